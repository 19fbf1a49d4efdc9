"""Two figures of the code's own verification at large displacements: the elastica, and the tangent stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexfem.arrays import Array
from flexfem.plot.curves import COLOURS
from flexfem.plot.numbers import scientific
from flexfem.plot.style import GREY, INK, in_house_style, legend_beside, panels
from flexfem.validate.elastica import Elastica
from flexfem.validate.taylor import SMALL, Remainders

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
    figure, (axes, shapes) = panels((WIDTH, 4.6), title, [text], 1, 2)
    _draw_displacements(axes, found)
    _draw_shapes(shapes, found)
    return figure


def _draw_displacements(axes: Axes, found: Elastica) -> None:
    for index, (name, ours, exact) in enumerate(
        (
            ("across the beam, v/L", found.across, found.exact_across),
            ("along the beam, u/L", found.along, found.exact_along),
        )
    ):
        colour = COLOURS[index]
        axes.plot(exact, found.exact_load, color=colour, linestyle="-" if index == 0 else (0, (5, 2)), linewidth=1.9)
        axes.plot(ours, found.load, label=name, marker="os"[index], color=colour, **MARK)
    axes.set(xlabel="displacement of the tip / L", ylabel="P L² / (E I)", xlim=(0, 0.9), ylim=(0, 10.6))
    axes.set_title("(a) load against displacement", loc="left")
    axes.grid()
    axes.legend(loc="upper left", frameon=False)


def _draw_shapes(axes: Axes, found: Elastica) -> None:
    axes.plot([0.0, 1.0], [0.0, 0.0], color=GREY, linewidth=1.2)
    for load in (1.0, 3.0, 5.0, 10.0):
        x, y = found.shapes[int(np.flatnonzero(found.load == load)[0])].T
        axes.plot(x, y, color=INK, linewidth=1.6)
        axes.annotate(
            f"P L²/EI = {load:g}" if load == 10.0 else f"{load:g}",
            (x[-1], y[-1]),
            (5, 3),
            textcoords="offset points",
            size=9,
        )
    ends = np.array([1.0 - found.exact_along, found.exact_across])
    axes.plot(*ends, color=COLOURS[1], linewidth=1.4, dashes=(5, 2), zorder=1)
    axes.set(xlabel="x / L", ylabel="y / L")
    axes.set_xlim(-0.03, 1.08, auto=True)  # matplotlib may widen one of them for equal scales
    axes.set_ylim(-0.05, 0.92, auto=True)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("(b) shapes; dashed: exact path of the tip", loc="left")
    axes.grid()


@in_house_style
def taylor_figure(found: Remainders) -> Figure:
    """Draw the remainder of the internal forces over the step, without tangent, with ours and with a wrong one."""
    text = (
        f"Internal forces of a strongly bent bar ({found.unknowns} unknowns, hub turned by about 0.4 rad) after a step "
        "in a random direction, less their linearisation. Only the true derivative leaves a remainder of second order, "
        "down to round-off."
    )
    figure, (axes,) = panels((WIDTH, 4.9), "Tangent stiffness: the remainder it leaves", [text], 1)
    _draw_remainders(axes, found)
    return figure


def _draw_remainders(axes: Axes, found: Remainders) -> None:
    curves: list[tuple[str, Array, float]] = [
        ("nothing taken off", found.none, found.slope(found.none, SMALL)),
        ("tangent without its geometric part", found.material, found.slope(found.material, SMALL)),
        ("tangent stiffness", found.ours, found.slope(found.ours)),
    ]
    for index, (name, left, slope) in enumerate(curves):
        label = f"{name}:\nslope {slope:.3f}" + ("" if index == 2 else " at small steps")
        colour, mark = (GREY, COLOURS[1], COLOURS[0])[index], "^so"[index]
        axes.plot(
            found.step, left, color=colour, linewidth=1.4, marker=mark, label=label, **(MARK | {"linestyle": "-"})
        )
    axes.set(xscale="log", yscale="log", xlabel="step over the largest", ylabel="remainder of the forces, relative")
    axes.yaxis.set_major_formatter(lambda value, _: scientific(value))
    axes.xaxis.set_major_formatter(lambda value, _: scientific(value))
    axes.minorticks_off()
    axes.grid()
    legend_beside(axes, labelspacing=0.9)
