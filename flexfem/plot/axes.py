"""Drawings on the axes of a user, or on new ones of pyplot's, which notebooks show."""

from __future__ import annotations

from matplotlib.axes import Axes

from flexfem.plot.displacement import plot_displacement
from flexfem.plot.stage import plot_stage
from flexfem.stage.schema import Stage
from flexfem.verify.result import Fields


def drawn_stage(stage: Stage, ax: Axes | None) -> Axes:
    """The outline of a stage that can be made, in mm."""
    return plot_stage(_axes(ax), stage)


def drawn_displacement(fields: Fields, hub_radius: float, factor: float | None, ax: Axes | None) -> Axes:
    """A displaced stage, see `plot_displacement`."""
    return plot_displacement(_axes(ax), fields, factor=factor, hub_radius=hub_radius)


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]
