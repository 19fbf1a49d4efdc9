"""What a page says of a design: its figures and its tables, section by section."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from markupsafe import Markup

from flexfem.page.section import PageSection, facts, notes, shown_figure, table
from flexfem.plot.design import design_figure, front_figure, sensitivity_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexfem.design.result import Designed


class Section(NamedTuple):
    """A section with the tables of `Designed.sections`: its title and figure, and what a screen reader says of that."""

    title: str
    figure: Callable[[Designed], Figure] | None = None
    about: str = ""


SECTIONS = {
    "design": Section(
        "Design", design_figure, "Outline of the stage, margins of its requirements, and history of the search."
    ),
    "requirements": Section("Requirements"),
    "sensitivity": Section(
        "Sensitivity to each dimension", sensitivity_figure, "Bars of how objectives and active requirements follow it."
    ),
    "front": Section("Front", front_figure, "The front by finite elements, and its designs to one scale."),
    "search": Section("Search"),
}


def design_parts(of: Designed, number: int, several: bool) -> Iterator[tuple[str, Callable[[], PageSection]]]:
    """The sections of a design, which is the `number`th of a page, by name; of `several` each says of which it is."""
    for name, tables in of.sections(plain=False).items():
        if tables:
            yield f"{of.name}: {name}", partial(_section, of, name, f"design-{number}-{name}", several)


def _section(of: Designed, name: str, anchor: str, several: bool) -> PageSection:
    title, figure, about = SECTIONS[name]
    parts = []
    if name == "design":
        title = of.name
        pairs = [
            ("requirements", of.file),
            ("base stage", of.base),
            ("result", f"it {of.state}"),
            ("seed", str(of.seed)),
        ]
        parts += [facts(pairs), notes(of.warnings), notes(of.sentences(), "note")]
    if figure is not None:
        parts.append(shown_figure(f"{anchor}-figure", partial(figure, of), about))
    for one in of.sections(plain=False)[name]:
        parts.append(table(one.head, one.rows, caption=one.caption, numbers=len(one.head) - one.names))
    return PageSection(
        anchor, f"{title}: {of.name}" if several and name != "design" else title, Markup("\n").join(parts)
    )
