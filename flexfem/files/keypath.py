"""Key paths: what a key of a file is called, the same in refusals, in `[provenance]`, in study files and in baselines.

Tables go by their keys and members of an array by their place, from 0: `hinges.base.neck_mm`,
`chain.link_lengths_mm[0]`, `factor[1].sd`. Where a member of an array says which thing it is about, it goes by that,
wherever it stands: `override.2.elbow.neck_mm` is the neck of the elbow hinge of chain 2,
`override.2.actuator.base.preload_n` the preload of the actuator "base" there.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, TypeAlias

KeyPath: TypeAlias = tuple[str | int, ...]

ABOUT = {  # by array: the keys of a member that say which it is
    "override": ("chain", "hinge"),
    "actuator": ("name",),
    "neck": ("chain", "hinge"),
}
LONGEST = 60  # characters of a key
_BARE = re.compile(r"[A-Za-z0-9_-]+")  # as TOML has it
_PLAIN = re.compile(r'[^.\[\]"]{1,60}')  # needs no quotes to be read back
_PART = re.compile(r'\[(?P<place>\d+)\]|(?:^|\.)(?:(?P<bare>[^.\[\]"]+)|(?P<quoted>"(?:[^"\\]|\\.)*"))')


def key_path(path: KeyPath, data: Any = None) -> str:
    """The text of a path of keys and places; `data`, tables or a model of them, tells what members are about.

    A key that says which member it is, right or wrong, is itself found by place: `override[0].chain`.
    """
    text, inside = "", data
    for index, part in enumerate(path):
        inside = _inside(inside, part)
        if isinstance(part, int):
            array, below = (path[index - 1] if index else ""), (*path[index + 1 : index + 2],)
            about = () if below and below[0] in ABOUT.get(str(array), ()) else _about(str(array), inside)
            text += "".join(f".{each}" for each in about) or f"[{part}]"
        else:
            text += f".{part if _PLAIN.fullmatch(part) and part.isprintable() else as_key(part)}"
    return text.removeprefix(".")


def path_of(text: str, data: Any = None) -> KeyPath:
    """The path of keys that a text says, with places for what members are about where `data` has them.

    Raises ValueError when it is no key path.
    """
    parts, end = list[str | int](), 0
    while end < len(text):
        found = _PART.match(text, end)
        if found is None:
            raise ValueError(f"{text}: no key path")
        end = found.end()
        parts.append(int(found["place"]) if found["place"] else found["bare"] or json.loads(found["quoted"]))
    return tuple(parts) if data is None else _placed(parts, data)


def _placed(parts: list[str | int], data: Any) -> KeyPath:
    for index, part in enumerate(parts):
        data = _inside(data, part)
        arrayed = str(part) in ABOUT and isinstance(data, list | tuple)
        for place, member in enumerate(data if arrayed else ()):
            about = _about(str(part), member)
            if about and about == tuple(parts[index + 1 : index + 1 + len(about)]):
                return (*parts[: index + 1], place, *parts[index + 1 + len(about) :])
    return tuple(parts)


def _about(array: str, member: Any) -> tuple[str, ...]:
    """What a member of an array is about, nothing where it does not say so in plain numbers and words."""
    values = tuple(_inside(member, key) for key in ABOUT.get(array, ()))
    if array == "override" and values[1] is None:
        values = (values[0], "actuator", _inside(member, "actuator"))
    plain = all(type(value) in (int, str) and re.fullmatch(r"\w{1,20}", str(value)) for value in values)
    return tuple(map(str, values)) if plain else ()


def _inside(data: Any, part: str | int) -> Any:
    if isinstance(data, Mapping):
        return data.get(part)
    if isinstance(data, list | tuple):
        return data[part] if isinstance(part, int) and part < len(data) else None
    return getattr(data, part, None) if isinstance(part, str) else None


def as_key(key: str) -> str:
    """A key as TOML writes it, clipped where it is long."""
    text = key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=not key.isprintable())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
