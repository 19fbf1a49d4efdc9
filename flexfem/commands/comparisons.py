"""What commands that compare print for people: error percentages, shares and meshes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from flexfem.commands.console import show
from flexfem.commands.tables import DIRECTIONS, Ending, print_ending, table
from flexfem.terminal import people
from flexfem.units import COMPLIANCES, STRESSES, Unit

if TYPE_CHECKING:
    from flexfem.commands.baseline.store import Checked
    from flexfem.verify.budget import Budget, ThreeDimensional
    from flexfem.verify.converge import MeshStudy
    from flexfem.verify.result import NeckPeak, Result


def show_checked(checked: Sequence[Checked], as_json: bool) -> NoReturn:
    """Print what changed or moved by baseline, each as data and as a line, and end the command accordingly."""
    found = [{"baseline": each.name, **each.data(one), "line": str(one)} for each in checked for one in each.findings]
    show({"checked": [each.name for each in checked], "findings": found}, as_json, print_regression)
    raise typer.Exit(1 if found else 0)


def print_results(results: Sequence[Result], output: Path) -> None:
    """Print the error percentages of every case."""
    out = people()
    out.print("error of the finite-element displacement, in per cent of the command")
    layers = ", and the layers" if any(each.elements == "three_dimensional" for each in results) else ""
    out.print(f"(rotations against translations by the lever l3; ± is the mesh, by grid convergence{layers})")
    rows = (row for result in results for row in _errors(result))
    out.print(table(("case", "commanded", "model", "X %", "Y %", "theta %"), rows))
    out.print(
        "highest neck stress per displacement in the commanded direction: by the model with the other directions held;"
        " by finite elements over the displacement that they reach"
    )
    out.print(table(("case", "", "model", "of the model", "", "of finite elements", ""), _peaks(results)))
    out.print(f"stored in {output}/")
    kinds = [[text for each in results for text in getattr(each, kind)] for kind in Ending._fields]
    print_ending(out, Ending(*(list(dict.fromkeys(texts)) for texts in kinds)))


def _peaks(results: Sequence[Result]) -> Iterator[tuple[str, ...]]:
    """Highest neck stress of every curve by both models, with the neck."""
    for result in results:
        unit = STRESSES[DIRECTIONS.index(result.direction)]
        for label, of in result.models.items():
            band = "" if of.peak_band is None else f" ± {of.peak_band * unit.factor:.2g}"
            cells = (*_peak(of.model_peak, unit, ""), *_peak(of.element_peak, unit, band))
            yield (result.case, unit.plain, label, *cells)


def _peak(of: NeckPeak | None, unit: Unit, band: str) -> tuple[str, str]:
    return ("", "") if of is None else (f"{of.stress * unit.factor:.4g}{band}", f"{of.hinge}, chain {of.chain}")


def _errors(result: Result) -> Iterator[tuple[str, ...]]:
    from flexfem.plot.text import COMMANDED, OF_STAGE

    for label, percent in result.error_percent.items():
        bands = result.uncertainty[label]
        numbers = (f"{getattr(percent, axis):z.3f} ± {bands[axis].band:.3f}" for axis in DIRECTIONS)
        commanded = f"{result.direction}{COMMANDED[result.drive]}{OF_STAGE[result.elements]}"
        yield (result.case, commanded, label, *numbers)


def print_convergence(of: MeshStudy) -> None:
    """Print the levels of a mesh study, and what they tend to."""
    out, found = people(), [of.uncertainty[axis] for axis in DIRECTIONS]
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
    out.print(table(head, rows))
    print_ending(out, of)


def print_budget(of: Budget) -> None:
    """Print the shares of the error in the commanded directions."""
    out, splits = people(), [(of.split[axis], axis) for axis in DIRECTIONS]
    out.print(f"{of.stage}: error of mobility {of.mobility}, {of.formula}, in per cent of the command")
    shares = [[(each.name, getattr(each.points, axis)) for each in split.shares] for split, axis in splits]
    rows = [(row[0][0], *(f"{points:+z.3f}" for _, points in row)) for row in zip(*shares, strict=True)]
    rows.append(("total", *(f"{getattr(split.total, axis):.3f} ± {split.band:.3f}" for split, axis in splits)))
    outside = [(split.out_of_plane, axis) for split, axis in splits]
    if all(share is not None for share, _ in outside):
        rows.append(("outside it: hinges by the chart", *(f"{getattr(share, axis):+z.3f}" for share, axis in outside)))
    if of.three_dimensional is not None:
        rows += _in_three_dimensions(of, of.three_dimensional)
    out.print(table(("share", *DIRECTIONS), rows))
    print_ending(out, of)


def _in_three_dimensions(of: Budget, solid: ThreeDimensional) -> list[tuple[str, ...]]:
    """What three dimensions change, measured on the stage, and the error against such a stage."""
    changed = [(getattr(solid.points[axis], axis), solid.band[axis], of.split[axis]) for axis in DIRECTIONS]
    against = [getattr(split.total, axis) for (*_, split), axis in zip(changed, DIRECTIONS, strict=True)]
    both = [(total + points, band + split.band) for total, (points, band, split) in zip(against, changed, strict=True)]
    return [
        ("outside it: three dimensions", *(f"{points:+z.3f} ± {band:.3f}" for points, band, _ in changed)),
        ("total in three dimensions", *(f"{total:.3f} ± {band:.3f}" for total, band in both)),
    ]


def print_regression(of: Mapping[str, Any]) -> None:
    """Print one line for everything that is not as accepted; what several baselines say, once."""
    lines = list(dict.fromkeys(finding["line"] for finding in of["findings"]))
    print("\n".join([*lines, f"checked {', '.join(of['checked'])}: "]), end="")
    print(f"{len(lines)} not as accepted" if lines else "all as accepted")
