"""Displacement fields, exaggerated, coloured by von Mises stress."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from flexfem.arrays import AnyArray, Array
from flexfem.fem.mesh import PlaneMesh
from flexfem.plot.drawing import fit
from flexfem.plot.mesh import QUARTERS, boundary_of, draw_boundary
from flexfem.plot.style import INK, in_house_style, new_axes, panels, wrapped
from flexfem.plot.text import round_factor, significant
from flexfem.questions.setup import MeshFields
from flexfem.results import Fields
from flexfem.units import STRESS

# largest drawn displacement over the size of the mechanism, less where parts would cross
VISIBLE = 0.05
SMALLER = 6  # at most: reductions of a factor
DECADES = 4  # of stress; lower stresses have the lowest colour
ROUND_OFF = 1e-9  # of the largest component of a pose; smaller components are zero by symmetry
COLOURS = "viridis"
PANEL = 5.0  # in, width
RIGID = "#C3C9D0"
OUTLINE = "#8A8A8A"


def draw_field(
    ax: Axes, nodes: Array, triangles: AnyArray, moved: Array, values: Array, norm: Normalize
) -> None:
    """Draw a mesh with displaced nodes, coloured by nodal values, and its outline at rest in grey."""
    _shade(ax, moved, triangles, values, 2, cmap=COLOURS, norm=norm)
    draw_boundary(ax, nodes, boundary_of(triangles), OUTLINE, 0.9, zorder=1)
    draw_boundary(ax, moved, boundary_of(triangles), INK, 0.5)
    ax.set_axis_off()


def draw_displaced(
    ax: Axes,
    mesh: PlaneMesh,
    moved: Array,
    norm: Normalize,
) -> None:
    """Draw a mesh with displaced nodes (n, 2), coloured by displacement over the largest one.

    Parts that do not move are grey, as parts without stress are in figures of stress.
    """
    sizes = np.linalg.norm(moved - mesh.nodes, axis=1)
    moves = np.any(sizes[mesh.triangles] > ROUND_OFF * sizes.max(), axis=1)
    if not moves.all():
        _draw_still(ax, mesh.nodes, mesh.triangles[~moves])
    shares = sizes / (sizes.max() or 1.0)
    draw_field(ax, mesh.nodes, mesh.triangles[moves], moved, shares, norm)


def _shade(
    ax: Axes, nodes: Array, triangles: AnyArray, values: Array, zorder: float, **colours: Any
) -> None:
    grid = Triangulation(nodes[:, 0], nodes[:, 1], triangles[:, QUARTERS].reshape(-1, 3))
    ax.tripcolor(grid, values, shading="gouraud", rasterized=True, zorder=zorder, **colours)


def plot_displacement(
    ax: Axes | None,
    fields: Fields | MeshFields,
    *,
    factor: float | None = None,
    norm: LogNorm | None = None,
) -> Axes:
    """Draw displaced finite elements, coloured by von Mises stress, and their outline at rest.

    Returns `ax`, or new axes.

    factor, norm : exaggeration and stress scale; default: chosen for the fields.
    """
    ax = ax or new_axes()
    plane = plane_fields(fields) if isinstance(fields, MeshFields) else fields
    factor = factor or exaggeration(plane)
    norm = norm or stress_scale(plane)
    elastic = np.any(plane.stress[plane.triangles] > 0, axis=1)
    if not elastic.all():
        _draw_still(ax, plane.nodes, plane.triangles[~elastic])
    moved = plane.nodes + factor * plane.displacement
    stress = np.clip(plane.stress, norm.vmin, None)
    draw_field(ax, plane.nodes, plane.triangles[elastic], moved, stress, norm)
    fit(ax, np.concatenate([plane.nodes, moved]), 0.03)
    return ax


def _draw_still(
    ax: Axes,
    nodes: Array,
    triangles: AnyArray,
) -> None:
    """Draw triangles that nothing happens to in grey, at rest."""
    grey = ListedColormap([RIGID])
    _shade(ax, nodes, triangles, np.zeros(len(nodes)), 1, cmap=grey)
    draw_boundary(ax, nodes, boundary_of(triangles), INK, 0.5)


def plane_fields(fields: MeshFields) -> Fields:
    """Return the fields of a figure: in three dimensions the mid-plane, with the highest stress."""
    mesh = fields.mesh
    made = fields.made()
    field = made["displacement"]
    stress = made["von_mises"]
    if fields.heights is not None:
        field = field[:, 0, :2]
        stress = stress.max(axis=1)
    return Fields(mesh.nodes, mesh.triangles, mesh.bodies, field, stress)


def exaggeration(*fields: Fields, signs: tuple[float, ...] = (1.0,)) -> float:
    """Return a round factor that makes displacements visible, with no part drawn through another.

    signs : of the displacements that are drawn.
    """
    largest = max(
        np.linalg.norm(each.displacement, axis=1).max() / np.ptp(each.nodes, axis=0).max()
        for each in fields
    )
    factor = round_factor(VISIBLE / float(largest)) if largest > 0 else 1.0
    for _ in range(SMALLER):
        if all(_is_simple(each, sign * factor) for each in fields for sign in signs):
            break
        factor = round_factor(0.7 * factor)
    return factor


def _is_simple(fields: Fields, factor: float) -> bool:
    """Return whether the outline of displaced finite elements does not cross itself."""
    moved = fields.nodes + factor * fields.displacement
    outline = moved[boundary_of(fields.triangles)[:, [0, 2, 1]]]
    return bool(shapely.is_simple(shapely.MultiLineString(list(outline))))


def stress_scale(*fields: Fields) -> LogNorm:
    """Return the logarithmic colours over `DECADES` decades up to the largest stress, MPa."""
    largest = max(float(field.stress.max()) for field in fields) or 1.0
    return LogNorm(largest / 10**DECADES, largest)


def draw_scale(figure: Figure, axes: Any, norm: Normalize, label: str, **place: Any) -> None:
    """Add a colour bar below one or several panels."""
    place = {"aspect": 38, "shrink": 6.0 / figure.get_figwidth()} | place
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=axes, location="bottom", **place)
    if isinstance(norm, LogNorm):
        bar.ax.xaxis.set_major_formatter(lambda value, _: significant(value, 1))
        bar.minorticks_off()
    bar.set_label(label)


@in_house_style
def stress_figure(fields: Mapping[str, Fields]) -> Figure:
    """Draw the deformed mechanism under every load; the keys of `fields` are the titles."""
    return displaced("", ["Displacements"], fields, len(fields)).figure


class DisplacedFigure(NamedTuple):
    """A figure of displaced finite elements, its panels, and their exaggeration."""

    figure: Figure
    axes: list[Axes]
    factor: float


def displaced(
    title: str,
    lines: list[str],
    fields: Mapping[str, Fields],
    columns: int,
    assumptions: Any = None,
    width: float = PANEL,
) -> DisplacedFigure:
    """Draw a panel for each case, of a width in inches, with one exaggeration and stress scale."""
    factor = exaggeration(*fields.values())
    norm = stress_scale(*fields.values())
    rows = -(-len(fields) // columns)
    places = list[Array]()
    for each in fields.values():
        places += [each.nodes, each.nodes + factor * each.displacement]
    everywhere = np.concatenate(places)
    wide, high = np.ptp(everywhere, axis=0)
    panel_height = float(np.clip(high / wide, 0.3, 1.2)) * width + 0.6
    size = (columns * width + 0.3, rows * panel_height + 0.8)
    first = (
        f"{lines[0]} × {significant(factor, 1)}; grey: at rest. Colour: von Mises stress on a "
        "logarithmic scale."
    )
    header = [first, *lines[1:]]
    figure, axes = panels(size, title, header, rows, columns, assumptions, len(fields))
    for ax, (label, field) in zip(axes, fields.items(), strict=True):
        ax.set_title(wrapped(label, width - 0.3, 11), size=11)
        plot_displacement(ax, field, factor=factor, norm=norm)
        fit(ax, everywhere, 0.03)
    draw_scale(figure, figure.axes, norm, f"von Mises stress ({STRESS})", extend="min")
    return DisplacedFigure(figure, axes, factor)
