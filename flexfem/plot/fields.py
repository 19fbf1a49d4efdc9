"""Displacement fields: the stage deformed by a command or by heating, exaggerated, coloured by von
Mises stress.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from flexfem.arrays import AnyArray, Array
from flexfem.paper.verification import CurveModels, Verification
from flexfem.plot.stage import QUARTERS, arrow, boundary_of, draw_boundary, fit
from flexfem.plot.style import (
    INK,
    NAMES,
    NOTE_COLOUR,
    in_house_style,
    new_axes,
    panels,
    titled,
    wrapped,
)
from flexfem.plot.text import round_factor, significant
from flexfem.questions.heat import CASES, Drift, WarmFields
from flexfem.questions.setup import MeshFields
from flexfem.refused import BadInput, printed
from flexfem.results import ELEMENTS, Fields
from flexfem.units import DIRECTIONS, MICROMETRE, STRESS, unit_for

VISIBLE = (
    0.05  # largest drawn displacement over the size of the stage, less where parts would cross
)
SMALLER = 6  # at most: reductions of a factor
DECADES = 4  # of stress; lower stresses have the lowest colour
EQUAL_STRESS = (
    1e-6  # relative difference of stresses equal by symmetry: above round-off, below mesh noise
)
ROUND_OFF = 1e-9  # of the largest component of a pose; smaller components are zero by symmetry
COLOURS = "viridis"
PANEL = 5.0  # in, width
RIGID = "#C3C9D0"
WARM: dict[
    str, tuple[str, str, tuple[float, float]]
] = {  # title, divisor of the stress unit, arrow in axes fractions
    "uniform": ("1 K everywhere", "K", (0.0, 0.0)),
    "gradient in x": ("1 K/mm along X", "K/mm", (0.1, 0.0)),
    "gradient in y": ("1 K/mm along Y", "K/mm", (0.0, 0.1)),
}


def draw_field(
    ax: Axes, nodes: Array, triangles: AnyArray, moved: Array, values: Array, norm: Normalize
) -> None:
    """Draw a mesh with displaced nodes, coloured by nodal values, and its undeformed outline in
    grey.
    """
    _shade(ax, moved, triangles, values, 2, cmap=COLOURS, norm=norm)
    draw_boundary(ax, nodes, boundary_of(triangles), "#8A8A8A", 0.9, zorder=1)
    draw_boundary(ax, moved, boundary_of(triangles), INK, 0.5)
    ax.set_axis_off()


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
    """Draw a plate displaced by finite elements, coloured by von Mises stress, and its undeformed
    outline in grey.

    `factor`, `norm` : exaggeration and stress scale; default: chosen for the fields. Returns `ax`,
    or new axes."""
    ax = ax or new_axes()
    fields = plane_fields(fields) if isinstance(fields, MeshFields) else fields
    factor = factor or exaggeration(fields)
    norm = norm or stress_scale(fields)
    moved = fields.nodes + factor * fields.displacement
    triangles = fields.triangles
    elastic = np.any(fields.stress[triangles] > 0, axis=1)
    if not elastic.all():
        _shade(
            ax,
            fields.nodes,
            triangles[~elastic],
            0 * fields.stress,
            1,
            cmap=ListedColormap([RIGID]),
        )
        draw_boundary(ax, fields.nodes, boundary_of(triangles[~elastic]), INK, 0.5)
    draw_field(
        ax, fields.nodes, triangles[elastic], moved, np.clip(fields.stress, norm.vmin, None), norm
    )
    fit(ax, np.concatenate([fields.nodes, moved]), 0.03)
    return ax


def plane_fields(fields: MeshFields) -> Fields:
    """Return the fields of a figure, in three dimensions as those of a stage."""
    mesh = fields.mesh
    made = fields.made()
    field = made["displacement"]
    stress = made["von_mises"]
    if fields.heights is not None:
        field = field[:, 0, :2]
        stress = stress.max(axis=1)
    return Fields(mesh.nodes, mesh.triangles, mesh.bodies, field, stress)


def exaggeration(*fields: Fields, signs: tuple[float, ...] = (1.0,)) -> float:
    """Return a round factor that makes the largest displacement visible, with no part drawn through
    another.

    signs : of the displacements that are drawn.
    """
    largest = max(
        np.linalg.norm(each.displacement, axis=1).max() / np.ptp(each.nodes, axis=0).max()
        for each in fields
    )
    factor = round_factor(VISIBLE / float(largest)) if largest > 0 else 1.0
    for _ in range(SMALLER):
        moved = [
            (each, each.nodes + sign * factor * each.displacement)
            for each in fields
            for sign in signs
        ]
        outlines = [at[boundary_of(each.triangles)[:, [0, 2, 1]]] for each, at in moved]
        if all(shapely.is_simple(shapely.MultiLineString(list(outline))) for outline in outlines):
            break
        factor = round_factor(0.7 * factor)
    return factor


def stress_scale(*fields: Fields) -> LogNorm:
    """Logarithmic colour scale over `DECADES` decades up to the largest stress, MPa."""
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
    """Draw the deformed stage under every load; the keys of `fields` are the titles."""
    return displaced("", ["Displacements"], fields, len(fields))[0]


def displaced(
    title: str,
    lines: list[str],
    fields: Mapping[str, Fields],
    columns: int,
    assumptions: Any = None,
    width: float = PANEL,
) -> tuple[Figure, list[Axes], float]:
    """Draw a panel for each case, of a width in inches, with one exaggeration and stress scale.

    Returns figure, panels and exaggeration.
    """
    factor = exaggeration(*fields.values())
    norm = stress_scale(*fields.values())
    rows = -(-len(fields) // columns)
    everywhere = [
        at
        for each in fields.values()
        for at in (each.nodes, each.nodes + factor * each.displacement)
    ]
    wide, high = np.ptp(np.concatenate(everywhere), axis=0)
    size = (
        columns * width + 0.3,
        rows * (float(np.clip(high / wide, 0.3, 1.2)) * width + 0.6) + 0.8,
    )
    key = (
        f" × {significant(factor, 1)}; grey: at rest. Colour: von Mises stress on a logarithmic "
        "scale."
    )
    figure, axes = panels(
        size, title, [lines[0] + key, *lines[1:]], rows, columns, assumptions, len(fields)
    )
    for ax, (label, field) in zip(axes, fields.items(), strict=True):
        ax.set_title(wrapped(label, width - 0.3, 11), size=11)
        plot_displacement(ax, field, factor=factor, norm=norm)
        fit(ax, np.concatenate(everywhere), 0.03)
    draw_scale(figure, figure.axes, norm, f"von Mises stress ({STRESS})", extend="min")
    return figure, axes, factor


@in_house_style
def deformed_figure(result: Verification, fields: Mapping[str, Fields]) -> Figure:
    """Draw the deformed stage of every curve at full command, with von Mises stress and its largest
    value.
    """
    models = result.models
    command = unit_for(result.direction, result.commanded[-1])
    value = significant(result.commanded[-1] * command.factor, 3)
    title = f"Stress in the displaced stage, {NAMES[result.direction]} = {value} {command}"
    solid = "Three dimensions: the mid-plane, with the highest stress through the thickness."
    lines = [f"{result.name}: finite elements at the largest command, displacements"]
    lines += [solid] if result.elements == "three_dimensional" else []
    columns = max(2, len(fields) if len(fields) < 4 else int(np.ceil(np.sqrt(len(fields)))))
    drawn = {label: fields[label] for label in result.curves}
    figure, axes, factor = displaced(title, lines, drawn, columns, result)
    for ax, (label, field) in zip(axes, drawn.items(), strict=True):
        moved = field.nodes + factor * field.displacement
        node, hinge = largest_stress(models[label], field)
        text = f"largest {significant(float(field.stress[node]), 3)} {STRESS} near {hinge}"
        ax.text(0.5, -0.03, text, transform=ax.transAxes, ha="center", va="center", size=9.5)
        outwards = 0.12 * np.ptp(moved) * moved[node] / np.linalg.norm(moved[node])
        arrow(ax, moved[node] + outwards, moved[node], colour=NOTE_COLOUR, width=1.6, shrinkB=4.0)
        ax.plot(
            *moved[node],
            "o",
            markersize=6,
            markerfacecolor="none",
            markeredgecolor=NOTE_COLOUR,
            zorder=6,
        )
    return figure


def largest_stress(model: CurveModels, fields: Fields) -> tuple[int, str]:
    """Node of the largest stress and the hinge nearest to it; of equal stresses, the one at the
    first hinge.
    """
    nodes = np.flatnonzero(fields.stress >= fields.stress.max() * (1 - EQUAL_STRESS))
    centres = np.array([hinge.centre for hinge in model.hinges])
    nearest = np.linalg.norm(fields.nodes[nodes, None] - centres, axis=2).argmin(axis=1)
    number = int(nearest.min())
    hinge = model.hinges[number]
    return int(nodes[nearest.argmin()]), f"hinge {number + 1} ({hinge.hinge}, chain {hinge.chain})"


@in_house_style
def drift_figure(found: Drift) -> Figure:
    """Draw the three cases, each with its own exaggeration and stress scale."""
    about = found.about
    fields = _warm(found).cases
    settings = found.settings
    expansion = f"{settings['expansion']}, of the frame {settings['frame']}".replace(
        "um/", f"{MICROMETRE}/"
    )
    lines = [
        f"Plane finite elements. Expansion of the stage {expansion}. Gradients are zero at the "
        "platform centre. Grey: at rest. Heavy lines: clamped edges, which move with the frame."
    ]
    figure, axes = panels(
        (12.0, 5.0), f"{about.name}: displacement and stress by heating", lines, 1, 3, about
    )
    factors = {name: exaggeration(each) for name, each in fields.items()}
    everywhere = np.concatenate(
        [each.nodes + factors[name] * each.displacement for name, each in fields.items()]
    )
    for letter, ax, name in zip("abc", axes, CASES, strict=True):
        fit(plot_drift(ax, found, name), everywhere, 0.03)
        pose, stress = (
            found.at(quantity, case=name, model=ELEMENTS) for quantity in ("pose", "stress")
        )
        title, per, _ = WARM[name]
        titled(ax, letter, f"{title}, displacements × {significant(factors[name], 1)}")
        label = (
            f"von Mises stress ({STRESS} per {per})\n\nplatform: {_pose(pose, about.lever)}\n"
            f"necks: up to {significant(float(np.max(stress)), 3)} {STRESS}"
        )
        draw_scale(
            figure, ax, stress_scale(fields[name]), label, aspect=30, shrink=0.9, extend="min"
        )
    return figure


def _warm(found: Drift) -> WarmFields:
    """Return the plane fields of a result. Raises BadInput when it has none."""
    if not isinstance(found.fields, WarmFields):
        raise BadInput("a drift without plane finite elements, expected a result with them")
    return found.fields


def plot_drift(ax: Axes | None, found: Drift, case: str) -> Axes:
    """Draw a stage displaced by 1 K or 1 K/mm, coloured by von Mises stress; return `ax`, or new
    axes.

    Raises BadInput for an unknown case, or a result without finite elements.
    """
    warm = _warm(found)
    if case not in warm.cases:
        raise BadInput(f"case {printed(case)}, expected one of: {', '.join(warm.cases)}")
    fields = warm.cases[case]
    factor = exaggeration(fields)
    ax = plot_displacement(ax, fields, factor=factor)
    moved = fields.nodes + factor * fields.displacement
    draw_boundary(ax, moved, warm.ground, INK, 3.0, zorder=4)
    x, y = WARM[case][2]
    if x or y:
        look = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
        ax.annotate(
            "", (0.02 + x, 0.86 + y), (0.02, 0.86), xycoords="axes fraction", arrowprops=look
        )
        ax.text(0.04 + x, 0.86 + y / 2, "warmer", transform=ax.transAxes, va="center", size=8.5)
    return ax


def _pose(pose: Array, lever: float) -> str:
    """Format a pose with unit prefixes and zeros in place of round-off."""
    sizes = np.abs(pose) * [1.0, 1.0, lever]
    cells = []
    for axis, value, size in zip(DIRECTIONS, pose, sizes, strict=True):
        unit = unit_for(axis, abs(value))
        shown = (
            f"{significant(unit.factor * value)} {unit}"
            if size > ROUND_OFF * np.max(sizes)
            else "0"
        )
        cells.append(f"{NAMES[axis]} {shown}")
    return ", ".join(cells)
