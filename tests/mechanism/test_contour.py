"""The part to cut: one closed contour, as large as what is meshed, and a wire's path that leaves it every neck."""

from __future__ import annotations

import cmath

import numpy as np
import pytest
import shapely
from hypothesis import Phase, assume, given, settings
from hypothesis import strategies as st

from flexfem.mechanism.bodies import draw_sector
from flexfem.mechanism.drawing import cut_path, part_of
from flexfem.mechanism.outlines import Segment, area, circle_of, polygon_points
from flexfem.mechanism.stage import Stage
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


def test_the_part_is_closed_and_as_large_as_what_is_meshed(stage) -> None:
    part = part_of(stage)
    assert gap(part.loops[0]) < CLOSED
    assert sum(bends(part.loops[0])) + sum(s.turn for s in part.loops[0]) == pytest.approx(2 * np.pi, abs=1e-9)
    meshed = sum(area(face.loop) for chain in (1, 2, 3) for face in draw_sector(stage, chain).values())
    assert part.area == pytest.approx(meshed, rel=1e-12)
    assert part_of(stage, 4.3).area == pytest.approx(meshed - 3 * np.pi * 4.3**2 / 4, rel=1e-12)
    whole = [
        segment for segment in part.loops[0] if segment.centre is None or abs(segment.start - segment.centre) > 0.1
    ]
    assert part.length == pytest.approx(sum(s.length for s in whole) + 2 * np.pi * 7.7, rel=1e-12)


def test_pads_are_rectangles_at_the_clamped_edges_with_holes_in_their_middle(stage) -> None:
    part = part_of(stage, 3.1)
    grounds = [
        segment.turned((chain - 1) * 2 * np.pi / 3)
        for chain in (1, 2, 3)
        for face in draw_sector(stage, chain).values()
        for segment, label in zip(face.loop, face.labels, strict=True)
        if label == "ground"
    ]
    for pad, ground, hole in zip(part.ground, grounds, map(circle_of, part.loops[2:]), strict=True):
        assert gap(pad) < CLOSED and area(pad) == pytest.approx(8.9**2, rel=1e-12)
        assert abs(pad[0].start - ground.start) + abs(pad[0].end - ground.end) < 1e-12
        assert [segment.length for segment in pad] == pytest.approx([8.9] * 4)
        assert abs(hole[0] - np.mean([s.start for s in pad])) < 1e-12 and hole[1] == pytest.approx(1.55)


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
    """Area beside a closed curve by Steiner: A + L d + pi d^2, less what is trimmed off at sharp inner corners."""
    try:
        part = part_of(stage)
    except BadInput:
        assume(False)
    half, sharp = kerf / 2, [bend for bend in bends(part.loops[0]) if bend < -1e-6]
    path = cut_path(part, kerf)
    assert gap(path.loops[0]) < CLOSED
    trimmed = sum(np.tan(-bend / 2) + bend / 2 for bend in sharp)
    length = sum(segment.length for segment in part.loops[0])
    expected = area(part.loops[0]) + length * half + (np.pi - trimmed) * half**2
    assert area(path.loops[0]) == pytest.approx(expected, rel=1e-9)
    assert circle_of(path.loops[1]) == pytest.approx((0, 7.7 - half))
    metal = shapely.Polygon(polygon_points(part.loops[0], 2e-2))
    shapely.prepare(metal)
    assert shapely.distance(shapely.points(polygon_points(path.loops[0], 0.1)), metal).min() > half - CHORD


def test_a_kerf_too_wide_for_the_part_is_refused(make_stage) -> None:
    """Fillets have a radius of an eighth of the link's width, 8.9 mm; link 2 comes within 2.2 mm of the platform."""
    part = part_of(make_stage({"chain.link_lengths_mm": [31.0, 33.5, 23.0]}))
    with pytest.raises(BadInput, match=r"kerf of 2.2251 mm, expected .* notch, fillet or hole, 2.225 mm"):
        cut_path(part, 2.2251)
    with pytest.raises(BadInput, match=r"than every gap of the part: the wire would cut the part at -10.6, -13.8"):
        cut_path(part, 2.2)
    assert circle_of(cut_path(part, 0.3).loops[1]) == pytest.approx((0, 7.55))
