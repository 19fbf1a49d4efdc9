"""Key results of a mechanism by one model, and its drawing, as a live page shows them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import compress
from operator import not_
from typing import Any, NamedTuple

import numpy as np
import shapely

from flexfem.mechanism.hinge_place import joint_polygon
from flexfem.mechanism.layout import Layout, LinearActuator
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import body_polygon
from flexfem.questions.handling import quick_stiffness, svg_path
from flexfem.questions.modes import modes
from flexfem.results import Progress, Result

SHOWN = (  # quantities of `stiffness`, with their names on the page
    ("free", "stiffness, other directions free"),
    ("held", "stiffness, other directions held"),
    ("free_yield_range", "linear range until a hinge yields"),
    ("amplification", "output motion per actuator opening"),
    ("input_stiffness", "stiffness at the actuator"),
)
FREQUENCY = "first natural frequency in the plane"
MARGIN = 0.04  # of the drawing around the plate, relative to its size
DECIMALS = 4  # of coordinates, mm


class Row(NamedTuple):
    """A key result: its name and its cells, one for x, y and theta or a single one."""

    name: str
    cells: list[str]


class PlateDrawing(NamedTuple):
    """A drawing in millimetres, y upwards: its box and its paths in the notation of SVG.

    box : left, low, width, height.   bodies, hinges, ground : paths.   output : x and y.
    actuators : lines x1, y1, x2, y2.
    """

    box: list[float]
    bodies: list[str]
    ground: list[str]
    hinges: list[str]
    output: list[float]
    actuators: list[list[float]]


def rows_by_model(
    mechanism: Mechanism,
    models: Any,
    progress: Progress | None = None,
) -> list[Row]:
    """Return the key results by the analytic model or by finite elements."""
    asked: dict[str, Any] = {"models": models, "progress": progress}
    at_rest = quick_stiffness(mechanism, **asked)
    found = list[Row]()
    for quantity, name in SHOWN:
        found += _rows(at_rest, quantity, name)
    first = modes(mechanism, models=models, count=1)
    return found + _rows(first, "frequency", FREQUENCY, mode=first.axes["mode"][0])


def _rows(result: Result, quantity: str, name: str, **labels: str) -> list[Row]:
    """Return the rows of a quantity by the last model, one for each actuator."""
    if quantity not in result.values:
        return []
    over = result.quantities[quantity].over
    labels["model"] = result.axes["model"][-1]
    if "actuator" not in over:
        return [Row(name, result.texts(quantity, **_in_order(over, labels)))]
    found = list[Row]()
    actuators = result.axes["actuator"]
    for actuator in actuators:
        at = _in_order(over, labels | {"actuator": actuator})
        text = f"{name} {actuator}" if len(actuators) > 1 else name
        found.append(Row(text, result.texts(quantity, **at)))
    return found


def _in_order(over: Iterable[str], labels: dict[str, str]) -> dict[str, str]:
    return {axis: labels[axis] for axis in over if axis in labels}


def drawing_of(layout: Layout) -> PlateDrawing:
    """Return the drawing of a mechanism."""
    shapes = [body_polygon(layout, index, refuse=False) for index in range(len(layout.bodies))]
    hinges = [joint_polygon(joint) for joint in layout.joints]
    is_fixed = [body.fixed for body in layout.bodies]
    output = layout.points[0][1].point
    return PlateDrawing(
        box=_box_around([*shapes, *hinges]),
        bodies=[svg_path(shape) for shape in compress(shapes, map(not_, is_fixed))],
        ground=[svg_path(shape) for shape in compress(shapes, is_fixed)],
        hinges=[svg_path(hinge) for hinge in hinges],
        output=[output.real, output.imag],
        actuators=[_line(actuator) for actuator in layout.actuators],
    )


def _box_around(shapes: Sequence[Any]) -> list[float]:
    """Return left, low, width and height of shapes with a margin, mm."""
    left, low, right, high = shapely.total_bounds(np.array(shapes))
    margin = MARGIN * max(right - left, high - low)
    box = (left - margin, low - margin, right - left + 2 * margin, high - low + 2 * margin)
    return [round(float(value), DECIMALS) for value in box]


def _line(actuator: LinearActuator) -> list[float]:
    """Return x and y of both contacts, mm."""
    near, far = actuator.contacts
    return [near.point.real, near.point.imag, far.point.real, far.point.imag]
