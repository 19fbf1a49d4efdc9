"""
Shapes of hinges
================

A hinge of a mechanism has one of seven shapes. The figure shows each shape with its dimensions,
which are the keys of a `[[hinge]]` table, and its rotational compliance by the beam integral of the
analytic model. All hinges have the same neck, and all but the circular one and the v have the same
length."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from matplotlib import pyplot

from flexfem.mechanism.profiles import profile_of

ROWS = [(0.0, 5.0), (1.0, 2.2), (3.0, 1.0), (5.0, 1.0), (7.0, 2.2), (8.0, 5.0)]
SHAPES: dict[str, dict[str, Any]] = {
    "circular": {"radius": 2.0},
    "elliptical": {"length": 8.0, "depth": 2.0},
    "parabolic": {"length": 8.0, "depth": 2.0},
    "filleted": {"length": 8.0, "fillet": 2.0},
    "leaf": {"length": 8.0, "fillet": 0.5},
    "v": {"angle": np.deg2rad(110.0), "root_radius": 1.2, "depth": 2.2},
    "profile": {"table": ROWS},
}
MARKS = {  # dimension: start and end of an arrow, mm, of the shapes that have it
    ("circular", "radius"): ((0.0, 2.5), (1.41, 1.09)),
    ("filleted", "fillet"): ((2.0, 2.5), (3.41, 1.09)),
    ("v", "root_radius"): ((-1.5, 2.95), (-0.35, 0.62)),
    ("leaf", "fillet"): ((2.6, 1.7), (3.6, 0.7)),
}
BODY = 8.4  # height of both bodies, mm


def draw(file: str | None = None) -> dict[str, float]:
    """Print the rotational compliance of every shape, rad/(N mm), and draw all; aluminium, 10 mm
    thick.
    """
    figure, axes = pyplot.subplots(2, 4, figsize=(12, 6.2), layout="constrained")
    found = dict[str, float]()
    for ax, (shape, dimensions) in zip(axes.flat, SHAPES.items(), strict=False):
        profile = profile_of(
            shape, dimensions if shape == "profile" else dimensions | {"neck": 1.0}
        )
        found[shape] = float(profile.compliance(71.7e3, 0.33, 10.0)[2, 2])
        half = profile.length / 2
        end = profile.end_height
        x = half * np.sin(np.linspace(-np.pi / 2, np.pi / 2, 801))
        ax.fill_between(
            x, -profile.height(x) / 2, profile.height(x) / 2, color="#C25500", linewidth=0
        )
        for side in (-1, 1):
            ax.fill_between(
                [side * half, side * 7.0], -BODY / 2, BODY / 2, color="#E3E6EA", linewidth=0
            )
        ax.axhline(0.0, color="white", linewidth=0.6, linestyle="-.")
        arrow(ax, (0.0, -1.9), (0.0, -0.5), "neck", (0.25, -1.9), "->")
        arrow(ax, (-half, -3.75), (half, -3.75), "length", (0.0, -3.6), "<->")
        if "depth" in dimensions:
            arrow(
                ax,
                (0.0, 0.5),
                (0.0, end / 2),
                "depth",
                (0.25, 0.5 + dimensions["depth"] / 2),
                "<->",
            )
        for (of, name), (start, tip) in MARKS.items():
            if of == shape:
                arrow(ax, start, tip, name, (start[0] + 0.3, start[1] + 0.1), "->")
        if shape == "v":
            draw_angle(ax, dimensions["angle"])
        keys = ", ".join(["table"] if shape == "profile" else [*dimensions, "neck"])
        ax.set_title(f'"{shape}"\n{keys}', fontsize=10)
        ax.set(xlim=(-6, 6), ylim=(-BODY / 2, BODY / 2), aspect="equal")
        ax.set_axis_off()
    bars = axes.flat[-1]
    bars.barh([*found], [1e6 * value for value in found.values()], color="#C25500")
    bars.invert_yaxis()
    bars.set_xlabel("rotation (µrad/(N mm)),\nneck 1 mm, aluminium 10 mm thick", fontsize=8)
    bars.tick_params(labelsize=8)
    for shape, value in found.items():
        print(f"{shape:12}{value:12.4g} rad/(N mm)")
    if file:
        figure.savefig(file, dpi=100)
    return found


def draw_angle(ax: Any, angle: float) -> None:
    """Draw the angle between the flanks of the lower notch, from the point where they meet."""
    directions = -np.pi / 2 + angle / 2 * np.linspace(-1, 1, 41)
    arc = -0.24j + 2.3 * np.exp(1j * directions)
    ax.plot(arc.real, arc.imag, color="black", linewidth=0.8)
    ax.text(-0.2, -2.0, "angle", ha="right", va="center", fontsize=8)


def arrow(ax: Any, start: Any, end: Any, name: str, at: Any, style: str) -> None:
    """Draw a dimension with its name."""
    ax.annotate(
        "",
        end,
        start,
        arrowprops={"arrowstyle": style, "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0},
    )
    centred = "center" if name == "length" else "left" if name in ("neck", "depth") else "right"
    ax.text(*at, name, ha=centred, va="bottom" if name != "neck" else "center", fontsize=8)


if __name__ == "__main__":
    draw(sys.argv[1] if len(sys.argv) > 1 else None)
