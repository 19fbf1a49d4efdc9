"""One stage file through the analytic model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.paper.designs import design_arrays
from flexfem.paper.equations import stiffness
from flexfem.paper.model import analyse, assemble, in_range
from flexfem.paper.stage import load_stage
from flexfem.refused import BadInput, ComputationFailed

from ..tolerances import DENSE

REFERENCE = Path(__file__).parents[2] / "geometry/mobility6.toml"
STAGE = """
name = "generic"
thickness_mm = 9.3
[material]
name = "generic"
youngs_modulus_gpa = 68.9
poissons_ratio = 0.29
density_kg_m3 = 2700.0
yield_strength_mpa = 480.0
[chain]
link_lengths_mm = [29.0, 33.5, {l3}]
joint_angles_deg = [176.0, -85.0, {phi3}]
link_width_mm = 9.0
[hinges.base]
radius_mm = 3.9
neck_mm = 0.52
prismatic = true
[hinges.elbow]
radius_mm = 1.6
neck_mm = 0.47
[hinges.platform]
radius_mm = 1.4
neck_mm = 0.55
[platform]
radius_mm = 17.0
hub_radius_mm = 8.0
[[override]]
chain = 2
hinge = "elbow"
neck_mm = 0.61
axis_deg = 20.0
"""


@pytest.fixture
def stage(tmp_path):
    path = tmp_path / "stage.toml"
    path.write_text(STAGE.format(l3=22.7, phi3=97.0))
    return load_stage(path)


def test_the_stages_own_hinges_decide_without_a_given_mobility(stage) -> None:
    found = analyse(stage)
    assert found.mobility == stage.mobility == 6 and found.freedoms == analyse(stage, 6).freedoms
    np.testing.assert_array_equal(found.stiffness, analyse(stage, 6).stiffness)


def test_hinges_outside_the_range_of_the_formula_are_flagged_not_refused(stage) -> None:
    found = analyse(
        stage, formula="smith-chetwynd"
    )  # t/R 0.13 at the base hinges, its range begins at 0.2
    assert in_range(design_arrays(stage), "smith-chetwynd").tolist() == [[[False, True, True]] * 3]
    assert (
        np.isfinite(found.stiffness).all()
        and in_range(design_arrays(stage), "paros-weisbord").all()
    )


@pytest.mark.parametrize(
    "asked", [{"mobility": 0}, {"mobility": 9}, {"mobility": 27}, {"formula": "nonsense"}]
)
def test_an_unknown_model_is_refused(stage, asked) -> None:
    with pytest.raises(BadInput, match=str(*asked.values())):
        analyse(stage, **asked)


def test_a_singular_stage_is_an_error_that_names_it(tmp_path) -> None:
    """Base, elbow and platform hinge in line: with rotations alone nothing gives along the line."""
    path = tmp_path / "singular.toml"
    path.write_text(STAGE.format(l3=22.7, phi3=97.0).replace("-85.0", "0.0"))
    with pytest.raises(ComputationFailed, match="stage 'generic' is at a singular configuration"):
        analyse(load_stage(path), 3)


@pytest.mark.parametrize("links", [False, True])
def test_a_stage_without_an_answer_names_the_neck_that_is_too_thin_and_a_width_that_has_one(
    links,
) -> None:
    """Not its configuration, which is that of the reference stage."""
    stage = load_stage(REFERENCE)
    thin = stage.replace(override={(2, "elbow"): {"neck": 1e-4}})
    with pytest.raises(
        BadInput, match=r"override.2.elbow.neck_mm = 0.0001: .* expected >= \S+$"
    ) as refused:
        analyse(thin, links=links)
    least = float(refused.value.reason.rpartition(" ")[2])
    assert 1e-4 < least < 0.01
    analyse(stage.replace(override={(2, "elbow"): {"neck": least}}), links=links)


def test_links_that_meet_in_the_centre_turn_freely_but_for_their_springs(tmp_path, error) -> None:
    """With link 2 of every chain through the centre, base joints do not fix the others, and springs
    still hold it.
    """
    path = tmp_path / "concurrent.toml"
    path.write_text(STAGE.format(l3=22.7, phi3=0.0))
    stage = load_stage(path)
    of = assemble(stage, 3)
    K = analyse(stage, 3).stiffness
    assert error(stiffness(of).K_uu, K) < DENSE
    assert np.linalg.eigvalsh(K / np.sqrt(np.outer(np.diag(K), np.diag(K)))).min() > 0.1
