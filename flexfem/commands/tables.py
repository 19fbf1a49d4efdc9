"""What commands print for people: tables of their records."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem.units import COMMANDS, COMPLIANCES, DEGREE, FORCES, LENGTH, POSES, STIFFNESSES, STRESS, STRESSES, Unit

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from flexfem.arrays import Array
    from flexfem.validate.compare import CrossCheck
    from flexfem.validate.records import Finding
    from flexfem.validate.registry import BenchmarkTable
    from flexfem.verify.answers import LoadReport, MeshReport, PlacedHinge, StageReport, StiffnessReport
    from flexfem.verify.budget import Budget
    from flexfem.verify.case import Direction
    from flexfem.verify.claims import ClaimsReport
    from flexfem.verify.converge import MeshStudy
    from flexfem.verify.hinges import KnownFormula
    from flexfem.verify.result import Result
    from flexfem.verify.summary import ModelSummary, Summary
    from flexfem.verify.workspace import Point, Workspace

DIRECTIONS: tuple[Direction, ...] = ("x", "y", "theta")
MODELS = ("without", "tangent", "exact", "elements", "loaded")  # of `workspace`, and what they are called
MODEL_NAMES = ("(16) less its terms", "(16)", "exact", "elements", "elements, same load")
KINDS = {
    "stiffness": "tangent stiffness, change from rest",
    "position": "linear position error, along",
    "across": "linear position error, across",
}


class Ending(NamedTuple):
    """What is said below every table."""

    warnings: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str]


def _people() -> Console:
    """Standard output; wide when it is no terminal, so that no table is folded in a file."""
    from rich.console import Console

    terminal = sys.stdout is not None and sys.stdout.isatty()
    return Console(soft_wrap=True, highlight=False, markup=False, color_system=None, width=None if terminal else 200)


def _table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> Table:
    from rich.table import Table

    table = Table(*head, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        table.add_row(*row)
    return table


def _plane(model: str) -> str:
    """How the stage is made a plane problem, in words."""
    words = {"plane_stress": "plane stress", "plane_strain": "plane strain"}
    return words.get(model, "plane stress corrected by the thickness chart")


def print_stage(of: StageReport) -> None:
    """Print what `check` found."""
    out = _people()
    chains = "alike" if of.chains_alike else "differ"
    out.print(f"{of.name}: mobility {of.mobility}, chains {chains}, {_plane(of.model)}")
    x, y, R, t = (f"{name} {LENGTH}" for name in ("x", "y", "R", "t"))
    head = ("chain", "hinge", x, y, f"axis {DEGREE.plain}", R, t, "freedoms")
    out.print(_table(head, map(_hinge, of.hinges)))
    out.print("where the numbers come from:")
    for key, source in (of.provenance | dict.fromkeys(of.not_stated, "not stated")).items():
        out.print(f"  {key}: {source}")
    for text in of.warnings:
        out.print(f"warning: {text}")
    for said, keys in (("assumed, not the paper's", of.assumed), ("no source stated", of.not_stated)):
        if keys:
            out.print(f"{said}: {', '.join(keys)}")


def _hinge(h: PlacedHinge) -> Iterator[str]:
    x, y = h.centre_mm
    yield from (str(h.chain), h.hinge, f"{x:z.4f}", f"{y:z.4f}", f"{h.axis_deg:.2f}")
    yield from (f"{h.radius_mm:g}", f"{h.neck_mm:g}", "rotation, axial" if h.prismatic else "rotation")


def print_stiffness(of: StiffnessReport) -> None:
    """Print what `stiffness` found."""
    out = _people()
    outside = "" if of.formula_in_range else " (outside its range of t/R at some hinge)"
    out.print(f"{of.name}: analytic model, mobility {of.mobility}, {of.formula}{outside}, {_plane(of.model)}")
    _print_matrix(out, f"stiffness K_uu, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance C_uu, {_both(COMPLIANCES)}", of.compliance)
    _print_ending(out, of)


def print_load(of: LoadReport) -> None:
    """Print what `solve` found."""
    out = _people()
    out.print(f"{of.name}: finite elements, {_plane(of.model)}, {of.triangles} triangles, {of.unknowns} unknowns")
    _print_matrix(out, f"stiffness, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance, {_both(COMPLIANCES)}", of.compliance)
    if any(of.force):
        _print_load_case(out, of)
    _print_ending(out, of)


def _print_load_case(out: Console, of: LoadReport) -> None:
    for name, found, units in (("force", of.force, FORCES), ("displacement", of.displacement, POSES)):
        values = "  ".join(f"{value: .6e}" for value in found)
        out.print(f"{name:<12} {values}  {', '.join(unit.plain for unit in units)}")
    out.print(f"largest von Mises stress at the necks, {STRESS}, chain by chain (base, elbow, platform):")
    for chain, row in enumerate(of.neck_stress, start=1):
        out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))


def print_summary(of: Summary) -> None:
    """Print how far a stage may go, by every model that was asked."""
    out = _people()
    strength = f"yield strength {of.yield_strength:g} {STRESS}"
    out.print(f"{of.name}: mobility {of.mobility}, {_plane(of.model)}, {strength}")
    columns = ("stiffness", "safe range", "force there", "stress per displacement", "first to yield")
    for source in dict.fromkeys(of.material.values()):
        out.print(f"{', '.join(key for key, text in of.material.items() if text == source)}: {source}")
    for side in (of.analytic, of.elements):
        if side is not None:
            out.print(_table((side.model, *columns), _limits(side)))
    if of.accuracy:
        out.print(of.accuracy)
    out.print("safe range: the other directions held, until the first neck yields; force: along the displacement there")
    _print_ending(out, of)


def _limits(side: ModelSummary) -> Iterator[list[str]]:
    """Stiffness, range, force and limiting hinge by direction."""
    units = zip(DIRECTIONS, STIFFNESSES, COMMANDS, FORCES, STRESSES, strict=True)
    for axis, (direction, stiff, command, load, per) in enumerate(units):
        limit = side.limits[direction]
        yield [
            direction,
            f"{side.stiffness[axis][axis]:.5g} {stiff.plain}",
            f"±{limit.range_at_yield * command.factor:.4g} {command.plain}",
            f"{getattr(limit.force, direction) * load.factor:.4g} {load.plain}",
            f"{limit.stress * per.factor:.4g} {per.plain}",
            f"{limit.hinge} hinge, chain {limit.chain}",
        ]


def print_mesh(of: MeshReport) -> None:
    """Print what `mesh` wrote, one value a line."""
    out = _people()
    for key in ("file", "name", "written", "resolution", "nodes", "triangles"):
        out.print(f"{key}: {getattr(of, key)}")
    _print_ending(out, of)


def print_results(results: Sequence[Result], output: Path) -> None:
    """Print the error percentages of every case."""
    out = _people()
    out.print("error of the finite-element displacement, in per cent of the command")
    out.print("(rotations against translations by the lever l3; ± is the mesh, by grid convergence)")
    rows = (row for result in results for row in _errors(result))
    out.print(_table(("case", "commanded", "model", "X %", "Y %", "theta %"), rows))
    out.print(f"stored in {output}/")
    kinds = [[text for each in results for text in getattr(each, kind)] for kind in Ending._fields]
    _print_ending(out, Ending(*(list(dict.fromkeys(texts)) for texts in kinds)))


def _errors(result: Result) -> Iterator[tuple[str, ...]]:
    for label, percent in result.error_percent.items():
        bands = result.uncertainty[label]
        numbers = (f"{getattr(percent, axis):z.3f} ± {bands[axis].band:.3f}" for axis in DIRECTIONS)
        yield (result.case, result.direction, label, *numbers)


def print_convergence(of: MeshStudy) -> None:
    """Print the levels of a mesh study, and what they tend to."""
    out, found = _people(), [of.uncertainty[axis] for axis in DIRECTIONS]
    out.print(f"{of.stage}: platform compliance on finer and finer meshes")
    head = ("triangles across a neck", "unknowns", *map(" ".join, zip(DIRECTIONS, map(str, COMPLIANCES), strict=True)))
    levels = zip(of.resolutions, of.unknowns, of.compliance, strict=True)
    rows = [(str(n), str(unknowns), *(f"{C[k][k]:.9e}" for k in range(3))) for n, unknowns, C in levels]
    rows += [
        ("extrapolated", "", *(f"{u.extrapolated:.9e}" for u in found)),
        ("band of the finest", "", *(f"{u.band / u.extrapolated:.1e} relative" for u in found)),
        ("observed order", "", *("none" if u.observed is None else f"{u.observed:.2f}" for u in found)),
        ("verdict", "", *(u.verdict for u in found)),
    ]
    out.print(_table(head, rows))
    _print_ending(out, of)


def print_cross_check(of: CrossCheck) -> None:
    """Print how far another solver's answer is from ours."""
    out, rows = _people(), []
    out.print(f"{of.name}: {of.unknowns} unknowns, flexfem against {of.solver} {of.version}")
    for check in of.checks:
        allowed = "only stated" if check.allowed is None else f"{check.allowed:.1e}"
        rows.append((check.quantity, f"{check.difference:.1e}", allowed, "" if check.passed else "TOO FAR"))
    out.print(_table(("largest relative difference", "is", "allowed", ""), rows))
    out.print(f"{of.seconds:.2f} s here, {of.their_seconds:.2f} s there; passed: {of.passed}")
    _print_ending(out, of)


def print_benchmarks(of: BenchmarkTable) -> None:
    """Print what the published problems came to."""
    out = _people()
    head = ("benchmark", "quantity", "target", "ours", "off by", "allowed", "")
    out.print(_table(head, map(_finding, of.findings)))
    out.print(f"{len(of.findings)} findings in {sum(of.seconds.values()):.0f} s; passed: {of.passed}")
    out.print("targets are published, with their sources in benchmarks.md (--output DIR)")


def _finding(f: Finding) -> tuple[str, ...]:
    limits = (f"{f.difference:.2g}", f"{f.allowed:.2g}", "" if f.passed else "FAILED")
    return (f.name, f.quantity, f"{f.target:.6g}", f"{f.ours:.6g}", *limits)


def print_budget(of: Budget) -> None:
    """Print the shares of the error in the commanded directions."""
    out, splits = _people(), [(of.split[axis], axis) for axis in DIRECTIONS]
    out.print(f"{of.stage}: error of mobility {of.mobility}, {of.formula}, in per cent of the command")
    shares = [[(each.name, getattr(each.points, axis)) for each in split.shares] for split, axis in splits]
    rows = [(row[0][0], *(f"{points:+z.3f}" for _, points in row)) for row in zip(*shares, strict=True)]
    rows.append(("total", *(f"{getattr(split.total, axis):.3f} ± {split.band:.3f}" for split, axis in splits)))
    outside = [(split.out_of_plane, axis) for split, axis in splits]
    if all(share is not None for share, _ in outside):
        rows.append(("outside it: out of plane", *(f"{getattr(share, axis):+z.3f}" for share, axis in outside)))
    out.print(_table(("share", *DIRECTIONS), rows))
    _print_ending(out, of)


def print_workspace(of: Workspace) -> None:
    """Print what the terms of (16) and large displacements are worth, at a tenth of the commands and at all of them."""
    out = _people()
    against = f"nonlinear finite elements of {of.unknowns} unknowns"
    out.print(f"{of.stage}: large displacements, mobility {of.mobility}, {of.formula}, against {against}")
    out.print(_table(("per cent", "commanded", "at", *MODEL_NAMES), _travelled(of)))
    for box, size in ((of.small, "a tenth of these commands"), (of.box, "all of them")):
        out.print(
            f"anywhere within {size}: linear position off by up to {box.position:.3f} %, the second-order terms of "
            f"(16) change the tangent compliance by up to {box.terms:.3f} %"
        )
    _print_ending(out, of)


def _travelled(of: Workspace) -> Iterator[tuple[str, ...]]:
    for kind, name in KINDS.items():
        for axis, unit in zip(DIRECTIONS, COMMANDS, strict=True):
            for point in of.travel[axis].points:
                yield (name, axis, f"{unit.factor * point.commanded:+g} {unit.plain}", *_of_models(point, kind))


def _of_models(point: Point, kind: str) -> Iterator[str]:
    found = getattr(point, kind)
    return (f"{found[model]:+z.4f}" if model in found else "" for model in MODELS)


def print_formulas(of: Mapping[str, KnownFormula]) -> None:
    """Print the hinge formulas, one a line and its source below."""
    out = _people()
    for name, formula in of.items():
        low, high = formula.t_over_R
        out.print(f"{name}: {', '.join(formula.freedoms)}; t/R {low:g} to {high:g}")
        out.print(f"    {formula.source}. {formula.status}")


def print_claims(of: ClaimsReport) -> None:
    """Print the verdicts, and the alternatives with their magnitudes."""
    out, rows = _people(), []
    for verdict in of.verdicts:
        out.print(f"{verdict.verdict}: {verdict.statement} ({verdict.where})")
        out.print(f"    {verdict.found}")
    out.print("\nwhat else could have produced the paper's curves, per cent along the command and largest across")
    for row in of.alternatives:
        pairs = (f"{getattr(row.along, axis):z.3f}, {getattr(row.across, axis):z.3f}" for axis in DIRECTIONS)
        rows.append((row.name, f"mobility {row.mobility}", *pairs))
    out.print(_table(("alternative", "model", "X", "Y", "theta"), rows))
    _print_ending(out, of)


def print_regression(of: Mapping[str, Any]) -> None:
    """Print one line for everything that is not as accepted; what several baselines say, once."""
    lines = list(dict.fromkeys(finding["line"] for finding in of["findings"]))
    print("\n".join([*lines, f"checked {', '.join(of['checked'])}: "]), end="")
    print(f"{len(lines)} not as accepted" if lines else "all as accepted")


def _both(units: Sequence[Unit]) -> str:
    """The units of translations and of rotations."""
    return " and ".join(dict.fromkeys(unit.plain for unit in units))


def _print_matrix(out: Console, title: str, matrix: Array) -> None:
    out.print(f"{title} (x, y, theta)")
    for row in matrix:
        out.print("  " + "  ".join(f"{value: .9e}" for value in row))


def _print_ending(out: Console, of: Any) -> None:
    """Print the warnings of a record, and how many numbers are in doubt."""
    for text in of.warnings:
        out.print(f"warning: {text}")
    if of.assumed:
        out.print(f"{len(of.assumed)} of these numbers are assumed, not the paper's: --json lists them")
    if of.not_stated:
        out.print(f"{len(of.not_stated)} of these numbers have no stated source: --json lists them")
