"""The opening of a page on a mechanism: its most important numbers by one model, and its motions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from flexfem.arrays import Array
from flexfem.fem.mesh import PlaneMesh
from flexfem.page.section import moving_svg, parts
from flexfem.questions import bands as comparison
from flexfem.results import ANALYTIC, ELEMENTS, SPACE, Result, TextTable, number
from flexfem.units import DIRECTIONS, FORCES

AT_REST = {
    "free": "stiffness, other directions free",
    "yield_range": "displacement at first yield, other directions held, linear",
    "yield_force": "force at first yield, other directions held, linear",
    "stress": "highest hinge stress per displacement, other directions held",
}
# by linear theory; left out where the range at finite displacement is known
LINEAR = ("yield_range", "yield_force")
SENSES = ("positive", "negative")
UNKNOWN = "not known"
STIFF = "stiff: not compared"
MOVING = "The motion is exaggerated; the grey outline is at rest. Click on it to stop or start it."
HEAD = ["", "x", "y", "θ"]
OTHERS = "Other directions: the two along which the output is not driven, held at zero or free."


class KeyResults(NamedTuple):
    """The key results of a page.

    rows : a title, and a cell for each direction.
    singles : titles and values of single numbers.
    motions : moving outlines.
    """

    rows: list[list[str]]
    singles: list[tuple[str, str]]
    motions: list[Markup]

    def add_motion(
        self, name: str, caption: str, mesh: PlaneMesh, field: Array, swings: bool
    ) -> None:
        """Add the motion of a mesh by a field (n, 2); `swings` to both sides, as a mode does."""
        svg = moving_svg(mesh.nodes, mesh.triangles, field, swings)
        framed = parts.framed(f"motion-{name}", svg, f"{caption} {MOVING}", caption)
        self.motions.append(Markup(framed))


def opened(
    drawing: Markup,
    key: KeyResults,
    caption: str,
) -> Markup:
    """Return a drawing beside its key results, and its motions."""
    rows = [[title, *map(_unbroken, cells)] for title, *cells in key.rows]
    numbers = TextTable(HEAD, rows, 1, caption)
    return Markup(parts.opened(drawing, key.motions, numbers, key.singles))


def _unbroken(text: str) -> str:
    """Return a cell that breaks neither after its sign ±, nor before a %, nor within its unit."""
    for pair in ("± ", " %", "N mm"):
        text = text.replace(pair, pair.replace(" ", SPACE))
    return text.replace("/", "/\N{WORD JOINER}")


def first_frequencies(vibrating: Result) -> list[tuple[str, str]]:
    """Return titles and values of the first frequency, and of the first one out of the plane."""
    first = vibrating.axes["mode"][0]  # with layers "1 in the plane" or "1 out of the plane"
    motion = first.partition(" ")[2] or "in the plane"
    value = vibrating.texts("frequency", mode=first)[-1]
    singles = [(f"first natural frequency, {motion}", value)]
    if "first_out_of_plane" in vibrating.values and motion == "in the plane":
        lifted = vibrating.texts("first_out_of_plane")[0]
        singles.append(("first natural frequency, out of the plane", lifted))
    return singles


def rows_at_rest(
    found: Result,
    model: str,
    analytic: str,
) -> list[list[str]]:
    """Return the rows of a model by direction, and of the errors of the others from it.

    analytic : name of the only analytic model.
    """
    held = list[str]()
    for k, axis in enumerate(DIRECTIONS):
        held.append(found.texts("stiffness", model=model, component=axis)[k])
    rows = [["stiffness, other directions held", *held]]
    for name, title in AT_REST.items():
        if name not in found.values or (name in LINEAR and "range" in found.values):
            continue
        if name == "yield_force" and name not in found.bands:
            rows.append([title, *_force_at_yield(found, model)])
        else:
            rows.append([title, *found.texts(name, model=model)])
    return rows + rows_of_range(found) + _rows_of_errors(found, analytic)


def _force_at_yield(found: Result, model: str) -> list[str]:
    """Return cells of the force at yield.

    Its relative band is the sum of those of the stiffness and of the range, whose product it is.
    """
    stiffness = np.diagonal(found.at("stiffness", model=model))
    of_stiffness = np.diagonal(found.band("stiffness", model=model)) / stiffness
    reach = found.at("yield_range", model=model)
    of_range = found.band("yield_range", model=model) / reach
    force = found.at("yield_force", model=model)
    bands = force * (of_stiffness + of_range)
    cells = zip(force.tolist(), bands.tolist(), FORCES, strict=True)
    return [f"{number(value, band)} {unit}" for value, band, unit in cells]


def _rows_of_errors(found: Result, analytic: str) -> list[list[str]]:
    """Return the errors of the stiffness, other directions free, of all models but the last, %.

    A direction in which the mechanism is far stiffer than in its softest one has none.
    """
    free = found.internal.values["free"]
    last = free[-1]
    relative_band = (found.band("free") / free)[-1]
    unused = comparison.held(found.internal.values["compliance"][-1], found.about.lever)
    rows = list[list[str]]()
    for label, other in zip(found.axes["model"][:-1], free[:-1], strict=True):
        ratio = 100 * other / last
        cells = zip(unused, ratio - 100, ratio * relative_band, strict=True)
        errors = [STIFF if out else f"{number(error, band)} %" for out, error, band in cells]
        title = f"error of the stiffness, other directions free, by {_model(label, analytic)}"
        rows.append([title, *errors])
    return rows


def rows_of_range(found: Result) -> list[list[str]]:
    """Return the rows of the range at finite displacement, of its limits, and of the force there.

    There are none for a result that has no such range.
    """
    if "range" not in found.values:
        return []
    rows = list[list[str]]()
    for others in ("free", "held"):
        ranges = _both_ways(found, "range", others)
        rows.append([f"range until the first limit, other directions {others}", *ranges])
        rows.append(["limit", *_limits(found, others)])
        forces = _both_ways(found, "range_force", others)
        rows.append(["force at the end of the range", *forces])
    return rows


def _both_ways(
    found: Result,
    name: str,
    others: str,
) -> list[str]:
    """Return the ends of both senses of every direction; one if they differ in sign alone."""
    cells = list[str]()
    positive, negative = (found.texts(name, others=others, sense=sense) for sense in SENSES)
    for there, back in zip(positive, negative, strict=True):
        if there and back == f"-{there}":
            cells.append(f"{there} each way")
        else:
            cells.append(f"{there or UNKNOWN} to {back or UNKNOWN}")
    return cells


def _limits(found: Result, others: str) -> list[str]:
    """Return the limits that end the range along every direction, in both senses."""
    cells = list[str]()
    positive, negative = (_limits_of_sense(found, others, sense) for sense in SENSES)
    for there, back in zip(positive, negative, strict=True):
        cells.append(there if there == back else f"{there}; {back}")
    return cells


def _limits_of_sense(
    found: Result,
    others: str,
    sense: str,
) -> list[str]:
    governing = found.at("range_limit", others=others, sense=sense)
    return [found.axes["limit"][row] for row in np.argmax(governing, axis=0)]


def errors_driven(
    found: Result,
    actuator: str,
    analytic: str,
) -> list[tuple[str, str]]:
    """Return the errors of the amplification of an actuator by all models but the last."""
    place = found.axes["actuator"].index(actuator)
    lever = found.about.lever
    *models, elements = found.internal.values["amplification"][place]
    width = found.internal.bands["amplification"][place, -1]
    rows = list[tuple[str, str]]()
    for label, model in zip(found.axes["model"][:-1], models, strict=True):
        error = float(comparison.amplification_errors(model, elements, lever))
        band = float(comparison.amplification_bands(model, elements, width, lever))
        title = f"error of the amplification of actuator {actuator} by {_model(label, analytic)}"
        rows.append((title, f"{number(error, band)} %"))
    return rows


def _model(label: str, analytic: str) -> str:
    """Return the name of a model in a sentence; `analytic` describes the only analytic one."""
    if label == ELEMENTS:
        return "plane finite elements"
    return f"the analytic model ({analytic if label == ANALYTIC else label})"
