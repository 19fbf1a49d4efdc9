"""Files for the workshop, read back: necks, radii, area, volume, units, layers, closed contours."""

from __future__ import annotations

import cmath
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import flexfem
from flexfem.cad import step
from flexfem.fem.plate_mesh import plate_contours
from flexfem.mechanism.outlines import area
from flexfem.meshing.session import gmsh_session
from flexfem.paper.bodies import draw_sector
from flexfem.refused import BadInput, ComputationFailed

from ..conftest import UNLIKE, with_changes

ROOT = Path(__file__).parents[2]
REL = 1e-9  # of what is read from text
NEAR = 1e-9  # mm
HOSTILE = "a <b> & \"q\" 'it' %%c %%% ^J \\P {x}; é \u4e2d"
HOSTILE_IN_STEP = (
    r"a <b> & 'q' ''it'' %%c %%% ^J \\P {x}; \X2\00E9\X0\ \X2\4E2D\X0\ ".strip().replace(
        "'q'", '"q"'
    )
)
HINGES = {  # radius and neck, mm, of the nine hinges of the stage with UNLIKE
    1: [(2.3, 0.53), (1.6, 0.47), (1.4, 0.61)],
    2: [(3.9, 0.53), (1.6, 0.83), (1.4, 0.61)],
    3: [(3.9, 0.53), (1.6, 0.47), (1.9, 0.41)],
}
SVG = "{http://www.w3.org/2000/svg}"


class Piece(NamedTuple):
    """A line or arc that was read: ends, and for an arc its centre and the angle that it turns from
    start to end.
    """

    start: complex
    end: complex
    centre: complex = 0j
    turn: float = 0.0

    @property
    def swept(self) -> float:
        """Area to its left seen from the origin: half the integral of x dy - y dx, in closed form."""
        a = self.start
        b = self.end
        c = self.centre
        if not self.turn:
            return (a.conjugate() * b).imag / 2
        return abs(a - c) ** 2 * self.turn / 2 + (c.conjugate() * (b - a)).imag / 2

    @property
    def back(self) -> Piece:
        return Piece(self.end, self.start, self.centre, -self.turn)


def chained(pieces: list[Piece]) -> list[list[Piece]]:
    """The pieces as closed loops; fails on an end that meets no other."""
    left = list(pieces)
    loops = []
    while left:
        loop = [left.pop(0)]
        while abs(loop[-1].end - loop[0].start) > 1e-9:
            near = [
                (each, way)
                for each in left
                for way in (each, each.back)
                if abs(way.start - loop[-1].end) < 1e-9
            ]
            assert len(near) == 1, (loop[-1], near)
            left.remove(near[0][0])
            loop.append(near[0][1])
        loops.append(loop)
    return loops


def place(point) -> complex:
    return complex(point.x, point.y)


def dxf_pieces(space, layer: str) -> Iterator[Piece]:
    for each in space.query(f'*[layer=="{layer}"]'):
        if each.dxftype() == "LINE":
            yield Piece(place(each.dxf.start), place(each.dxf.end))
        elif each.dxftype() == "ARC":
            centre = place(each.dxf.center)
            first = each.dxf.start_angle
            last = each.dxf.end_angle
            ends = [centre + cmath.rect(each.dxf.radius, math.radians(a)) for a in (first, last)]
            yield Piece(*ends, centre, math.radians((last - first) % 360))


def svg_pieces(path: str) -> list[Piece]:
    """Pieces of a path of the commands M, L, A and Z, y upwards."""
    found = []
    at = 0j
    for command, text in re.findall(r"([MLAZ])([^MLAZ]*)", path):
        numbers = [float(word) for word in text.split()]
        if command == "Z":
            assert abs(at - found[0].start) < 1e-9
            continue
        end = complex(numbers[-2], -numbers[-1])
        if command == "L":
            found.append(Piece(at, end))
        elif command == "A":
            radius, same, _, large, sweep, *_ = numbers
            assert radius == same and large == 0
            half = (end - at) / 2
            sense = 1 if sweep == 0 else -1
            centre = (
                at
                + half
                + sense * 1j * half / abs(half) * math.sqrt(max(radius**2 - abs(half) ** 2, 0.0))
            )
            found.append(
                Piece(at, end, centre, sense * 2 * math.asin(min(abs(half) / radius, 1.0)))
            )
        at = end
    return found


def require_necks(pieces: list[Piece], beside: float = 0.0) -> list[complex]:
    """Centres of all hinges, each as HINGES has it, its notches `beside` smaller in radius, and in
    place.
    """
    centres_of_necks = list[complex]()
    turning = [(p.centre, abs(p.start - p.centre)) for p in pieces if p.turn]
    arcs = {
        (round(c.real, 7), round(c.imag, 7)): (c, radius) for c, radius in turning
    }  # once, and as it was read
    for chain, expected in HINGES.items():
        places = []
        for radius, neck in expected:
            centres = [
                centre for centre, found in arcs.values() if abs(found + beside - radius) < NEAR
            ]
            pairs = [
                (a + b) / 2
                for a, b in combinations(centres, 2)
                if abs(abs(a - b) - 2 * radius - neck) < NEAR
            ]
            places.append(pairs)
        lengths = (31.07, 33.506, 25.0)
        found = [
            (base, elbow, end)
            for base, elbow, end in product(*places)
            if np.allclose(
                [abs(base - elbow), abs(elbow - end), abs(end)], lengths, rtol=0, atol=NEAR
            )
        ]
        assert found, chain
        centres_of_necks += found[0]
    return centres_of_necks


@pytest.fixture(scope="module")
def stage() -> flexfem.Stage:
    """Lengths of as many decimals as a drawing must keep."""
    return with_changes(
        {"override": UNLIKE, "name": HOSTILE, "chain.link_lengths_mm": [31.07, 33.506, 25.0]}
    )


@pytest.fixture(scope="module")
def metal(stage) -> float:
    """Area of what is meshed, mm^2."""
    return sum(
        area(face.loop) for chain in (1, 2, 3) for face in draw_sector(stage, chain).values()
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("parts")


@pytest.fixture(scope="module")
def drawing(stage, folder):
    """The model space of the DXF with a kerf and holes, read back."""
    flexfem.export(stage, folder / "part.dxf", kerf=0.32, holes=4.3)
    return ezdxf.readfile(folder / "part.dxf")


def test_a_dxf_is_in_millimetres_on_its_layers_and_without_errors(drawing):
    assert drawing.header["$INSUNITS"] == 4 and drawing.header["$MEASUREMENT"] == 1
    assert drawing.audit().errors == []
    kinds = {}
    for each in drawing.modelspace():
        kinds.setdefault(each.dxf.layer, set()).add(each.dxftype())
    assert kinds == {
        **{"METAL": {"LINE", "ARC"}, "HOLES": {"CIRCLE"}, "GROUND": {"LINE"}},
        **{"CENTRE_MARKS": {"LINE"}, "DIMENSIONS": {"DIMENSION", "LINE", "TEXT"}},
        "WIRE_PATH": {"LINE", "ARC", "CIRCLE"},
    }
    assert set(kinds) < {layer.dxf.name for layer in drawing.layers}


def test_a_dxf_has_the_metal_as_one_closed_contour(drawing, metal):
    space = drawing.modelspace()
    (loop,) = chained(list(dxf_pieces(space, "METAL")))
    hub, *mounting = sorted(
        space.query('CIRCLE[layer=="HOLES"]'), key=lambda hole: -hole.dxf.radius
    )
    assert abs(place(hub.dxf.center)) < NEAR and hub.dxf.radius == pytest.approx(7.7, abs=NEAR)
    assert abs(sum(piece.swept for piece in loop)) - math.pi * 7.7**2 == pytest.approx(
        metal, rel=REL
    )
    holes = [place(hole.dxf.center) for hole in mounting]
    marks = [(piece.start + piece.end) / 2 for piece in dxf_pieces(space, "CENTRE_MARKS")]
    wanted = [*require_necks(loop), 0j, *holes]
    assert len(marks) == 2 * len(wanted) == 2 * 13
    assert all(sum(abs(mark - centre) < NEAR for mark in marks) == 2 for centre in wanted)


def test_the_path_of_the_wire_leaves_every_neck(drawing):
    space = drawing.modelspace()
    (path,) = chained(list(dxf_pieces(space, "WIRE_PATH")))
    require_necks(path, beside=0.16)
    assert sorted(
        hole.dxf.radius for hole in space.query('CIRCLE[layer=="WIRE_PATH"]')
    ) == pytest.approx([1.99, 1.99, 1.99, 7.54])


def test_a_dxf_states_dimensions_that_it_measures(drawing):
    space = drawing.modelspace()
    measured = {each.dxf.text: each.get_measurement() for each in space.query("DIMENSION")}
    assert measured == pytest.approx(
        {"l1 <>": 31.07, "l2 <>": 33.506, "l3 <>": 25.0, "w <>": 8.9}, rel=REL
    )
    said = [each.plain_text() for each in space.query("TEXT")]
    assert {f"R {radius}, t {neck}" for hinges in HINGES.values() for radius, neck in hinges} < set(
        said
    )
    assert {"platform R 16.3", "hub R 7.7", "3 holes R 2.15", HOSTILE} < set(said)
    assert "the models do not include the mounting holes, which make the pads softer" in said


def test_an_svg_is_in_millimetres_with_true_arcs(stage, folder, metal):
    found = flexfem.export(stage, folder / "part.svg", kerf=0.32, holes=4.3)
    root = ElementTree.parse(folder / "part.svg").getroot()
    _, _, width, height = map(float, root.get("viewBox").split())
    assert (root.get("width"), root.get("height")) == (f"{width}mm", f"{height}mm")
    groups = {group.get("id"): group for group in root.iter(f"{SVG}g")}
    assert list(groups) == found.layers
    loop, path = (
        svg_pieces(groups[name].find(f"{SVG}path").get("d")) for name in ("METAL", "WIRE_PATH")
    )
    assert sum(piece.swept for piece in loop) - math.pi * 7.7**2 == pytest.approx(metal, rel=REL)
    require_necks(loop)
    require_necks(path, beside=0.16)
    hub, *_ = groups["HOLES"]
    assert [float(hub.get(key)) for key in ("r", "cx", "cy")] == pytest.approx(
        [7.7, 0.0, 0.0], abs=NEAR
    )
    assert root.find(f"{SVG}title").text == HOSTILE


EXPORTED = (
    "import sys, flexfem\nfor name in sys.argv[1:]: flexfem.export(flexfem.load('stage.toml'), "
    "name)"
)


def test_the_same_stage_gives_the_same_bytes_in_another_process_at_another_time(stage, tmp_path):
    stage.save(tmp_path / "stage.toml")
    files = ["a.dxf", "a.svg", "a.step"]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "7"}
    subprocess.run(
        [sys.executable, "-c", EXPORTED, *files], check=True, cwd=tmp_path, env=variables
    )
    for name in files:
        flexfem.export(stage, tmp_path / f"b{name[1:]}")
        assert (tmp_path / name).read_bytes() == (tmp_path / f"b{name[1:]}").read_bytes(), name
    text = (tmp_path / "a.step").read_text()
    assert (
        "FILE_NAME('Open CASCADE Shape Model','1970-01-01T00:00:00'" in text
        and time.strftime("%Y-%m-") not in text
    )


def test_a_step_is_one_solid_in_millimetres_with_cylinders(stage, folder, metal):
    found = flexfem.export(stage, folder / "part.step", holes=4.3)
    volume = (metal - 3 * math.pi * 2.15**2) * 9.7
    assert found.volume == pytest.approx(volume, rel=1e-12)
    text = (folder / "part.step").read_text()
    assert text.count("SI_UNIT(.MILLI.,.METRE.)") == text.count("LENGTH_UNIT()") > 0
    radii = [
        round(float(value), 9)
        for value in re.findall(r"= CYLINDRICAL_SURFACE\('',#\d+,([^)]*)\)", text)
    ]
    wanted = [radius for hinges in HINGES.values() for radius, _ in hinges]
    assert all(radii.count(radius) == 2 * wanted.count(radius) for radius in wanted)
    assert radii.count(7.7) == 1 and radii.count(2.15) == 3 and "B_SPLINE_SURFACE" not in text
    assert (
        text.count("= PRODUCT(")
        == text.count(f"= PRODUCT('{HOSTILE_IN_STEP}','{HOSTILE_IN_STEP}'")
        == 1
    )
    with gmsh_session() as gmsh:
        gmsh.model.occ.importShapes(str(folder / "part.step"), highestDimOnly=False)
        gmsh.model.occ.synchronize()
        necks = 18  # where the quarters of a notch are one face
        corners = (
            2 * (len(plate_contours(stage.layout)[0]) - necks) + 2 * 4
        )  # of two faces, and one on each rim of holes
        assert len(gmsh.model.getEntities(0)) == corners
        ((_, tag),) = gmsh.model.getEntities(3)
        assert gmsh.model.occ.getMass(3, tag) == pytest.approx(volume, rel=1e-12)
        box = gmsh.model.getBoundingBox(3, tag)
        assert (box[2], box[5]) == pytest.approx((0.0, 9.7), abs=1e-6)
        kinds = {gmsh.model.getType(*face) for face in gmsh.model.getEntities(2)}
    assert kinds == {"Plane", "Cylinder"}


@pytest.mark.parametrize(
    ("volume", "high", "said"),
    [(25.0, 9.7e-3, r"25 mm\^3, 0.0097 mm high"), (28874.8973, 9.7, "9.7 mm high, expected")],
)
def test_a_solid_of_another_volume_is_refused(stage, tmp_path, volume, high, said):
    read = {"volumes": np.array([volume]), "box": np.array([[0, 0, 0], [0.1, 0.1, high]])}
    with (
        patch.object(step, "run_mesher", lambda *_: read),
        pytest.raises(ComputationFailed, match=said),
    ):
        flexfem.export(stage, tmp_path / "part.step")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "asked", "said"),
    [
        (
            "part.pdf",
            {},
            r"extension '\.pdf', expected a file name that ends in one of \.dxf, \.svg, \.step",
        ),
        ("folder.dxf", {}, "is a folder"),
        ("none/part.dxf", {}, "no folder"),
        ("part.step", {"kerf": 0.3}, r"kerf with \.step"),
        ("part.dxf", {"kerf": 0.0}, r"kerf 0\.0, expected a number from 0\.01 to 10 mm"),
        ("part.svg", {"holes": 0.004}, r"expected a number from 0\.01"),  # metres
        (f"{300 * 'x'}.dxf", {}, "cannot be written: File name too long"),
        ("part.dxf", {"kerf": 2.3}, r"kerf of 2\.3 mm"),
        ("part.svg", {"holes": 8.9}, r"mounting holes of 8\.9 mm"),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_line(stage, tmp_path, name, asked, said):
    (tmp_path / "folder.dxf").mkdir()
    with pytest.raises(BadInput, match=said) as refused:
        flexfem.export(stage, tmp_path / name, **asked)
    assert "\n" not in str(refused.value)
    assert [path.name for path in tmp_path.rglob("*")] == ["folder.dxf"]


def test_a_part_never_replaces_its_stage(tmp_path):
    path = tmp_path / "stage.toml"
    path.write_bytes((ROOT / "geometry/mobility6.toml").read_bytes())
    other_name = tmp_path / "stage.svg"
    other_name.symlink_to(path)
    before = path.read_bytes()
    with pytest.raises(
        BadInput,
        match=r"stage\.svg: the same file as .*stage\.toml, which is an input of this command",
    ):
        flexfem.export(flexfem.load(path), other_name)
    assert path.read_bytes() == before
    assert set(tmp_path.iterdir()) == {path, other_name}


TABLES = {
    "v": [[0, 4.0], [3, 0.5], [10, 3.0]],
    "flat": [[0, 4.0], [2, 0.5], [8, 0.5], [10, 4.0]],
    "leaf": [[0, 0.5], [4, 0.5], [10, 0.5]],
    "steps": [[0, 4.0], [2, 4.0], [2.01, 0.6], [9, 0.7], [10, 5.0]],
}
ARCS = 1e-5  # relative area, of arcs within 0.1 um of a cubic


@pytest.mark.parametrize("smooth", [False, True], ids=["lines", "smooth"])
@pytest.mark.parametrize("name", TABLES)
def test_a_hinge_by_table_is_exported_as_it_is(tmp_path, name, smooth):
    """Area and volume by hand: of the two blocks of 12 x 8 mm, and below the edges."""
    rows = TABLES[name]
    plate = tmp_path / "plate.toml"
    table = f"smooth = {str(smooth).lower()}\ntable_mm = {rows}"
    plate.write_text(BETWEEN_BLOCKS + table)
    mechanism = flexfem.load(plate)
    x, h = np.array(rows).T
    below = PchipInterpolator(x, h).integrate(0, 10) if smooth else np.trapezoid(h, x)
    expected = 2 * 12 * 8 + below
    found = flexfem.export(mechanism, tmp_path / "plate.step")
    assert found.area == pytest.approx(expected, rel=ARCS if smooth else REL)
    with gmsh_session() as gmsh:
        solids = gmsh.model.occ.importShapes(str(tmp_path / "plate.step"))
        assert [dim for dim, _ in solids] == [3]
        assert gmsh.model.occ.getMass(*solids[0]) == pytest.approx(6.5 * expected, rel=REL)
    flexfem.export(mechanism, tmp_path / "plate.dxf")
    (loop,) = chained(
        list(dxf_pieces(ezdxf.readfile(tmp_path / "plate.dxf").modelspace(), "METAL"))
    )
    assert abs(sum(piece.swept for piece in loop)) == pytest.approx(
        expected, rel=ARCS if smooth else REL
    )
    drawn = np.array([piece.start for piece in loop])
    corners = np.abs(drawn[:, None] - (x - 5 + 0.5j * h)).min(axis=0) < NEAR
    if not smooth:
        assert not any(piece.turn for piece in loop)
        assert corners[[0, -1]].all() and corners[1:-1].all() == (
            name != "leaf"
        )  # its edge is one line


BETWEEN_BLOCKS = """
name = "two blocks"
thickness_mm = 6.5
[material]
name = "al-7075-t6"
[[body]]
name = "ground"
fixed = true
outline_mm = [[-17, -4], [-5, -4], [-5, 4], [-17, 4]]
[[body]]
name = "tip"
outline_mm = [[5, -4], [17, -4], [17, 4], [5, 4]]
[output]
body = "tip"
at_mm = [5, 0]
[[hinge]]
name = "neck"
between = ["ground", "tip"]
at_mm = [0, 0]
direction_deg = 0
shape = "profile"
"""
