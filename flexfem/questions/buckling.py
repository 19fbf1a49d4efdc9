"""Multiples of a stated load at which a plate buckles, by beams and by finite elements, in the
plane and out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import FinitePlate, load_factors
from flexfem.arrays import Array
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import PlateModel, plate_model
from flexfem.fem.prestress import critical_shapes, lifted, prestress_by
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates, setup
from flexfem.questions.bands import SAFETY
from flexfem.questions.loads import AtPoints, held_ports, required_load
from flexfem.questions.plates import (
    LIFTED_LAYERS,
    LIFTED_RESOLUTION,
    Thickened,
    Values,
    lifted_mesh_error,
)
from flexfem.questions.setup import MeshFields, ModelAnswer, Models
from flexfem.results import ANALYTIC, COARSE_MESHES, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

MOST = 20  # factors
AT_REST = (
    "the load factor multiplies the whole load; displacements before buckling are neglected, as "
    "by Euler: a mechanism that moves far under the load, or that bends more and more, has its "
    "limit in `large`"
)
NOT_IN_PLANE = (
    "no buckling in the plane under a positive multiple of this load before strains are large"
)
OUT_OF_PLANE_FIRST = (
    "it buckles first out of the plane: `factor_out_of_plane` is the lowest load factor"
)
BEAMS_ONLY = "the analytic model has rigid bodies and hinges as beams"


class Buckling(Result):
    """Load factors at which a plate buckles under a stated load, lowest first."""

    title = "buckling"
    has_mesh_fields = True
    main_result = ("factor", {})
    columns = ("model",)
    footnotes = (AT_REST, BEAMS_ONLY)
    factor = Quantity("load factor of buckling", "", ("factor", "model"), COARSE_MESHES)
    factor_out_of_plane = Quantity(
        "load factor of buckling out of the plane", "", gate=COARSE_MESHES
    )
    load = Quantity("stated loads", "wrench", ("point", "direction"))
    critical = Quantity(
        "loads at which it buckles first", "wrench", ("point", "direction"), COARSE_MESHES, "wrench"
    )


@setup.question
def buckling(
    mechanism: Mechanism,
    *,
    force: tuple[float, float, float] | None = None,
    force_at: AtPoints | None = None,
    hold: Sequence[str] | None = None,
    count: int = 3,
    models: Models = "both",
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Buckling:
    """Load factors at which a mechanism buckles under a stated load.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    force : tuple of float, optional
        Load on the output: N, N, N mm.
    force_at : mapping of str to tuple of float, or sequence of str, optional
        Loads at points by their names, N, N, N mm, besides that on the output: NAME=FX,FY,M,
        repeated. Two opposite loads at two points are a pair between their bodies.
    hold : sequence of str, optional
        Directions of the output that are held at zero: x, y or theta, repeated.
    count : int
        Number of load factors, from the lowest.
    models : {"both", "analytic", "elements"}
        The models to compute.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    solid : bool
        The whole plate by finite elements in three dimensions.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Buckling
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        buckling` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> guide = flexfem.load("geometry/parallelogram.toml")
    >>> found = flexfem.buckling(guide, force=(0.0, -100.0, 0.0), count=1, models="analytic")
    >>> round(float(found.factor[0, 0]), 4)
    0.6013
    """
    stated = required_load(mechanism.layout, force, force_at)
    count = arguments.integer("count", count, MOST)
    held = held_ports(hold)
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    loaded = Compressed(mechanism, stated.on_ports, held, count)
    shapes = list[MeshFields]()  # of the last, which is the finest mesh

    @cache
    def by_mesh(resolution: int, layers: int) -> Array:
        model = _factorised(mechanism, resolution, layers)
        change = prestress_by(model, loaded.load, held)
        found = critical_shapes(model, change, held, count)
        shapes.append(_fields(model, found.shapes))
        return _all_of(found.factors, count)

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        factors = by_mesh(resolution, layers)
        return {"factor": factors if thick is None else factors * _ratios(loaded, thick)}

    found = dict[str, ModelAnswer]()
    if models != "elements" and mechanism.layout.joints:
        factors = _by_beams(loaded, None)
        found[ANALYTIC] = ModelAnswer({"factor": np.where(np.isfinite(factors), factors, np.nan)})
    if mesh is not None:
        thickness = () if mesh.layers else plates.thickness_of(mechanism)
        found |= plates.element_values(mesh, element_values, progress, thickness=thickness)
    first = _first(list(found.values())[-1], stated.at_points)
    if mesh is not None and mechanism.model == "three_dimensional":
        first = _with_out_of_plane(first, loaded)
    return setup.answer(
        Buckling,
        mechanism,
        found,
        mesh,
        {"output held in": ", ".join(DIRECTIONS[port] for port in held) or None},
        {"load": stated.at_points, **first.values},
        {"factor": [str(number) for number in range(1, count + 1)]},
        bands=first.bands,
        warnings=first.warnings,
        fields=shapes[-1] if shapes else None,
    )


class Compressed(NamedTuple):
    """A mechanism under a load (k,) with held ports, and the number of load factors."""

    mechanism: Mechanism
    load: Array
    held: tuple[int, ...]
    most: int


class First(NamedTuple):
    """Values and bands of the first buckling by quantity, its load factor, and warnings."""

    factor: float
    values: dict[str, Any]
    bands: dict[str, Any]
    warnings: list[str]


def _by_beams(loaded: Compressed, hinges: Array | None) -> Array:
    """Return load factors with rigid bodies and hinges as beams of compliances (h, 3, 3)."""
    plate = FinitePlate(loaded.mechanism.layout, hinges)
    return load_factors(plate, loaded.load, loaded.held, loaded.most)


def _ratios(loaded: Compressed, thick: Thickened) -> Array:
    """Return the ratios of load factors by the thickness of hinges."""
    ratios = _by_beams(loaded, thick.solid.hinges) / _by_beams(loaded, thick.plane.hinges)
    return np.where(np.isfinite(ratios), ratios, 1.0)


def _first(last: ModelAnswer, at_points: Array) -> First:
    """Return the loads (points, 3) at which a mechanism buckles first in the plane."""
    factor = float(last.values["factor"][0])
    bands = dict[str, Any]()
    if "factor" in last.bands:
        bands["critical"] = last.bands["factor"][0] * np.abs(at_points)
    warnings = [NOT_IN_PLANE] if np.isnan(factor) else []
    return First(factor, {"critical": factor * at_points}, bands, warnings)


def _with_out_of_plane(first: First, loaded: Compressed) -> First:
    """Return the first buckling with the load factor out of the plane."""
    name = "factor_out_of_plane"
    factor, band = _out_of_plane(loaded)
    warnings = list(first.warnings)
    if factor < np.nan_to_num(first.factor, nan=np.inf):
        warnings.append(OUT_OF_PLANE_FIRST)
    return First(
        first.factor, {**first.values, name: factor}, {**first.bands, name: band}, warnings
    )


def _factorised(
    mechanism: Mechanism,
    resolution: int,
    layers: int,
) -> PlateModel:
    """Factorise the finite elements of a mechanism; they are not kept."""
    layout = mechanism.layout
    mesh = mesh_layout(layout, resolution)
    return plate_model(layout, mesh, plates.layers_of(mechanism, layers))


def _all_of(factors: Array, count: int) -> Array:
    """Return factors (count,), nan beyond those that were found."""
    found = np.full(count, np.nan)
    found[: len(factors)] = factors
    return found


def _fields(model: PlateModel, shapes: Array) -> MeshFields:
    """Return the shapes (size, s) in which a plate buckles, with a largest displacement of 1 mm."""
    structure = model.structure

    def made() -> dict[str, Array]:
        fields = structure.fields(shapes)
        return {
            f"factor {number}": field / np.abs(field).max()
            for number, field in enumerate(fields, start=1)
        }

    heights = structure.layers.heights if structure.layers else None
    return MeshFields(structure.mesh, made, heights)


def _out_of_plane(loaded: Compressed) -> tuple[float, float]:
    """Return the least load factor out of the plane, in which the held directions do not take part,
    and its band.
    """
    mechanism, load, held, _ = loaded
    layout = mechanism.layout
    mesh = mesh_layout(layout, LIFTED_RESOLUTION)
    found = list[float]()
    for number in LIFTED_LAYERS:
        layers = plates.layers_of(mechanism, number)
        assert layers is not None
        change = prestress_by(plate_model(layout, mesh, layers), load, held)
        model = plate_model(layout, mesh, layers.antisymmetric)
        factors = critical_shapes(model, lifted(change, model, load), (), 1).factors
        found.append(float(_all_of(factors, 1)[0]))
    few, many = found
    return many, SAFETY * abs(many - few) + 2 * lifted_mesh_error(layout) * abs(many)
