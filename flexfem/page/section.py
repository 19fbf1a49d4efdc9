"""What a page is made of: sections, tables and figures, put together as one file that loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from flexfem.plot.style import headless, rendered

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexfem.results import Result, TextTable

TEMPLATES = Path(__file__).with_name("templates")
NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
FONTS = "'DejaVu Sans', Verdana, sans-serif"  # Verdana's letters are as wide


class PageSection(NamedTuple):
    """A part of a page under a heading; `id` is that of the heading's anchor, once on a page."""

    id: str
    title: str
    html: Markup


@cache
def templates() -> Environment:
    """The templates, with escaping on and an error for a name that is not given."""
    loader = FileSystemLoader(TEMPLATES)
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def markup(template: str, **values: Any) -> Markup:
    """A template filled in; what is no Markup among the values is escaped."""
    return Markup(templates().get_template(template).render(**values))


def html_of(sections: Sequence[PageSection], **page: Any) -> str:
    """The page as the text of a file.

    `page` : title and subtitle, assumptions that it must say first, the command that makes it again, when it was made,
    and versions.
    """
    script, style = ((TEMPLATES / name).read_text() for name in ("page.js", "page.css"))
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()  # this script alone runs
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{allowed}'; "
    policy += "base-uri 'none'; form-action 'none'"
    code = {"policy": policy, "script": Markup(script), "style": Markup(style)}
    return str(markup("page.html", sections=sections, **page, **code))


def table(of: TextTable, sortable: bool = True) -> Markup:
    """A table, nothing without rows; where it is `sortable`, a button in every heading sorts the rows."""
    return markup("table.html", of=of, sortable=sortable and len(of.rows) > 1) if of.rows else Markup("")


def tables_of(found: Result) -> Markup:
    """All tables, sentences and warnings of a result."""
    tables = [table(each, sortable=False) for each in found.tables(plain=False)]
    return Markup("").join([*tables, notes([*found.sentences(), *found.warnings], "note")])


def facts(pairs: Iterable[tuple[str, str | Markup]]) -> Markup:
    """A list of names with their values."""
    return markup("facts.html", pairs=list(pairs))


def notes(texts: Sequence[str], kind: str = "warning") -> Markup:
    """A list of sentences, none for no text; `kind` is warning or note."""
    return markup("notes.html", texts=texts, kind=kind) if texts else Markup("")


def sentence(text: str) -> str:
    """The text with a capital at its beginning and a full stop at its end."""
    whole = text.strip()
    return f"{whole[:1].upper()}{whole[1:]}{'' if whole.endswith(('.', '!', '?')) or not whole else '.'}"


def shown_figure(name: str, draw: Callable[[], Figure], description: str, data: Markup | None = None) -> Markup:
    """A figure of the package as a part of a section, the lines of its header as its caption.

    `name` : its id, once on a page.   `description` : for a screen reader.   `data` : a table of its numbers.
    """
    with headless() as lines:
        figure = draw()
    caption = " ".join(map(sentence, lines))
    svg = inline_svg(figure, name)
    return markup("figure.html", name=name, svg=svg, caption=caption, description=description, data=data)


def inline_svg(figure: Figure, name: str) -> Markup:
    """A figure as an SVG element, at most as wide as it was drawn; its ids begin with `name`."""
    text = NOT_XML.sub("\ufffd", rendered(figure, "svg").decode())
    text = re.sub(r"(?s)<metadata>.*?</metadata>|<defs>\s*<style.*?</defs>", "", text[text.index("<svg") :])
    text = re.sub(r'\b(id="|href="#)', rf"\1{name}-", text.replace("url(#", f"url(#{name}-"))
    text = re.sub(r' d="[^"]*"', lambda m: re.sub(r"(\.\d\d)\d+", r"\1", m[0]), text)  # hundredths of a point
    text = text.replace("'DejaVu Sans'", FONTS)
    width = figure.get_figwidth() * 96.0  # px an inch
    opening = f'<svg class="drawn" style="max-width: {width:.0f}px" '
    text = re.sub(r'<svg |\s(width|height)="[\d.]+pt"', lambda m: opening if m[0] == "<svg " else "", text, count=3)
    return Markup(text)
