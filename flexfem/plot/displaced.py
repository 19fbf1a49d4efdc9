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
from flexfem.plot.fields import VISIBLE, draw_displaced, draw_scale, exaggeration
from flexfem.plot.style import NAMES, VISIBLE_BAND, panels, wrapped
from flexfem.plot.text import minus, sentence, significant, typeset
from flexfem.questions.drive import Drive
from flexfem.questions.gravity import MechanismGravity
from flexfem.questions.heat import CASES, MechanismDrift
from flexfem.questions.modes import MechanismModes
from flexfem.questions.setup import MeshFields
from flexfem.results import SPACE, Fields, Result

SHARE = Normalize(0, 1)
COLUMNS = 2  # panels per row
PANEL = 3.9  # in, width
WIDE_PANEL = 6.4  # in, width of the only panel
NARROWEST = 6.7  # in, of a page
LINE = 0.16  # in, height of a line of a title
FLATTEST = 0.3  # height over width of a drawing, at least
TALLEST = 1.2
TITLE_SIZE = 9.5  # points
BOTH_SENSES = (1.0, -1.0)
GREY = "Grey: at rest, and fixed parts"
WARM = {
    "uniform": "1 K everywhere",
    "gradient in x": "1 K/mm along x",
    "gradient in y": "1 K/mm along y",
}


class Shape(NamedTuple):
    """A displaced outline: its name, lines of numbers, and its field (n, 2), mm."""

    name: str
    numbers: Sequence[str]
    field: Array

    def lines(self, factor: float, signs: tuple[float, ...]) -> list[str]:
        """Return name, numbers and factor; that of a mode, whose size is arbitrary, is left out."""
        drawn = "" if signs == BOTH_SENSES else f"displacements × {significant(factor, 1)}"
        return [text for text in (self.name, *self.numbers, drawn) if text]


@style.in_house_style
def modes_figure(found: MechanismModes) -> Figure:
    """Draw the natural modes, each with its frequency and the motion of the output."""
    fields = _fields(found).made()
    model = found.axes["model"][-1]
    shapes = list[Shape]()
    for name, field in fields.items():
        mode = found.axes["mode"][int(name.removeprefix("mode ")) - 1]
        frequency = _texts(found, "frequency", mode=mode, model=model)[0]
        shapes.append(Shape(f"mode {mode}: {frequency}", [_moving(found, mode)], field))
    lines = [
        f"Frequencies: {model}. Shapes: finite elements in the plane, each with its own factor. "
        f"{GREY}. Output: share of each direction in the square of its motion, rotations times "
        "the lever."
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
        numbers = [
            _pose(_texts(found, "motion", point=output, **at)),
            f"opening {_texts(found, 'used', **at)[0]} of the stroke, "
            f"force {_texts(found, 'force', **at)[0]}",
            f"highest hinge stress {_texts(found, 'stress', **at)[0]}",
        ]
        shapes.append(Shape(f"full stroke of {name}", numbers, field))
    lines = [
        f"Motion of the output for the full free stroke of one actuator, all in place: {model}. "
        f"Shapes: plane finite elements at small displacements. {GREY}."
    ]
    return _drawn(found, "motion by the actuators", lines, shapes)


@style.in_house_style
def gravity_figure(found: MechanismGravity) -> Figure:
    """Draw the mechanism under its weight, with the displacement of every point."""
    field = _fields(found).made()["displacement"]
    model = found.axes["model"][-1]
    numbers = [
        f"{point}: {_pose(_texts(found, 'pose', model=model, point=point))}"
        for point in found.axes["point"]
    ]
    numbers.append(f"highest hinge stress {_texts(found, 'stress', model=model)[0]}")
    lines = [
        f"Upright plate, gravity {minus(found.settings['gravity'])} from x; numbers: {model}. "
        f"Shape: plane finite elements. {GREY}."
    ]
    return _drawn(found, "displacement by weight", lines, [Shape("", numbers, field)])


@style.in_house_style
def drift_figure(found: MechanismDrift) -> Figure:
    """Draw the mechanism displaced by heat, in every case with the motion of the output."""
    fields = _fields(found).made()
    model = found.axes["model"][-1]
    output = found.axes["point"][0]
    shapes = list[Shape]()
    is_stressed = bool(np.any(found.at("stress", model=model)))
    for case in CASES:
        at = {"case": case, "model": model}
        numbers = [_pose(_texts(found, "pose", point=output, **at))]
        if is_stressed:
            numbers.append(f"highest hinge stress {_texts(found, 'stress', **at)[0]}")
        shapes.append(Shape(WARM[case], numbers, fields[case]))
    without = "" if is_stressed else " No case causes stress in the hinges."
    lines = [
        f"Motion of the output per K or K/mm, about the origin: {model}.{without} Shapes: plane "
        f"finite elements, each with its own factor. {GREY}."
    ]
    return _drawn(found, "drift by temperature", lines, shapes)


def _texts(found: Result, quantity: str, **labels: str) -> list[str]:
    """Return cells of a table as figures have them, without bands that are too small to matter."""
    cells = found.visible_texts(quantity, VISIBLE_BAND, **labels)
    return [typeset(cell) for cell in cells]


def _pose(cells: Sequence[str]) -> str:
    """Return a motion by its cells along x, y and theta."""
    parts = [f"{name} {cell}" for name, cell in zip(NAMES.values(), cells, strict=True)]
    return ", ".join(part.replace(" ", SPACE) for part in parts)


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

    The numbers of a single shape are lines of the header.

    signs : of the displacements that must not cross.
    """
    mesh = _fields(found).mesh
    grid = _Grid.of(len(shapes))
    drawn = [_placed(mesh, shape, signs, grid.width) for shape in shapes]
    titles = ["\n".join(panel.lines) for panel in drawn]
    if len(drawn) == 1:
        lines = [sentence("; ".join(shapes[0].lines(drawn[0].factor, signs))), *lines]
        titles = [""]
    everywhere = np.concatenate([mesh.nodes, *(panel.places for panel in drawn)])
    size = grid.size(everywhere, titles)
    heading = f"{found.about.name}: {subject}"
    figure, axes = panels(size, heading, lines, grid.rows, grid.columns, found.about, len(shapes))
    for ax, panel, text in zip(axes, drawn, titles, strict=True):
        draw_displaced(ax, mesh, panel.places, SHARE)
        fit(ax, everywhere, VISIBLE / 2)
        ax.set_title(text, size=TITLE_SIZE)
    draw_scale(figure, figure.axes, SHARE, "displacement / largest of the drawing")
    return figure


class _Panel(NamedTuple):
    """A drawn shape: its factor, the lines of its title, and displaced nodes (n, 2), mm."""

    factor: float
    lines: Sequence[str]
    places: Array


def _placed(mesh: PlaneMesh, shape: Shape, signs: tuple[float, ...], width: float) -> _Panel:
    """Return a shape with its own exaggeration, for a panel of a width."""
    factor = _factor(mesh, shape, signs)
    lines = [wrapped(line, width - 0.2, TITLE_SIZE) for line in shape.lines(factor, signs)]
    return _Panel(factor, lines, mesh.nodes + factor * shape.field)


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
