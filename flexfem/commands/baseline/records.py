"""What flexfem prints of an input file, section by section: what a baseline holds."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, AnalyticResult, analyse
from flexfem.commands.baseline.committed import COARSE, committed_mesh, mesh_name
from flexfem.commands.baseline.inputs import Kind, kind_of
from flexfem.commands.baseline.moves import Leaf, leaves
from flexfem.commands.plain import plain
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import RESOLUTION
from flexfem.fem.response import driven_response, platform_response
from flexfem.fem.structure import plate_of
from flexfem.files.refusals import key_path
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.questions.bands import levels
from flexfem.refused import BadInput, ComputationFailed
from flexfem.verify import answers, budget, hinges, imposed
from flexfem.verify.case import Curve, LoadedCase
from flexfem.verify.converge import converge
from flexfem.verify.errors import compare
from flexfem.verify.protocol import OnMesh, Solve, Solved, run_case
from flexfem.verify.stage_report import report_stage

Section: TypeAlias = Callable[[], Any]
FORCE = (1.0, -2.0, 30.0)  # N, N, N mm: of `solve`; no two components alike
LEVELS = levels(RESOLUTION)  # of `converge`: the meshes that budget and cases need anyway


def sections(path: Path, folder: Path, solve: Solve) -> dict[str, Section]:
    """What is recorded of an input file, to be called by name; committed meshes are kept in `folder`.

    Raises BadInput when the file cannot be used.
    """
    return _SECTIONS[kind_of(path)](path, folder, solve)


def record(path: Path, folder: Path, solve: Solve, made: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Every section of an input file, as plain data, but for those made already. Raises BadInput, ComputationFailed."""
    ready = made or {}
    return {
        name: plain(ready[name] if name in ready else make()) for name, make in sections(path, folder, solve).items()
    }


def settings(kind: Kind) -> dict[str, Leaf]:
    """What the record of a kind depends on beside the input file, by key."""
    of_stage = {
        "solve": {"force": FORCE, "resolution": RESOLUTION},
        "mesh": {"resolution": COARSE},
        "converge": {"resolutions": LEVELS},
        "budget": {"amplitudes": budget.AMPLITUDES, "resolution": RESOLUTION},
    }
    of_case = {"committed": {"resolution": COARSE}}
    found = {"stage": of_stage, "case": of_case}.get(kind, {})
    return {key_path(path): value for path, value in leaves(found).items()}


def meshes(path: Path) -> dict[str, Stage]:
    """Names of the committed meshes that an input file needs, with their stages."""
    match kind_of(path):
        case "stage":
            stage = load_feasible(path)
            return {mesh_name(path, stage): stage}
        case "case":
            loaded = LoadedCase(path)
            if loaded.case.model == "three_dimensional":
                return {}
            files = {curve.label: loaded.stage_path(curve) for curve in loaded.case.curve}
            return {mesh_name(files[label], stage): stage for label, stage in loaded.stages.items()}
        case _:
            return {}


def _of_stage(path: Path, folder: Path, solve: Solve) -> dict[str, Section]:
    stage = load_feasible(path)
    mesh = folder / mesh_name(path, stage)
    return {
        "check": lambda: _less(("drive",), _by_name(report_stage(stage))),
        "stiffness": lambda: _stiffness(stage),
        "mesh": lambda: _or_refused(lambda: _solution(stage, _on_committed(stage, mesh), FORCE, COARSE)),
        "solve": lambda: _or_refused(lambda: _solution(stage, solve(stage, RESOLUTION), FORCE, RESOLUTION)),
        "budget": lambda: _less(("three_dimensional",), _or_refused(lambda: budget.budget(stage, solve=solve))),
        "converge": lambda: _or_refused(lambda: converge(stage, LEVELS, solve)),
    }


def _stiffness(stage: Stage) -> dict[str, Any]:
    """What `stiffness` says by the paper's model and by the finest one, without and with elastic links."""
    models: dict[str, Callable[[], AnalyticResult]] = {
        DEFAULT_FORMULA: lambda: analyse(stage),
        CALIBRATED: lambda: analyse(stage, 21, CALIBRATED),
        "links": lambda: analyse(stage, 21, CALIBRATED, links=True),
    }
    return {
        name: _or_refused(partial(lambda found: answers.report_stiffness(stage, found()), found))
        for name, found in models.items()
    }


def _solution(stage: Stage, solved: Solved | OnMesh, force: Any, resolution: int) -> answers.LoadReport:
    full = load_case(stage, solved.mesh, solved.response, np.array(force))
    return answers.report_load(stage, solved, full, resolution)


def _on_committed(stage: Stage, path: Path) -> OnMesh:
    plate = plate_of(stage)
    mesh = committed_mesh(stage, path)
    return OnMesh(mesh, platform_response(mesh, plate))


def _of_case(path: Path, folder: Path, solve: Solve) -> dict[str, Section]:
    loaded = LoadedCase(path)
    found: dict[str, Section] = {"result": lambda: run_case(loaded, solve)[0]}
    if loaded.case.model == "three_dimensional":  # committed meshes are whole and plane
        return found
    return {"committed": lambda: {each.label: _curve(loaded, each, folder) for each in loaded.case.curve}, **found}


def _curve(loaded: LoadedCase, curve: Curve, folder: Path) -> dict[str, Any]:
    """The linear comparison of one curve on its committed mesh."""
    case, stage, file = loaded.case, loaded.stages[curve.label], loaded.stage_path(curve)
    if case.drive != "force":
        return _imposed(loaded, curve, folder)
    K, lever = analyse(stage, curve.mobility, curve.formula).stiffness, stage.chain.link_lengths[2]
    solved = _on_committed(stage, folder / mesh_name(file, stage))
    found = compare(K, solved.response.compliance, case.direction, case.commanded, lever)
    model = {"stiffness": K.tolist(), "force": found.force.tolist()}
    full = _solution(stage, solved, found.force[-1], COARSE)
    return {"model": model, "percent": found.percent.tolist(), **_by_name(full)}


def _imposed(loaded: LoadedCase, curve: Curve, folder: Path) -> dict[str, Any]:
    """Of a curve with joints commanded: what it imposes, and the poses per command of its committed mesh."""
    case, stage, file = loaded.case, loaded.stages[curve.label], loaded.stage_path(curve)
    given = imposed.imposed(stage, analyse(stage, curve.mobility, curve.formula, curve.links), case.drive)
    mesh = committed_mesh(stage, folder / mesh_name(file, stage))
    found = driven_response(mesh, plate_of(stage), given.stacks).compliance
    percent = imposed.compared(given, found, case, stage.chain.link_lengths[2]).percent
    return {"model": {"given": given.given.tolist()}, "percent": percent.tolist()}


def _of_chart(path: Path, folder: Path, solve: Solve) -> dict[str, Section]:
    """What the analytic model reads from a chart of flexfem itself."""
    if path.stem == "thickness_chart":
        return {"thickness": hinges.thickness_review}
    middle = float(np.sqrt(np.prod(json.loads(path.read_bytes())["range"]["H/h"])))
    return {
        "formulas": hinges.known_formulas,
        "hinges": hinges.hinge_review,
        "middle": lambda: hinges.hinge_review(middle),
    }


def _of_study(path: Path, folder: Path, solve: Solve) -> dict[str, Section]:
    from flexfem.files.toml import read_toml

    data = read_toml(path).data
    return {str(data.get("model")): lambda: _study(path, "figure" in data)}


def _study(path: Path, figures: bool) -> dict[str, Any]:
    """The collected table, column by column, and what the figures show; by the commands, as users run them."""
    with tempfile.TemporaryDirectory() as made:
        table = Path(made) / "table.csv"
        _flexfem("study", "run", str(path), "--output", made)
        _flexfem("study", "collect", str(path), "--output", made, "--to", str(table))
        with table.open(newline="") as file:
            rows = list(csv.DictReader(file))
        columns = {name: [_cell(row[name]) for row in rows] for name in (rows[0] if rows else ())}
        shown = _flexfem("study", "plot", str(path), "--output", made, "--json") if figures else "{}"
        return {"table": columns, "findings": json.loads(shown).get("findings", {})}


def _flexfem(*arguments: str) -> str:
    command = [sys.executable, "-m", "flexfem", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise ComputationFailed(said[-1].removeprefix("flexfem: ") if said else f"flexfem {arguments[1]} failed")
    return done.stdout


def _cell(text: str) -> Leaf:
    try:
        return float(text)
    except ValueError:
        return text or None


def _by_name(found: Any) -> dict[str, Any]:
    """An answer on a stage with the name of its file alone: a baseline may lie in any folder."""
    data: dict[str, Any] = plain(found)
    return data | {"file": Path(data["file"]).name}


def _less(parts: tuple[str, ...], found: dict[str, Any]) -> dict[str, Any]:
    """What is recorded of an answer, less the parts that a drive adds."""
    return {key: each for key, each in found.items() if key not in parts}


def _or_refused(make: Section) -> Any:
    """What is made, or why a stage cannot have it."""
    try:
        return _by_name(make())
    except BadInput as refusal:
        return {"refused": str(refusal)}


_SECTIONS: dict[Kind, Callable[[Path, Path, Solve], dict[str, Section]]] = {
    "stage": _of_stage,
    "case": _of_case,
    "study": _of_study,
    "chart": _of_chart,
}
