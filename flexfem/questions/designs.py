"""Many designs of a mechanism at once: numbers of questions by the analytic network.

Each number is that of its question about every design, to round-off where hinges are plane: of
`stiffness` without limits, of `drive`, and natural frequencies of `modes`. In three dimensions the
ratios of the compliance of hinges to that in plane stress are given, since each takes milliseconds
(`hinges.wide`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TypeAlias

import numpy as np

from flexfem.analytic.design_modes import frequencies
from flexfem.analytic.designs import DesignNetwork, RatiosOf
from flexfem.arrays import Array, inverse
from flexfem.mechanism.layout import ActuatorSet
from flexfem.mechanism.layouts import Layouts
from flexfem.questions.drive import AtStrokes, values_at_strokes
from flexfem.questions.driven import DriveSystem

OF_STRESS = ("stress", "yield_range", "free_yield_range", "yield_force")
AT_REST = (
    "compliance",
    "stiffness",
    "held",
    "free",
    "input_stiffness",
    "amplification",
    *OF_STRESS,
)  # quantities of `Stiffness`
AT_STROKES = (
    "motion",
    "transmission",
    "used",
    "coupling",
    "cross",
    "rotation",
    "force",
    "stress",
    "engaged",
    "engaged_free",
)  # quantities of `Drive`
QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "stiffness": AT_REST,
    "drive": AT_STROKES,
    "modes": ("frequency",),
}  # that arrays have, by question


def answers(
    layouts: Layouts, ratios_of: RatiosOf, wanted: Mapping[str, Collection[str]]
) -> dict[str, dict[str, Array]]:
    """Return quantities (n, ...) of n designs by question, in internal units.

    wanted : names of quantities by question, of `QUANTITIES`. Stress, which takes most of the time,
        is computed only where it is wanted.

    nan for a design without a solution.
    """
    with np.errstate(all="ignore"):
        network = DesignNetwork(layouts, ratios_of)
        found = dict[str, dict[str, Array]]()
        for question, names in wanted.items():
            found[question] = ANSWERS[question](network, {*names})
        return found


def at_rest(
    layouts: Layouts, ratios_of: RatiosOf, wanted: Collection[str] = AT_REST
) -> dict[str, Array]:
    """Return quantities of `AT_REST` (n, ...) of n designs, as `answers`."""
    return answers(layouts, ratios_of, {"stiffness": wanted})["stiffness"]


def _at_rest(network: DesignNetwork, wanted: set[str]) -> dict[str, Array]:
    """Return quantities of `AT_REST`."""
    first = 3 * len(network.layouts.points)
    C = network.response.compliance
    ports = [*range(3), *range(first, C.shape[-1])]
    values = _of_output(C[:, :3, :3])
    values |= _of_inputs(C[:, ports][:, :, ports])
    if not wanted.isdisjoint(OF_STRESS):
        values |= _of_stress(network, values)
    return values


def _of_output(compliance: Array) -> dict[str, Array]:
    K = inverse(compliance)
    K = (K + np.swapaxes(K, -1, -2)) / 2
    return {
        "compliance": compliance,
        "stiffness": K,
        "held": np.diagonal(K, axis1=-2, axis2=-1),
        "free": 1 / np.diagonal(compliance, axis1=-2, axis2=-1),
    }


def _of_inputs(compliance: Array) -> dict[str, Array]:
    """Return the stiffness (n, a) at the actuators and the motion (n, a, 3) per opening of each."""
    openings = np.diagonal(compliance, axis1=-2, axis2=-1)[:, 3:]
    motions = np.swapaxes(compliance[:, :3, 3:], -1, -2)
    return {"input_stiffness": 1 / openings, "amplification": motions / openings[..., None]}


def _of_stress(network: DesignNetwork, values: dict[str, Array]) -> dict[str, Array]:
    """Return the stress (n, h, 3) per displacement, and displacements and forces (n, 3) at yield.

    The displacement is along one direction of the output, with the others held or free.
    """
    layouts = network.layouts
    held = values["stiffness"]
    alone = values["free"][:, None] * np.eye(3)
    of_both = network.stress_under(np.concatenate([held, alone], axis=-1))
    highest = np.zeros((layouts.number, 6))
    for number, hinge in enumerate(layouts.hinges):
        share = np.divide(layouts.yield_strength, hinge.material.yield_strength)
        np.maximum(highest, network.for_each(share)[:, None] * of_both[:, number], out=highest)
    strength = network.for_each(layouts.yield_strength)[:, None]
    reach = strength / highest
    return {
        "stress": of_both[..., :3],
        "free_yield_range": reach[:, 3:],
        "yield_range": reach[:, :3],
        "yield_force": values["held"] * reach[:, :3],
    }


# driven


def _at_strokes(network: DesignNetwork, wanted: set[str]) -> dict[str, Array]:
    """Return quantities of `AT_STROKES`."""
    layouts = network.layouts
    C = network.response.compliance
    first = 3 * len(layouts.points)
    drives = range(first, C.shape[-1])
    ports = [*range(3), *drives]
    driven = DriveSystem.of(C[:, ports][:, :, ports], _drive(network))
    strokes = driven.drive.highest
    loads = np.zeros((layouts.number, len(drives), C.shape[-1]))
    loads[..., first:] = np.swapaxes(driven.Y * strokes[:, None], -1, -2)
    stress = np.full((layouts.number, len(drives), len(layouts.hinges)), np.nan)
    if "stress" in wanted:
        of_loads = network.stress_under(np.swapaxes(loads, -1, -2))
        stress = np.swapaxes(of_loads, -1, -2)
    linear = AtStrokes(loads @ C, loads, stress)
    engaged = driven.engaged
    return {
        **values_at_strokes(linear, linear, strokes, _lever(network)),
        "engaged": np.diagonal(inverse(engaged), axis1=-2, axis2=-1),
        "engaged_free": 1 / np.diagonal(engaged, axis1=-2, axis2=-1),
    }


def _drive(network: DesignNetwork) -> ActuatorSet:
    """Return the numbers (n, a) of the actuators, as `Layout.drive`."""
    inputs = network.layouts.inputs
    stiffness = np.stack([network.for_each(one.stiffness) for one in inputs], axis=-1)
    stroke = np.stack([network.for_each(one.stroke) for one in inputs], axis=-1)
    none = np.zeros_like(stroke)
    names = tuple(one.name for one in inputs)
    force = stiffness * stroke
    return ActuatorSet((), names, stiffness, none, force, np.eye(len(names)), none, stroke)


def _lever(network: DesignNetwork) -> Array:
    """Return the lever (n,) of the output, as `Layout.lever`."""
    layouts = network.layouts
    output = layouts.points[0]
    lever = np.zeros(layouts.number)
    for hinge in layouts.hinges:
        if output.body in hinge.bodies:
            np.maximum(lever, np.abs(hinge.place - np.asarray(output.point)), out=lever)
    return np.where(lever > 0, lever, 1.0)


def _of_modes(network: DesignNetwork, wanted: set[str]) -> dict[str, Array]:
    """Return natural frequencies (n, modes)."""
    return {"frequency": frequencies(network)}


Answer: TypeAlias = Callable[[DesignNetwork, set[str]], dict[str, Array]]
ANSWERS: Mapping[str, Answer] = {
    "stiffness": _at_rest,
    "drive": _at_strokes,
    "modes": _of_modes,
}
