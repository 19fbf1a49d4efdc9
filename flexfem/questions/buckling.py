"""Multiples of a stated load at which a plate buckles, by beams and by finite elements, in the
plane and out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import FinitePlate, load_factors
from flexfem.arrays import Array
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import PlateModel, plate_model
from flexfem.fem.prestress import critical_shapes, lifted, prestress_by
from flexfem.mechanism.mechanism import Mechanism
from flexfem.paper.stage import Stage
from flexfem.questions import plates, setup
from flexfem.questions.bands import SAFETY
from flexfem.questions.loads import AtPoints, held_ports, required_load
from flexfem.questions.plates import LIFTED_LAYERS, LIFTED_RESOLUTION, Values, lifted_mesh_error
from flexfem.questions.setup import MeshFields, ModelAnswer, Models
from flexfem.results import ANALYTIC, COARSER, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

MOST = 20  # factors
AT_REST = (
    "the load factor multiplies the whole load; displacements before buckling are neglected, as "
    "by Euler: a mechanism that moves far under the load, or that bends more and more, has its "
    "limit in `large`"
)
BEAMS_ONLY = "the analytic model has rigid bodies and hinges as beams"


class Buckling(Result):
    """Load factors at which a plate buckles under a stated load, lowest first."""

    title = "buckling"
    main = ("factor", {})
    columns = ("model",)
    reading = (AT_REST, BEAMS_ONLY)
    factor = Quantity("load factor of buckling", "", ("factor", "model"), COARSER)
    factor_out_of_plane = Quantity("load factor of buckling out of the plane", "", gate=COARSER)
    load = Quantity("stated loads", "wrench", ("point", "direction"))
    critical = Quantity(
        "loads at which it buckles first", "wrench", ("point", "direction"), COARSER, "wrench"
    )


@setup.options(only_for="plane")
def buckling(
    stage: Mechanism,
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
    """Load factors at which a stage or mechanism buckles under a stated load.

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
    layout = stage.layout
    stated = required_load(layout, force, force_at)
    count = arguments.integer("count", count, MOST)
    held = held_ports(hold)
    mesh = plates.mesh_of(
        stage, models, resolution, setup.elements_through(solid, thickness_resolution)
    )
    shapes = list[MeshFields]()

    def of_beams(hinges: Array | None) -> Array:
        return load_factors(FinitePlate(layout, hinges), stated.on_ports, held, count)

    @cache
    def by_mesh(resolution: int, layers: int) -> Array:
        model = _factorised(stage, resolution, layers)
        found = critical_shapes(model, prestress_by(model, stated.on_ports, held), held, count)
        shapes.append(_fields(model, found.shapes))
        return _all_of(found.factors, count)

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        factors = by_mesh(resolution, layers)
        if thick is not None:
            ratios = of_beams(thick.solid.hinges) / of_beams(thick.plane.hinges)
            factors = factors * np.where(np.isfinite(ratios), ratios, 1.0)
        return {"factor": factors}

    found = dict[str, ModelAnswer]()
    if models != "elements" and layout.joints:
        factors = of_beams(None)
        found[ANALYTIC] = ModelAnswer({"factor": np.where(np.isfinite(factors), factors, np.nan)})
    if mesh is not None:
        thickness = () if mesh.layers or isinstance(stage, Stage) else plates.thickness_of(stage)
        found |= plates.by_elements(mesh, of_size, progress, thickness=thickness)
    *_, last = found.values()
    first = last.values["factor"][0]
    values = {"load": stated.at_points, "critical": first * stated.at_points}
    bands = dict[str, Any]()
    if "factor" in last.bands:
        bands["critical"] = last.bands["factor"][0] * np.abs(stated.at_points)
    warnings = list[str]()
    if np.isnan(first):
        text = (
            "no buckling in the plane under a positive multiple of this load before strains are "
            "large"
        )
        warnings.append(text)
    if mesh is not None and stage.model == "three_dimensional":
        values["factor_out_of_plane"], bands["factor_out_of_plane"] = _out_of_plane(
            stage, stated.on_ports, held
        )
        if values["factor_out_of_plane"] < np.nan_to_num(first, nan=np.inf):
            warnings.append(
                "it buckles first out of the plane: `factor_out_of_plane` is the lowest load factor"
            )
    settings = {"output held in": ", ".join(DIRECTIONS[port] for port in held) or None}
    axes = {
        "factor": [str(number + 1) for number in range(count)],
        "point": [name for name, _ in layout.points],
    }
    fields = shapes[-1] if shapes else None
    return setup.answer(
        Buckling,
        stage,
        found,
        mesh,
        settings,
        values,
        axes,
        bands=bands,
        warnings=warnings,
        fields=fields,
    )


def _factorised(stage: Mechanism, resolution: int, layers: int) -> PlateModel:
    """Factorise the finite elements of a plate, of a stage as of any other mechanism."""
    return plate_model(
        stage.layout, mesh_layout(stage.layout, resolution), plates.layers_of(stage, layers)
    )


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

    return MeshFields(structure.mesh, made, structure.layers.heights if structure.layers else None)


def _out_of_plane(stage: Mechanism, load: Array, held: tuple[int, ...]) -> tuple[float, float]:
    """Return the least load factor out of the plane, in which the held directions do not take part,
    and its band.
    """
    mesh = mesh_layout(stage.layout, LIFTED_RESOLUTION)
    found = list[float]()
    for number in LIFTED_LAYERS:
        layers = plates.layers_of(stage, number)
        assert layers is not None
        change = prestress_by(plate_model(stage.layout, mesh, layers), load, held)
        model = plate_model(stage.layout, mesh, layers.antisymmetric)
        factors = critical_shapes(model, lifted(change, model, load), (), 1).factors
        found.append(float(_all_of(factors, 1)[0]))
    few, many = found
    return many, SAFETY * abs(many - few) + 2 * lifted_mesh_error(stage.layout) * abs(many)
