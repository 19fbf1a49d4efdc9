"""Whether chains that are alike reduce the effect of a gradient of temperature, as the text says of its structure."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.model import CALIBRATED, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.analytic.responses import WarmBodies, WarmModel, drift
from flexfem.arrays import Array
from flexfem.mechanism.stage import HINGE_NAMES
from flexfem.verdicts.evidence import Evidence, Metal
from flexfem.verify.drift import UNLIKE, UNLIKE_CHAINS

ALIKE = (1.0, 1.0, 1.0)  # factors on the necks of each chain


def temperature_gradient(on: Evidence) -> Array:
    """By how many per cent (n, family) a gradient moves stages of `UNLIKE_CHAINS` further than those with like chains.

    Of the stages of mobility six, the hinges of chain 1 in all chains; by calibrated hinges, every freedom, elastic
    links, and pads whose clamped edges the frame strains and bows. The effect is the largest pose, rotation times l3,
    by a gradient of any direction; the coefficients of expansion cancel.
    """
    found = _warmed(on.six.metal)
    alike = _ends(found.alike, found.lever)[:, 0]
    return np.stack([100 * (_ends(other, found.lever)[:, 0] / alike - 1) for other in found.family], axis=-1)


def said_temperature_gradient(on: Evidence, values: Array) -> str:
    """A sentence on one stage, with what a uniform change does beside."""
    found = _warmed(on.six.metal)
    moved = [float(np.hypot(*each.pose[0, :2, 0])) for each in found.family]
    turned = float(abs(found.alike.pose[0, 2, 0]) * found.lever[0])
    alike = _ends(found.alike, found.lever)[0, 1]
    least = [100 * (_ends(each, found.lever)[0, 1] / alike - 1) for each in found.family]
    said = ", ".join(f"{name} {value:+.2f} %" for name, value in zip(UNLIKE_CHAINS, values, strict=True))
    return (
        f"with necks {UNLIKE:g} % {said} in the worst direction of the gradient, and {min(least):+.2f} to"
        f" {max(least):+.2f} % in the best; a uniform change only turns the platform where chains are alike, and moves"
        f" it by {min(moved) / turned:.2g} to {max(moved) / turned:.2g} of that turn times l3 where they are not"
    )


class _Warmed(NamedTuple):
    """Drift of n stages that do not expand on a frame that does: with like chains, and each of `UNLIKE_CHAINS`.

    lever : l3 (n,), mm.
    """

    lever: Array
    alike: WarmModel
    family: list[WarmModel]


def _warmed(metal: Metal) -> _Warmed:
    """Drift of the metal's stages.

    Notes
    -----
    Necks a tenth wider change what the clamped edges do, which counts. What they change in the compliance of pads,
    links and platform is worth 1e-5 points where a gradient moves unlike chains hardly further, 0.0015 where by 18 %.
    """
    of = metal if metal.designs.alike else _alike(metal)
    factors = sorted({factor for each in UNLIKE_CHAINS.values() for factor in each})
    edges = {factor: np.array([edge_motions(stage, factor) for stage in of.stages]) for factor in factors}
    rest = np.zeros(len(of.stages))

    def warmed(by: tuple[float, float, float]) -> WarmModel:
        designs = replace(of.designs, neck=of.designs.neck * np.array(by)[:, None])
        bodies = WarmBodies(of.bodies, np.stack([edges[factor][:, k] for k, factor in enumerate(by)], axis=1))
        return drift(designs, hinge_compliances(designs, CALIBRATED), freedoms_of(21), rest, rest + 1, bodies)

    family = [warmed(by) for by in UNLIKE_CHAINS.values()]
    return _Warmed(of.designs.link_lengths[:, 2], warmed(ALIKE), family)


def _ends(of: WarmModel, lever: Array) -> Array:
    """Largest and least pose (n, 2), rotation times l3, by a gradient of one K/mm of any direction."""
    pose = of.pose[:, :, 1:].copy()
    pose[:, 2] *= lever[:, None]
    known = np.all(np.isfinite(pose), axis=(1, 2), keepdims=True)
    return np.where(known[..., 0], np.linalg.svd(np.where(known, pose, 0.0), compute_uv=False), np.nan)


def _alike(metal: Metal) -> Metal:
    """The stages with the hinges of chain 1 in all chains."""
    stages = tuple(
        stage.model_copy(update={"hinges": {name: stage.hinge(1, name) for name in HINGE_NAMES}, "override": ()})
        for stage in metal.stages
    )
    first = {name: np.repeat(getattr(metal.designs, name)[:, :1], 3, axis=1) for name in ("radius", "neck", "axis")}
    designs = replace(metal.designs, radius=first["radius"], neck=first["neck"], axis=first["axis"])
    return Metal(stages, designs, np.array([body_compliance(stage) for stage in stages]), metal.compliance)
