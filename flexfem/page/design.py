"""What a page says of a design: its stage and figures, requirements with margins and prices, sensitivities, search."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.page.section import Cell, Content, PageSection, facts, notes, shown_figure, table
from flexfem.plot.design import design_figure
from flexfem.plot.design_front import front_figure
from flexfem.plot.sensitivity import sensitivity_figure
from flexfem.plot.text import SPACE, significant

if TYPE_CHECKING:
    from flexfem.synthesis.result import Designed, Goal, Requirement, Stated

UNKNOWN = Cell("not known", "")
BANDS = Markup(
    "<p>± is the band of the meshes, and of the stages drawn for a coupling under tolerance; without one a value is "
    "exact, or of the analytic model alone.</p>"
)


def design_parts(of: Designed, number: int, several: bool) -> Iterator[tuple[str, Callable[[], PageSection | None]]]:
    """The sections of a design, which is the `number`th of a page, by name; of `several` each says of which it is."""
    yield of.name, lambda: _found(of, number)
    for name, make in MADE.items():
        yield f"{of.name}: {name}", lambda name=name, make=make: _titled(make(of, number), of, several)  # type: ignore[misc]


def _titled(section: PageSection | None, of: Designed, several: bool) -> PageSection | None:
    return section if section is None or not several else replace(section, title=f"{section.title}: {of.name}")


def _found(of: Designed, number: int) -> PageSection:
    """The dimensions, the objectives, and the figure."""
    state = "meets all requirements" if of.feasible else "does not meet all requirements: the nearest that was found"
    rows: list[list[Content]] = [
        [name, f"{value:g}", f"{of.relaxed[name]:.6g}", "at an end of its range" if name in of.at_ends else ""]
        for name, value in of.design.items()
    ]
    head = ["dimension (units of the stage file)", "designed", "without steps, by the model", "limit"]
    said = f"Outline of the designed stage, margins of its requirements, and the history of the search. It {state}."
    parts = [
        facts([("requirements", of.file), ("base stage", of.base), ("result", f"it {state}")]),
        notes(of.warnings),
        notes([*(coupling.said for coupling in of.scattered), *of.tightening], "note"),
        shown_figure(f"design-{number}-figure", lambda: design_figure(of), said),
        table(head, rows, caption="Dimensions of the design"),
        table(["objective", "value", "better", *RESTS], map(_goal, of.objectives), caption="Objectives"),
        BANDS,
    ]
    return PageSection(f"design-{number}", of.name, Markup("\n").join(parts))


RESTS = ("checked by", "model by itself")


def _goal(of: Goal) -> list[Content]:
    return [of.label, _value(of), of.better, of.checked_by, significant(of.shown(of.uncorrected), 6)]


def _value(of: Stated) -> str:
    band = "" if not of.band else f"{SPACE}±{SPACE}{significant(of.band, 2)}"
    text = f"{significant(of.shown(of.value), 6)}{band}{SPACE}{of.unit}".rstrip()
    spread = of.push_spread
    return text if spread is None else f"{text}, ±{SPACE}{significant(spread, 2)} by the spread of the pushes"


def _requirements(of: Designed, number: int) -> PageSection | None:
    """Every requirement with its margin and price, and the relaxations where they cannot all be met."""
    if not of.requirements:
        return None
    head = ["requirement", "wanted", "value", "verdict", "margin (%)", "1 % more costs the objective (%)", *RESTS]
    parts = [table(head, map(_asked, of.requirements), caption="Requirements with their margins and prices")]
    parts += [
        Markup(
            "<p>Margins are in per cent of the end that is wanted. The price of an active requirement is by how many "
            "per cent of itself the first objective gets worse, without steps.</p>"
        )
    ]
    rows: list[list[Content]] = [
        [one.requirement, "none is enough", ""]
        if one.relax_to is None or one.percent is None
        else [one.requirement, significant(one.relax_to, 6), significant(one.percent, 6)]
        for one in of.alternatives
    ]
    if rows:
        said = "Smallest relaxation of each requirement alone, the others kept, by the model"
        parts += [table(["requirement", "relaxed to", "by (%)"], rows, caption=said, numbers=2)]
    return PageSection(f"design-{number}-requirements", "Requirements", Markup("\n").join(parts))


def _asked(of: Requirement) -> list[Content]:
    band = "" if not of.band_percent else f"{SPACE}±{SPACE}{significant(of.band_percent, 2)}"
    margin = Cell(significant(of.margin_percent, 3) + band, of.margin_percent)
    price: Content = "" if not of.active else UNKNOWN
    if of.price_percent is not None:
        price = Cell(significant(of.price_percent, 3), of.price_percent)
    verdict = Markup("<strong>{}</strong>").format(of.verdict)
    wanted, uncorrected = " and ".join(of.wanted), significant(of.shown(of.uncorrected), 6)
    return [of.label, wanted, _value(of), verdict, margin, price, of.checked_by, uncorrected]


def _sensitivity(of: Designed, number: int) -> PageSection:
    """How every quantity follows every dimension."""
    every = {each.name: each.label for each in (*of.requirements, *of.objectives)}
    rows: list[list[Content]] = [
        [name, *(_change(row[key]) for key in every)] for name, row in of.sensitivities.items()
    ]
    data = table(["dimension", *every.values()], rows, numbers=len(every), caption="Change (%) for 1 % of a dimension")
    asked = ", ".join(each.label for each in of.decisive)
    figure = shown_figure(
        f"design-{number}-bars",
        lambda: sensitivity_figure(of),
        f"Bars of how these follow each dimension: {asked}. Their lengths are in the table below.",
        data=data,
    )
    return PageSection(f"design-{number}-sensitivity", "Sensitivity to each dimension", figure)


def _change(value: float | None) -> Content:
    return UNKNOWN if value is None else Cell(significant(value, 3), value)


def _front(of: Designed, number: int) -> PageSection | None:
    """The designs of the front, by finite elements, with what the corrected model said of them."""
    if not of.front:
        return None
    goals = [goal.headed() for goal in of.objectives]
    head = ["design", *of.front[0].design, *goals, *(f"{goal}, corrected model" for goal in goals), "requirements"]
    rows: list[list[Content]] = []
    for place, one in enumerate(of.front, 1):
        shown = [goal.shown for goal in of.objectives] * 2
        numbers = [show(value) for show, value in zip(shown, [*one.values, *one.predicted], strict=True)]
        made = (Cell(f"{value:g}", value) for value in one.design.values())
        kept = "met" if one.met else Markup("<strong>not met</strong>")
        rows.append([str(place), *made, *(Cell(significant(value, 5), value) for value in numbers), kept])
    said = "Designs that no other beats in all objectives, solved by finite elements"
    drawn = "The front by finite elements, and its designs to one scale, by their numbers."
    parts = [shown_figure(f"front-{number}-figure", lambda: front_figure(of), drawn), table(head, rows, caption=said)]
    return PageSection(f"design-{number}-front", "Front", Markup("\n").join(parts))


def _search(of: Designed, number: int) -> PageSection:
    """What the search took, and how well the corrected model agreed with finite elements."""
    counts = [[name, f"{count:,}"] for name, count in of.evaluations.items()]
    rounds: list[list[Content]] = [
        [str(place), f"{turn.evaluations:,}", significant(turn.gap_percent, 3)]
        for place, turn in enumerate(of.rounds, 1)
    ]
    agreed = "came to agree" if of.agreed else "did not come to agree"
    said = (
        f"Corrected model and finite elements {agreed} within {of.accuracy_percent:g} % at the design. Seed {of.seed}."
    )
    parts = [
        notes([said], "note"),
        table(["model", "designs"], counts, caption="Evaluations", numbers=1),
        table(["round", "designs by the model", "largest difference (%)"], rounds, caption="Rounds", numbers=2),
    ]
    return PageSection(f"design-{number}-search", "Search", Markup("\n").join(parts))


MADE: dict[str, Callable[[Designed, int], PageSection | None]] = {
    "requirements": _requirements,
    "sensitivity": _sensitivity,
    "front": _front,
    "search": _search,
}
