"""Warnings about results of a stage outside the range of validity of its models; each function
returns sentences, or none.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.files.tables import memoized
from flexfem.hinges.formulas import FORMULAS
from flexfem.paper.designs import design_arrays, envelope
from flexfem.paper.model import AnalyticResult, analyse, best_model, corrected, in_range
from flexfem.paper.stage import HINGE_NAMES, Stage
from flexfem.paper.stage_file import Plane
from flexfem.questions.warnings import RIGHT_UNIT, Warnings, implausible
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import DIRECTIONS, LENGTH, PLANES

BEAM_INTEGRALS = ("paros-weisbord", "wu-zhou", "lobontiu", "quadrature")  # the same numbers
# Per cent by which the highest neck stress per displacement exceeds that of plane finite elements,
# with elastic links: smallest and largest of the reference stages and of random ones
# (benchmarks/stress.py), rounded outwards. The stress concentration is accurate to 1 %; the rest is
# due to the stiffness of the hinges.
STRESS_ABOVE = {
    **dict.fromkeys(BEAM_INTEGRALS, (10.0, 22.0)),
    "paros-weisbord-short": (8.0, 10.0),
    "smith-chetwynd": (3.0, 5.0),
    "koster": (-1.0, 6.0),
    "schotborgh": (1.0, 3.0),
    "calibrated": (-1.0, 1.0),
}
RIGID_ABOVE = {"calibrated": (1.0, 9.0)}  # the same with rigid links
# the same for `model = "corrected"` and three-dimensional finite elements of whole stages
# (benchmarks/solid_stress.py)
SOLID_ABOVE = {
    **dict.fromkeys(BEAM_INTEGRALS, (5.0, 23.0)),
    "smith-chetwynd": (-1.0, 6.0),
    "koster": (-4.0, 6.0),
    "calibrated": (-2.0, 2.0),
}
SOLID_BELOW = "finite elements of resolution 6 with 3 layers are up to 2 % low; "  # 1.6 at b/t = 20
# margin of the limits of driven stages, as a share of the yield strength: the model may
# underestimate the neck stress
YIELD_MARGIN: dict[Plane, float] = {"plane_stress": 0.01, "plane_strain": 0.01, "corrected": 0.02}
# per cent of the model's own compliance; the paper aims to explain errors of 5 to 10 per cent
LEFT_OUT = 5.0
STRAIGHT = 15.0  # deg between the lines of a chain's hinges; only selects an explanation
THICK = 1.0  # per cent of the stiffness: a tenth of the effect of a thick hinge
FAR = 0.1  # of the shortest link, and rad: here the linear solution has errors of some per cent


def of_stage(stage: Stage) -> Warnings:
    """Return the warnings on a stage's own analytic model with the default formula, or that it has
    no solution.
    """
    try:
        return of_result(stage, analyse(stage))
    except (BadInput, ComputationFailed) as error:
        reason = error.reason if isinstance(error, BadInput) else error
        return [*of_numbers(stage), f"the analytic model has no solution: {reason}"]


def of_result(stage: Stage, model: AnalyticResult) -> Warnings:
    """Return the warnings on the numbers of a stage and on one of its analytic models."""
    return [*of_numbers(stage), *of_formula(stage, model.formula), *of_model(stage, model)]


def of_numbers(stage: Stage) -> Warnings:
    """Warn of numbers of a stage file that are possible, but probably in another unit."""
    design = design_arrays(stage)
    across = float(envelope(design)[0])
    neck = float(np.min(design.neck))
    doubts = implausible("stage", stage.material, stage.thickness, across, neck)
    if max(map(abs, stage.chain.joint_angles)) <= np.deg2rad(2 * np.pi):
        doubts.append(f"chain.joint_angles_deg are all within two pi: {RIGHT_UNIT}")
    return doubts


def of_motion(
    stage: Stage,
    pose: Array,
    where: str,
) -> Warnings:
    """Warn of a platform displacement (3,), mm, mm, rad, outside the range of the linear solution."""
    shortest = min(stage.chain.link_lengths)
    translation = float(np.max(np.abs(pose[:2])))
    rotation = float(np.abs(pose[2]))
    if translation <= FAR * shortest and rotation <= FAR:
        return []
    return [
        f"{where}: the platform moves {translation:.3g} {LENGTH} and turns {rotation:.3g} rad, "
        f"more than {FAR:g} of the shortest link ({shortest:g} {LENGTH}) or {FAR:g} rad; the "
        "linear result is not valid there"
    ]


def of_formula(stage: Stage, formula: str) -> Warnings:
    """Warn of hinges outside the range of a hinge formula; those outside in all chains are named
    once.
    """
    design = design_arrays(stage)
    outside = ~in_range(design, formula)[0]
    if not np.any(outside):
        return []
    ratio = (design.neck / design.radius)[0, outside]
    low, high = FORMULAS[formula].valid
    used = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (ratio.min(), ratio.max())))
    return [
        f"hinge formula {formula} is valid for t/R from {low:g} to {high:g}, and is used at {used} "
        f"({', '.join(_named_hinges(outside))})"
    ]


def _named_hinges(chosen: AnyArray) -> list[str]:
    """Name hinges (3 chains, 3 hinges); those that are chosen in all chains together."""
    in_all = np.all(chosen, axis=0)
    together = [
        f"{name} hinges" for name, each in zip(HINGE_NAMES, in_all.tolist(), strict=True) if each
    ]
    alone = np.argwhere(chosen & ~in_all)
    return together + [f"{HINGE_NAMES[k]} hinge of chain {chain + 1}" for chain, k in alone]


def of_model(stage: Stage, model: AnalyticResult) -> Warnings:
    """Warn of hinge freedoms and link elasticity that a model neglects although they matter on this
    stage.

    The compliances of one hinge formula are compared: the model's, with axial freedoms, with shear,
    with elastic links."""
    ladder = np.array([np.diag(model.compliance), *_refined(stage, model.formula, model.mobility)])
    gained = 100.0 * (ladder[-1] / ladder[0] - 1.0)
    if not np.any(gained > LEFT_OUT):
        return []
    worst = int(np.argmax(gained))
    names = ("axial freedoms", "shear freedoms", "elastic links")[4 - len(ladder) :]
    shares = 100.0 * np.diff(ladder[:, worst]) / ladder[0, worst]
    parts = [
        f"{name} {share:.3g} %" for name, share in zip(names, shares, strict=True) if share > 0.1
    ]
    return [
        f"the analytic model of mobility {model.mobility} is not accurate for this stage: the "
        f"neglected compliances make it {gained[worst]:.3g} % softer in {DIRECTIONS[worst]} "
        f"({', '.join(parts)}){_nearly_straight(stage)}; use --links with mobility 21"
    ]


def _nearly_straight(stage: Stage) -> str:
    """Explain the error of a model by hinges that are nearly in line; "" where they are not."""
    bend = float(np.rad2deg(np.abs(np.arctan(np.tan(stage.chain.joint_angles[1])))))
    if bend >= STRAIGHT:
        return ""
    return f", because the hinges of each chain are nearly in line (elbow {bend:.3g} deg)"


@memoized
def _refined(
    stage: Stage,
    formula: str,
    mobility: int,
) -> tuple[Array, ...]:
    """Return the compliance diagonals (3,) of models above a mobility: axial freedoms, shear,
    elastic links.
    """
    with_freedoms = [
        np.diag(analyse(stage, higher, formula).compliance)
        for higher in (12, 21)
        if higher > mobility
    ]
    return (*with_freedoms, np.diag(analyse(stage, 21, formula, links=True).compliance))


def of_thickness(stage: Stage) -> Warnings:
    """Warn of a plane model whose stiffness differs from that with three-dimensional hinges."""
    changes = stiffer_by_thickness(stage)
    if changes is None or np.max(np.abs(changes)) < THICK:
        return []
    listed = ", ".join(
        f"{value:+.2g} % in {axis}" for axis, value in zip(DIRECTIONS, changes, strict=True)
    )
    return [
        f"{PLANES[stage.model]} neglects the thickness of the hinges, which changes the stiffness "
        f"by {listed} (thickness chart); `--solid` of `stiffness` and of `modes` includes it"
    ]


@memoized
def stiffer_by_thickness(stage: Stage) -> Array | None:
    """Return the change (3,) of the platform stiffness from the plane model to three-dimensional
    hinges, per cent.

    None if the thickness chart does not cover a hinge.
    """
    chosen = best_model(stage, [])
    try:
        plane, solid = (
            np.diag(analyse(*chosen._replace(stage=one)).stiffness)
            for one in (stage, corrected(stage))
        )
    except (BadInput, ComputationFailed):
        return None
    return np.asarray(100 * (solid / plane - 1))


def stress_above(
    formula: str, links: bool = True, plane: Plane = "plane_stress"
) -> tuple[float, float] | None:
    """Return least and largest excess of the neck stress over finite elements, per cent; None if
    not compared.
    """
    if plane == "corrected":
        return SOLID_ABOVE.get(formula) if links else None
    return (STRESS_ABOVE if links else RIGID_ABOVE).get(formula)


def stress_accuracy(
    formula: str,
    links: bool = True,
    plane: Plane = "plane_stress",
) -> str:
    """Describe the error of the analytic neck stress relative to finite elements."""
    excess = stress_above(formula, links, plane)
    solid = plane == "corrected"
    if excess is None and not links and formula not in RIGID_ABOVE:
        return (
            "with rigid links the stress is too high: with paros-weisbord by 14 to 34 % relative "
            "to finite elements; `summary` uses calibrated hinges and elastic links"
        )
    stress = f"stress by {formula} with {'elastic' if links else 'rigid'} links"
    if excess is None:
        dimensions = " in three dimensions" if solid else ""
        return f"{stress} has not been compared with finite elements{dimensions}"
    elements = "plane finite elements"
    below = ""
    if solid:
        elements = "finite elements in three dimensions without mesh error"
        below = SOLID_BELOW
    return (
        f"{stress} differs by {excess[0]:+g} to {excess[1]:+g} % from {elements} in the compared "
        f"cases; {below}the range at yield has the opposite error"
    )


def driven_accuracy(
    formula: str,
    links: bool,
    plane: Plane,
) -> str:
    """Describe the errors of analytic neck stress and yield limits of driven stages relative to
    finite elements.

    They are those of single highly stressed necks on random stages, rounded outwards
    (benchmarks/drive_stress.py)."""
    limits = f"the stress limits are {100 * (1 - YIELD_MARGIN[plane]):g} % of the yield strength"
    if not links:
        return (
            "with rigid links neck stress is 0.8 to 13 times that of plane finite elements with "
            f"the same strokes; {limits}, but are not safe; use calibrated hinges with elastic "
            "links"
        )
    if formula == "calibrated":
        reduction = ", in plane stress" if plane == "corrected" else ""
        return (
            "neck stress differs by -1 to +2 % from plane finite elements with the same strokes "
            f"in compared cases{reduction}; {limits}"
        )
    if formula == "paros-weisbord":
        return (
            "neck stress differs by -4 to +23 % from plane finite elements, also at single "
            f"necks; {limits}"
        )
    return (
        f"neck stress by {formula} has not been compared with finite elements of driven "
        f"stages; {limits}"
    )


def of_stacks(stage: Stage) -> Warnings:
    """Warn that the drift of a stage does not include its stacks."""
    if not stage.actuator:
        return []
    return ["the stacks, their preloads and their expansion are neglected"]


def held_faces(stage: Stage) -> Warnings:
    """Warn that the faces of a plane-strain stage are free in three dimensions."""
    if stage.model != "plane_strain":
        return []
    return [
        'model = "plane_strain" holds the faces of the stage; in three dimensions they are free'
    ]
