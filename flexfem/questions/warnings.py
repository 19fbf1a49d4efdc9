"""Warnings about results outside the range of validity of a model; each function returns sentences,
or none.
"""

from __future__ import annotations

import numpy as np

from flexfem.arrays import Array
from flexfem.files.refusals import key_path
from flexfem.files.tables import once
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.materials import Material
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import plate_mass, size_of
from flexfem.mechanism.plate_checks import triangles_needed
from flexfem.paper.designs import envelope, lower
from flexfem.paper.model import AnalyticResult, analyse, best_model, corrected, in_range
from flexfem.paper.stage import HINGE_NAMES, Stage
from flexfem.paper.stage_file import Plane
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import DIRECTIONS, LENGTH, PLANES, STRESS, short

Warnings = list[str]

# per cent by which the highest neck stress per displacement exceeds that of plane finite elements,
# with elastic links:
# smallest and largest of the reference stages and of random ones (benchmarks/stress.py), rounded
# outwards. The stress
# concentration is accurate to 1 %; the rest is due to the stiffness of the hinges.
STRESS_ABOVE = {
    **dict.fromkeys(
        ("paros-weisbord", "wu-zhou", "lobontiu", "quadrature"), (10.0, 22.0)
    ),  # identical beam integrals
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
    **dict.fromkeys(("paros-weisbord", "wu-zhou", "lobontiu", "quadrature"), (5.0, 23.0)),
    "smith-chetwynd": (-1.0, 6.0),
    "koster": (-4.0, 6.0),
    "calibrated": (-2.0, 2.0),
}
SOLID_BELOW = "finite elements of resolution 6 with 3 layers are up to 2 % low; "  # 1.6 at b/t = 20
# margin of the limits of driven stages, as a share of the yield strength: the model may
# underestimate the neck stress
YIELD_MARGIN: dict[Plane, float] = {"plane_stress": 0.01, "plane_strain": 0.01, "corrected": 0.02}
# per cent at resolution 4, falling with its square: 0.6 to 1.02 on reference and random stages
STRESS_BELOW = 1.0
YIELD_STRAIN = (1e-5, 0.2)  # of hinge materials, from soft metals to rubbers
DENSITIES = (10.0, 23_000.0)  # kg/m^3, foam to osmium
# mm: from the smallest mechanisms cut from sheet to more than the length of plates
ACROSS = (1.0, 5000.0)
# size of a plate / thickness / neck: a larger ratio is more likely a number in another unit
SLENDER = 1000.0
# masses of the plate; with a payload in kg for g the ratio is a thousand times too large
HEAVY = 100.0
RIGHT_UNIT = "is the unit right?"
MANY_TRIANGLES = 200_000  # with 8 across the necks; three meshes take more than a minute
# per cent of the model's own compliance; the paper aims to explain errors of 5 to 10 per cent
LEFT_OUT = 5.0
STRAIGHT = 15.0  # deg between the lines of a chain's hinges; only selects an explanation
THICK = 1.0  # per cent of the stiffness: a tenth of the effect of a thick hinge
FAR = 0.1  # of the shortest link, and rad: here the linear solution has errors of some per cent


def _when(holds: object, text: str) -> Warnings:
    return [text] if holds else []


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


def of_yield(stress: float, yield_strength: float, where: str) -> Warnings:
    """Warn of a highest stress above the yield strength, MPa; `where` names the load or command."""
    if stress <= yield_strength:
        return []
    return [
        f"{where}: the highest stress is {stress:.4g} {STRESS}, beyond the yield strength of "
        f"{yield_strength:.4g} {STRESS}; the elastic result is not valid there"
    ]


def of_motion(stage: Stage, pose: Array, where: str) -> Warnings:
    """Warn of a platform displacement (3,), mm, mm, rad, outside the range of the linear solution."""
    shortest = min(stage.chain.link_lengths)
    translation = float(np.max(np.abs(pose[:2])))
    rotation = float(np.abs(pose[2]))
    return _when(
        translation > FAR * shortest or rotation > FAR,
        f"{where}: the platform moves {translation:.3g} {LENGTH} and turns {rotation:.3g} rad, "
        f"more than {FAR:g} of the shortest link ({shortest:g} {LENGTH}) or {FAR:g} rad; the "
        "linear result is not valid there",
    )


def of_formula(stage: Stage, formula: str) -> Warnings:
    """Warn of hinges outside the range of a hinge formula; those outside in all chains are named
    once.
    """
    design = lower(stage)
    outside = ~in_range(design, formula)[0]
    if not np.any(outside):
        return []
    ratio = (design.neck / design.radius)[0, outside]
    low, high = FORMULAS[formula].valid
    alike = outside.all(axis=0)
    used = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (ratio.min(), ratio.max())))
    hinges = [f"{name} hinges" for name, each in zip(HINGE_NAMES, alike, strict=True) if each]
    hinges += [
        f"{HINGE_NAMES[k]} hinge of chain {chain + 1}" for chain, k in np.argwhere(outside & ~alike)
    ]
    valid = f"hinge formula {formula} is valid for t/R from {low:g} to {high:g}"
    return [f"{valid}, and is used at {used} ({', '.join(hinges)})"]


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
    parts = ", ".join(
        f"{name} {share:.3g} %" for name, share in zip(names, shares, strict=True) if share > 0.1
    )
    bend = float(np.rad2deg(np.abs(np.arctan(np.tan(stage.chain.joint_angles[1])))))
    straight = (
        f", because the hinges of each chain are nearly in line (elbow {bend:.3g} deg)"
        if bend < STRAIGHT
        else ""
    )
    return [
        f"the analytic model of mobility {model.mobility} is not accurate for this stage: the "
        f"neglected compliances make it {gained[worst]:.3g} % softer in {DIRECTIONS[worst]} "
        f"({parts}){straight}; use --links with mobility 21"
    ]


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


@once
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


def implausible(
    kind: str, material: Material, thickness: float, across: float, neck: float
) -> Warnings:
    """Warn of the material and the size of a plate that are possible, but probably in another unit.

    kind : what the plate is called.   thickness, across, neck : of the plate, its largest extent
    and its smallest neck, mm."""
    strength = material.yield_strength
    strain = strength / material.youngs_modulus
    flat = f"thickness_mm = {thickness:g} is below a thousandth of"
    plausible = {
        f"material.yield_strength_mpa = {strength:g} is {strain:.2g} of Young's modulus": (
            strain,
            YIELD_STRAIN,
        ),
        f"material.density_kg_m3 = {material.density:g} is not that of a solid": (
            material.density,
            DENSITIES,
        ),
        f"the {kind} is {short(across, '.3g')} {LENGTH} across": (across, ACROSS),
        f"{flat} the {kind}, {across:.3g} {LENGTH} across": (across / thickness, (0.0, SLENDER)),
        f"neck_mm = {neck:g} is below a thousandth of the thickness, {thickness:g} {LENGTH}": (
            thickness / neck,
            (0.0, SLENDER),
        ),
    }
    return [
        f"{text}: {RIGHT_UNIT}"
        for text, (value, (low, high)) in plausible.items()
        if not low <= value <= high
    ]


def of_numbers(plate: Mechanism) -> Warnings:
    """Warn of numbers of a file that are possible, but probably in another unit."""
    if isinstance(plate, Stage):
        return _of_stage_numbers(plate)
    layout = plate.layout
    neck = min((joint.profile.neck for joint in layout.joints), default=np.inf)
    kind = plate.kind.removesuffix(" file")
    doubts = implausible(kind, plate.material, plate.thickness, size_of(layout), neck)
    needed = triangles_needed(layout)
    if needed > MANY_TRIANGLES:
        doubts.append(
            f"finite elements need about {needed:.2g} triangles with 8 across the necks, which "
            "take minutes"
        )
    return doubts + of_payload(plate, sum(load.mass for load in layout.payloads))


def _of_stage_numbers(stage: Stage) -> Warnings:
    design = lower(stage)
    across = float(envelope(design)[0])
    neck = float(np.min(design.neck))
    doubts = implausible("stage", stage.material, stage.thickness, across, neck)
    if max(map(abs, stage.chain.joint_angles)) <= np.deg2rad(2 * np.pi):
        doubts.append(f"chain.joint_angles_deg are all within two pi: {RIGHT_UNIT}")
    return doubts


def of_payload(mechanism: Mechanism, mass: float) -> Warnings:
    """Warn of a payload, tonne, that is far heavier than its plate."""
    if mass == 0.0:
        return []
    own = plate_mass(mechanism.layout)
    ratio = mass / own
    if ratio <= HEAVY:
        return []
    return [
        f"the payload of {1e3 * mass:.4g} kg is {ratio:.3g} times as heavy as the plate of "
        f"{1e3 * own:.3g} kg: {RIGHT_UNIT}"
    ]


def of_parameters(mechanism: Mechanism) -> Warnings:
    """Warn of parameters on which nothing depends; a name may be misspelt, or kept for later."""
    unused = mechanism.unused_parameters
    return [
        f"{key_path(('parameters', key))}: no number depends on this parameter" for key in unused
    ]


def stress_above(
    formula: str, links: bool = True, plane: Plane = "plane_stress"
) -> tuple[float, float] | None:
    """Return least and largest excess of the neck stress over finite elements, per cent; None if
    not compared.
    """
    if plane == "corrected":
        return SOLID_ABOVE.get(formula) if links else None
    return (STRESS_ABOVE if links else RIGID_ABOVE).get(formula)


def stress_accuracy(formula: str, links: bool = True, plane: Plane = "plane_stress") -> str:
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
        return (
            f"{stress} has not been compared with finite "
            f"elements{' in three dimensions' if solid else ''}"
        )
    elements = (
        "finite elements in three dimensions without mesh error"
        if solid
        else "plane finite elements"
    )
    return (
        f"{stress} differs by {excess[0]:+g} to {excess[1]:+g} % from {elements} in the compared "
        f"cases; {SOLID_BELOW if solid else ''}the range at yield has the opposite error"
    )


def driven_accuracy(formula: str, links: bool, plane: Plane) -> str:
    """Describe the errors of analytic neck stress and yield limits of driven stages relative to
    finite elements.

    They are those of single highly stressed necks on random stages, rounded outwards
    (benchmarks/drive_stress.py)."""
    limits = f"the stress limits are {100 * (1 - YIELD_MARGIN[plane]):g} % of the yield strength"
    if formula == "calibrated" and links:
        error = (
            "neck stress differs by -1 to +2 % from plane finite elements with the same strokes "
            "in compared cases"
        )
        return (
            f"{error}; {limits}" if plane != "corrected" else f"{error}, in plane stress; {limits}"
        )
    if links and formula == "paros-weisbord":
        return (
            "neck stress differs by -4 to +23 % from plane finite elements, also at single "
            f"necks; {limits}"
        )
    if links:
        return (
            f"neck stress by {formula} has not been compared with finite elements of driven "
            f"stages; {limits}"
        )
    return (
        "with rigid links neck stress is 0.8 to 13 times that of plane finite elements with the "
        f"same strokes; {limits}, but are not safe; use calibrated hinges with elastic links"
    )


def stress_below(resolution: int) -> str:
    """Describe the largest error of the highest neck stress by finite elements of a resolution."""
    return f"up to {STRESS_BELOW * (4 / resolution) ** 2:.2g} % low"


def of_stacks(stage: Stage) -> Warnings:
    """Warn that the drift of a stage does not include its stacks."""
    return _when(stage.actuator, "the stacks, their preloads and their expansion are neglected")


def held_faces(stage: Stage) -> Warnings:
    """Warn that the faces of a plane-strain stage are free in three dimensions."""
    text = 'model = "plane_strain" holds the faces of the stage; in three dimensions they are free'
    return _when(stage.model == "plane_strain", text)


@once
def _refined(stage: Stage, formula: str, mobility: int) -> tuple[Array, ...]:
    """Return the compliance diagonals (3,) of models above a mobility: axial freedoms, shear,
    elastic links.
    """
    with_freedoms = [
        np.diag(analyse(stage, higher, formula).compliance)
        for higher in (12, 21)
        if higher > mobility
    ]
    return (*with_freedoms, np.diag(analyse(stage, 21, formula, links=True).compliance))
