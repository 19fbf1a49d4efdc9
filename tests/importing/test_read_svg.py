"""SVG drawings as editors and laser cutters write them: y downwards, pixels, transforms; sizes
follow by hand.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexfem.importing.read import read_drawing
from flexfem.mechanism.outlines import area, circle_of
from flexfem.refused import BadInput

ROUND_OFF = 1e-9  # relative, of an area from coordinates with 16 digits
BEZIER = (
    3e-4  # of the radius: the largest distance of the usual cubic for a quarter of a circle from it
)
PIXEL = 25.4 / 96  # mm

PLATE = (
    60.0 * 40.0 - math.pi * 4.0**2 / 2 - math.pi * 3.0**2
)  # mm^2, notch of radius 4 mm, hole of radius 3 mm
# the notch is in the upper side, where y is 0
OUTLINE = "M 26 0 H 0 v 40 h 60 V 0 L 34 0 A 4 4 0 0 1 26 0 Z"
HOLE = '<circle cx="12" cy="25" r="3"/>'
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
HEAD += 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
IN_MM = 'width="80mm" height="60mm" viewBox="0 0 80 60">'


def area_of(drawing):
    return sum(map(area, (drawing.outside, *drawing.holes)))


def written(folder, body, size=IN_MM, head=HEAD):
    path = folder / "part.svg"
    path.write_text(f"{head}{size}{body}</svg>")
    return path


def test_y_points_downwards(tmp_path):
    drawing = read_drawing(written(tmp_path, f'<path d="{OUTLINE}"/>{HOLE}'))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    assert all(abs(each.centre - 30) < 1e-9 for each in drawing.outside if each.centre is not None)
    corners = np.array([each.start for each in drawing.outside])
    assert math.isclose(corners.imag.min(), -40.0) and abs(corners.imag.max()) < 1e-9
    centre, radius = circle_of(drawing.holes[0])
    assert abs(centre - (12 - 25j)) < 1e-9 and math.isclose(radius, 3.0)
    assert drawing.notes == () and drawing.deviation < 1e-12


KAPPA = 4 * (math.sqrt(2) - 1) / 3 * 3  # of a quarter circle of radius 3
DIALECTS = {
    "relative commands": ('<path d="m26 0h-26v40h60v-40l-26 0a4 4 0 0 1-8 0z"/>' + HOLE, IN_MM),
    "one path of two": (f'<path d="{OUTLINE} M 9 25 a 3 3 0 1 0 6 0 a 3 3 0 1 0 -6 0 z"/>', IN_MM),
    "shapes": (
        '<g><polyline points="26,0 0,0 0,40 60,40 60,0 34,0"/><path d="M34 0A4 4 0 0 1 26 0"/></g>'
        '<ellipse cx="12" cy="25" rx="3" ry="3"/>',
        IN_MM,
    ),
    "transforms": (
        '<g transform="translate(40 30) rotate(30) scale(-2 2)"><g transform="matrix(.5 0 0 .5 3 4) skewX(20)">'
        f'<g transform="skewX(-20)"><path d="{OUTLINE}"/>{HOLE}</g></g></g>',
        IN_MM,
    ),
    "pixels": (
        f'<g transform="scale({1 / PIXEL!r})"><path d="{OUTLINE}"/>{HOLE}</g>',
        'width="300" height="200">',
    ),
    "points": (
        f'<path d="{OUTLINE}"/>{HOLE}',
        f'width="{80 * 72 / 25.4!r}pt" height="{60 * 72 / 25.4!r}pt" viewBox="-5 -5 80 60">',
    ),
    "inches": (f'<path d="{OUTLINE}"/>{HOLE}', f'width="{80 / 25.4!r}in" viewBox="0 0 80 60">'),
    "attributes in mm": (
        '<rect x="0mm" y="0mm" width="60mm" height="4cm"/><rect x="-9mm" y="0.1in" width="5pt" height="1mm"/>'
        f'<g transform="scale({1 / PIXEL!r})"><path d="M34 0A4 4 0 0 1 26 0Z"/>{HOLE}</g>',
        'width="80mm" height="60mm">',
    ),
    "use": (
        f'<defs><g id="part"><path d="{OUTLINE}"/><g id="h">{HOLE}</g></g></defs>'
        '<use xlink:href="#part" x="7" y="9" transform="rotate(90)"/>',
        IN_MM,
    ),
    "style sheet": (
        "<style>.cut { stroke: #f00; fill: none } #back { display: none } .dash { stroke-dasharray: 2 1 }</style>"
        f'<path class="cut" d="{OUTLINE}"/><g class="cut">{HOLE}</g><path id="back" d="M0 0H90V50z"/>'
        '<path class="dash" d="M 0 20 H 60"/>',
        IN_MM,
    ),
    "not drawn": (
        f'<title>part</title><path d="{OUTLINE}"/>{HOLE}<text x="3" y="3">60</text><script>while(1);</script>'
        '<rect width="80" height="60" fill="white"/><path d="M5 5h9v9z" visibility="hidden"/>'
        '<path d="M5 5h9v9z" fill="none"/><image href="file:///etc/passwd" width="9" height="9"/>'
        '<clipPath id="c"><rect width="70" height="50"/></clipPath><path d="M0 20H60" style="stroke-dasharray:3,1"/>',
        IN_MM,
    ),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_give_the_same_plate(dialect, tmp_path):
    body, size = DIALECTS[dialect]
    drawing = read_drawing(written(tmp_path, body, size))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    assert len(drawing.holes) == 1 and math.isclose(
        circle_of(drawing.holes[0])[1], 3.0, rel_tol=1e-6
    )
    arcs = [each for each in drawing.outside if each.centre is not None]
    assert len(drawing.outside) - len(arcs) == 5
    assert all(math.isclose(abs(each.start - each.centre), 4.0, rel_tol=1e-6) for each in arcs)


def test_bezier_curves_for_a_circle_are_the_circle(tmp_path):
    k = KAPPA
    circle = (
        f"M 15 25 C 15 {25 + k} {12 + k} 28 12 28 S 9 {25 + k} 9 25 S {12 - k} 22 12 22 S 15 "
        f"{25 - k} 15 25 Z"
    )
    drawing = read_drawing(written(tmp_path, f'<path d="{OUTLINE}"/><path d="{circle}"/>'))
    centre, radius = circle_of(drawing.holes[0])
    assert abs(centre - (12 - 25j)) < 1e-9 and math.isclose(radius, 3.0, rel_tol=1e-9)
    assert 2e-4 * 3 < drawing.deviation < BEZIER * 3


def test_quadratic_curve_stays_a_parabola(tmp_path):
    """A side of 60 mm that bulges as the parabola with a height of 10 mm: an area of 2/3 of 60 x
    10.
    """
    drawing = read_drawing(written(tmp_path, '<path d="M0 0 Q 30 -20 60 0 V 40 H 0 Z"/>'))
    assert math.isclose(area_of(drawing), 2400 + 400, abs_tol=65 * 1.5e-4)
    points = np.concatenate(
        [each.at(np.linspace(0, 1, 9)) for each in drawing.outside if each.centre is not None]
    )
    assert np.max(np.abs(points.imag - 10 * (1 - (points.real / 30 - 1) ** 2))) < 2 * 1.5e-4


def test_layers_of_inkscape_are_marks(tmp_path):
    layers = (
        f'<g inkscape:groupmode="layer" inkscape:label="Cut" id="layer1"><path d="{OUTLINE}"/>{HOLE}</g>'
        '<g inkscape:groupmode="layer" inkscape:label="GROUND" id="layer2"><rect y="36" width="60" height="4"/></g>'
        '<path id="OUTPUT" d="M 50 5 h 4 v 4 h -4 z"/>'
        '<g inkscape:label="Dimensions" inkscape:groupmode="layer"><path d="M 0 50 H 60"/></g>'
    )
    drawing = read_drawing(written(tmp_path, layers))
    assert math.isclose(area_of(drawing), PLATE, rel_tol=ROUND_OFF)
    marks = {mark.layer: set(np.round(mark.points, 9)) for mark in drawing.marks}
    assert marks == {
        "GROUND": {-36j, 60 - 36j, 60 - 40j, -40j},
        "OUTPUT": {50 - 5j, 54 - 5j, 54 - 9j, 50 - 9j},
    }
    assert drawing.notes == ("Left out: elements of Dimensions (1).",)


def test_unit_of_the_user_replaces_that_of_the_file(tmp_path):
    body = f'<path d="{OUTLINE}"/>{HOLE}'
    path = written(tmp_path, body, 'width="300" height="200" viewBox="0 0 80 60">')
    for units, millimetres in (("mm", 1.0), ("in", 25.4), ("90dpi", 25.4 / 90), ("px", 25.4 / 96)):
        assert math.isclose(
            area_of(read_drawing(path, units=units)), PLATE * millimetres**2, rel_tol=ROUND_OFF
        )
    unstated = read_drawing(written(tmp_path, body, 'viewBox="0 0 80 60">'))
    assert unstated.notes == ("The file states no physical size, and 96 px per inch are assumed.",)
    assert math.isclose(area_of(unstated), PLATE * PIXEL**2, rel_tol=ROUND_OFF)


BOMB = (
    "".join(f'<g id="g{k}">' + f'<use href="#g{k + 1}"/>' * 10 + "</g>" for k in range(9))
    + '<path id="g9" d="M0 0h9"/>'
)
REFUSED = {
    "no XML": ("garbage", r"not readable as SVG: syntax error"),
    "cut off": (HEAD + IN_MM + f'<path d="{OUTLINE}', r"not readable as SVG"),
    "another file": ("<html><body/></html>", r"an XML file of <html>, expected <svg>"),
    "an entity": (
        '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
        + HEAD
        + IN_MM
        + "<text>&x;</text></svg>",
        r"declarations in <!DOCTYPE>",
    ),
    "nothing": (
        HEAD + IN_MM + "<text>60</text></svg>",
        r"no curve of a contour; left out: texts \(1\)",
    ),
    "repeated": (HEAD + IN_MM + BOMB + "</svg>", r"e\+\d\d elements with those that <use> repeats"),
    "repeats itself": (HEAD + IN_MM + '<g id="a"><use href="#a"/></g></svg>', r"may repeat itself"),
    "deep": (HEAD + IN_MM + "<g>" * 5000 + "</g>" * 5000 + "</svg>", r"nested more than 200 deep"),
    "no box": (
        HEAD + 'viewBox="0 0 0 60"><path d="M0 0h9v9z"/></svg>',
        r"viewBox '0 0 0 60', expected a positive",
    ),
    "no number": (HEAD + IN_MM + '<path d="M0 0H1e400V30z"/></svg>', r"finite"),
    "bad path": (
        HEAD + IN_MM + '<path d="M 0 0 L 60 x 3"/></svg>',
        r"not readable as SVG|a gap|open",
    ),
    "small": (
        HEAD + IN_MM + '<rect width="1.5" height="2.05"/></svg>',
        r"2\.05 mm across: inches\?",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line(case, tmp_path):
    path = tmp_path / "part.svg"
    path.write_text(REFUSED[case][0])
    with pytest.raises(BadInput, match=REFUSED[case][1]) as raised:
        read_drawing(path)
    assert str(raised.value).startswith(f"{path}: ") and len(str(raised.value).splitlines()) == 1


def test_a_file_that_takes_too_long_is_refused(tmp_path, monkeypatch):
    path = written(tmp_path, f'<path d="{OUTLINE}"/>{HOLE}')
    monkeypatch.setattr("flexfem.importing.limit.TIME_LIMIT", 0.0)
    with pytest.raises(BadInput, match=r"not read within 0 s, expected a simpler drawing"):
        read_drawing(path)


def test_document_type_without_declarations_is_read(tmp_path):
    head = (
        '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">'
        + HEAD
    )
    assert math.isclose(
        area_of(read_drawing(written(tmp_path, f'<path d="{OUTLINE}"/>{HOLE}', head=head))), PLATE
    )
