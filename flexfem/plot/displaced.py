"""Displaced outlines of a mechanism with their numbers: modes, strokes, weight and heat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.fem.mesh import PlaneMesh
from flexfem.plot import style
from flexfem.plot.drawing import fit
from flexfem.plot.fields import VISIBLE, draw_field, draw_scale, exaggeration
from flexfem.plot.style import NAMES, panels, wrapped
from flexfem.plot.text import minus, significant
from flexfem.questions.drive import Drive
from flexfem.questions.gravity import MechanismGravity
from flexfem.questions.heat import CASES, MechanismDrift
from flexfem.questions.modes import MechanismModes
from flexfem.questions.setup import MeshFields
from flexfem.results import SPACE, Fields, Result

SHARE = Normalize(0, 1)
COLUMNS = 3  # panels per row
PANEL = 3.9  # in, width
WIDE_PANEL = 6.4  # in, width of the only panel
NARROWEST = 7.4  # in, of a page
LINE = 0.16  # in, height of a line of a title
FLATTEST = 0.3  # height over width of a drawing, at least
TALLEST = 1.2
TITLE_SIZE = 9.5  # points
BOTH_SENSES = (1.0, -1.0)
CONVENTION = "Displacements are exaggerated; grey: at rest."
WARM = {
    "uniform": "1 K everywhere",
    "gradient in x": "1 K/mm along x",
    "gradient in y": "1 K/mm along y",
}


class Shape(NamedTuple):
    """A displaced outline: the lines of its title, and its field (n, 2), mm."""

    title: Sequence[str]
    field: Array


@style.in_house_style
def modes_figure(found: MechanismModes) -> Figure:
    """Draw the natural modes, each with its frequency and the motion of the output."""
    fields = _fields(found).made()
    model = found.axes["model"][-1]
    shapes = list[Shape]()
    # the last rows may be modes of analytic models alone
    for mode, field in zip(found.axes["mode"], fields.values(), strict=False):
        frequency = found.texts("frequency", mode=mode, model=model)[0]
        shapes.append(Shape([f"mode {mode}: {frequency}", _moving(found, mode)], field))
    lines = [
        f"Frequencies: {model}. Shapes: plane finite elements, each with its own factor; grey: at "
        "rest. Output: share of each direction in the square of its motion, rotations times the "
        "lever."
    ]
    return _drawn(found, "natural modes", lines, shapes, BOTH_SENSES)


def _moving(found: MechanismModes, mode: str) -> str:
    """Return the main directions of the output in a mode."""
    shares = found.at("share", mode=mode)
    if np.isnan(shares).any():
        return "the output hardly moves"
    named = [
        f"{share:.0f}{SPACE}% in {name}"
        for name, share in zip(NAMES.values(), shares.tolist(), strict=True)
        if share >= 1
    ]
    return f"output: {', '.join(named)}"


@style.in_house_style
def drive_figure(found: Drive) -> Figure:
    """Draw the mechanism at the full stroke of each actuator, with motion, force and stress."""
    fields = _fields(found).made()
    model = found.axes["model"][-1]
    output = found.axes["point"][0]
    shapes = list[Shape]()
    for name, field in fields.items():
        at = {"actuator": name, "model": model}
        used = found.texts("used", **at)[0]
        force = found.texts("force", **at)[0]
        title = [
            f"full stroke of {name}",
            _pose(found.texts("motion", point=output, **at)),
            f"opening {used} of the stroke",
            f"force {force}",
            f"highest hinge stress {found.texts('stress', **at)[0]}",
        ]
        shapes.append(Shape(title, field))
    lines = [
        f"Motion of the output for the full free stroke of one actuator, all in place: {model}. "
        f"Shapes: plane finite elements at small displacements, each with its own factor. "
        f"{CONVENTION}"
    ]
    return _drawn(found, "motion by the actuators", lines, shapes)


@style.in_house_style
def gravity_figure(found: MechanismGravity) -> Figure:
    """Draw the mechanism under its weight, with the displacement of every point."""
    field = _fields(found).made()["displacement"]
    model = found.axes["model"][-1]
    title = [
        f"{point}: {_pose(found.texts('pose', model=model, point=point))}"
        for point in found.axes["point"]
    ]
    title.append(f"highest hinge stress {found.texts('stress', model=model)[0]}")
    lines = [
        f"Upright plate, gravity {minus(found.settings['gravity'])} from x; numbers: {model}. "
        f"Shape: plane finite elements. {CONVENTION}"
    ]
    return _drawn(found, "displacement by weight", lines, [Shape(title, field)])


@style.in_house_style
def drift_figure(found: MechanismDrift) -> Figure:
    """Draw the mechanism displaced by heat, in every case with the motion of the output."""
    fields = _fields(found).made()
    model = found.axes["model"][-1]
    output = found.axes["point"][0]
    shapes = list[Shape]()
    for case in CASES:
        at = {"case": case, "model": model}
        title = [
            WARM[case],
            _pose(found.texts("pose", point=output, **at)),
            f"highest hinge stress {found.texts('stress', **at)[0]}",
        ]
        shapes.append(Shape(title, fields[case]))
    lines = [
        f"Motion of the output per K or K/mm, about the origin: {model}. Shapes: plane finite "
        f"elements, each with its own factor. {CONVENTION}"
    ]
    return _drawn(found, "drift by temperature", lines, shapes)


def _pose(cells: Sequence[str]) -> str:
    """Return a motion by its cells along x, y and theta."""
    parts = [f"{name} {cell}" for name, cell in zip(NAMES.values(), cells, strict=True)]
    return minus(", ".join(parts))


def _fields(found: Result) -> MeshFields:
    assert isinstance(found.fields, MeshFields)
    return found.fields


def _drawn(
    found: Result,
    subject: str,
    lines: Sequence[str],
    shapes: Sequence[Shape],
    signs: tuple[float, ...] = (1.0,),
) -> Figure:
    """Draw shapes, coloured by their displacement, each with its own exaggeration.

    signs : of the displacements that must not cross.
    """
    mesh = _fields(found).mesh
    grid = _Grid.of(len(shapes))
    drawn = [_placed(mesh, shape, signs, grid.width) for shape in shapes]
    everywhere = np.concatenate([mesh.nodes, *(panel.places for panel in drawn)])
    title = f"{found.about.name}: {subject}"
    size = grid.size(everywhere, [panel.title for panel in drawn])
    figure, axes = panels(size, title, lines, grid.rows, grid.columns, found.about, len(shapes))
    for ax, panel in zip(axes, drawn, strict=True):
        draw_field(ax, mesh.nodes, mesh.triangles, panel.places, panel.values, SHARE)
        fit(ax, everywhere, VISIBLE / 2)
        ax.set_title(panel.title, size=TITLE_SIZE)
    draw_scale(figure, figure.axes, SHARE, "displacement / largest of the drawing")
    return figure


class _Panel(NamedTuple):
    """A drawn shape: title, displaced nodes (n, 2), mm, and displacements (n,) over the largest."""

    title: str
    places: Array
    values: Array


def _placed(mesh: PlaneMesh, shape: Shape, signs: tuple[float, ...], width: float) -> _Panel:
    """Return a shape with its own exaggeration, for a panel of a width."""
    factor = _factor(mesh, shape, signs)
    sizes = np.linalg.norm(shape.field, axis=1)
    return _Panel(
        _title(shape, factor, signs, width),
        mesh.nodes + factor * shape.field,
        sizes / (sizes.max() or 1.0),
    )


class _Grid(NamedTuple):
    """Rows and columns of panels, and the width of one, inches."""

    rows: int
    columns: int
    width: float

    @classmethod
    def of(cls, panels: int) -> _Grid:
        columns = min(COLUMNS, panels)
        return cls(-(-panels // columns), columns, PANEL if columns > 1 else WIDE_PANEL)

    def size(self, everywhere: Array, titles: Sequence[str]) -> tuple[float, float]:
        """Return the size of a figure, inches, whose panels show all places (n, 2)."""
        wide, high = np.ptp(everywhere, axis=0)
        height = float(np.clip(high / wide, FLATTEST, TALLEST)) * self.width
        height += LINE * (2 + max(title.count("\n") + 1 for title in titles))
        return max(self.columns * self.width + 0.3, NARROWEST), self.rows * height + 0.8


def _factor(
    mesh: PlaneMesh,
    shape: Shape,
    signs: tuple[float, ...],
) -> float:
    """Return the exaggeration of a shape."""
    plane = Fields(mesh.nodes, mesh.triangles, mesh.bodies, shape.field, shape.field[:, 0])
    return exaggeration(plane, signs=signs)


def _title(
    shape: Shape,
    factor: float,
    signs: tuple[float, ...],
    width: float,
) -> str:
    """Return the title of a panel; the factor of a mode, whose size is arbitrary, is left out."""
    lines = [*shape.title]
    if signs != BOTH_SENSES:
        lines.append(f"drawn × {significant(factor, 1)}")
    return "\n".join(wrapped(line, width - 0.2, TITLE_SIZE) for line in lines)
