"""Mesh of faces that share curves, drawn point by point."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexfem.mechanism.outlines import Face
from flexfem.meshing.requests import FaceMesh, NamedArrays
from flexfem.meshing.session import gmsh_session
from flexfem.meshing.shapes import SAME_POINT, draw_curve, draw_point
from flexfem.meshing.triangles import Drawn, add_field, triangulated


def mesh_faces(job: FaceMesh) -> NamedArrays:
    """Mesh faces with quadratic triangles, conforming along the curves they share.

    Returns arrays as `triangulated`.
    """
    with gmsh_session() as gmsh:
        drawn = _draw_faces(gmsh.model.geo, job.faces)
        gmsh.model.geo.synchronize()
        field = gmsh.model.mesh.field
        balls = list[int]()
        for grading in job.gradings:
            sizes = {"VIn": grading.size, "VOut": grading.largest, "Thickness": grading.reach}
            for z in grading.points:
                place = {"XCenter": z.real, "YCenter": z.imag, "Radius": grading.radius}
                balls.append(add_field(field, "Ball", **place, **sizes))
        return triangulated(gmsh.model.mesh, job.divisions, balls, drawn)


def _draw_faces(kernel: Any, faces: list[Face]) -> Drawn:
    """Draw every point and curve once; curves with the label `free` are left out of the result.

    A segment with coincident ends is omitted; a curve that a face traverses backwards has a
    negative tag in its loop.
    """
    indices = iter(_ends_at_same_point(faces))
    points = dict[int, int]()
    drawn = dict[tuple[int, int], int]()
    labelled = list[tuple[str, int]]()
    loops = list[int]()
    for face in faces:
        tags = list[int]()
        for segment, label in zip(face.loop, face.labels, strict=True):
            start, end = next(indices)
            if start == end:
                continue
            if (end, start) in drawn:
                tags.append(-drawn[end, start])
                continue
            if start not in points:
                points[start] = draw_point(kernel, segment.start)
            if end not in points:
                points[end] = draw_point(kernel, segment.end)
            drawn[start, end] = draw_curve(kernel, segment, points[start], points[end])
            tags.append(drawn[start, end])
            if label != "free":
                labelled.append((label, tags[-1]))
        loops.append(kernel.addCurveLoop(tags))
    return Drawn(labelled, [[int(kernel.addPlaneSurface([loop]))] for loop in loops])


def _ends_at_same_point(faces: list[Face]) -> list[tuple[int, int]]:
    """Return for the start and end of every segment the index of the first end at this point."""
    ends = np.array([(segment.start, segment.end) for face in faces for segment in face.loop])
    apart = np.abs(ends.ravel()[:, None] - ends.ravel())
    first = np.argmax(apart < SAME_POINT, axis=1)
    return [(start, end) for start, end in first.reshape(ends.shape).tolist()]
