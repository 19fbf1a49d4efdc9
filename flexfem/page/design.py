"""What a page says of a design: its stage and figures, requirements with margins, sensitivities, front, search."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.page.section import Cell, Content, PageSection, facts, notes, shown_figure, table
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure
from flexfem.plot.text import SPACE, significant

if TYPE_CHECKING:
    from flexfem.design.result import Designed, Requirement, Stated

UNKNOWN = Cell("not known", "")
BANDS = Markup(
    "<p>± is the band of the meshes, and of the stages drawn for a coupling under tolerance; without one a value is "
    "exact, or of the analytic model alone.</p>"
)
CHECKED = ("checked by", "model by itself")


def design_parts(of: Designed, number: int, several: bool) -> Iterator[tuple[str, Callable[[], PageSection | None]]]:
    """The sections of a design, which is the `number`th of a page, by name; of `several` each says of which it is."""
    yield of.name, lambda: _overview(of, number)
    for name, make in SECTIONS.items():
        yield f"{of.name}: {name}", partial(_made, make, of, f"design-{number}-{name}", several)


def _made(
    make: Callable[[Designed, str], PageSection | None], of: Designed, id: str, several: bool
) -> PageSection | None:
    section = make(of, id)
    return section if section is None or not several else replace(section, title=f"{section.title}: {of.name}")


def _overview(of: Designed, number: int) -> PageSection:
    """The dimensions, the objectives, and the figure."""
    state = "meets all requirements" if of.feasible else "does not meet all requirements: the nearest that was found"
    rows: list[list[Content]] = [
        [name, f"{value:g}", f"{of.relaxed[name]:.6g}", "at an end of its range" if name in of.at_ends else ""]
        for name, value in of.design.items()
    ]
    head = ["dimension (units of the stage file)", "designed", "without steps, by the model", "limit"]
    about = f"Outline of the designed stage, margins of its requirements, and the history of the search. It {state}."
    goals = ([goal.label, _value(goal), goal.better, *_checked(goal)] for goal in of.objectives)
    parts = [
        facts([("requirements", of.file), ("base stage", of.base), ("result", f"it {state}")]),
        notes(of.warnings),
        notes(of.notes, "note"),
        shown_figure(f"design-{number}-figure", lambda: design_figure(of), about),
        table(head, rows, caption="Dimensions of the design"),
        table(["objective", "value", "better", *CHECKED], goals, caption="Objectives"),
        BANDS,
    ]
    return PageSection(f"design-{number}", of.name, Markup("\n").join(parts))


def _value(of: Stated) -> str:
    band = "" if not of.band else f"{SPACE}±{SPACE}{significant(of.band, 2)}"
    text = f"{significant(of.value, 6)}{band}{SPACE}{of.unit}".rstrip()
    spread = of.push_spread
    return text if spread is None else f"{text}, ±{SPACE}{significant(spread, 2)} by the spread of the pushes"


def _checked(of: Stated) -> list[Content]:
    return [of.checked_by, significant(of.uncorrected, 6)]


def _requirements(of: Designed, id: str) -> PageSection | None:
    """Every requirement with its margin, and the relaxations where they cannot all be met."""
    if not of.requirements:
        return None
    head = ["requirement", "wanted", "value", "verdict", "margin (% of the end)", "limits the objective", *CHECKED]
    parts = [table(head, map(_requirement, of.requirements), caption="Requirements with their margins")]
    rows: list[list[Content]] = [
        [one.requirement, "none is enough", ""]
        if one.relax_to is None or one.percent is None
        else [one.requirement, significant(one.relax_to, 6), significant(one.percent, 6)]
        for one in of.alternatives
    ]
    if rows:
        caption = "Smallest relaxation of each requirement alone, the others kept, by the model"
        parts += [table(["requirement", "relaxed to", "by (%)"], rows, caption=caption, numbers=2)]
    return PageSection(id, "Requirements", Markup("\n").join(parts))


def _requirement(of: Requirement) -> list[Content]:
    band = "" if not of.band_percent else f"{SPACE}±{SPACE}{significant(of.band_percent, 2)}"
    margin = Cell(significant(of.margin_percent, 3) + band, of.margin_percent)
    verdict = Markup("<strong>{}</strong>").format(of.verdict)
    active = "yes" if of.active else ""
    return [of.label, " and ".join(of.wanted), _value(of), verdict, margin, active, *_checked(of)]


def _sensitivity(of: Designed, id: str) -> PageSection:
    """How every quantity follows every dimension."""
    every = {each.name: each.label for each in (*of.requirements, *of.objectives)}
    rows: list[list[Content]] = [
        [name, *(UNKNOWN if (x := row[key]) is None else Cell(significant(x, 3), x) for key in every)]
        for name, row in of.sensitivities.items()
    ]
    data = table(["dimension", *every.values()], rows, numbers=len(every), caption="Change (%) for 1 % of a dimension")
    labels = ", ".join(each.label for each in of.decisive)
    about = f"Bars of how these follow each dimension: {labels}. Their lengths are in the table below."
    figure = shown_figure(f"{id}-bars", lambda: sensitivity_figure(of), about, data=data)
    return PageSection(id, "Sensitivity to each dimension", figure)


def _front(of: Designed, id: str) -> PageSection | None:
    """The designs of the front, by finite elements, with what the corrected model said of them."""
    if not of.front:
        return None
    goals = [goal.headed() for goal in of.objectives]
    head = ["design", *of.front[0].design, *goals, *(f"{goal}, corrected model" for goal in goals), "requirements"]
    rows: list[list[Content]] = []
    for place, one in enumerate(of.front, 1):
        made = (Cell(f"{value:g}", value) for value in one.design.values())
        numbers = (Cell(significant(value, 5), value) for value in (*one.values, *one.predicted))
        rows.append([str(place), *made, *numbers, "met" if one.met else Markup("<strong>not met</strong>")])
    caption = "Designs that no other beats in both objectives, solved by finite elements"
    about = "The front by finite elements, and its designs to one scale, by their numbers."
    parts = [shown_figure(f"{id}-figure", lambda: front_figure(of), about), table(head, rows, caption=caption)]
    return PageSection(id, "Front", Markup("\n").join(parts))


def _search(of: Designed, id: str) -> PageSection:
    """What the search took, and how well the corrected model agreed with finite elements."""
    counts = [[name, f"{count:,}"] for name, count in of.evaluations.items()]
    rounds = [[str(k), f"{r.evaluations:,}", significant(r.gap_percent, 3)] for k, r in enumerate(of.rounds, 1)]
    agreed = "came to agree" if of.agreed else "did not come to agree"
    text = (
        f"Corrected model and finite elements {agreed} within {of.accuracy_percent:g} % at the design. Seed {of.seed}."
    )
    parts = [
        notes([text], "note"),
        table(["model", "designs"], counts, caption="Evaluations", numbers=1),
        table(["round", "designs by the model", "largest difference (%)"], rounds, caption="Rounds", numbers=2),
    ]
    return PageSection(id, "Search", Markup("\n").join(parts))


SECTIONS: dict[str, Callable[[Designed, str], PageSection | None]] = {
    "requirements": _requirements,
    "sensitivity": _sensitivity,
    "front": _front,
    "search": _search,
}
