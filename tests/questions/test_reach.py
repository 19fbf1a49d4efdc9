"""The poses that a drive reaches: hand polygons, zonotopes, symmetry, and every point against the
strokes it takes.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import LineCollection
from scipy.optimize import linprog

import flexfem
from flexfem.paper.commanding import Commanding, commanding, driven_elements
from flexfem.paper.designs import design_arrays
from flexfem.paper.driven import drive_ranges, stress_along
from flexfem.paper.drives import ActuatorSet, drive_of
from flexfem.paper.figures.reach import reach_figure
from flexfem.paper.model import CALIBRATED, DEFAULT_FORMULA, ModelChoice
from flexfem.paper.polytope import polytope_of
from flexfem.paper.reach import StageReach, pose_set
from flexfem.paper.stage import Stage, load_stage
from flexfem.questions.driven import CommandLimits, DriveSystem, stroke_limits
from flexfem.questions.poses import PoseSet
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS

from ..conftest import ROOT
from ..tolerances import DENSE, SOLVED

GEOMETRY = ROOT / "geometry"
NONE = np.zeros(3)
LOAD = np.array([0.7, -0.4, 7.0])
LEVER = 24.0
SCALE = np.array([1.0, 1.0, LEVER])
OWN = flexfem.Analytic(formula=CALIBRATED, mobility=21, links=True)
SIX = flexfem.Analytic(mobility=6)


def with_actuators(stage: Stage, *changes: dict[str, object], **all_of: object) -> Stage:
    """The stage with its first actuators changed one by one, or all of them alike."""
    each = changes or ({},) * len(stage.actuator)
    return stage.replace(
        actuator=[
            a.model_copy(update=change | all_of)
            for a, change in zip(stage.actuator, each, strict=False)
        ]
    )


@pytest.fixture(scope="module")
def stage() -> Stage:
    return load_stage(GEOMETRY / "mobility6.toml").replace(model="plane_stress")


@pytest.fixture(scope="module")
def light(stage) -> Stage:
    """Preloads that strokes use up, so that contacts bind."""
    return with_actuators(stage, preload=4.0)


@pytest.fixture(scope="module")
def own(unlike_drive) -> Stage:
    """Unlike chains; single stacks, tilted; light pairs on the other side of the link; a weak
    single on the rim.
    """
    weak = ({"preload": 0.0, "ball_radius": None}, {"preload": 12.0}, {"blocking_force": 41.0})
    return with_actuators(unlike_drive, *weak)


def modelled(stage: Stage) -> Commanding:
    return commanding(ModelChoice(stage, None, CALIBRATED, True))


def reach(
    stage: Stage, load: np.ndarray = NONE, models: str = "analytic", **others: object
) -> StageReach:
    return flexfem.reach(stage, load=load, models=models, **others)


def poses_of(stage: Stage) -> PoseSet:
    one = modelled(stage)
    return pose_set(one, one.system, NONE)


@pytest.fixture(scope="module")
def reached(stage) -> StageReach:
    """Without load."""
    return reach(stage, NONE)


def ends(found: StageReach, name: str) -> np.ndarray:
    """Ranges in um, um, mrad."""
    return 1e3 * found.at("ends", others=name, model=ANALYTIC).T


def test_a_cube_with_an_edge_cut_off_is_drawn_as_by_hand(stage):
    """Commands are the pose; x + y <= 1.5 cuts an edge off the cube, x <= 3 never binds."""
    rows = np.concatenate([np.eye(3), -np.eye(3), [[1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])
    drive = drive_of(stage)._replace(lowest=-np.ones(3), highest=np.ones(3), differential=np.eye(3))
    of = DriveSystem(
        np.block([[np.zeros((3, 3)), np.eye(3)], [np.eye(3), np.zeros((3, 3))]]), np.eye(3), drive
    )
    bounds = np.append(np.ones(6), [1.5, 3.0])
    poses = PoseSet(of, CommandLimits(rows[None], bounds[None]), NONE)
    poses.names = [*(f"stroke of {k}" for k in range(6)), "contact of 0", "contact of 1"]
    found = polytope_of(poses, 2.0)
    corners = {(-1, -1), (1, -1), (1, 0.5), (0.5, 1), (-1, 1)}
    assert {tuple(np.round(v, 9).tolist()) for v in found.vertices} == {
        (*c, z) for c in corners for z in (-1, 1)
    }
    assert found.volume == pytest.approx(2 * (4 - 0.125))
    assert sorted(found.by) == [("contact of 0",), *((f"stroke of {k}",) for k in range(6))]
    section = found.section
    starts = np.round([edge.start for edge in section], 9).tolist()
    assert starts == [[-1, 1], [-1, -1], [1, -1], [1, 0.5], [0.5, 1]]
    np.testing.assert_allclose(
        [edge.end for edge in section], np.roll(starts, -1, axis=0), atol=DENSE
    )
    assert [edge.by[0] for edge in section] == [
        f"{kind} of {k}"
        for kind, k in (("stroke", 3), ("stroke", 4), ("stroke", 0), ("contact", 0), ("stroke", 1))
    ]
    (x,), (by,) = poses.maximised(np.ones((1, 3)), (0,))
    assert x == pytest.approx([0.0, 1.0, 1.0]) and set(by) == {"stroke of 1", "stroke of 2"}


def test_strokes_alone_reach_a_zonotope(stage):
    """Support and volume in closed form: sum of |G_j . n| over strokes, 8 times the sum of all
    |det|.
    """
    one = modelled(stage)
    found = polytope_of(poses_of(stage), LEVER)
    G = one.system.poses * 8.7e-3
    assert (found.dimension, len(found.vertices), len(found.faces)) == (
        3,
        32,
        30,
    )  # 2 + 6 * 5, 6 * 5
    determinants = [abs(np.linalg.det(G[:, list(three)])) for three in combinations(range(6), 3)]
    assert found.volume == pytest.approx(8 * sum(determinants), rel=DENSE)
    for n in np.random.default_rng(4).normal(size=(40, 3)) / SCALE[::-1]:
        assert np.max(found.vertices @ n) == pytest.approx(np.sum(np.abs(n @ G)), rel=DENSE)
    np.testing.assert_allclose(
        found.supports, np.sum(np.abs((found.normals * SCALE) @ G), axis=1), rtol=DENSE
    )
    moved_to = [one.system.moved(x, NONE).pose for x in found.commands]
    np.testing.assert_allclose(moved_to, found.vertices, rtol=DENSE, atol=1e-15)


def test_ranges_of_the_reference_stages(stage, reached):
    """With the others at zero X reaches less than Y."""
    found = reached
    both = np.array([[-1.0, 1.0]])
    np.testing.assert_allclose(
        ends(found, "zero"), both * [[23.989], [25.852], [1.0780]], rtol=1e-4
    )
    np.testing.assert_allclose(
        ends(found, "free"), both * [[28.675], [27.248], [1.0780]], rtol=1e-4
    )
    assert np.array([found.circle, found.ball]) == pytest.approx([23.807, 18.980], rel=1e-4)
    assert found.volume == pytest.approx(2.01660e3, rel=1e-4)
    assert list(poses_of(stage).ranges()[1]["zero", "x", "high"]) == [
        "stroke of elbow, chain 1, longest",
        "stroke of base, chain 3, longest",
        "stroke of base, chain 2, shortest",
        "stroke of elbow, chain 3, shortest",
    ]
    three = reach(load_stage(GEOMETRY / "mobility3.toml").replace(model="plane_stress"))
    np.testing.assert_allclose(
        ends(three, "zero")[:2], [[-24.780, 24.780], [-26.232, 26.232]], rtol=1e-4
    )


def test_strokes_alone_limit_a_mechanism():
    """Four actuators, each way against HiGHS; in closed form with the others free, and nothing held
    by two.
    """
    rng = np.random.default_rng(3)
    strokes = np.array([0.02, 0.05, 0.01, 0.03])
    root = rng.normal(size=(7, 7)) * [1, 1, 1 / LEVER, 1, 1, 1, 1]
    for count in (4, 2):
        one = np.ones(count)
        rest = np.zeros(count)
        drive = ActuatorSet(
            (), ("a", "b", "c", "d")[:count], one, rest, one, np.eye(count), rest, strokes[:count]
        )
        system = DriveSystem.of((root.T @ root)[: 3 + count, : 3 + count], drive)
        motion = system.poses * strokes[:count]
        held, free = PoseSet(system, stroke_limits(system), NONE).ranges()[0]
        np.testing.assert_allclose(
            free, [np.minimum(motion, 0).sum(axis=1), np.maximum(motion, 0).sum(axis=1)]
        )
        for axis, (row, sign) in product(range(3), enumerate((1, -1))):
            others = {
                "A_eq": np.delete(motion, axis, axis=0),
                "b_eq": np.zeros(2),
                "bounds": (0, 1),
            }
            wanted = sign * linprog(sign * motion[axis], **others).fun if count > 2 else np.nan
            assert held[row, axis] == pytest.approx(wanted, rel=DENSE, abs=1e-12, nan_ok=True)


def test_what_is_inside_takes_less_than_all_and_what_is_beyond_more(light):
    """Faces against the strokes within limits, another linear program: share 1 on every face, more
    0.1 % beyond.
    """
    one = modelled(light)
    found = reach(light, LOAD)
    V = found.vertices
    middle = np.mean(found.vertices, axis=0)
    solid = found.fields
    normals = solid.normals * SCALE
    supports = solid.supports
    assert {by.kinds for by in solid.by} == {("stroke",), ("stroke", "contact")}
    assert np.all(normals @ V.T <= supports[:, None] + DENSE * np.max(np.abs(supports)))

    def share(pose: np.ndarray) -> float:
        x = one.system.commands(pose, LOAD, LEVER, "within limits")
        return max(float(np.max(each)) for each in one.system.shares(x, LOAD).values())

    @settings(max_examples=8, deadline=None, database=None, derandomize=True)
    @given(st.tuples(*3 * [st.floats(-1, 1)]).filter(lambda n: np.linalg.norm(n) > 0.1))
    def check(direction):
        along = np.array(direction) / SCALE
        rate = normals @ along
        far = np.min(((supports - normals @ middle) / np.where(rate > 0, rate, np.nan))[rate > 0])
        assert share(middle + far * along) == pytest.approx(1.0, abs=1e-7)
        assert share(middle + 1.001 * far * along) > 1.0 + 1e-5
        assert share(middle + 0.999 * far * along) < 1.0 - 1e-5

    check()


def test_ranges_are_those_that_studies_have_by_programs_of_their_own(own, stage):
    """Single stacks, light pairs and unlike chains; and yield that binds."""
    weak = stage.replace(material={"yield_strength": 20.0}, override={(2, "elbow"): {"neck": 0.61}})
    for each in (own, weak):
        one = modelled(each)
        studied = drive_ranges(design_arrays(each), one.system.at(None), one.necks[None]).reach[0]
        found, stops, _ = poses_of(each).ranges()
        np.testing.assert_allclose(found[0], [-studied[1], studied[0]], rtol=DENSE)
    assert any("yield" in by.kinds for by in stops.values())


def test_an_own_stage_with_unlike_chains_single_stacks_and_a_load(own):
    load = np.array([1.0, -0.7, 5.0])
    found = reach(own, load, "both", resolution=4, analytic=OWN)
    np.testing.assert_allclose(
        ends(found, "zero"), [[-5.642, 5.791], [-5.944, 6.825], [-0.07518, 0.7150]], rtol=2e-4
    )
    model = found.at("ends", model=ANALYTIC)
    elements = found.at("ends", model=ELEMENTS)
    np.testing.assert_allclose(elements[0, 1], model[0, 1], rtol=1.2e-2)
    np.testing.assert_allclose(elements[1, 0], model[1, 0], rtol=1.2e-2)
    assert np.all(elements[0, 1] != model[0, 1])
    one = modelled(own)
    X = found.commands / 1e3  # mm
    for x in X:
        assert max(np.max(used) for used in one.system.shares(x, load).values()) < 1 + DENSE
        force = one.system.drive.preload + one.system.moved(x, load).force
        assert np.max(one.stress(load, force)) < 0.99 * own.material.yield_strength * (1 + DENSE)
    np.testing.assert_allclose(
        [one.system.moved(x, load).pose for x in X], found.vertices, atol=1e-12
    )
    assert np.min(X[:, 0]) == pytest.approx(0.0, abs=DENSE * 17.4e-3) and np.max(
        X[:, 0]
    ) <= 17.4e-3 * (1 + DENSE)
    rest = one.system.engaged @ load
    np.testing.assert_allclose(found.rest, rest)
    edges = found.fields.section
    section = np.array([edge.start for edge in edges])
    np.testing.assert_allclose(
        section, np.roll([edge.end for edge in edges], 1, axis=0), atol=1e-10
    )
    along = np.linspace(0.0, 1.0, 1001)[:, None, None]
    boundary = section + along * (np.roll(section, -1, axis=0) - section)
    assert np.min(np.linalg.norm(boundary - rest[:2], axis=-1)) == pytest.approx(
        float(found.circle) / 1e3, rel=1e-4
    )
    left = found.fields.supports - found.fields.normals @ (SCALE * rest)
    assert np.min(left) == pytest.approx(float(found.ball) / 1e3) and found.ball > 1.0


def test_preloads_of_single_stacks_stress_necks_and_those_of_pairs_do_not(stage, reached):
    alone = with_actuators(stage, {"pair": False, "preload": 4.0})
    (said,) = reach(alone, NONE).warnings
    assert (
        "no opposite stack that balances their preload, which stresses the necks with up to "
        "40.19 MPa" in said
    )
    assert reached.warnings == []
    limits = poses_of(stage).limits
    np.testing.assert_allclose(limits.at_rest, 0.0, atol=1e-9)
    assert limits.strength == pytest.approx(
        497.97, rel=1e-9
    )  # 99 % of 503 MPa: the model's stress may be 1 % low
    stressed = poses_of(alone).limits
    assert np.max(stress_along(stressed.sections, stressed.at_rest)) == pytest.approx(
        40.19, rel=1e-3
    )


def test_limits_that_allow_nothing_are_named(stage):
    with pytest.raises(
        ComputationFailed, match="limits of contact and those of blocking force and those of yield"
    ):
        reach(stage, np.array([4000.0, 0.0, 0.0]))
    alone = with_actuators(stage, {"pair": False, "preload": 60.0})
    with pytest.raises(
        ComputationFailed, match=r"limits of yield allow no commands.* necks with up to 602\.9 MPa"
    ):
        reach(alone, NONE)
    with pytest.raises(BadInput, match=r"no \[\[actuator\]\]"):
        reach(stage.replace(actuator=[]), NONE)


def test_pairs_without_preload_do_not_move_and_say_so(stage):
    found = reach(with_actuators(stage, preload=0.0, ball_radius=None), NONE)
    assert (found.fields.dimension, found.volume, found.circle, found.ball) == (0, 0.0, 0.0, 0.0)
    assert not ends(found, "free").any() and found.fields.section == [] and len(found.vertices) == 0
    assert found.warnings == ["the poses within the limits are not a solid: they are a single pose"]


def test_a_pose_that_others_at_zero_do_not_allow_is_none(stage):
    """Single stacks turn the platform one way; a moment the other way takes it off zero."""
    found = reach(
        with_actuators(stage, {"pair": False, "preload": 4.0}), np.array([0.0, 0.0, 30.0])
    )
    assert np.isnan(ends(found, "zero")[0]).all() and ends(found, "free")[0, 1] > 20.0
    assert found.fields.section == [] and found.circle == 0.0


def test_a_set_of_too_many_vertices_says_how_far_it_misses_poses(stage, monkeypatch):
    soft = stage.replace(material=stage.material.model_copy(update={"yield_strength": 50.0}))
    poses = poses_of(soft)
    whole = polytope_of(poses, LEVER)
    monkeypatch.setattr("flexfem.paper.polytope.MOST", 20)
    part = polytope_of(poses, LEVER)
    beyond = np.max(whole.vertices * SCALE @ part.normals.T, axis=0) - part.supports
    assert whole.missed == 0 and 20 >= len(part.vertices) < len(whole.vertices)
    assert (
        part.missed * np.max(np.abs(part.vertices * SCALE))
        == pytest.approx(np.max(beyond), rel=1e-6)
        and part.missed > 0.01
    )


def test_round_off_is_no_radius_about_rest(stage):
    """A single stack a chain at rest stands at the shortest end of its stroke: nothing is left
    about it.
    """
    single = stage.actuator[0].model_copy(
        update={"pair": False, "ball_radius": None, "preload": 3.0}
    )
    for load in (NONE, LOAD, np.array([1.0, 0.0, 5.0])):
        found = reach(stage.replace(actuator=[single]), load)
        assert found.fields.dimension == 3 and found.ball == 0.0


def test_ranges_of_finite_elements_are_within_limits_of_their_own_forces(light):
    """Where contacts bind, forces by the model would let the metal go elsewhere."""
    found = reach(light, LOAD, "both", resolution=2, analytic=SIX)
    elements = driven_elements(light, 2).system
    first = commanding(ModelChoice(light, 6, DEFAULT_FORMULA, False))
    own, other = (
        PoseSet(elements, pose_set(first, of, LOAD).limits, LOAD).ranges()[0]
        for of in (elements, first.system)
    )
    np.testing.assert_allclose(found.at("ends", model=ELEMENTS), own, rtol=SOLVED)
    assert np.max(np.abs(own[1, 1] / other[1, 1] - 1)) > 1e-4


def test_the_figure_draws_the_section_and_the_faces_by_their_limits(light):
    found = reach(light, LOAD)
    figure = reach_figure(found)
    section, solid = figure.axes[:2]
    drawn = {
        each.get_label(): each for each in section.collections if isinstance(each, LineCollection)
    }
    assert set(drawn) == {"stroke", "stroke and contact"}
    for label, each in drawn.items():
        wanted = [
            [e.start, e.end] for e in found.fields.section if " and ".join(e.by.kinds) == label
        ]
        np.testing.assert_allclose(each.get_segments(), 1e3 * np.array(wanted))
    of = found.fields
    ends = [solid.get_xlim(), solid.get_ylim(), solid.get_zlim()]
    np.testing.assert_allclose(
        ends, 1e3 * np.transpose([of.vertices.min(axis=0), of.vertices.max(axis=0)])
    )
