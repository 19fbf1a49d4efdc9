"""What claims are measured by: each measurement takes the two stages and says what it found, in numbers and words."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexfem.analytic.equilibrium import missed
from flexfem.analytic.kinematics import freedoms_of, mobility
from flexfem.analytic.model import analyse, assemble
from flexfem.analytic.stiffness import inverse_kinematics, stiffness
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.stage.schema import Stage
from flexfem.units import COMMANDS
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.errors import error_bands, error_matrix, levels
from flexfem.verify.protocol import Solve

MOTIONS, SEED, STRAY = 1000, 29, 0.1  # other joint motions; root of their energy over that of (29)


class ModelErrors(NamedTuple):
    """One of the two stages with the mobility the paper models it with.

    percent, band : (3, 3), per cent, error of finite elements under the force of (18) and its mesh band, column j for
        command j.   stiffness, compliance : (3, 3), of the model and of the finite elements.
    """

    stage: Stage
    mobility: int
    stiffness: Array
    compliance: Array
    percent: Array
    band: Array


class Evidence(NamedTuple):
    """All that claims are measured on; amplitude (3,) of the workspace in mm, mm, rad."""

    three: ModelErrors
    six: ModelErrors
    amplitude: Array


class Measured(NamedTuple):
    """Measured values, a sentence with them, and whether they depend on the stage's dimensions."""

    values: tuple[float, ...]
    found: str
    dimensional: bool = True


def errors_of_model(stage: Stage, mobility: int, solve: Solve) -> ModelErrors:
    """Model and finite elements of one stage, with the mesh band of their errors."""
    K, lever = analyse(stage, mobility).stiffness, stage.chain.link_lengths[2]
    found = np.array([solve(stage, level).response.compliance for level in levels(RESOLUTION)])
    return ModelErrors(stage, mobility, K, found[-1], *error_bands(K, found, levels(RESOLUTION), lever))


def _along(of: ModelErrors) -> Array:
    return np.asarray(np.diag(of.percent))


def _across(of: ModelErrors) -> Array:
    return np.asarray(np.abs(of.percent[~np.eye(3, dtype=bool)]))


def _listed(values: Array, form: str = ".3f") -> str:
    return ", ".join(f"{axis} {value:{form}}" for axis, value in zip(DIRECTIONS, values, strict=True))


def _mobility(_: Evidence) -> Measured:
    values = tuple(float(mobility(freedoms_of(model))) for model in (3, 6, 12))  # (1)
    return Measured(values, "(1) gives {:.0f}, {:.0f} and {:.0f}".format(*values), dimensional=False)


def _six_commanded(on: Evidence) -> Measured:
    said = f"errors of {_listed(_along(on.six))} %, mesh band at most {np.max(np.diag(on.six.band)):.3f} points"
    return Measured(tuple(np.abs(_along(on.six)).tolist()), said)


def _six_across(on: Evidence) -> Measured:
    return Measured(tuple(_across(on.six).tolist()), f"at most {np.max(_across(on.six)):.1g} % across")


def _three_everywhere(on: Evidence) -> Measured:
    why = ": a three-fold symmetric stage cannot err across under (18)" if on.three.stage.chains_alike else ""
    said = (
        f"errors of {_listed(_along(on.three))} % along, against {_listed(_along(on.six))} % with mobility six, and at"
        f" most {np.max(_across(on.three)):.1g} % across{why}"
    )
    return Measured(tuple(np.abs(on.three.percent).ravel().tolist()), said)


def _six_better(on: Evidence) -> Measured:
    less = np.abs(_along(on.three)) - np.abs(_along(on.six))
    return Measured(tuple(less.tolist()), f"mobility six errs less by {_listed(less)} points of mobility three's error")


def _axial_share(on: Evidence) -> Measured:
    stage, lever = on.six.stage, on.six.stage.chain.link_lengths[2]
    without = np.diag(error_matrix(analyse(stage, 3).stiffness, on.six.compliance, lever))
    shares = 100 * (without - _along(on.six)) / without
    freedoms = np.diag(error_matrix(on.three.stiffness, analyse(on.three.stage, 21).compliance, lever))
    said = (
        f"without the axial freedom the model of the mobility-six stage errs {_listed(without)} % instead of"
        f" {_listed(_along(on.six))} %, so it accounts for {_listed(shares)} % of the error; all freedoms that mobility"
        f" three leaves out are worth {_listed(freedoms)} of {_listed(_along(on.three))} points on its own stage"
    )
    return Measured(tuple(shares.tolist()), said)


def _diagonal(on: Evidence) -> Measured:
    largest = []
    for side in (on.three, on.six):
        size = np.sqrt(np.diag(side.stiffness))
        ratio = 100 * side.stiffness / np.outer(size, size)
        largest.append(float(np.max(np.abs(ratio - np.diag(np.diag(ratio))))))
        largest.append(float(100 * abs(side.stiffness[0, 0] / side.stiffness[1, 1] - 1)))
    said = (
        "off the diagonal {:.1g} % (mobility three) and {:.1g} % (six) at most, X and Y differ by {:.1g} % and {:.1g} %"
    )
    return Measured(tuple(largest), said.format(largest[0], largest[2], largest[1], largest[3]))


def _second_order(on: Evidence) -> Measured:
    of = assemble(on.six.stage, on.six.mobility)
    lever = on.six.stage.chain.link_lengths[2]
    moved, terms = (100 * value for value in missed(of, on.amplitude, lever))
    far = 100 * missed(of, 10 * on.amplitude, lever).position
    within = " and ".join(f"{COMMANDS[k].factor * on.amplitude[k]:g} {COMMANDS[k].plain}" for k in (0, 2))
    said = (
        f"exact and linear position differ by up to {moved:.3f} % within {within}, the two terms"
        f" change the tangent compliance by up to {terms:.3f} %; at ten times these commands the positions differ by up"
        f" to {far:.2f} %"
    )
    return Measured((moved,), said)


def _minimum_energy(on: Evidence) -> Measured:
    of = assemble(on.six.stage, on.six.mobility)
    at, random = stiffness(of), np.random.default_rng(SEED)
    best = inverse_kinematics(of, at, on.amplitude).independent  # (29)
    internal = np.linalg.svd(at.influence.G_u)[2][3:]  # joint motions that leave the platform where it is
    assert np.max(np.abs(internal @ at.influence.G_u.T)) < 1e-9 * np.max(np.abs(at.influence.G_u))  # rounding
    stray = random.normal(size=(MOTIONS, len(internal))) @ internal
    least = best @ at.K_aa @ best
    stray *= STRAY * np.sqrt(least / np.einsum("ka,ab,kb->k", stray, at.K_aa, stray))[:, None]
    energy = np.einsum("ka,ab,kb->k", best + stray, at.K_aa, best + stray)
    more = 100 * (energy / least - 1)
    said = (
        f"{MOTIONS} random other joint motions to one pose, each with {STRAY**2:.0%} of the energy in what differs,"
        f" store at least {np.min(more):.3f} % more than (29)"
    )
    return Measured((float(np.min(more)),), said)


def _measured_stiffness(on: Evidence) -> Measured:
    softer = 100 * (1 - 1 / np.diag(on.six.compliance @ on.six.stiffness))
    said = (
        f"in the same comparison the finite elements are more compliant than the model by {_listed(softer, '.1f')} %,"
        f" {np.mean(softer):.1f} % on average; the text also finds the real stage more compliant"
    )
    return Measured(tuple(softer.tolist()), said)


MEASURES: dict[str, Callable[[Evidence], Measured]] = {
    "mobility": _mobility,
    "six-commanded": _six_commanded,
    "six-across": _six_across,
    "three-everywhere": _three_everywhere,
    "six-better": _six_better,
    "axial-share": _axial_share,
    "diagonal": _diagonal,
    "second-order": _second_order,
    "minimum-energy": _minimum_energy,
    "measured-stiffness": _measured_stiffness,
}
