"""Mechanisms drawn, exported, meshed and shown on a page: areas in closed form, the wire's
distance, refusals.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import ezdxf
import meshio
import numpy as np
import pytest
import shapely

import flexfem as api
from flexfem.cad.step import write_step
from flexfem.fem.plate_mesh import plate_contours
from flexfem.mechanism.contours import Part, cut_path
from flexfem.mechanism.mechanism_file import read_mechanism
from flexfem.mechanism.outlines import polygon_points
from flexfem.mechanism.plate import clashes
from flexfem.plot.plate import drawing_figure, load_figure

from .test_export import chained, dxf_pieces

# area, mm^2: base with a hole, head with four fillets, parabolic hinge of height t + 2 d (2 x /
# L)^2
AREA = (
    (21 * 9 - math.pi * 1.7**2)
    + (10.4 * 6.1 - (4 - math.pi) * 1.3**2)
    + (0.57 * 5.2 + 2 * 1.9 * 5.2 / 3)
)
TEXT = """
name = "nod"
thickness_mm = 4.3
material = {name = "al-7075-t6"}
output = {body = "head", at_mm = [1.1, 9.7]}
point = [{name = "corner", body = "head", at_mm = [6, 8], contact_mm = 2}]
body = [
{name="base",fixed=true,outline_mm=[[-12, -9], [9, -9], [9, 0], [-12, 0]],holes=[{centre_mm=[-7, -4], radius_mm=1.7}]},
{name="head", outline_mm=[[-4.4, 5.2, 1.3], [6, 5.2, 1.3], [6, 11.3, 1.3], [-4.4, 11.3, 1.3]]}]
[[hinge]]
name = "neck"
between = ["base", "head"]
at_mm = [0.6, 2.6]
direction_deg = 90
shape = "parabolic"
length_mm = 5.2
depth_mm = 1.9
neck_mm = 0.57
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    (path := tmp_path_factory.mktemp("plates") / "nod.toml").write_text(TEXT)
    return path.parent


@pytest.fixture(scope="module")
def nod(folder) -> api.Mechanism:
    return api.load(folder / "nod.toml")


def test_a_drawing_has_the_area_of_the_parts_and_true_arcs(nod, folder):
    assert api.export(nod, folder / "nod.dxf", kerf=0.31).area == pytest.approx(AREA, rel=2e-6)
    space = ezdxf.readfile(folder / "nod.dxf").modelspace()
    (loop,) = chained([*dxf_pieces(space, "METAL")])
    assert abs(sum(piece.swept for piece in loop)) == pytest.approx(
        AREA + math.pi * 1.7**2, rel=2e-6
    )
    wire = {round(arc.dxf.radius, 9) for arc in space.query('ARC[layer=="WIRE_PATH"]')}
    assert {1.455, 0.155} < wire  # fillets wider, corners rounded
    assert {each.dxf.layer: each.dxf.radius for each in space.query("CIRCLE")} == pytest.approx(
        {"HOLES": 1.7, "WIRE_PATH": 1.545}
    )


def test_the_wire_stays_at_half_the_kerf_from_every_contour(nod):
    outer, *others = plate_contours(nod.layout)
    wire = cut_path(Part([outer, *others]), 0.5)
    metal = shapely.Polygon(
        polygon_points(outer, 1e-3), [polygon_points(loop, 1e-3) for loop in others]
    )
    points = np.concatenate(
        [segment.at(np.linspace(0, 1, 40)) for loop in wire.loops for segment in loop]
    )
    assert shapely.distance(metal, shapely.points(points.real, points.imag)) == pytest.approx(
        0.25, abs=1e-3
    )


def test_a_solid_has_the_volume_of_the_plate_and_no_other_is_kept(nod, folder):
    assert api.export(nod, folder / "nod.step").volume == pytest.approx(4.3 * AREA, rel=2e-6)
    with pytest.raises(api.ComputationFailed, match=r"expected 1 of 812\.7 mm\^3"):
        write_step(
            nod.name, nod.layout, Part([[*nod.layout.bodies[0].outline]]), folder / "other.step"
        )
    assert not (folder / "other.step").exists()


def test_a_report_lists_parts_and_refuses_those_that_overlap_which_are_drawn(flexfem, folder):
    found = json.loads(flexfem("check", folder / "nod.toml", "--json")[1])
    assert found["mass_g"] == pytest.approx(2.81e-3 * 4.3 * AREA, rel=1e-5) and found[
        "size_mm"
    ] == [21.0, 20.3]
    assert list(found["hinges"][0].values())[:6] == [
        "neck",
        "base - head",
        "parabolic",
        5.2,
        0.57,
        "depth 1.9 mm",
    ]
    (folder / "low.toml").write_text(
        TEXT.replace("[-4.4, 5.2, 1.3], [6, 5.2, 1.3]", "[-4.4, -1, 1.3], [6, -1, 1.3]")
    )
    code, _, err = flexfem("check", folder / "low.toml")
    assert code == 2 and re.fullmatch(
        r"flexfem: \S+low.toml, line \d+: \S*base\S*: .*\bhead\b.*\n", err
    ), err
    code, out, drawn = flexfem("view", folder / "low.toml", "-o", folder)
    assert (code, out) == (
        2,
        "",
    ) and drawn == f"{err[:-1]}; drawn in {folder / 'low-drawing.png'}\n"
    (overlap,) = clashes(
        read_mechanism(folder / "low.toml").layout, api.BadInput("")
    )  # above it are 0.3 mm of fillets
    assert overlap.bounds == pytest.approx(
        (-3.1 - math.sqrt(1.6), -1, 4.7 + math.sqrt(1.6), 0), abs=1e-4
    )


def test_a_mesh_holds_bodies_hinges_and_unit_loads(nod, folder):
    for suffix in (".msh", ".inp"):
        api.mesh(nod, folder / f"nod{suffix}", resolution=3)
    assert set(meshio.read(folder / "nod.msh").field_data) == {
        "body base",
        "body head",
        "hinge neck",
    }
    text = (folder / "nod.inp").read_text()
    table = re.search(r"\*NODE, NSET=all\n(.*?)\n\*", text, re.DOTALL)
    nodes = np.array([line.split(",")[1:3] for line in table[1].splitlines()], dtype=float)
    loads = re.findall(r"\*CLOAD, OP=NEW\n(.*?)\n\*", text, re.DOTALL)
    for k, load in enumerate(loads):
        node, axis, force = np.array([line.split(",") for line in load.splitlines()], dtype=float).T
        x, y = (nodes[node.astype(int) - 1] - [[1.1, 9.7], [6, 8]][k // 3]).T
        along = [
            np.sum(force[axis == 1]),
            np.sum(force[axis == 2]),
            np.sum(force * np.where(axis == 2, x, -y)),
        ]
        assert along == pytest.approx(np.eye(3)[k % 3], abs=1e-8)
    assert len(loads) == 6


@pytest.mark.slow
def test_drawings_name_the_parts_and_show_the_displacement(nod, folder):
    (ax,) = drawing_figure(nod).axes
    assert {"base", "head", "neck", "output", "corner", "x", "y"} < {
        text.get_text() for text in ax.texts
    }
    found = api.stiffness(nod, models="elements", force=(1.9, 0.0, 0.0), resolution=4)
    mesh = found.fields.mesh
    moved = found.fields.made()["displacement"]
    at = np.argmin(np.hypot(*(mesh.nodes - [1.1, 9.7]).T))
    x, y, theta = found.at("pose", model="three dimensions", point="output")
    shift = theta * (mesh.nodes[at] - [1.1, 9.7])
    assert moved[at] == pytest.approx([x - shift[1], y + shift[0]], rel=2e-3, abs=2e-6)
    assert not moved[mesh.triangles[mesh.bodies == 0]].any()
    assert "at hinge neck" in " ".join(
        text.get_text() for text in load_figure(found).texts
    ).replace("\n", " ")
    page = api.report(
        folder / "nod.toml", folder / "nod.html", sections=["analytic", "stress", "drive"]
    )
    assert page.sections == ["The mechanism", "Analytic model", "Stress", "Sources of the numbers"]


REFUSED = {
    "identify nod.toml x.toml": "identify is for a stage file, not for a mechanism file",
    "export nod.toml -o x.dxf --holes 3": "mounting holes of 3 mm",
    "stiffness nod.toml --mobility 3": "not an option for a mechanism file",
    "report nod.toml -o x.html --sections life --amplitude 1 0 0": "section life, expected",
    "study status nod.toml": "expected a study file",
}


def test_what_a_mechanism_does_not_have_is_refused_in_one_line(flexfem, folder, monkeypatch):
    monkeypatch.chdir(folder)
    for command, said in REFUSED.items():
        code, out, err = flexfem(*command.split())
        assert (code, out, err.count("\n")) == (2, "", 1) and said in err
