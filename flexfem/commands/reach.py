"""How the poses that a drive reaches are printed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from flexfem.commands.tables import DIRECTIONS, ends, numbers, print_ending, table
from flexfem.units import COMMANDS, FORCES, MICROMETRE
from flexfem.verify.limits import grouped

if TYPE_CHECKING:
    from rich.console import Console

    from flexfem.verify.reach import Reach


def print_reach(out: Console, of: Reach) -> None:
    """Print how far a drive goes in every direction, and which limits stop it."""
    load = f" under {numbers(of.load, FORCES)}" if any(of.load) else ""
    out.print(f"poses that the drive reaches within all limits{load}, by {of.model}; stopped by limits of")
    head = ("", "range", *(("finite elements",) if of.elements else ()), "stopped at the low end", "at the high end")
    out.print(table(head, _range_rows(of)))
    solid = "" if of.dimension < 3 else f", {of.volume * COMMANDS[0].factor ** 2 * COMMANDS[2].factor:.5g} um^2 mrad"
    um = MICROMETRE
    out.print(
        f"all poses: {len(of.vertices)} vertices, {len(of.faces)} faces{solid}; about rest a circle of "
        f"{um.factor * of.circle:.4g} {um.plain} in X and Y at theta 0, and a ball of {um.factor * of.ball:.4g} "
        f"{um.plain} with rotations times l3 = {of.lever:g} mm"
    )
    out.print("limits: stroke, contacts that only push, blocking force, yield at the necks of the model; linear")
    out.print(f"stress: {of.stress_accuracy}")
    print_ending(out, of)


def _range_rows(of: Reach) -> Iterator[list[str]]:
    for axis, unit in zip(DIRECTIONS, COMMANDS, strict=True):
        for name in ("held", "free"):
            found, metal = (getattr(each[axis], name) if each else None for each in (of.ranges, of.elements))
            row = [f"{axis}, others {'zero' if name == 'held' else 'free'}", ends(found, unit)]
            row += [ends(metal, unit)] if of.elements else []
            yield [*row, *(("", "") if found is None else (grouped(found.low_by), grouped(found.high_by)))]
