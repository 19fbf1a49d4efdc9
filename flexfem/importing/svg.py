"""SVG drawings: paths and shapes with their transforms, mm, y upwards.

The text is parsed here, so that a file can neither declare entities nor refer to others;
svgelements then draws it.
"""

from __future__ import annotations

import io
import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import svgelements

from flexfem.importing.curves import Approximation, Contents, DrawnCurve, arc, bezier, ellipse
from flexfem.importing.layers import is_mark, is_remark, is_screws
from flexfem.importing.limit import started, within_limit
from flexfem.importing.network import SNAP
from flexfem.importing.units import INCH, LENGTHS, DrawingUnit
from flexfem.mechanism.outlines import Segment
from flexfem.refused import BadInput, line_of, text_of

MOST_ELEMENTS = 200_000  # also those that `use` repeats
LARGEST_FILE = 20_000_000  # bytes; some 500,000 lines
DEEPEST = 200  # elements in elements
LONGEST_STYLE = 100_000  # characters of a style sheet
LONGEST_TRANSFORM = 2_000
DOTS_PER_INCH = 96  # of CSS
SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
HREF = "{http://www.w3.org/1999/xlink}href"
LAYER = "data-flexfem-layer"  # attributes that are added to the elements of a file
GROUPS = "data-flexfem-groups"
SEPARATOR = "\t"
SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
CONTAINERS = ("svg", "g", "defs", "use", "a", "switch", "style", "symbol")
NOT_DRAWN = {  # what an element is called, in the plural
    "text": "texts",
    "image": "images",
    "foreignObject": "foreign objects",
    "script": "scripts",
    "clipPath": "clip paths",
    "mask": "masks",
    "marker": "markers",
    "pattern": "patterns",
    "linearGradient": "gradients",
    "radialGradient": "gradients",
}
SILENT = ("title", "desc", "metadata", "namedview")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
PHYSICAL = re.compile(rf"\s*{NUMBER}\s*(mm|cm|in|pt|pc)\s*")
LENGTH = re.compile(rf"\s*({NUMBER})\s*(mm|cm|in|pt|pc|px)?\s*")
PLACES = ("x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "x1", "y1", "x2", "y2")
SAME_SCALE = 1e-3  # of the scales of both directions, per scale
DEFAULT_PIXELS = 1e3  # width and height of a page that states none
UNPAINTED = ("none", "transparent")
ON_CHORD = 1e-9  # mm^2; distance of the points of a Bezier curve that is a line, times its length
ROUND_OFF = 1e-9  # of radii, per radius, and of turns, rad
UNSTATED = f"The file states no physical size, and {DOTS_PER_INCH} px per inch are assumed."
SOLID = re.compile(r"\s*(none|0*(\.0*)?(px|mm)?([\s,]+0*(\.0*)?(px|mm)?)*)\s*", re.IGNORECASE)


def read_svg(data: bytes, unit: DrawingUnit | None) -> Contents:
    """Read the paths and shapes of a drawing.

    A group, an Inkscape layer or an element itself gives a curve the name of its layer. Texts,
    images, dashed lines and what is not painted are left out and counted.

    Raises BadInput for a file that is not XML, declares entities, repeats too many elements or
    takes too long.
    """
    start = started()
    if len(data) > LARGEST_FILE:
        raise BadInput(f"{len(data):,} bytes, expected at most {LARGEST_FILE:,}")
    root = _parsed(data)
    if root.tag not in (f"{SVG}svg", "svg"):
        raise BadInput(f"an XML file of <{_name(root)[:40]}>, expected <svg>")
    left_out = Counter[str]()
    _simplify(root, left_out)
    _check_repeated(root)
    _name_layers(root, (), "")
    page = _page(root)
    scale = page.scale if unit is None else unit.millimetres
    unstated = "" if page.stated or unit is not None else UNSTATED
    for key in ("width", "height", "viewBox", "preserveAspectRatio"):
        root.attrib.pop(key, None)
    reader = _Reader(page, scale, left_out, start)
    try:
        text = io.BytesIO(ElementTree.tostring(root))
        drawn = svgelements.SVG.parse(
            text,
            width=page.width,
            height=page.height,
            on_error="raise",
        )
        reader.read(drawn)
    except BadInput:
        raise
    except Exception as error:  # svgelements raises many kinds for impossible values
        raise BadInput(f"not readable as SVG: {line_of(error)[:120]}") from None
    return Contents(reader.curves, [], +left_out, reader.deviation, unstated)


def _name(element: ElementTree.Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


# The text of the file


class _Builder:
    """A tree of limited size from the events of a parser that refuses declared entities."""

    def __init__(self) -> None:
        self.tree = ElementTree.TreeBuilder()
        self.depth = 0
        self.count = 0

    def start(
        self,
        name: str,
        attributes: dict[str, str],
    ) -> None:
        """Begin an element."""
        self.depth += 1
        self.count += 1
        if self.depth > DEEPEST:
            raise BadInput(f"elements nested more than {DEEPEST} deep, expected fewer")
        if self.count > MOST_ELEMENTS:
            raise BadInput(f"more than {MOST_ELEMENTS:,} elements, expected fewer")
        qualified = {_qualified(key): value for key, value in attributes.items()}
        self.tree.start(_qualified(name), qualified)

    def end(self, name: str) -> None:
        """End an element."""
        self.depth -= 1
        self.tree.end(_qualified(name))


def _qualified(name: str) -> str:
    """Name as ElementTree writes it, {namespace}name."""
    return "{" + name if "}" in name else name


def _refuse_declarations(
    _name: str, _system: str | None, _public: str | None, has_internal_subset: bool
) -> None:
    if has_internal_subset:
        raise BadInput(
            "declarations in <!DOCTYPE>, which flexfem does not read, expected a file without them"
        )


def _parsed(data: bytes) -> ElementTree.Element:
    """Return the root of an XML text. Raises BadInput."""
    if data[:2] == b"\x1f\x8b":
        raise BadInput("a compressed file, expected SVG text")
    builder = _Builder()
    parser = expat.ParserCreate(namespace_separator="}")
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.tree.data
    parser.StartDoctypeDeclHandler = _refuse_declarations
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
        return builder.tree.close()
    except (expat.ExpatError, ValueError, LookupError, AssertionError) as error:
        raise BadInput(
            f"not readable as SVG: {text_of(error)[:120]}, expected an SVG file"
        ) from None


def _simplify(element: ElementTree.Element, left_out: Counter[str]) -> None:
    """Take away what draws no curve, and what svgelements would take long for."""
    for child in list(element):
        name = _name(child)
        known = child.tag in (f"{SVG}{name}", name)
        if known and name in (*SHAPES, *CONTAINERS):
            _check_texts(child, name)
            _simplify(child, left_out)
            continue
        element.remove(child)
        if name not in SILENT and known:
            left_out[NOT_DRAWN.get(name, f"<{name[:40]}> elements")] += 1


def _view(root: ElementTree.Element) -> tuple[float, float, float, float] | None:
    """Return x, y, width and height of the `viewBox`, None without one. Raises BadInput."""
    texts = re.split(r"[\s,]+", root.get("viewBox", "").strip())
    numbers = [number for number in map(_number, texts) if number is not None]
    if len(texts) != 4 or len(numbers) != 4:
        return None
    x, y, width, height = numbers
    if width <= 0 or height <= 0:
        raise BadInput(
            f"viewBox {root.get('viewBox')!r}, expected a positive width and height"[:120]
        )
    return x, y, width, height


def _check_texts(element: ElementTree.Element, name: str) -> None:
    """Refuse texts that a parser takes long for; a style sheet has no long blanks then."""
    if name == "style":
        text = " ".join("".join(element.itertext()).split())
        if len(text) > LONGEST_STYLE:
            raise BadInput(
                f"a style sheet of {len(text):,} characters, expected at most {LONGEST_STYLE:,}"
            )
        element.text = text
    for key in PLACES:
        text = element.get(key, "")
        length = _millimetres(text) if PHYSICAL.fullmatch(text) else None
        if length is not None:  # svgelements rounds the inch
            element.set(key, repr(length * DOTS_PER_INCH / INCH))
    if len(element.get("transform", "")) > LONGEST_TRANSFORM:
        raise BadInput(f"a transform of more than {LONGEST_TRANSFORM:,} characters, expected fewer")


def _check_repeated(root: ElementTree.Element) -> None:
    """Refuse elements that repeat each other too often, or themselves."""
    named = {each.get("id"): each for each in root.iter() if each.get("id")}
    sizes = dict[int, float]()

    def size(element: ElementTree.Element, depth: int) -> float:
        if depth > DEEPEST:
            raise BadInput(
                f"<use> nested more than {DEEPEST} deep, expected fewer: an element may repeat "
                "itself"
            )
        key = id(element)
        if key not in sizes:
            target = named.get(_target(element)) if _name(element) == "use" else None
            own = 1.0 + sum(size(child, depth + 1) for child in element)
            sizes[key] = own + (0.0 if target is None else size(target, depth + 1))
        return sizes[key]

    total = size(root, 0)
    if total > MOST_ELEMENTS:
        raise BadInput(
            f"{total:.3g} elements with those that <use> repeats, expected at most "
            f"{MOST_ELEMENTS:,}"
        )


def _target(element: ElementTree.Element) -> str | None:
    """Id of the element that <use> repeats; other files are not read."""
    link = element.get("href") or element.get(HREF) or ""
    return link[1:] if link.startswith("#") else None


def _name_layers(
    element: ElementTree.Element,
    groups: tuple[str, ...],
    layer: str,
) -> None:
    """Write on every element the names that it is in, and which of them is its layer."""
    label = element.get(f"{INKSCAPE}label")
    names = [each for each in (label, element.get("id")) if each]
    if _name(element) != "svg":
        groups = (*groups, *names)
        telling = [each for each in names if _tells(each)]
        if telling:
            layer = telling[0]
        elif _name(element) == "g" and names and not _tells(layer):
            layer = names[0]
    element.set(LAYER, layer)
    element.set(GROUPS, SEPARATOR.join(groups))
    for child in element:
        _name_layers(child, groups, layer)


def _tells(layer: str) -> bool:
    return is_mark(layer) or is_screws(layer) or is_remark(layer)


class _Page(NamedTuple):
    """The visible part of a drawing in its user units.

    scale : mm per user unit.   stated : whether the file states it.
    """

    x: float
    y: float
    width: float
    height: float
    scale: float
    stated: bool

    def is_covered(self, box: tuple[float, float, float, float] | None) -> bool:
        """Whether a box of lowest and highest x and y covers the page."""
        if box is None:
            return False
        low = complex(box[0] - self.x, box[1] - self.y)
        high = complex(box[2] - self.x, box[3] - self.y)
        near = 1e-6 * max(self.width, self.height)
        return (
            max(low.real, low.imag) <= near
            and high.real >= self.width - near
            and high.imag >= self.height - near
        )


def _page(root: ElementTree.Element) -> _Page:
    """Return the page.

    A user unit is a pixel of CSS unless width or height and `viewBox` say otherwise.
    """
    pixel = INCH / DOTS_PER_INCH
    width = _positive(_millimetres(root.get("width")))
    height = _positive(_millimetres(root.get("height")))
    view = _view(root)
    if view is None:
        across = (width or DEFAULT_PIXELS * pixel) / pixel
        up = (height or DEFAULT_PIXELS * pixel) / pixel
        return _Page(0.0, 0.0, across, up, pixel, False)
    x, y, across, up = view
    scales = list[float]()
    if width:
        scales.append(width / across)
    if height:
        scales.append(height / up)
    fit = root.get("preserveAspectRatio", "")
    if "none" in fit and len(scales) == 2 and abs(scales[0] / scales[1] - 1) > SAME_SCALE:
        raise BadInput("a viewBox that is stretched in one direction, expected equal scales")
    chosen = max if "slice" in fit else min
    stated = any(PHYSICAL.fullmatch(root.get(key, "")) for key in ("width", "height"))
    return _Page(x, y, across, up, chosen(scales, default=pixel), stated)


def _positive(length: float | None) -> float | None:
    return length if length is not None and length > 0 else None


def _number(text: str) -> float | None:
    """Return the finite number that a text states, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _millimetres(text: str | None) -> float | None:
    """Return a length in mm; None for no length or a share of another."""
    found = LENGTH.fullmatch(text or "")
    value = None if found is None else _number(found[1])
    if found is None or value is None:
        return None
    return value * LENGTHS[found[2] or "px"]


# Its curves


class _Reader:
    """The curves of a drawing, as they are read."""

    def __init__(
        self,
        page: _Page,
        scale: float,
        left_out: Counter[str],
        start: float,
    ) -> None:
        self.page = page
        self.scale = scale
        self.start = start
        self.left_out = left_out
        self.curves = list[DrawnCurve]()
        self.deviation = 0.0

    def read(self, drawn: Any) -> None:
        """Read all shapes of a drawing."""
        for element in within_limit(drawn.elements(), self.start):
            if not isinstance(element, svgelements.Shape):
                continue
            values = element.values
            layer = str(values.get(LAYER) or "")
            reason = self._reason_to_leave(element, values, layer)
            if reason:
                self.left_out[reason] += 1
                continue
            groups = tuple(str(values.get(GROUPS) or "").split(SEPARATOR))
            for segments in self._subpaths(svgelements.Path(element).reify()):
                self.curves.append(DrawnCurve(tuple(segments), layer or "0", groups))

    def _reason_to_leave(
        self,
        element: Any,
        values: dict[str, Any],
        layer: str,
    ) -> str:
        """Return as what a shape is counted that is no edge of metal, "" for an edge."""
        if is_remark(layer):
            return f"elements of {layer}"
        if str(values.get("visibility", "")).strip() in ("hidden", "collapse"):
            return "hidden elements"
        has_stroke = str(values.get("stroke", "none")).strip() not in UNPAINTED
        has_fill = str(values.get("fill", "black")).strip() not in UNPAINTED
        if not has_stroke and not has_fill:
            return "elements that are not painted"
        if not SOLID.fullmatch(str(values.get("stroke-dasharray") or "none")):
            return "dashed lines"
        is_unstroked = isinstance(element, svgelements.Rect) and not has_stroke
        if is_unstroked and self.page.is_covered(element.bbox()):
            return "backgrounds"
        return ""

    def _point(self, point: Any) -> complex:
        """Point of the drawing, mm, y upwards."""
        return complex(float(point.x), -float(point.y)) * self.scale

    def _kept(self, found: Approximation) -> list[Segment]:
        self.deviation = max(self.deviation, found.deviation)
        return found.segments

    def _subpaths(self, path: Any) -> Iterator[list[Segment]]:
        """Lines and arcs of a path, one list for each of its parts."""
        segments = list[Segment]()
        for piece in path:
            if isinstance(piece, svgelements.Move):
                if segments:
                    yield segments
                segments = []
            else:
                segments += self._drawn(piece)
        if segments:
            yield segments

    def _drawn(self, piece: Any) -> list[Segment]:
        """Lines and arcs of one command of a path."""
        if piece.start is None or piece.end is None:
            return []
        start = self._point(piece.start)
        end = self._point(piece.end)
        if isinstance(piece, svgelements.CubicBezier):
            controls = [piece.control1, piece.control2]
            return self._bezier([start, *map(self._point, controls), end])
        if isinstance(piece, svgelements.QuadraticBezier):
            return self._bezier([start, self._point(piece.control), end])
        if isinstance(piece, svgelements.Arc):
            return self._arc(piece, start, end)
        return _line(start, end)

    def _bezier(self, points: list[complex]) -> list[Segment]:
        """Lines and arcs of a Bezier curve."""
        start = points[0]
        end = points[-1]
        local = [(z - start) * (end - start).conjugate() for z in points]
        along = [z.real for z in local]
        if along == sorted(along) and all(abs(z.imag) < ON_CHORD for z in local):
            return _line(start, end)
        return self._kept(bezier(points))

    def _arc(
        self,
        piece: Any,
        start: complex,
        end: complex,
    ) -> list[Segment]:
        """Arc of a circle or an ellipse."""
        across = float(piece.rx) * self.scale
        up = float(piece.ry) * self.scale
        turn = float(piece.sweep)
        if min(across, up) <= 0 or not math.isfinite(turn):
            return _line(start, end)
        centre = self._point(piece.center)
        if abs(across - up) > ROUND_OFF * max(across, up):
            angle = float(piece.get_rotation())
            major = complex(math.cos(angle), -math.sin(angle)) * across
            minor = complex(-math.sin(angle), -math.cos(angle)) * up
            return self._kept(ellipse(centre, major, minor, float(piece.get_start_t()), turn))
        if abs(across - abs(end - start) / 2) < SNAP:
            # Rounded numbers tell the centre of half a circle badly.
            centre = (start + end) / 2
            turn = math.copysign(math.pi, turn)
        found = arc(centre, start, -turn)
        if found and abs(turn) < 2 * math.pi - ROUND_OFF:
            found[-1] = found[-1]._replace(end=end)
        return found


def _line(start: complex, end: complex) -> list[Segment]:
    """Return a line, none of no length."""
    return [Segment(start, end)] if start != end else []
