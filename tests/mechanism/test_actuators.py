"""Actuators: the catalogue, contacts by Hertz, what a file may not say, and where the stacks of a
pair are.
"""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.mechanism.actuators import catalogue
from flexfem.paper.actuators import Actuator, hertz
from flexfem.paper.drives import contacts, drive_of
from flexfem.paper.stage import Stage, load_feasible
from flexfem.questions.driven import DriveSystem
from flexfem.refused import BadInput

BASE = {
    "name": "base",
    "between": ("frame", "link 1"),
    "point": (44.0, -36.5),
    "direction": np.pi / 2,
    "pair": True,
}
ANY = {**BASE, "stack": "AE0505D16"}


@pytest.fixture
def stage(project) -> Stage:
    return load_feasible(project.path("geometry/mobility6.toml"))


def test_the_catalogue_holds_the_stacks_of_the_data_sheet():
    sheet = {
        "AE0203D04": (4.6, 1.5, 237),
        "AE0203D08": (9.1, 1.5, 235),
        "AE0203D16": (17.4, 2.0, 224),
        "AE0203D44H40": (42.0, 6.6, 271),
        "AE0505D08": (9.1, 1.5, 978),
        "AE0505D16": (17.4, 2.0, 935),
    }
    assert list(catalogue()) == list(sheet)
    found = [
        (1e3 * each.stroke, 1e3 * each.tolerance, each.blocking_force)
        for each in catalogue().values()
    ]
    np.testing.assert_allclose(found, list(sheet.values()), rtol=1e-12)
    assert all(each.source for each in catalogue().values())


def test_a_preload_of_the_blocking_force_itself_is_borne(stage):
    """17.4 um times 50 N/um is 870 N, in floating point a little less; nothing is left to push
    harder with.
    """
    full = BASE | {"pair": False, "stroke": 17.4e-3, "stiffness": 50e3}
    assert 869.9999999 < Actuator(**full).rating.blocking_force < 870.0
    drive = drive_of(stage.replace(actuator=[full | {"preload": 870.0}]))
    _, contact, blocking = DriveSystem(np.eye(6), np.eye(3), drive).limits(np.zeros(3)).values()
    np.testing.assert_array_equal([contact.sizes, blocking.sizes], [[870.0] * 3, [0.0] * 3])
    with pytest.raises(BadInput, match="at most the blocking force of the stack, 870"):
        Actuator(**full, preload=870.00001)


def test_a_steel_ball_on_aluminium_by_hertz():
    steel = (206e3, 0.3)
    aluminium = (71.7e3, 0.33)
    assert hertz(2.0, 50.0, steel, aluminium) == pytest.approx(12.835e3, rel=1e-4)  # N/mm, by hand
    approach = (9 * 50.0**2 / (16 * 2.0 * 59362.0**2)) ** (1 / 3)
    assert hertz(2.0, 50.0, steel, aluminium) == pytest.approx(
        1.5 * 50.0 / approach, rel=1e-4
    )  # F ~ approach^3/2


def test_stack_and_contact_are_in_series_and_without_one_it_is_the_stack(stage):
    assert drive_of(
        stage.replace(actuator=[ANY | {"contact_stiffness": 1e4}])
    ).stiffness == pytest.approx(8.4309e3, rel=1e-4)
    assert drive_of(stage.replace(actuator=[ANY])).stiffness == pytest.approx(53.736e3, rel=1e-4)


@pytest.mark.parametrize(
    ("loose", "stiffness"), [(None, 10.36e3), (False, 10.36e3), (True, 6.79e3)]
)
def test_a_loose_ball_has_two_contacts_in_series_and_what_is_assumed_of_it_is_said(
    stage, loose, stiffness
):
    """53.74 N/um of the stack, 12.84 on aluminium, and 19.74 on a steel end: (6 R E*^2 F)^(1/3), E*
    = 113.2 GPa.
    """
    drawn = Actuator(**ANY, ball_radius=2.0, preload=50.0, ball_loose=loose)
    behind = (6 * 2.0 * (206e3 / (2 * (1 - 0.3**2))) ** 2 * 50.0) ** (1 / 3)
    exact = 1 / (1 / 53.736e3 + 1 / 12.835e3 + (1 / behind if loose else 0.0))
    assert exact == pytest.approx(stiffness, rel=1e-3)
    driven = stage.replace(actuator=[drawn])
    assert drive_of(driven).stiffness == pytest.approx([exact] * 6, rel=1e-4)
    unsaid = stage.replace(actuator=[drawn.model_copy(update={"ball_loose": None})])
    assert (driven.drive_hash == unsaid.drive_hash) == (not loose)
    said = {
        None: ["steel", "fixed to the stack"],
        False: ["steel"],
        True: ["steel", "steel end of the stack"],
    }[loose]
    with pytest.raises(BadInput, match=r"^Actuator: ball_radius = 2\.0, expected also a preload_n"):
        drawn.model_copy(update={"preload": 0.0})
    of_balls = [key for key in driven.drive_assumptions.assumed if "ball (" in key]
    assert of_balls == [f"actuator.base.ball ({each})" for each in said]


STACK = 'stack = "AE0505D16"                       # 17.4'
LINK = 'hinge = "base"\narm_mm = 10.0 '
SIDE = 'side = "left"'
ANYWHERE = (SIDE, "#")
BAD = [  # edits of the first actuator, what is said, what is named
    (
        [(LINK, "point_mm = [44.0, -35.0]\ndirection_deg = 90.0 #"), ANYWHERE],
        "contact off the body",
        "[44, -36.5]",
    ),
    (
        [(LINK, "point_mm = [54.0, -36.5]\ndirection_deg = 90.0 #"), ANYWHERE],
        "contact off the body",
        "of chain 1",
    ),
    (
        [(LINK, "point_mm = [44.0, -36.5]\ndirection_deg = 270.0 #"), ANYWHERE],
        "not directed into",
        "of 90",
    ),
    (
        [(LINK, "point_mm = [44.0, -36.5]\ndirection_deg = 0.0 #"), ANYWHERE],
        "not directed into",
        "84 degrees",
    ),
    (
        [(LINK, "point_mm = [44.0, -36.5]\ndirection_deg = 90.0 #")],
        "one of hinge with arm_mm with side",
        "side",
    ),
    (
        [(LINK, "point_mm = [44.0, -36.5] #"), ANYWHERE],
        "or point_mm with direction_deg",
        "one of hinge",
    ),
    ([(LINK, 'hinge = "base"\narm_mm = 4.0 #')], "contact off the link", "between 4 and 28.5"),
    ([(LINK, 'hinge = "base"\narm_mm = 28.5 #')], "contact off the link", "arm_mm = 28.5"),
    (
        [(LINK, 'hinge = "platform"\narm_mm = 10.0 #')],
        "base or elbow, at an end of link 1",
        "hinge",
    ),
    ([(LINK, 'hinge = "base" #')], "hinge with arm_mm with side", "one of"),
    ([(SIDE, 'side = "left"\ntilt_deg = 85.0 #')], "tilt_deg = 85.0", "<= 80"),
    ([('["frame", "link 1"]', '["frame", "platform"]')], "point_mm on a platform", "hinge"),
    ([('["frame", "link 1"]', '["link 1", "link 1"]')], "two bodies", "link 1"),
    ([('["frame", "link 1"]', '["link 1", "frame"]')], "a moving body in second place", "frame"),
    ([(STACK, 'stack = "AE0505D61" #')], "did you mean AE0505D16?", "stack"),
    (
        [(STACK, "stroke_um = 17.4 #")],
        "stroke_um with stiffness_n_per_um",
        "stroke_um with blocking_force_n",
    ),
    ([(STACK, "#")], "one of stack, or", "actuator.base"),
    (
        [(STACK, 'stack = "AE0505D16"\nblocking_force_n = 900.0 #')],
        "one of stack, or",
        "blocking_force_n = 900.0",
    ),
    (
        [("preload_n = 50.0", "preload_n = 936.0")],
        "preload_n = 936.0",
        "blocking force of the stack, 935",
    ),
    ([("preload_n = 50.0", "preload_n = 0.0")], "a ball without preload", "ball_radius_mm"),
    (
        [("ball_radius_mm = 2.0", "ball_radius_mm = 2.0\ncontact_stiffness_n_per_um = 9")],
        "not both",
        "contact_stiff",
    ),
    (
        [("ball_radius_mm = 2.0", "ball_poissons_ratio = 0.3")],
        "also ball_radius_mm",
        "ball_poissons_ratio",
    ),
    ([("ball_radius_mm = 2.0", "ball_loose = false")], "also ball_radius_mm", "ball_loose"),
    ([('name = "base"', 'name = "elbow"')], "no other actuator", "actuator[1].name"),
]


OWN = '[[override]]\nchain = 2\nactuator = "base"\n'
BAD_OVERRIDES = [  # what is added, what is said
    (
        OWN.replace('"base"', '"bass"') + "preload_n = 40.0\n",
        "an actuator of this stage, did you mean base?",
    ),
    (OWN, "expected at least one of stack, stroke_um"),
    (
        OWN + "preload_n = 936.0\n",
        "override.2.actuator.base.preload_n = 936.0, expected at most the blocking force",
    ),
    (OWN + "preload_n = 0.0\n", "a ball without preload has no stiffness"),
    (OWN + "stroke_um = 9.0\n", "override.2.actuator.base.stroke_um = 9.0, expected one of stack"),
    (OWN + "arm_mm = 29.0\n", "override.2.actuator.base.arm_mm = 29, contact off the link"),
    (
        OWN + "neck_mm = 0.4\n",
        "override.2.actuator.base.neck_mm = 0.4, expected with an actuator only stack, stroke_um",
    ),
    (OWN + 'hinge = "base"\npreload_n = 40.0\n', "either a hinge or an actuator"),
    ("[[override]]\nchain = 2\nneck_mm = 0.4\n", "either a hinge or an actuator"),
    (OWN + "preload_n = 40.0\n" + OWN + "arm_mm = 11.0\n", "one override for each actuator"),
    ('[[override]]\nchain = 2\nhinge = "base"\npreload_n = 40.0\n', "with a hinge only radius_mm"),
]
BAD += [
    ([("[provenance]", added + "\n[provenance]")], said, "expected")
    for added, said in BAD_OVERRIDES
]


@pytest.mark.parametrize(("edits", "said", "also"), BAD)
def test_a_bad_actuator_or_override_of_one_is_refused_in_one_line(project, edits, said, also):
    path = project.path("geometry/mobility6.toml")
    text = "".join(
        line for line in path.read_text().splitlines(True) if not line.startswith('"actuator.')
    )
    begin = text[: text.index("[[actuator]]")].count("\n") + 1
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    with pytest.raises(BadInput) as refused:
        load_feasible(path)
    line = str(refused.value)
    assert said in line and also in line and "\n" not in line and line.startswith(f"{path}, line ")
    if edits[0][0] != "[provenance]":
        assert (
            0 <= int(line.split("line ")[1].split(":")[0]) - begin <= 14
        )  # in that table, or the name of the next


def test_the_partner_of_a_pair_pushes_back_from_the_opposite_side(stage):
    first, partner = contacts(stage, 1, 0)
    assert (first.point, partner.point) == pytest.approx(
        (44 - 36.5j, 44 - 27.5j)
    )  # 10 mm from the neck at 54, -32
    assert first.direction == pytest.approx(1j)
    assert contacts(stage, 1, 1)[0].point == pytest.approx(
        34 - 36.5j
    )  # 10 mm from the elbow at 24, -32
    oblique = stage.replace(actuator=[ANY | {"direction": np.deg2rad(60.0)}])
    partner = contacts(oblique, 1, 0)[1]
    assert partner.point == pytest.approx(44 + 9 / np.tan(np.deg2rad(60.0)) - 27.5j)
    tilted = stage.replace(
        actuator=[stage.actuator[0].model_copy(update={"tilt": np.deg2rad(-30.0)})]
    )
    for ours, theirs in zip(contacts(tilted, 1, 0), contacts(oblique, 1, 0), strict=True):
        assert ours.point == pytest.approx(theirs.point)
        assert ours.direction == pytest.approx(theirs.direction)
    for stacks in (drive_of(stage).stacks, drive_of(oblique).stacks):
        first, partner = stacks[:2]
        np.testing.assert_allclose(
            first.pushes[0].wrench, -partner.pushes[0].wrench, atol=1e-12
        )  # one line of action
        np.testing.assert_allclose(first.pushes[0].wrench, -first.pushes[1].wrench)


def test_a_pair_is_commanded_about_the_middle_of_its_strokes(stage):
    drive = drive_of(stage)
    np.testing.assert_allclose(drive.lowest, -8.7e-3)  # half of 17.4 um on either side
    np.testing.assert_allclose(drive.highest, 8.7e-3)
    np.testing.assert_array_equal(drive.differential[:, 0], [1, -1, *[0] * 10])
    single = drive_of(stage.replace(actuator=[ANY | {"pair": False}]))
    np.testing.assert_allclose([single.lowest, single.highest], [[0] * 3, [17.4e-3] * 3])
    np.testing.assert_array_equal(single.differential, np.eye(3))


def test_a_contact_on_the_platform_may_be_anywhere_on_its_rim(stage):
    angle = np.deg2rad(100.0)
    point = 17.0 * np.exp(1j * angle)
    pushed = {"name": "rim", "between": ("frame", "platform"), "point": (point.real, point.imag)}
    made = stage.replace(actuator=[pushed | {"direction": angle + np.pi, "stack": "AE0505D16"}])
    np.testing.assert_allclose(
        drive_of(made).stacks[0].pushes[0].wrench,
        [*-np.array([np.cos(angle), np.sin(angle)]), 0.0],
        atol=1e-12,
    )
    with pytest.raises(BadInput, match="off the body"):
        stage.replace(
            actuator=[pushed | {"point": (10.0, 0.0), "direction": np.pi, "stack": "AE0505D16"}]
        )


def test_the_drive_has_a_hash_of_its_own(stage):
    passive = stage.replace(actuator=[])
    assert (
        stage.hash
        == passive.hash
        == "24fed7d518c264d804800da3529cf37373256a769eb952f271886cb679a3b011"
    )
    hashes = {passive.drive_hash, stage.drive_hash, stage.replace(neck=0.49).drive_hash}
    changes = {
        "between": ("link 2", "link 1"),
        "arm": 11.0,
        "hinge": "elbow",
        "side": "right",
        "tilt": 0.1,
    }
    changes |= {"pair": False, "stack": "AE0203D16", "preload": 20.0}
    changes |= {"ball_radius": 1.0, "ball_youngs_modulus": 3e5, "ball_poissons_ratio": 0.2}
    for key, value in changes.items():
        first = stage.actuator[0].model_copy(update={key: value})
        hashes.add(stage.replace(actuator=[first, stage.actuator[1]]).drive_hash)
    assert len(hashes) == 3 + len(changes)
    renamed = stage.actuator[0].model_copy(update={"name": "other"})
    assert stage.replace(actuator=[renamed, stage.actuator[1]]).drive_hash == stage.drive_hash
    with pytest.raises(BadInput, match=r"no \[\[actuator\]\]"):
        drive_of(passive)


def test_an_override_changes_the_actuator_of_its_chain_and_no_other(project, stage, tmp_path):
    path = project.path("geometry/mobility6.toml")
    path.write_text(
        path.read_text().replace(
            "[provenance]", OWN + "preload_n = 40.0\narm_mm = 12.0\n\n[provenance]"
        )
    )
    own = load_feasible(path)
    found = drive_of(own)
    before = drive_of(stage)
    np.testing.assert_array_equal(found.preload, [50, 50, 50, 50, 40, 40, *[50] * 6])
    assert (
        found.stiffness[4] < found.stiffness[0] == before.stiffness[0]
    )  # the ball of less force is softer
    first = [contacts(own, chain, 0)[0].point for chain in (1, 2, 3)]
    assert first == pytest.approx([44 - 36.5j, 42 - 36.5j, 44 - 36.5j])
    assert own.hash == stage.hash
    assert own.drive_hash != stage.drive_hash
    in_python = stage.replace(override={(2, "actuator", "base"): {"preload": 40.0, "arm": 12.0}})
    named = stage.replace(actuator={"base": {"preload": 40.0}})
    assert [each.preload for each in named.actuator] == [40.0, stage.actuator[1].preload]
    assert in_python.drive_hash == own.drive_hash
    own.save(tmp_path / "copy.toml")
    assert load_feasible(tmp_path / "copy.toml") == own
    assert "override.2.actuator.base.preload_n" in own.drive_assumptions.not_stated
    assert not any("actuator" in key for key in own.not_stated)
