"""What a page is made of: sections, figures and tables, everything that is not markup escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, TypeAlias

from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup


@dataclass(frozen=True)
class PageSection:
    """A part of a page under a heading of its own.

    id : of the heading's anchor, once on a page.   html : what is below the heading.
    script : plain JavaScript that the section needs, put once at the end of the page whichever sections share it.
    style : CSS that the section needs, likewise.
    """

    id: str
    title: str
    html: Markup
    script: str = ""
    style: str = ""


@dataclass(frozen=True)
class PageFigure:
    """An inline figure with what a reader sees below it and what a screen reader says of it.

    svg : of `inline.inline_svg`.   data : a table of its numbers, which the page folds away below it.
    """

    svg: Markup
    caption: str
    description: str
    data: Markup | None = None


class Cell(NamedTuple):
    """A cell of a table whose place in the sorted order is not that of its text.

    key : number or text to sort by.
    """

    text: str | Markup
    key: float | str


Content: TypeAlias = str | Markup | Cell


@cache
def templates() -> Environment:
    """The templates, with escaping on and an error for a name that is not given."""
    return Environment(
        loader=PackageLoader("flexfem.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def markup(template: str, **values: Any) -> Markup:
    """A template filled in; what is no Markup among the values is escaped."""
    return Markup(templates().get_template(template).render(**values))


def figure_html(figure: PageFigure, name: str) -> Markup:
    """A figure as a part of a section; `name` is its id, once on a page."""
    return markup("figure.html", figure=figure, name=name)


def table(
    headers: Sequence[str],
    rows: Iterable[Sequence[Content]],
    sortable: bool = True,
    caption: str = "",
    numbers: int = 0,
) -> Markup:
    """A table whose first column names the rows and whose last `numbers` columns are set as numbers.

    sortable : a button in every heading sorts the rows, where there is more than one.
    """
    made = [[cell if isinstance(cell, Cell) else Cell(cell, "") for cell in row] for row in rows]
    first = len(headers) - numbers
    return markup("table.html", headers=headers, rows=made, sortable=sortable, caption=caption, first=first)


def facts(pairs: Iterable[tuple[str, str | Markup]]) -> Markup:
    """A list of names with their values."""
    return markup("facts.html", pairs=list(pairs))


def notes(texts: Sequence[str], kind: str = "warning") -> Markup:
    """A list of sentences, none for no text; `kind` is warning or note."""
    return markup("notes.html", texts=texts, kind=kind) if texts else Markup("")


def json_data(name: str, value: Any) -> Markup:
    """Data for a section's script as an inert element with the id `name`."""
    return Markup('<script type="application/json" id="{}">{}</script>').format(name, htmlsafe_json_dumps(value))
