"""Where an answer leaves what it is meant for: every function returns the plain sentences that are earned, or none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexfem.analytic.model import AnalyticResult, analyse, best_model, corrected, in_range
from flexfem.arrays import Array
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.designs import envelope, lower
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import Plane
from flexfem.refused import BadInput, ComputationFailed
from flexfem.units import DIRECTIONS, LENGTH, PLANES, STRESS

Warnings = list[str]

# per cent by which the highest neck stress per displacement is above that of plane finite elements, with elastic links:
# smallest and largest of the reference stages and of random ones (benchmarks/stress.py), rounded outwards. The
# concentration at the neck is good to 1 %; the rest is the stiffness of the hinges.
STRESS_ABOVE = {
    **dict.fromkeys(("paros-weisbord", "wu-zhou", "lobontiu", "quadrature"), (10.0, 22.0)),  # the same beam integrals
    "paros-weisbord-short": (8.0, 10.0),
    "smith-chetwynd": (3.0, 5.0),
    "koster": (-1.0, 6.0),
    "schotborgh": (1.0, 3.0),
    "calibrated": (-1.0, 1.0),
}
RIGID_ABOVE = {"calibrated": (1.0, 9.0)}  # the same with rigid links
# the same of `model = "corrected"` and finite elements of whole stages in three dimensions (benchmarks/solid_stress.py)
SOLID_ABOVE = {
    **dict.fromkeys(("paros-weisbord", "wu-zhou", "lobontiu", "quadrature"), (5.0, 23.0)),
    "smith-chetwynd": (-1.0, 6.0),
    "koster": (-4.0, 6.0),
    "calibrated": (-2.0, 2.0),
}
SOLID_BELOW = "those of resolution 6 and 3 layers are up to 2 % low; "  # 1.6 at b/t = 20
# share of the yield strength by which limits of driven stages stay below it: what the model's neck stress may be low
YIELD_MARGIN: dict[Plane, float] = {"plane_stress": 0.01, "plane_strain": 0.01, "corrected": 0.02}
STRESS_BELOW = 1.0  # per cent at resolution 4, falling with its square: 0.6 to 1.02 on both and three random stages
YIELD_STRAIN = (1e-5, 0.2)  # of all solids that hinges are made of, soft metals to rubbers
DENSITIES = (10.0, 23_000.0)  # kg/m^3, foam to osmium
ACROSS = (1.0, 5000.0)  # mm: the smallest stages that are cut from sheet; longer than plates come
SLENDER = 100.0  # times as wide as thick: such a link is foil, and more likely a thickness in another unit

LEFT_OUT = 5.0  # per cent of the model's own compliance; the paper sets out to explain errors of 5 to 10 per cent
STRAIGHT = 15.0  # deg between the lines of a chain's hinges; only explains what was left out, decides nothing
THICK = 1.0  # per cent of the stiffness: a tenth of what a thick hinge differs by
FAR = 0.1  # of the shortest link, and rad: there the linear answer is off by some per cent


def of_stage(stage: Stage) -> Warnings:
    """Warnings on a stage's own analytic model by the default formula, also that it has no answer at all."""
    try:
        return of_result(stage, analyse(stage))
    except (BadInput, ComputationFailed) as error:
        reason = error.reason if isinstance(error, BadInput) else error
        return [*of_numbers(stage), f"the analytic model has no answer: {reason}"]


def of_result(stage: Stage, model: AnalyticResult) -> Warnings:
    """Warnings on a stage's numbers and on one analytic model of it."""
    return [*of_numbers(stage), *of_formula(stage, model.formula), *of_model(stage, model)]


def of_yield(stress: float, yield_strength: float, where: str) -> Warnings:
    """A highest neck stress beyond the yield strength, MPa; `where` says under which load or command."""
    said = (
        f"{where}: the highest neck stress is {stress:.4g} {STRESS}, beyond the yield strength of {yield_strength:.4g} "
        f"{STRESS}; the answer is elastic and does not hold there"
    )
    return [said] if stress > yield_strength else []


def of_motion(stage: Stage, pose: Array, where: str) -> Warnings:
    """A platform displacement (3,), mm, mm, rad, that the linear answer is not meant for."""
    shortest = min(stage.chain.link_lengths)
    moved, turned = float(np.max(np.abs(pose[:2]))), float(np.abs(pose[2]))
    said = (
        f"{where}: the platform moves {moved:.3g} {LENGTH} and turns {turned:.3g} rad, more than {FAR:g} of the "
        f"shortest link ({shortest:g} {LENGTH}) or {FAR:g} rad; the answer is linear and does not hold there"
    )
    return [said] if moved > FAR * shortest or turned > FAR else []


def of_formula(stage: Stage, formula: str) -> Warnings:
    """A hinge formula outside its range at some hinge."""
    design = lower(stage)
    outside = ~in_range(design, formula)[0]
    if not np.any(outside):
        return []
    ratio, (low, high) = (design.neck / design.radius)[0, outside], FORMULAS[formula].valid
    used = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (ratio.min(), ratio.max())))
    return [
        f"hinge formula {formula} is meant for t/R from {low:g} to {high:g}, and is used at {used} ({_places(outside)})"
    ]


def of_model(stage: Stage, model: AnalyticResult) -> Warnings:
    """Freedoms of hinges, and elastic links, that a model leaves out though they matter on this stage.

    Compared are compliances by one hinge formula: the model's, with axial freedoms, with shear too, with elastic links.
    """
    ladder = np.array([np.diag(model.compliance), *_with_more(stage, model.formula, model.mobility)])
    gained = 100.0 * (ladder[-1] / ladder[0] - 1.0)
    if not np.any(gained > LEFT_OUT):
        return []
    worst = int(np.argmax(gained))
    names = ("axial freedoms", "shear freedoms", "elastic links")[4 - len(ladder) :]
    shares = 100.0 * np.diff(ladder[:, worst]) / ladder[0, worst]
    parts = ", ".join(f"{name} {share:.3g} %" for name, share in zip(names, shares, strict=True) if share > 0.1)
    bend = float(np.rad2deg(np.abs(np.arctan(np.tan(stage.chain.joint_angles[1])))))
    straight = (
        f", because the hinges of each chain are nearly in line (elbow {bend:.3g} deg)" if bend < STRAIGHT else ""
    )
    return [
        f"the analytic model of mobility {model.mobility} is not meant for this stage: what it leaves out makes it "
        f"{gained[worst]:.3g} % softer in {DIRECTIONS[worst]} ({parts}){straight}; --links with mobility 21 has it all"
    ]


def of_thickness(stage: Stage) -> Warnings:
    """A plane model whose hinges are far from those of three dimensions."""
    more = stiffer_by_thickness(stage)
    if more is None or np.max(np.abs(more)) < THICK:
        return []
    said = ", ".join(f"{value:+.2g} % in {axis}" for axis, value in zip(DIRECTIONS, more, strict=True))
    return [
        f"{PLANES[stage.model]} leaves out the thickness of the hinges, which changes the stiffness by {said} "
        "(thickness chart); `--layers 3` of `stiffness` and of `modes` includes it"
    ]


@once
def stiffer_by_thickness(stage: Stage) -> Array | None:
    """By how much, per cent, the thickness of the hinges makes the platform stiffer than in the stage's plane (3,).

    None where the thickness chart does not reach a hinge. Positive where three dimensions are stiffer.
    """
    chosen = best_model(stage, [])
    try:
        found = [np.diag(analyse(*chosen._replace(stage=one)).stiffness) for one in (stage, corrected(stage))]
    except (BadInput, ComputationFailed):
        return None
    return np.asarray(100 * (found[1] / found[0] - 1))


def of_numbers(stage: Stage) -> Warnings:
    """Numbers of a stage file that are possible, but more likely in another unit."""
    metal, chain, across = stage.material, stage.chain, float(envelope(lower(stage))[0])
    strain, turn = metal.yield_strength / metal.youngs_modulus, max(map(abs, chain.joint_angles))
    plausible = {
        f"material.yield_strength_mpa = {metal.yield_strength:g} is {strain:.2g} of Young's modulus": (
            YIELD_STRAIN[0] <= strain <= YIELD_STRAIN[1]
        ),
        f"material.density_kg_m3 = {metal.density:g} is that of no solid": (
            DENSITIES[0] <= metal.density <= DENSITIES[1]
        ),
        f"thickness_mm = {stage.thickness:g} is below a hundredth of the links' width, {chain.link_width:g} {LENGTH}": (
            chain.link_width <= SLENDER * stage.thickness
        ),
        f"the stage is {across:.3g} {LENGTH} across": ACROSS[0] <= across <= ACROSS[1],
        "chain.joint_angles_deg are all within two pi": turn > np.deg2rad(2 * np.pi),
    }
    return [f"{said}: is the unit right?" for said, is_plausible in plausible.items() if not is_plausible]


def stress_above(formula: str, links: bool = True, plane: Plane = "plane_stress") -> tuple[float, float] | None:
    """Per cent by which the highest neck stress is above finite elements, least and most; None where not compared."""
    if plane == "corrected":
        return SOLID_ABOVE.get(formula) if links else None
    return (STRESS_ABOVE if links else RIGID_ABOVE).get(formula)


def stress_accuracy(formula: str, links: bool = True, plane: Plane = "plane_stress") -> str:
    """How far the analytic neck stress is from finite elements, in words."""
    found, solid = stress_above(formula, links, plane), plane == "corrected"
    if found is None and not links and formula not in RIGID_ABOVE:
        return (
            "with rigid links the stress is too high, by 14 to 34 % with paros-weisbord where it was compared with "
            "finite elements; `summary` takes calibrated hinges and elastic links"
        )
    how = f"stress by {formula} with {'elastic' if links else 'rigid'} links"
    if found is None:
        return f"{how} has not been compared with finite elements{' in three dimensions' if solid else ''}"
    elements = "finite elements in three dimensions without mesh error" if solid else "plane finite elements"
    return (
        f"{how} is {found[0]:+g} to {found[1]:+g} % off that of {elements}, where it was compared; "
        f"{SOLID_BELOW if solid else ''}the safe range is as much the other way"
    )


def driven_accuracy(formula: str, links: bool, plane: Plane) -> str:
    """How far the analytic neck stress of a driven stage, and its limits of yield, are from finite elements, in words.

    Single necks of high stress on random driven stages, rounded outwards (benchmarks/drive_stress.py).
    """
    at = f"limits of yield are set at {100 * (1 - YIELD_MARGIN[plane]):g} % of the yield strength"
    if formula == "calibrated" and links:
        said = "neck stress is -1 to +2 % off that of plane finite elements by the same strokes, where compared"
        return f"{said}; {at}" if plane != "corrected" else f"{said}, in plane stress; {at}"
    if links and formula == "paros-weisbord":
        return f"neck stress is -4 to +23 % off that of plane finite elements, single necks included; {at}"
    if links:
        return f"neck stress by {formula} has not been compared with finite elements of driven stages; {at}"
    return (
        "with rigid links neck stress is 0.8 to 13 times that of plane finite elements with the same strokes; "
        f"{at}, which does not make them safe; calibrated hinges with elastic links do"
    )


def stress_below(resolution: int) -> str:
    """By how many per cent, at most, the highest neck stress of finite elements of a resolution is low."""
    return f"up to {STRESS_BELOW * (4 / resolution) ** 2:.2g} % low"


def of_stacks(stage: Stage) -> Warnings:
    """Of a stage with stacks, that they are not in its drift."""
    return ["the stacks, their preloads and their own expansion are left out"] if stage.actuator else []


def held_faces(stage: Stage) -> Warnings:
    """That a stage whose model holds its faces has them free here."""
    said = 'model = "plane_strain" holds the faces of the stage; in three dimensions they are free'
    return [said] if stage.model == "plane_strain" else []


@once
def _with_more(stage: Stage, formula: str, mobility: int) -> tuple[Array, ...]:
    """Diagonals (3,) of the compliance with axial freedoms, with shear, with elastic links, of those that are more."""
    found = [np.diag(analyse(stage, more, formula).compliance) for more in (12, 21) if more > mobility]
    return (*found, np.diag(analyse(stage, 21, formula, links=True).compliance))


def _places(where: NDArray[np.bool_]) -> str:
    """Hinges (3 chains, 3 hinges) in words: by name when it is so in all chains."""
    names = [f"{name} hinges" for name, column in zip(HINGE_NAMES, where.T, strict=True) if np.all(column)]
    places = np.argwhere(where & ~np.all(where, axis=0))
    return ", ".join([*names, *(f"{HINGE_NAMES[k]} hinge of chain {chain + 1}" for chain, k in places)])
