"""Regression: every number a case produces against the numbers we once accepted, and the reason why we did.

A baseline is ours, not the truth: it says that a number moved, never that it was right. Three kinds of numbers are
kept apart because they repeat to different digits: the analytic ones, finite elements on a committed mesh, and finite
elements on a mesh made afresh.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from flexfem.arrays import AnyArray, Array
from flexfem.design import Stage
from flexfem.errors import BadInput
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import plate_of, platform_response
from flexfem.files import read_arrays, write_atomically
from flexfem.verify.case import DIRECTIONS, LoadedCase
from flexfem.verify.result import Model, Record, Result, stamp, versions, write_record

ANALYTIC = 1e-12  # relative: closed forms and 6 x 6 algebra
COMMITTED_MESH = 1e-8  # relative: the same equations, solved by another library
FRESH_MESH = 5e-5  # relative: another gmsh makes another mesh; 1.5e-6 was seen between two versions
CROSS = 5e-6  # of the command: what FRESH_MESH leaves to a displacement that should be zero
COARSE = 2  # triangles across the necks of a committed mesh


class Metric(Record):
    """One number, how far it may move and in which unit."""

    value: float
    allowed: float
    unit: str


class Acceptance(Record):
    """When and why numbers were accepted."""

    when: str
    reason: str
    versions: dict[str, str]


class Baseline(Record):
    """Accepted numbers of a case; `meshes` names the committed mesh of each curve."""

    case: str
    history: list[Acceptance]
    meshes: dict[str, str]
    metrics: dict[str, Metric]


class Move(NamedTuple):
    """A number that is not where the baseline has it; None where there is none."""

    case: str
    metric: str
    was: Metric | None
    now: Metric | None

    def __str__(self) -> str:
        """One line for people: was, is, allowed."""
        name = f"{self.case}: {self.metric}"
        if self.was is None or self.now is None:
            present = self.was or self.now
            assert present is not None
            return f"{name} {'is new' if self.was is None else 'is gone'}: {present.value:.15g} {present.unit}"
        change = self.now.value - self.was.value
        return (
            f"{name} was {self.was.value:.15g}, is {self.now.value:.15g}, "
            f"moved {change:+.3g}, allowed {self.was.allowed:.2g} {self.was.unit}"
        )


def baseline_folder(loaded: LoadedCase) -> Path:
    """Where the baselines of a case are kept unless told otherwise: `tests/baselines` beside the folder of cases."""
    return loaded.path.resolve().parent.parent / "tests" / "baselines"


def check(loaded: LoadedCase, result: Result, folder: Path) -> list[Move]:
    """Numbers that moved from the baseline by more than allowed, in the baseline's order; none when all is well.

    Raises BadInput when there is no baseline for the case.
    """
    baseline = read_baseline(folder / f"{loaded.stem}.json")
    now = metrics(loaded, result, {label: read_mesh(folder / name) for label, name in baseline.meshes.items()})
    moves = []
    for name in [*baseline.metrics, *(name for name in now if name not in baseline.metrics)]:
        was, new = baseline.metrics.get(name), now.get(name)
        if was is None or new is None or not abs(new.value - was.value) <= was.allowed:
            moves.append(Move(loaded.stem, name, was, new))
    return moves


def accept(loaded: LoadedCase, result: Result, folder: Path, reason: str) -> Path:
    """Make the numbers of a result the baseline of its case, with a reason; returns the file.

    A committed mesh is kept as long as its stage is the same. Raises BadInput when the reason is empty.
    """
    if not reason.strip():
        raise BadInput("--reason is empty, expected why the numbers may move")
    path = folder / f"{loaded.stem}.json"
    history = read_baseline(path).history if path.exists() else []
    names, meshes = {}, {}
    for curve in loaded.case.curve:
        stage = loaded.stages[curve.label]
        names[curve.label] = f"{loaded.stage_path(curve).stem}-{stage.hash[:8]}.npz"
        meshes[curve.label] = _committed_mesh(stage, folder / names[curve.label])
    entry = Acceptance(when=stamp(), reason=reason.strip(), versions=versions())
    found = metrics(loaded, result, meshes)
    baseline = Baseline(case=loaded.stem, history=[*history, entry], meshes=names, metrics=found)
    return write_record(baseline, path)


def metrics(loaded: LoadedCase, result: Result, meshes: dict[str, StageMesh]) -> dict[str, Metric]:
    """Every number of a case that is watched, by name."""
    found = {}
    for label, model in result.models.items():
        for name, metric in (_analytic(model) | _fresh(result, label)).items():
            found[f"{label}: {name}"] = metric
        if label in meshes and label in loaded.stages:
            for name, metric in _on_committed_mesh(loaded.stages[label], meshes[label]).items():
                found[f"{label}: {name}"] = metric
    return found


def _analytic(model: Model) -> dict[str, Metric]:
    units = ("N/mm", "N/mm", "N mm/rad")
    return {
        f"analytic stiffness {axis}": Metric(value=value, allowed=ANALYTIC * abs(value), unit=unit)
        for axis, value, unit in zip(DIRECTIONS, np.diag(np.array(model.stiffness)).tolist(), units, strict=True)
    }


def _on_committed_mesh(stage: Stage, mesh: StageMesh) -> dict[str, Metric]:
    compliance: Array = platform_response(mesh, plate_of(stage)).compliance
    units = ("mm/N", "mm/N", "rad/(N mm)")
    return {
        f"committed mesh compliance {axis}": Metric(value=value, allowed=COMMITTED_MESH * abs(value), unit=unit)
        for axis, value, unit in zip(DIRECTIONS, np.diag(compliance).tolist(), units, strict=True)
    }


def _fresh(result: Result, label: str) -> dict[str, Metric]:
    """Displacements at full command and error percentages, each gated on its own."""
    lever, command = result.models[label].lever, result.commanded[-1]
    if result.direction == "theta":
        command *= lever
    found = {}
    for axis in DIRECTIONS:
        scale = command / lever if axis == "theta" else command
        pose = getattr(result.curves[label], axis)[-1] + (result.commanded[-1] if axis == result.direction else 0.0)
        allowed = FRESH_MESH * abs(pose) + CROSS * scale
        unit = "rad" if axis == "theta" else "mm"
        found[f"displacement {axis}"] = Metric(value=pose, allowed=allowed, unit=unit)
        percent = getattr(result.error_percent[label], axis)
        found[f"error {axis}"] = Metric(value=percent, allowed=100 * allowed / scale, unit="percentage points")
    return found


def read_baseline(path: Path) -> Baseline:
    """Read an accepted baseline. Raises BadInput when there is none or it is damaged."""
    try:
        return Baseline.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        raise BadInput(f"{path}: no baseline; flexfem baseline CASE --reason TEXT makes one") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path}: not a baseline: {error.errors(include_url=False)[0]['msg']}") from None


def _committed_mesh(stage: Stage, path: Path) -> StageMesh:
    if not path.exists():
        write_mesh(build_mesh(stage, COARSE), path)
    return read_mesh(path)


def write_mesh(mesh: StageMesh, path: Path) -> None:
    """Store a mesh as arrays. Raises BadInput when the folder does not take it."""
    arrays: dict[str, AnyArray] = {f"edges.{name}": edge for name, edge in mesh.edges.items()} | {
        "nodes": mesh.nodes,
        "triangles": mesh.triangles.astype(np.int32),
        "bodies": mesh.bodies.astype(np.int8),
    }
    write_atomically(path, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))


def read_mesh(path: Path) -> StageMesh:
    """Read a committed mesh. Raises BadInput when it is missing or damaged."""
    arrays = read_arrays(path, "a committed mesh")
    try:
        edges = {name.removeprefix("edges."): arrays[name] for name in arrays if name.startswith("edges.")}
        triangles, bodies = (arrays[name].astype(np.int64) for name in ("triangles", "bodies"))
        return StageMesh(arrays["nodes"], triangles, bodies, edges)
    except KeyError as error:
        raise BadInput(f"{path}: expected a committed mesh: it has no {error}") from None
