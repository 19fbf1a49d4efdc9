"""A stage with its dimensions; of one that is not finished, what there is."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from os import environ
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from flexfem.arrays import Array
from flexfem.mechanism.bodies import necks, polygon_points
from flexfem.mechanism.designs import CHAIN_TURN, stage_frames
from flexfem.mechanism.drawing import LETTER, TURNS, Dimensions, dimensions_of, part_of
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, PartialStage, Stage
from flexfem.plot.marks import arrow, clear_spot
from flexfem.plot.stage import plot_stage
from flexfem.plot.style import GREY, INK, in_house_style, new_axes, panels
from flexfem.units import LENGTH

COLOUR = "#00664A"
SIZE = 8.0  # points
HALO = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"}
SKELETON = ("chain.link_lengths_mm", "chain.joint_angles_deg")


def plot_dimensions(ax: Axes | None, stage: Stage, missing: Sequence[str] = ()) -> Axes:
    """Draw a stage to scale with its dimensions, in mm; returns `ax`, or new axes.

    missing : key paths that its file does not give; of such a stage only what does not need them is drawn.

    Raises BadInput when nothing is missing and its bodies cannot be drawn.
    """
    found = PartialStage(stage, list(missing))
    ax = ax or new_axes()
    if found.whole:
        part = part_of(stage)
        plot_stage(ax, stage)
        corners = np.concatenate([_draw_dimensions(ax, dimensions_of(stage, part)), polygon_points(part.outer)])
    else:
        corners = _draw_given(ax, found)
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.03 * max(high - low)
    ax.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    ax.set_aspect("equal", anchor="N")
    ax.set(xlabel=f"x ({LENGTH})", ylabel=f"y ({LENGTH})")
    return ax


def _xy(z: complex) -> tuple[float, float]:
    return float(z.real), float(z.imag)


def _write(ax: Axes, at: complex, text: str, turn: float = 0.0) -> None:
    ax.text(*_xy(at), text, size=SIZE, color=COLOUR, rotation=turn, ha="center", va="center", zorder=8, bbox=HALO)


def _draw_dimensions(ax: Axes, of: Dimensions) -> Array:
    """Draw lengths and labels; returns places (n, 2) that must be seen."""
    seen = list[complex]()
    for span in of.spans:
        start, end = span.line
        for foot, head in ((span.start, start), (span.end, end)):
            ax.plot(*np.transpose([_xy(foot), _xy(head)]), color=COLOUR, linewidth=0.5, zorder=6)
        arrow(ax, _xy(start), _xy(end), "<|-|>", COLOUR, 0.8)
        short = abs(end - start) < 2 * LETTER * of.height * len(span.text)  # its text goes beside the line
        aside = 1j * (end - start) / abs(end - start) * np.sign(span.away) * of.height * 1.5 if short else 0j
        _write(ax, (start + end) / 2 + aside, span.text, float(np.rad2deg(np.angle(end - start))))
        seen += [start + 2 * aside, end + 2 * aside]
    for label in of.labels:
        ax.plot(*np.transpose([_xy(end) for end in label.line]), color=COLOUR, linewidth=0.5, zorder=6)
        _write(ax, label.place, label.text)
        seen += [label.place - label.half, label.place + label.half]
    return np.array([_xy(z) for z in seen])


def _draw_given(ax: Axes, found: PartialStage) -> Array:
    """Draw what does not need what is missing; returns places (n, 2) that must be seen."""
    stage, seen = found.stage, [np.zeros((1, 2))]
    circles = {"platform": stage.platform.radius, "hub": stage.platform.hub_radius}
    for name, radius in circles.items():
        if found.given(f"platform.{'hub_' * (name == 'hub')}radius_mm"):
            style = "--" if name == "hub" else "-"
            ax.add_patch(Circle((0, 0), radius, fill=False, edgecolor=INK, linewidth=0.9, linestyle=style, zorder=3))
            _write(ax, radius * np.exp(-0.6j * np.pi), f"{name} R {radius:.6g}")
            seen.append(1.15 * radius * np.array([[-1.0, -1.0], [1.0, 1.0]]))
    if found.given(*SKELETON):
        seen += _draw_skeleton(ax, found)
    return np.concatenate(seen)


def _draw_skeleton(ax: Axes, found: PartialStage) -> list[Array]:
    """Draw the lines of the chains with lengths and hinges of chain 1; returns places (n, 2) that must be seen."""
    stage, centres = found.stage, stage_frames(found.stage).centres
    lines = np.concatenate([centres, np.zeros((3, 1, 2))], axis=1)
    size, shares = float(np.abs(lines).max()), np.linspace(0.0, 1.0, 9)[:, None, None]
    taken = [((1 - shares) * lines[:, None, :-1] + shares * lines[:, None, 1:]).reshape(-1, 2)]
    labels = [(f"chain {chain}", line[0]) for chain, line in zip(CHAINS, lines, strict=True)]
    for line in lines:
        ax.plot(*line.T, "o-", color=INK, linewidth=1.2, markersize=3.5, zorder=4)
    for k, length in enumerate(stage.chain.link_lengths):
        labels.append((f"l{k + 1} {length:.6g}", lines[0, k : k + 2].mean(axis=0)))
    for k, name in enumerate(HINGE_NAMES):
        drawn = [_draw_notches(ax, found, chain, name) for chain in CHAINS]
        taken += [rim for _, rims in drawn for rim in rims]
        texts = [f"{name} hinge {said}".strip() for said, _ in drawn]
        labels += [(text, lines[chain, k]) for chain, text in enumerate(texts) if chain == 0 or text != texts[0]]
    for text, anchor in labels:
        half = 0.011 * size * len(text)
        spot = clear_spot(anchor, 0.1 * size, np.concatenate(taken), 0.05 * size, half)
        _write(ax, complex(*spot), text)
        taken.append(spot + half * np.array([[-1.0, 0.0], [-0.5, 0.0], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]))
    return [*taken, 1.05 * lines.reshape(-1, 2)]


def _draw_notches(ax: Axes, found: PartialStage, chain: int, name: str) -> tuple[str, list[Array]]:
    """Draw the circles of a hinge's notches where its file gives them; returns what it gives, and rims."""
    stage, given, rims = found.stage, dict[str, float](), list[Array]()
    for key, letter in (("radius", "R"), ("neck", "t")):
        own = any(each.place == (chain, name) and getattr(each, key) is not None for each in stage.override)
        if own or found.given(f"hinges.{name}.{key}_mm"):
            given[letter] = getattr(stage.hinge(chain, name), key)
    pose, turn = necks(stage, chain)[HINGE_NAMES.index(name)], np.exp(1j * (chain - 1) * CHAIN_TURN)
    for side in (1, -1) if len(given) == 2 else ():
        middle = turn * (pose.point + side * (given["R"] + given["t"] / 2) * 1j * np.exp(1j * pose.heading))
        ax.add_patch(Circle(_xy(middle), given["R"], fill=False, edgecolor=GREY, linewidth=0.9, zorder=3))
        rims.append(np.array([_xy(middle + given["R"] * each) for each in TURNS]))
    return ", ".join(f"{letter} {value:.6g}" for letter, value in given.items()), rims


@in_house_style
def drawing_figure(stage: Stage, missing: Sequence[str] = ()) -> Figure:
    """A page with the stage, its dimensions, what the drawing does not show, and what is missing."""
    found = PartialStage(stage, list(missing))
    facts = {
        "thickness_mm": f"thickness {stage.thickness:.6g} {LENGTH}",
        "chain.link_width_mm": f"link width {stage.chain.link_width:.6g} {LENGTH}",
        "chain.joint_angles_deg": "joint angles "
        + ", ".join(f"{angle:.6g}" for angle in np.rad2deg(stage.chain.joint_angles))
        + " deg",
        "material.name": stage.material.name,
    }
    lines = ["; ".join(text for key, text in facts.items() if found.given(key))]
    if missing:
        lines.append(f"missing: {', '.join(missing)}")
    elif stage.chains_alike:
        lines.append("Hinges are labelled on chain 1; chains 2 and 3 are the same, turned by 120 and 240 degrees.")
    if found.whole:
        lines.append("Heavy lines: clamped. Disc: the hub, rigid in the models.")
    title = stage.name if found.given("name") else str(stage.origin)
    figure, (axes,) = panels((8.27, 7.6), title, [line for line in lines if line], 1, doubts=found.doubts)
    plot_dimensions(axes, stage, missing)
    return figure


def has_display() -> bool:
    """Whether matplotlib can open a window here."""
    if sys.platform.startswith("linux") and not (environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY")):
        return False
    import matplotlib as mpl
    from matplotlib.backends.registry import BackendFilter, backend_registry

    known: Any = backend_registry
    try:
        return mpl.get_backend().lower() in known.list_builtin(BackendFilter.INTERACTIVE)
    except ImportError:  # of the backend that the user asks for
        return False


def show_window(stage: Stage, missing: Sequence[str] = ()) -> None:
    """Open the drawing in a window, and wait until it is closed."""
    from matplotlib import pyplot

    figure, ax = pyplot.subplots(figsize=(8.27, 8.27), layout="constrained")
    plot_dimensions(ax, stage, missing)
    ax.set_title(f"{stage.origin}: missing {', '.join(missing)}" if missing else stage.name, wrap=True)
    pyplot.show()
    pyplot.close(figure)
