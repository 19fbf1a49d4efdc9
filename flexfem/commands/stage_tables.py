"""What `check`, `summary`, `mesh` and `formulas` print for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from flexfem.commands.tables import DIRECTIONS, ends, print_ending, table
from flexfem.terminal import people
from flexfem.units import COMMANDS, DEGREE, FORCES, LENGTH, MICROMETRE, PLANES, RATE, STIFFNESSES, STRESS, STRESSES
from flexfem.verify.limits import grouped

if TYPE_CHECKING:
    from flexfem.units import Direction
    from flexfem.verify.answers import MeshReport
    from flexfem.verify.hinges import KnownFormula
    from flexfem.verify.pose_set import Range
    from flexfem.verify.stage_report import PlacedActuator, PlacedHinge, StageReport
    from flexfem.verify.summary import ModelSummary, Summary


def print_stage(of: StageReport) -> None:
    """Print what `check` found."""
    out = people()
    chains = "alike" if of.chains_alike else "differ"
    out.print(f"{of.name}: mobility {of.mobility}, chains {chains}, {PLANES[of.model]}")
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
    for said, keys in (("assumed", of.assumed), ("no source stated", of.not_stated)):
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
        f"{with_contact:.4g} with {one.contact}, preload {one.preload:g} N"
    )


def _hinge(h: PlacedHinge) -> Iterator[str]:
    x, y = h.centre_mm
    yield from (str(h.chain), h.hinge, f"{x:z.4f}", f"{y:z.4f}", f"{h.axis_deg:.2f}")
    yield from (f"{h.radius_mm:g}", f"{h.neck_mm:g}", "rotation, axial" if h.prismatic else "rotation")


def print_summary(of: Summary) -> None:
    """Print how far a stage may go, by every model that was asked."""
    from flexfem.mechanism.stage_file import counted, of_drive

    out = people()
    strength = f"yield strength {of.yield_strength:g} {STRESS}"
    out.print(f"{of.name}: mobility {of.mobility}, {strength}")
    columns = (
        "stiffness, others held",
        "safe range",
        "force there",
        "stress per displacement",
        "first to yield",
        "stiffness, others free",
    )
    for source in dict.fromkeys(of.material.values()):
        out.print(f"{', '.join(key for key, text in of.material.items() if text == source)}: {source}")
    for side in (of.analytic, of.elements):
        if side is not None:
            out.print(side.model)
            out.print(table(("", *columns), _limits(side)))
    if of.thickness is not None:
        effect = ", ".join(f"{value:+.3g} % in {axis}" for axis, value in of.thickness.model_dump().items())
        out.print(f"thickness: three-dimensional hinges change the stiffness in {PLANES[of.plane]} by {effect}")
    if of.accuracy:
        out.print(of.accuracy)
    out.print("stiffness: K_ii with the other directions held, 1 / C_ii with them free")
    out.print("safe range: the other directions held, until the first neck yields; force: along the displacement there")
    if of.drive is not None:
        head = ("the drive reaches", "others at zero", "others free", "stopped, at zero, by limits of")
        out.print(table(head, _driven(of.drive.ranges)))
        doubted = [key for key in (*of.drive.assumed, *of.drive.not_stated) if of_drive(key)]
        said = counted(len(doubted), "number of the drive is", "numbers of the drive are")
        out.print(f"{said} assumed or without a stated source")
    print_ending(out, of)


def _driven(ranges: Mapping[Direction, Range]) -> Iterator[list[str]]:
    """Ranges of the drive by direction, and what stops them at the high end."""
    for (direction, each), unit in zip(ranges.items(), COMMANDS, strict=True):
        stop = "" if each.held is None else grouped(each.held.high_by)
        yield [direction, ends(each.held, unit), ends(each.free, unit), stop]


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
            f"{side.free[axis]:.5g} {stiff.plain}",
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
