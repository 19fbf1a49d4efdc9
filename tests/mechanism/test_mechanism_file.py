"""Mechanism files: what their expressions, outlines and copies resolve to, and what is refused in
which words.
"""

from __future__ import annotations

import copy
import pickle
import tomllib

import jsonschema
import numpy as np
import pytest

import flexfem
from flexfem.files.writing import toml_text
from flexfem.mechanism.mechanism_file import MechanismFile, load_mechanism
from flexfem.mechanism.outlines import area
from flexfem.refused import BadInput
from flexfem.schemas.of_files import schema_of
from flexfem.workshop import MECHANISMS

from ..conftest import ROOT

TEXT = """\
name = "an odd one"
thickness_mm = "2 * height"
material = {name = "al-6061-t6"}
output = {body = "hub", at_mm = [0, 1]}
payload = {mass_g = 250, inertia_kg_mm2 = 8}
[parameters]
height_mm = "length / 10 + tan(tilt)"
length_mm = 40
tilt_deg = 45
legs = 3
[[body]]
name = "frame"
outline_mm = [[-5, 60], [5, 60, "length / 20"], [5, 50], [-5, 50]]
clamped_edges = [1]
[[body]]
name = "hub"
centre_mm = [0, 0]
radius_mm = 9
holes = [{centre_mm = [1, 0], radius_mm = 2}, {outline_mm = [[-6, -1], [-3, -1], [-3, 1]]}]
[[body]]
name = "crank"
path_mm = [[0, 48], [0, 35, 10], [30, 35], [30, 25]]
width_mm = 6
[[hinge]]
name = "root"
between = ["frame", "crank"]
at_mm = [0, 49]
direction_deg = "-2 * tilt"
shape = "circular"
radius_mm = 1
neck_mm = 0.5
[[hinge]]
name = "tip"
between = ["crank", "hub"]
at_mm = [20, 16]
direction_deg = -90
shape = "leaf"
length_mm = 18
neck_mm = 0.4
cut_mm = 5
[[actuator]]
name = "push"
between = ["ground", "crank"]
at_mm = [[33, 55], [33, 30]]
stroke_um = 20
blocking_force_n = 400
mass_g = 5
[[copy]]
parts = ["crank", "root", "push"]
mirror_mm = [[-20, 0], [-20, 7]]
[[copy]]
parts = ["frame", "crank", "root"]
count = "legs"
about_mm = [10, 0]
"""
ODD = MechanismFile.model_validate(
    tomllib.loads(TEXT)
)  # its parts do not fit together, which its layout does not mind


def test_outlines_have_the_areas_of_elementary_geometry_and_numbers_are_in_inside_units():
    layout = ODD.layout
    frame, hub, crank, *_ = layout.bodies
    assert layout.thickness == 10.0
    assert area(frame.outline) == pytest.approx(100 - (1 - np.pi / 4) * 2**2, rel=1e-13)
    assert area(hub.outline) == pytest.approx(81 * np.pi, rel=1e-13)
    assert [area(hole) for hole in hub.holes] == pytest.approx([-4 * np.pi, -3.0], rel=1e-13)
    centreline = (
        13 - 10 + 10 * np.pi / 2 + 20 + 10
    )  # an arc and a mitre: area is width times centreline
    assert area(crank.outline) == pytest.approx(6 * centreline, rel=1e-13)
    assert all(
        a.end == b.start
        for a, b in zip(crank.outline, [*crank.outline[1:], crank.outline[0]], strict=True)
    )
    edge = frame.outline[frame.clamped[0]]
    assert {edge.start, edge.end} == {
        -5 + 60j,
        3 + 60j,
    }  # the first edge as stated, though it was stated clockwise
    assert [joint.cut for joint in layout.joints[:2]] == pytest.approx([1.02 * 6, 5.0])
    push, _ = layout.actuators
    (payload,) = layout.payloads
    assert (push.contacts[0].body, push.direction, push.stroke, push.stiffness) == (
        -1,
        -1j,
        0.02,
        20000.0,
    )
    assert (push.mass, payload.mass, payload.inertia) == pytest.approx((5e-6, 250e-6, 8e-3))
    assert push.contacts[1].radius == pytest.approx(np.hypot(36, 48 - 25) / 20)


def test_copies_are_turned_and_mirrored_and_hang_together():
    layout = ODD.layout
    names = [body.name for body in layout.bodies]
    assert names == ["frame", "hub", "crank", "crank 2", "frame 2", "crank 3", "frame 3", "crank 4"]
    joints = {joint.name: joint for joint in layout.joints}
    between = {name: tuple(names[k] for k in joint.bodies) for name, joint in joints.items()}
    assert between == {
        "root": ("frame", "crank"),
        "tip": ("crank", "hub"),
        "root 2": ("frame", "crank 2"),
        "root 3": ("frame 2", "crank 3"),
        "root 4": ("frame 3", "crank 4"),
    }
    third = np.exp(2j * np.pi / 3)
    assert joints["root 2"].place == pytest.approx(-40 + 49j) and joints[
        "root 3"
    ].place == pytest.approx(10 + third * (-10 + 49j))
    headings = [np.exp(1j * joints[name].heading) for name in ("root", "root 2", "root 3")]
    assert headings == pytest.approx([-1j, -1j, -1j * third])
    areas = [
        area(layout.bodies[names.index(name)].outline) for name in ("crank", "crank 2", "crank 4")
    ]
    assert areas == pytest.approx(areas[:1] * 3, rel=1e-13)
    turned = layout.bodies[names.index("frame 2")]
    held = turned.outline[turned.clamped[0]]
    ends = sorted([held.start, held.end], key=lambda z: abs(z - 10 - third * (-15 + 60j)))
    assert ends == pytest.approx([10 + third * (-15 + 60j), 10 + third * (-7 + 60j)])
    pushes = {each.name: each for each in layout.actuators}
    assert (
        pushes["push 2"].contacts[1].point == -73 + 30j and pushes["push 2"].contacts[1].body == 3
    )


def test_parameters_are_kept_written_and_changed(tmp_path):
    shipped = flexfem.load(ROOT / "geometry/parallelogram.toml")
    shipped.save(tmp_path / "same.toml")
    again = flexfem.load(tmp_path / "same.toml")
    assert again == shipped == pickle.loads(pickle.dumps(again)) and again.hash == shipped.hash
    longer = again.replace(parameters={"length_mm": 60.0}, hinge={"leaf": {"neck": 0.4}})
    assert [joint.profile.length for joint in longer.layout.joints] == [60.0, 60.0]
    assert longer.layout.joints[1].profile.neck == 0.4 and longer.layout.points[0][1].point == 65j
    assert (
        longer.hash != shipped.hash
        and longer.sources["parameters.length_mm"] == "replaced in Python"
    )
    assert "parameters.distance_mm" in shipped.assumed and shipped.not_stated == ()


MATERIAL = """\
[frame]
expansion_um_per_m_k = "4 * legs"
[material]
name = "cold"
youngs_modulus_gpa = "70 + 0.05 * below"
poissons_ratio = "1 / legs"
density_kg_m3 = 2700
yield_strength_mpa = 300
fatigue_strength_coefficient_mpa = 900
fatigue_strength_exponent = -0.1
fatigue_range_cycles = ["10**3", 1e6]
[parameters]
legs = 3
below = 100
"""


def test_numbers_of_the_material_are_expressions_in_mechanisms_and_not_in_stages(tmp_path):
    path = tmp_path / "cold.toml"
    text = (ROOT / "geometry/parallelogram.toml").read_text()
    path.write_text(text.replace('[material]\nname = "al-7075-t6"\n\n[parameters]\n', MATERIAL))
    cold = load_mechanism(path)
    assert cold.material.youngs_modulus == 75e3 and cold.material.poissons_ratio == 1 / 3
    assert cold.layout.youngs_modulus == 75e3 and cold.frame.expansion == pytest.approx(
        12e-6, rel=1e-12
    )
    assert cold.material.fatigue_range == (1e3, 1e6)
    colder = cold.replace(parameters={"below": 200.0})
    assert colder.material.youngs_modulus == 80e3 and colder.hash != cold.hash
    path.write_text(colder.to_toml())
    assert load_mechanism(path) == colder and '"70 + 0.05 * below"' in path.read_text()
    assert cold.replace(material={"youngs_modulus": 71e3}).material.poissons_ratio == 1 / 3
    stage = (ROOT / "geometry/mobility6.toml").read_text()
    path.write_text(stage.replace("modulus_gpa = 71.7", 'modulus_gpa = "71.7"'))
    with pytest.raises(BadInput, match=r'gpa = "71\.7", expected a number'):
        flexfem.load(path)


def test_a_mechanism_built_in_python_is_that_of_a_file():
    leaf = {
        "between": ["ground", "stage"],
        "direction": np.pi / 2,
        "shape": "leaf",
        "length": 50,
        "neck": 0.5,
    }
    leaves = [leaf | {"name": f"leaf {k}", "at": [x, 25]} for k, x in enumerate((-20, 20))]
    bars = [
        {"name": name, "path": [[-25, y], [25, y]], "width": 10}
        for name, y in (("ground", -5), ("stage", 55))
    ]
    bars[0]["fixed"] = True
    built = MechanismFile(
        name="built",
        thickness=10,
        material="al-7075-t6",
        body=bars,
        hinge=leaves,
        output={"body": "stage", "at": [0, 55]},
    )
    shipped = flexfem.load(ROOT / "geometry/parallelogram.toml").replace(
        hinge={"leaf": {"fillet": 0.0}}
    )
    assert built.material == shipped.material == flexfem.materials()["al-7075-t6"]
    assert [joint.profile for joint in built.layout.joints] == [
        joint.profile for joint in shipped.layout.joints
    ]
    assert np.array([joint.place for joint in built.layout.joints]) == pytest.approx(
        [-20 + 25j, 20 + 25j]
    )


def test_a_parameter_that_the_mechanism_lacks_is_refused_unless_an_expression_uses_it():
    shipped = flexfem.load(ROOT / "geometry/parallelogram.toml")
    with pytest.raises(
        BadInput,
        match=r"changed: parameters.lenght_mm is an unknown parameter, did you mean length",
    ):
        shipped.replace(parameters={"lenght_mm": 60.0})
    with pytest.raises(
        BadInput,
        match=r"parameters.zz is an unknown parameter, one of length_mm, distance_mm, neck",
    ):
        shipped.replace(parameters={"zz": "neck"})
    made = shipped.replace(parameters={"half_mm": "neck / 2"}, hinge={"leaf": {"fillet": "half"}})
    assert made.hinge[0].fillet == 0.25 and made.unused_parameters == ()
    assert made.replace(parameters={"half_mm": 0.3}).hinge[0].fillet == 0.3


def test_check_warns_of_parameters_on_which_no_number_depends(tmp_path):
    path = tmp_path / "guide.toml"
    text = (ROOT / "geometry/parallelogram.toml").read_text()
    path.write_text(
        text.replace(
            "[parameters]", '[parameters]\nspare_mm = "reserve / 2"\nreserve_mm = "length"'
        )
    )
    found = load_mechanism(path)
    assert found.unused_parameters == ("spare_mm", "reserve_mm")  # the second serves only the first
    said = [text for text in flexfem.check(found).warnings if "depends" in text]
    assert said == [
        f"parameters.{name}: no number depends on this parameter"
        for name in ("spare_mm", "reserve_mm")
    ]
    path.write_text(text)
    assert load_mechanism(path).unused_parameters == ()


def test_mappings_of_a_loaded_file_cannot_be_changed_but_copied():
    for name in ("parallelogram", "mobility6"):
        plate = flexfem.load(ROOT / f"geometry/{name}.toml")
        text = plate.to_toml()
        for mapping in (
            plate.provenance,
            plate.entries,
            plate.sources,
            getattr(plate, "parameters", plate.provenance),
        ):
            with pytest.raises(TypeError):
                mapping["x"] = 1.0
            with pytest.raises((TypeError, AttributeError)):
                mapping.clear()
            with pytest.raises((TypeError, AttributeError)):
                mapping.update(x=1.0)
        with pytest.raises(TypeError):
            plate.replace(thickness=3.0).provenance["x"] = "assumed"
        assert plate.to_toml() == text and copy.deepcopy(plate) == plate == pickle.loads(
            pickle.dumps(plate)
        )
        assert plate.provenance | {"x": "y"} == {**plate.provenance, "x": "y"}


@pytest.mark.parametrize("name", MECHANISMS)
def test_shipped_mechanisms_can_be_made_and_new_writes_them(name, tmp_path):
    flexfem.new_stage(tmp_path / "mine.toml", kind=name)
    assert (tmp_path / "mine.toml").read_bytes() == (ROOT / f"geometry/{name}.toml").read_bytes()
    assert load_mechanism(tmp_path / "mine.toml").not_stated == ()


REFUSED = [  # old and new text, and pieces of the message
    (
        '"2 * height"',
        '"2 * heigth"',
        'line 2: thickness_mm = "2 * heigth", ... did you mean height?',
    ),
    ("length_mm = 40", 'length_mm = "height * 2"', "line 7: ... height = length = height"),
    (
        "tilt_deg = 45",
        'tilt_deg = "log(0 * legs)"',
        "line 9: parameters.tilt_deg = ... a finite number",
    ),
    (
        "neck_mm = 0.4",
        'neck_mm = "legs - 4"',
        "line 39: hinge.tip.neck_mm = ... > 0; its value is -1",
    ),
    (
        "legs = 3",
        "length_deg = 3",
        "line 10: parameters.length_deg = 3, ... differs from length_mm",
    ),
    (
        "legs = 3",
        f"{61 * 'x'} = 3",
        "line 10: parameters.xxx ... expected a name of at most 60 letters, digits and _",
    ),
    (
        "length / 20",
        "length / 2",
        "line 13: body.frame.outline_mm[1] = ... a fillet of at most 10 mm",
    ),
    (
        "radius_mm = 9",
        "radius_mm = 9\nwidth_mm = 3",
        "body.hub.width_mm = 3 ... one of outline_mm, or path_mm",
    ),
    (
        "width_mm = 6",
        "width_mm = 6\nclamped_edges = [3]",
        "line 24: ... clamped_edges[0] = 3, ... of 2 edges",
    ),
    (
        '["crank", "hub"]',
        '["crank", "hup"]',
        'line 34: hinge.tip.between[1] = "hup", ... did you mean hub?',
    ),
    ("radius_mm = 1\n", "\n", "line 24: hinge.root.radius_mm, expected this dimension"),
    (
        '["crank", "root", "push"]',
        '["krank"]',
        'line 49: copy[0].parts[0] = "krank", ... did you mean crank?',
    ),
    ('"legs"', '"legs / 2"', 'line 53: copy[1].count = "legs / 2", ... '),
    (
        "[0, 1]}",
        "[0, 12], contact_mm = 2}",
        'line 4: output.at_mm = [0, 12], expected a point of "hub"',
    ),
    (
        "[0, 1]}",
        "[1, 0], contact_mm = 1}",
        'line 4: output.at_mm = [1, 0], expected a point of "hub"',
    ),  # in its hole
    (
        'circular"\nradius',
        'v"\ndepth_mm = 2\nangle_deg = 190\nroot_radius',
        "line 31: ... angle_deg = 190.0, ... ",
    ),
    (
        'circular"\nradius',
        'circular"\nside = "top"\nradius',
        "line 30: hinge.root.side = ... 'left' or 'right'",
    ),
    (
        'circular"\nradius',
        'circular"\nside = "left"\ncut_mm = 2\nradius',
        "root.cut_mm = 2, ... at least 2.5, twice",
    ),
    (
        "[33, 30]]",
        "[39, 30]]",
        'line 44: ... push.at_mm[1] = [39, 30], expected a point of "crank"',
    ),
]


@pytest.mark.parametrize(("old", "new", "said"), REFUSED)
def test_what_is_wrong_is_refused_with_file_line_key_and_expectation(old, new, said, tmp_path):
    assert old in TEXT
    path = tmp_path / "odd.toml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(BadInput) as caught:
        load_mechanism(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line ") and message.isprintable()
    assert all(piece in message for piece in said.split(" ... "))


def in_inches(value, by=1.0):
    """A content with every length divided by 25.4, in a key that ends in _in; so do key paths of
    provenance.
    """
    if isinstance(value, dict):
        lengths = {key: key.endswith("_mm") for key in value}
        return {
            key[:-2] + "in" if lengths[key] else key: in_inches(each, 25.4 if lengths[key] else 1.0)
            for key, each in value.items()
        }
    if isinstance(value, list):
        return [in_inches(each, by) for each in value]
    return value if by == 1.0 or isinstance(value, str) else value / by


def test_a_stage_file_in_inches_is_the_same_stage_bit_for_bit_and_the_schema_accepts_it(tmp_path):
    path = ROOT / "geometry/mobility6.toml"
    file = tmp_path / "inches.toml"
    content = {"units": "in", **in_inches(tomllib.loads(path.read_text()))}
    file.write_text(toml_text(content))
    metric = flexfem.load(path)
    found = flexfem.load(file)
    assert found == metric and found.hash == metric.hash and found.sources == metric.sources
    assert tomllib.loads(found.to_toml()) == tomllib.loads(metric.to_toml())
    validator = jsonschema.Draft7Validator(schema_of("stage"))
    assert validator.is_valid(content)
    missing = {key: value for key, value in content.items() if key != "thickness_in"}
    assert not validator.is_valid(missing) and not validator.is_valid(
        missing | {"thicknes_in": 0.4}
    )


INCHES = """\
name = "two leaves"
units = "in"
thickness_in = 0.4
material = {name = "al-7075-t6"}
parameters = {span_in = 2, wide_in = "span / 5"}
output = {body = "stage", at_in = [0, 2.2]}
[[body]]
name = "ground"
fixed = true
path_in = [[-1, -0.2], [1, -0.2]]
width_in = "wide"
[[body]]
name = "stage"
path_in = [[-1, "span + 0.2"], [1, "span + 0.2"]]
width_in = "wide"
[[hinge]]
name = "leaf"
between = ["ground", "stage"]
at_in = [-0.8, "span / 2"]
direction_deg = 90
shape = "leaf"
length_in = "span"
neck_in = 0.02
[[copy]]
parts = ["leaf"]
mirror_in = [[0, 0], [0, 1]]
[provenance]
"hinge.leaf.neck_in" = "drawing 7"
"parameters.span_in" = "assumed"
"""


def test_expressions_of_a_file_in_inches_are_in_inches_and_results_in_mm(tmp_path):
    file = tmp_path / "inches.toml"
    file.write_text(INCHES)
    assert jsonschema.Draft7Validator(schema_of("mechanism")).is_valid(tomllib.loads(INCHES))
    found = load_mechanism(file)
    assert [joint.place for joint in found.layout.joints] == pytest.approx(
        [-20.32 + 25.4j, 20.32 + 25.4j]
    )
    assert found.body[1].path[0] == pytest.approx((-25.4, 55.88)) and found.body[
        1
    ].width == pytest.approx(10.16)
    assert found.sources["hinge.leaf.neck_mm"] == "drawing 7" and found.assumed == (
        "parameters.span_in",
    )
    report = flexfem.check(found)
    assert report.hinges[0].length_mm == 50.8 and report.dimensions["thickness_mm"] == 10.16
    longer = found.replace(parameters={"span_in": 3})
    assert longer.hinge[0].length == pytest.approx(76.2) and longer.body[1].path[0][
        1
    ] == pytest.approx(81.28)
    found.save(tmp_path / "metric.toml")
    assert load_mechanism(tmp_path / "metric.toml") == found
    file.write_text(INCHES.replace("thickness_in = 0.4", 'thickness_in = "0.1 + wide"'))
    summed = load_mechanism(file)
    assert summed.thickness == pytest.approx(12.7)  # 0.5 in: the factor applies to the whole sum
    summed.save(tmp_path / "summed.toml")
    assert load_mechanism(tmp_path / "summed.toml") == summed


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        (
            "neck_in = 0.02",
            "neck_in = -0.02",
            23,
            "neck_mm = -0.508, expected > 0 (in mm, to which this file is conv",
        ),
        (
            "neck_in = 0.02",
            "neck_mm = 0.508",
            23,
            'neck_mm, expected a key that ends in _in: units = "in"',
        ),
        (
            "span_in = 2",
            "span_mm = 2",
            5,
            'parameters.span_mm, expected a key that ends in _in: units = "in"',
        ),
        ('"in"', '"ft"', 2, 'units = "ft", expected "mm", or in a file "in"'),
        ('"in"', '"mm"', 3, "thickness_in is an unknown key, did you mean thickness_mm?"),
        ("at_in = [-0.8,", "at_in = [true,", 19, "hinge.leaf.at_mm[0] = true, expected a number"),
        (
            "length_in = ",
            "length_in = 1e5 #",
            22,
            "hinge.leaf.length_mm = 100000.0, expected <= 10000",
        ),
        (
            "0.4\n",
            '"0.1) + (0.3"\n',
            3,
            'thickness_mm = "0.1) + (0.3", expected an expression: numbers, names',
        ),
        (
            "0.02\n",
            '"1) / (1)) * ((0.02"\n',
            23,
            'neck_mm = "1) / (1)) * ((0.02", expected an expression',
        ),
        (
            "0.4\n",
            '"wde"\n',
            3,
            'thickness_mm = "wde", expected names of parameters, not "wde", did you mean wide?',
        ),
    ],
)
def test_mistakes_in_a_file_in_inches_are_refused_with_their_line(old, new, line, said, tmp_path):
    file = tmp_path / "inches.toml"
    file.write_text(INCHES.replace(old, new))
    with pytest.raises(BadInput) as refused:
        load_mechanism(file)
    assert str(refused.value).startswith(f"{file}, line {line}: ") and said in str(refused.value)


LEAVES = """\
name = "two leaves"
thickness_mm = 10
material = {name = "al-7075-t6"}
output = {body = "stage", at_mm = [0, 55]}
[[body]]
name = "ground"
fixed = true
path_mm = [[-25, -5], [25, -5]]
width_mm = 10
[[body]]
name = "stage"
path_mm = [[-25, 55], [25, 55]]
width_mm = 10
holes = []
[[hinge]]
name = "leaf"
between = ["ground", "stage"]
at_mm = [-20, 25]
direction_deg = 90
shape = "leaf"
length_mm = 50
neck_mm = 0.5
fillet_mm = 0.5
[[copy]]
parts = ["leaf"]
mirror_mm = [[0, 0], [0, 1]]
"""
HOLES = "holes = [{centre_mm = [0, 55], radius_mm = 2}, {centre_mm = [%s], radius_mm = 2}]"
AROUND = "path_mm = [[-25, 55], [35, 55], [35, -20]]"
MENDED = [  # replaced texts, line, and what leads to the mend
    (
        {"direction_deg = 90": "direction_deg = 1.571"},
        15,
        "direction 1.571 deg, read in radians it would reach",
    ),
    (
        {"direction_deg = 90": "direction_deg = 1.2"},
        15,
        "its length is 50 mm and its direction 1.2 deg$",
    ),
    (
        {"length_mm = 50": "length_mm = 0.05"},
        23,
        "expected less than half of length_mm = 0.05: is the unit of both",
    ),
    ({"fillet_mm = 0.5": "fillet_mm = 30"}, 23, "expected less than half of length_mm = 50$"),
    (
        {"holes = []": HOLES % "20, 60"},
        14,
        "holes[1]: the hole around 20, 60 crosses the edge of the body",
    ),
    ({"holes = []": HOLES % "20, 80"}, 14, "holes[1]: the hole around 20, 80 is outside the body"),
    ({"holes = []": HOLES % "1, 56"}, 14, "holes[1]: the hole around 1, 56 meets holes[0]"),
    (
        {"[[-25, 55], [25, 55]]": "[[-25, 55], [25, 55, 3], [0, 30, 3], [0, 70]]"},
        10,
        "body.stage: self-intersection",
    ),
    (
        {
            "path_mm = [[-25, 55], [25, 55]]": AROUND,
            "fillet_mm = 0.5": "fillet_mm = 0.5\ncut_mm = 130",
        },
        10,
        "in 2 pieces after the cuts for its hinges (most by hinge.leaf, whose cut_mm is 130 and "
        "may be as low as 1.5)",
    ),
]


@pytest.mark.parametrize(("changes", "line", "said"), MENDED)
def test_a_refusal_names_what_is_to_be_mended(changes, line, said, tmp_path):
    text = LEAVES
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "leaves.toml"
    path.write_text(text)
    with pytest.raises(BadInput) as refused:
        load_mechanism(path)
    message = str(refused.value)
    assert message.startswith(f"{path}, line {line}: ") and f"{said.rstrip('$')}" in message
    assert message.endswith(said[:-1]) or not said.endswith("$")
