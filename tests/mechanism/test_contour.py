"""The part to cut: one closed contour, as large as what is meshed, and a wire's path that leaves it
every neck.
"""

from __future__ import annotations

import cmath

import numpy as np
import pytest
import shapely
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from flexfem.fem.plate_mesh import plate_contours
from flexfem.mechanism.contours import Part, cut_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import Segment, area, circle_of, polygon_points
from flexfem.mechanism.plate import plate_polygon
from flexfem.paper.bodies import draw_sector
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

from .test_bodies import about

CLOSED = 1e-8  # mm; walls shorter than a millionth of a micrometre are left out
CHORD = 3e-4  # mm, of the polygons


def bends(loop: list[Segment]) -> list[float]:
    """Angles turned from each segment to the next, rad."""
    pairs = zip(loop, [*loop[1:], loop[0]], strict=True)
    return [cmath.phase(b.tangent(0.0) / a.tangent(1.0)) for a, b in pairs]


def gap(loop: list[Segment]) -> float:
    return max(abs(a.end - b.start) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True))


def part_of(stage: Stage) -> Part:
    return Part(plate_contours(stage.layout))


def test_the_part_is_closed_and_as_large_as_what_is_meshed(stage) -> None:
    part = part_of(stage)
    assert gap(part.loops[0]) < CLOSED
    assert sum(bends(part.loops[0])) + sum(s.turn for s in part.loops[0]) == pytest.approx(
        2 * np.pi, abs=1e-9
    )
    meshed = [face.loop for chain in (1, 2, 3) for face in draw_sector(stage, chain).values()]
    assert part.area == pytest.approx(sum(map(area, meshed)), rel=1e-12)
    assert plate_polygon(stage.layout).area == pytest.approx(part.area, rel=2e-5)  # chords
    assert circle_of(part.loops[1]) == pytest.approx((0, 7.7))


def test_a_stage_is_a_mechanism_of_ten_bodies_clamped_at_the_backs_of_its_pads(stage) -> None:
    layout = stage.layout
    assert [body.name for body in layout.bodies][:3] == [
        "pad of chain 1",
        "link 1 of chain 1",
        "link 2 of chain 1",
    ]
    ends = [
        (3 * chain + k, 3 * chain + k + 1 if k < 2 else 9) for chain in range(3) for k in range(3)
    ]
    assert [joint.bodies for joint in layout.joints] == ends
    grounds = [
        segment.turned((chain - 1) * 2 * np.pi / 3)
        for chain in (1, 2, 3)
        for face in draw_sector(stage, chain).values()
        for segment, label in zip(face.loop, face.labels, strict=True)
        if label == "ground"
    ]
    for pad, ground in zip(layout.bodies[:9:3], grounds, strict=True):
        assert gap(list(pad.outline)) < CLOSED and area(pad.outline) == pytest.approx(
            8.9**2, rel=1e-12
        )
        (back,) = (pad.outline[k] for k in pad.clamped)
        assert abs(back.start - ground.start) + abs(back.end - ground.end) < 1e-12


USUAL = st.fixed_dictionaries(  # that can be made
    {
        "chain.link_lengths_mm": st.tuples(about(31.0, 0.1), about(33.5, 0.03), about(25.0, 0.02)),
        "chain.link_width_mm": st.floats(8.5, 9.5),
        "hinges.base.axis_deg": st.floats(165.0, 195.0),
        "hinges.platform.radius_mm": st.floats(0.7, 2.0),
        "hinges.platform.neck_mm": st.floats(0.02, 1.5),
    }
)


@settings(max_examples=3, phases=[Phase.generate])  # what fails is plain as it is
@given(USUAL, st.floats(0.05, 1.2))
def test_a_wire_leaves_the_part_and_every_neck(make_stage, changes, kerf) -> None:
    require_beside(make_stage(changes), kerf)


def require_beside(stage: Stage, kerf: float) -> None:
    """Area beside a closed curve by Steiner: A + L d + pi d^2, less what is trimmed off at sharp
    inner corners.
    """
    try:
        check_feasible(stage)
    except BadInput:
        assume(False)
    part = part_of(stage)
    half = kerf / 2
    sharp = [bend for bend in bends(part.loops[0]) if bend < -1e-6]
    path = cut_path(part, kerf)
    assert gap(path.loops[0]) < CLOSED
    trimmed = sum(np.tan(-bend / 2) + bend / 2 for bend in sharp)
    length = sum(segment.length for segment in part.loops[0])
    expected = area(part.loops[0]) + length * half + (np.pi - trimmed) * half**2
    assert area(path.loops[0]) == pytest.approx(expected, rel=1e-9)
    assert circle_of(path.loops[1]) == pytest.approx((0, 7.7 - half))
    metal = shapely.Polygon(polygon_points(part.loops[0], 2e-2))
    shapely.prepare(metal)
    assert (
        shapely.distance(shapely.points(polygon_points(path.loops[0], 0.1)), metal).min()
        > half - CHORD
    )


def test_a_kerf_too_wide_for_the_part_is_refused(make_stage) -> None:
    """Fillets have a radius of an eighth of the link's width, 8.9 mm; link 2 comes within 2.2 mm of
    the platform.
    """
    part = part_of(make_stage({"chain.link_lengths_mm": [31.0, 33.5, 23.0]}))
    with pytest.raises(
        BadInput, match=r"kerf of 2.2251 mm, expected .* notch, fillet or hole, 2.225 mm"
    ):
        cut_path(part, 2.2251)
    with pytest.raises(
        BadInput, match=r"than every gap of the part: the wire would cut the part at -10.6, -13.8"
    ):
        cut_path(part, 2.2)
    assert circle_of(cut_path(part, 0.3).loops[1]) == pytest.approx((0, 7.55))
