"""The opening of a page on a stage or mechanism: its most important numbers by one model, and its
motions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.section import moving_svg, parts
from flexfem.paper.commanding import DrivenElements, driven_elements
from flexfem.paper.stage import Stage
from flexfem.plot.style import NAMES
from flexfem.questions import bands as comparison
from flexfem.questions.budget import budget
from flexfem.questions.drive import drive
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness
from flexfem.results import ANALYTIC, ELEMENTS, SOLID, SPACE, Result, TextTable, number
from flexfem.units import DIRECTIONS, PLANES, Direction

Ask: TypeAlias = Callable[
    [Callable[..., Any]], Any
]  # answers a question about the subject of a page, once
ENDS = partial(reach, models="analytic")
SHARES = partial(budget, plane=True)
BEAMS = (
    partial(stiffness, models="analytic"),
    partial(modes, models="analytic", count=1),
)  # without finite elements
AT_REST = {
    "free": "stiffness, other directions free",
    "yield_range": "range at yield, other directions held, linear, ±",
    "yield_force": "force at yield, other directions held, linear",
    "stress": "highest stress per displacement",
}
LINEAR = (
    "yield_range",
    "yield_force",
)  # by linear theory; left out where the range at finite displacement is known
SENSES = ("positive", "negative")
UNKNOWN = "not known"
COARSE = 2  # triangles across a neck, for the motions by actuators, which are only drawn
MOVING = "The motion is exaggerated; the grey outline is at rest. Click on it to stop or start it."


def opening(
    subject: Mechanism, ask: Ask, sections: Sequence[str], meshed: bool, drawing: Markup
) -> Markup:
    """Return the drawing of a stage or mechanism beside its key results, and its motions.

    meshed : whether the numbers are those of finite elements; otherwise they are those of the
    analytic model."""
    at_rest, vibrating = (ask(question) for question in ((stiffness, modes) if meshed else BEAMS))
    plane = PLANES[subject.model]
    model = at_rest.axes["model"][-1] if meshed else ANALYTIC
    analytic = at_rest.settings.get("analytic model", f"rigid bodies, hinges as beams, {plane}")
    rows = rows_at_rest(at_rest, model, analytic)
    first = vibrating.axes["mode"][0]  # with layers "1 in the plane" or "1 out of the plane"
    motion_of_first = first.partition(" ")[2] or "in the plane"
    singles = [
        (
            f"first natural frequency, {motion_of_first}",
            vibrating.texts("frequency", mode=first)[-1],
        )
    ]
    if "first_out_of_plane" in vibrating.values and motion_of_first == "in the plane":
        singles.append(
            ("first natural frequency, out of the plane", vibrating.texts("first_out_of_plane")[0])
        )
    figures = list[Markup]()
    fields = vibrating.fields
    if meshed and fields is not None:  # a mechanism in three dimensions has none
        shape = fields.shapes[0] if isinstance(subject, Stage) else fields.made()["mode 1"]
        figures.append(
            _moving("0", f"First natural mode, {singles[0][1]}.", fields.mesh, shape, True)
        )
    if isinstance(subject, Stage):
        if meshed and "budget" in sections:
            shares = ask(SHARES)
            title = f"error of the displacement by the paper's model ({shares.settings['model']})"
            rows.append([title, *shares.texts("share", share="total")])
        if meshed and "thickness" in at_rest.values:
            rows.append(
                [
                    "change of the stiffness in three dimensions, not included",
                    *at_rest.texts("thickness"),
                ]
            )
        if "drive" in sections and subject.actuator:
            ends = [
                ask(ENDS).texts("ends", others="zero", end=end, model=ANALYTIC)
                for end in ("low", "high")
            ]
            cells = map(" to ".join, zip(*ends, strict=True))
            rows.append(["range of the drive, others at zero, by the analytic model", *cells])
            if meshed:
                elements = driven_elements(subject, COARSE)
                for axis in DIRECTIONS:
                    caption = f"Motion in {NAMES[axis]} by the actuators."
                    field = driven_field(elements, axis)
                    figures.append(_moving(axis, caption, elements.mesh, field, True))
    elif actuators := at_rest.axes.get("actuator", ()):
        driven = ask(drive)
        output = subject.layout.points[0][0]
        for name in actuators:
            at: dict[str, str] = {"actuator": name, "model": model}
            gain = at_rest.texts("amplification", **at)
            motion = driven.texts("motion", point=output, **at)
            rows.append([f"amplification: output motion per opening of actuator {name}", *gain])
            rows.append([f"output motion by the full stroke of actuator {name}", *motion])
            singles += errors_driven(at_rest, name, analytic) if meshed else []
            singles.append(
                (f"input stiffness at actuator {name}", at_rest.texts("input_stiffness", **at)[0])
            )
            singles.append(
                (
                    f"highest stress at the full stroke of actuator {name}",
                    driven.texts("stress", **at)[0],
                )
            )
            if meshed:
                mesh = driven.fields.mesh
                field = driven.fields.made()[name]
                figures.append(
                    _moving(f"{len(figures)}", f"Motion by actuator {name}.", mesh, field, False)
                )
    caption = f"Key results by the analytic model ({analytic})."
    if meshed:
        solved = (
            "finite elements in three dimensions"
            if model == SOLID
            else f"plane finite elements, {plane}"
        )
        caption = f"Key results by {solved}. ±: numerical uncertainty."
    rows = [[title, *map(_unbroken, cells)] for title, *cells in rows]
    return Markup(
        parts.opened(drawing, figures, TextTable(["", "X", "Y", "θ"], rows, 1, caption), singles)
    )


def _unbroken(text: str) -> str:
    """Return a cell that breaks neither after its sign ±, nor before a %, nor within its unit."""
    for pair in ("± ", " %", "N mm"):
        text = text.replace(pair, pair.replace(" ", SPACE))
    return text.replace("/", "/\N{WORD JOINER}")


def rows_at_rest(found: Result, model: str, analytic: str) -> list[list[str]]:
    """Return the rows of a model by direction, and of errors of the others from it; `analytic`
    names the analytic one.

    The stage has no band of the force at yield: it is that of the stiffness and of the range,
    relative."""
    K, width = (
        np.diagonal(part, axis1=1, axis2=2)
        for part in (found.at("stiffness"), found.band("stiffness"))
    )
    widths = dict(found.internal.bands)
    if "yield_force" in found.values:
        share = found.band("yield_range") / found.at("yield_range")
        widths.setdefault("yield_force", found.at("yield_force") * (share + width / K))
    found = type(found)(found.about, found.internal.values, widths, found.axes)
    held = [
        found.texts("stiffness", model=model, component=axis)[k]
        for k, axis in enumerate(DIRECTIONS)
    ]
    rows = [["stiffness, other directions held", *held]]
    at_rest = {name: title for name, title in AT_REST.items() if name in found.values}
    if "range" in found.values:
        at_rest = {name: title for name, title in at_rest.items() if name not in LINEAR}
    rows += [[title, *found.texts(name, model=model)] for name, title in at_rest.items()]
    rows += rows_of_range(found)
    free = found.internal.values["free"]
    band = found.band("free")
    unused = comparison.held(found.internal.values["compliance"][-1], found.about.lever)
    for label, other in zip(found.axes["model"][:-1], free[:-1], strict=True):
        ratio = 100 * other / free[-1]
        pairs = zip(unused, ratio - 100, ratio * (band / free)[-1], strict=True)
        errors = ["held" if out else f"{number(*pair)} %" for out, *pair in pairs]
        rows.append([f"error of the stiffness, others free, by {_model(label, analytic)}", *errors])
    return rows


def rows_of_range(found: Result) -> list[list[str]]:
    """Return the rows of the range of the output at finite displacement, the limit that ends it,
    and the force there.

    There are none for a result that has no such range.
    """
    if "range" not in found.values:
        return []
    rows = list[list[str]]()
    for others in ("free", "held"):
        ends = [_limits(found, others, sense) for sense in SENSES]
        rows.append(
            [f"range until a limit, other directions {others}", *_both_ways(found, "range", others)]
        )
        rows.append(
            [
                "limit",
                *(
                    first if first == last else f"{first}; {last}"
                    for first, last in zip(*ends, strict=True)
                ),
            ]
        )
        rows.append(["force at the end of the range", *_both_ways(found, "range_force", others)])
    return rows


def _both_ways(found: Result, name: str, others: str) -> list[str]:
    """Return cells with the ends of both senses of every direction, or with one if they differ in
    sign alone.
    """
    texts = [found.texts(name, others=others, sense=sense) for sense in SENSES]
    return [
        f"{there} each way"
        if there and back == f"-{there}"
        else f"{there or UNKNOWN} to {back or UNKNOWN}"
        for there, back in zip(*texts, strict=True)
    ]


def _limits(found: Result, others: str, sense: str) -> list[str]:
    """Return the limits that end the range along every direction in a sense."""
    governing = found.at("range_limit", others=others, sense=sense)
    return [found.axes["limit"][row] for row in np.argmax(governing, axis=0)]


def errors_driven(found: Result, actuator: str, analytic: str) -> list[tuple[str, str]]:
    """Return the errors of the amplification of an actuator by all models but the last, with their
    titles.
    """
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
    """Name an analytic model by its label, or the only analytic one by a description; plane finite
    elements as such.
    """
    if label == ELEMENTS:
        return "plane finite elements"
    return f"the analytic model ({analytic if label == ANALYTIC else label})"


def driven_field(elements: DrivenElements, direction: Direction) -> Array:
    """Return the displacements (n, 2), mm, for a unit pose along a direction by the strokes of
    least energy.
    """
    system = elements.system
    lever = elements.stage.chain.link_lengths[2]
    load = np.zeros(3)
    strokes = system.commands(np.eye(3)[DIRECTIONS.index(direction)], load, lever, "least energy")
    return np.asarray(np.tensordot(system.moved(strokes, load).force, elements.fields[3:], axes=1))


def _moving(name: str, caption: str, mesh: StageMesh, field: Array, swings: bool) -> Markup:
    svg = moving_svg(mesh.nodes, mesh.triangles, field, swings)
    return Markup(parts.framed(f"motion-{name}", svg, f"{caption} {MOVING}", caption))
