"""Axes of the figures of a study: what they are called, and ticks that read without powers where they can."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from flexfem.arrays import Array
from flexfem.plot.numbers import significant
from flexfem.plot.study_labels import Quantity

FEW_DECADES = 2.5  # up to which 2 and 5 have ticks between the powers of ten


def name_axis(axes: Axes, which: Literal["x", "y"], quantity: Quantity, ends: tuple[float, float]) -> None:
    """Scale, label and ticks of an axis that goes from one end to the other."""
    if quantity.log:
        axes.set(**{f"{which}scale": "log"})
    axes.set(**{f"{which}lim": ends})
    axis: Axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_label_text(quantity.label, parse_math=bool(quantity.symbol))
    if quantity.log:
        log_ticks(axis, ends)


def log_ticks(axis: Axis, ends: tuple[float, float]) -> None:
    """Ticks at powers of ten, and at multiples of them where there are few, written as plain numbers."""
    decades = float(np.log10(ends[1] / ends[0]))
    subs = range(1, 10) if decades < 1.0 else (1.0, 2.0, 5.0) if decades < FEW_DECADES else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    axis.set_minor_locator(LogLocator(subs=range(2, 10)) if decades < 2 * FEW_DECADES else NullLocator())
    axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))


def ends_of(values: Array, log: bool, room: float = 0.04) -> tuple[float, float]:
    """Where an axis begins and ends that shows finite values with some room on both sides."""
    places = np.log(values) if log else values
    low, high = float(places.min()), float(places.max())
    margin = room * (high - low) or 0.05 * (abs(high) or 1.0)
    ends = (low - margin, high + margin)
    return (float(np.exp(ends[0])), float(np.exp(ends[1]))) if log else ends
