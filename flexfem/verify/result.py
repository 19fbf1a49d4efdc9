"""What a verification found, as it is stored, and what every stored answer says. N, mm, rad throughout."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from flexfem.arrays import AnyArray, Array, first_highest
from flexfem.files.toml import Label
from flexfem.files.writing import digest, write_atomically
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.bands import Convergence, Verdict
from flexfem.verify.case import DIRECTIONS, Analysis, Direction, Drive, Elements

DIGEST = "digest"  # key of a stored record
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


class NeckPeak(Record):
    """The neck with the highest von Mises stress, and that per displacement of the platform: MPa per mm or rad."""

    chain: int
    hinge: str
    stress: float

    @classmethod
    def of(cls, stress: Array) -> NeckPeak:
        """Of stresses (3 chains, 3 hinges) per displacement."""
        chain, position = first_highest(stress)
        return cls(chain=chain + 1, hinge=HINGE_NAMES[position], stress=float(np.max(stress)))


class CurveModels(Record):
    """The two models behind a curve.

    plane : the stage's own choice of plane problem.   layers : of finite elements in three dimensions, in half the
        thickness, 0 in the plane.   band_layers : their share of the bands of the percentages.
    stiffness : (3, 3) analytic, order x, y, theta; compliance : (3, 3) of the finite elements.
    force : (points, 3) loads on the platform, N, N, N mm: by (18), or in a nonlinear case by the exact equilibrium;
        zero where joints are commanded.
    joints, imposed : hinges or pairs of stacks (m,), and (points, m) what they were given: rotations, rad, or strokes,
        mm; empty under a force.
    lever : l3, mm.  neck_stress : (3 chains, 3 hinges) MPa at full command.
    model_peak : of the model, the others held, None where joints are commanded; element_peak : of the finite elements
        with what they were given, by the displacement that they reached.   peak_band : half-width of the latter by
        meshes, None where there is one mesh.
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
    model_peak: NeckPeak | None = None
    element_peak: NeckPeak | None = None
    peak_band: float | None = None
    lever: float
    link_width: float
    platform_radius: float
    hub_radius: float
    hinges: list[HingeDrawing]
    resolution: int
    layers: int = 0
    band_layers: Triple | None = None
    triangles: int
    unknowns: int


class Result(Record):
    """A verification: `curves` holds finite-element minus commanded displacement; percentages as in CONVENTIONS.md.

    drive : what the finite elements were given, and elements : which they are, `drive` and `model` of `case.Case`.
    commanded : mm for x and y, rad for theta.  `error_percent`: the commanded direction relative to the command; cross
    directions with translations relative to a commanded translation, rotations times `lever` (mixed ones likewise).
    uncertainty : for each percentage the band of the mesh, in percentage points.
    assumed, not_stated : key paths of numbers that are assumed, and of those whose source is not stated.
    warnings : where the answers leave what they are meant for, one plain sentence each.
    """

    case: Label
    name: Label
    direction: Direction
    analysis: Analysis = "linear"
    drive: Drive = "force"
    elements: Elements = "fe"
    commanded: list[float]
    curves: dict[Label, Series] = Field(min_length=1)
    error_percent: dict[str, Triple]
    uncertainty: dict[str, dict[Direction, Uncertainty]]
    models: dict[str, CurveModels]
    assumed: list[str]
    not_stated: list[str]
    warnings: list[str]
    versions: dict[str, str]
    written: str
    seconds: float


class Fields(Record):
    """Finite-element fields of one curve at full command: nodes (n, 2) mm, triangles (m, 6), bodies (m,),
    displacement (n, 2) mm, von Mises stress (n,) MPa; in three dimensions the displacement of the mid-plane, and the
    highest stress through the thickness."""

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


def write_record(record: Record, path: Path, **beside: str) -> Path:
    """Store a record as JSON, `beside` and the digest of all of it added, by which readers see a change.

    Returns the path. Raises BadInput when the folder does not take it.
    """
    content = record.model_dump(mode="json") | beside
    text = json.dumps(content | {DIGEST: digest(content)}, indent=1, allow_nan=False)
    write_atomically(path, lambda file: file.write(f"{text}\n".encode()))
    return path
