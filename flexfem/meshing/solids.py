"""Plates in STEP files: one is written, and the solid of another program becomes a plate."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.outlines import area
from flexfem.meshing.contours import contours_of_faces
from flexfem.meshing.requests import FoundSection, NamedArrays, PlateSolid, SolidSection
from flexfem.meshing.session import gmsh_session
from flexfem.meshing.shapes import draw_union

SECTION_ERROR = 2e-5  # mm; of arcs in place of another curve of a solid that another program wrote
PERPENDICULAR = 1e-5  # most cosine between the normals of a plate and of a face perpendicular to it
SOLID_NAME = re.compile(rb"MANIFOLD_SOLID_BREP\s*\(\s*'((?:[^']|'')*)'")
ON_SIDE = 1e-4  # mm; a plane face at a smaller distance from a side of a plate is a part of it
ALREADY_FLAT = 1e-12  # sine of the angle between the normal of a plate and z; round-off
PARALLEL = 1 - 1e-9  # least cosine between the normals of parallel faces
MOST_DIRECTIONS = 30  # of plane faces that may be the sides of a plate
MOST_MEMORY = 6_000_000_000  # bytes, while a solid of another program is read


def write_plate(solid: PlateSolid) -> NamedArrays:
    """Write a plate as a STEP file, its arcs as cylinders, in mm, and read it back.

    Returns
    -------
    volumes (n,), mm^3, of the n solids in the file, exact mass properties; box (2, 3), mm, lowest
    and highest corner."""
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        kernel.extrude(draw_union(kernel, solid.regions), 0.0, 0.0, solid.thickness)
        kernel.synchronize()
        corners = gmsh.model.getBoundary(gmsh.model.getEntities(3), False, False, True)
        centres_of_arcs = [point for point in kernel.getEntities(0) if point not in corners]
        kernel.remove(centres_of_arcs)
        kernel.synchronize()
        gmsh.write(solid.path)
        gmsh.clear()
        solids = [tag for dim, tag in kernel.importShapes(solid.path) if dim == 3]
        kernel.synchronize()
        return {
            "volumes": np.array([kernel.getMass(3, tag) for tag in solids]),
            "box": np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)),
        }


def section_of(job: SolidSection) -> FoundSection:
    """Cut one solid of a STEP file half way between its two sides.

    The plate is perpendicular to the direction along which most of the surface is parallel or
    perpendicular to it, of equal ones the direction of the smallest thickness. Its two sides are
    the plane faces across it with most area.
    """
    with _limited_memory(), gmsh_session() as gmsh:
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
        kernel = gmsh.model.occ
        solids, names = _imported_solids(gmsh.model, job.path)
        chosen = _chosen(job.part, names)
        if chosen < 0:
            return FoundSection([], names, -1)
        solid = (3, solids[chosen])
        kernel.remove([(3, tag) for tag in solids if tag != solid[1]], recursive=True)
        kernel.synchronize()
        boundary = gmsh.model.getBoundary([solid], oriented=False)
        faces = [_SolidFace.of(gmsh.model, tag) for _, tag in boundary]
        sides = _sides(faces)
        volume = kernel.getMass(*solid)
        if sides is None:
            return FoundSection([], names, chosen, solid=volume, other=_counted_faces(faces))
        _lay_flat(kernel, solid, sides)
        contours = contours_of_faces(gmsh.model, _cut_in_middle(kernel, solid), SECTION_ERROR)
        return FoundSection(
            contours,
            names,
            chosen,
            sides.high - sides.low,
            volume,
            (sides.high - sides.low) * sum(map(area, contours)),
            _counted_faces([face for face in faces if not _fits(face, sides)]),
            _only_lines_and_circles(gmsh.model),
        )


def _imported_solids(model: Any, path: str) -> tuple[list[int], list[str]]:
    """Return the tags of the solids of a file and their names, the largest solid first."""
    solids = [tag for dim, tag in model.occ.importShapes(path) if dim == 3]
    model.occ.synchronize()
    names = dict(zip(solids, _names_of_solids(model, solids, path), strict=True))
    solids.sort(key=lambda tag: -model.occ.getMass(3, tag))
    return solids, [names[tag] for tag in solids]


def _cut_in_middle(kernel: Any, solid: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the faces of the section of a solid by the plane z = 0, in place of the solid."""
    low, high = np.reshape(kernel.getBoundingBox(*solid), (2, 3))
    box = kernel.addRectangle(low[0] - 1, low[1] - 1, 0.0, *(high - low + 2)[:2])
    section = kernel.intersect([(2, box)], [solid])[0]
    kernel.synchronize()
    return [each for each in section if each[0] == 2]


def _only_lines_and_circles(model: Any) -> bool:
    """Return whether every curve of a model is a line or a circular arc."""
    return all(model.getType(1, tag) in ("Line", "Circle") for _, tag in model.getEntities(1))


@contextmanager
def _limited_memory() -> Iterator[None]:
    """Limit the memory of this process to `MOST_MEMORY`, where the system can.

    Files of others may ask for any.
    """
    try:
        import resource
    except ImportError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_AS)
    within = MOST_MEMORY if before[1] == resource.RLIM_INFINITY else min(MOST_MEMORY, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (within, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _names_of_solids(
    model: Any,
    solids: Sequence[int],
    path: str,
) -> list[str]:
    """Return the names of solids in the order of the file: of their products, else their own."""
    names = [model.getEntityName(3, tag).rpartition("/")[2] for tag in solids]
    if not any(names):
        found = SOLID_NAME.findall(Path(path).read_bytes())
        if len(found) == len(solids):
            names = [name.decode(errors="replace").replace("''", "'") for name in found]
    return names


def _chosen(part: int | str, names: Sequence[str]) -> int:
    """Return the index of the solid with a number or a name, -1 without one."""
    text = str(part).strip().lower()
    if text.isdecimal():
        return int(text) - 1 if 1 <= int(text) <= len(names) else -1
    return next((k for k, name in enumerate(names) if name.lower() == text), -1)


class _SolidFace(NamedTuple):
    """A face of a solid: kind, area, mm^2, unit normals (n, 3) at points, one point (3,), mm."""

    kind: str
    area: float
    normals: AnyArray
    point: AnyArray

    @classmethod
    def of(
        cls,
        model: Any,
        tag: int,
    ) -> _SolidFace:
        """Return the face of a tag."""
        low, high = model.getParametrizationBounds(2, tag)
        shares = np.linspace(0.03, 0.97, 5)
        parameters = np.array([(u, v) for u in shares for v in shares]) * (high - low) + low
        normals = np.reshape(model.getNormal(tag, parameters.ravel()), (-1, 3))
        point = np.array(model.getValue(2, tag, parameters[len(parameters) // 2]))
        return cls(model.getType(2, tag), float(model.occ.getMass(2, tag)), normals, point)


class _Sides(NamedTuple):
    """Unit normal (3,) of a plate, and positions, mm, of its two sides along it."""

    normal: AnyArray
    low: float
    high: float


def _fits(face: _SolidFace, sides: _Sides) -> bool:
    """Whether a face is perpendicular to a plate, or on one of its two sides."""
    along = np.abs(face.normals @ sides.normal)
    if np.all(along < PERPENDICULAR):
        return True
    if face.kind != "Plane":
        return False
    at = float(face.point @ sides.normal)
    return min(abs(at - sides.low), abs(at - sides.high)) < ON_SIDE


def _sides(faces: Sequence[_SolidFace]) -> _Sides | None:
    """Return the two sides of a plate, None for a solid without two parallel plane faces."""
    planes = sorted((face for face in faces if face.kind == "Plane"), key=lambda face: -face.area)
    whole = sum(face.area for face in faces)
    best = None
    best_score = (-1.0, 0.0)
    for normal in _directions(planes):
        sides = _sides_across(planes, normal)
        if sides is None:
            continue
        share = sum(face.area for face in faces if _fits(face, sides)) / whole
        score = (round(share, 6), sides.low - sides.high)
        if score > best_score:
            best = sides
            best_score = score
    return best


def _directions(planes: Sequence[_SolidFace]) -> list[AnyArray]:
    """Return the distinct normals (3,) of the first plane faces, their largest part positive."""
    found = list[AnyArray]()
    for face in planes:
        normal = face.normals[0]
        normal = normal * math.copysign(1.0, normal[np.argmax(np.abs(normal))])
        if len(found) < MOST_DIRECTIONS and all(abs(normal @ other) < PARALLEL for other in found):
            found.append(normal)
    return found


def _sides_across(planes: Sequence[_SolidFace], normal: AnyArray) -> _Sides | None:
    """Return the two planes across a normal with most area, None if there is one or none."""
    areas = dict[float, float]()
    for face in planes:
        if abs(face.normals[0] @ normal) > PARALLEL:
            place = round(float(face.point @ normal), 5)
            areas[place] = areas.get(place, 0.0) + face.area
    if len(areas) < 2:
        return None
    one, other = sorted(areas, key=lambda place: -areas[place])[:2]
    return _Sides(normal, min(one, other), max(one, other))


def _lay_flat(
    kernel: Any,
    solid: tuple[int, int],
    sides: _Sides,
) -> None:
    """Turn a plate by the smallest angle so that its normal is along z, and its middle at z = 0."""
    axis = np.cross(sides.normal, (0.0, 0.0, 1.0))
    sine = float(np.linalg.norm(axis))
    cosine = float(sides.normal[2])
    if sine > ALREADY_FLAT:
        kernel.rotate([solid], 0, 0, 0, *(axis / sine), math.atan2(sine, cosine))
    kernel.translate([solid], 0, 0, -(sides.low + sides.high) / 2)
    kernel.synchronize()


def _counted_faces(faces: Sequence[_SolidFace]) -> dict[str, tuple[int, float]]:
    """Return number and total area of faces by kind."""
    counted = dict[str, tuple[int, float]]()
    for face in faces:
        number, size = counted.get(face.kind, (0, 0.0))
        counted[face.kind] = (number + 1, size + face.area)
    return counted
