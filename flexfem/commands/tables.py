"""What commands on one stage print for people: tables of their records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> Table:
    from rich.table import Table

    made = Table(*head, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        made.add_row(*row)
    return made


def print_ending(out: Console, of: Any) -> None:
    """Print the warnings of a record, and how many numbers are in doubt."""
    from flexfem.mechanism.stage_file import doubts_said

    for text in of.warnings:
        out.print(f"warning: {text}")
    for text in doubts_said(of.assumed, of.not_stated):
        out.print(f"{text}: --json lists them")
