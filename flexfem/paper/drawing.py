"""Dimensions of a stage in a workshop drawing: the lengths of chain 1, necks, platform and hub."""

from __future__ import annotations

import numpy as np

from flexfem.mechanism.dimensions import TEXT, Callout, Disc, DrawingFacts, Span
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.outlines import circle_of, disc, reverse
from flexfem.mechanism.plate import extent, plate_polygon
from flexfem.paper.stage_file import StageContent, hinges_of
from flexfem.refused import BadInput
from flexfem.units import DEGREE, LENGTH

REACHES = (1.0, 1.5, 2.0)  # of a dimension line from its length, in widths of a link
PAD_REACH = 2.5  # of the dimension line of the pad, in heights of the text
COPIES = "chains 2 and 3 as chain 1, turned by 120 and 240 degrees"
UNLABELLED = (
    "hinges are labelled on chain 1: chains 2 and 3 are the same, turned by 120 and 240 degrees"
)
STRIPS = "The stage cannot be made. Strips between the hinges stand for links that cannot be drawn"


def stage_facts(stage: StageContent) -> DrawingFacts:
    """Return what a drawing shows and states of a stage beside its outlines and sizes."""
    angles = ", ".join(f"{angle:.6g}" for angle in np.rad2deg(stage.chain.joint_angles))
    minus = "\N{MINUS SIGN}"
    chains_alike = len(set(hinges_of(stage))) == 1
    return DrawingFacts(
        discs=[Disc(0j, stage.platform.hub_radius)],
        facts=[
            f"link width {stage.chain.link_width:.6g} {LENGTH}",
            f"joint angles {angles.replace('-', minus)} {DEGREE}",
        ],
        copies=COPIES if chains_alike else "",
        unlabelled=UNLABELLED if chains_alike else "",
        named=False,
        unmade=STRIPS,
    )


def stage_spans(stage: StageContent, layout: Layout) -> list[Span]:
    """Return the lengths of the links of chain 1 and the width of its pad.

    A dimension line is the nearest one with a third of the link width as clearance from the plate,
    or the clearest one.
    """
    shape = plate_polygon(layout)
    width = stage.chain.link_width
    start, end = layout.bodies[0].outline[0][:2]
    spans = [Span("w", start, end, -PAD_REACH * TEXT * extent(shape))]
    ends = [*(joint.place for joint in layout.joints[:3]), 0j]

    def clearance(span: Span) -> float:
        return min(float(shape.distance(span.middle)), width / 3)

    for k in range(3):
        away = [side * reach * width for reach in REACHES for side in (1, -1)]
        lines = [Span(f"l{k + 1}", ends[k], ends[k + 1], distance) for distance in away]
        spans.append(max(lines, key=clearance))
    return [span.rightwards for span in spans]


def stage_callouts(stage: StageContent, layout: Layout) -> list[Callout]:
    """Return radii of notches, platform, hub and mounting holes, and necks.

    Hinges are named on chain 1 where all chains have equal hinges, otherwise on every chain.
    """
    chains_alike = len(set(hinges_of(stage))) == 1
    callouts = list[Callout]()
    for joint in layout.joints[: 3 if chains_alike else 9]:
        profile = joint.profile
        text = f"R {profile.root_radius:.6g}, t {profile.neck:.6g}"
        callouts.append(Callout(text, joint.place))
    edges = layout.bodies[-1].outline
    rims = [complex(segment.at(0.5)) for segment in edges if segment.centre == 0]
    rim = max(rims, key=lambda point: abs(point - layout.joints[2].place))
    callouts.append(Callout(f"platform R {stage.platform.radius:.6g}", rim))
    hub = stage.platform.hub_radius
    callouts.append(Callout(f"hub R {hub:.6g}", hub * rim / abs(rim)))
    for centre, radius in filter(None, map(circle_of, layout.bodies[0].holes)):
        callouts.append(Callout(f"3 holes R {radius:.6g}", centre))
    return callouts


def with_mounting_holes(
    stage: StageContent,
    layout: Layout,
    diameter: float,
) -> Layout:
    """Return the layout of a stage with a hole in the middle of every pad.

    Raises BadInput for a hole, mm, as wide as the pad.
    """
    width = stage.chain.link_width
    if not diameter < width:
        raise BadInput(
            f"mounting holes of {diameter:g} mm, expected less than the pad width: "
            f"chain.link_width_mm = {width:g}"
        )
    bodies = list(layout.bodies)
    for k, body in enumerate(bodies):
        if body.clamped:
            middle = sum(segment.start for segment in body.outline) / len(body.outline)
            hole = tuple(reverse(disc(middle, diameter / 2).loop))
            bodies[k] = body._replace(holes=(hole,))
    return layout._replace(bodies=tuple(bodies))
