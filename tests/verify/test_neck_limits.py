"""The half-spaces of yield against the stresses of strokes and loads, on a stage with unlike chains."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.drives import drive_of
from flexfem.mechanism.stage import load_stage
from flexfem.verify.driven import moved
from flexfem.verify.driven_models import commanding, stresses
from flexfem.verify.neck_limits import NeckForces, NeckSections, limits_of_necks, neck_forces, per_command, sections_of

GEOMETRY = Path(__file__).parents[2] / "geometry"
LOAD = np.array([3.1, -1.7, 41.0])


def test_the_half_spaces_of_yield_are_the_stresses_of_the_necks():
    stage = load_stage(GEOMETRY / "mobility6.toml").replace(
        override={(2, "elbow"): {"neck": 0.41}, (3, "platform"): {"radius": 1.9}}, model="plane_strain"
    )
    drive, one, frames = drive_of(stage), commanding(stage, None, "calibrated", True), stage_frames(stage)
    sections = NeckSections(*(each[0] for each in sections_of(lower(stage))))
    carried = per_command(one.of, frames, one.model.necks)
    rest = np.concatenate([LOAD, moved(one.of, drive, np.zeros(6), LOAD).force])
    at_rest = NeckForces(*(each[..., 0] for each in neck_forces(frames, (one.model.necks @ rest)[..., None])))
    limits = limits_of_necks(sections, carried, at_rest, np.array(503.0))
    assert limits.rows.shape == (9 * 141 * 4, 6)
    rng = np.random.default_rng(3)
    for command in 1e-3 * rng.normal(size=(5, 6)):
        found = limits.rows @ command - limits.offsets
        wanted = stresses(stage, one, moved(one.of, drive, command, LOAD), LOAD)
        np.testing.assert_allclose(np.max(found.reshape(3, 3, -1), axis=-1), wanted, rtol=1e-10)
    np.testing.assert_array_equal(limits.sizes, 503.0)
