"""The mechanism file of a plate that was found in a drawing: the same plate, and one number for
equal parts.
"""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

import flexfem as api
from flexfem.importing.drawings import assembled, report_of
from flexfem.importing.outline import outline_rows, placed_vertices, vertices_of
from flexfem.importing.roles import Wishes
from flexfem.importing.write import Heading
from flexfem.mechanism.outlines import Segment, rounded
from flexfem.mechanism.plate import body_polygon
from flexfem.refused import BadInput

from .plates import found_plate

SAME = 1e-8  # relative, of the analytic model: written numbers have nine decimals
HEADING = Heading("part", 10.0, "al-7075-t6", {"thickness_mm": "stated with the import"})
# a stage between leaves of unequal lengths, turned by 30 degrees; fillets and a hole in the bodies
LEAVES = {
    "name": "turned guide",
    "thickness_mm": 8.0,
    "material": {"name": "al-7075-t6"},
    "body": [
        {
            "name": "base",
            "fixed": True,
            "outline_mm": [[-30.0, -9.0], [31.0, -9.0, 2.5], [31.0, 0.0], [-30.0, 0.0]],
            "holes": [{"centre_mm": [3.0, -5.0], "radius_mm": 1.7}],
        },
        {
            "name": "table",
            "outline_mm": [[-22.0, 21.0], [24.0, 21.0], [24.0, 33.0], [-22.0, 33.0, 4.0]],
        },
    ],
    "hinge": [
        {"name": "one", "between": ["base", "table"], "at_mm": [-15.0, 10.5], "direction_deg": 90.0}
        | {"shape": "leaf", "length_mm": 21.0, "neck_mm": 0.37, "fillet_mm": 0.6},
        {"name": "two", "between": ["base", "table"], "at_mm": [17.0, 10.5], "direction_deg": 90.0}
        | {"shape": "leaf", "length_mm": 21.0, "neck_mm": 0.37, "fillet_mm": 0.6},
    ],
    "output": {"body": "table", "at_mm": [1.0, 27.0]},
}


def turned(content, degrees):
    """The same file with all points turned about the origin."""
    cosine = math.cos(math.radians(degrees))
    sine = math.sin(math.radians(degrees))

    def point(row):
        return [cosine * row[0] - sine * row[1], sine * row[0] + cosine * row[1], *row[2:]]

    made = dict(content)
    made["body"] = [
        body
        | {"outline_mm": [point(row) for row in body["outline_mm"]]}
        | {
            "holes": [
                hole | {"centre_mm": point(hole["centre_mm"])} for hole in body.get("holes", [])
            ]
        }
        for body in content["body"]
    ]
    made["hinge"] = [
        hinge | {"at_mm": point(hinge["at_mm"]), "direction_deg": hinge["direction_deg"] + degrees}
        for hinge in content["hinge"]
    ]
    made["output"] = content["output"] | {"at_mm": point(content["output"]["at_mm"])}
    return made


def of_file(mechanism):
    """The plate of a mechanism, with its ground and output stated as points."""
    plate = found_plate(mechanism.layout)
    output = mechanism.layout.points[0][1]
    fixed = [k for k, body in enumerate(mechanism.layout.bodies) if body.fixed]
    inside = [body_polygon(mechanism.layout, k).representative_point() for k in fixed]
    ground = tuple(complex(point.x, point.y) for point in inside)
    heading = HEADING._replace(thickness=float(mechanism.thickness))
    return assembled(plate, Wishes(ground, output=output.point), heading)


def same(stiffness, reference):
    """Whether two stiffness matrices are equal, relative to the geometric mean of the diagonal
    terms.
    """
    own = np.sqrt(np.diagonal(reference, axis1=-2, axis2=-1))
    return np.all(np.abs(stiffness - reference) <= SAME * own[..., None] * own[..., None, :])


def stiffness_of(mechanism):
    return api.stiffness(mechanism, models="analytic").at("stiffness")


@pytest.mark.slow
def test_a_turned_guide_is_written_exactly_and_stays_closed_when_a_leaf_changes():
    mechanism = api.MechanismFile.model_validate(turned(LEAVES, 30.0))
    plate = of_file(mechanism)
    assert plate.off.area < 1e-7 and plate.off.largest < 1e-4  # polygons follow arcs within 4e-6 mm
    written = plate.mechanism
    assert dict(written.parameters) == {"length_mm": 21.0, "neck_mm": 0.37, "fillet_mm": 0.6}
    assert [hinge.name for hinge in written.hinge] == ["leaf"] and len(written.layout.joints) == 2
    assert same(stiffness_of(written), stiffness_of(mechanism))
    written.replace(parameters={"length_mm": 18.0})  # refuses a leaf that ends before its bodies
    longer = written.replace(parameters={"length_mm": 25.0, "neck_mm": 0.41})
    along = np.array([math.cos(math.radians(30)), math.sin(math.radians(30))])
    compliance = np.linalg.inv(stiffness_of(longer)[0])[:2, :2]
    before = np.linalg.inv(stiffness_of(written)[0])[:2, :2]
    ratio = (along @ compliance @ along) / (along @ before @ along)
    # leaves bend as fixed-guided beams between their fillets, (length - 2 fillet)^3 / neck^3;
    # fillets add 1 %
    assert ratio == pytest.approx((23.8 / 19.8) ** 3 / (0.41 / 0.37) ** 3, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["parallelogram", "xy-stage", "lever-amplifier", "rhombic-amplifier"]
)
def test_a_shipped_mechanism_is_written_with_one_number_for_equal_parts(kind):
    mechanism = api.load(f"geometry/{kind}.toml")
    plate = of_file(mechanism)
    assert plate.off.area < 1e-6 and plate.off.largest < 1e-3
    assert same(stiffness_of(plate.mechanism), stiffness_of(mechanism))
    for key, value in plate.mechanism.parameters.items():
        for factor in (0.93, 1.06):
            plate.mechanism.replace(
                parameters={key: factor * value}
            )  # refuses a plate that is torn


def test_an_xy_stage_is_written_as_a_person_would():
    plate = of_file(api.load("geometry/xy-stage.toml"))
    written = plate.mechanism
    assert dict(written.parameters) == {"length_mm": 17.0, "neck_mm": 0.4, "fillet_mm": 0.5}
    assert [body.name for body in written.body] == ["ground", "stage", "link"]
    assert [hinge.name for hinge in written.hinge] == ["leaf a", "leaf b"]
    assert [copies.count for copies in written.copies] == [None, None, 4]
    reference = api.load("geometry/xy-stage.toml").replace(parameters={"neck_mm": 0.44})
    thicker = written.replace(parameters={"neck_mm": 0.44})
    assert same(stiffness_of(thicker), stiffness_of(reference))
    assert written.not_stated == () and [key for key in written.assumed if "output" in key] == []
    assert "read from part.dxf" in plate.written.text
    report = report_of(plate, None)
    assert {hinge.length_mm for hinge in report.hinges} == {17.0} and len(report.hinges) == 24


@pytest.mark.slow
def test_names_of_the_report_are_those_of_the_written_copies():
    """By place: the name of a hinge in the table is that of the hinge at the same place in the
    file.
    """
    plate = of_file(api.load("geometry/xy-stage.toml"))
    places = {joint.name: joint.place for joint in plate.mechanism.layout.joints}
    for name, hinge in zip(plate.written.names.hinges, plate.found.hinges, strict=True):
        assert abs(places[name] - hinge.place) < 1e-9, name


def test_arcs_and_fillets_are_written_as_they_are_drawn():
    corners = [0j, 30 + 0j, 30 + 20j, 20j]
    radii = [0.0, 0.0, 0.0, 3.5]
    bows = [0.0, 4.2, 0.0, 0.0]
    loop = rounded(corners, radii, bows).loop
    rows = outline_rows(placed_vertices(vertices_of(loop, ()), []))
    assert len(rows) == 4
    for corner, radius, bow in zip(corners, radii, bows, strict=True):
        (row,) = [[*row, 0.0, 0.0][:4] for row in rows if abs(complex(*row[:2]) - corner) < 1e-9]
        assert row[2:] == pytest.approx([radius, bow], abs=1e-9)


def test_lines_that_continue_are_one_edge():
    loop = [
        Segment(0j, 4 + 0j),
        Segment(4 + 0j, 10 + 0j),
        Segment(10 + 0j, 10 + 5j),
        Segment(10 + 5j, 0j),
    ]
    assert [vertex.point for vertex in vertices_of(loop, ())] == [0j, 10 + 0j, 10 + 5j]
    begun_inside = [*loop[1:], loop[0]]
    assert {vertex.point for vertex in vertices_of(begun_inside, ())} == {0j, 10 + 0j, 10 + 5j}


def test_hinges_that_differ_by_more_than_a_micrometre_have_numbers_of_their_own():
    layout = api.load("geometry/parallelogram.toml").layout
    plate = found_plate(layout)
    first, second = plate.hinges
    other = second._replace(dimensions=second.dimensions | {"neck": 0.503})
    made = assembled(plate._replace(hinges=(first, other)), Wishes(), HEADING)
    stated = dict(made.mechanism.parameters)
    assert (stated["leaf_1_neck_mm"], stated["leaf_2_neck_mm"]) == (0.5, 0.503)
    assert made.off.largest == pytest.approx(
        1.5e-3, rel=0.05
    )  # half of the difference of the necks
    assert "off the drawing by up to 1.5 um" in made.warnings[0]


def test_a_table_is_read_from_the_other_end_where_the_ground_is_there():
    mechanism = api.MechanismFile.model_validate(
        LEAVES
        | {
            "hinge": [
                {
                    "name": "one",
                    "between": ["table", "base"],
                    "at_mm": [-15.0, 10.5],
                    "direction_deg": -90.0,
                }
                | {"shape": "profile", "table_mm": [[0, 2.0], [3, 0.5], [8, 0.9], [21, 3.0]]},
                {
                    "name": "two",
                    "between": ["base", "table"],
                    "at_mm": [17.0, 10.5],
                    "direction_deg": 90.0,
                }
                | {"shape": "profile", "table_mm": [[0, 3.0], [13, 0.9], [18, 0.5], [21, 2.0]]},
            ]
        }
    )
    made = of_file(mechanism)
    assert made.off.largest < 1e-4
    assert same(stiffness_of(made.mechanism), stiffness_of(mechanism))


def test_a_fillet_cannot_be_clamped():
    layout = api.MechanismFile.model_validate(LEAVES).layout
    body = layout.bodies[0]
    arc = next(segment for segment in body.outline if segment.centre is not None)
    with pytest.raises(BadInput, match="this is a fillet"):
        assembled(found_plate(layout), Wishes((complex(arc.at(0.5)),)), HEADING)


def test_the_text_is_plain_toml_with_a_source_for_every_number():
    text = of_file(api.load("geometry/lever-amplifier.toml")).written.text
    content = tomllib.loads(text)
    assert set(content["provenance"]) >= {"thickness_mm", "parameters", "body", "hinge", "output"}
    assert all(len(line) <= 120 for line in text.splitlines())
