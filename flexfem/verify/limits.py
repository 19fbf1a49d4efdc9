"""Names of the limits of a drive: what kind they are, and how they are said together."""

from __future__ import annotations

from collections.abc import Sequence

KINDS = ("stroke", "contact", "blocking force", "yield")  # what the name of a limit begins with, before " of "


def kinds(by: Sequence[str]) -> tuple[str, ...]:
    """What kinds of limits these are, in the order of `KINDS`."""
    return tuple(kind for kind in KINDS if any(name.startswith(f"{kind} of ") for name in by))


def grouped(by: Sequence[str]) -> str:
    """Names of limits in a line, kind by kind."""
    found = {kind: [n.removeprefix(f"{kind} of ") for n in by if n.startswith(f"{kind} of ")] for kind in kinds(by)}
    return "; ".join(f"{kind}: {' | '.join(names)}" for kind, names in found.items())
