"""Mode shapes in three dimensions: of the mid-plane in it, or how far it leaves its plane, by contours."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from flexfem.plot.marks import quarters
from flexfem.plot.modes import draw_shape, grid_of, outline, said_of_mode, shade
from flexfem.plot.style import INK, in_house_style, new_axes
from flexfem.refused import BadInput
from flexfem.units import UNITS
from flexfem.verify.solid_modes import SolidNaturalModes, SolidVibration

CONTOURS = np.array([-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8])  # of w over its largest size


@in_house_style
def solid_modes_figure(found: SolidVibration) -> Figure:
    """Draw all modes, each with its kind, its frequency and band and the share of the mass that goes with it."""
    of = found.record
    payload = ""
    if of.payload_mass or of.payload_inertia:
        inertia = f"{of.payload_inertia:g} and, tilting, {of.payload_tilting:g} {UNITS['kg_mm2']}"
        payload = f" payload {of.payload_mass:g} {UNITS['kg']}, {inertia};"
    lines = [
        f"Finite elements in three dimensions; drives disengaged;{payload} mass {of.mass:.4g} {UNITS['kg']}. The "
        "mid-plane is drawn: displaced in its plane, exaggerated, each mode by its own factor, grey: at rest; out of "
        "its plane by contours every 0.2 of the largest w, dashed where it is opposite, thick where it is zero."
    ]
    titles = [_title(of, number) for number in range(1, len(of.modes) + 1)]
    return grid_of(of, found.mesh, lines, titles, lambda ax, number: plot_solid_mode(ax, found, number))


def _title(of: SolidNaturalModes, number: int) -> str:
    one = of.modes[number - 1]
    shares = {name.replace("_", " "): share for name, share in one.share.model_dump().items()}
    return f"mode {number}, {one.kind}: {said_of_mode(one.frequency, one.band, shares)}"


def plot_solid_mode(ax: Axes | None, found: SolidVibration, number: int) -> Axes:
    """Draw the mid-plane in one mode (from 1): displaced in its plane, or contours of w; returns `ax`, or new axes.

    Colours are the size of the displacement over the largest. Raises BadInput for a mode that is not there.
    """
    if not 1 <= number <= len(found.record.modes):
        raise BadInput(f"mode {number!r}, expected 1 to {len(found.record.modes)}")
    ax, mesh, field = ax or new_axes(), found.mesh, found.field(number - 1)[:, 0]
    if found.record.modes[number - 1].kind == "in plane":
        return draw_shape(ax, mesh, field[:, :2])
    w = field[:, 2] / np.abs(field[:, 2]).max()
    xy = mesh.nodes[:, 0], mesh.nodes[:, 1]
    linked = mesh.bodies % 4 > 0  # on the pads, whose backs are clamped, w is nearly zero and its contour says nothing
    grid, inner = (Triangulation(*xy, quarters(t)) for t in (mesh.triangles, mesh.triangles[linked]))
    shade(ax, grid, np.abs(w))
    looks = {"colors": INK, "linewidths": np.where(CONTOURS == 0.0, 1.6, 0.6), "zorder": 2.5}
    if w.min() < 0.0 < w.max():
        looks["negative_linestyles"] = "dashed"
    ax.tricontour(inner, w, levels=CONTOURS, **looks)
    outline(ax, mesh, mesh.nodes)
    return ax
