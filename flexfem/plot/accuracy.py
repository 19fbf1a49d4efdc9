"""Figures of the code's own verification: the elastica, and the remainder that the tangent stiffness leaves."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.style import COLOURS, GREY, INK, in_house_style, legend_beside, panels
from flexfem.plot.text import scientific
from flexfem.validate.bending import SMALL, Elastica, Remainders

WIDTH = 8.27  # in
MARK: Any = {"linestyle": "none", "markerfacecolor": "white", "markersize": 6.5, "markeredgewidth": 1.4, "zorder": 3}


@in_house_style
def elastica_figure(found: Elastica) -> Figure:
    """Draw the load over both displacements of the tip, and the shapes of the beam."""
    text = (
        f"A cantilever under a force at its tip that keeps its direction, bent by up to {found.across[-1]:.2f} of its "
        "length. Curves: elliptic integrals (Bisshopp and Drucker 1945). "
        f"Marks: {found.unknowns} unknowns, plane stress."
    )
    title = "Elastica: large displacements against the exact solution"
    figure, (axes, shapes) = panels((WIDTH, 3.8), title, [text], 1, 2)
    plot_elastica(axes, found).set_title("(a) load against displacement", loc="left")
    plot_shapes(shapes, found).set_title("(b) shapes; dashed: exact path of the tip", loc="left")
    return figure


def plot_elastica(ax: Axes, found: Elastica) -> Axes:
    """Draw the load over both displacements of the tip, exact and solved; returns `ax`."""
    for index, (name, ours, exact) in enumerate(
        (
            ("across the beam, v/L", found.across, found.exact_across),
            ("along the beam, u/L", found.along, found.exact_along),
        )
    ):
        colour = COLOURS[index]
        ax.plot(exact, found.exact_load, color=colour, linestyle="-" if index == 0 else (0, (5, 2)), linewidth=1.9)
        ax.plot(ours, found.load, label=name, marker="os"[index], color=colour, **MARK)
    ax.set(xlabel="displacement of the tip / L", ylabel="P L² / (E I)", xlim=(0, 0.9), ylim=(0, 10.6))
    ax.grid()
    ax.legend(loc="upper left", frameon=False)
    return ax


def plot_shapes(ax: Axes, found: Elastica) -> Axes:
    """Draw the beam at rest and under four loads, and the exact path of its tip; returns `ax`."""
    ax.plot([0.0, 1.0], [0.0, 0.0], color=GREY, linewidth=1.2)
    for load in (1.0, 3.0, 5.0, 10.0):
        x, y = found.shapes[int(np.flatnonzero(found.load == load)[0])].T
        ax.plot(x, y, color=INK, linewidth=1.6)
        ax.annotate(
            f"P L²/EI = {load:g}" if load == 10.0 else f"{load:g}",
            (x[-1], y[-1]),
            (5, 3),
            textcoords="offset points",
            size=9,
        )
    ends = np.array([1.0 - found.exact_along, found.exact_across])
    ax.plot(*ends, color=COLOURS[1], linewidth=1.4, dashes=(5, 2), zorder=1)
    ax.set(xlabel="x / L", ylabel="y / L")
    ax.set_xlim(-0.03, 1.08, auto=True)  # matplotlib may widen one of them for equal scales
    ax.set_ylim(-0.05, 0.92, auto=True)
    ax.set_aspect("equal", adjustable="datalim")
    ax.grid()
    return ax


@in_house_style
def taylor_figure(found: Remainders) -> Figure:
    """Draw the remainder of the internal forces over the step, without tangent, with ours and with a wrong one."""
    text = (
        f"Internal forces of a strongly bent bar ({found.unknowns} unknowns, hub turned by about 0.4 rad) after a step "
        "in a random direction, less their linearisation. Only the true derivative leaves a remainder of second order, "
        "down to round-off."
    )
    figure, (axes,) = panels((WIDTH, 4.2), "Tangent stiffness: the remainder it leaves", [text], 1)
    plot_remainders(axes, found)
    return figure


def plot_remainders(ax: Axes, found: Remainders) -> Axes:
    """Draw the remainder of the forces over the step, one curve a tangent; returns `ax`."""
    curves: list[tuple[str, Array, float]] = [
        ("nothing taken off", found.none, found.slope(found.none, SMALL)),
        ("tangent without its geometric part", found.material, found.slope(found.material, SMALL)),
        ("tangent stiffness", found.ours, found.slope(found.ours)),
    ]
    for index, (name, left, slope) in enumerate(curves):
        label = f"{name}:\nslope {slope:.3f}" + ("" if index == 2 else " at small steps")
        colour, mark = (GREY, COLOURS[1], COLOURS[0])[index], "^so"[index]
        ax.plot(found.step, left, color=colour, linewidth=1.4, marker=mark, label=label, **(MARK | {"linestyle": "-"}))
    ax.set(xscale="log", yscale="log", xlabel="step over the largest", ylabel="remainder of the forces, relative")
    ax.yaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.xaxis.set_major_formatter(lambda value, _: scientific(value))
    ax.minorticks_off()
    ax.grid()
    legend_beside(ax, labelspacing=0.9)
    return ax
