"""From a drawing to answers: the command, the drawing as input of every question, and round trips."""

from __future__ import annotations

import json
import math

import ezdxf
import numpy as np
import pytest

import flexfem as api
from flexfem.importing.drawings import Reading, imported
from flexfem.importing.roles import Wishes
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.plate import body_polygon
from flexfem.refused import BadInput

from ..conftest import ROOT
from .random_plates import random_mechanism

STATED = ("--thickness", "10mm", "--material", "al-7075-t6")
MICROMETRE = 1e-3  # mm, of dimensions and edges
SAME = 1e-5  # relative, of the analytic model of an exact drawing
# the same where the drawing has arcs in place of ellipses and parabolas: 0.4 um of a neck of 0.4 mm
OF_CURVES = 1e-3
AL = Reading(thickness=10.0, material="al-7075-t6")


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    path = tmp_path_factory.mktemp("drawn") / "part.dxf"
    api.export(api.load(ROOT / "geometry/parallelogram.toml"), path)
    return path


def inside(layout, index):
    point = body_polygon(layout, index).representative_point()
    return complex(point.x, point.y)


def wishes_of(layout):
    """Ground and output of a layout as points."""
    ground = [inside(layout, k) for k, body in enumerate(layout.bodies) if body.fixed]
    ground += [complex(body.outline[k].at(0.5)) for body in layout.bodies for k in body.clamped]
    output = layout.points[0][1]
    return Wishes(tuple(ground), inside(layout, output.body), output.point)


def require_same(plate, made, exact=SAME):
    """Bodies, hinges, dimensions, edges, and for mechanisms the analytic stiffness and first
    frequency.
    """
    layout = plate.layout
    found = made.mechanism.layout
    assert (len(found.bodies), len(found.joints)) == (len(layout.bodies), len(layout.joints))
    assert made.off.largest < MICROMETRE and made.warnings == []
    for joint in layout.joints:
        twin = min(found.joints, key=lambda each: abs(each.place - joint.place))
        assert abs(twin.place - joint.place) < MICROMETRE
        assert type(twin.profile) is type(joint.profile)
        for key, value in vars(joint.profile).items():
            if isinstance(value, float):
                assert abs(getattr(twin.profile, key) - value) < MICROMETRE, (joint.name, key)
    if isinstance(plate, MechanismFile):
        absent = {part.name for part in (*plate.actuator, *plate.point)}  # no drawing has them
        copies = [
            each.model_copy(
                update={"parts": tuple(name for name in each.parts if name not in absent)}
            )
            for each in plate.copies
        ]
        plate = plate.replace(
            actuator=(), payload=None, point=(), copies=tuple(each for each in copies if each.parts)
        )
        again = made.mechanism.replace(material=plate.material.model_dump(exclude_none=True))
        before, after = (
            api.stiffness(each, models="analytic").at("stiffness")[0] for each in (plate, again)
        )
        own = np.sqrt(np.diag(before))
        assert np.all(np.abs(after - before) <= exact * np.outer(own, own))
        first, second = (
            api.modes(each, models="analytic", count=1).at("frequency") for each in (plate, again)
        )
        assert second == pytest.approx(first, rel=exact)


def test_import_writes_a_file_that_answers(flexfem, part, tmp_path):
    code, out, err = flexfem(
        "import", part, "-o", "mine.toml", *STATED, "--output", "0,55", "--json"
    )
    assert code == 0, err
    report = json.loads(out)
    assert [body["body"] for body in report["bodies"]] == ["ground", "stage"]
    assert [hinge["length_mm"] for hinge in report["hinges"]] == [50.0, 50.0]
    assert report["edge_off_um"] < 1 and report["area_off"] < 1e-6
    of_file, of_drawing = (
        json.loads(flexfem("stiffness", *subject, "--models", "analytic", "--json")[1])[
            "quantities"
        ]["free"]["values"]
        for subject in (("mine.toml",), (part, *STATED, "--output", "0,55"))
    )
    assert of_file == of_drawing
    reference = api.stiffness(api.load(ROOT / "geometry/parallelogram.toml"), models="analytic").at(
        "free"
    )
    assert np.ravel(of_file) == pytest.approx(np.ravel(reference), rel=SAME)


def test_a_drawing_is_said_in_one_line_and_an_assumed_ground_in_it(flexfem, part):
    code, out, err = flexfem("check", part, *STATED)
    assert code == 0
    assert err.splitlines()[0].startswith(
        f"{part}: 2 bodies, 2 hinges; ground: ground (read from part.dxf"
    )
    assert "leaf 2" in out


@pytest.mark.slow
def test_view_draws_what_was_recognised(flexfem, part, tmp_path):
    code, out, err = flexfem("view", part, *STATED, "-o", "seen.png")
    assert (code, err) == (0, "") and "seen.png" in out


@pytest.mark.slow
def test_compare_takes_the_drawing_in_either_order(flexfem, part):
    mechanism = ROOT / "geometry/parallelogram.toml"
    for order in ((part, mechanism), (mechanism, part)):
        code, out, err = flexfem("compare", *order, "--models", "analytic", "--json")
        assert code == 0, err
        found = json.loads(out)
        (plate,) = found["plates"]
        assert found["mechanisms"][0]["file"] == str(mechanism)
        assert plate["hinges"] == [] and plate["edge_off_um"] < 0.1
        changes = {each["path"]: each["changes_percent"][1] for each in found["numbers"]}
        assert all(abs(changes[f"stiffness.free.{axis}"]) < 1e-3 for axis in ("x", "y", "theta"))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("import", "part.dxf"), "a drawing without a thickness, expected --thickness"),
        (
            ("import", "part.dxf", "--thickness", "10mm"),
            "a drawing without a material, expected --material",
        ),
        (
            ("import", "part.dxf", "--thickness", "10mm", "--material", "al-7075"),
            "did you mean al-7075-t6?",
        ),
        (("import", "part.dxf", "--thickness", "0mm", "--material", "al-7075-t6"), "thickness"),
        (
            ("import", "part.dxf", *STATED, "-o", "part.dxf"),
            "expected a file name that ends in .toml",
        ),
        (("import", "part.dxf", *STATED, "-o", "no/folder.toml"), "no folder"),
        (("import", "part.toml", *STATED), "expected a drawing: .dxf, .step, .stp, .svg"),
        (("import", "none.dxf", *STATED), "no such file"),
        (("baseline", "part.dxf", "--reason", "none"), "this is a drawing, expected a TOML file"),
        (("study", "run", "part.dxf"), "this is a drawing, expected a TOML file"),
        (
            ("stiffness", str(ROOT / "geometry/pivot.toml"), "--thickness", "9mm"),
            "thickness is for a drawing",
        ),
        (("stiffness", "part.dxf", *STATED, "--ground", "900,0"), "mm from the nearest body"),
        (("compare", "part.dxf"), "1 file, expected two or more"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(flexfem, part, arguments, text, tmp_path):
    drawing = tmp_path / "empty/part.dxf"
    drawing.write_bytes(part.read_bytes())
    code, out, err = flexfem(*arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and text in err
    assert [path.name for path in drawing.parent.iterdir()] == ["part.dxf"]


def test_a_drawing_of_another_program_in_inches(tmp_path):
    """R12 with bulges: two blocks, a notch of radius 1/16 in and neck 0.02 in between them; closed
    form of its area.
    """
    document = ezdxf.new("R12")
    half = 0.01
    radius = 0.0625
    high = 0.25
    points = [  # x, y, bulge; inches
        (-1.0, -high, 0.0),
        (-radius, -high, 0.0),
        (-radius, -half - radius, -math.tan(math.pi / 4)),
        (radius, -half - radius, 0.0),
        (radius, -high, 0.0),
        (1.0, -high, 0.0),
        (1.0, high, 0.0),
        (radius, high, 0.0),
        (radius, half + radius, -math.tan(math.pi / 4)),
        (-radius, half + radius, 0.0),
        (-radius, high, 0.0),
        (-1.0, high, 0.0),
    ]
    document.modelspace().add_polyline2d(points, format="xyb", close=True)
    path = tmp_path / "inches.dxf"
    document.saveas(path)
    reading = Reading(thickness=6.35, material="al-7075-t6", ground=["-20,0"])
    with pytest.raises(BadInput, match="2 mm across: inches"):  # R12 states no unit
        imported(path, reading)
    made = imported(path, reading._replace(units="in"))
    (joint,) = made.mechanism.layout.joints
    assert joint.profile.neck == pytest.approx(0.508) and joint.profile.radius == pytest.approx(
        1.5875
    )
    assert dict(made.mechanism.parameters) == {"radius_mm": 1.5875, "neck_mm": 0.508}
    assert made.off.largest < MICROMETRE
    assert made.mechanism.layout.points[0][1].point.real > 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(path.stem for path in (ROOT / "geometry").glob("*.toml")))
def test_a_shipped_mechanism_comes_back_from_its_drawing(kind, tmp_path):
    plate = api.load(ROOT / f"geometry/{kind}.toml")
    ending = (".dxf", ".svg", ".step")[len(kind) % 3]
    api.export(plate, tmp_path / f"{kind}{ending}")
    require_same(plate, imported(tmp_path / f"{kind}{ending}", AL, wishes=wishes_of(plate.layout)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, 14, 22, 25, 29, 18])
def test_a_random_mechanism_comes_back_from_its_drawing(seed, tmp_path):
    plate = random_mechanism(seed)
    ending = (".dxf", ".svg", ".step")[seed % 3]
    api.export(plate, tmp_path / f"random{ending}")
    stated = AL._replace(thickness=float(plate.thickness))
    require_same(
        plate,
        imported(tmp_path / f"random{ending}", stated, wishes=wishes_of(plate.layout)),
        OF_CURVES,
    )
