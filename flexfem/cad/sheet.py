"""A workshop drawing: contours by layer, dimensions and texts, independent of the file format."""

from __future__ import annotations

from typing import NamedTuple

from flexfem.mechanism.contours import Part
from flexfem.mechanism.dimensions import Dimensions
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.outlines import Segment, area, circle_of

METAL = "METAL"
HOLES = "HOLES"  # the round ones
GROUND = "GROUND"  # fixed bodies and clamped edges
MARKS = "CENTRE_MARKS"
SIZES = "DIMENSIONS"
WIRE = "WIRE_PATH"
COLOURS = {  # of each layer, dark on white
    METAL: "#1A1A1A",
    HOLES: "#B00000",
    GROUND: "#0072B2",
    MARKS: "#707070",
    SIZES: "#007A58",
    WIRE: "#CC3399",
}
LINE_PITCH = 1.6  # distance of lines of notes, over the height of their letters


class Text(NamedTuple):
    """A text of a drawing, and its middle or, if it is not centred, its lower left corner."""

    text: str
    place: complex
    is_centred: bool


class Sheet(NamedTuple):
    """Drawing in mm, x to the right and y upwards, with the origin of the mechanism.

    paths : closed loops of segments by layer, and lines as paths of one segment.
    """

    paths: dict[str, list[list[Segment]]]
    dimensions: Dimensions
    texts: list[Text]

    @property
    def title(self) -> str:
        """The first of the notes."""
        return next(text.text for text in self.texts if not text.is_centred)


def sheet_of(
    layout: Layout, part: Part, wire: Part | None, sizes: Dimensions, notes: list[str]
) -> Sheet:
    """Return the drawing of a part, with its dimensions, and with notes below.

    wire : the path of the wire's centre, if there is one.
    """
    holes = [loop for loop in part.loops if circle_of(loop) and area(loop) < 0]
    metal = [loop for loop in part.loops if loop not in holes]
    paths = {
        METAL: metal,
        HOLES: holes,
        GROUND: _ground(layout),
        MARKS: _centre_marks(layout, holes, sizes.height),
        SIZES: [[Segment(*label.line)] for label in sizes.labels],
        WIRE: wire.loops if wire else [],
    }
    used = {name: found for name, found in paths.items() if found or name == SIZES}
    texts = [Text(label.text, label.place, True) for label in sizes.labels]
    texts += _notes_below(metal, sizes, notes)
    return Sheet(used, sizes, texts)


def _ground(layout: Layout) -> list[list[Segment]]:
    """Return the outlines of fixed bodies, and clamped edges of others."""
    fixed = [list(body.outline) for body in layout.bodies if body.fixed]
    free = [body for body in layout.bodies if not body.fixed]
    return fixed + [[body.outline[k]] for body in free for k in body.clamped]


def _centre_marks(
    layout: Layout,
    holes: list[list[Segment]],
    height: float,
) -> list[list[Segment]]:
    """Return a cross at the centre of every hinge and round hole."""
    centres = [joint.place for joint in layout.joints]
    for hole in holes:
        circle = circle_of(hole)
        if circle is not None:
            centres.append(circle[0])
    halves = (height / 2, 0.5j * height)
    return [[Segment(z - half, z + half)] for z in centres for half in halves]


def _notes_below(
    metal: list[list[Segment]],
    sizes: Dimensions,
    notes: list[str],
) -> list[Text]:
    """Return lines of notes below the part and its labels."""
    corners = [segment.start for loop in metal for segment in loop]
    lowest = min(z.imag for z in [*corners, *(label.place for label in sizes.labels)])
    foot = complex(min(z.real for z in corners), lowest - 5 * sizes.height)
    pitch = 1j * LINE_PITCH
    return [
        Text(note, foot - pitch * line * sizes.height, False) for line, note in enumerate(notes)
    ]
