"""What can be drawn of a mechanism file that is not finished: parts that cannot be read are left
out and named.
"""

from __future__ import annotations

import copy
import re
from contextlib import suppress
from typing import Any, NamedTuple

from pydantic import ValidationError

from flexfem.files.inches import in_millimetres
from flexfem.files.refusals import KeyPath, one_line, path_of, problems_of, sentence
from flexfem.files.toml import PathLike, TomlFile, read_toml
from flexfem.mechanism.assembly import layout_of
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.materials import with_material_of_file
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile, read_mechanism
from flexfem.mechanism.plate_checks import ungrounded
from flexfem.refused import BadInput

STAND_INS: dict[str, Any] = {  # for keys without which no file can be read; none of them is drawn
    "name": "unfinished mechanism",
    "thickness_mm": 1.0,
    "material": {"name": "al-7075-t6"},
    "output": {"body": "?", "at_mm": [0.0, 0.0]},
}
MOST = 10_000  # faults


class Unfinished(NamedTuple):
    """The readable part of a file, and a text for everything that is missing or at fault.

    layout : of the readable part; None for the layout of the mechanism.
    """

    mechanism: Mechanism
    layout: Layout | None
    missing: list[str]


class _Reading:
    """The content of a file, from which parts at fault are removed, and what was said of them."""

    def __init__(self, path: PathLike) -> None:
        self.file: TomlFile = read_toml(path)
        self.data: dict[str, Any] = copy.deepcopy(in_millimetres(path, self.file.data))
        self.numbers = {
            key: [*range(len(part))] for key, part in self.data.items() if isinstance(part, list)
        }
        self.missing = list[str]()
        for key in STAND_INS:
            if key not in self.data:
                self.stand_in(key, f"{key} is missing")
        # a file of materials that cannot be read is a fault of the material
        with suppress(BadInput):
            self.data = with_material_of_file(path, self.data)

    def stand_in(
        self,
        key: str,
        text: str,
    ) -> None:
        """Name a fault of a required key and replace it."""
        self.missing.append(text)
        self.data[key] = STAND_INS[key]

    def said(
        self,
        text: str,
        at: KeyPath,
    ) -> str:
        """Return a text about a key with the number of its part in the file, and the line."""
        if len(at) > 1 and at[0] in self.numbers and isinstance(at[1], int):
            own = self.numbers[str(at[0])][at[1]]
            text = text.replace(f"{at[0]}[{at[1]}]", f"{at[0]}[{own}]", 1)
            at = (at[0], own, *at[2:])
        line = self.file.line(at)
        return one_line(text if line is None else f"line {line}: {text}")

    def remove(
        self,
        at: KeyPath,
        text: str,
    ) -> None:
        """Name a fault and remove the part that has it.

        Raises BadInput where there is no such part.
        """
        text = self.said(text, at)
        key = str(at[0]) if at else ""
        if key in STAND_INS and self.data[key] != STAND_INS[key]:
            self.stand_in(key, text)
            return
        if key not in self.data:
            raise BadInput(text)
        if key != "provenance":  # sources of what was removed are no fault
            self.missing.append(text)
        inside = self.data[key]
        if (
            key == "copy"
            and "parts" in at
            and isinstance(at[-1], int)
            and len(inside[at[1]]["parts"]) > 1
        ):
            del inside[at[1]]["parts"][at[-1]]
        elif isinstance(inside, list) and len(at) > 1 and isinstance(at[1], int):
            del inside[at[1]]
            del self.numbers[key][at[1]]
        elif key in ("parameters", "provenance") and len(at) > 1:
            del inside[at[1]]
        else:
            del self.data[key]


def read_drawable(path: PathLike) -> Unfinished:
    """Read a mechanism file, or what can be drawn of an unfinished one.

    A connection to ground may be missing, too.

    Raises BadInput as `read_mechanism` for a file without a body that can be drawn.
    """
    try:
        mechanism = read_mechanism(path)
    except BadInput as refusal:
        try:
            return _without_faults(path)
        except BadInput:
            raise refusal from None
    return Unfinished(mechanism, mechanism.layout, ungrounded(mechanism.layout))


def _without_faults(path: PathLike) -> Unfinished:
    reading = _Reading(path)
    for _ in range(MOST):
        absent = list[str]()
        try:
            mechanism = MechanismFile.model_validate(reading.data)
            layout = layout_of(mechanism, absent)
        except ValidationError as error:
            problems = problems_of(error, reading.data)
            last = max(
                problems,
                key=lambda each: [part if isinstance(part, int) else -1 for part in each.path[1:2]],
            )
            reading.remove(last.path, sentence(last, MechanismFile, reading.data))
        except BadInput as refusal:
            reading.remove(_key_of(refusal.reason, reading.data), refusal.reason)
        else:
            if reading.data["output"] == STAND_INS["output"]:
                absent = [text for text in absent if not text.startswith("output.body")]
            said = [reading.said(text, _key_of(text, reading.data)) for text in absent]
            texts = [*reading.missing, *said, *ungrounded(layout)[: not absent]]
            return Unfinished(mechanism, layout, list(dict.fromkeys(texts)))
    raise BadInput("too many faults")


def _key_of(text: str, data: dict[str, Any]) -> KeyPath:
    """Return the path of the key with which a text begins, () without one."""
    found = re.match(r"(?:\.?\w+|\[\d+\])*", text)
    with suppress(ValueError):
        return path_of(found[0] if found else "", data)
    return ()
