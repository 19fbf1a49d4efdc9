"""Generic stages: unequal links, all nine hinges different, no symmetry, necks not along the links."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.hinges.chart import Compliance
from flexfem.hinges.formulas import formula
from flexfem.paper.equations import FREEDOMS_BY_MOBILITY, Freedoms, PaperModel, influence
from flexfem.paper.frames import Frames, frames

R = ("rotation",)
RA = ("rotation", "axial")
RAS = ("rotation", "axial", "shear")
RS = ("rotation", "shear")
TABLES: dict[str, Freedoms] = {
    **{f"mobility {m}": table for m, table in FREEDOMS_BY_MOBILITY.items()},
    "mixed, one slide": ((R, R, RA), (R, R, R), (R, R, R)),
    "mixed, chains unlike": ((RA, R, RAS), (R, RS, R), (RAS, RA, R)),
    "mixed, one chain full": ((R, R, R), (RAS, RAS, RAS), (R, R, R)),
}


class Sample(NamedTuple):
    """A generic stage or a batch of them."""

    frames: Frames
    compliance: Compliance


def sample(seed: int, *designs: int) -> Sample:
    """Stage number `seed`, or that many of them along leading axes."""
    rng = np.random.default_rng(seed)
    lengths = np.array([30.0, 32.0, 24.0]) * rng.uniform(0.85, 1.15, (*designs, 3))
    angles = np.radians([180.0, -90.0, 90.0]) + rng.uniform(-0.3, 0.3, (*designs, 3))
    regular = frames(lengths, angles)
    centres = regular.centres + rng.uniform(-3.0, 3.0, regular.centres.shape)
    skew = Frames(centres, rng.uniform(-np.pi, np.pi, regular.axes.shape))
    radius = rng.uniform(1.3, 4.1, skew.axes.shape)
    neck = rng.uniform(0.3, 0.7, skew.axes.shape)
    return Sample(skew, formula("paros-weisbord").compliance(radius, neck, 9.3, 68.9e3, 0.29))


def scaled_error(K: Array, reference: Array) -> float:
    """Largest entry of K - reference over the diagonal of the reference: free of mm against rad."""
    size = np.sqrt(np.abs(np.diagonal(reference, axis1=-2, axis2=-1)))
    return float(np.max(np.abs(K - reference) / (size[..., :, None] * size[..., None, :])))


def close_loops(of: PaperModel, displacement: Array) -> Array:
    """Joint displacements (..., N) with the independent ones as given; Newton's method on the gaps
    of the loops.
    """
    phi = np.array(displacement)
    for _ in range(12):
        at = influence(of.frames, of.joints, of.choice, phi)
        phi[..., of.choice.dependent] -= (at.A_inverse @ at.gap[..., None])[..., 0]
    return phi


@pytest.fixture(scope="session")
def generic() -> Callable[..., Sample]:
    """`sample`."""
    return sample


@pytest.fixture(scope="session")
def error() -> Callable[[Array, Array], float]:
    """`scaled_error`."""
    return scaled_error


@pytest.fixture(params=TABLES, scope="session")
def table(request: pytest.FixtureRequest) -> Freedoms:
    """Every table of joint freedoms, uniform and mixed."""
    return TABLES[request.param]
