"""Designs as arrays and as stages are the same designs, and those the stage file would give."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexfem.mechanism.keys import keys
from flexfem.paper.stage import HINGE_NAMES, load_stage
from flexfem.refused import BadInput
from flexfem.study.loaded import mechanism_of, sample

FEW = 'method = "monte_carlo"\ndesigns = 20\nseed = 5'
FACTORS = (
    'key = "thickness_mm"\nfrom = 5.0\nto = 15.0',
    'key = "material.youngs_modulus_gpa"\nfrom = 60.0\nto = 210.0',
    'key = "material.poissons_ratio"\nfrom = 0.2\nto = 0.4',
    'key = "material.yield_strength_mpa"\nfrom = 200.0\nto = 900.0',
    'key = "chain.link_lengths_mm[2]"\nfrom = 23.0\nto = 27.0',
    'key = "chain.joint_angles_deg[0]"\nfrom = 170.0\nto = 180.0',
    'key = "hinges.*.neck_mm"\nfrom = 0.4\nto = 0.7',
    'key = "hinges.base.axis_deg"\nfrom = 160.0\nto = 190.0',
    'key = "override.3.platform.radius_mm"\nfrom = 1.2\nto = 1.9',
    'key = "override.3.platform.axis_deg"\nfrom = 80.0\nto = 100.0',
    'key = "override.1.base.neck_mm"\nfrom = 0.4\nto = 0.7',
    'keys = ["platform.radius_mm", "override.2.elbow.radius_mm"]\nvalues = [1.5, 1.6]',
)


def test_designs_as_arrays_are_the_stages_one_by_one(studies: Any) -> None:
    loaded = studies.of(FEW, *FACTORS)
    values = sample(loaded, 0, loaded.count)
    together = loaded.family.batch.designs(values)
    for index, row in enumerate(values):
        stage = mechanism_of(loaded, row)
        assert together.thickness[index] == stage.thickness
        for name in ("youngs_modulus", "poissons_ratio", "yield_strength"):
            assert getattr(together, name)[index] == getattr(stage.material, name)
        assert tuple(together.link_lengths[index]) == stage.chain.link_lengths
        assert tuple(together.joint_angles[index]) == stage.chain.joint_angles
        assert together.platform_radius[index] == stage.platform.radius
        for name in ("radius", "neck"):
            np.testing.assert_array_equal(getattr(together, name)[index], stage.array(name))
        axes = [[stage.hinge(chain, name).axis for name in HINGE_NAMES] for chain in (1, 2, 3)]
        expected = [[np.nan if axis is None else axis for axis in row] for row in axes]
        np.testing.assert_array_equal(together.axis[index], expected)


def test_a_design_is_the_stage_that_the_edited_file_would_give(studies: Any) -> None:
    """Read by the stage format itself, not by the study's own hands."""
    necks = (
        'key = "hinges.elbow.neck_mm"\nvalues = [0.5]',
        'key = "override.2.elbow.neck_mm"\nvalues = [0.8]',
    )
    link = (
        'key = "chain.link_lengths_mm[1]"\nvalues = [34.25]',
        'key = "override.3.base.radius_mm"\nvalues = [3.5]',
    )
    loaded = studies.of(FEW, *necks, *link, 'key = "material.youngs_modulus_gpa"\nvalues = [71.7]')
    text = (studies.folder / "stage.toml").read_text()
    edits = {
        "neck_mm = 0.47": "neck_mm = 0.5",
        "neck_mm = 0.71": "neck_mm = 0.8",
        "33.5": "34.25",
        "68.3": "71.7",
    }
    edits["[provenance]"] = '[[override]]\nchain = 3\nhinge = "base"\nradius_mm = 3.5\n[provenance]'
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    (studies.folder / "edited.toml").write_text(text)
    stage = mechanism_of(loaded, sample(loaded, 0, 1)[0])
    assert len({(each.chain, each.hinge) for each in stage.override}) == len(stage.override) == 2
    assert stage.hash == load_stage(studies.folder / "edited.toml").hash != loaded.base.hash


def test_a_single_hinge_keeps_what_is_its_own(studies: Any) -> None:
    """The stage overrides the elbow of chain 2; a factor for all elbows leaves it, one for that
    hinge does not.
    """
    elbows = 'key = "hinges.elbow.neck_mm"\nvalues = [0.5]'
    loaded = studies.of(FEW, elbows)
    np.testing.assert_array_equal(
        loaded.family.batch.designs(np.array([[0.5]])).neck[0, :, 1], [0.5, 0.71, 0.5]
    )
    for chain, expected in (
        (1, [0.9, 0.71, 0.5]),
        (2, [0.5, 0.9, 0.5]),
    ):  # whatever the order of the factors
        single = studies.of(FEW, f'key = "override.{chain}.elbow.neck_mm"\nvalues = [0.9]', elbows)
        values = np.array([[0.9, 0.5]])
        np.testing.assert_array_equal(single.family.batch.designs(values).neck[0, :, 1], expected)
        np.testing.assert_array_equal(mechanism_of(single, values[0]).array("neck")[:, 1], expected)


@pytest.mark.parametrize("value", [-0.1, 0.0, np.inf, np.nan, 2e4, 1e-9])
def test_a_value_that_no_file_can_give_is_refused_by_its_key(value: float, studies: Any) -> None:
    loaded = studies.of(FEW, 'key = "hinges.base.neck_mm"\ndistribution = "normal"\nsd = 0.1')
    with pytest.raises(BadInput, match=r"^hinges\.base\.neck_mm = .*, expected"):
        mechanism_of(loaded, np.array([value]))
    values = np.array([0.5, value, 0.6])
    np.testing.assert_array_equal(
        keys()["hinges.base.neck_mm"].number.refuses(values), [False, True, False]
    )
    shrinking = np.array(
        [-5.0, -1e-4, 0.0, 3.0]
    )  # um/(m K): a frame's, of which one is a unit mistake
    assert keys()["frame.expansion_um_per_m_k"].number.refuses(shrinking).tolist() == [
        False,
        True,
        False,
        False,
    ]
