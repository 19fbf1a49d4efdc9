"""The mesh error of the platform compliance against the size of the triangles."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from flexfem.plot.curves import NAMES, curve_style
from flexfem.plot.numbers import scientific
from flexfem.plot.style import GREY, add_axes, header, in_house_style, new_figure, wrapped
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.converge import MeshStudy

WIDTH, HEIGHT = 8.27, 5.6  # in
ORDER = 4  # of the energy of quadratic triangles, and so of the compliance


@in_house_style
def convergence_figure(study: MeshStudy) -> Figure:
    """Draw the relative distance of each diagonal compliance from its extrapolated value over the triangle size."""
    figure = new_figure(WIDTH, HEIGHT)
    lines = [
        f"Platform compliance on {len(study.resolutions)} meshes, {study.unknowns[0]} to {study.unknowns[-1]} "
        "unknowns: distance from the value extrapolated to vanishing triangles. "
        "Bar: the band of the finest mesh by its grid convergence index."
    ]
    top = HEIGHT - header(figure, f"{study.stage}: mesh convergence", lines, study.assumed, study.not_stated) - 0.2
    axes = add_axes(figure, 0.95, 0.65, 4.75, top - 0.65)
    size = 1 / np.array(study.resolutions, dtype=float)
    for index, axis in enumerate(DIRECTIONS):
        found = study.uncertainty[axis]
        distance = np.abs(np.array(found.values) / found.extrapolated - 1)
        style = curve_style(index, len(DIRECTIONS), len(size)) | {"markevery": 1}
        order = "no order" if found.observed is None else f"order {found.observed:.2f}"
        text = f"{NAMES[axis]}: {found.verdict}, {order}, band {found.band / abs(found.extrapolated):.1e}"
        axes.plot(size, distance, label=wrapped(text, 1.6, 8.5), **style)
        spread = found.band / abs(found.extrapolated)
        axes.errorbar(
            size[-1:], [spread], [[max(0.0, spread - distance[-1])], [0.0]], color=style["color"], capsize=3 + 2 * index
        )
    largest = max(np.abs(u.values[0] / u.extrapolated - 1) for u in study.uncertainty.values())
    slope = 2 * largest * (size / size[0]) ** ORDER
    axes.plot(size, slope, color=GREY, linewidth=0.9, dashes=(2, 2), label=f"order {ORDER}")
    axes.set(xscale="log", yscale="log", xlabel="triangle size at the necks / t", ylabel="relative mesh error")
    axes.set_xticks(size, [f"1/{n}" for n in study.resolutions])
    axes.yaxis.set_major_formatter(lambda value, _: scientific(value))
    axes.minorticks_off()
    axes.grid(color="#D5D5D5", linewidth=0.5)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, frameon=False, handlelength=4.4)
    return figure
