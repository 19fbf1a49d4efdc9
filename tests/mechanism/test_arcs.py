"""Outlines with arcs: areas by elementary geometry, in either sense, mirrored, in inches; a curved
strip that bends.
"""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

import flexfem
from flexfem.fem.plate_mesh import mesh_layout, plate_contours
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.outlines import area
from flexfem.questions.plates import elements
from flexfem.refused import BadInput

ROUND_OFF = 1e-12  # relative, of an area
BEAM = (
    0.005  # of a curved beam's theory: its clamped end cannot contract, and the point has an extent
)

HEAD = """
name = "plate"
thickness_mm = 5
model = "plane_stress"
[material]
name = "a metal"
youngs_modulus_gpa = 70
poissons_ratio = 0.3
density_kg_m3 = 2700
yield_strength_mpa = 240
"""
OUTPUT = """
[output]
body = "plate"
at_mm = [{x!r}, {y!r}]
contact_mm = 0.5
"""


def bodies_of(text: str) -> list[float]:
    """Areas of the bodies of a mechanism, holes taken off."""
    layout = MechanismFile.model_validate(
        tomllib.loads(HEAD + text + OUTPUT.format(x=1.0, y=1.0))
    ).layout
    return [area(body.outline) + sum(map(area, body.holes)) for body in layout.bodies]


def plate_with(outline: str, more: str = "") -> str:
    return f'[[body]]\nname = "plate"\noutline_mm = {outline}\nclamped_edges = [1]\n{more}\n'


SEGMENT = 7.25**2 * np.arccos(5.25 / 7.25) - 5.25 * np.sqrt(
    4 * 7.25 - 4
)  # 2 mm high over a chord of 10 mm
MAJOR = np.pi * 5.2**2 - (
    5.2**2 * np.arccos(2 / 5.2) - 2 * 4.8
)  # 7.2 mm high over 9.6 mm: 2 mm beyond the centre


@pytest.mark.parametrize(
    ("outline", "expected"),
    [
        ("[[0, 0], [10, 0, 0, 2], [10, 10], [0, 10]]", 100 + SEGMENT),
        ("[[0, 0], [10, 0, 0, -2], [10, 10], [0, 10]]", 100 - SEGMENT),
        (
            "[[0, 10], [10, 10, 0, -2], [10, 0], [0, 0]]",
            100 + SEGMENT,
        ),  # clockwise: outwards is to the left
        (
            "[[0, 10, 3], [10, 10, 0, -2], [10, 0], [0, 0, 3]]",
            100 + SEGMENT - 2 * (1 - np.pi / 4) * 9,
        ),
        ("[[0, 0], [12, 0, 0, 6]]", 18 * np.pi),  # half a disc of two corners
        ("[[0, 0, 0, 6], [12, 0, 0, 6]]", 36 * np.pi),
        ("[[0, 0], [9.6, 0, 0, 7.2]]", MAJOR),
        (
            "[[0, 0, 0, 3], [20, 0, 0, 1], [20, 10, 0, -3], [0, 10, 0, -1]]",
            200.0,
        ),  # a strip that is curved twice
    ],
)
def test_an_outline_with_arcs_has_the_area_of_elementary_geometry(outline, expected):
    assert bodies_of(plate_with(outline)) == pytest.approx([expected], rel=ROUND_OFF)


def test_mirrored_and_turned_copies_of_an_arc_bulge_to_the_same_side_of_their_outlines():
    copied = """
[[copy]]
parts = ["plate"]
mirror_mm = [[-5, 0], [-5, 1]]
[[copy]]
parts = ["plate"]
count = 2
about_mm = [0, 30]
"""
    found = bodies_of(plate_with("[[0, 0], [10, 0, 0, 2], [10, 10], [0, 10]]", copied))
    assert found == pytest.approx([100 + SEGMENT] * 3, rel=ROUND_OFF)


def test_arcs_of_holes_and_in_inches_and_by_expressions(tmp_path):
    hole = 'holes = [{outline_in = [["reach / 8", 0.1, 0, "-reach / 8"], ["reach / 4", 0.1, 0, "-reach / 8"]]}]'
    text = plate_with("[[-1, -1], [1, -1], [1, 1], [-1, 1]]", hole)
    text = (HEAD + text + OUTPUT.format(x=-0.5, y=-0.5)).replace(
        "_mm =", "_in ="
    ) + "[parameters]\nreach = 2\n"
    path = tmp_path / "plate.toml"
    path.write_text('units = "in"' + text)
    layout = flexfem.load(path).layout
    (body,) = layout.bodies
    radius = (
        0.125**2 + 0.25**2
    ) / 0.5  # in, through the ends of a chord of 0.25 in and 0.25 in above it
    half_turn = 2 * np.arctan(0.25 / 0.125)
    lens = radius**2 * (2 * half_turn - np.sin(2 * half_turn))
    assert sum(map(area, body.holes)) == pytest.approx(-lens * 25.4**2, rel=ROUND_OFF)


@pytest.mark.parametrize(
    ("outline", "said"),
    [
        (
            "[[0, 0], [10, 0, 1, 2], [10, 10], [0, 10]]",
            r"outline_mm\[1\] = .*expected no fillet at the end of an arc",
        ),
        (
            "[[0, 0], [10, 0, 0, 2], [10, 10, 1], [0, 10]]",
            r"outline_mm\[2\] = .*expected no fillet at the end of an",
        ),
        (
            "[[0, 0], [10, 0]]",
            r"outline_mm = .*expected at least 3 corners, or 2 with an arc between them",
        ),
        ("[[0, 0], [10, 0, 0, 2, 1], [10, 10], [0, 10]]", r"outline_mm\[1\]"),
        (
            "[[0, 0, 0, 2], [10, 0, 0, -2]]",
            r"outline_mm\[0\] = .*expected a corner at which the outline does not turn",
        ),
        (
            "[[0, 0], [10, 0, 0, -7], [10, 10], [0, 10]]",
            r"self-intersection",
        ),  # the arc crosses other sides
    ],
)
def test_outlines_with_arcs_that_cannot_be_drawn_are_refused(tmp_path, outline, said):
    path = tmp_path / "plate.toml"
    path.write_text(HEAD + plate_with(outline) + OUTPUT.format(x=0.0, y=5.0))
    with pytest.raises(BadInput, match=said) as refusal:
        flexfem.check(flexfem.load(path))
    assert "\n" not in str(refusal.value)


QUARTER = """
[[body]]
name = "plate"
outline_mm = [[9, 0], [11, 0, 0, "11 * rise"], [0, 11], [0, 9, 0, "-9 * rise"]]
clamped_edges = [1]
[[point]]
name = "before"
body = "plate"
at_mm = [5, "5 * sqrt(3)"]
contact_mm = 0.5
[parameters]
rise = "1 - sqrt(0.5)"
"""


def test_a_curved_strip_bends_as_the_theories_of_winkler_and_castigliano_say():
    """A quarter of a ring, clamped at one end, with a couple and a radial force at 80 degrees.

    The couple is read at 60 degrees, away from where it is introduced.
    """
    at = 10 * np.exp(1j * np.deg2rad(80))
    strip = MechanismFile.model_validate(
        tomllib.loads(HEAD + QUARTER + OUTPUT.format(x=float(at.real), y=float(at.imag)))
    )
    found = elements(strip, 6).compliance
    E = 70e3
    G = 70e3 / 2.6
    A = 10.0
    R = 10.0
    alpha = np.deg2rad(80)
    before = np.deg2rad(60)
    neutral = 2 / np.log(11 / 9)
    e = R - neutral
    couple = np.exp(1j * before) * (1 - 1j * before) - 1  # integral of t exp(i t)
    moved = -neutral * couple + 1j * before * e * np.exp(1j * before)
    expected = np.array([moved.real, moved.imag, before]) / (E * A * e)
    assert found[3:6, 2] == pytest.approx(expected, rel=BEAM)
    sine, cosine = (
        alpha / 2 + sign * np.sin(2 * alpha) / 4 for sign in (-1, 1)
    )  # integrals of the squares
    radial = R**2 * sine / (E * A * e) - R * sine / (E * A) + 1.2 * R * cosine / (G * A)
    direction = np.array([np.cos(alpha), np.sin(alpha)])
    assert direction @ found[:2, :2] @ direction == pytest.approx(radial, rel=BEAM)


def test_an_arc_that_is_clamped_is_held_along_its_whole_length_and_drawn_as_an_arc():
    outline = (
        "[[0, 0, 0, 18], [12, 0], [12, 8], [0, 8]]"  # most of a disc of 10 mm radius below a stub
    )
    text = HEAD + plate_with(outline) + OUTPUT.format(x=6.0, y=7.0)
    layout = MechanismFile.model_validate(tomllib.loads(text)).layout
    (body,) = layout.bodies
    held = [body.outline[k] for k in body.clamped]
    assert sum(each.length for each in held) == pytest.approx(
        20 * (np.pi - np.arcsin(0.6)), rel=ROUND_OFF
    )
    mesh = mesh_layout(layout, 4)
    nodes = mesh.nodes[np.unique(mesh.edges["clamped"])]
    assert np.hypot(nodes[:, 0] - 6, nodes[:, 1] + 8) == pytest.approx(10.0, abs=1e-9)
    assert np.ptp(nodes, axis=0) == pytest.approx([20, 18], abs=0.1)
    (loop,) = plate_contours(layout)
    assert sum(each.length for each in loop if each.centre is not None) == pytest.approx(
        20 * (np.pi - np.arcsin(0.6)), rel=1e-9
    )
