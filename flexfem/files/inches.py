"""Files in inches: their lengths are converted to mm before anything else reads them."""

from __future__ import annotations

from typing import Any

from flexfem.files.expressions import Scaled
from flexfem.files.quantities import LONGEST
from flexfem.files.refusals import key_path
from flexfem.files.toml import PathLike, bad_key, in_mm, paths_in

INCH = 25.4  # mm
OF_OWN_UNIT = "parameters"  # table whose keys state the units of their numbers


def in_millimetres(path: PathLike, data: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a file in mm.

    Raises BadInput for a key in mm in a file with `units = "in"`.
    """
    if data.get("units") != "in":
        return data
    for at in paths_in(data):
        if str(at[-1]).endswith("_mm") and at[0] != "provenance":
            expected = 'expected a key that ends in _in: units = "in"'
            raise bad_key(path, at, f"{key_path(at, data)}, {expected}")
    found = dict[str, Any]()
    for key, value in data.items():
        if key == "provenance" and isinstance(value, dict):
            found[key] = {_source_key(name): source for name, source in value.items()}
        elif key in ("provenance", OF_OWN_UNIT):
            found[key] = value
        elif key != "units":
            found[in_mm(key)] = _metric(value, key)
    return found


def _source_key(key: str) -> str:
    """Return the key path of a source in mm."""
    return key if key.startswith(OF_OWN_UNIT) else str(in_mm(key))


def _metric(value: Any, key: str) -> Any:
    """Return the value of a key with lengths, whose keys end in _in, in mm.

    An expression is multiplied.
    """
    if isinstance(value, list):
        return [_metric(each, key) for each in value]
    if isinstance(value, dict):
        return {in_mm(name): _metric(each, name) for name, each in value.items()}
    if not key.endswith("_in") or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return Scaled(value, INCH)
    if isinstance(value, int | float) and abs(value) < LONGEST:
        return float(f"{INCH * value:.15g}")
    return value
