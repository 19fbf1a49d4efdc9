"""What a verification found, as it is stored: numbers as JSON, fields beside it as .npz. N, mm, rad throughout."""

from __future__ import annotations

import contextlib
import json
import os
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import place_of
from flexfem.files.toml import kind_of, read_toml
from flexfem.files.writing import read_arrays, write_atomically
from flexfem.refused import BadInput
from flexfem.stage.schema import Stage
from flexfem.verify.case import DIRECTIONS, Analysis, Direction, Drive
from flexfem.verify.errors import Convergence, Verdict

PACKAGES = ("flexfem", "numpy", "scipy", "scikit-fem", "gmsh")
Matrix = list[list[float]]


class Record(BaseModel):
    """Stored data: frozen, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class OfStage(Record):
    """What every answer on one stage says of it.

    file : where it was read, "" without a file.   hash : of its physical content.
    assumed, not_stated : key paths of numbers that are assumed, and of those whose source is not stated.
    """

    file: str
    hash: str
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]


def about(stage: Stage) -> dict[str, Any]:
    """The fields of `OfStage`, but for the warnings."""
    doubts = {"assumed": list(stage.assumed), "not_stated": list(stage.not_stated)}
    return {"file": str(stage.origin), "hash": stage.hash, **doubts, "versions": versions()}


class Triple(Record):
    """One number for each of the platform's freedoms."""

    x: float
    y: float
    theta: float

    @classmethod
    def of(cls, values: Array) -> Triple:
        """Of values (3,)."""
        return cls(**dict(zip(DIRECTIONS, values.tolist(), strict=True)))


class Series(Record):
    """One list of numbers for each of the platform's freedoms."""

    x: list[float]
    y: list[float]
    theta: list[float]


class Uncertainty(Record):
    """Mesh uncertainty of a number, see `errors.Convergence`; its values on every resolution."""

    resolutions: list[int]
    values: list[float]
    verdict: Verdict
    order: float
    observed: float | None
    extrapolated: float
    band: float

    @classmethod
    def of(cls, found: Convergence) -> Uncertainty:
        """A convergence as it is stored: lists, and None for nan."""
        data = found._asdict() | {"observed": None if np.isnan(found.observed) else found.observed}
        resolutions = [int(n) for n in found.resolutions]
        return cls(**(data | {"resolutions": resolutions, "values": found.values.tolist()}))


class HingeDrawing(Record):
    """One hinge as modelled: centre (mm), direction of the neck (rad), radius and neck (mm), freedoms."""

    chain: int
    hinge: str
    centre: tuple[float, float]
    axis: float
    radius: float
    neck: float
    freedoms: list[str]


class Model(Record):
    """The two models behind a curve.

    plane : the stage's own choice of plane problem.
    stiffness : (3, 3) analytic, order x, y, theta; compliance : (3, 3) of the finite elements.
    force : (points, 3) loads on the platform, N, N, N mm: by (18), or in a nonlinear case by the exact equilibrium;
        zero where joints are commanded.
    joints, imposed : hinges or pairs of stacks (m,), and (points, m) what they were given: rotations, rad, or strokes,
        mm; empty under a force.
    lever : l3, mm.  neck_stress : (3 chains, 3 hinges) MPa at full command.
    """

    stage: str
    file: str
    hash: str
    plane: str = "plane_stress"
    mobility: int
    formula: str
    formula_in_range: bool
    links: bool = False
    assumed: list[str]
    not_stated: list[str]
    stiffness: Matrix
    compliance: Matrix
    force: Matrix
    joints: list[str] = []
    imposed: Matrix = []
    neck_stress: Matrix
    lever: float
    link_width: float
    platform_radius: float
    hub_radius: float
    hinges: list[HingeDrawing]
    resolution: int
    triangles: int
    unknowns: int


class Result(Record):
    """A verification: `curves` holds finite-element minus commanded displacement; percentages as in CONVENTIONS.md.

    drive : what the finite elements were given, see `case.Case`.
    commanded : mm for x and y, rad for theta.  `error_percent`: the commanded direction relative to the command; cross
    directions with translations relative to a commanded translation, rotations times `lever` (mixed ones likewise).
    uncertainty : for each percentage the band of the mesh, in percentage points.
    assumed, not_stated : key paths of numbers that are assumed, and of those whose source is not stated.
    warnings : where the answers leave what they are meant for, one plain sentence each.
    """

    case: str
    name: str
    direction: Direction
    analysis: Analysis = "linear"
    drive: Drive = "force"
    commanded: list[float]
    curves: dict[str, Series]
    error_percent: dict[str, Triple]
    uncertainty: dict[str, dict[Direction, Uncertainty]]
    models: dict[str, Model]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]
    written: str
    seconds: float


class Fields(Record):
    """Finite-element fields of one curve at full command: nodes (n, 2) mm, triangles (m, 6), bodies (m,),
    displacement (n, 2) mm, von Mises stress (n,) MPa."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    nodes: AnyArray
    triangles: AnyArray
    bodies: AnyArray
    displacement: AnyArray
    stress: AnyArray


def stamp() -> str:
    """The time, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def versions() -> dict[str, str]:
    """Versions of the packages that move numbers."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed as a package"
    return found


def write_result(result: Result, fields: dict[str, Fields], folder: Path) -> Path:
    """Store a result as `<case>.json`, its fields as `<case>.npz`; returns the path of the former."""
    arrays = {
        f"{index}.{key}": value
        for index, label in enumerate(result.curves)
        for key, value in fields[label].model_dump().items()
    }
    write_atomically(
        folder / f"{result.case}.npz", lambda file: np.savez_compressed(file, allow_pickle=False, **arrays)
    )
    return write_record(result, folder / f"{result.case}.json")


def write_record(record: Record, path: Path) -> Path:
    """Store a record as JSON; returns the path. Raises BadInput when the folder does not take it."""
    write_atomically(path, lambda file: file.write((record.model_dump_json(indent=1) + "\n").encode()))
    return path


def read_result(path: str | os.PathLike[str]) -> Result:
    """Read a stored result. Raises BadInput when it is none."""
    try:
        return Result.model_validate_json(Path(path).read_bytes())
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{place_of(path)}: {_no_result(path, error)}") from None


def _no_result(path: str | os.PathLike[str], error: ValidationError) -> str:
    """What a file is that is no result: of another kind, of another version, or damaged."""
    first = error.errors(include_url=False)[0]
    if first["type"] == "json_invalid":
        with contextlib.suppress(BadInput):
            found = kind_of(read_toml(path).data)
            return f"this is a {found or 'TOML file'}, expected a result of flexfem verify, <case>.json"
        return "not a result of flexfem verify: no JSON"
    keys = json.loads(Path(path).read_bytes())
    if not isinstance(keys, dict) or not {"case", "curves"} <= set(keys):
        return "this is JSON, but not a result of flexfem verify, <case>.json"
    where = ".".join(map(str, first["loc"]))
    return f"not a result of this version of flexfem verify, which would make it again: {where}: {first['msg']}"


def read_fields(path: str | os.PathLike[str], result: Result) -> dict[str, Fields]:
    """Read the fields stored beside a result. Raises BadInput when they are missing or of another result."""
    beside = Path(path).with_suffix(".npz")
    arrays = read_arrays(beside, f"the fields of {path}")
    try:
        return {
            label: Fields(**{key: arrays[f"{index}.{key}"] for key in Fields.model_fields})
            for index, label in enumerate(result.curves)
        }
    except KeyError as error:
        raise BadInput(f"{beside}: expected the fields of {path}: it has no {error}") from None
