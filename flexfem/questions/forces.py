"""Forces and moments inside a mechanism under a load: through hinges and stated sections, with
strain and stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
import shapely

from flexfem.analytic.plates import respond
from flexfem.arrays import Array
from flexfem.fem.sections import hinge_wrenches, part_strains, section_wrench
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import extent, plate_polygon
from flexfem.questions import plates, setup
from flexfem.questions.bands import levels
from flexfem.questions.loads import AtPoints, required_load
from flexfem.questions.plates import ElasticParts, Thickened, Values
from flexfem.questions.setup import Models
from flexfem.refused import BadInput, printed
from flexfem.results import COARSE_MESHES, STRESS, Gate, Progress, Quantity, Result
from flexfem.units import UNITS, in_unit

INSIDE = 1e-6  # of the size of a plate: depth of an end of a section in the material, by round-off
RESULTANTS = ("axial", "shear", "moment")
NEARLY_EQUAL = Gate(1.0, absolute=1e4)  # of a place: another one may have nearly the same strain


class Forces(Result):
    """Forces and moments through sections of a mechanism under a load, and its highest strains and
    stresses.
    """

    title = "forces under the load"
    main_result = ("force", {})
    columns = ("resultant",)
    labels: ClassVar = {"resultant": RESULTANTS}
    footnotes = (
        "through a hinge: on its end at its second body, along its axis (tension is positive), "
        "across it, and the moment at its centre; the moment of a section at x along the axis is "
        "`moment - x shear`",
        "through a section from a first to a second point: on the material at the left, along "
        "the normal to the right (tension is positive), along the line, and the moment about its "
        "middle; by finite elements",
        "strain: largest magnitude of a principal strain in the plane, where stress is stated; "
        "the place is that of the strain",
    )
    load = Quantity("stated loads", "wrench", ("point", "direction"), detail=True)
    force = Quantity(
        "force and moment through hinges and sections",
        ("n", "n", "n_mm"),
        ("section", "model", "resultant"),
        COARSE_MESHES,
        "wrench",
    )
    strain = Quantity("highest strain", "percent", ("part", "model"), STRESS, "all")
    strain_x = Quantity("at x", "mm", ("part", "model"), NEARLY_EQUAL)
    strain_y = Quantity("at y", "mm", ("part", "model"), NEARLY_EQUAL)
    stress = Quantity("highest stress", "mpa", ("part", "model"), STRESS, "all")


@setup.question
def forces(
    mechanism: Mechanism,
    *,
    force: tuple[float, float, float] | None = None,
    force_at: AtPoints | None = None,
    section: Sequence[str] | Sequence[Sequence[float]] | None = None,
    models: Models = "both",
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> Forces:
    """Force and moment through the hinges and stated sections of a mechanism under a load, and its
    highest strains.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    force : tuple of float, optional
        Load on the output: N, N, N mm.
    force_at : mapping of str to tuple of float, or sequence of str, optional
        Loads at points by their names, N, N, N mm, besides that on the output: NAME=FX,FY,M,
        repeated.
    section : sequence of str or of four float, optional
        Sections of bodies, each by two points beside the body, mm: X1,Y1,X2,Y2, repeated.
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
    Forces
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        forces` lists it.

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
    >>> found = flexfem.forces(guide, force=(0.0, 10.0, 0.0), models="analytic")
    >>> round(float(found.at("force", section="leaf", model="analytic", resultant="axial")), 6)  # N
    5.0
    """
    layout = mechanism.layout
    stated = required_load(layout, force, force_at)
    ends = [_ends(layout, one) for one in _listed(section)]
    if ends and models == "analytic":
        raise BadInput("section with models 'analytic', expected models with finite elements")
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    loaded = Loaded(mechanism, stated.on_ports, ends)

    def by_network(elastic: bool) -> Values:
        return _by_network(loaded, elastic)

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        return _by_mesh(loaded, resolution, layers, thick)

    found = plates.by_models(mechanism, mesh, models, by_network, element_values, progress)
    warnings = list[str]()
    if mesh is not None:
        coarsest = plates.meshed(mechanism, levels(mesh.resolution)[0])
        warnings += plates.left_out_corners(layout, coarsest)
    return setup.answer(
        Forces,
        mechanism,
        found,
        mesh,
        {},
        {"load": stated.at_points},
        _axes(loaded),
        warnings=warnings,
    )


class Loaded(NamedTuple):
    """A mechanism under a load (k,) on its ports, and the ends of the sections."""

    mechanism: Mechanism
    load: Array
    sections: list[tuple[complex, complex]]


def _axes(loaded: Loaded) -> dict[str, list[str]]:
    """Return the names of hinges and sections, of parts that move, and of points."""
    layout = loaded.mechanism.layout
    hinges = [joint.name for joint in layout.joints]
    bodies = [body.name for body in layout.bodies if not body.fixed]
    return {
        "section": [*hinges, *(_named(ends) for ends in loaded.sections)],
        "part": [*hinges, *bodies],
        "point": [name for name, _ in layout.points],
    }


def _wrenches(loaded: Loaded, parts: ElasticParts) -> Array:
    """Return the wrenches (h, 3) through hinges by the network of bodies and hinges."""
    response = respond(loaded.mechanism.layout, parts.bodies, hinges=parts.hinges)
    return response.wrenches @ loaded.load


def _by_network(loaded: Loaded, elastic: bool) -> Values:
    """Return wrenches and stress of the hinges by the network of bodies and hinges."""
    wrenches = _wrenches(loaded, plates.joined_parts(loaded.mechanism, elastic))
    return {
        "force": wrenches,
        "stress": plates.stress_by(loaded.mechanism, wrenches, elastic),
    }


def _by_mesh(
    loaded: Loaded,
    resolution: int,
    layers: int,
    thick: Thickened | None,
) -> Values:
    """Return wrenches, strains and stress by finite elements, with the thickness of hinges if
    given.
    """
    mechanism, load, sections = loaded
    layout = mechanism.layout
    response = plates.solved(mechanism, resolution, layers)
    field = np.tensordot(load, response.nodal, axes=1)
    wrenches = hinge_wrenches(response, layout, field)
    through = [section_wrench(response, field, *ends) for ends in sections]
    strains = part_strains(response, layout, load)
    highest = strains.highest
    if thick is not None:
        wrenches = wrenches + thick.change(partial(_wrenches, loaded))
        of_bodies = np.full(len(response.bodies), thick.of_bodies)
        highest = highest * np.concatenate([thick.strain_ratios(wrenches), of_bodies])
    by_loads = plates.elements(mechanism, resolution, layers, thick)
    assert by_loads.bodies is not None
    return {
        "force": np.concatenate([wrenches, np.reshape(through, (-1, 3))]),
        "strain": 100 * highest,
        "strain_x": strains.place[:, 0],
        "strain_y": strains.place[:, 1],
        "stress": np.concatenate([by_loads.stress(load), by_loads.bodies(load).highest]),
    }


def _listed(
    section: Sequence[str] | Sequence[Sequence[float]] | None,
) -> list[str | Sequence[float]]:
    """Return sections of which one may be stated alone."""
    if isinstance(section, str):
        return [section]
    return list(section or ())


def _named(pair: tuple[complex, complex]) -> str:
    start, end = pair
    return f"({start.real:g}, {start.imag:g}) to ({end.real:g}, {end.imag:g})"


def _ends(layout: Layout, stated: str | Sequence[float]) -> tuple[complex, complex]:
    """Return the ends of a section, mm. Raises BadInput unless it crosses a part that moves, its
    ends outside.
    """
    start, end = _points(stated)
    plate = plate_polygon(layout)
    inside = plate.buffer(-INSIDE * extent(plate))
    line = shapely.LineString([(at.real, at.imag) for at in (start, end)])
    if not inside.intersects(line):
        raise BadInput(f"section {printed(stated)}, expected a line across a body")
    for at in (start, end):
        if inside.contains(shapely.Point(at.real, at.imag)):
            raise BadInput(
                f"section {printed(stated)}, expected both points beside the body, not "
                f"({at.real:g}, {at.imag:g}) in it"
            )
    return start, end


def _points(stated: str | Sequence[float]) -> tuple[complex, complex]:
    """Return two different points, mm, of a text X1,Y1,X2,Y2 or four numbers. Raises BadInput."""
    numbers = stated.split(",") if isinstance(stated, str) else [str(one) for one in stated]
    refusal = BadInput(f"section {printed(stated)}, expected X1,Y1,X2,Y2: two different points, mm")
    try:
        x1, y1, x2, y2 = (in_unit(one.strip(), UNITS["mm"]) for one in numbers)
    except ValueError:
        raise refusal from None
    if not np.all(np.isfinite([x1, y1, x2, y2])) or (x1, y1) == (x2, y2):
        raise refusal
    return complex(x1, y1), complex(x2, y2)
