"""Forces and moments inside a mechanism under a load: through hinges and stated sections, with
strain and stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import shapely

from flexfem.analytic.plates import respond
from flexfem.arrays import Array
from flexfem.fem.sections import hinge_wrenches, part_strains, section_wrench
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import extent, plate_polygon
from flexfem.paper.stage import Stage
from flexfem.questions import plates, setup
from flexfem.questions.bands import levels
from flexfem.questions.loads import AtPoints, required_load
from flexfem.questions.plates import Values
from flexfem.questions.setup import Models
from flexfem.refused import BadInput, printed
from flexfem.results import COARSER, STRESS, Gate, Progress, Quantity, Result
from flexfem.units import UNITS, in_unit

INSIDE = 1e-6  # of the size of a plate: depth of an end of a section in the material, by round-off
RESULTANTS = ("axial", "shear", "moment")
NEARLY_EQUAL = Gate(1.0, absolute=1e4)  # of a place: another one may have nearly the same strain


class Forces(Result):
    """Forces and moments through sections of a mechanism under a load, and its highest strains and
    stresses.
    """

    title = "forces under the load"
    main = ("force", {})
    columns = ("resultant",)
    labels: ClassVar = {"resultant": RESULTANTS}
    reading = (
        "through a hinge: on its end at its second body, along its axis (tension is positive), "
        "across it, and the moment at its centre; the moment of a section at x along the axis is "
        "`moment - x shear`",
        "through a section from a first to a second point: on the material at the left, along "
        "the normal to the right (tension is positive), along the line, and the moment about its "
        "middle; by finite elements",
        "strain: largest magnitude of a principal strain in the plane, where stress is stated; "
        "the place is that of the strain",
    )
    load = Quantity("stated loads", "wrench", ("point", "direction"))
    force = Quantity(
        "force and moment through",
        ("n", "n", "n_mm"),
        ("section", "model", "resultant"),
        COARSER,
        "wrench",
    )
    strain = Quantity("highest strain", "percent", ("part", "model"), STRESS, "all")
    strain_x = Quantity("at x", "mm", ("part", "model"), NEARLY_EQUAL)
    strain_y = Quantity("at y", "mm", ("part", "model"), NEARLY_EQUAL)
    stress = Quantity("highest stress", "mpa", ("part", "model"), STRESS, "all")


@setup.question
def forces(
    stage: Mechanism,
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
    >>> found = flexfem.forces(flexfem.load("geometry/parallelogram.toml"), force=(0.0, 10.0, 0.0), models="analytic")
    >>> round(float(found.at("force", section="leaf", model="analytic", resultant="axial")), 6)  # N
    5.0
    """
    if isinstance(stage, Stage):
        raise BadInput(
            f"{stage.origin}: forces is for a mechanism, expected one; stiffness has the stress "
            "of necks"
        )
    layout = stage.layout
    stated = required_load(layout, force, force_at)
    load = stated.on_ports
    ends = [_ends(layout, one) for one in _listed(section)]
    if ends and models == "analytic":
        raise BadInput("section with models 'analytic', expected models with finite elements")
    mesh = plates.mesh_of(
        stage, models, resolution, setup.elements_through(solid, thickness_resolution)
    )

    def wrenches_of(parts: plates.ElasticParts) -> Array:
        return respond(layout, parts.bodies, hinges=parts.hinges).wrenches @ load

    def of_network(elastic: bool) -> Values:
        wrenches = wrenches_of(plates.joined_parts(stage, elastic))
        stress = plates.stress_by(stage, wrenches, elastic)
        return {"force": wrenches, "stress": stress}

    def of_size(resolution: int, layers: int, thick: plates.Thickened | None = None) -> Values:
        response = plates.solved(stage, resolution, layers)
        field = np.tensordot(load, response.nodal, axes=1)
        wrenches = hinge_wrenches(response, layout, field)
        through = [section_wrench(response, field, *pair) for pair in ends]
        strains = part_strains(response, layout, load)
        highest = strains.highest
        if thick is not None:
            wrenches = wrenches + thick.change(wrenches_of)
            of_parts = [
                thick.strain_ratios(wrenches),
                np.full(len(response.bodies), thick.of_bodies),
            ]
            highest = highest * np.concatenate(of_parts)
        by_loads = plates.elements(stage, resolution, layers, thick)
        assert by_loads.bodies is not None
        return {
            "force": np.concatenate([wrenches, np.reshape(through, (-1, 3))]),
            "strain": 100 * highest,
            "strain_x": strains.place[:, 0],
            "strain_y": strains.place[:, 1],
            "stress": np.concatenate([by_loads.stress(load), by_loads.bodies(load).highest]),
        }

    found = plates.by_models(stage, mesh, models, of_network, of_size, progress)
    names = [joint.name for joint in layout.joints]
    axes = {
        "section": [*names, *(_named(pair) for pair in ends)],
        "part": [*names, *(body.name for body in layout.bodies if not body.fixed)],
        "point": [name for name, _ in layout.points],
    }
    warnings = list[str]()
    if mesh is not None:
        warnings += plates.left_out_corners(
            layout, plates.meshed(stage, levels(mesh.resolution)[0])
        )
    return setup.answer(
        Forces, stage, found, mesh, {}, {"load": stated.at_points}, axes, warnings=warnings
    )


def _listed(
    section: Sequence[str] | Sequence[Sequence[float]] | None,
) -> list[str | Sequence[float]]:
    """Return sections of which one may be stated alone."""
    return [section] if isinstance(section, str) else list(section or ())


def _named(pair: tuple[complex, complex]) -> str:
    start, end = pair
    return f"({start.real:g}, {start.imag:g}) to ({end.real:g}, {end.imag:g})"


def _ends(layout: Layout, stated: str | Sequence[float]) -> tuple[complex, complex]:
    """Return the ends of a section, mm. Raises BadInput unless it crosses a part that moves, its
    ends outside.
    """
    numbers = list(stated.split(",")) if isinstance(stated, str) else list(map(str, stated))
    expected = "expected X1,Y1,X2,Y2: two different points, mm"
    try:
        x1, y1, x2, y2 = (in_unit(str(one).strip(), UNITS["mm"]) for one in numbers)
    except ValueError:
        raise BadInput(f"section {printed(stated)}, {expected}") from None
    if not np.all(np.isfinite([x1, y1, x2, y2])) or (x1, y1) == (x2, y2):
        raise BadInput(f"section {printed(stated)}, {expected}")
    plate = plate_polygon(layout)
    inside = plate.buffer(-INSIDE * extent(plate))
    if not inside.intersects(shapely.LineString([(x1, y1), (x2, y2)])):
        raise BadInput(f"section {printed(stated)}, expected a line across a body")
    for x, y in ((x1, y1), (x2, y2)):
        if inside.contains(shapely.Point(x, y)):
            raise BadInput(
                f"section {printed(stated)}, expected both points beside the body, not ({x:g}, "
                f"{y:g}) in it"
            )
    return complex(x1, y1), complex(x2, y2)
