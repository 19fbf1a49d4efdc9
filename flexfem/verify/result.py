"""What a verification found, as it is stored, and what every stored answer says. N, mm, rad throughout."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from flexfem.arrays import AnyArray, Array, first_highest
from flexfem.files.writing import digest, write_atomically
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.bands import Convergence, Verdict
from flexfem.units import DIRECTIONS

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
