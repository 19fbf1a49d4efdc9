"""A small stored verification with made-up numbers: three chains of one triangle each and a ring about the hub."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.verify.budget import Budget, BudgetShare, Split, ThreeDimensional
from flexfem.verify.converge import MeshStudy
from flexfem.verify.result import CurveModels, Fields, HingeDrawing, Result, Series, Triple, Uncertainty

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


def model(**changes: Any) -> CurveModels:
    given: dict[str, Any] = {
        "stage": "a stage $x_1$",
        "file": "../geometry/one.toml",
        "hash": "1234567890abcdef" * 4,
        "mobility": 6,
        "formula": "paros-weisbord",
        "formula_in_range": True,
        "assumed": [],
        "not_stated": [],
        "stiffness": [[41.0, 2.3, 310.0], [2.1, 43.0, -290.0], [330.0, -270.0, 47000.0]],
        "compliance": np.linalg.inv([[37.0, 1.5, 220.0], [1.4, 38.5, -310.0], [230.0, -300.0, 39000.0]]).tolist(),
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
    return CurveModels(**(given | changes))


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
    given.setdefault(
        "uncertainty",
        {
            label: {axis: uncertainty(0.0173 + 0.01 * k + 0.1 * row) for k, axis in enumerate(("x", "y", "theta"))}
            for row, label in enumerate(errors)
        },
    )
    return Result(curves=curves, error_percent=percent, models=models, **given)


def uncertainty(band: float, **changes: Any) -> Uncertainty:
    given = {"resolutions": [3, 4, 6], "values": [1.1, 1.02, 1.0], "verdict": "converging", "order": 2.7}
    return Uncertainty(**(given | {"observed": 3.1, "extrapolated": 0.99, "band": band} | changes))


IN_THREE_DIMENSIONS = ThreeDimensional(
    resolution=4,
    layers=3,
    unknowns=203_823,
    points={
        "x": Triple(x=-10.673, y=3.1, theta=3.2),
        "y": Triple(x=2.1, y=5.217, theta=2.2),
        "theta": Triple(x=1.1, y=1.2, theta=-7.461),
    },
    band={"x": 0.121, "y": 0.234, "theta": 0.345},
)


def budget(**changes: Any) -> Budget:
    """Shares that differ in all directions and within each, of both signs; what is across is not what is along."""
    shares = {
        "x": [(0.216, 9.1, 8.1), (11.796, 9.2, 8.2), (0.526, 9.3, 8.3), (-0.308, 9.4, 8.4), (-0.139, 9.5, 8.5)],
        "y": [(7.1, -0.411, 6.1), (7.2, 8.523, 6.2), (7.3, 0.731, 6.3), (7.4, 0.092, 6.4), (7.5, 0.253, 6.5)],
        "theta": [(5.1, 4.1, 0.137), (5.2, 4.2, 9.685), (5.3, 4.3, -0.722), (5.4, 4.4, 0.051), (5.5, 4.5, 0.326)],
    }
    outside = {"x": (-10.533, 3.1, 3.2), "y": (2.1, 6.217, 2.2), "theta": (1.1, 1.2, -8.461)}
    bands, amplitudes = {"x": 0.013, "y": 0.127, "theta": 0.245}, {"x": 0.05, "y": 0.07, "theta": 0.002}
    split = {
        axis: Split(
            amplitude=amplitudes[axis],
            shares=[BudgetShare(name=name, points=triple(one)) for name, one in zip(NAMES, found, strict=True)],
            total=triple(tuple(np.sum(found, axis=0))),
            band=bands[axis],
            out_of_plane=triple(outside[axis]),
        )
        for axis, found in shares.items()
    }
    given = {"stage": "a stage $x_1$", "file": "one.toml", "hash": "1234", "plane": "plane_strain", "mobility": 6}
    given |= {
        "formula": "paros-weisbord",
        "assumed": [],
        "not_stated": [],
        "warnings": [],
        "split": split,
        "versions": {},
    }
    return Budget(**(given | changes))


NAMES = ("freedoms", "formula", "links", "what is left", "large displacement")


def triple(values: tuple[float, ...]) -> Triple:
    return Triple(x=values[0], y=values[1], theta=values[2])


def mesh_study(**changes: Any) -> MeshStudy:
    """Four meshes; the diagonal terms converge at orders 4, 3 and not at all, to values of their own."""
    resolutions = np.array([2.0, 3.0, 5.0, 8.0])
    limits = {"x": 0.0271, "y": 0.0263, "theta": 2.57e-5}
    values = {
        "x": limits["x"] * (1 - 0.3 * resolutions**-4),
        "y": limits["y"] * (1 - 0.2 * resolutions**-3),
        "theta": limits["theta"] * (1 + np.array([0.01, -0.02, 0.003, 0.007])),
    }
    compliance = np.array([[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]]) * np.arange(1, 5)[:, None, None]
    for k, found in enumerate(values.values()):
        compliance[:, k, k] = found
    bands, observed = {"x": 1.9e-4, "y": 8.3e-4, "theta": 4.1e-7}, {"x": 3.97, "y": 2.96, "theta": None}
    verdicts = {"x": "converging", "y": "out of range", "theta": "oscillatory"}
    found = {
        axis: uncertainty(
            bands[axis],
            resolutions=[2, 3, 5, 8],
            values=values[axis].tolist(),
            extrapolated=limits[axis],
            observed=observed[axis],
            verdict=verdicts[axis],
        )
        for axis in values
    }
    given = {
        "stage": "a stage $x_1$",
        "file": "one.toml",
        "hash": "1234",
        "assumed": [],
        "not_stated": [],
        "warnings": [],
        "resolutions": [2, 3, 5, 8],
    }
    given |= {"triangles": [31, 77, 211, 545], "unknowns": [123, 234, 567, 1234], "compliance": compliance.tolist()}
    return MeshStudy(**(given | {"uncertainty": found, "versions": {}} | changes))


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


SHARE = {"without": 0.61, "tangent": 0.97, "exact": 1.0}


SIZES = {
    "m": 1e3,
    "mm": 1.0,
    "µm": 1e-3,
    "nm": 1e-6,
    "pm": 1e-9,
    "rad": 1.0,
    "mrad": 1e-3,
    "µrad": 1e-6,
    "nrad": 1e-9,
    "prad": 1e-12,
    "%": 1.0,
}


def size_in(label: str) -> float:
    """What one of the unit in the brackets of a label is, in mm or rad."""
    return SIZES[label.rpartition("(")[2].rstrip(")")]


def extent(filled: Any) -> Array:
    """Ascending abscissae of a filled band, with its lower and upper ends there, (n, 3)."""
    (path,) = filled.get_paths()
    places = np.unique(path.vertices[:, 0])
    sides = [path.vertices[path.vertices[:, 0] == x, 1] for x in places]
    return np.array([(x, side.min(), side.max()) for x, side in zip(places, sides, strict=True)])


def texts(figure: Any) -> list[str]:
    """All that is written in a figure but at its axes, with plain spaces on one line each."""
    legends = [axes.get_legend() for axes in figure.axes] + figure.legends
    found = [
        text for where in (figure, *figure.axes, *(each for each in legends if each)) for text in where_texts(where)
    ]
    return [text.get_text().replace("\n", " ").replace("\N{NO-BREAK SPACE}", " ") for text in found]


def where_texts(where: Any) -> list[Any]:
    return where.get_texts() if hasattr(where, "get_texts") else where.texts


class Made(NamedTuple):
    """Makers of stored results, and readers of what was drawn."""

    hinges: Callable[..., list[HingeDrawing]]
    model: Callable[..., CurveModels]
    result: Callable[..., Result]
    fields: Callable[..., Fields]
    budget: Callable[..., Budget]
    mesh_study: Callable[..., MeshStudy]
    size_in: Callable[[str], float]
    extent: Callable[[Any], Array]
    texts: Callable[[Any], list[str]]
    three_dimensional: ThreeDimensional


@pytest.fixture(scope="session")
def made() -> Made:
    """Makers of stored results with made-up numbers."""
    return Made(hinges, model, result, fields, budget, mesh_study, size_in, extent, texts, IN_THREE_DIMENSIONS)
