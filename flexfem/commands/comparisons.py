"""What commands that compare print for people: error percentages, shares and meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from flexfem.commands.reach import print_reach
from flexfem.commands.tables import DIRECTIONS, print_ending, table
from flexfem.terminal import people
from flexfem.units import COMMANDS

if TYPE_CHECKING:
    from flexfem.verify.workspace import Point, Workspace

MODELS = ("without", "tangent", "exact", "elements", "loaded")  # of `workspace`, and what they are called
MODEL_NAMES = ("(16) less its terms", "(16)", "exact", "elements", "elements, same load")
KINDS = {
    "stiffness": "tangent stiffness, change from rest",
    "position": "linear position error, along",
    "across": "linear position error, across",
}


def print_workspace(of: Workspace) -> None:
    """Print what the terms of (16) and large displacements are worth, at a tenth of the commands and at all of them."""
    out = people()
    against = f"nonlinear finite elements of {of.unknowns} unknowns"
    out.print(f"{of.stage}: large displacements, mobility {of.mobility}, {of.formula}, against {against}")
    out.print(table(("per cent", "commanded", "at", *MODEL_NAMES), _travelled(of)))
    for box, size in ((of.small, "a tenth of these commands"), (of.box, "all of them")):
        out.print(
            f"anywhere within {size}: linear position off by up to {box.position:.3f} %, the second-order terms of "
            f"(16) change the tangent compliance by up to {box.terms:.3f} %"
        )
    print_ending(out, of)
    if of.reach is None:
        out.print(of.no_reach)
    else:
        print_reach(out, of.reach)


def _travelled(of: Workspace) -> Iterator[tuple[str, ...]]:
    for kind, name in KINDS.items():
        for axis, unit in zip(DIRECTIONS, COMMANDS, strict=True):
            for point in of.travel[axis].points:
                yield (name, axis, f"{unit.factor * point.commanded:+g} {unit.plain}", *_of_models(point, kind))


def _of_models(point: Point, kind: str) -> Iterator[str]:
    found = getattr(point, kind)
    return (f"{found[model]:+z.4f}" if model in found else "" for model in MODELS)
