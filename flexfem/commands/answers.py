"""What commands answer where no record is stored: the data that `--json` prints, tables show and baselines hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexfem.analytic.formulas import FORMULAS
from flexfem.analytic.model import AnalyticResult
from flexfem.files.provenance import key_paths, provenance_of
from flexfem.stage.designs import stage_frames
from flexfem.stage.schema import HINGE_NAMES, Stage
from flexfem.verify import warning

if TYPE_CHECKING:
    from flexfem.fem.mesh import StageMesh
    from flexfem.fem.response import LoadCase
    from flexfem.validate.compare import CrossCheck
    from flexfem.validate.registry import BenchmarkTable
    from flexfem.verify.protocol import OnMesh, Solved

Answer = dict[str, Any]
UNITS = "N, mm, rad; order x, y, theta"


def _about(stage: Stage, warnings: warning.Warnings, **found: Any) -> Answer:
    """An answer on a stage: which it is, what was found, and what is to be known of that."""
    doubts = {"assumed": list(stage.assumed), "not_stated": list(stage.not_stated)}
    return {"file": str(stage.origin), "name": stage.name, **found, "warnings": warnings, **doubts}


def of_stage(stage: Stage) -> Answer:
    """What `check` answers."""
    sources = {key: provenance_of(stage, key) for key in key_paths(stage)}
    return _about(
        stage,
        warning.of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=stage.model_dump(mode="json", exclude={"name", "hinges", "override", "provenance"}),
        hinges=[_hinge(stage, chain, position) for chain, position in np.ndindex(3, 3)],
        provenance={key: source for key, source in sources.items() if source},
    )


def _hinge(stage: Stage, chain: int, position: int) -> Answer:
    placed, hinge = stage_frames(stage), stage.hinge(chain + 1, HINGE_NAMES[position])
    return {
        "chain": chain + 1,
        "hinge": HINGE_NAMES[position],
        "centre_mm": placed.centres[chain, position].tolist(),
        "axis_deg": float(np.rad2deg(placed.axes[chain, position]) % 360.0),
        "radius_mm": hinge.radius,
        "neck_mm": hinge.neck,
        "prismatic": hinge.prismatic,
    }


def of_model(stage: Stage, result: AnalyticResult) -> Answer:
    """What `stiffness` answers."""
    return _about(
        stage,
        [*warning.of_formula(stage, result.formula), *warning.of_model(stage, result)],
        units=UNITS,
        model=stage.model,
        mobility=result.mobility,
        formula=result.formula,
        formula_source=FORMULAS[result.formula].source,
        formula_in_range=bool(np.all(result.in_range)),
        stiffness=result.stiffness,
        compliance=result.compliance,
        hinge_compliance=result.hinges,
    )


def of_mesh(stage: Stage, mesh: StageMesh, resolution: int, output: Path) -> Answer:
    """What `mesh` answers."""
    counts = {"nodes": len(mesh.nodes), "triangles": len(mesh.triangles)}
    return _about(stage, [], written=str(output), resolution=resolution, **counts)


def of_solution(stage: Stage, solved: Solved | OnMesh, case: LoadCase, resolution: int) -> Answer:
    """What `solve` answers."""
    strength, where = stage.material.yield_strength, "under this load"
    return _about(
        stage,
        [
            *warning.of_yield(float(np.max(case.neck_stress)), strength, where),
            *warning.of_motion(stage, case.pose, where),
        ],
        units=f"{UNITS}; stress MPa",
        model=stage.model,
        resolution=resolution,
        triangles=solved.triangles,
        unknowns=solved.response.unknowns,
        stiffness=np.linalg.inv(solved.response.compliance),
        compliance=solved.response.compliance,
        force=case.force,
        displacement=case.pose,
        reaction=case.reaction,
        energy=case.energy,
        neck_stress=case.neck_stress,
    )


def of_cross_check(stage: Stage, found: CrossCheck) -> Answer:
    """What `cross-check` answers."""
    checks = [{**check._asdict(), "passed": check.passed} for check in found.checks]
    return _about(stage, [], units=UNITS, **(found._asdict() | {"checks": checks, "passed": found.passed}))


def of_benchmarks(table: BenchmarkTable) -> Answer:
    """What `benchmark` answers."""
    findings = [
        {**f._asdict(), "passed": f.passed}
        | {name: float(value) if np.isfinite(value := getattr(f, name)) else None for name in ("ours", "difference")}
        for f in table.findings
    ]
    return {"findings": findings, "seconds": table.seconds, "passed": table.passed}
