"""Docstrings here say `name : meaning`, several on one line where they are short; napoleon wants a type there.

Below a heading such as Parameters every name gets a line of its own with its meaning below it; elsewhere, as in the
docstring of a class, names become a list.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

NAMES = r"\*{0,2}[A-Za-z_]\w*(?:(?:, | and )\*{0,2}\w+)*"
ENTRY = re.compile(rf"({NAMES}) : (.*)")
NEXT = re.compile(rf" {{3}}(?={NAMES} : )")
RULE = re.compile(r"-{3,}\s*")
SECTIONS = ("Parameters", "Returns", "Raises", "Notes", "Examples", "Yields", "Attributes")


def restated(lines: list[str]) -> list[str]:
    """The same docstring as napoleon and docutils read it."""
    found, section, inside = list[str](), "", False
    for index, line in enumerate(lines):
        if RULE.fullmatch(line):
            section = lines[index - 1].strip() if lines[index - 1].strip() in SECTIONS else section
        entries = [ENTRY.fullmatch(part.strip()) for part in NEXT.split(line)] if line[:1].strip() else []
        if entries and all(entries) and section in ("", "Parameters", "Attributes"):
            for name, meaning in (entry.groups() for entry in entries if entry):
                if section:
                    found += [name, f"    {meaning}"]
                else:
                    found += [*([""] if not inside and found and found[-1].strip() else []), f"* **{name}**: {meaning}"]
                inside = True
        elif inside and line.startswith("    "):
            found.append(("    " if section else "  ") + line.strip())
        else:
            if inside and line.strip() and not section and found[-1].strip():
                found.append("")
            inside = False
            found.append(line)
    return found


def restate(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = restated(lines)


def without_validators(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str, None] | None:
    """Leave out the signature of a table of a file: its attributes are below, with their types."""
    return ("", None) if what == "class" and hasattr(obj, "model_fields") else None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", restate, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", without_validators)
    return {"parallel_read_safe": True}
