"""Mesh of a plate: the union of its regions, divided along lines, by OpenCASCADE."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.layout import Move
from flexfem.meshing.requests import Grading, Line, NamedArrays, PlateMesh
from flexfem.meshing.session import gmsh_session
from flexfem.meshing.shapes import draw_curve, draw_point, draw_region, draw_union
from flexfem.meshing.triangles import Drawn, add_field, triangulated

SAME_PART = 1e-5  # mm; two faces with middles at a smaller distance are the same
SAME_SIZE = 1e-6  # relative, of their areas or lengths


def mesh_plate(job: PlateMesh) -> NamedArrays:
    """Mesh regions with quadratic triangles, conforming along the curves they share.

    Returns arrays as `triangulated`, and areas (regions,), mm^2, exact.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        gmsh.option.setNumber("Mesh.Algorithm", job.algorithm)
        drawn = _divide(gmsh.model, job)
        points = [[draw_point(kernel, z) for z in grading.points] for grading in job.gradings]
        kernel.synchronize()
        sizes = _sizes_near(gmsh.model.mesh.field, job.gradings, points)
        sizes += _sizes_in(gmsh.model.mesh.field, job.largest, drawn.faces)
        if job.moves:
            _repeat(gmsh.model, job.moves)
        areas = np.array([sum(kernel.getMass(2, tag) for tag in part) for part in drawn.faces])
        return {**triangulated(gmsh.model.mesh, job.divisions, sizes, drawn), "areas": areas}


def _sizes_near(
    field: Any, gradings: Sequence[Grading], points: Sequence[Sequence[int]]
) -> list[int]:
    """Return fields with the sizes of gradings near their points, given by tags."""
    found = list[int]()
    for grading, near in zip(gradings, points, strict=True):
        distance = field.add("Distance")
        field.setNumbers(distance, "PointsList", near)
        limits = {"SizeMin": grading.size, "SizeMax": grading.largest}
        limits |= {"DistMin": grading.radius, "DistMax": grading.radius + grading.reach}
        found.append(add_field(field, "Threshold", InField=distance, **limits))
    return found


def _sizes_in(
    field: Any,
    largest: Sequence[float],
    faces: Sequence[Sequence[int]],
) -> list[int]:
    """Return fields with the largest sizes, mm, in the faces of each region."""
    found = list[int]()
    for size, part in zip(largest, faces, strict=True):
        found.append(add_field(field, "Constant", VIn=size, VOut=max(largest)))
        field.setNumbers(found[-1], "SurfacesList", part)
    return found


def _divide(model: Any, job: PlateMesh) -> Drawn:
    """Divide the union of the regions along the lines.

    Regions are united first, since a hinge may be tangent to the side at which it meets a body: no
    triangle edge follows this side.
    """
    kernel = model.occ
    drawn = _draw_regions(kernel, job)
    pieces = kernel.fragment(drawn.faces, [_draw_line(kernel, line) for line in job.lines])[1]
    kernel.synchronize()
    owner = dict[int, int]()
    for region, found in zip(drawn.regions, pieces, strict=False):  # pieces of lines follow
        if region is not None:
            owner.update((tag, region) for _, tag in found)
    curves = _owned_curves(model, job.lines, pieces[len(drawn.faces) :], owner)
    if len(owner) != len(model.getEntities(2)):
        raise ValueError("a part of the plate is connected to nothing")
    faces: list[list[int]] = [[] for _ in job.regions]
    for tag, region in owner.items():
        faces[region].append(tag)
    return Drawn(curves, faces)


class _DrawnRegions(NamedTuple):
    """Faces of gmsh, and the region of each, None for faces of several regions that are united."""

    faces: list[tuple[int, int]]
    regions: list[int | None]


def _draw_regions(kernel: Any, job: PlateMesh) -> _DrawnRegions:
    """Draw the union of the regions with lines, and every other region by itself."""
    with_lines = {line.region for line in job.lines}
    united = [region for index, region in enumerate(job.regions) if index in with_lines]
    faces = draw_union(kernel, united) if with_lines else []
    regions: list[int | None] = [None] * len(faces)
    for index, region in enumerate(job.regions):
        if index not in with_lines:
            own_faces = draw_region(kernel, region)
            faces += own_faces
            regions += [index] * len(own_faces)
    return _DrawnRegions(faces, regions)


def _draw_line(kernel: Any, line: Line) -> tuple[int, int]:
    start = draw_point(kernel, line.curve.start)
    end = draw_point(kernel, line.curve.end)
    return (1, draw_curve(kernel, line.curve, start, end))


def _owned_curves(
    model: Any, lines: Sequence[Line], pieces: Sequence[Any], owner: dict[int, int]
) -> list[tuple[str, int]]:
    """Return the pieces of lines in the plate with their labels, and let them give faces an owner.

    owner : region of each face, by its tag.
    """
    curves = list[tuple[str, int]]()
    for line, found in zip(lines, pieces, strict=True):
        for _, tag in found:
            beside = model.getAdjacencies(1, tag)[0].tolist()
            region = line.region
            if region is None:
                region = next((owner[face] for face in beside if face in owner), -1)
            if region >= 0:
                for face in beside:
                    owner.setdefault(face, region)
            if region in [owner.get(face) for face in beside]:
                curves.append((line.label, tag))
            elif beside:  # else it is beyond an edge
                raise ValueError("two parts of the plate are joined without a hinge")
    return curves


def _repeat(model: Any, moves: Sequence[Move]) -> None:
    """Let meshes of faces and curves be copied from those that the moves take to them.

    Each curve but one of those alike is a copy of this one, which is a copy of nothing: as a side
    of a copied face it could be one of its own copies.
    """
    for dim in (2, 1):
        tags = [tag for _, tag in model.getEntities(dim)]
        middles = {tag: complex(*model.occ.getCenterOfMass(dim, tag)[:2]) for tag in tags}
        sizes = {tag: float(model.occ.getMass(dim, tag)) for tag in tags}
        own_moves = (Move(), *moves) if dim == 1 else tuple(moves)
        while middles:
            first, middle = next(iter(middles.items()))
            done = {first}
            for move in own_moves:
                image = _image(middles, sizes, first, move(middle))
                if image not in done or move == Move():
                    model.mesh.setPeriodic(dim, [image], [first], _affine(move))
                    done.add(image)
            middles = {tag: at for tag, at in middles.items() if tag not in done}


def _image(
    middles: dict[int, complex],
    sizes: dict[int, float],
    first: int,
    place: complex,
) -> int:
    """Return the face or curve like the first one whose middle is at a place, else itself."""
    for tag, middle in middles.items():
        alike = math.isclose(sizes[tag], sizes[first], rel_tol=SAME_SIZE)
        if alike and abs(middle - place) < SAME_PART:
            return tag
    return first


def _affine(move: Move) -> AnyArray:
    """Return the matrix (16,) of gmsh of a move."""
    affine = np.eye(4)
    affine[:2, :2] = move.of_twists[:2, :2]
    affine[:2, 3] = (move.shift.real, move.shift.imag)
    return affine.ravel()
