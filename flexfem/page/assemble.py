"""A page put together from its sections, one file that loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from flexfem.page.section import PageSection, markup, templates


@dataclass(frozen=True)
class Page:
    """A page: its title, a line below it, what it must say first of numbers in doubt, its sections.

    command : line that makes it again.   made : time, UTC.   doubts : "" without any.
    """

    title: str
    subtitle: str
    doubts: str
    sections: Sequence[PageSection]
    command: str
    made: str
    versions: dict[str, str]


def html_of(page: Page) -> str:
    """The page as the text of a file."""
    scripts = [file_text("page.js"), *dict.fromkeys(each.script for each in page.sections if each.script)]
    styles = [file_text("page.css"), *dict.fromkeys(each.style for each in page.sections if each.style)]
    return str(
        markup(
            "page.html",
            page=page,
            policy=policy(scripts),
            scripts=[Markup(text) for text in scripts],
            styles=[Markup(text) for text in styles],
        )
    )


def policy(scripts: Sequence[str]) -> str:
    """Content security policy under which these scripts alone run and nothing is loaded."""
    hashes = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts)
    allowed = " ".join(f"'sha256-{each}'" for each in hashes)
    return (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {allowed}; "
        "base-uri 'none'; form-action 'none'"
    )


def file_text(name: str) -> str:
    """A file beside the templates as it is."""
    loader = templates().loader
    assert loader is not None
    return loader.get_source(templates(), name)[0]
