"""What a record is made from, key by key: the input file and the files it names."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

from pydantic import BaseModel

from flexfem.commands.baseline.moves import MISSING, Leaf, became, leaves, printable
from flexfem.files.refusals import key_path
from flexfem.files.toml import read_toml, validate
from flexfem.mechanism.stage import load_stage
from flexfem.mechanism.stage_file import of_drive, of_heat
from flexfem.refused import BadInput
from flexfem.verify.case import Case

Kind: TypeAlias = Literal["case", "study", "stage", "chart"]
Keys: TypeAlias = dict[str, Leaf]
TELLTALE: dict[str, Kind] = {"curve": "case", "sampling": "study", "chain": "stage"}
MODELS: dict[Kind, Callable[[Path], BaseModel]] = {
    "case": lambda path: validate(Case, path),
    "stage": load_stage,
}
DATA = Path(__file__).parents[2] / "data"  # the charts that the analytic model reads


class Change(NamedTuple):
    """A key of an input that is not what the baseline was made from."""

    file: str
    key: str
    was: Leaf
    now: Leaf

    def __str__(self) -> str:
        """One line for people."""
        return printable(f"the input changed: {self.file}: {self.key} {became(self.was, self.now)}")


def kind_of(path: Path) -> Kind:
    """What an input file is. Raises BadInput when it is nothing that has a baseline."""
    if path.suffix == ".json" and path.resolve().parent == DATA.resolve():
        return "chart"
    data = read_toml(path).data
    for key, kind in TELLTALE.items():
        if key in data:
            return kind
    raise BadInput(f"{path}: expected a stage, a case, a study, or a chart of flexfem itself")


def keys_of(path: Path) -> Keys:
    """Every key of an input file by its path in the file, in file units; defaults are filled in.

    A stage's drive and its coefficients of expansion are left out: no record is made of them. So is what says which
    hinge an override is about: the names of its other keys say so too, and the order of overrides says nothing.
    """
    kind = kind_of(path)
    if kind == "chart":
        data = json.loads(path.read_bytes())
    else:
        data = read_toml(path).data
        if kind in MODELS:
            data = _completed(MODELS[kind](path), data)
    found = {key_path(key, data): value for key, value in leaves(data).items()}
    left_out = (of_drive, of_heat, _by_place)
    return {key: value for key, value in found.items() if kind != "stage" or not any(each(key) for each in left_out)}


def _by_place(key: str) -> bool:
    """Whether a key says which hinge an override is about; baselines of earlier versions hold such keys."""
    return re.fullmatch(r"override\[\d+\]\.(chain|hinge)", key) is not None


def _completed(table: BaseModel, data: Mapping[str, Any]) -> dict[str, Any]:
    """What a file says, with the values of the keys that it leaves to their defaults."""
    found, stated = dict(data), table.model_dump(by_alias=True)
    for name, field in type(table).model_fields.items():
        key, value = field.alias or name, getattr(table, name)
        if key not in data:
            if isinstance(value, str | float | int):
                found[key] = stated[key]
        elif isinstance(value, BaseModel):
            found[key] = _completed(value, data[key])
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            found[key] = [_completed(one, part) for one, part in zip(value, data[key], strict=True)]
    return found


def inputs_of(path: Path) -> dict[str, Keys]:
    """Keys of an input file and of the files that it names, by file; those as the input file names them.

    Raises BadInput when one cannot be used.
    """
    keys = keys_of(path)
    found = {path.name: keys}
    for value in keys.values():
        other = path.parent / str(value)
        if isinstance(value, str) and value not in found and os.path.isfile(other):
            found[value] = keys_of(other) if other.suffix == ".toml" else {"sha256": file_hash(other)}
    return found


def file_hash(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def changes(folder: Path | None, was: Mapping[str, Keys], now: Mapping[str, Keys]) -> list[Change]:
    """Keys that are not what they were, by file; files are relative to the folder where one is given."""
    found = []
    for file in [*was, *(file for file in now if file not in was)]:
        old = {key: value for key, value in was.get(file, {}).items() if not _by_place(key)}
        new = now.get(file, {})
        shown = file if folder is None else os.path.normpath(folder / file)
        for key in [*old, *(key for key in new if key not in old)]:
            before, after = old.get(key, MISSING), new.get(key, MISSING)
            if before != after:
                found.append(Change(shown, key, before, after))
    return found
