"""A small stored verification with made-up numbers: three chains of one triangle each and a ring
about the hub.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.paper.budget import StageBudget
from flexfem.paper.verification import CurveModels, HingeDrawing, Verification
from flexfem.questions.budget import PLANE_SHARES, Budget
from flexfem.questions.convergence import MeshConvergence
from flexfem.questions.errors import MechanismErrors
from flexfem.results import About, Fields

HINGES = ("base", "elbow", "platform")
PLACES = ((52.0, -30.0), (25.0, -31.0), (21.0, 3.0))


def hinges(mobility: int = 6, neck: float = 0.4) -> list[HingeDrawing]:
    axial = {3: (), 6: ("base",), 12: HINGES, 21: HINGES}[mobility]
    made = []
    for chain in range(3):
        c = np.cos(chain * 2 * np.pi / 3)
        s = np.sin(chain * 2 * np.pi / 3)
        for position, (name, (x, y)) in enumerate(zip(HINGES, PLACES, strict=True)):
            where = {
                "centre": (c * x - s * y, s * x + c * y),
                "radius": 1.3 + 0.2 * position,
                "neck": neck,
            }
            axis = (3.1, 3.2, 1.7)[position] + chain * 2 * np.pi / 3
            freedoms = ["rotation", *(["axial"] * (name in axial)), *(["shear"] * (mobility == 21))]
            made.append(
                HingeDrawing(chain=chain + 1, hinge=name, axis=axis, freedoms=freedoms, **where)
            )
    return made


def model(**changes: Any) -> CurveModels:
    given: dict[str, Any] = {
        "stage": "a stage $x_1$",
        "file": "../geometry/one.toml",
        "hash": "1234567890abcdef" * 4,
        "plane": "plane_stress",
        "mobility": 6,
        "formula": "paros-weisbord",
        "links": False,
        "assumed": [],
        "not_stated": [],
        "lever": 21.0,
        "hub_radius": 7.0,
        "hinges": hinges(),
        "resolution": 5,
        "layers": 0,
        "triangles": 12345,
        "unknowns": 54321,
        "verdicts": ["converging"] * 3,
    }
    return CurveModels(**(given | changes))


def result(errors: dict[str, tuple[float, float, float]], **changes: Any) -> Verification:
    """A result whose errors are the given multiples of the command (made comparable by the lever),
    x, y, theta.
    """
    models = changes.pop("models", {label: model() for label in errors})
    axis = ("x", "y", "theta").index(changes.get("direction", "x"))
    commanded = np.array(changes.pop("commanded", [-0.05, 0.0, 0.05]))
    about = About(
        changes.pop("name", "A case $y$"),
        f"{changes.pop('case', 'fig')}.toml",
        "1234",
        changes.pop("assumed", []),
        changes.pop("not_stated", []),
        21.0,
    )
    warnings = changes.pop("warnings", [])
    settings = {
        "direction": "x",
        "analysis": "linear",
        "drive": "force",
        "model": changes.pop("elements", "fe"),
    }
    facts = {label: each.model_dump() for label, each in models.items()}
    comparable = commanded[:, None] * (21.0 if axis == 2 else 1.0) / np.array([1.0, 1.0, 21.0])
    values = {
        "command": commanded[:, None] * np.eye(3)[axis],
        "error": [np.array(each) * comparable for each in errors.values()],
        "percent": [100 * np.array(each) for each in errors.values()],
        "neck_stress": np.linspace(1.0, 31.7, 9).reshape(3, 3) * np.ones((len(errors), 1, 1)),
    }
    band = 0.0173 + 0.01 * np.arange(3) + 0.1 * np.arange(len(errors))[:, None]
    axes = {"curve": list(errors), "point": [str(k) for k in range(len(commanded))]}
    return Verification(
        about, values, {"percent": band}, axes, settings | changes | {"curves": facts}, warnings
    )


def budget(outside: bool = True, assumed: tuple[str, ...] = ()) -> StageBudget:
    """Shares that differ in all directions and within each, of both signs; totals are their sums."""
    shares = np.array(
        [
            [0.216, -0.411, 0.137],
            [11.796, 8.523, 9.685],
            [0.526, 0.731, -0.722],
            [-0.308, 0.092, 0.051],
            [-0.139, 0.253, 0.326],
        ]
    )
    share = np.concatenate([shares, np.sum(shares, axis=0, keepdims=True)])
    band = np.full(share.shape, np.nan)
    band[-1] = [0.013, 0.127, 0.245]
    values = {"share": share}
    bands = {"share": band}
    if outside:
        values["solid"] = np.array(
            [[-10.533, 6.217, -8.461], [-10.673, 5.217, -7.461], [1.4, 14.4, 2.0]]
        )
        bands["solid"] = np.array([[np.nan] * 3, [0.121, 0.234, 0.345], [0.134, 0.361, 0.590]])
    about = About("a stage $x_1$", "one.toml", "1234", assumed, lever=21.0)
    return StageBudget(about, values, bands, settings={"model": "mobility 6, paros-weisbord"})


def mesh_study(assumed: tuple[str, ...] = ()) -> MeshConvergence:
    """Four meshes; the diagonal terms converge at orders 4, 3 and not at all, to values of their
    own.
    """
    resolutions = np.array([2.0, 3.0, 5.0, 8.0])
    limits = np.array([0.0271, 0.0263, 2.57e-5])
    change = np.array([-0.3 * resolutions**-4, -0.2 * resolutions**-3, [0.01, -0.02, 0.003, 0.007]])
    band = np.full((4, 3), np.nan)
    band[-1] = [1.9e-4, 8.3e-4, 4.1e-7]
    values = {
        "along": limits * (1 + change.T),
        "extrapolated": limits,
        "order": [3.97, 2.96, np.nan],
    }
    return MeshConvergence(
        About("a stage $x_1$", "one.toml", "1234", assumed, lever=21.0),
        values | {"unknowns": [123, 234, 567, 1234]},
        {"along": band},
        {"mesh": [f"{n:.0f} across a neck" for n in resolutions]},
        notes=[
            "meshes in x: converging",
            "meshes in y: out of range",
            "meshes in theta: oscillatory",
        ],
    )


def guide_errors() -> MechanismErrors:
    """Errors of two models of a mechanism: from -4.5 % in steps of 1 %."""
    values = {
        "percent": np.arange(18.0).reshape(2, 3, 3) - 4.5,
        "free": np.ones((2, 3)),
        "lever": 36.0,
    }
    bands = {"percent": np.full((2, 3, 3), 0.25)}
    return MechanismErrors(
        About("a guide"), values, bands, {"model": ("analytic", "elastic bodies")}
    )


def guide_budget() -> Budget:
    """Shares of 3, -1, 1e-13 and their sum along y, with the bands of the last two; x is held."""
    shares = np.array([3.0, -1.0, 1e-13, 2.0])
    values = {"share": np.column_stack([np.full(4, np.nan), shares, 10 * shares])}
    bands = {"share": np.array([[np.nan] * 3, [np.nan] * 3, [1e-14] * 3, [0.25] * 3])}
    return Budget(About("a guide"), values, bands, {"share": PLANE_SHARES})


def fields() -> Fields:
    """Nine curved triangles around the hinges of the model; the base ones stand still along one
    side.
    """
    nodes = []
    triangles = []
    moved = []
    for number, hinge in enumerate(hinges()):
        corners = np.array(hinge.centre) + 4.0 * np.array([[1.0, 0.1], [-0.4, 0.9], [-0.6, -0.8]])
        middles = (corners + np.roll(corners, -1, axis=0)) / 2 + [
            [0.3, 0.2],
            [0.0, 0.0],
            [0.0, 0.0],
        ]
        triangles.append(np.arange(6) + 6 * number)
        nodes += [*corners, *middles]
        still = np.array([0, 1, 0, 0, 0, 0] if hinge.hinge == "base" else [1, 1, 1, 1, 1, 1])
        moved.append(still[:, None] * [0.031, -0.012])
    bodies = np.repeat([0, 4, 8], 3) + np.tile([0, 1, 2], 3)
    stress = np.linspace(0.01, 31.7, len(nodes))
    where = {"nodes": np.array(nodes), "triangles": np.array(triangles), "bodies": bodies}
    return Fields(**where, displacement=np.concatenate(moved), stress=stress)


SIZES = {"m": 1e3, "mm": 1.0, "µm": 1e-3, "nm": 1e-6, "pm": 1e-9, "%": 1.0}
SIZES |= {"rad": 1.0, "mrad": 1e-3, "µrad": 1e-6, "nrad": 1e-9, "prad": 1e-12}


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
    legends = [
        each for each in (*(axes.get_legend() for axes in figure.axes), *figure.legends) if each
    ]
    found = [text for where in (figure, *figure.axes) for text in where.texts]
    found += [text for legend in legends for text in legend.get_texts()]
    return [text.get_text().replace("\n", " ").replace("\N{NO-BREAK SPACE}", " ") for text in found]


@pytest.fixture(scope="session")
def made() -> Any:
    """Makers of stored results with made-up numbers, and readers of what was drawn: this module."""
    return sys.modules[__name__]
