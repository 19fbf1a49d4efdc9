"""Large displacements of a mechanism: its force and its tangent stiffness over the displacement."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot import style
from flexfem.plot.style import GREY, INK, MODEL_COLOURS, NAMES, panels, titled
from flexfem.questions.large import BEAMS, LINEAR, Large
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.units import DIRECTIONS, UNITS, Direction

LOOKS: dict[str, dict[str, Any]] = {
    LINEAR: {"color": GREY, "linestyle": "dashed", "linewidth": 1.2},
    BEAMS: {"color": MODEL_COLOURS[ANALYTIC], "linewidth": 1.8},
    ELEMENTS: {
        "color": MODEL_COLOURS[ELEMENTS],
        "linewidth": 1.4,
        "linestyle": (0, (5, 1.5)),
    },
}
FORCE_WORDS = {"x": "force", "y": "force", "theta": "moment"}
FORCE_UNITS = {"x": "N", "y": "N", "theta": "N mm"}
STIFFNESS_UNITS = {"x": "N/mm", "y": "N/mm", "theta": "N mm/rad"}
SIZE = (6.7, 6.2)  # in


@style.in_house_style
def large_figure(found: Large) -> Figure:
    """Draw force and tangent stiffness over the displacement by all theories."""
    direction = along_of(found)
    loaded = "force" in found.values
    how = "Growing dead load on the output."
    if not loaded:
        how = f"The output is driven along {NAMES[direction]}, the other directions free."
    if _has_bands(found, direction):
        how += " Bars: band of the finite elements."
    title = f"{found.about.name}: large displacements"
    figure, axes = panels(SIZE, title, [how], 2, assumptions=found.about)
    titled(plot_force(axes[0], found, direction), "a", FORCE_WORDS[direction])
    titled(plot_tangent(axes[1], found, direction), "b", "tangent stiffness, other directions free")
    style.legend_below(figure, axes, 4)
    return figure


def along_of(found: Large) -> Direction:
    """Return the direction along which the load is largest."""
    quantity = "force" if "force" in found.values else "driving"
    load = found.at(quantity, load=found.axes["load"][-1])
    force = np.ravel(load if quantity == "force" else load[0])
    scaled = np.abs(force) / [1.0, 1.0, found.about.lever]
    return DIRECTIONS[int(np.argmax(scaled))]


def plot_force(
    ax: Axes,
    found: Large,
    direction: Direction,
) -> Axes:
    """Draw the force along a direction over the displacement, with the events; return `ax`."""
    for theory in found.axes["theory"]:
        moved, force = _at_shares(found, theory, direction)
        bands = _bands(found, "driving", theory, direction)
        look = LOOKS[theory]
        if "curve_pose" in found.values and theory != LINEAR:
            curve = found.at("curve_pose", theory=theory, direction=direction)
            pull = found.at("curve_force", theory=theory, direction=direction)
            ax.plot(curve, pull, label=theory, **look)
            _mark_end(ax, curve, pull, moved, look["color"])
            ax.errorbar(
                moved[1:],
                force[1:],
                bands,
                fmt=".",
                color=look["color"],
                capsize=2.5,
            )
        else:
            ax.plot(moved, force, label=theory, **look)
    if "event_pose" in found.values:
        _mark_events(ax, found, direction)
    _label(ax, direction, f"{FORCE_WORDS[direction]} ({FORCE_UNITS[direction]})")
    return ax


def plot_tangent(
    ax: Axes,
    found: Large,
    direction: Direction,
) -> Axes:
    """Draw the tangent stiffness along a direction over the displacement; return `ax`."""
    for theory in found.axes["theory"]:
        moved, _ = _at_shares(found, theory, direction)
        stiffness = found.at("stiffness", theory=theory, direction=direction)
        bands = _bands(found, "stiffness", theory, direction)
        marker = "" if theory == LINEAR else "o"
        look = LOOKS[theory] | {"marker": marker, "markersize": 4}
        ax.errorbar(moved[1:], stiffness, bands, capsize=2.5, label=theory, **look)
    ax.axhline(0.0, color=INK, linewidth=0.6)
    ax.axvline(0.0, color=INK, linewidth=0.6)
    _label(ax, direction, f"tangent stiffness ({STIFFNESS_UNITS[direction]})")
    return ax


def _at_shares(
    found: Large,
    theory: str,
    direction: Direction,
) -> tuple[Array, Array]:
    """Return displacements and forces at rest and at the shares of the load or displacement."""
    moved = found.at("pose", theory=theory, direction=direction)
    if "driving" in found.values:
        force = found.at("driving", theory=theory, direction=direction)
    else:
        force = found.at("force", direction=direction)
    return np.append(0.0, moved), np.append(0.0, force)


def _bands(
    found: Large,
    quantity: str,
    theory: str,
    direction: Direction,
) -> Array | None:
    """Return the bands at the shares; None where none are known."""
    if quantity not in found.bands:
        return None
    bands = np.nan_to_num(found.band(quantity, theory=theory, direction=direction))
    return bands if bands.any() else None


def _has_bands(found: Large, direction: Direction) -> bool:
    """Return whether a theory has bands that the figure shows."""
    quantities = ("driving", "stiffness")
    return any(
        _bands(found, quantity, theory, direction) is not None
        for quantity in quantities
        for theory in found.axes["theory"]
    )


def _mark_end(
    ax: Axes,
    moved: Array,
    force: Array,
    shares: Array,
    colour: str,
) -> None:
    """Mark the end of a curve that does not reach the whole displacement."""
    if np.isfinite(shares[-1]):
        return
    last = np.flatnonzero(np.isfinite(moved))[-1]
    ax.plot(
        moved[last],
        force[last],
        "X",
        color=colour,
        markersize=8,
        label="end of the curve",
    )


def _mark_events(
    ax: Axes,
    found: Large,
    direction: Direction,
) -> None:
    """Mark limit points and other events by numbers, which the legend explains."""
    for number, event in enumerate(found.axes["event"], start=1):
        moved = found.at("event_pose", event=event, direction=direction)
        force = found.at("event_force", event=event, direction=direction)
        known = np.flatnonzero(np.isfinite(moved))
        for theory in known.tolist():
            style.ring(ax, (moved[theory], force[theory]), str(number))
        ax.plot([], [], linestyle="none", label=f"{number}: {event}")


def _label(
    ax: Axes,
    direction: Direction,
    text: str,
) -> None:
    """Label the axes; the displacement is in the unit of the result."""
    unit = UNITS["rad" if direction == "theta" else "mm"]
    ax.set_xlabel(f"displacement of the output in {NAMES[direction]} ({unit})")
    ax.set_ylabel(text)
    ax.grid()
