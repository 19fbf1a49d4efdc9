"""The drawn stage: closed, in one piece, as wide as it says, and with the notches that the hinge
formulas integrate.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import Face, Segment, area, polygon_points
from flexfem.paper.bodies import BODIES, centrelines, draw_sector, turn
from flexfem.paper.designs import stage_frames
from flexfem.paper.stage import HINGE_NAMES, Stage
from flexfem.refused import BadInput

ROUND_OFF = 1e-9  # mm; coordinates near 70 mm, after a dozen turns and tangents
GRID = 1e-9  # mm; polygons of neighbouring thirds differ by a rounding where they meet
FINE = 2e-3  # rad per chord: a chord leaves R step^2/8 = 2e-6 mm of a 4 mm arc
CHORD = 5e-6  # mm of thickness, two chords of FINE with some room
CHAINS = (1, 2, 3)


def thirds(stage: Stage) -> Iterator[tuple[int, str, Face]]:
    """All twelve faces, in their places."""
    for chain in CHAINS:
        for body, face in draw_sector(stage, chain).items():
            yield chain, body, Face(turn(face.loop, chain), face.labels)


def polygons(stage: Stage, step: float = FINE) -> dict[tuple[int, str], shapely.Polygon]:
    return {
        (chain, body): shapely.Polygon(polygon_points(face.loop, step))
        for chain, body, face in thirds(stage)
    }


def labelled(face: Face, label: str) -> list[Segment]:
    return [
        segment for segment, found in zip(face.loop, face.labels, strict=True) if found == label
    ]


def across(place: complex, direction: complex, reach: float) -> shapely.LineString:
    ends = place - reach * direction, place + reach * direction
    return shapely.LineString([(end.real, end.imag) for end in ends])


def hinges(stage: Stage) -> Iterator[tuple[int, str, complex, complex]]:
    """Chain, name, neck centre and unit vector along the neck of all nine hinges."""
    placed = stage_frames(stage)
    for chain, (k, name) in (
        (chain, named) for chain in CHAINS for named in enumerate(HINGE_NAMES)
    ):
        yield (
            chain,
            name,
            complex(*placed.centres[chain - 1, k]),
            cmath.exp(1j * placed.axes[chain - 1, k]),
        )


def test_twelve_faces_make_one_ring_around_the_hub(stage: Stage) -> None:
    shapes = polygons(stage)
    whole = shapely.union_all(list(shapes.values()), grid_size=GRID)
    assert whole.geom_type == "Polygon" and len(whole.interiors) == 1
    assert whole.area == pytest.approx(
        sum(shape.area for shape in shapes.values()), rel=1e-8
    )  # GRID times perimeter
    hub = shapely.Polygon(whole.interiors[0])
    assert hub.area == pytest.approx(np.pi * stage.platform.hub_radius**2, rel=1e-5)  # chords
    assert abs(complex(hub.centroid.x, hub.centroid.y)) < 1e-6


def test_links_are_as_wide_as_the_file_says_all_along(stage: Stage) -> None:
    shapes = polygons(stage)
    width = stage.chain.link_width
    measured = 0
    for chain in CHAINS:
        for body, line in zip(BODIES, centrelines(stage, chain), strict=False):
            for segment in turn(line, chain):
                for share in (0.12, 0.5, 0.93):
                    place = complex(segment.at(share))
                    outward = 1j * complex(segment.tangent(share))
                    found = (
                        shapes[chain, body]
                        .intersection(across(place, outward, 0.55 * width))
                        .length
                    )
                    assert found == pytest.approx(width, abs=3 * CHORD), (
                        chain,
                        body,
                    )  # wide arcs, longer chords
                    measured += 1
    assert measured > 9 * 6  # a pad and two links of several segments


def test_pads_are_square_and_clamped_along_their_back(stage: Stage) -> None:
    width = stage.chain.link_width
    placed = {(chain, name): (centre, along) for chain, name, centre, along in hinges(stage)}
    for chain, body, face in thirds(stage):
        grounds = labelled(face, "ground")
        assert len(grounds) == (1 if body == "pad" else 0)
        for edge in grounds:
            centre, along = placed[chain, "base"]
            back = centre - (stage.hinge(chain, "base").radius + width) * along
            assert edge.length == pytest.approx(width, abs=ROUND_OFF)
            assert abs((edge.start + edge.end) / 2 - back) < ROUND_OFF


def test_two_degrees_of_rim_between_lugs_are_enough_and_less_is_refused(
    make_stage: Callable[..., Stage],
) -> None:
    """A lug of 117.95 degrees leaves 2.05, one of 118.05 degrees 1.95."""
    crowded = {"chain.joint_angles_deg": [175.0, -85.0, 70.0], "platform.hub_radius_mm": 2.0}
    stage = make_stage({**crowded, "platform.radius_mm": 9.26833})
    rims = [s.turn for s in labelled(draw_sector(stage, 1)["platform"], "free") if s.centre == 0]
    assert np.degrees(sum(rims)) == pytest.approx(2.05, abs=1e-3)
    with pytest.raises(BadInput, match="each covers 118 of 120 degrees"):
        draw_sector(make_stage({**crowded, "platform.radius_mm": 9.25773}), 1)


def about(value: float, share: float) -> st.SearchStrategy[float]:
    return st.floats(value * (1 - share), value * (1 + share))


def near(value: float, by: float) -> st.SearchStrategy[float]:
    return st.floats(value - by, value + by)


AXES = st.one_of(st.none(), st.floats(-360.0, 360.0))
# Half of the designs keep their default axes and most keep a modest width: else nearly all would be
# refused.
CHANGES = st.fixed_dictionaries(
    {
        "chain.link_lengths_mm": st.tuples(about(31.0, 0.3), about(33.5, 0.3), about(25.0, 0.3)),
        "chain.joint_angles_deg": st.tuples(near(175.0, 25.0), near(-85.0, 25.0), near(92.0, 25.0)),
        "chain.link_width_mm": st.floats(5.0, 11.0),
        "hinges.base.radius_mm": st.floats(0.3, 4.0),
        "hinges.elbow.radius_mm": st.floats(0.3, 3.0),
        "hinges.platform.radius_mm": st.floats(0.3, 3.0),
        "hinges.base.neck_mm": st.floats(0.02, 1.5),
        "hinges.elbow.neck_mm": st.floats(0.02, 1.5),
        "hinges.platform.neck_mm": st.floats(0.02, 1.5),
        "platform.radius_mm": st.floats(9.0, 20.0),
        "platform.hub_radius_mm": st.floats(2.0, 9.5),
    },
    optional={f"hinges.{name}.axis_deg": AXES for name in HINGE_NAMES},
)
OVERRIDES = st.lists(
    st.fixed_dictionaries(
        {
            "chain": st.integers(1, 3),
            "hinge": st.sampled_from(HINGE_NAMES),
            "neck_mm": st.floats(0.02, 1.5),
        },
        optional={"radius_mm": st.floats(0.3, 4.0), "axis_deg": st.floats(-360.0, 360.0)},
    ),
    max_size=2,
    unique_by=lambda override: (override["chain"], override["hinge"]),
)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(CHANGES, OVERRIDES)
def test_any_stage_is_refused_in_one_line_or_drawn_in_one_piece(
    make_stage, changes, override
) -> None:
    stage = make_stage({**changes, "override": override})
    try:
        check_feasible(stage)
    except BadInput as refusal:
        assert str(refusal) and "\n" not in str(refusal) and "nan" not in str(refusal)
        return
    shapes = polygons(stage, 0.02)
    assert all(area(face.loop) > 0 for _, _, face in thirds(stage))
    whole = shapely.union_all(list(shapes.values()), grid_size=GRID)
    assert (
        whole.geom_type == "Polygon" and len(whole.interiors) >= 1
    )  # more when neighbouring chains touch
    assert whole.area == pytest.approx(
        sum(shape.area for shape in shapes.values()), rel=1e-6
    )  # GRID times perimeter
