"""Edges of hinges as exact curves: lines, arcs of circles and ellipses, and Bezier curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.outlines import Segment


class Bezier(NamedTuple):
    """A Bezier curve with complex control points (n,), mm, of which the first and the last one are
    its ends.
    """

    points: tuple[complex, ...]


class Ellipse(NamedTuple):
    """An arc of an ellipse of at most a quarter turn.

    `major` is the vector of its major half-axis, mm.
    """

    start: complex
    end: complex
    centre: complex
    major: complex


Curve = Segment | Bezier | Ellipse


def mapped(curve: Curve, move: Callable[[complex], complex]) -> Curve:
    """Return a curve after a rigid motion or a reflection of its points."""
    if isinstance(curve, Bezier):
        return Bezier(tuple(map(move, curve.points)))
    start = move(curve.start)
    end = move(curve.end)
    if isinstance(curve, Ellipse):
        centre = move(curve.centre)
        return Ellipse(start, end, centre, move(curve.centre + curve.major) - centre)
    return Segment(start, end, None if curve.centre is None else move(curve.centre))


def backwards(curve: Curve) -> Curve:
    """Return the same curve in the opposite direction."""
    if isinstance(curve, Bezier):
        return Bezier(curve.points[::-1])
    return curve._replace(start=curve.end, end=curve.start)


def mirror_image(edge: Iterable[Curve]) -> list[Curve]:
    """Return an edge on the other side of the axis."""
    return [mapped(curve, lambda z: z.conjugate()) for curve in edge]


def ends_of(curve: Curve) -> tuple[complex, complex]:
    return (
        (curve.points[0], curve.points[-1])
        if isinstance(curve, Bezier)
        else (curve.start, curve.end)
    )


def rise_of(
    x: Array,
    curve: Curve,
    step: complex,
) -> Array:
    """Rise (...) of a line, or of an arc from its lowest point, at distances x (...) from its
    start; `step` to its end.

    Without cancellation: `r - sqrt(r^2 - x^2) = x^2 / (r + sqrt(r^2 - x^2))`.
    """
    assert not isinstance(curve, Bezier)
    if curve.centre is None:
        return np.asarray(x * (step.imag / step.real))
    if isinstance(curve, Ellipse):  # scaled to a circle
        return np.asarray(
            step.imag
            * (x / step.real) ** 2
            / (1 + np.sqrt(np.maximum(1 - (x / step.real) ** 2, 0.0)))
        )
    r = abs(curve.start - curve.centre)
    return np.asarray(x**2 / (r + np.sqrt(np.maximum(r**2 - x**2, 0.0))))
