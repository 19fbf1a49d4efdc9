"""Other models of a stage, and the same model of a stage that is made, loaded, read or driven otherwise."""

from __future__ import annotations

import numpy as np

from flexfem import units
from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.large import at_pose
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, analyse, assemble, at_rest, hinge_compliances
from flexfem.analytic.paper import AXIAL, dot, freedoms_of, split, stiffness
from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import RESOLUTION
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.designs import lower
from flexfem.mechanism.stage import HINGE_NAMES, Hinge, Stage
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.units import LENGTH, MICROMETRE
from flexfem.verify.case import Drive
from flexfem.verify.imposed import elements, imposed
from flexfem.verify.protocol import Solve

SCATTER, DRAWS, SEED = 0.005, 200, 2003  # mm, standard deviation of the necks; stages; seed
QUANTILES = {"median": 0.5, "95 %": 0.95}
CUT = 0.010  # mm, how much thicker or thinner than drawn wire cutting may leave all necks: assumed
OFFSET = 0.5  # mm, of a pole in X and in Y from the platform's centre: assumed
PRESSED = (10.0, 30.0)  # N, along every base neck: assumed
AMPLITUDES = np.array([0.05, 0.05, 1e-3])  # mm, mm, rad, at which the second-order terms are taken


def other_formulas(stage: Stage, mobility: int, compliance: Array) -> dict[str, Array]:
    """Error percentages (3, 3) of the model with every other registered hinge formula that answers for the stage."""
    found = {}
    for name in FORMULAS:
        if name != DEFAULT_FORMULA:
            try:
                K = analyse(stage, mobility, name).stiffness
            except BadInput:  # off its chart, or not positive here
                continue
            found[f"hinge formula {name}"] = error_matrix(K, compliance, _lever(stage))
    return found


def other_necks(stage: Stage, mobility: int, solve: Solve) -> dict[str, Array]:
    """Error percentages (3, 3) where all necks of the metal are thicker or thinner than drawn, or scattered."""
    K, found = analyse(stage, mobility).stiffness, {}
    for change, what in ((CUT, "thicker"), (-CUT, "thinner")):
        try:
            metal = solve(necks_changed(stage, change), RESOLUTION).response.compliance
        except BadInput:  # no such stage
            continue
        name = f"necks of the metal {MICROMETRE.factor * CUT:g} {MICROMETRE.plain} {what} than drawn"
        found[name] = error_matrix(K, metal, _lever(stage))
    percent = np.abs(scatter(stage, mobility))
    deviation = f"{MICROMETRE.factor * SCATTER:g} {MICROMETRE.plain}"
    for name, share in QUANTILES.items():
        found[f"necks scattered by {deviation}, {name} of {DRAWS} stages"] = np.quantile(percent, share, axis=0)
    return found


def off_centre(stage: Stage, mobility: int, compliance: Array) -> dict[str, Array]:
    """Error percentages (3, 3) with the load applied, the pose read, or both, beside the platform's centre."""
    at = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-OFFSET, OFFSET, 1.0]])  # wrench at the centre of one beside it
    K, where = analyse(stage, mobility).stiffness, f"{OFFSET:g} {units.LENGTH.plain} off the centre in X and in Y"
    metal = {
        f"load applied {where}": compliance @ at,
        f"pose read {where}": at.T @ compliance,
        f"load applied and pose read {where}": at.T @ compliance @ at,
    }
    return {name: error_matrix(K, C, _lever(stage)) for name, C in metal.items()}


def loaded(stage: Stage, mobility: int, compliance: Array) -> dict[str, Array]:
    """Error percentages (3, 3) by both readings of the terms of (16): of the command's own load, of a preload.

    With the first the model knows them, with the second the metal has them and the model does not.
    """
    K, lever = analyse(stage, mobility).stiffness, _lever(stage)
    exact = at_pose(assemble(stage, mobility), np.diag(AMPLITUDES)).load.T / AMPLITUDES
    said = " and ".join(f"{units.COMMANDS[k].factor * AMPLITUDES[k]:g} {units.COMMANDS[k].plain}" for k in (0, 2))
    found = {f"force of the exact equilibrium at {said}": error_matrix(exact, compliance, lever)}
    for force in PRESSED:
        metal = inverse(inverse(compliance) + preload_stiffness(stage, force))
        found[f"base necks pressed with {force:g} {units.FORCES[0].plain}, which the model leaves out"] = error_matrix(
            K, metal, lever
        )
    return found


def preload_stiffness(stage: Stage, force: float) -> Array:
    """What an axial force in all base necks, N, compression positive, adds to the platform's stiffness (3, 3).

    Notes
    -----
    The term `- tau_p o H_p` of (16) at rest with the paper's six freedoms, the force held by what presses the necks.
    """
    of = assemble(stage, 6)
    at, base = stiffness(of), (of.joints.kind == AXIAL) & (of.joints.hinge == 0)
    _, tau_p = split(np.where(base, force, 0.0), of.choice)
    G_u = at.influence.G_u
    K = inverse(G_u @ inverse(at.K_aa - dot(tau_p, at.influence.H_p)) @ G_u.T)
    return np.asarray(K - at.K_uu)


def driven_joints(stage: Stage, mobility: int) -> dict[str, Array]:
    """Error percentages (3, 3) of finite elements whose joints, or stacks where it has some, are commanded."""
    drives: dict[str, Drive] = {"joints commanded instead of the platform": "joints"}
    if stage.actuator:
        drives["strokes commanded instead of the platform"] = "strokes"
    return {name: joints_on_metal(stage, mobility, drive) for name, drive in drives.items()}


def joints_on_metal(stage: Stage, mobility: int, drive: Drive) -> Array:
    """Error percentages (3, 3) of finite elements given the rotations or strokes of a model, see `imposed`."""
    given = imposed(stage, analyse(stage, mobility), drive)
    metal = elements(stage, RESOLUTION, drive, mobility).response.compliance
    return error_matrix(np.eye(3), given.poses(metal), _lever(stage))


def necks_changed(stage: Stage, change: float) -> Stage:
    """The stage with all its necks thicker by `change`, mm. Raises BadInput when no neck is left."""
    if np.min(stage.array("neck")) + change <= 0:
        thinnest = np.min(stage.array("neck"))
        raise BadInput(f"a neck of {thinnest:g} {LENGTH.plain}, expected more than {-change:g} {LENGTH.plain}")
    hinges: dict[str, Hinge] = {name: getattr(stage.hinges, name) for name in HINGE_NAMES}
    drawn = {name: hinge.model_copy(update={"neck": hinge.neck + change}) for name, hinge in hinges.items()}
    others = tuple(
        each if each.neck is None else each.model_copy(update={"neck": each.neck + change}) for each in stage.override
    )
    return stage.model_copy(update={"hinges": stage.hinges.model_copy(update=drawn), "override": others})


def _lever(stage: Stage) -> float:
    return stage.chain.link_lengths[2]


def with_necks(stage: Stage, ratio: float) -> Stage:
    """The stage with the necks thickened or thinned to R/t = ratio in every hinge; overrides are dropped.

    Links are widened where a notch needs it; the rigid-link models here do not know their width.
    """
    hinges: dict[str, Hinge] = {name: getattr(stage.hinges, name) for name in HINGE_NAMES}
    changed = {name: hinge.model_copy(update={"neck": hinge.radius / ratio}) for name, hinge in hinges.items()}
    widest = max(2 * hinge.radius + hinge.neck for hinge in changed.values())
    chain = stage.chain.model_copy(update={"link_width": max(stage.chain.link_width, widest)})
    return stage.model_copy(update={"chain": chain, "hinges": stage.hinges.model_copy(update=changed), "override": ()})


def scatter(stage: Stage, mobility: int, deviation: float = SCATTER, draws: int = DRAWS, seed: int = SEED) -> Array:
    """Error percentages (draws, 3, 3) of stages whose nine necks are normally scattered, mm, about the drawn ones.

    The metal is the calibrated hinges with elastic pads, links and platform; the model knows the drawn dimensions.
    """
    lever, noise = stage.chain.link_lengths[2], np.random.default_rng(seed).normal(size=(draws, 3, 3))
    designs = lower(stage).repeated(draws)
    designs.neck[:] += deviation * noise
    hinges = hinge_compliances(designs, CALIBRATED)
    real = inverse(at_rest(designs, hinges, freedoms_of(21), body_compliance(stage)).stiffness)
    K = analyse(stage, mobility).stiffness
    return np.array([error_matrix(K, each, lever) for each in real])


def joint_command(stage: Stage, mobility: int, real: str = CALIBRATED) -> Array:
    """Error percentages (3, 3) when the independent rotations of (30) are imposed on a stage with all 21 freedoms.

    Notes
    -----
    The model turns the command into rotations of base (mobility three) or base and elbow hinges (six) by (29); the
    stage takes the pose of least energy with these rotations R phi_a given:
    `phi_a = K_aa^-1 R^T (R K_aa^-1 R^T)^-1 phi_given`, links rigid, hinges by the formula `real`.
    Finite elements are given them by `joints_on_metal`.
    """
    of, metal = assemble(stage, mobility), assemble(stage, 21, real)
    known, at = stiffness(of), stiffness(metal)
    given = known.C_aa @ known.influence.G_u.T @ known.K_uu  # (29), (30)
    R = at.influence.G_a[np.searchsorted(metal.joints.slot, of.joints.slot[of.choice.independent])]
    phi = at.C_aa @ R.T @ np.linalg.solve(R @ at.C_aa @ R.T, given)
    return error_matrix(np.eye(3), at.influence.G_u @ phi, stage.chain.link_lengths[2])
