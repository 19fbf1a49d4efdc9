"""Curve of the force that drives the output of a mechanism along one direction, by beams and by
finite elements.

Each model follows its own curve from rest. Finite elements follow it on the coarsest mesh. On the
finer meshes they are solved at its events and at the shares of the displacement alone, reached
along the same curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.analytic.paths import DrivenPlate
from flexfem.arrays import Array
from flexfem.fem.nonlinear import PulledElements
from flexfem.mechanism.curves import (
    BIFURCATION,
    FURTHEST,
    HIGHEST,
    WITHOUT_FORCE,
    CurvePoint,
    Event,
    Followed,
    ForceCurve,
    Waypoint,
    at_extremum,
    replayed,
    way_along,
)
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import corner_bands, levels
from flexfem.questions.plates import model_of
from flexfem.questions.setup import Mesh
from flexfem.results import Progress

NUMBERS = 9  # of the output, see `numbers_of`


def numbers_of(point: CurvePoint) -> Array:
    """Return pose, load, and tangent stiffness along every direction with the others free, of the
    output (9,).
    """
    return np.concatenate([point.motions[:3], point.loads[:3], 1 / np.diag(point.compliance)[:3]])


class Traced(NamedTuple):
    """A curve of one theory: its points, those at the shares of the displacement, and its events,
    by their labels.

    shares : as far as the curve reaches them.   share_bands : half-widths (s, 9) of `numbers_of`
    them.
    event_bands : (9,), of every event.
    """

    curve: ForceCurve
    shares: list[CurvePoint]
    events: dict[str, CurvePoint]
    share_bands: Array
    event_bands: dict[str, Array]


def by_beams(
    layout: Layout,
    port: int,
    displacements: Array,
) -> Traced:
    """Return the curve of co-rotational beams up to the last of displacements (s,) of a port, mm or
    rad.
    """
    plate = DrivenPlate(layout)

    def reach(near: CurvePoint, line: tuple[float, float, float]) -> CurvePoint | None:
        return plate.on_line(near, port, line)

    rest = plate.curve_point(np.zeros(plate.size), np.zeros(plate.ports))
    curve = Followed(reach, port, float(displacements[-1])).curve(rest)
    way = way_along(curve, reach, port, displacements.tolist())
    shares = [waypoint.at for waypoint in way if waypoint.wanted and waypoint.event is None]
    labels = labels_of([event for _, event in curve.events], layout)
    events = {label: event.at for label, (_, event) in zip(labels, curve.events, strict=True)}
    return Traced(curve, shares, events, np.full((len(shares), NUMBERS), np.nan), {})


def element_values(
    mechanism: Mechanism,
    mesh: Mesh,
    port: int,
    displacements: Array,
    progress: Progress | None = None,
) -> Traced:
    """Return the curve of plane finite elements up to the last of displacements (s,) of a port, mm
    or rad.
    """
    steps = levels(mesh.resolution)
    coarsest = PulledElements(model_of(mechanism, steps[0]), port)
    curve = Followed(coarsest.on_line, port, float(displacements[-1])).curve(coarsest.rest())
    way = way_along(curve, coarsest.on_line, port, displacements.tolist())
    wanted = [waypoint for waypoint in way if waypoint.wanted]
    on_meshes: list[list[CurvePoint | None]] = [[waypoint.at for waypoint in wanted]]
    for number, step in enumerate(steps[1:], start=2):
        if progress is not None:
            progress(f"{number - 1} of {len(steps)} meshes")
        finer = PulledElements(model_of(mechanism, step), port)
        on_meshes.append(replayed(finer.on_line, finer.rest(), way, port, curve.scale))
    if progress is not None:
        progress(f"{len(steps)} of {len(steps)} meshes")
    each = [
        _on_all_meshes(waypoint, points, port)
        for waypoint, points in zip(wanted, zip(*on_meshes, strict=True), strict=True)
    ]
    bands = [_band(np.array(steps, dtype=float), points) for points in each]
    return _traced(curve, wanted, [points[-1] for points in each], bands, mechanism.layout)


def _band(sizes: Array, points: Sequence[CurvePoint]) -> Array:
    """Return the band (9,) of `numbers_of` a point; nan if a mesh does not have it."""
    if len(points) < len(sizes):
        return np.full(NUMBERS, np.nan)
    return corner_bands(sizes, np.array([numbers_of(point) for point in points]))


def _traced(
    curve: ForceCurve,
    wanted: Sequence[Waypoint],
    points: Sequence[CurvePoint],
    bands: Sequence[Array],
    layout: Layout,
) -> Traced:
    """Return a curve with the points that are wanted on the finest mesh, and their bands."""
    found = Traced(curve, [], {}, np.zeros((0, NUMBERS)), {})
    share_bands = list[Array]()
    events = [waypoint.event for waypoint in wanted if waypoint.event is not None]
    labels = iter(labels_of(events, layout))
    for waypoint, point, band in zip(wanted, points, bands, strict=True):
        if waypoint.event is None:
            found.shares.append(point)
            share_bands.append(band)
        else:
            label = next(labels)
            found.events[label] = point
            found.event_bands[label] = band
    return found._replace(share_bands=np.reshape(share_bands, (-1, NUMBERS)))


def _on_all_meshes(
    waypoint: Waypoint, points: Sequence[CurvePoint | None], port: int
) -> list[CurvePoint]:
    """Return a point of the curve on the coarsest and, as far as it is found there, on the finer
    meshes.
    """
    found = [point for point in points if point is not None]
    if waypoint.event is None:
        return found
    return [found[0], *(at_extremum(waypoint.event, point, port) for point in found[1:])]


def labels_of(events: Sequence[Event], layout: Layout) -> list[str]:
    """Return the labels of events, numbered where there are several of a kind."""
    names = [_name(event, layout) for event in events]
    numbers = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [f"{name} {number}" for name, number in zip(names, numbers, strict=True)]


def _name(event: Event, layout: Layout) -> str:
    if event.kind == WITHOUT_FORCE:
        return (
            "unstable position without force"
            if event.at.unstable
            else "stable position without force"
        )
    if event.kind == BIFURCATION:
        return (
            f"buckling of {layout.ports[event.port].label}"
            if event.port >= 0
            else "buckling of other parts"
        )
    return {HIGHEST: "limit of the force", FURTHEST: "limit of the displacement"}[event.kind]
