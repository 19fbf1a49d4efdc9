"""What `Stage.replace` is given, merged into what a stage holds, both by attribute name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from flexfem.files.refusals import shown
from flexfem.refused import BadInput
from flexfem.stage.inside import plain
from flexfem.stage.materials import with_changes
from flexfem.stage.tables import CHAINS, HINGE_NAMES, Hinge

OF_HINGES = tuple(Hinge.model_fields)  # attributes that may be given without naming the table


def merged_changes(held: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a changed stage; `held` is its `model_dump`, changes are as `Stage.replace` takes them.

    Raises BadInput for an override that names no hinge.
    """
    content, given = plain(held), {name: _plain(value) for name, value in changes.items()}
    for name in [name for name in OF_HINGES if name in given]:
        value = given.pop(name)
        by_hinge = value if isinstance(value, dict) else dict.fromkeys(HINGE_NAMES, value)
        content = _merge(content, {"hinges": {hinge: {name: each} for hinge, each in by_hinge.items()}})
    if "material" in given:
        value = given.pop("material")
        named = {"name": value} if isinstance(value, str) else value
        content["material"] = with_changes(content["material"], value) if isinstance(value, dict) else named
    if isinstance(given.get("override"), dict):
        content["override"] = _overridden(content.get("override", []), given.pop("override"))
    return dict(_merge(content, given))


def _overridden(held: list[Any], given: Mapping[Any, Any]) -> list[Any]:
    found = {(each["chain"], each["hinge"]): each for each in held}
    for place, values in given.items():
        chain, hinge = place if isinstance(place, tuple) and len(place) == 2 else (None, place)
        if chain not in CHAINS or hinge not in HINGE_NAMES:
            names = ", ".join(HINGE_NAMES)
            raise BadInput(f"override: no hinge {shown(str(place))}, expected (1, 2 or 3, one of {names})")
        found[chain, hinge] = found.get((chain, hinge), {"chain": chain, "hinge": hinge}) | dict(values)
    return list(found.values())


def _merge(old: Any, new: Any) -> Any:
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return old | {key: _merge(old.get(key), value) for key, value in new.items()}


def _plain(value: Any) -> Any:
    """A table built in Python by its content, which replaces what is held as far as it says anything."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_unset=True)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return {key: _plain(item) for key, item in value.items()} if isinstance(value, Mapping) else plain(value)
