"""A small stored verification with made-up numbers: three chains of one triangle each and a ring about the hub."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from flexfem.verify.result import Fields, HingeDrawing, Model, Result, Series, Triple, Uncertainty

HINGES = ("base", "elbow", "platform")
PLACES = ((52.0, -30.0), (25.0, -31.0), (21.0, 3.0))


def hinges(mobility: int = 6, neck: float = 0.4) -> list[HingeDrawing]:
    axial = {3: (), 6: ("base",), 12: HINGES, 21: HINGES}[mobility]
    made = []
    for chain in range(3):
        c, s = np.cos(chain * 2 * np.pi / 3), np.sin(chain * 2 * np.pi / 3)
        for position, (name, (x, y)) in enumerate(zip(HINGES, PLACES, strict=True)):
            made.append(
                HingeDrawing(
                    chain=chain + 1,
                    hinge=name,
                    centre=(c * x - s * y, s * x + c * y),
                    axis=(3.1, 3.2, 1.7)[position] + chain * 2 * np.pi / 3,
                    radius=1.3 + 0.2 * position,
                    neck=neck,
                    freedoms=["rotation", *(["axial"] * (name in axial)), *(["shear"] * (mobility == 21))],
                )
            )
    return made


def model(**changes: Any) -> Model:
    given: dict[str, Any] = {
        "stage": "a stage $x_1$",
        "file": "../geometry/one.toml",
        "hash": "1234567890abcdef" * 4,
        "mobility": 6,
        "formula": "paros-weisbord",
        "formula_in_range": True,
        "assumed": [],
        "not_stated": [],
        "stiffness": np.diag([41.0, 43.0, 47000.0]).tolist(),
        "compliance": np.diag([1 / 37.0, 1 / 38.5, 1 / 39000.0]).tolist(),
        "force": [[-2.05, 0.0, 0.0], [0.0, 0.0, 0.0], [2.05, 1e-17, 0.0]],
        "neck_stress": [[1.0, 2.0, 3.0], [4.0, 31.7, 6.0], [7.0, 8.0, 9.0]],
        "lever": 21.0,
        "link_width": 8.0,
        "platform_radius": 16.0,
        "hub_radius": 7.0,
        "hinges": hinges(),
        "resolution": 5,
        "triangles": 12345,
        "unknowns": 54321,
    }
    return Model(**(given | changes))


def result(errors: dict[str, tuple[float, float, float]], **changes: Any) -> Result:
    """A result whose errors are the given multiples of the command (made comparable by the lever), x, y, theta."""
    given: dict[str, Any] = {"case": "fig", "name": "A case $y$", "direction": "x", "commanded": [-0.05, 0.0, 0.05]}
    given |= {
        "assumed": [],
        "not_stated": [],
        "warnings": [],
        "versions": {"flexfem": "0.1.0"},
        "written": "2026-01-01T00:00:00+00:00",
        "seconds": 1.5,
    }
    given |= changes
    models = given.pop("models", {label: model() for label in errors})
    command = np.array(given["commanded"]) * (21.0 if given["direction"] == "theta" else 1.0)
    curves = {
        label: Series(x=list(a * command), y=list(b * command), theta=list(c * command / 21.0))
        for label, (a, b, c) in errors.items()
    }
    percent = {label: Triple(x=100 * a, y=100 * b, theta=100 * c) for label, (a, b, c) in errors.items()}
    given.setdefault("uncertainty", {label: {axis: uncertainty() for axis in ("x", "y", "theta")} for label in errors})
    return Result(curves=curves, error_percent=percent, models=models, **given)


def uncertainty() -> Uncertainty:
    return Uncertainty(
        resolutions=[3, 4, 6],
        values=[1.1, 1.02, 1.0],
        verdict="converging",
        order=3.1,
        observed=3.1,
        extrapolated=0.99,
        band=0.0173,
    )


def fields() -> Fields:
    """Nine curved triangles around the hinges of the model; the base ones stand still along one side."""
    nodes, triangles, moved = [], [], []
    for number, hinge in enumerate(hinges()):
        corners = np.array(hinge.centre) + 4.0 * np.array([[1.0, 0.1], [-0.4, 0.9], [-0.6, -0.8]])
        middles = (corners + np.roll(corners, -1, axis=0)) / 2 + [[0.3, 0.2], [0.0, 0.0], [0.0, 0.0]]
        triangles.append(np.arange(6) + 6 * number)
        nodes += [*corners, *middles]
        still = np.array([0, 1, 0, 0, 0, 0] if hinge.hinge == "base" else [1, 1, 1, 1, 1, 1])
        moved.append(still[:, None] * [0.031, -0.012])
    stress = np.linspace(0.01, 31.7, len(nodes))
    bodies = np.repeat([0, 4, 8], 3) + np.tile([0, 1, 2], 3)
    return Fields(
        nodes=np.array(nodes),
        triangles=np.array(triangles),
        bodies=bodies,
        displacement=np.concatenate(moved),
        stress=stress,
    )


class Made(NamedTuple):
    """Makers of stored results."""

    hinges: Callable[..., list[HingeDrawing]]
    model: Callable[..., Model]
    result: Callable[..., Result]
    fields: Callable[..., Fields]


@pytest.fixture(scope="session")
def made() -> Made:
    """Makers of stored results with made-up numbers."""
    return Made(hinges, model, result, fields)
