"""What is on a drawing of a part, layer by layer: what the writers of DXF and SVG translate, and nothing else."""

from __future__ import annotations

from cmath import exp
from collections.abc import Iterator
from typing import NamedTuple

from flexfem.files.refusals import one_line
from flexfem.mechanism.bodies import Segment, necks
from flexfem.mechanism.designs import CHAIN_TURN
from flexfem.mechanism.drawing import Dimensions, Hole, Part, cut_path, dimensions_of
from flexfem.mechanism.stage import CHAINS, Stage
from flexfem.mechanism.stage_file import counted

METAL, HUB, MOUNTING, PADS = "METAL", "HUB_HOLE", "MOUNTING_HOLES", "CLAMPED_PADS"
MARKS, SIZES, WIRE = "CENTRE_MARKS", "DIMENSIONS", "WIRE_PATH"
LONGEST = 100  # letters of a name on a drawing
COLOURS = {  # of each layer, dark on white
    METAL: "#1A1A1A",
    HUB: "#B00000",
    MOUNTING: "#B00000",
    PADS: "#0072B2",
    MARKS: "#707070",
    SIZES: "#007A58",
    WIRE: "#CC3399",
}


class Sheet(NamedTuple):
    """A drawing in mm, x to the right and y upwards, the platform centre at the origin.

    loops : closed loops of segments by layer.   holes : circles by layer.   marks : centres to mark (complex).
    notes : lines of text below it, from `foot`, the complex place of the first.
    """

    loops: dict[str, list[list[Segment]]]
    holes: dict[str, list[Hole]]
    marks: list[complex]
    dimensions: Dimensions
    notes: list[str]
    foot: complex

    @property
    def layers(self) -> list[str]:
        """Names of the layers that hold anything, in the order of `COLOURS`."""
        used = {*self.loops, *self.holes, MARKS, SIZES}
        return [name for name in COLOURS if name in used]


def sheet_of(stage: Stage, part: Part, kerf: float | None = None) -> Sheet:
    """The drawing of a stage's part, with the path of a wire that cuts `kerf` mm wide where that is given.

    Raises BadInput for a kerf too wide for the part.
    """
    loops, holes = {METAL: [part.outer], PADS: part.pads}, {HUB: [part.hub]}
    if part.mounting:
        holes[MOUNTING] = part.mounting
    if kerf is not None:
        path = cut_path(part, kerf)
        loops[WIRE], holes[WIRE] = [path.outer], path.holes
    placed = [pose.point * exp(1j * (chain - 1) * CHAIN_TURN) for chain in CHAINS for pose in necks(stage, chain)]
    sizes = dimensions_of(stage, part)
    ends = [each.start for each in part.outer]
    lowest = min(z.imag for z in [*ends, *(label.place for label in sizes.labels)])
    foot = complex(min(z.real for z in ends), lowest - 5 * sizes.height)
    marks = [*placed, *(hole.centre for hole in part.holes)]
    return Sheet(loops, holes, marks, sizes, list(notes_of(stage, part, kerf)), foot)


def notes_of(stage: Stage, part: Part, kerf: float | None) -> Iterator[str]:
    """What a reader of the drawing must know, one line each."""
    yield one_line(stage.name, LONGEST)
    yield f"mm; thickness {stage.thickness:.6g}; {one_line(stage.material.name, LONGEST)}"
    if stage.chains_alike:
        yield "chains 2 and 3 as chain 1, turned by 120 and 240 degrees"
    for said, keys in (("ASSUMED", stage.assumed), ("NO STATED SOURCE", stage.not_stated)):
        if keys:
            yield f"{said}: {counted(len(keys), 'number', 'numbers')} of geometry and material"
    yield "In the models: clamped along the back edges of the pads, the hub hole filled by a rigid disc."
    if part.mounting:
        yield "Not in the models: the mounting holes."
    if kerf is not None:
        yield f"{WIRE}: middle of a cut {kerf:.6g} mm wide, wire and spark gap together"
