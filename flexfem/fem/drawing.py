"""Outlines drawn in a kernel of gmsh, every point and curve once: `gmsh.model.geo` for meshes, `occ` for parts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.mechanism.bodies import Face, Segment

SAME_POINT = 1e-7  # mm; faces compute their common points each on its own


class DrawnCurve(NamedTuple):
    """A drawn curve: its label, and for an arc the centre."""

    label: str
    centre: complex | None


def draw_loops(kernel: Any, faces: list[Face]) -> tuple[dict[int, DrawnCurve], list[int]]:
    """Draw every point and curve once; returns the curves and the closed loop of each face."""
    ends = np.array([(segment.start, segment.end) for face in faces for segment in face.loop])
    first = np.argmax(np.abs(ends.ravel()[:, None] - ends.ravel()) < SAME_POINT, axis=1).reshape(ends.shape)
    drawn, loops, places = _Drawn(kernel), [], iter(first.tolist())
    for face in faces:
        pieces = zip(face.loop, face.labels, strict=True)
        tags = [drawn.curve(segment, label, *next(places)) for segment, label in pieces]
        loops.append(int(kernel.addCurveLoop([tag for tag in tags if tag])))
    return drawn.curves, loops


class _Drawn:
    """Points and curves that the kernel has, by the places of their ends among all ends."""

    def __init__(self, kernel: Any) -> None:
        self.kernel = kernel
        self.curves: dict[int, DrawnCurve] = {}
        self._points: dict[int, int] = {}
        self._between: dict[tuple[int, int], int] = {}

    def curve(self, segment: Segment, label: str, start: int, end: int) -> int:
        """Tag of a curve, negative where its face meets it backwards; 0 for an arc of a bend too slight to draw."""
        one, other = self._point(start, segment.start), self._point(end, segment.end)
        if one == other:
            return 0
        if (other, one) in self._between:
            return -self._between[other, one]
        if segment.centre is None:
            tag = int(self.kernel.addLine(one, other))
        else:
            middle = self.kernel.addPoint(segment.centre.real, segment.centre.imag, 0.0)
            tag = int(self.kernel.addCircleArc(one, middle, other))
        self._between[one, other], self.curves[tag] = tag, DrawnCurve(label, segment.centre)
        return tag

    def _point(self, place: int, at: complex) -> int:
        if place not in self._points:
            self._points[place] = self.kernel.addPoint(at.real, at.imag, 0.0)
        return self._points[place]
