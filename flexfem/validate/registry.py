"""All benchmarks by name, the table of their findings, and the table as text."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from flexfem.files.writing import markdown_table, write_atomically
from flexfem.refused import BadInput
from flexfem.validate import (
    beams,
    bending,
    exact,
    fatigue_constants,
    holes,
    membranes,
    vibrating,
    vibrating_solids,
    warm,
    wedges,
)
from flexfem.validate.records import Finding

FILE = "benchmarks.md"
BENCHMARKS: Mapping[str, Callable[[], list[Finding]]] = MappingProxyType(
    {
        "manufactured-solution": exact.manufactured,
        "patch-test": exact.patch,
        "rigid-body-motions": exact.rigid_motions,
        "reciprocity": exact.reciprocity,
        "balances": exact.balances,
        "kirsch-hole": holes.kirsch,
        "howland-strips": holes.howland,
        "nafems-le1": membranes.nafems_le1,
        "cook-membrane": membranes.cook,
        "macneal-harder-straight-beam": beams.macneal_harder,
        "macneal-harder-curved-beam": beams.curved_beam,
        "timoshenko-cantilever": beams.timoshenko,
        "circular-notch": holes.notch,
        "elastica": bending.elastica,
        "tangent": bending.tangent_order,
        "nafems-fv32": vibrating.nafems_fv32,
        "vibrating-rods": vibrating.rods,
        "free-body": vibrating.free_motions,
        "dowling-fit": fatigue_constants.dowling_fit,
        "dowling-table": fatigue_constants.dowling_table,
        "warm-free-body": warm.free_bodies,
        "hot-spot": warm.hot_spot,
        "wedge-patch-test": wedges.patch,
        "wedge-rigid-motions": wedges.rigid_motions,
        "thickness-limits": wedges.thickness_limits,
        "zettl-bounds": wedges.zettl,
        "bent-beam": vibrating_solids.bent_beam,
        "annular-plate": vibrating_solids.annular_plate,
        "free-solid": vibrating_solids.free_halves,
    }
)


class BenchmarkTable(NamedTuple):
    """Findings in the order of the registry, and the time of each benchmark, s."""

    findings: list[Finding]
    seconds: dict[str, float]

    @property
    def passed(self) -> bool:
        """Whether every finding passed."""
        return all(finding.passed for finding in self.findings)


def run_benchmarks(
    names: Sequence[str] | None = None, progress: Callable[[str], object] | None = None
) -> BenchmarkTable:
    """Run all benchmarks, or those named.

    Parameters
    ----------
    progress : called with the name of each benchmark before it runs.

    Raises
    ------
    BadInput: a name is not registered.
    ComputationFailed: gmsh failed, or a system could not be solved.
    """
    findings, seconds = [], {}
    for name in BENCHMARKS if names is None else names:
        if name not in list(BENCHMARKS):
            raise BadInput(f"benchmark {name!r} is not known, expected one of: {', '.join(BENCHMARKS)}")
        if progress is not None:
            progress(name)
        start = time.perf_counter()
        findings += BENCHMARKS[name]()
        seconds[name] = time.perf_counter() - start
    return BenchmarkTable(findings, seconds)


def markdown_page(table: BenchmarkTable) -> str:
    """The findings as a page in Markdown: the numbers, then sources and notes."""
    failed = sum(not finding.passed for finding in table.findings)
    verdict = f"{failed} of {len(table.findings)} failed" if failed else f"all {len(table.findings)} passed"
    head = ("benchmark", "quantity", "target", "±", "ours", "difference", "allowed", "unknowns", "")
    lines = [
        "# Code verification",
        "",
        f"Every target is published or exact, none is a value of our own; {verdict},"
        f" in {sum(table.seconds.values()):.0f} s.",
        "",
        markdown_table(head, map(_row, table.findings), "llrrrrrr"),
        "",
        "## Sources",
        "",
    ]
    sources = dict.fromkeys((finding.name, finding.source) for finding in table.findings)
    lines += [f"- {name}: {source}." for name, source in sources]
    notes = [f"- {found.name}, {found.quantity}: {found.note}." for found in table.findings if found.note]
    return "\n".join([*lines, "", "## Notes", "", *notes]) + "\n"


def write_benchmarks(table: BenchmarkTable, folder: Path) -> Path:
    """Write the page into a folder, made when missing; returns its path. Raises BadInput when it takes no file."""
    path = folder / FILE
    write_atomically(path, lambda file: file.write(markdown_page(table).encode()))
    return path


def _row(found: Finding) -> list[str]:
    uncertainty = f"{found.target_uncertainty:.2g}" if found.target_uncertainty else "exact"
    relative = f" ({100 * found.difference / found.target:+.2f} %)" if found.target else ""
    cells = [found.name, found.quantity, f"{found.target:.5g}", uncertainty, f"{found.ours:.5g}"]
    cells += [f"{found.difference:+.1e}{relative}", f"{found.allowed:.2g}", f"{found.unknowns}"]
    return [*cells, "passed" if found.passed else "**FAILED**"]
