"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]], align: str = "") -> str:
    """A table in Markdown, without a line end after it.

    Parameters
    ----------
    align : a letter a column, l or r for numbers, flush right; columns beyond it are l.
    """
    rule = ["---:" if side == "r" else "---" for side in align.ljust(len(head), "l")]
    lines = [head, rule, *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("|" + "".join(f" {cell} |" if cell else " |" for cell in line) for line in lines)
