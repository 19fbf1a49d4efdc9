"""Limits of the range besides hinges: contact of parts, the stroke of a drive, and yield of bodies."""

import numpy as np
import pytest

import flexfem
from flexfem.analytic.paths import CONTACT, STROKE, YIELD, DrivenPlate
from flexfem.questions import ranges

E = 70_000.0
B = 9.0
T = 0.4
L = 37.0
STRENGTH = 400.0  # MPa, mm
# relative: a stage on two leaves also turns, by 2e-5 of its displacement per mm of its height
TILT = 3e-4
TURNED = 1e-6  # mm, of a corner on a line: a path finds its end to 1e-7
OF_BODIES = (
    0.06  # relative: bands of stress, and the lever of the force, which shortens as the arm bends
)
ARC = 2e-3  # relative: a stage on two leaves also moves along them, 0.6 x^2 / L


def guide(*others, strength=STRENGTH, actuator=(), at=(0.0, 0.0)):
    """A stage between two leaves along y under a fixed block, with more bodies."""
    leaf = {
        "between": ("block", "stage"),
        "direction": -np.pi / 2,
        "shape": "leaf",
        "neck": T,
        "length": L,
    }
    return flexfem.Mechanism(
        name="guide",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.29,
            "density": 2700.0,
            "yield_strength": strength,
        },
        body=[
            {"name": "stage", "outline": [(-15, -8), (15, -8), (15, 8), (-15, 8)]},
            {"name": "block", "outline": [(-20, 45), (20, 45), (20, 54), (-20, 54)], "fixed": True},
            *others,
        ],
        hinge=[{**leaf, "name": f"leaf {x}", "at": (x, 8 + L / 2)} for x in (-11, 11)],
        actuator=actuator,
        output={"body": "stage", "at": at},
    )


def stop(gap, name="stop", thickness=7.0):
    """A fixed body beside the stage, on its right."""
    left = 15 + gap
    outline = [(left, -5), (left + thickness, -5), (left + thickness, 3), (left, 3)]
    return {"name": name, "outline": outline, "fixed": True}


def end(mechanism, axis=0, sense=1.0):
    """End of a path by beams, whose linear range without limits is 2.6 mm."""
    return DrivenPlate(mechanism.layout).end(axis, (), sense * STRENGTH * L**2 / (3 * E * T))


@pytest.mark.parametrize("thickness", [7.0, 0.05], ids=["thick", "thin"])
def test_a_range_ends_where_the_stage_meets_a_stop(thickness):
    """Between two steps of the path, in this sense alone."""
    reached = end(guide(stop(0.83, thickness=thickness)))
    assert reached.kind == CONTACT
    assert reached.displacement == pytest.approx(0.83, rel=TILT)
    assert "'stage'" in reached.parts and "'stop'" in reached.parts
    away = end(guide(stop(0.83, thickness=thickness)), sense=-1.0)
    assert away.kind == YIELD and away.displacement < -2.0


def test_a_stage_that_turns_meets_the_corner_of_a_stop():
    """The right side of the stage, at 15 mm, meets the lower corner of the stop, at (15.02, -5) mm."""
    reached = end(guide(stop(0.02)), axis=2, sense=0.05)
    assert reached.kind == CONTACT
    x, y, turn = reached.at.motions[:3]
    along = (-5 - y - 15 * np.sin(turn)) / np.cos(
        turn
    )  # on the right side of the stage, from its middle
    assert turn > 1e-4
    assert x + 15 * np.cos(turn) - along * np.sin(turn) == pytest.approx(15.02, abs=TURNED)


def test_a_leaf_that_bends_meets_a_post_beside_it():
    """A guided leaf moves by half of the stage's displacement at its middle, where a post is 0.6 mm
    from it.
    """
    post = {"name": "post", "outline": [(11.8, 26), (13, 26), (13, 27), (11.8, 27)], "fixed": True}
    reached = end(guide(post))
    assert reached.kind == CONTACT and "'leaf 11'" in reached.parts
    place = (45 - 26.0) / L  # of the lower edge of the post along the leaf, from its fixed end
    assert reached.displacement * place**2 * (3 - 2 * place) == pytest.approx(0.6, rel=0.01)


def test_the_stroke_of_a_drive_ends_a_range_in_its_sense_alone():
    drive = {
        "name": "push",
        "between": ("wall", "stage"),
        "at": [(-30, 2), (-15, 2)],
        "stroke": 0.13,
        "stiffness": 500,
    }
    wall = {"name": "wall", "outline": [(-40, -5), (-30, -5), (-30, 5), (-40, 5)], "fixed": True}
    driven = guide(wall, actuator=[drive])
    reached = end(driven)
    assert (reached.kind, reached.parts) == (STROKE, "'push'")
    assert reached.displacement == pytest.approx(0.13, rel=ARC)
    assert end(driven, sense=-1.0).kind == YIELD


def test_stiffness_names_the_limits_in_its_table_its_values_and_its_notes():
    found = flexfem.stiffness(guide(stop(0.83)), models="analytic")
    place = {"direction": "x", "others": "free"}
    assert found.at("range", sense="positive", **place) == pytest.approx(0.83, rel=TILT)
    assert found.at("range_limit", sense="positive", limit="contact", **place) == 1
    assert found.at("range_limit", sense="negative", limit="yield of a hinge", **place) == 1
    np.testing.assert_array_equal(np.sum(found.range_limit, axis=2), 1)
    assert any(
        "+x (others free)" in note and "contact of 'stage' and 'stop'" in note
        for note in found.notes
    )
    cells = [cell for table in found.tables() for row in table.rows for cell in row]
    assert any("contact" in cell for cell in cells)


@pytest.mark.slow
def test_finite_elements_meet_a_stop_where_it_is_drawn_and_the_others_see_no_stop():
    found = flexfem.stiffness(guide(stop(0.83)), models="elements", resolution=4)
    place = {"direction": "x", "others": "free"}
    distance = abs(float(found.at("range", sense="positive", **place)) - 0.83)
    assert distance < float(found.band("range", sense="positive", **place)) < 0.02
    assert found.at("range_limit", sense="positive", limit="contact", **place) == 1
    assert found.at("range", sense="negative", **place) < -2.0


@pytest.mark.slow
@pytest.mark.parametrize("strength", [8.0, 350.0], ids=["linear", "finite"])
def test_a_slender_body_yields_before_its_hinge_at_the_bending_stress_of_its_neck(strength):
    """A force at the end of a body that is 1.2 mm wide 40 mm before it: `sigma = 6 F l / (b h^2)`;
    the hinge is 3 mm.

    The width grows by 0.1 per mm on both sides of the neck, so that the stress of a beam holds.
    """
    upper = [(60, 3), (30, 3), (12, 0.6), (8, 0.6), (0, 1.6)]
    body = [(x, -y) for x, y in reversed(upper)] + upper
    one = flexfem.Mechanism(
        name="slender body",
        model="plane_stress",
        thickness=B,
        material={
            "name": "m",
            "youngs_modulus": E,
            "poissons_ratio": 0.29,
            "density": 2700.0,
            "yield_strength": strength,
        },
        body=[
            {"name": "block", "outline": [(-20, -9), (-6, -9), (-6, 9), (-20, 9)], "fixed": True},
            {"name": "arm", "outline": body},
        ],
        hinge=[
            {
                "name": "root",
                "between": ("block", "arm"),
                "at": (-3, 0),
                "direction": 0.0,
                "shape": "leaf",
                "neck": 3.0,
                "length": 6.0,
            }
        ],
        output={"body": "arm", "at": (50.0, 0.0), "contact": 2.0},
    )
    found = flexfem.stiffness(one, models="elements", resolution=4)
    place = {"direction": "y", "others": "free", "sense": "positive"}
    assert found.at("range_limit", limit="yield of a body", **place) == 1
    force = float(found.at("range_force", **place))
    assert force == pytest.approx(strength * B * 1.2**2 / 6 / 42, rel=OF_BODIES)
    assert any("yield of body 'arm'" in note for note in found.notes)


@pytest.mark.slow
def test_finite_elements_follow_the_path_on_which_leaves_bow(monkeypatch):
    """A free turn of this guide bows its leaves under a moment that hardly grows, far below that of
    linear theory, which is nearly that of the unstable path on which they stay straight.
    """
    guide = "geometry/double-parallelogram.toml"
    found = flexfem.stiffness(flexfem.load(guide))
    beams = flexfem.stiffness(flexfem.load(guide), models="analytic")
    place = {"others": "free", "direction": "theta", "sense": "positive"}
    assert found.at("range", **place) == pytest.approx(
        beams.at("range", **place), abs=float(found.band("range", **place))
    )
    moment = found.at("range_force", **place)
    assert moment == pytest.approx(beams.at("range_force", **place), rel=0.1)
    straight = found.at("free", direction="theta")[-1] * found.at("range", **place)
    assert moment < 0.3 * straight
    monkeypatch.setattr(ranges, "STEPS_TO_BUCKLING", (1,))  # which leads to the unstable path
    lost = flexfem.stiffness(flexfem.load(guide))
    assert np.isnan(lost.at("range", **place))
    assert any("theta (others free): not known" in note for note in lost.notes)
