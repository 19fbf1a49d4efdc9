"""Baselines as files: read, accept with a reason, check one or a folder of them."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from pydantic import Field, JsonValue, ValidationError

from flexfem.commands.baseline.committed import committed_mesh, mesh_keys
from flexfem.commands.baseline.inputs import Change, Keys, Kind, changes, inputs_of, kind_of
from flexfem.commands.baseline.moves import MISSING, Leaf, Move, moves
from flexfem.commands.baseline.records import meshes, record, settings
from flexfem.commands.baseline.rules import rule_of
from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput
from flexfem.questions.case import LoadedCase
from flexfem.verify.protocol import Solve
from flexfem.verify.result import Record, Result, stamp, versions

Difference: TypeAlias = Change | Move | str
SETTINGS = "settings of flexfem"


class Acceptance(Record):
    """When and why numbers were accepted."""

    when: str
    reason: str = Field(pattern=r"\S")
    versions: dict[str, str]


class Made(Record):
    """What a record was made from, key by key: the input file and those it names, settings of the code, meshes."""

    inputs: dict[str, Keys]
    settings: Keys
    meshes: dict[str, Keys]


class Baseline(Record):
    """What flexfem printed of an input file, relative to the baseline's folder, when it was accepted."""

    kind: Kind
    file: str
    history: list[Acceptance] = Field(min_length=1)
    source: Made
    record: dict[str, JsonValue]


class Checked(NamedTuple):
    """A baseline and what is not as accepted; nothing when all is well."""

    name: str
    findings: list[Difference]

    @staticmethod
    def data(finding: Difference) -> dict[str, Leaf]:
        """A difference by name; `was` or `now` is left out where there is nothing."""
        named = {} if isinstance(finding, str) else finding._asdict()
        return {key: value for key, value in named.items() if value != MISSING}


def folder_of(path: Path) -> Path:
    """Where the baseline of an input file is kept unless told otherwise: `baselines` beside it."""
    return path.parent / "baselines"


def file_of(path: Path, folder: Path) -> Path:
    """The baseline of an input file in a folder."""
    return folder / f"{path.stem}.json"


def places(wanted: Sequence[tuple[Path, Path]]) -> list[tuple[Path, Path]]:
    """Input files with the folders of their baselines, when all can be accepted. Raises BadInput."""
    taken: dict[Path, Path] = {}
    for path, folder in wanted:
        kind_of(path)
        target = file_of(path, folder)
        other = taken.setdefault(target, path)
        if other != path or _owner(target, path) != _relative(path, folder):
            raise BadInput(f"{path}: {target} is the baseline of another file, expected another name or folder")
    return list(wanted)


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _owner(target: Path, path: Path) -> str:
    """The input file of a baseline, relative to its folder; that of a path when there is none yet."""
    return read_baseline(target).file if target.exists() else _relative(path, target.parent)


def source_of(path: Path, folder: Path) -> Made:
    """What a record of an input file would be made from now. Raises BadInput."""
    found = {name: mesh_keys(folder / name) for name in meshes(path) if (folder / name).exists()}
    return Made(inputs=inputs_of(path), settings=settings(kind_of(path)), meshes=found)


def changed(path: Path, folder: Path, baseline: Baseline) -> list[Change]:
    """Keys of what a baseline was made from that are not what they were: of input files, else of the rest."""
    was, now = baseline.source, source_of(path, folder)
    return changes(path.parent, was.inputs, now.inputs) or [
        *changes(None, {SETTINGS: was.settings}, {SETTINGS: now.settings}),
        *changes(folder, was.meshes, now.meshes),
    ]


def check(path: Path, folder: Path, solve: Solve, made: dict[str, Any] | None = None) -> list[Difference]:
    """What is not as the baseline of an input file has it: changed inputs alone, or else numbers that moved.

    Parameters
    ----------
    made : sections of the record that are there already.

    Raises BadInput when there is no baseline, ComputationFailed.
    """
    baseline = read_baseline(file_of(path, folder))
    if found := changed(path, folder, baseline):
        return list(found)
    return list(moves(path.stem, baseline.record, record(path, folder, solve, made), rule_of))


def checked_case(case: LoadedCase, folder: Path, solve: Solve, result: Result) -> Checked:
    """Check the baseline of a case whose result is there already. Raises BadInput, ComputationFailed."""
    return Checked(case.stem, check(case.path, folder, solve, {"result": result}))


def accept(path: Path, folder: Path, reason: str, solve: Solve) -> Path:
    """Make what flexfem prints of an input file its baseline; returns the file. Raises BadInput, ComputationFailed."""
    target = file_of(path, folder)
    history = read_baseline(target).history if target.exists() else []
    for name, stage in meshes(path).items():
        committed_mesh(stage, folder / name)
    baseline = Baseline(
        kind=kind_of(path),
        file=_relative(path, folder),
        history=[*history, Acceptance(when=stamp(), reason=reason.strip(), versions=versions())],
        source=source_of(path, folder),
        record=record(path, folder, solve),
    )
    write_atomically(target, lambda out: out.write(_text(baseline).encode()), again=True)
    return target


def _text(baseline: Baseline) -> str:
    """JSON with every list of numbers on one line."""
    text = json.dumps(baseline.model_dump(mode="json"), indent=1, allow_nan=False)
    return re.sub(r'\[\s[^][{}"]*\]', lambda found: re.sub(r"\s+", " ", found[0]), text) + "\n"


def read_baseline(path: Path) -> Baseline:
    """Read an accepted baseline. Raises BadInput when there is none or it is damaged."""
    try:
        return Baseline.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        raise BadInput(f"{path}: no baseline; flexfem baseline FILE --reason TEXT makes one") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise BadInput(f"{path}: not a baseline: {where}: {first['msg']}") from None
