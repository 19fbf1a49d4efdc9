"""What commands on one stage print for people: tables of their records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem.terminal import people
from flexfem.units import (
    COMPLIANCES,
    FORCES,
    LENGTH,
    PLANES,
    POSES,
    STIFFNESSES,
    STRESS,
    STRESSES,
    Unit,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from flexfem.arrays import Array
    from flexfem.units import Direction
    from flexfem.verify.answers import LoadReport, StiffnessReport
    from flexfem.verify.solid_report import SolidReport

DIRECTIONS: tuple[Direction, ...] = ("x", "y", "theta")


class Ending(NamedTuple):
    """What is said below every table."""

    warnings: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str]


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> Table:
    from rich.table import Table

    made = Table(*head, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        made.add_row(*row)
    return made


def numbers(values: Sequence[float], units: Sequence[Unit]) -> str:
    """Numbers with their units, in a line."""
    return ", ".join(f"{value * unit.factor:z.5g} {unit.plain}" for value, unit in zip(values, units, strict=True))


def print_stiffness(of: StiffnessReport) -> None:
    """Print what `stiffness` found."""
    out = people()
    outside = "" if of.formula_in_range else " (outside its range of t/R at some hinge)"
    freedoms = "elastic links" if of.links else f"mobility {of.mobility}"
    out.print(f"{of.name}: analytic model, {of.formula}{outside}, {freedoms}, {PLANES[of.model]}")
    _print_matrix(out, f"stiffness K_uu, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance C_uu, {_both(COMPLIANCES)}", of.compliance)
    out.print("highest neck stress per displacement, the others held:")
    for axis, unit in enumerate(STRESSES):
        out.print(f"  {DIRECTIONS[axis]:<6} {_peak(of.neck_stress[..., axis], unit)}")
        if of.elements is not None:
            band = of.elements.band[axis] * unit.factor
            metal = _peak(of.elements.stress[..., axis], unit, f" ± {band:.2g}")
            out.print(f"         finite elements, resolution {of.elements.resolution}: {metal}")
    out.print(f"stress: {of.stress_accuracy}")
    print_ending(out, of)


def _peak(stress: Array, unit: Unit, band: str = "") -> str:
    """The highest of neck stresses (3, 3) per displacement, and where."""
    from flexfem.arrays import first_highest

    chain, hinge = first_highest(stress)
    where = f"{('base', 'elbow', 'platform')[hinge]} hinge, chain {chain + 1}"
    return f"{stress.max() * unit.factor:.4g}{band} {unit.plain}, {where}"


def print_load(of: LoadReport) -> None:
    """Print what `solve` found."""
    out = people()
    out.print(f"{of.name}: finite elements, {PLANES[of.model]}, {of.triangles} triangles, {of.unknowns} unknowns")
    _print_matrix(out, f"stiffness, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance, {_both(COMPLIANCES)}", of.compliance)
    if any(of.force):
        _print_load_case(out, of)
    print_ending(out, of)


def print_solid(of: SolidReport) -> None:
    """Print what `solve --three-dimensional` found."""
    out = people()
    heights = ", ".join(f"{z:.4g}" for z in of.heights)
    wedges = f"{of.triangles} triangles times {of.layers} layers in half the thickness"
    out.print(f"{of.name}: finite elements in three dimensions, {wedges}, {of.unknowns} unknowns")
    out.print(f"bounds of the layers from the mid-plane, {LENGTH}: {heights}")
    _print_matrix(out, f"stiffness, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance, {_both(COMPLIANCES)}", of.compliance)
    head = ("of the compliance, %", *DIRECTIONS)
    rows = [
        (said, *(f"{100 * sign * of_one[k, k] / of.compliance[k, k]:.3g}" for k in range(3)))
        for said, of_one, sign in (
            ("band, mesh in the plane", of.band_plane, 1),
            ("band, layers through the thickness", of.band_thickness, 1),
            ("plane stress is softer by", of.plane_stress - of.compliance, 1),
            ("plane strain is stiffer by", of.plane_strain - of.compliance, -1),
        )
    ]
    out.print(table(head, rows))
    if any(of.force):
        _print_load_case(out, of)
        out.print(f"where, {LENGTH} from the mid-plane (the face is at {of.heights[-1]:g}):")
        for chain, row in enumerate(of.neck_height, start=1):
            out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))
    print_ending(out, of)


def _print_load_case(out: Console, of: LoadReport | SolidReport) -> None:
    import numpy as np

    from flexfem.arrays import ROUND_OFF

    most = np.sqrt(np.diag(of.compliance) * (of.force @ of.displacement))  # that so much work can move
    moved = np.where(np.abs(of.displacement) <= ROUND_OFF * most, 0.0, of.displacement)
    for name, found, units in (("force", of.force, FORCES), ("displacement", moved, POSES)):
        values = "  ".join(f"{value: .6e}" if value else f"{'0':>13}" for value in found)
        out.print(f"{name:<12} {values}  {', '.join(unit.plain for unit in units)}")
    out.print(f"largest von Mises stress at the necks, {STRESS}, chain by chain (base, elbow, platform):")
    for chain, row in enumerate(of.neck_stress, start=1):
        out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))


def _both(units: Sequence[Unit]) -> str:
    """The units of translations and of rotations."""
    return " and ".join(dict.fromkeys(unit.plain for unit in units))


def _print_matrix(out: Console, title: str, matrix: Array) -> None:
    from flexfem.arrays import without_round_off

    out.print(f"{title} (x, y, theta)")
    for row in without_round_off(matrix):
        out.print("  " + "  ".join(f"{value: .9e}" if value else f"{'0':>16}" for value in row))


def print_ending(out: Console, of: Any) -> None:
    """Print the warnings of a record, and how many numbers are in doubt."""
    from flexfem.mechanism.stage_file import doubts_said

    for text in of.warnings:
        out.print(f"warning: {text}")
    for text in doubts_said(of.assumed, of.not_stated):
        out.print(f"{text}: --json lists them")
