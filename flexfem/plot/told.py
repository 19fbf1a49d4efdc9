"""Places in figures of results that tell their numbers when they are pointed at."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.plot.curves import NAMES, mesh_band, panel_of
from flexfem.plot.placed import HasHinges, placed
from flexfem.plot.text import significant
from flexfem.plot.vector import Spot
from flexfem.questions.budget import TOTAL, Budget
from flexfem.questions.errors import Verification
from flexfem.units import DEGREE, DIRECTIONS, LENGTH, Direction, unit_for

BAR = 0.62  # height of a bar of a budget


def error_spots(figure: Figure, result: Verification) -> list[Spot]:
    """Spots on the points of the curves of an `error_figure`: command, error and the band of the meshes."""
    return [
        spot for ax, freedom in zip(figure.axes, DIRECTIONS, strict=False) for spot in _of_curves(ax, result, freedom)
    ]


def _of_curves(ax: Axes, result: Verification, freedom: Direction) -> list[Spot]:
    unit, command = panel_of(result, freedom).unit, unit_for(result.direction, max(map(abs, result.commanded)))
    spots = []
    for label in result.curves:
        bands = mesh_band(result, label, freedom) * unit.factor
        for given, error, band in zip(
            result.commanded, result.at("error", curve=label, direction=freedom), bands, strict=True
        ):
            said = f"{significant(error * unit.factor)} ± {significant(float(band), 2)} {unit}"
            at = f"{significant(given * command.factor)} {command}"
            text = f"{label}\ncommanded {NAMES[result.direction]} {at}\nerror in {NAMES[freedom]} {said}"
            spots.append(Spot(ax, given * command.factor, error * unit.factor, text))
    return spots


def budget_spots(figure: Figure, budget: Budget) -> list[Spot]:
    """Spots on the bars of a `budget_figure`: name and percentage points of the share."""
    spots, names = [], budget.axes["share"]
    for ax, direction in zip(figure.axes, DIRECTIONS, strict=False):
        *values, total = budget.at("share", direction=direction).tolist()
        start = 0.0
        for place, (name, value) in enumerate(zip(names, values, strict=False)):
            text = f"{name}\n{significant(value)} percentage points of {NAMES[direction]}"
            spots.append(Spot(ax, start + value / 2, place, text, abs(value), BAR))
            start += value
        band = float(budget.band("share", share=TOTAL, direction=direction))
        text = f"total\n{significant(total)} ± {significant(band, 2)} % in {NAMES[direction]}"
        spots.append(Spot(ax, total / 2, len(values), text, abs(total), BAR))
    return spots


def hinge_spots(ax: Axes, stage: HasHinges) -> list[Spot]:
    """Spots on the hinges of a drawn stage: dimensions and place, mm."""
    spots = []
    for hinge in placed(stage).hinges:
        x, y = hinge.centre
        turn = float(np.rad2deg(hinge.axis)) % 360.0
        text = (
            f"{hinge.hinge} hinge, chain {hinge.chain}\nnotch radius {hinge.radius:g} {LENGTH}, neck {hinge.neck:g} "
            f"{LENGTH}\ncentre {x:z.4f}, {y:z.4f} {LENGTH}, axis {turn:.2f}{DEGREE}"
        )
        size = 2 * hinge.radius + hinge.neck
        spots.append(Spot(ax, x, y, text, size, size))
    return spots
