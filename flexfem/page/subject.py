"""The page of a mechanism: the questions of its sections, its key results and its stress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np
from markupsafe import Markup

from flexfem.arrays import Array
from flexfem.hinges.strength import required_law
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.expansion import require_expansion
from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.handle import handled_drawing
from flexfem.page.key import (
    OTHERS,
    KeyResults,
    errors_driven,
    first_frequencies,
    opened,
    rows_at_rest,
)
from flexfem.page.section import (
    PageSection,
    Part,
    facts,
    folded,
    notes,
    parts,
    section,
    shown_figure,
    table,
)
from flexfem.page.sources import AssumedKeys, assumptions_of, rows_of_file, sources_section
from flexfem.plot import figures_of
from flexfem.plot.fields import plane_fields, stress_figure
from flexfem.plot.plate import drawing_figure
from flexfem.plot.text import SYMBOLS, percent, significant
from flexfem.questions.budget import budget
from flexfem.questions.check import check
from flexfem.questions.drive import drive
from flexfem.questions.errors import errors_of
from flexfem.questions.heat import drift
from flexfem.questions.large import large
from flexfem.questions.modes import modes
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, SOLID, Fields, Result, TextTable, record_parts
from flexfem.units import COMMANDS, PLANES, STRESS

Question: TypeAlias = Callable[..., Any]

TITLES = {
    "analytic": "Analytic model",
    "elements": "Finite elements",
    "budget": "Error budget",
    "stress": "Stress",
    "drive": "Drive",
    "large": "Large displacements",
    "modes": "Natural modes",
    "drift": "Drift by temperature",
    "life": "Fatigue life",
}
SECTIONS = tuple(TITLES)
STANDARD = SECTIONS[:5]
TABLES_ONLY = ("analytic", "elements")  # sections without figures
OF_HINGES = ("analytic", "budget", "life")  # sections that a plate without hinges does not have
ANALYTIC_MODEL = partial(stiffness, models="analytic")
ANALYTIC_MODES = partial(modes, models="analytic", count=1)
# mm, mm, rad: commands of the stress figure, assumed, as in cases/
STRESS_AMPLITUDES = np.array([0.05, 0.05, 1e-3])


class Subject(NamedTuple):
    """Subject of a page: its title, the kind of its files, its assumptions, and its parts in order."""

    title: str
    kind: str
    assumed: list[str]
    not_stated: list[str]
    parts: list[Part]


class KeyModel(NamedTuple):
    """The model of the key results.

    label : its label in results.   analytic : description of the analytic model.
    meshed : whether it is one of finite elements.
    """

    label: str
    analytic: str
    meshed: bool


class Stresses(NamedTuple):
    """Displaced finite elements of a section on stress, and the highest stress of each part, MPa."""

    fields: Fields
    highest: Array


class MechanismPage:
    """The page of a mechanism; a kind of mechanism with other sections has a subclass.

    Parameters
    ----------
    mechanism : Mechanism
    sections : names of the requested sections.
    amplitude : of the section on life, mm, mm, rad; None without it.
    """

    of_section: ClassVar[dict[str, tuple[Question, ...]]] = {
        "analytic": (ANALYTIC_MODEL,),
        "elements": (stiffness,),
        "budget": (errors_of, budget),
        "drive": (drive, reach),
        "large": (large,),
        "modes": (modes,),
        "drift": (drift,),
    }
    without_mesh: ClassVar[frozenset[str]] = frozenset({"analytic"})
    stressed_axes: ClassVar[tuple[int, ...]] = (0, 1, 2)

    def __init__(
        self,
        mechanism: Mechanism,
        sections: Sequence[str],
        amplitude: Any,
    ) -> None:
        self.mechanism = mechanism
        self.amplitude = amplitude
        self.sections = self._available(sections)
        self._answers: dict[Question, Any] = {}

    @property
    def kind(self) -> str:
        """Kind of the mechanism in a sentence."""
        return self.mechanism.kind.removesuffix(" file")

    @property
    def is_driven(self) -> bool:
        """Whether the mechanism has actuators."""
        return bool(self.mechanism.layout.actuators)

    @cached_property
    def meshed(self) -> bool:
        """Whether a section needs finite elements, of which the key results then are."""
        return not self.without_mesh.issuperset(self.sections)

    def questions(self, section_name: str) -> tuple[Question, ...]:
        """Return the questions of a section."""
        return self.of_section[section_name]

    def ask(self, question: Question) -> Any:
        """Return the answer of a question about the mechanism, which is computed once."""
        if question not in self._answers:
            self._answers[question] = question(self.mechanism)
        return self._answers[question]

    def subject(self) -> Subject:
        """Return the subject of the page. Raises BadInput before anything is computed."""
        self._require_material()
        checked = check(self.mechanism)
        keys = self.assumptions(checked)
        made: list[Part] = [(self.kind, partial(self._first_section, checked))]
        for name in SECTIONS:
            if name in self.sections and (name != "drive" or self.is_driven):
                made.append((name, partial(self._section, name)))
        rows = rows_of_file(self.mechanism, keys)
        made.append(("sources", partial(sources_section, rows, "source")))
        return Subject(self.mechanism.name, self.kind.capitalize(), *keys, made)

    def assumptions(self, checked: Any) -> AssumedKeys:
        """Return the assumed keys of a checked mechanism, and those without a source."""
        return assumptions_of([checked])

    def _available(self, sections: Sequence[str]) -> list[str]:
        """Return the requested sections that the mechanism has. Raises BadInput."""
        origin = self.mechanism.origin
        if "life" in sections and "life" not in self.of_section:
            raise BadInput(f"{origin}: section life, expected some of {', '.join(SECTIONS[:-1])}")
        if self.mechanism.layout.joints:
            return list(sections)
        available = [name for name in sections if name not in OF_HINGES]
        if not available:
            raise BadInput(
                f"{origin}: no [[hinge]], expected sections other than {', '.join(OF_HINGES)}"
            )
        return available

    def _require_material(self) -> None:
        """Raise BadInput for a material without the constants of a section."""
        with naming_place(self.mechanism):
            if "life" in self.sections:
                required_law(self.mechanism.material)
            if "drift" in self.sections:
                require_expansion(self.mechanism)

    # sections

    def _section(self, name: str) -> PageSection:
        if name == "stress":
            return self._stress_section()
        title = TITLES[name]
        answers = [self.ask(question) for question in self.questions(name)]
        figures = list[Markup]()
        for found in answers:
            has_figure = found.figure and (found.fields is not None or not found.drawn_from_fields)
            if has_figure and name not in TABLES_ONLY:
                draw = partial(_main_figure, found)
                figures.append(shown_figure(f"{name}-figure", draw, title))
        return section(name, title, *map(parts.answered, answers), *figures)

    def _first_section(self, checked: Any) -> PageSection:
        """Return the drawing and the key results, then dimensions and parts."""
        pairs, tables = record_parts(checked, plain=False)
        # sources with lines of their own are in another section
        pairs = [pair for pair in pairs if pair[0] != "sources" or not pair[1].startswith("\n")]
        draw = partial(drawing_figure, self.mechanism, small=True)
        description = f"Drawing to scale of {self.mechanism.name}"
        drawing = shown_figure("drawing", draw, description, table(tables[0]))
        listed = folded("Dimensions, material and parts", facts(pairs), *map(table, tables[1:]))
        bent = self.ask(large) if "large" in self.sections else None
        moved = handled_drawing(self.mechanism, self._at_rest(), bent)
        html = (moved, self._opening(drawing), notes(checked.warnings), listed)
        return section(self.kind, f"The {self.kind}", *html)

    def _stress_section(self) -> PageSection:
        """Return the von Mises stress by finite elements for displacements in several directions."""
        displaced = dict[str, Stresses]()
        for axis in self.stressed_axes:
            amplitude = STRESS_AMPLITUDES[axis]
            unit = COMMANDS[axis]
            x, y, theta = amplitude * np.eye(3)[axis]
            found = self.displaced((float(x), float(y), float(theta)))
            name = f"{SYMBOLS[axis]} = {amplitude * unit.factor:g} {unit}"
            displaced[name] = Stresses(plane_fields(found.fields), self.stresses(found))
        columns = [each.highest for each in displaced.values()]
        cells = zip(self.stressed_parts(found), *columns, strict=True)
        rows = [[label, *map(significant, values)] for label, *values in cells]
        head = ["part", *(f"{name} ({STRESS})" for name in displaced)]
        data = table(TextTable(head, rows, 1, "Highest von Mises stress of each hinge and body"))
        draw = partial(stress_figure, {name: each.fields for name, each in displaced.items()})
        figure = shown_figure("stress-figure", draw, "Von Mises stress when displaced", data)
        highest = "; ".join(self._highest(name, each) for name, each in displaced.items())
        note = f"The other directions are held; the amplitudes are assumed. {highest}."
        return section("stress", "Stress", notes([note], "note"), figure)

    def _highest(
        self,
        name: str,
        stresses: Stresses,
    ) -> str:
        largest = float(stresses.highest.max())
        share = percent(100 * largest / self.mechanism.material.yield_strength)
        return f"{name}: {significant(largest)} {STRESS} at most, {share} of the yield strength"

    def displaced(self, held: tuple[float, float, float]) -> Any:
        """Return the answer of finite elements held at a displacement, mm, mm, rad."""
        return stiffness(
            self.mechanism,
            models="elements",
            displacement=held,
            no_limits=True,
        )

    def stresses(self, found: Result) -> Array:
        """Return the highest stress of each part under the displacement of a result, MPa."""
        model = found.axes["model"][-1]
        stress = np.ravel(found.at("hinge_stress", model=model))
        if "body_stress" in found.values:
            stress = np.concatenate([stress, found.at("body_stress", model=model)])
        return stress

    def stressed_parts(self, found: Result) -> list[str]:
        """Return the names of the parts of `stresses`."""
        bodies = found.axes.get("body", ()) if "body_stress" in found.values else ()
        return [*found.axes["hinge"], *(f"body {name}" for name in bodies)]

    # key results

    def _opening(self, drawing: Markup) -> Markup:
        """Return the drawing beside the key results, and the motions."""
        at_rest = self._at_rest()
        vibrating = self.ask(modes if self.meshed else ANALYTIC_MODES)
        plane = PLANES[self.mechanism.model]
        rigid = f"rigid bodies, hinges as beams, {plane}"
        label = at_rest.axes["model"][-1] if self.meshed else ANALYTIC
        model = KeyModel(label, at_rest.settings.get("analytic model", rigid), self.meshed)
        rows = rows_at_rest(at_rest, model.label, model.analytic)
        key = KeyResults(rows, first_frequencies(vibrating), [])
        if self.meshed and vibrating.fields is not None:  # none in three dimensions
            caption = f"First natural mode, {key.singles[0][1]}."
            shape = self.first_shape(vibrating)
            key.add_motion("0", caption, vibrating.fields.mesh, shape, True)
        self.add_key_results(key, at_rest, model)
        caption = f"Key results by the analytic model ({model.analytic})."
        if self.meshed:
            solved = f"plane finite elements, {plane}"
            if label == SOLID:
                solved = "finite elements in three dimensions"
            caption = f"Key results by {solved}. ±: numerical uncertainty."
        return opened(drawing, key, f"{caption} {OTHERS}")

    def _at_rest(self) -> Any:
        """Return the answer of `stiffness` of the key results, which is computed once."""
        return self.ask(stiffness if self.meshed else ANALYTIC_MODEL)

    def first_shape(self, vibrating: Any) -> Array:
        """Return the displacements (n, 2) of the first natural mode."""
        shape: Array = vibrating.fields.made()["mode 1"]
        return shape

    def add_key_results(
        self,
        key: KeyResults,
        at_rest: Result,
        model: KeyModel,
    ) -> None:
        """Add the key results of the actuators."""
        actuators = at_rest.axes.get("actuator", ())
        if not actuators:
            return
        driven = self.ask(drive)
        for name in actuators:
            self._add_actuator(key, name, at_rest, driven, model)

    def _add_actuator(
        self, key: KeyResults, name: str, at_rest: Result, driven: Any, model: KeyModel
    ) -> None:
        """Add amplification, motion, input stiffness and stress of an actuator, and its motion."""
        at = {"actuator": name, "model": model.label}
        output = self.mechanism.layout.points[0][0]
        gain = at_rest.texts("amplification", **at)
        motion = driven.texts("motion", point=output, **at)
        key.rows.append([f"amplification: output motion per opening of actuator {name}", *gain])
        key.rows.append([f"output motion by the full stroke of actuator {name}", *motion])
        if model.meshed:
            key.singles.extend(errors_driven(at_rest, name, model.analytic))
        stiff = at_rest.texts("input_stiffness", **at)[0]
        key.singles.append((f"input stiffness at actuator {name}", stiff))
        stress = driven.texts("stress", **at)[0]
        key.singles.append((f"highest stress at the full stroke of actuator {name}", stress))
        if model.meshed:
            mesh = driven.fields.mesh
            field = driven.fields.made()[name]
            number = f"{len(key.motions)}"
            key.add_motion(number, f"Motion by actuator {name}.", mesh, field, False)


def _main_figure(found: Any) -> Any:
    return figures_of(found)[""]
