"""Ground, output and actuators of a plate that was found in a drawing: stated, marked, else by a
stated rule.
"""

from __future__ import annotations

import pytest

import flexfem as api
from flexfem.importing.drawings import Reading, assembled
from flexfem.importing.found import DrawnMark
from flexfem.importing.roles import Wishes, actuator_of, point_of, roles_of
from flexfem.importing.write import Heading
from flexfem.refused import BadInput

from .plates import found_plate

HEADING = Heading("part", 10.0, "al-7075-t6", {"thickness_mm": "stated with the import"})
CORNERS = [[0.0, 0.0], [40.0, 0.0], [40.0, 12.0], [0.0, 12.0]]
NOTCH = {"shape": "circular", "radius_mm": 3.0, "neck_mm": 0.6}
CHAIN = {  # three blocks in a row: screws in the first, the second is the largest
    "name": "chain",
    "thickness_mm": 10.0,
    "material": {"name": "al-7075-t6"},
    "body": [
        {
            "name": "block",
            "fixed": True,
            "outline_mm": [[-24.0, -5.0], [-4.0, -5.0], [-4.0, 5.0], [-24.0, 5.0]],
        }
        | {
            "holes": [
                {"centre_mm": [-18.0, 1.0], "radius_mm": 1.6},
                {"centre_mm": [-10.0, 1.0], "radius_mm": 1.6},
            ]
        },
        {"name": "arm", "outline_mm": [[2.0, -5.0], [40.0, -5.0], [40.0, 5.0], [2.0, 5.0]]},
        {"name": "tip", "outline_mm": [[46.0, -5.0], [60.0, -5.0], [60.0, 5.0], [46.0, 5.0]]},
    ],
    "hinge": [
        {"name": "first", "between": ["block", "arm"], "at_mm": [-1.0, 0.0], "direction_deg": 0.0}
        | NOTCH,
        {"name": "second", "between": ["arm", "tip"], "at_mm": [43.0, 0.0], "direction_deg": 0.0}
        | NOTCH,
    ],
    "output": {"body": "tip", "at_mm": [60.0, 0.0]},
}


@pytest.fixture(scope="module")
def chain():
    return found_plate(api.MechanismFile.model_validate(CHAIN).layout)


@pytest.fixture(scope="module")
def frame():
    return found_plate(api.load("geometry/xy-stage.toml").layout)


def test_without_marks_the_body_with_most_screws_is_ground_and_the_end_of_the_chain_the_output(
    chain,
):
    found = roles_of(chain, Wishes())
    assert (found.fixed, found.output) == ((0,), 2)
    assert found.at == pytest.approx(53.0 + 0j, abs=1e-3)
    assert found.sources["ground"].startswith("assumed: the body with the most round holes")
    assert found.sources["output"].startswith("assumed")


def test_a_frame_around_all_others_is_the_ground(frame):
    found = roles_of(frame, Wishes())
    assert (found.fixed, found.output) == ((0,), 1)
    assert found.sources["ground"] == "assumed: the body around all others is the ground"


def test_a_point_in_a_body_fixes_it_and_one_on_an_edge_clamps_the_edge(chain):
    inside = roles_of(chain, Wishes((20 + 0j,)))
    assert (inside.fixed, inside.clamped) == ((1,), {})
    on_edge = roles_of(chain, Wishes((-24.01 + 2j,)))
    assert on_edge.fixed == () and list(on_edge.clamped) == [0]
    segment = chain.bodies[0].outside[on_edge.clamped[0][0]]
    assert {segment.start.real, segment.end.real} == {-24.0}
    made = assembled(chain, Wishes((-24.01 + 2j,)), HEADING).mechanism
    body = next(each for each in made.layout.bodies if each.clamped)
    assert body.outline[body.clamped[0]].start.real == pytest.approx(-24.0)


def test_screw_holes_and_marks_fix_bodies(chain):
    assert roles_of(chain, Wishes(clamp_holes=True)).fixed == (0,)
    square = tuple(complex(*corner) for corner in [(46, -5), (60, -5), (60, 5), (46, 5)])
    marked = chain._replace(
        drawing=chain.drawing._replace(
            marks=(DrawnMark("2_Ground", square), DrawnMark("OUTPUT", (-17 + 0j,)))
        )
    )
    found = roles_of(marked, Wishes())
    assert (found.fixed, found.output, found.at) == ((2,), 0, -17 + 0j)
    assert found.sources["ground"] == "read from part.dxf, layer 2_Ground"


def test_an_edge_that_a_mark_clamps_is_clamped_in_the_file(chain):
    bodies = [body for body in chain.bodies]
    edge = next(k for k, segment in enumerate(bodies[2].outside) if segment.at(0.5) == 60 + 0j)
    bodies[2] = bodies[2]._replace(clamped=(edge,))
    found = roles_of(chain._replace(bodies=tuple(bodies)), Wishes())
    assert (found.fixed, found.clamped, found.output) == ((), {2: (edge,)}, 0)


def test_the_pose_of_the_output_may_be_read_elsewhere(chain):
    reading = Reading(output_at="50,0:0,-20")
    found = roles_of(chain, reading.wishes)
    assert (found.output, found.at) == (2, -20j)


def test_an_actuator_lies_between_two_points(chain):
    reading = Reading(ground=["-20,0"], output_at="50,0", actuator=["20,-25:20,-5,AE0203D16"])
    made = assembled(chain, reading.wishes, HEADING).mechanism
    (drive,) = made.layout.actuators
    assert drive.direction == pytest.approx(1j)
    assert made.actuator[0].between == ("ground", "link") and made.actuator[0].stack == "AE0203D16"
    assumed = assembled(chain, Reading(actuator=["20,-25:20,-5"]).wishes, HEADING).mechanism
    assert any("stack" in key for key in assumed.assumed)


@pytest.mark.parametrize(
    ("reading", "text"),
    [
        (Reading(ground=["300,0"]), "ground 300,0: 240 mm from the nearest body"),
        (
            Reading(output_at="0,90"),
            "output 0,90: 85.0 mm from the plate|output 0,90: 85 mm from the plate",
        ),
        (Reading(output_at="-20,0"), "output -20,0: this point is on the ground"),
        (Reading(ground=["1;2"]), 'ground "1;2", expected a point x,y in mm'),
        (Reading(actuator=["0,0"]), 'actuator "0,0", expected two points'),
        (Reading(actuator=["0,0:0,0"]), "two different points"),
        (Reading(actuator=["0,0:0,99"]), "actuator at 0,99: 94 mm from the plate"),
        (Reading(ground=["-20,0", "20,0", "50,0"]), "every body is ground"),
        (Reading(ground=["-20,0", "-24,0"]), "ground both in the body"),
    ],
)
def test_points_off_the_plate_and_other_texts_are_refused_in_one_line(chain, reading, text):
    with pytest.raises(BadInput, match=text):
        roles_of(chain, reading.wishes)


def test_a_plate_without_hinges_needs_an_edge(chain):
    block = chain._replace(bodies=chain.bodies[:1], hinges=())
    with pytest.raises(BadInput, match="no hinges were found, expected --ground X,Y"):
        roles_of(block, Wishes())
    found = roles_of(block, Wishes((-24 + 0j,)))
    assert list(found.clamped) == [0] and found.output == 0


def test_points_are_read_as_people_write_them():
    assert point_of("ground", " -1.5mm , 2e1 ") == -1.5 + 20j
    assert point_of("ground", (3, 4)) == 3 + 4j
    assert actuator_of("actuator", "1,2:3,4, AE0505D16") == (1 + 2j, 3 + 4j, "AE0505D16")
