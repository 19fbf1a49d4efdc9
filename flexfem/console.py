"""What commands print: facts as JSON for machines, as tables for people; progress on a terminal only."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.notch import FORMULAS, over_calibrated
from flexfem.arrays import Array
from flexfem.benchmark.registry import Table as Findings
from flexfem.design import HINGE_NAMES, Stage, key_paths, provenance_of
from flexfem.errors import BadInput
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import LoadCase
from flexfem.layout.frames import stage_frames
from flexfem.peers.compare import CrossCheck
from flexfem.verify.baseline import Move
from flexfem.verify.case import DIRECTIONS, LoadedCase
from flexfem.verify.protocol import Solved, run_case, solve_stage
from flexfem.verify.result import Fields, Result

if TYPE_CHECKING:
    from flexfem.report.hinge_chart import HingeReview

Facts = dict[str, Any]
UNITS = "N, mm, rad; order x, y, theta"


def _people() -> Console:
    """Standard output; wide when it is no terminal, so that no table is folded in a file."""
    return Console(soft_wrap=True, highlight=False, width=None if sys.stdout.isatty() else 200)


def show(facts: Any, as_json: bool, people: Callable[[Any], None]) -> None:
    """Print facts as JSON, or hand them to the function that prints them for people."""
    if as_json:
        print(json.dumps(facts, indent=1, allow_nan=False))
    else:
        people(facts)


def load_cases(paths: Sequence[Path]) -> list[LoadedCase]:
    """Read all cases before any is run. Raises BadInput, also when two would write the same result."""
    loaded = [LoadedCase(path) for path in paths]
    seen: dict[str, Path] = {}
    for case in loaded:
        if case.stem in seen:
            raise BadInput(
                f"{case.path}: its results would overwrite those of {seen[case.stem]}, expected another name"
            )
        seen[case.stem] = case.path
    return loaded


def run_cases(loaded: Sequence[LoadedCase]) -> Iterator[tuple[Result, dict[str, Fields]]]:
    """Run cases one by one, each stage solved once; says on standard error how far it is."""
    solved: dict[tuple[str, int], Solved] = {}

    def solve(stage: Stage, resolution: int) -> Solved:
        key = (stage.hash, resolution)
        if key not in solved:
            solved[key] = solve_stage(stage, resolution)
        return solved[key]

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        for case in progress.track(loaded, description="verifying"):
            result, fields = run_case(case, solve)
            if not console.is_terminal:
                print(f"{case.stem}: {len(result.curves)} curves in {result.seconds:.1f} s", file=sys.stderr)
            yield result, fields


def with_progress(steps: int, description: str) -> Callable[[Stage, int], Solved]:
    """A `solve_stage` that says on standard error how far it is, after every one of `steps` calls."""
    done = 0

    def solve(stage: Stage, resolution: int) -> Solved:
        nonlocal done
        solved = solve_stage(stage, resolution)
        done += 1
        print(f"{description} {done}/{steps}: {solved.response.unknowns} unknowns", file=sys.stderr)
        return solved

    return solve


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
        "chains_alike": stage.chains_alike,
        "hash": stage.hash,
        "dimensions": stage.model_dump(mode="json", exclude={"name", "hinges", "override", "provenance"}),
        "hinges": hinges,
        "provenance": {key: source for key, source in sources.items() if source},
        "assumed": list(stage.assumed),
    }


def analytic_facts(path: Path, stage: Stage, result: AnalyticResult) -> Facts:
    """What `stiffness` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "units": UNITS,
        "mobility": result.mobility,
        "formula": result.formula,
        "formula_source": FORMULAS[result.formula].source,
        "formula_in_range": bool(np.all(result.in_range)),
        "stiffness": result.stiffness.tolist(),
        "compliance": result.compliance.tolist(),
        "hinge_compliance": {name: values.tolist() for name, values in result.hinges._asdict().items()},
        "assumed": list(stage.assumed),
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
        "assumed": list(stage.assumed),
    }


def solution_facts(path: Path, stage: Stage, solved: Solved, case: LoadCase, resolution: int) -> Facts:
    """What `solve` says."""
    return {
        "file": str(path),
        "name": stage.name,
        "units": f"{UNITS}; stress MPa",
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
        "assumed": list(stage.assumed),
    }


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
        "assumed": list(stage.assumed),
    }


def benchmark_facts(table: Findings) -> Facts:
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
    from flexfem.report.hinge_chart import FormulaCurve, HingeReview

    ratio = np.geomspace(*FORMULAS["calibrated"].valid, 121)
    found = over_calibrated(ratio, height, poissons_ratio)

    def curve(name: str) -> FormulaCurve:
        stated = FORMULAS[name].freedoms
        values = (getattr(found[name], f) if f in stated else None for f in ("rotation", "axial", "shear"))
        return FormulaCurve(name, FORMULAS[name].valid, *values)

    published = [curve(name) for name in FORMULAS if name != "calibrated"]
    return HingeReview(ratio, published, height, curve("calibrated"), poissons_ratio, FORMULAS["calibrated"].source)


def result_facts(results: Sequence[Result]) -> Any:
    """What `verify` says: one result as it is stored, several as a list."""
    stored = [result.model_dump(mode="json") for result in results]
    return stored[0] if len(stored) == 1 else stored


def move_facts(results: Sequence[Result], moves: Sequence[Move]) -> Facts:
    """What `verify --check` says."""
    moved = [
        {
            "case": move.case,
            "metric": move.metric,
            "was": move.was and move.was.value,
            "is": move.now and move.now.value,
            "allowed": move.was and move.was.allowed,
            "unit": (move.was or move.now).unit,  # type: ignore[union-attr]
            "line": str(move),
        }
        for move in moves
    ]
    return {"checked": [result.case for result in results], "moved": moved}


def print_stage(facts: Facts) -> None:
    """Print what `check` found."""
    out = _people()
    out.print(f"{facts['name']}: mobility {facts['mobility']}, chains {'alike' if facts['chains_alike'] else 'differ'}")
    table = Table(
        "chain", "hinge", "x mm", "y mm", "axis deg", "R mm", "t mm", "freedoms", box=None, padding=(0, 2, 0, 0)
    )
    for h in facts["hinges"]:
        x, y = h["centre_mm"]
        freedoms = "rotation, axial" if h["prismatic"] else "rotation"
        numbers = (f"{x:z.4f}", f"{y:z.4f}", f"{h['axis_deg']:.2f}", f"{h['radius_mm']:g}", f"{h['neck_mm']:g}")
        table.add_row(str(h["chain"]), h["hinge"], *numbers, freedoms)
    out.print(table)
    out.print("where the numbers come from:")
    for key, source in facts["provenance"].items():
        out.print(f"  {key}: {source}", markup=False)
    if facts["assumed"]:
        out.print(f"assumed, not the paper's: {', '.join(facts['assumed'])}", markup=False)


def print_analytic(facts: Facts) -> None:
    """Print what `stiffness` found."""
    out = _people()
    outside = "" if facts["formula_in_range"] else " (outside its range of t/R at some hinge)"
    out.print(
        f"{facts['name']}: analytic model, mobility {facts['mobility']}, {facts['formula']}{outside}", markup=False
    )
    _print_matrix(out, "stiffness K_uu, N/mm and N mm/rad", np.array(facts["stiffness"]))
    _print_matrix(out, "compliance C_uu, mm/N and rad/(N mm)", np.array(facts["compliance"]))
    _print_assumed(out, facts)


def print_solution(facts: Facts) -> None:
    """Print what `solve` found."""
    out = _people()
    out.print(f"{facts['name']}: finite elements, {facts['triangles']} triangles, {facts['unknowns']} unknowns")
    _print_matrix(out, "stiffness, N/mm and N mm/rad", np.array(facts["stiffness"]))
    _print_matrix(out, "compliance, mm/N and rad/(N mm)", np.array(facts["compliance"]))
    if any(facts["force"]):
        out.print("force        " + "  ".join(f"{v: .6e}" for v in facts["force"]) + "  N, N, N mm")
        out.print("displacement " + "  ".join(f"{v: .6e}" for v in facts["displacement"]) + "  mm, mm, rad")
        out.print("largest von Mises stress at the necks, MPa, chain by chain (base, elbow, platform):")
        for chain, row in enumerate(facts["neck_stress"], start=1):
            out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))
    _print_assumed(out, facts)


def print_facts(facts: Facts) -> None:
    """Print plain facts, one a line."""
    out = _people()
    for key, value in facts.items():
        if key != "assumed":
            out.print(f"{key}: {value}", markup=False)
    _print_assumed(out, facts)


def print_results(results: Sequence[Result], output: Path) -> None:
    """Print the error percentages of every case."""
    out = _people()
    table = Table("case", "commanded", "model", "X %", "Y %", "theta %", box=None, padding=(0, 2, 0, 0))
    for result in results:
        for label, percent in result.error_percent.items():
            bands = result.uncertainty[label]
            numbers = (f"{getattr(percent, axis):z.3f} ± {bands[axis].band:.3f}" for axis in DIRECTIONS)
            table.add_row(result.case, result.direction, label, *numbers)
    out.print("error of the finite-element displacement, in per cent of the command")
    out.print("(rotations against translations by the lever l3; ± is the mesh, by grid convergence)")
    out.print(table)
    out.print(f"stored in {output}/", markup=False)
    _print_assumed(out, {"assumed": {key for result in results for key in result.assumed}})


def print_convergence(facts: Facts) -> None:
    """Print the levels of a mesh study, and what they tend to."""
    out = _people()
    out.print(f"{facts['stage']}: platform compliance on finer and finer meshes", markup=False)
    names = ("triangles across a neck", "unknowns", "x mm/N", "y mm/N", "theta rad/(N mm)")
    table = Table(*names, box=None, padding=(0, 2, 0, 0))
    for resolution, unknowns, matrix in zip(facts["resolutions"], facts["unknowns"], facts["compliance"], strict=True):
        table.add_row(str(resolution), str(unknowns), *(f"{matrix[k][k]:.9e}" for k in range(3)))
    found = [facts["uncertainty"][axis] for axis in DIRECTIONS]
    table.add_row("extrapolated", "", *(f"{u['extrapolated']:.9e}" for u in found))
    table.add_row("band of the finest", "", *(f"{u['band'] / u['extrapolated']:.1e} relative" for u in found))
    table.add_row("observed order", "", *("none" if u["observed"] is None else f"{u['observed']:.2f}" for u in found))
    table.add_row("verdict", "", *(u["verdict"] for u in found))
    out.print(table)
    _print_assumed(out, facts)


def print_cross_check(facts: Facts) -> None:
    """Print how far another solver's answer is from ours."""
    out = _people()
    out.print(f"{facts['name']}: {facts['unknowns']} unknowns, flexfem against {facts['solver']} {facts['version']}")
    table = Table("largest relative difference", "is", "allowed", "", box=None, padding=(0, 2, 0, 0))
    for check in facts["checks"]:
        allowed = "only stated" if check["allowed"] is None else f"{check['allowed']:.1e}"
        table.add_row(check["quantity"], f"{check['difference']:.1e}", allowed, "" if check["passed"] else "TOO FAR")
    out.print(table)
    out.print(f"{facts['seconds']:.2f} s here, {facts['their_seconds']:.2f} s there; passed: {facts['passed']}")
    _print_assumed(out, facts)


def print_benchmarks(facts: Facts) -> None:
    """Print what the published problems came to."""
    out = _people()
    table = Table("benchmark", "quantity", "target", "ours", "off by", "allowed", "", box=None, padding=(0, 2, 0, 0))
    for f in facts["findings"]:
        numbers = ["none" if v is None else f"{v:.6g}" for v in (f["target"], f["ours"])]
        limits = (f"{f['difference']:.2g}", f"{f['allowed']:.2g}")
        table.add_row(f["name"], f["quantity"], *numbers, *limits, "" if f["passed"] else "FAILED")
    out.print(table)
    out.print(f"{len(facts['findings'])} findings in {sum(facts['seconds'].values()):.0f} s; passed: {facts['passed']}")
    out.print("targets are published, with their sources in benchmarks.md (--output DIR)")


def print_budget(facts: Facts) -> None:
    """Print the shares of the error in the commanded directions."""
    out = _people()
    out.print(
        f"{facts['stage']}: error of mobility {facts['mobility']}, {facts['formula']}, in per cent of the command"
    )
    table = Table("share", "x", "y", "theta", box=None, padding=(0, 2, 0, 0))
    splits = [facts["split"][axis] for axis in DIRECTIONS]
    for rows in zip(*(split["shares"] for split in splits), strict=True):
        points = (row["points"][axis] for row, axis in zip(rows, DIRECTIONS, strict=True))
        table.add_row(rows[0]["name"], *(f"{value:+z.3f}" for value in points))
    totals = zip(splits, DIRECTIONS, strict=True)
    table.add_row("total", *(f"{split['total'][axis]:.3f} ± {split['band']:.3f}" for split, axis in totals))
    out.print(table)
    _print_assumed(out, facts)


def print_formulas(facts: Facts) -> None:
    """Print the hinge formulas, one a line and its source below."""
    out = _people()
    for name, fact in facts.items():
        low, high = fact["t_over_R"]
        out.print(f"{name}: {', '.join(fact['freedoms'])}; t/R {low:g} to {high:g}", markup=False)
        out.print(f"    {fact['source']}. {fact['status']}", markup=False)


def print_claims(facts: Facts) -> None:
    """Print the verdicts, and the alternatives with their magnitudes."""
    out = _people()
    for verdict in facts["verdicts"]:
        out.print(f"{verdict['verdict']}: {verdict['statement']} ({verdict['where']})", markup=False)
        out.print(f"    {verdict['found']}", markup=False)
    out.print("\nwhat else could have produced the paper's curves, per cent along the command and largest across")
    table = Table("alternative", "model", "X", "Y", "theta", box=None, padding=(0, 2, 0, 0))
    for row in facts["alternatives"]:
        pairs = (f"{row['along'][axis]:z.3f}, {row['across'][axis]:z.3f}" for axis in DIRECTIONS)
        table.add_row(row["name"], f"mobility {row['mobility']}", *pairs)
    out.print(table)


def print_moves(facts: Facts) -> None:
    """Print one line for every number that moved."""
    for move in facts["moved"]:
        print(move["line"])
    count = len(facts["moved"])
    print(f"checked {', '.join(facts['checked'])}: " + (f"{count} numbers moved" if count else "no number moved"))


def print_written(facts: Facts) -> None:
    """Print the files written."""
    for path in facts["written"]:
        print(path)


def _print_matrix(out: Console, title: str, matrix: Array) -> None:
    out.print(f"{title} (x, y, theta)")
    for row in matrix:
        out.print("  " + "  ".join(f"{value: .9e}" for value in row))


def _print_assumed(out: Console, facts: Facts) -> None:
    if facts["assumed"]:
        out.print(f"{len(facts['assumed'])} of these numbers are assumed, not the paper's: flexfem check lists them")
