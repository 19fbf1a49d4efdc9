"""What commands say, as plain data: the keys of the JSON that `--json` prints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.notch import FORMULAS, over_calibrated
from flexfem.analytic.thick import factors
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import LoadCase
from flexfem.files.provenance import key_paths, provenance_of
from flexfem.stage.frames import stage_frames
from flexfem.stage.schema import HINGE_NAMES, Stage
from flexfem.validate.compare import CrossCheck
from flexfem.validate.registry import Table
from flexfem.verify import warning
from flexfem.verify.protocol import Solved
from flexfem.verify.result import Result

if TYPE_CHECKING:
    from flexfem.commands.baseline.store import Checked
    from flexfem.plot.hinge_chart import HingeReview
    from flexfem.plot.thickness import ThicknessReview

Facts = dict[str, Any]
UNITS = "N, mm, rad; order x, y, theta"


def stage_facts(path: Path, stage: Stage) -> Facts:
    """What `check` says of a stage."""
    placed = stage_frames(stage)
    hinges = []
    for chain, position in np.ndindex(3, 3):
        hinge = stage.hinge(chain + 1, HINGE_NAMES[position])
        hinges.append(
            {
                "chain": chain + 1,
                "hinge": HINGE_NAMES[position],
                "centre_mm": placed.centres[chain, position].tolist(),
                "axis_deg": float(np.rad2deg(placed.axes[chain, position]) % 360.0),
                "radius_mm": hinge.radius,
                "neck_mm": hinge.neck,
                "prismatic": hinge.prismatic,
            }
        )
    sources = {key: provenance_of(stage, key) for key in key_paths(stage)}
    return {
        "file": str(path),
        "name": stage.name,
        "mobility": stage.mobility,
        "model": stage.model,
        "chains_alike": stage.chains_alike,
        "hash": stage.hash,
        "dimensions": stage.model_dump(mode="json", exclude={"name", "hinges", "override", "provenance"}),
        "hinges": hinges,
        "provenance": {key: source for key, source in sources.items() if source},
        "warnings": warning.of_stage(stage),
        "assumed": list(stage.assumed),
        "not_stated": list(stage.not_stated),
    }


def analytic_facts(path: Path, stage: Stage, result: AnalyticResult) -> Facts:
    """What `stiffness` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "units": UNITS,
        "model": stage.model,
        "mobility": result.mobility,
        "formula": result.formula,
        "formula_source": FORMULAS[result.formula].source,
        "formula_in_range": bool(np.all(result.in_range)),
        "stiffness": result.stiffness.tolist(),
        "compliance": result.compliance.tolist(),
        "hinge_compliance": {name: values.tolist() for name, values in result.hinges._asdict().items()},
        "warnings": [*warning.of_formula(stage, result.formula), *warning.of_model(stage, result)],
        "assumed": list(stage.assumed),
        "not_stated": list(stage.not_stated),
    }


def mesh_facts(path: Path, stage: Stage, mesh: StageMesh, resolution: int, output: Path) -> Facts:
    """What `mesh` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "written": str(output),
        "resolution": resolution,
        "nodes": len(mesh.nodes),
        "triangles": len(mesh.triangles),
        "warnings": [],
        "assumed": list(stage.assumed),
        "not_stated": list(stage.not_stated),
    }


def solution_facts(path: Path, stage: Stage, solved: Solved, case: LoadCase, resolution: int) -> Facts:
    """What `solve` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "units": f"{UNITS}; stress MPa",
        "model": stage.model,
        "resolution": resolution,
        "triangles": len(solved.mesh.triangles),
        "unknowns": solved.response.unknowns,
        "stiffness": np.linalg.inv(solved.response.compliance).tolist(),
        "compliance": solved.response.compliance.tolist(),
        "force": case.force.tolist(),
        "displacement": case.pose.tolist(),
        "reaction": case.reaction.tolist(),
        "energy": case.energy,
        "neck_stress": case.neck_stress.tolist(),
        "warnings": load_warnings(stage, case),
        "assumed": list(stage.assumed),
        "not_stated": list(stage.not_stated),
    }


def load_warnings(stage: Stage, case: LoadCase) -> warning.Warnings:
    """Warnings on a load by linear finite elements."""
    highest, where = float(np.max(case.neck_stress)), "under this load"
    return [
        *warning.of_yield(highest, stage.material.yield_strength, where),
        *warning.of_motion(stage, case.pose, where),
    ]


def cross_check_facts(path: Path, stage: Stage, found: CrossCheck) -> Facts:
    """What `cross-check` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "units": UNITS,
        "solver": found.solver,
        "version": found.version,
        "triangles": found.triangles,
        "unknowns": found.unknowns,
        "compliance": found.ours.tolist(),
        "their_compliance": found.theirs.tolist(),
        "checks": [{**check._asdict(), "passed": check.passed} for check in found.checks],
        "passed": found.passed,
        "seconds": found.our_seconds,
        "their_seconds": found.their_seconds,
        "warnings": [],
        "assumed": list(stage.assumed),
        "not_stated": list(stage.not_stated),
    }


def benchmark_facts(table: Table) -> Facts:
    """What `benchmark` says."""
    findings = [{**f._asdict(), "ours": f.ours if np.isfinite(f.ours) else None} for f in table.findings]
    return {"findings": findings, "seconds": table.seconds, "passed": table.passed}


def formula_facts() -> Facts:
    """What `formulas` says."""
    return {
        name: {"freedoms": f.freedoms, "t_over_R": f.valid, "source": f.source, "status": f.status}
        for name, f in FORMULAS.items()
    }


def hinge_review(height: float = 3.0, poissons_ratio: float = 0.3) -> HingeReview:
    """Every formula over the calibrated hinge, for blocks `height` times as high as the notch."""
    from flexfem.plot.hinge_chart import FormulaCurve, HingeReview

    ratio = np.geomspace(*FORMULAS["calibrated"].valid, 121)
    found = over_calibrated(ratio, height, poissons_ratio)

    def curve(name: str) -> FormulaCurve:
        stated = FORMULAS[name].freedoms
        values = (getattr(found[name], f) if f in stated else None for f in ("rotation", "axial", "shear"))
        return FormulaCurve(name, FORMULAS[name].valid, *values)

    published = [curve(name) for name in FORMULAS if name != "calibrated"]
    return HingeReview(ratio, published, height, curve("calibrated"), poissons_ratio, FORMULAS["calibrated"].source)


def thickness_review(poissons_ratio: float = 0.33) -> ThicknessReview:
    """Three-dimensional over plane-stress compliance of the hinge, over its thickness, for necks slender to stout."""
    from flexfem.plot.thickness import ThicknessReview

    width, ratio = np.geomspace(0.5, 50.0, 121), np.array([0.02, 0.1, 0.3, 1.0])
    found = factors(1.0 / ratio[:, None], 1.0, width, poissons_ratio)
    source = "three-dimensional finite elements of one hinge, our own (flexfem/data/thickness_chart.json)"
    return ThicknessReview(width, ratio, poissons_ratio, found.rotation, found.axial, {}, source)


def result_facts(results: Sequence[Result]) -> Any:
    """What `verify` says: one result as it is stored, several as a list."""
    stored = [result.model_dump(mode="json") for result in results]
    return stored[0] if len(stored) == 1 else stored


def regression_facts(checked: Sequence[Checked]) -> Facts:
    """What `regression` and `verify --check` say: what changed or moved by baseline, each as data and as a line."""
    found = [
        {"baseline": each.name, **each.data(finding), "line": str(finding)}
        for each in checked
        for finding in each.findings
    ]
    return {"checked": [each.name for each in checked], "findings": found}
