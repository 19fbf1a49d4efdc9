"""Pages of the stage: its own sections and key results, and sections of stored verifications."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np

from flexfem.arrays import Array
from flexfem.page.key import KeyResults
from flexfem.page.section import PageSection, parts, section, shown_figure, table
from flexfem.page.sources import AssumedKeys, assumptions_of
from flexfem.page.subject import ANALYTIC_MODEL, KeyModel, MechanismPage, Question
from flexfem.paper.commanding import DrivenElements, driven_elements
from flexfem.paper.figures.errors import error_figure
from flexfem.paper.figures.stored import write_stored as write_stored
from flexfem.paper.stage import Stage
from flexfem.paper.verification import Verification
from flexfem.plot.style import NAMES
from flexfem.plot.text import SYMBOLS, significant
from flexfem.questions.budget import budget
from flexfem.questions.heat import drift
from flexfem.questions.large import large
from flexfem.questions.life import life
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness
from flexfem.questions.summary import summary
from flexfem.results import ANALYTIC, AXES, Result, TextTable
from flexfem.units import DIRECTIONS, Direction, unit_for

SHARES = partial(budget, plane=True)
DRIVE_RANGES = partial(reach, models="analytic")
COARSE = 2  # triangles across a neck, for the motions by actuators, which are only drawn


class StagePage(MechanismPage):
    """The page of a stage."""

    of_section: ClassVar[dict[str, tuple[Question, ...]]] = {
        "analytic": (ANALYTIC_MODEL,),
        "elements": (summary,),
        "budget": (SHARES,),
        "drive": (DRIVE_RANGES,),
        "large": (large,),
        "modes": (modes,),
        "drift": (drift,),
        "life": (life,),
    }
    without_mesh: ClassVar[frozenset[str]] = frozenset({"analytic", "drive", "life"})
    stressed_axes: ClassVar[tuple[int, ...]] = (0, 2)
    mechanism: Stage

    def __init__(
        self,
        mechanism: Stage,
        sections: Sequence[str],
        amplitude: Any,
    ) -> None:
        super().__init__(mechanism, sections, amplitude)
        if self.meshed:  # a stated plane problem is that of both models
            self.mechanism = mechanism.model_copy(update={"model": mechanism.model})
            self.mechanism.__dict__["origin"] = mechanism.origin

    def questions(self, section_name: str) -> tuple[Question, ...]:
        """Return the questions of a section; that on life is asked for the amplitude of the page."""
        if section_name == "life":
            return (partial(life, amplitude=self.amplitude),)
        return super().questions(section_name)

    @property
    def is_driven(self) -> bool:
        """Whether the stage has actuators."""
        return bool(self.mechanism.actuator)

    def assumptions(self, checked: Any) -> AssumedKeys:
        """Return the assumed keys of a checked stage and of its drive."""
        return assumptions_of([checked, checked.drive] if checked.drive else [checked])

    def displaced(self, held: tuple[float, float, float]) -> Any:
        """Return the answer of finite elements held at a displacement, mm, mm, rad."""
        return stiffness(self.mechanism, models="elements", displacement=held)

    def stresses(self, found: Result) -> Array:
        """Return the highest stress of each neck, MPa, chain by chain."""
        return np.ravel(found.at("neck_stress", model=found.axes["model"][-1]))

    def stressed_parts(self, found: Result) -> list[str]:
        """Return the names of the hinges of `stresses`."""
        return [f"{hinge} hinge, {chain}" for chain in AXES["chain"] for hinge in AXES["hinge"]]

    def first_shape(self, vibrating: Any) -> Array:
        """Return the displacements (n, 2) of the first natural mode."""
        shape: Array = vibrating.fields.shapes[0]
        return shape

    def add_key_results(
        self,
        key: KeyResults,
        at_rest: Result,
        model: KeyModel,
    ) -> None:
        """Add the error of the paper's model, the effect of thickness and the range of the drive."""
        if model.meshed and "budget" in self.sections:
            shares = self.ask(SHARES)
            title = f"error of the displacement by the paper's model ({shares.settings['model']})"
            key.rows.append([title, *shares.texts("share", share="total")])
        if model.meshed and "thickness" in at_rest.values:
            title = "change of the stiffness in three dimensions, not included"
            key.rows.append([title, *at_rest.texts("thickness")])
        if "drive" in self.sections and self.is_driven:
            self._add_drive(key, model.meshed)

    def _add_drive(
        self,
        key: KeyResults,
        meshed: bool,
    ) -> None:
        """Add the range of the drive, and the motions by the actuators."""
        found = self.ask(DRIVE_RANGES)
        low, high = (
            found.texts(
                "ends",
                others="zero",
                end=end,
                model=ANALYTIC,
            )
            for end in ("low", "high")
        )
        cells = [f"{first} to {last}" for first, last in zip(low, high, strict=True)]
        key.rows.append(
            ["range of the drive, other directions at zero, by the analytic model", *cells]
        )
        if not meshed:
            return
        elements = driven_elements(self.mechanism, COARSE)
        for axis in DIRECTIONS:
            field = driven_field(elements, axis)
            caption = f"Motion in {NAMES[axis]} by the actuators."
            key.add_motion(axis, caption, elements.mesh, field, True)


def driven_field(elements: DrivenElements, direction: Direction) -> Array:
    """Return the displacements (n, 2), mm, for a unit pose by the strokes of least energy."""
    system = elements.system
    lever = elements.stage.lever
    load = np.zeros(3)
    pose = np.eye(3)[DIRECTIONS.index(direction)]
    strokes = system.commands(pose, load, lever, "least energy")
    force = system.moved(strokes, load).force
    return np.asarray(np.tensordot(force, elements.fields[3:], axes=1))


def stored_section(result: Verification, number: int) -> PageSection:
    """Return the error curves of a case with their mesh bands."""
    command = unit_for(result.direction, max(map(abs, result.commanded)))
    symbol = SYMBOLS[DIRECTIONS.index(result.direction)]
    columns = {f"commanded {symbol} ({command})": (result.commanded, command)}
    for label in result.curves:
        for symbol, axis in zip(SYMBOLS, DIRECTIONS, strict=True):
            values = result.at("error", curve=label, direction=axis).tolist()
            unit = unit_for(axis, max(map(abs, values)))
            columns[f"{label}: error in {symbol} ({unit})"] = (values, unit)
    texts = [
        [significant(value * unit.factor, 5) for value in values]
        for values, unit in columns.values()
    ]
    data = table(TextTable([*columns], [*map(list, zip(*texts, strict=True))], 0))
    title = f"Errors of {result.name}"
    figure = shown_figure(f"curves-{number}", partial(error_figure, result), title, data)
    return section(f"case-{number}", result.name, figure, parts.answered(result))
