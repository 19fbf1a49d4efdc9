"""Whether chains that are alike reduce the effect of a gradient of temperature, as the text says of its structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexfem.analytic.heat import WarmModel, drift
from flexfem.analytic.kinematics import freedoms_of
from flexfem.analytic.model import CALIBRATED, hinge_compliances
from flexfem.arrays import Array
from flexfem.stage.designs import Designs
from flexfem.verdicts.evidence import Evidence
from flexfem.verify.drift import UNLIKE, UNLIKE_CHAINS


def temperature_gradient(on: Evidence) -> Array:
    """By how many per cent (n, family) a gradient moves stages of `UNLIKE_CHAINS` further than those with like chains.

    Of the stages of mobility six, the hinges of chain 1 in all chains; by calibrated hinges, every freedom and
    rigid links. The effect is the largest pose, rotation times l3, by a gradient of any direction; the coefficients of
    expansion cancel.
    """
    stages = _alike(on.six.designs)
    alike = _ends(stages)[:, 0]
    return np.stack([100 * (_ends(other)[:, 0] / alike - 1) for other in _family(stages)], axis=-1)


def said_temperature_gradient(on: Evidence, values: Array) -> str:
    """A sentence on one stage, with what a uniform change does beside."""
    stages = _alike(on.six.designs)
    moved = [float(np.hypot(*_warmed(each).pose[0, :2, 0])) for each in _family(stages)]
    turned = float(abs(_warmed(stages).pose[0, 2, 0]) * stages.link_lengths[0, 2])
    least = [100 * (_ends(each)[0, 1] / _ends(stages)[0, 1] - 1) for each in _family(stages)]
    said = ", ".join(f"{name} {value:+.2f} %" for name, value in zip(UNLIKE_CHAINS, values, strict=True))
    return (
        f"with necks {UNLIKE:g} % {said} in the worst direction of the gradient, and {min(least):+.2f} to"
        f" {max(least):+.2f} % in the best; a uniform change only turns the platform where chains are alike, and moves"
        f" it by {min(moved) / turned:.2g} to {max(moved) / turned:.2g} of that turn times l3 where they are not"
    )


def _warmed(designs: Designs) -> WarmModel:
    """Drift of stages that do not expand on a frame that does."""
    none = np.zeros(len(designs.neck))
    return drift(designs, hinge_compliances(designs, CALIBRATED), freedoms_of(21), none, none + 1)


def _ends(designs: Designs) -> Array:
    """Largest and least pose (n, 2), rotation times l3, by a gradient of one K/mm of any direction."""
    pose = _warmed(designs).pose[:, :, 1:].copy()
    pose[:, 2] *= designs.link_lengths[:, 2, None]
    known = np.all(np.isfinite(pose), axis=(1, 2), keepdims=True)
    return np.where(known[..., 0], np.linalg.svd(np.where(known, pose, 0.0), compute_uv=False), np.nan)


def _alike(designs: Designs) -> Designs:
    """The designs with the hinges of chain 1 in all chains."""
    first = {name: np.repeat(getattr(designs, name)[:, :1], 3, axis=1) for name in ("radius", "neck", "axis")}
    return replace(designs, radius=first["radius"], neck=first["neck"], axis=first["axis"])


def _family(designs: Designs) -> list[Designs]:
    return [replace(designs, neck=designs.neck * np.array(factors)[:, None]) for factors in UNLIKE_CHAINS.values()]
