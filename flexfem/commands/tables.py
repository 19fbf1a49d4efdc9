"""What commands on one stage print for people: tables of their records."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem.units import (
    COMMANDS,
    COMPLIANCES,
    DEGREE,
    FORCES,
    LENGTH,
    MICROMETRE,
    POSES,
    RATE,
    STIFFNESSES,
    STRESS,
    STRESSES,
    Unit,
)
from flexfem.verify.limits import grouped

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from flexfem.arrays import Array
    from flexfem.verify.answers import LoadReport, MeshReport, PlacedActuator, PlacedHinge, StageReport, StiffnessReport
    from flexfem.verify.case import Direction
    from flexfem.verify.hinges import KnownFormula
    from flexfem.verify.reach import Extent, Range
    from flexfem.verify.solid import SolidReport
    from flexfem.verify.summary import ModelSummary, Summary

DIRECTIONS: tuple[Direction, ...] = ("x", "y", "theta")


class Ending(NamedTuple):
    """What is said below every table."""

    warnings: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str]


def people() -> Console:
    """Standard output; wide when it is no terminal, so that no table is folded in a file."""
    from rich.console import Console

    terminal = sys.stdout is not None and sys.stdout.isatty()
    return Console(soft_wrap=True, highlight=False, markup=False, color_system=None, width=None if terminal else 200)


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> Table:
    from rich.table import Table

    made = Table(*head, box=None, padding=(0, 2, 0, 0))
    for row in rows:
        made.add_row(*row)
    return made


def numbers(values: Sequence[float], units: Sequence[Unit]) -> str:
    """Numbers with their units, in a line."""
    return ", ".join(f"{value * unit.factor:.5g} {unit.plain}" for value, unit in zip(values, units, strict=True))


def _plane(model: str) -> str:
    """How the stage is made a plane problem, in words."""
    words = {"plane_stress": "plane stress", "plane_strain": "plane strain"}
    return words.get(model, "plane stress corrected by the thickness chart")


def print_stage(of: StageReport) -> None:
    """Print what `check` found."""
    out = people()
    chains = "alike" if of.chains_alike else "differ"
    out.print(f"{of.name}: mobility {of.mobility}, chains {chains}, {_plane(of.model)}")
    x, y, R, t = (f"{name} {LENGTH}" for name in ("x", "y", "R", "t"))
    head = ("chain", "hinge", x, y, f"axis {DEGREE.plain}", R, t, "freedoms")
    out.print(table(head, map(_hinge, of.hinges)))
    for one in of.drive.actuators if of.drive else ():
        out.print(_actuator(one))
    out.print("where the numbers come from:")
    stated = of.provenance | (of.drive.provenance if of.drive else {})
    unstated = (*of.not_stated, *(key for key in (of.drive.not_stated if of.drive else ()) if key not in of.not_stated))
    for key, source in (stated | dict.fromkeys(unstated, "not stated")).items():
        out.print(f"  {key}: {source}")
    for text in of.warnings:
        out.print(f"warning: {text}")
    for said, keys in (("assumed, not the paper's", of.assumed), ("no source stated", of.not_stated)):
        if keys:
            out.print(f"{said}: {', '.join(keys)}")


def _actuator(one: PlacedActuator) -> str:
    """An actuator in a line."""
    kind = "a pair of stacks" if len(one.contacts_mm) == 2 else "a stack"
    k, with_contact = (value * RATE.factor for value in (one.stiffness, one.stiffness_with_contact))
    own = "" if len(one.chains) == 3 else f", chain {' and '.join(map(str, one.chains))}"
    return (
        f"drive {one.name}{own}: {kind} {one.stack or 'of its own'} on {one.between[0]} pushing {one.between[1]}, "
        f"{one.stroke * MICROMETRE.factor:g} {MICROMETRE.plain}, {one.blocking_force:.4g} N, {k:.4g} {RATE.plain}, "
        f"{with_contact:.4g} with its contact, preload {one.preload:g} N"
    )


def _hinge(h: PlacedHinge) -> Iterator[str]:
    x, y = h.centre_mm
    yield from (str(h.chain), h.hinge, f"{x:z.4f}", f"{y:z.4f}", f"{h.axis_deg:.2f}")
    yield from (f"{h.radius_mm:g}", f"{h.neck_mm:g}", "rotation, axial" if h.prismatic else "rotation")


def print_stiffness(of: StiffnessReport) -> None:
    """Print what `stiffness` found."""
    out = people()
    outside = "" if of.formula_in_range else " (outside its range of t/R at some hinge)"
    out.print(f"{of.name}: analytic model, mobility {of.mobility}, {of.formula}{outside}, {_plane(of.model)}")
    _print_matrix(out, f"stiffness K_uu, {_both(STIFFNESSES)}", of.stiffness)
    _print_matrix(out, f"compliance C_uu, {_both(COMPLIANCES)}", of.compliance)
    out.print("highest neck stress per displacement, the others held:")
    for axis, unit in enumerate(STRESSES):
        stress = of.neck_stress[..., axis]
        chain, hinge = divmod(int(stress.argmax()), 3)
        where = f"{('base', 'elbow', 'platform')[hinge]} hinge, chain {chain + 1}"
        out.print(f"  {DIRECTIONS[axis]:<6} {stress.max() * unit.factor:.4g} {unit.plain}, {where}")
    out.print(f"stress: {of.stress_accuracy}")
    print_ending(out, of)


def print_load(of: LoadReport) -> None:
    """Print what `solve` found."""
    out = people()
    out.print(f"{of.name}: finite elements, {_plane(of.model)}, {of.triangles} triangles, {of.unknowns} unknowns")
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
    for name, found, units in (("force", of.force, FORCES), ("displacement", of.displacement, POSES)):
        values = "  ".join(f"{value: .6e}" for value in found)
        out.print(f"{name:<12} {values}  {', '.join(unit.plain for unit in units)}")
    out.print(f"largest von Mises stress at the necks, {STRESS}, chain by chain (base, elbow, platform):")
    for chain, row in enumerate(of.neck_stress, start=1):
        out.print(f"  {chain}  " + "  ".join(f"{v:10.4g}" for v in row))


def print_summary(of: Summary) -> None:
    """Print how far a stage may go, by every model that was asked."""
    from flexfem.stage.schema import of_drive

    out = people()
    strength = f"yield strength {of.yield_strength:g} {STRESS}"
    out.print(f"{of.name}: mobility {of.mobility}, {_plane(of.model)}, {strength}")
    columns = ("stiffness", "safe range", "force there", "stress per displacement", "first to yield")
    for source in dict.fromkeys(of.material.values()):
        out.print(f"{', '.join(key for key, text in of.material.items() if text == source)}: {source}")
    for side in (of.analytic, of.elements):
        if side is not None:
            out.print(table((side.model, *columns), _limits(side)))
    if of.accuracy:
        out.print(of.accuracy)
    out.print("safe range: the other directions held, until the first neck yields; force: along the displacement there")
    if of.drive is not None:
        head = ("the drive reaches", "others at zero", "others free", "stopped, at zero, by limits of")
        out.print(table(head, _driven(of.drive.ranges)))
        doubted = [key for key in (*of.drive.assumed, *of.drive.not_stated) if of_drive(key)]
        out.print(f"{len(doubted)} numbers of the drive are assumed or without a stated source")
    print_ending(out, of)


def _driven(ranges: Mapping[Direction, Range]) -> Iterator[list[str]]:
    """Ranges of the drive by direction, and what stops them at the high end."""
    for (direction, each), unit in zip(ranges.items(), COMMANDS, strict=True):
        stop = "" if each.held is None else grouped(each.held.high_by)
        yield [direction, ends(each.held, unit), ends(each.free, unit), stop]


def ends(of: Extent | None, unit: Unit) -> str:
    """A range in words."""
    return "none" if of is None else f"{unit.factor * of.low:z.4g} to {unit.factor * of.high:z.4g} {unit.plain}"


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
    out = people()
    for key in ("file", "name", "written", "resolution", "nodes", "triangles"):
        out.print(f"{key}: {getattr(of, key)}")
    print_ending(out, of)


def print_formulas(of: Mapping[str, KnownFormula]) -> None:
    """Print the hinge formulas, one a line and its source below."""
    out = people()
    for name, formula in of.items():
        low, high = formula.t_over_R
        out.print(f"{name}: {', '.join(formula.freedoms)}; t/R {low:g} to {high:g}")
        out.print(f"    {formula.source}. {formula.status}")


def _both(units: Sequence[Unit]) -> str:
    """The units of translations and of rotations."""
    return " and ".join(dict.fromkeys(unit.plain for unit in units))


def _print_matrix(out: Console, title: str, matrix: Array) -> None:
    out.print(f"{title} (x, y, theta)")
    for row in matrix:
        out.print("  " + "  ".join(f"{value: .9e}" for value in row))


def print_ending(out: Console, of: Any) -> None:
    """Print the warnings of a record, and how many numbers are in doubt."""
    for text in of.warnings:
        out.print(f"warning: {text}")
    if of.assumed:
        out.print(f"{len(of.assumed)} of these numbers are assumed, not the paper's: --json lists them")
    if of.not_stated:
        out.print(f"{len(of.not_stated)} of these numbers have no stated source: --json lists them")
