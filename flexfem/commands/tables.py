"""What commands print for people: tables of the facts."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from flexfem.arrays import Array
from flexfem.commands.facts import Facts
from flexfem.units import (
    COMMANDS,
    COMPLIANCES,
    DEGREE,
    FORCES,
    LENGTH,
    POSES,
    STIFFNESSES,
    STRESS,
    STRESSES,
    Unit,
)
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.result import Result


def _people() -> Console:
    """Standard output; wide when it is no terminal, so that no table is folded in a file."""
    terminal = sys.stdout is not None and sys.stdout.isatty()
    return Console(soft_wrap=True, highlight=False, markup=False, color_system=None, width=None if terminal else 200)


def _plane(facts: Facts) -> str:
    """How the stage is made a plane problem, in words."""
    words = {"plane_stress": "plane stress", "plane_strain": "plane strain"}
    return words.get(facts["model"], "plane stress corrected by the thickness chart")


def print_stage(facts: Facts) -> None:
    """Print what `check` found."""
    out = _people()
    out.print(
        f"{facts['name']}: mobility {facts['mobility']}, chains {'alike' if facts['chains_alike'] else 'differ'}, "
        f"{_plane(facts)}"
    )
    x, y, R, t = (f"{name} {LENGTH}" for name in ("x", "y", "R", "t"))
    columns = ("chain", "hinge", x, y, f"axis {DEGREE.plain}", R, t, "freedoms")
    table = Table(*columns, box=None, padding=(0, 2, 0, 0))
    for h in facts["hinges"]:
        x, y = h["centre_mm"]
        freedoms = "rotation, axial" if h["prismatic"] else "rotation"
        numbers = (f"{x:z.4f}", f"{y:z.4f}", f"{h['axis_deg']:.2f}", f"{h['radius_mm']:g}", f"{h['neck_mm']:g}")
        table.add_row(str(h["chain"]), h["hinge"], *numbers, freedoms)
    out.print(table)
    out.print("where the numbers come from:")
    for key, source in (facts["provenance"] | dict.fromkeys(facts["not_stated"], "not stated")).items():
        out.print(f"  {key}: {source}", markup=False)
    for text in facts["warnings"]:
        out.print(f"warning: {text}", markup=False)
    for said, keys in (("assumed, not the paper's", facts["assumed"]), ("no source stated", facts["not_stated"])):
        if keys:
            out.print(f"{said}: {', '.join(keys)}", markup=False)


def print_analytic(facts: Facts) -> None:
    """Print what `stiffness` found."""
    out = _people()
    outside = "" if facts["formula_in_range"] else " (outside its range of t/R at some hinge)"
    out.print(
        f"{facts['name']}: analytic model, mobility {facts['mobility']}, {facts['formula']}{outside}, {_plane(facts)}",
        markup=False,
    )
    _print_matrix(out, f"stiffness K_uu, {_both(STIFFNESSES)}", np.array(facts["stiffness"]))
    _print_matrix(out, f"compliance C_uu, {_both(COMPLIANCES)}", np.array(facts["compliance"]))
    _print_ending(out, facts)


def print_solution(facts: Facts) -> None:
    """Print what `solve` found."""
    out = _people()
    size = f"{facts['triangles']} triangles, {facts['unknowns']} unknowns"
    out.print(f"{facts['name']}: finite elements, {_plane(facts)}, {size}")
    _print_matrix(out, f"stiffness, {_both(STIFFNESSES)}", np.array(facts["stiffness"]))
    _print_matrix(out, f"compliance, {_both(COMPLIANCES)}", np.array(facts["compliance"]))
    if any(facts["force"]):
        out.print("force        " + "  ".join(f"{v: .6e}" for v in facts["force"]) + f"  {_all(FORCES)}")
        out.print("displacement " + "  ".join(f"{v: .6e}" for v in facts["displacement"]) + f"  {_all(POSES)}")
        out.print(f"largest von Mises stress at the necks, {STRESS}, chain by chain (base, elbow, platform):")
        for chain, row in enumerate(facts["neck_stress"], start=1):
            out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))
    _print_ending(out, facts)


def print_summary(facts: Facts) -> None:
    """Print how far a stage may go, by every model that was asked."""
    out = _people()
    out.print(
        f"{facts['name']}: mobility {facts['mobility']}, {_plane(facts)}, yield strength {facts['yield_strength']:g} "
        f"{STRESS}",
        markup=False,
    )
    for side in (facts["analytic"], facts["elements"]):
        if side is not None:
            out.print(_limits_table(side))
    if facts["accuracy"]:
        out.print(facts["accuracy"], markup=False)
    out.print("safe range: the other directions held, until the first neck yields; force: along the displacement there")
    _print_ending(out, facts)


def _limits_table(side: Facts) -> Table:
    """Stiffness, range, force and limiting hinge by direction."""
    columns = ("stiffness", "safe range", "force there", "stress per displacement", "first to yield")
    table = Table(side["model"], *columns, box=None, padding=(0, 2, 0, 0))
    units = zip(DIRECTIONS, STIFFNESSES, COMMANDS, FORCES, STRESSES, strict=True)
    for axis, (direction, stiff, command, load, per) in enumerate(units):
        limit = side["limits"][direction]
        table.add_row(
            direction,
            f"{side['stiffness'][axis][axis]:.5g} {stiff.plain}",
            f"±{limit['reach'] * command.factor:.4g} {command.plain}",
            f"{limit['force'][direction] * load.factor:.4g} {load.plain}",
            f"{limit['stress'] * per.factor:.4g} {per.plain}",
            f"{limit['hinge']} hinge, chain {limit['chain']}",
        )
    return table


def print_facts(facts: Facts) -> None:
    """Print plain facts, one a line."""
    out = _people()
    for key, value in facts.items():
        if key not in ("warnings", "assumed", "not_stated"):
            out.print(f"{key}: {value}", markup=False)
    _print_ending(out, facts)


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
    kinds = ("warnings", "assumed", "not_stated")
    once = {kind: list(dict.fromkeys(text for each in results for text in getattr(each, kind))) for kind in kinds}
    _print_ending(out, once)


def print_convergence(facts: Facts) -> None:
    """Print the levels of a mesh study, and what they tend to."""
    out = _people()
    out.print(f"{facts['stage']}: platform compliance on finer and finer meshes", markup=False)
    names = ("triangles across a neck", "unknowns", *map(" ".join, zip(DIRECTIONS, map(str, COMPLIANCES), strict=True)))
    table = Table(*names, box=None, padding=(0, 2, 0, 0))
    for resolution, unknowns, matrix in zip(facts["resolutions"], facts["unknowns"], facts["compliance"], strict=True):
        table.add_row(str(resolution), str(unknowns), *(f"{matrix[k][k]:.9e}" for k in range(3)))
    found = [facts["uncertainty"][axis] for axis in DIRECTIONS]
    table.add_row("extrapolated", "", *(f"{u['extrapolated']:.9e}" for u in found))
    table.add_row("band of the finest", "", *(f"{u['band'] / u['extrapolated']:.1e} relative" for u in found))
    table.add_row("observed order", "", *("none" if u["observed"] is None else f"{u['observed']:.2f}" for u in found))
    table.add_row("verdict", "", *(u["verdict"] for u in found))
    out.print(table)
    _print_ending(out, facts)


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
    _print_ending(out, facts)


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
    outside = [split["out_of_plane"] for split in splits]
    totals = zip(splits, DIRECTIONS, strict=True)
    table.add_row("total", *(f"{split['total'][axis]:.3f} ± {split['band']:.3f}" for split, axis in totals))
    if all(outside):
        points = (share[axis] for share, axis in zip(outside, DIRECTIONS, strict=True))
        table.add_row("outside it: out of plane", *(f"{value:+z.3f}" for value in points))
    out.print(table)
    _print_ending(out, facts)


def print_workspace(facts: Facts) -> None:
    """Print what the terms of (16) and large displacements are worth, at a tenth of the commands and at all of them."""
    out = _people()
    out.print(
        f"{facts['stage']}: large displacements, mobility {facts['mobility']}, {facts['formula']}, against nonlinear "
        f"finite elements of {facts['unknowns']} unknowns"
    )
    kinds = {"stiffness": "tangent stiffness, change from rest", "position": "linear position error, along"}
    kinds["across"] = "linear position error, across"
    models = ("without", "tangent", "exact", "elements", "loaded")
    columns = ("(16) less its terms", "(16)", "exact", "elements", "elements, same load")
    table = Table("per cent", "commanded", "at", *columns, box=None, padding=(0, 2, 0, 0))
    for kind, name in kinds.items():
        for axis, unit in zip(DIRECTIONS, COMMANDS, strict=True):
            for point in facts["travel"][axis]["points"]:
                numbers = (f"{point[kind][m]:+z.4f}" if m in point[kind] else "" for m in models)
                table.add_row(name, axis, f"{unit.factor * point['commanded']:+g} {unit.plain}", *numbers)
    out.print(table)
    for part, size in (("small", "a tenth of these commands"), ("box", "all of them")):
        box = facts[part]
        out.print(
            f"anywhere within {size}: linear position off by up to {box['position']:.3f} %, the second-order terms of "
            f"(16) change the tangent compliance by up to {box['terms']:.3f} %"
        )
    _print_ending(out, facts)


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
    _print_ending(out, facts)


def print_regression(facts: Facts) -> None:
    """Print one line for everything that is not as accepted; what several baselines say, once."""
    lines = list(dict.fromkeys(finding["line"] for finding in facts["findings"]))
    print("\n".join([*lines, f"checked {', '.join(facts['checked'])}: "]), end="")
    print(f"{len(lines)} not as accepted" if lines else "all as accepted")


def print_written(facts: Facts) -> None:
    """Print the files written."""
    for path in facts["written"]:
        print(path)


def _both(units: Sequence[Unit]) -> str:
    """The units of translations and of rotations."""
    return " and ".join(dict.fromkeys(unit.plain for unit in units))


def _all(units: Sequence[Unit]) -> str:
    return ", ".join(unit.plain for unit in units)


def _print_matrix(out: Console, title: str, matrix: Array) -> None:
    out.print(f"{title} (x, y, theta)")
    for row in matrix:
        out.print("  " + "  ".join(f"{value: .9e}" for value in row))


def _print_ending(out: Console, facts: Facts) -> None:
    """Print the warnings, and how many numbers are in doubt."""
    for text in facts.get("warnings", ()):
        out.print(f"warning: {text}", markup=False)
    if facts["assumed"]:
        out.print(f"{len(facts['assumed'])} of these numbers are assumed, not the paper's: flexfem check lists them")
    if facts["not_stated"]:
        count = len(facts["not_stated"])
        out.print(f"{count} of these numbers have no source in the file: flexfem check lists them")
