"""Ensembles: the same stages from the same seed, only those that can be made, metal as finite elements have it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import CALIBRATED, analyse
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import load_stage
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.study.designs import stage_of
from flexfem.verdicts.arguments import ACROSS
from flexfem.verdicts.claims import load_claims
from flexfem.verdicts.ensemble import drawn_values, metal_of_stage, populate, side_of
from flexfem.verdicts.evidence import modelled
from flexfem.verify.other_stages import joint_command
from flexfem.verify.protocol import solve_stage

ROOT = Path(__file__).parents[2]
FILE = "cases/claims.toml"
NECK, SMALL, THREE, SIX, L1, L2, L3, ELBOW, PLATFORM, WIDTH = range(10)


def of_size(designs, seed=2003, path=ROOT / FILE):
    loaded = load_claims(path)
    ensemble = loaded.claims.ensemble.model_copy(update={"designs": designs, "seed": seed})
    return loaded._replace(claims=loaded.claims.model_copy(update={"ensemble": ensemble}))


@pytest.fixture(scope="module")
def few():
    loaded = of_size(10)
    return loaded, populate(loaded)


def test_a_seed_draws_the_same_values_and_another_seed_others():
    one, same, other = (drawn_values(of_size(40, seed)) for seed in (2003, 2003, 2004))
    np.testing.assert_array_equal(one, same)
    assert np.min(np.abs(one - other)) > 0
    np.testing.assert_array_equal(drawn_values(of_size(20)), one[:20])


def test_values_are_between_the_ends_that_the_file_states():
    found = drawn_values(of_size(1000))
    ends = [
        (0.2, 1.0), (1.0, 2.5), (1.0, 2.5), (2.5, 4.5), (20, 40), (20, 40), (21, 34), (-150, 0), (-30, 150), (8, 13),
    ]  # fmt: skip
    for column, (low, high) in zip(found.T, ends, strict=True):
        assert low <= np.min(column) < low + 0.02 * (high - low) and high - 0.02 * (high - low) < np.max(column) <= high
    assert np.median(found[:, NECK]) == pytest.approx(np.sqrt(0.2), rel=0.06)  # logarithmic


def test_factors_go_to_the_stages_they_are_of_and_what_cannot_be_made_is_left_out_and_counted(few):
    _, found = few
    assert found.drawn == 10 and found.off_chart == 0 and found.infeasible + len(found.values) == 10
    assert 0 < found.infeasible < 10
    three, six, values = found.three.designs, found.six.designs, found.values
    for designs in (three, six):
        np.testing.assert_array_equal(designs.neck, np.broadcast_to(values[:, NECK, None, None], designs.neck.shape))
        np.testing.assert_allclose(designs.radius[:, 1, 1:], values[:, [SMALL, SMALL]])
        np.testing.assert_allclose(designs.link_lengths, values[:, L1 : L3 + 1])
        np.testing.assert_allclose(designs.joint_angles[:, 1:], np.radians(values[:, ELBOW : PLATFORM + 1]))
        np.testing.assert_allclose(designs.link_width, values[:, WIDTH])
    np.testing.assert_allclose(three.radius[:, 2, 0], values[:, THREE])
    np.testing.assert_allclose(six.radius[:, 2, 0], values[:, SIX])
    assert not three.prismatic.any() and six.prismatic[:, 0].all()


def test_the_metal_of_a_drawn_stage_is_that_of_the_stage_alone(few):
    """Platforms that two stages share are computed once; a stage built by hand knows nothing of that."""
    loaded, found = few
    row = found.values[1]
    for base, mine, metal in ((loaded.three, row[THREE], found.three), (loaded.six, row[SIX], found.six)):
        stage = base.replace(
            neck={name: row[NECK] for name in ("base", "elbow", "platform")},
            radius={"base": mine, "elbow": row[SMALL], "platform": row[SMALL]},
            chain={
                "link_lengths": row[L1 : L3 + 1].tolist(),
                "joint_angles": np.radians([180.0, row[ELBOW], row[PLATFORM]]).tolist(),
                "link_width": row[WIDTH],
            },
        )
        check_feasible(stage)
        expected = analyse(stage, 21, CALIBRATED, links=True).compliance
        np.testing.assert_allclose(metal.compliance[1], expected, rtol=1e-9, atol=1e-9 * np.max(np.abs(expected)))


def test_unlike_platforms_have_their_own_compliance(project):
    path = project.edit("geometry/mobility3.toml", ("hub_radius_mm = 8.0", "hub_radius_mm = 9.5")).parents[1] / FILE
    loaded = of_size(3, path=path)
    found = populate(loaded)

    for side, metal in (("three", found.three), ("six", found.six)):
        varied, places = side_of(loaded, side)
        expected = analyse(stage_of(varied, found.values[0][places]), 21, CALIBRATED, links=True).compliance
        np.testing.assert_allclose(np.diag(metal.compliance[0]), np.diag(expected), rtol=1e-9)


def test_errors_of_a_batch_are_those_of_each_stage(few):
    _, found = few
    of = modelled(found.six, 6, "koster")
    for row, lever in enumerate(found.values[:, L3]):
        expected = error_matrix(of.stiffness[row], found.six.compliance[row], float(lever))
        np.testing.assert_allclose(of.percent[row], expected, atol=1e-9)
    assert len(found.of_rows(np.arange(len(found.values)) == 1).three.compliance) == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("designs = 1200", "designs = 0", "ensemble.designs"),
        ("designs = 1200", "designs = 20000", "10000"),
        ("seed = 2003", "seed = -1", "ensemble.seed"),
        ('stage = "six"', 'stage = "both"', "ensemble.factor[3].stage"),
        ('stage = "six"', 'stage = "three"', "ensemble.factor[2] sets hinges.base.radius_mm"),
        ('stage = "six"\nfrom = 2.5\nto = 4.5', 'stage = "six"', "a factor is values"),
        ("from = 8.0\nto = 13.0", "from = 8.0\nto = 3.0", "ensemble.factor[9].to"),
        ("from = 8.0\nto = 13.0", "from = 8.0\nto = 13.0\npoints = 3", "no points"),
        ('key = "chain.link_width_mm"', 'key = "chain.link_widht_mm"', "link_width_mm"),
        ('key = "chain.link_width_mm"', 'key = "material.density_kg_m3"', "expected a number that answers depend on"),
        ("from = 8.0\nto = 13.0", "from = 0.3\nto = 0.5", "none of these pairs of stages can be made"),
    ],
)
def test_an_ensemble_that_cannot_be_meant_is_refused_in_one_line(project, old, new, said):
    path = project.edit(FILE, (old, new))
    if "none of" in said:
        path.write_text(path.read_text().replace("designs = 1200", "designs = 5"))
    with pytest.raises(BadInput) as refused:
        populate(load_claims(path))
    assert said in str(refused.value) and "\n" not in str(refused.value) and "claims.toml" in str(refused.value)


TURN = np.array([[-0.5, -np.sqrt(0.75), 0.0], [np.sqrt(0.75), -0.5, 0.0], [0.0, 0.0, 1.0]])


def test_a_linear_protocol_of_a_three_fold_symmetric_stage_couples_no_translation_to_rotation():
    """Any map that a turn by 120 degrees leaves as it is, symmetric or not: X to Y is left, and skew."""
    random = np.random.default_rng(7).normal(size=(50, 3, 3))
    turns = [np.linalg.matrix_power(TURN, k) for k in range(3)]
    found = np.mean([R @ random @ R.T for R in turns], axis=0)
    np.testing.assert_allclose(found[:, [0, 1, 2, 2], [2, 2, 0, 1]], 0.0, atol=1e-14)
    np.testing.assert_allclose(found[:, 0, 0], found[:, 1, 1])
    np.testing.assert_allclose(found[:, 0, 1], -found[:, 1, 0])
    assert np.min(np.abs(found[:, 0, 1])) > 1e-3
    both = np.array([one + one.T for one in found])
    product = both[:25] @ both[25:]  # compliance times stiffness
    np.testing.assert_allclose(product[:, 0, 1], 0.0, atol=1e-13)
    assert "zero under any linear protocol" in ACROSS.replace("\n", " ")


def test_forces_leave_no_error_across_and_joint_commands_one_between_x_and_y(few):
    """Random three-fold symmetric stages: translation and rotation never, X and Y where joints are commanded."""
    loaded, found = few
    of = modelled(found.three, 3, "paros-weisbord")
    assert np.max(np.abs(of.percent[:, ~np.eye(3, dtype=bool)])) < 1e-8

    varied, places = side_of(loaded, "three")
    for row in found.values[:3]:
        error = joint_command(stage_of(varied, row[places]), 3)
        assert np.max(np.abs([*error[:2, 2], *error[2, :2]])) < 1e-8
        assert abs(error[0, 1]) > 1e-4 and error[0, 1] == pytest.approx(-error[1, 0], rel=1e-6)


def test_the_metal_of_the_reference_stages_is_that_with_elastic_links():
    for name in ("mobility3", "mobility6"):
        stage = load_stage(ROOT / f"geometry/{name}.toml")
        expected = analyse(stage, 21, CALIBRATED, links=True).compliance
        np.testing.assert_allclose(metal_of_stage(stage).compliance[0], expected, rtol=1e-9, atol=1e-12)
        assert body_compliance(stage).shape == (9, 9)


@pytest.mark.slow
def test_the_metal_of_an_ensemble_is_that_of_finite_elements():
    """Four drawn pairs: errors within 0.03 points, three less six within 0.004."""

    loaded = of_size(8)
    found = populate(loaded)
    off = []
    for side, metal, mobility in (("three", found.three, 3), ("six", found.six, 6)):
        of = modelled(metal, mobility, "paros-weisbord")
        varied, places = side_of(loaded, side)
        stages = [stage_of(varied, row[places]) for row in found.values[:4]]
        solved = np.array([solve_stage(stage, 8).response.compliance for stage in stages])
        errors = error_matrix(of.stiffness[:4], solved, found.values[:4, L3])
        off.append(np.diagonal(errors - of.percent[:4], axis1=1, axis2=2))
    assert np.max(np.abs(off)) < 0.07 and np.max(np.abs(off[0] - off[1])) < 0.004


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5, 11, 77])
def test_another_seed_gives_the_same_verdicts(seed):
    from flexfem.verdicts.verdict import measure_claims
    from tests.verify.test_claims import DEPEND, EXPECTED, analytic_stand_in

    found = measure_claims(ROOT / FILE, analytic_stand_in, lambda loaded: populate(of_size(1200, seed)))
    expected = EXPECTED | dict.fromkeys(DEPEND, "depends on the dimensions")
    assert {each.id: each.verdict for each in found} == expected
