"""Numbers of a mechanism that sliders change, and their values in the text of its file."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit

from flexfem.files.expressions import Evaluated
from flexfem.files.inputs import may_write
from flexfem.files.refusals import path_of, place_of
from flexfem.files.writing import write_atomically
from flexfem.mechanism.keys import Key, keys
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput
from flexfem.units import unit_of, without_unit

STEPS = 200  # of a slider
LOWEST = 0.5  # ends of a slider relative to the value in the file
HIGHEST = 2.0
FROM_ZERO = 1.0  # half the length of a slider of a number that is zero, in its unit
DIGITS = 6  # significant digits of a number that a slider sets


class Slider(NamedTuple):
    """A number that can be changed: its key path, name, unit, value in the file, and ends."""

    path: str
    name: str
    unit: str
    value: float
    low: float
    high: float
    step: float


def numbers_of(mechanism: Mechanism) -> list[Key]:
    """Return the keys of the numbers that a file states: its parameters, else all its numbers.

    Numbers that are expressions follow the others, and are left out.
    """
    parameters: Mapping[str, Any] = getattr(mechanism, "parameters", {})
    known = keys()
    stated = [
        known[f"parameters.{name}"]
        for name, value in parameters.items()
        if not isinstance(value, Evaluated)
    ]
    if stated:
        return stated
    return [key for key in known.values() if _is_stated(key, mechanism)]


def _is_stated(key: Key, mechanism: Mechanism) -> bool:
    value = key.value_in(mechanism) if key.places_in(mechanism) else None
    stated = key.path if key.element is None else key.path.rpartition("[")[0]
    return isinstance(value, float) and stated in mechanism.numbers


def sliders_of(mechanism: Mechanism) -> list[Slider]:
    """Return a slider for each number, about its value."""
    found = list[Slider]()
    for key in numbers_of(mechanism):
        value = key.value_in(mechanism)
        assert value is not None
        low, high = sorted((LOWEST * value, HIGHEST * value))
        if not value:
            low = -FROM_ZERO
            high = FROM_ZERO
        name = without_unit(key.path.removeprefix("parameters.")).replace("_", " ")
        unit = unit_of(key.path).name
        found.append(Slider(key.path, name, unit, value, low, high, (high - low) / STEPS))
    return found


def changed(mechanism: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """Return a mechanism with other numbers by key path, in the units of the file.

    Raises BadInput for an unknown path, and for numbers with which it cannot be made.
    """
    known = {key.path: key for key in numbers_of(mechanism)}
    changes = dict[str, Any]()
    for path, value in values.items():
        if path not in known:
            raise BadInput(f"{path} is no number of this file, expected one of: {', '.join(known)}")
        if value != known[path].value_in(mechanism):
            known[path].set_in(changes, mechanism, value)
    return mechanism.replace(**changes) if changes else mechanism


def save(path: Path, values: Mapping[str, float]) -> list[str]:
    """Write numbers into a file by their key paths, and change nothing else in its text.

    Returns the paths of the numbers that have changed. Raises BadInput for a file that is not TOML,
    or that has no such number.
    """
    document = _document(path)
    written = list[str]()
    for key, value in values.items():
        *tables, last = path_of(key)
        table: Any = document
        for name in tables:
            table = table[name]
        if _is_number(table[last]) and float(table[last]) != value:
            table[last] = int(value) if value.is_integer() else value
            written.append(key)
    if written:
        may_write(path)
        mode = stat.S_IMODE(path.stat().st_mode)
        place = path.resolve()  # a link stays one
        write_atomically(place, lambda file: file.write(tomlkit.dumps(document).encode()))
        place.chmod(mode)
    return written


def is_in_file(path: Path, key: str) -> bool:
    """Return whether a file states a number at a key path: others have a default, or a name."""
    found: Any = _document(path)
    try:
        for name in path_of(key):
            found = found[name]
    except (LookupError, TypeError):
        return False
    return _is_number(found)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _document(path: Path) -> tomlkit.TOMLDocument:
    """Return the content of a file with its comments and ends of lines."""
    try:
        return tomlkit.parse(path.read_bytes().decode("utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(f"{place_of(path)}: {error}, expected a TOML file") from None
