"""The parts of a mechanism file and their copies, each with its place."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from flexfem.files.refusals import key_path, shown, suggestion
from flexfem.mechanism.layout import Move
from flexfem.mechanism.parts import BodyHole, Copies, MechanismTables
from flexfem.refused import BadInput

PARTS = ("body", "hinge", "actuator", "point")  # arrays of named parts
MOST = 2000  # parts, copies included


class PlacedPart(NamedTuple):
    """A part of a mechanism file, or a copy of one.

    kind : of `PARTS`.   table : of the file.   bodies : names of the bodies that it joins, or is
    on.   key : key path of the table.   original : name of the part that it copies, else its own.
    move : from the place in the file.
    """

    name: str
    kind: str
    table: Any
    bodies: tuple[str, ...]
    key: str
    original: str
    move: Move = Move()


def placed_parts(
    mechanism: MechanismTables, moves_of: Callable[[Copies], Iterator[Move]] | None = None
) -> list[PlacedPart]:
    """Return all parts and their copies. Raises BadInput for copies that are impossible.

    moves_of : returns the moves from originals to their copies, by default those that are stated.
    """
    found = _stated_parts(mechanism)
    counts = Counter((part.kind, part.original) for part in found)
    for index, copies in enumerate(mechanism.copies):
        key = f"copy[{index}].parts"
        _check_names(copies, found, key)
        originals = [part for part in found if part.name in copies.parts]
        if len(found) + len(originals) * (int(copies.count or 2) - 1) > MOST:
            raise BadInput(f"{key}, expected at most {MOST} parts in all, copies included")
        taken = {(part.kind, part.name) for part in found}
        for move in (moves_of or stated_moves)(copies):
            names = _new_names(originals, counts)
            for kind, name in names.values():
                if (kind, name) in taken:
                    expected = f"expected no other {kind} {shown(name)}, a copy's name"
                    raise BadInput(f"{key}, {expected}")
            found += _copied(originals, names, move)
    return found


def _stated_parts(mechanism: MechanismTables) -> list[PlacedPart]:
    """Return the parts that the file states."""
    found = list[PlacedPart]()
    for kind in PARTS:
        for index, table in enumerate(getattr(mechanism, kind)):
            bodies: tuple[str, ...] = ()
            if kind == "point":
                bodies = (table.body,)
            elif kind != "body":
                bodies = table.between
            key = key_path((kind, index), mechanism)
            found.append(PlacedPart(table.name, kind, table, bodies, key, table.name))
    return found


def _check_names(
    copies: Copies,
    found: list[PlacedPart],
    key: str,
) -> None:
    """Raise BadInput for a part that is not there or is named twice."""
    names = {part.name for part in found}
    for place, name in enumerate(copies.parts):
        if name not in names:
            expected = f"the name of a part{suggestion(name, names)}"
        elif name in copies.parts[:place]:
            expected = "each part once"
        else:
            continue
        raise BadInput(f"{key}[{place}] = {shown(name)}, expected {expected}")


def stated_moves(copies: Copies) -> Iterator[Move]:
    """Yield the moves from an original to its copies."""
    if copies.mirror is None:
        yield from rotations(copies)
        return
    first, second = (complex(*point) for point in copies.mirror)
    turn = (second - first) / (second - first).conjugate()
    yield Move(turn, first - turn * first.conjugate(), mirrored=True)


def rotations(table: Copies | BodyHole) -> Iterator[Move]:
    """Yield the rotations from an original to its copies."""
    count = int(table.count or 1)
    about = complex(*(table.about or (0.0, 0.0)))
    step = 2 * math.pi / count if table.angle is None else table.angle
    for k in range(1, count):
        turn = cmath.exp(1j * k * step)
        yield Move(turn, about - turn * about)


Named = tuple[str, str]  # kind and name of a part


def _new_names(originals: list[PlacedPart], counts: Counter[Named]) -> dict[Named, Named]:
    """Return the names of copies by those of their originals, and count the copies."""
    names = dict[Named, Named]()
    for part in originals:
        counts[part.kind, part.original] += 1
        number = counts[part.kind, part.original]
        names[part.kind, part.name] = (part.kind, f"{part.original} {number}")
    return names


def _copied(
    originals: list[PlacedPart], names: dict[Named, Named], move: Move
) -> Iterator[PlacedPart]:
    """Yield moved copies, on the copies of their bodies where these are copied, too."""
    for part in originals:
        bodies = [names.get(("body", name), ("body", name))[1] for name in part.bodies]
        _, name = names[part.kind, part.name]
        yield part._replace(
            name=name,
            bodies=tuple(bodies),
            move=move.after(part.move),
        )
