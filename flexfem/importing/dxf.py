"""DXF drawings, R12 to 2018, ASCII or binary: the curves of the model space in the plane, mm."""

from __future__ import annotations

import cmath
import io
import logging
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ezdxf import recover
from ezdxf.document import Drawing
from ezdxf.entities import Ellipse
from ezdxf.lldxf.tagger import binary_tags_loader

from flexfem.importing.curves import Approximation, Contents, DrawnCurve, approximated, arc, ellipse
from flexfem.importing.found import DrawnMark
from flexfem.importing.layers import is_remark
from flexfem.importing.limit import started, within_limit
from flexfem.importing.units import MM, DrawingUnit
from flexfem.mechanism.outlines import Segment, bowed
from flexfem.refused import BadInput, line_of, text_of

MOST_ENTITIES = 100_000  # also those that blocks repeat, and vertices
DEEPEST = 32  # blocks in blocks
CONTROL_POINT = 16  # flag of a vertex
HIGHEST_DEGREE = 25  # of a spline
FULL_TURN = 2 * math.pi
BINARY = b"AutoCAD Binary DXF\r\n\x1a\x00"
ENTITY = re.compile(rb"^[ \t]*0[ \t]*\r?\n[ \t]*(?:[A-Z_]|3D)", re.MULTILINE)
END = re.compile(rb"(^|\n)[ \t]*0[ \t]*\r?\n[ \t]*EOF\s*\x00*\s*$|\x00+EOF\x00+\s*$")
NOT_DRAWN = {  # what an entity is called, in the plural
    "DIMENSION": "dimensions",
    "ARC_DIMENSION": "dimensions",
    "LARGE_RADIAL_DIMENSION": "dimensions",
    "LEADER": "leaders",
    "MULTILEADER": "leaders",
    "TEXT": "texts",
    "MTEXT": "texts",
    "ATTRIB": "texts",
    "ATTDEF": "texts",
    "HATCH": "hatches",
    "MPOLYGON": "hatches",
    "XLINE": "construction lines",
    "RAY": "construction lines",
    "VIEWPORT": "viewports",
    "IMAGE": "images",
}
DASHED = re.compile(r"hidden|cent(er|re)|dash|phantom|dot|divide|iso0[2-9]|iso1\d", re.IGNORECASE)
INSUNITS = {
    1: "in",
    2: "ft",
    4: "mm",
    5: "cm",
    6: "m",
    8: "uin",
    9: "mil",
    10: "yd",
    12: "nm",
    13: "um",
    14: "dm",
}

logging.getLogger("ezdxf").setLevel(logging.CRITICAL)  # what it repairs is in its audit


class _Place(NamedTuple):
    """Where an entity stands: the layer and line type of blocks around it, and their names."""

    layer: str
    linetype: str
    groups: tuple[str, ...]


def read_dxf(
    data: bytes,
    path: Path,
    unit: DrawingUnit | None,
) -> Contents:
    """Read the curves of the model space.

    Dimensions, texts, hatches, hidden and centre lines and layers that are off are left out and
    counted.

    Raises BadInput for a file that is no complete DXF file, has too many entities or takes too
    long.
    """
    start = started()
    document, notes = _document(data)
    stated = unit or _unit_of(document)
    reader = _Reader(document, (stated or MM).millimetres, start)
    try:
        reader.read(document.modelspace(), _Place("0", "CONTINUOUS", ()), 0)
    except (BadInput, RecursionError):
        raise
    except Exception as error:  # ezdxf raises many kinds for entities without what they need
        raise BadInput(f"an entity that cannot be read: {line_of(error)[:120]}") from None
    for layout in document.layouts:
        if layout.name != "Model":
            number = sum(entity.dxftype() != "VIEWPORT" for entity in layout)
            reader.left_out["entities of a paper space"] += number
    unstated = "" if stated else "The file states no unit, and mm is assumed."
    return Contents(
        reader.curves, reader.points, +reader.left_out, reader.deviation, unstated, None, notes
    )


def _document(data: bytes) -> tuple[Any, tuple[str, ...]]:
    """Return the document, and notes about what was repaired. Raises BadInput."""
    if data.startswith(b"AC10") or data.startswith(b"AC1."):
        raise BadInput("a DWG file, expected DXF: save it as DXF")
    binary = data.startswith(BINARY)
    if not binary and b"\x00" in data[:4096]:
        raise BadInput("neither text nor a binary DXF file, expected DXF")
    number = data.count(b"\x00\x00LINE\x00") if binary else sum(1 for _ in ENTITY.finditer(data))
    if number > 2 * MOST_ENTITIES:  # a polyline of R12 has an entity for each vertex
        raise BadInput(f"{number:,} entities, expected at most {MOST_ENTITIES:,}")
    if not binary and not number:
        raise BadInput("no entity, expected a DXF file")
    if not END.search(data[-64:]):
        raise BadInput("the file ends without its end marker EOF, expected a complete DXF file")
    try:
        if binary:
            document = Drawing.load(binary_tags_loader(data))
            audit = document.audit()
        else:
            document, audit = recover.read(io.BytesIO(data))
    except Exception as error:  # ezdxf raises many kinds for what is no DXF
        raise BadInput(f"not readable as DXF: {line_of(error)[:120]}") from None
    if not len(audit.errors):
        return document, ()
    wrong = len(audit.errors) + len(audit.fixes)
    return document, (f"{wrong} faults of the DXF file were repaired.",)


def _unit_of(document: Any) -> DrawingUnit | None:
    """Return the unit that the file states."""
    code = document.header.get("$INSUNITS", 0)
    return DrawingUnit.named(INSUNITS[code]) if code in INSUNITS else None


class _Reader:
    """The curves of a document, as they are read."""

    def __init__(
        self,
        document: Any,
        scale: float,
        start: float,
    ) -> None:
        self.document = document
        self.scale = scale
        self.start = start
        self.curves = list[DrawnCurve]()
        self.points = list[DrawnMark]()
        self.left_out = Counter[str]()
        self.deviation = 0.0
        self.count = 0

    def read(
        self,
        entities: Iterable[Any],
        place: _Place,
        depth: int,
    ) -> None:
        """Read entities of a layout or a block."""
        for entity in within_limit(entities, self.start):
            self.count += 1
            if self.count > MOST_ENTITIES:
                raise BadInput(
                    f"more than {MOST_ENTITIES:,} entities with those of blocks, expected fewer"
                )
            kind = entity.dxftype()
            at = self._place(entity, place)
            reason = self._reason_to_leave(entity, kind, at)
            if reason:
                self.left_out[reason] += 1
            elif kind == "INSERT":
                self._read_block(entity, at, depth)
            else:
                self._read_entity(entity, kind, at)

    def _place(
        self,
        entity: Any,
        around: _Place,
    ) -> _Place:
        """Return where an entity stands; on layer 0 of a block it takes the layer of the block."""
        layer = str(entity.dxf.get("layer", "0"))
        if layer == "0" and around.groups:
            layer = around.layer
        linetype = str(entity.dxf.get("linetype", "BYLAYER"))
        if linetype.upper() == "BYBLOCK":
            linetype = around.linetype
        elif linetype.upper() == "BYLAYER":
            linetype = self._linetype_of(layer)
        return _Place(layer, linetype, around.groups)

    def _linetype_of(self, layer: str) -> str:
        """Return the line type of a layer."""
        if not self.document.layers.has_entry(layer):
            return "CONTINUOUS"
        return str(self.document.layers.get(layer).dxf.get("linetype", "CONTINUOUS"))

    def _reason_to_leave(
        self,
        entity: Any,
        kind: str,
        at: _Place,
    ) -> str:
        """Return as what an entity is counted that is no edge of metal, "" for a curve."""
        if kind in NOT_DRAWN:
            return NOT_DRAWN[kind]
        if entity.dxf.get("paperspace", 0):
            return "entities of a paper space"
        if entity.dxf.get("invisible", 0):
            return "invisible entities"
        if self.document.layers.has_entry(at.layer):
            layer = self.document.layers.get(at.layer)
            if layer.is_off() or layer.is_frozen():
                return f"entities on layer {at.layer}, which is off"
        if is_remark(at.layer):
            return f"entities on layer {at.layer}"
        if kind != "INSERT" and self._dashed(at.linetype):
            return f"curves of line type {at.linetype}"
        return ""

    def _dashed(self, name: str) -> bool:
        """Whether lines of a type have gaps."""
        if name.upper() == "CONTINUOUS":
            return False
        if self.document.linetypes.has_entry(name):
            tags = self.document.linetypes.get(name).pattern_tags.tags
            return any(tag.code == 49 and tag.value < 0 for tag in tags)
        return DASHED.search(name) is not None

    def _read_block(
        self,
        insert: Any,
        at: _Place,
        depth: int,
    ) -> None:
        """Read what a block reference draws, also in rows and columns."""
        if depth >= DEEPEST:
            raise BadInput(
                f"blocks in blocks deeper than {DEEPEST}, expected fewer: a block may contain "
                "itself"
            )
        copies = max(1, insert.dxf.get("row_count", 1)) * max(1, insert.dxf.get("column_count", 1))
        if copies > MOST_ENTITIES:
            raise BadInput(f"a block repeated {copies:,} times, expected at most {MOST_ENTITIES:,}")
        name = str(insert.dxf.get("name", ""))
        inside = at._replace(groups=(*at.groups, name))
        inserts = insert.multi_insert() if copies > 1 else (insert,)
        for one in within_limit(inserts, self.start):
            self.read(self._of_block(one), inside, depth + 1)

    def _of_block(self, insert: Any) -> Iterator[Any]:
        """Entities of a block at their places."""
        if insert.block() is None:
            self.left_out["references to missing blocks"] += 1
            return
        yield from insert.virtual_entities(skipped_entity_callback=self._skipped)

    def _skipped(
        self,
        entity: Any,
        _: str,
    ) -> None:
        self.left_out[NOT_DRAWN.get(entity.dxftype(), f"{entity.dxftype()} entities")] += 1

    def _read_entity(
        self,
        entity: Any,
        kind: str,
        at: _Place,
    ) -> None:
        """Add the curve of an entity."""
        if kind == "POINT":
            self.points.append(DrawnMark(at.layer, (self._plane(entity.dxf.location),)))
            return
        segments: list[Segment] | None = None
        if kind == "LINE":
            segments = [Segment(self._plane(entity.dxf.start), self._plane(entity.dxf.end))]
        elif kind in ("ARC", "CIRCLE"):
            segments = self._arc(entity, kind)
        elif kind == "LWPOLYLINE":
            corners = [(x, y, bulge) for x, y, bulge in entity.get_points("xyb")]
            segments = self._polyline(entity, corners, bool(entity.closed))
        elif kind == "POLYLINE" and not (entity.is_poly_face_mesh or entity.is_polygon_mesh):
            segments = self._old_polyline(entity)
        elif kind == "ELLIPSE":
            segments = self._kept(self._ellipse(entity))
        elif kind == "SPLINE":
            segments = self._kept(self._spline(entity))
        if segments is None:
            self.left_out[f"{kind} entities"] += 1
        elif segments:
            self.curves.append(DrawnCurve(tuple(segments), at.layer, at.groups))

    def _plane(self, point: Any) -> complex:
        """Point of the drawing, mm."""
        return complex(point[0], point[1]) * self.scale

    def _kept(self, found: Approximation) -> list[Segment]:
        self.deviation = max(self.deviation, found.deviation)
        return found.segments

    def _arc(
        self,
        entity: Any,
        kind: str,
    ) -> list[Segment]:
        """Circle or arc, which is an ellipse where its plane is inclined."""
        axis = entity.dxf.extrusion
        if math.hypot(axis.x, axis.y) > 1e-9 * abs(axis.z):
            return self._kept(self._ellipse(Ellipse.from_arc(entity)))
        centre = self._plane(entity.ocs().to_wcs(entity.dxf.center))
        radius = abs(float(entity.dxf.radius)) * self.scale
        if radius == 0:
            return []
        first = 0.0
        turn = FULL_TURN
        if kind == "ARC":
            first = math.radians(float(entity.dxf.start_angle))
            last = math.radians(float(entity.dxf.end_angle))
            turn = (last - first) % FULL_TURN or FULL_TURN
        if axis.z < 0:
            first = math.pi - first
            turn = -turn
        return arc(centre, centre + cmath.rect(radius, first), turn)

    def _polyline(
        self, entity: Any, corners: list[tuple[float, float, float]], closed: bool
    ) -> list[Segment]:
        """Lines and, where a corner has a bulge, arcs."""
        ocs = entity.ocs()
        side = -1.0 if entity.dxf.extrusion.z < 0 else 1.0
        points = [self._plane(ocs.to_wcs((x, y, 0.0))) for x, y, _ in corners]
        following = [*points[1:], *(points[:1] if closed else [])]
        segments = list[Segment]()
        for (_, _, bulge), start, end in zip(corners, points, following, strict=False):
            if start != end:
                segments += bowed(start, end, side * bulge * abs(end - start) / 2)
        self.count += len(corners)
        return segments

    def _old_polyline(self, entity: Any) -> list[Segment]:
        """Polyline of R12, of which the control points of a fitted curve are no corners."""
        corners = list[tuple[float, float, float]]()
        for vertex in entity.vertices:
            if vertex.dxf.get("flags", 0) & CONTROL_POINT:
                continue
            place = vertex.dxf.location
            bulge = 0.0 if entity.is_3d_polyline else vertex.dxf.get("bulge", 0.0)
            corners.append((place[0], place[1], bulge))
        return self._polyline(entity, corners, bool(entity.is_closed))

    def _ellipse(self, entity: Any) -> Approximation:
        first = float(entity.dxf.start_param)
        turn = (float(entity.dxf.end_param) - first) % FULL_TURN or FULL_TURN
        major = self._plane(entity.dxf.major_axis)
        minor = self._plane(entity.minor_axis)
        return ellipse(self._plane(entity.dxf.center), major, minor, first, turn)

    def _spline(self, entity: Any) -> Approximation:
        """Spline by control points, with weights, or by points that it goes through."""
        if not 1 <= entity.dxf.degree <= HIGHEST_DEGREE:
            raise BadInput(
                f"a spline of degree {entity.dxf.degree}, expected 1 to {HIGHEST_DEGREE}"
            )
        self.count += entity.control_point_count() + entity.fit_point_count()
        try:
            curve = entity.construction_tool()
            knots = np.unique(np.array(curve.knots(), dtype=float))
        except Exception as error:  # ezdxf raises many kinds for impossible splines
            raise BadInput(f"a spline that cannot be drawn: {text_of(error)[:80]}") from None
        low = knots[0]
        high = min(float(curve.max_t), knots[-1])
        knots = knots[knots <= high]

        def at(share: Any) -> Any:
            parameters = np.clip(low + (high - low) * np.ravel(share), low, high)
            points = np.array([(point.x, point.y) for point in curve.points(parameters)])
            return np.reshape(points @ [1, 1j], np.shape(share)) * self.scale

        return approximated(at, (knots - low) / (high - low))
