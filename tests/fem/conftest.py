"""Small meshes, made once a session: gmsh starts in a process of its own, which takes longer than most solutions."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh
from flexfem.fem.response import Response, plate_of, platform_response
from flexfem.fem.sectors import build_mesh
from flexfem.stage.schema import Stage, load_stage

GEOMETRY = Path(__file__).parents[2] / "geometry"
RESOLUTION = 3  # triangles across a neck: within 0.5 % of the converged compliance, and a mesh takes 0.3 s

GENERIC: dict[str, Any] = {
    "name": "generic stage",
    "thickness_mm": 9.7,
    "material": {
        "name": "generic metal",
        "youngs_modulus_gpa": 68.3,
        "poissons_ratio": 0.29,
        "density_kg_m3": 2739.0,
        "yield_strength_mpa": 411.0,
    },
    "chain": {
        "link_lengths_mm": [31.0, 33.5, 25.0],
        "joint_angles_deg": [175.0, -85.0, 92.0],
        "link_width_mm": 8.9,
    },
    "hinges": {
        "base": {"radius_mm": 3.9, "neck_mm": 0.53, "prismatic": True},
        "elbow": {"radius_mm": 1.6, "neck_mm": 0.47},
        "platform": {"radius_mm": 1.4, "neck_mm": 0.61},
    },
    "platform": {"radius_mm": 16.3, "hub_radius_mm": 7.7},
}
UNLIKE: list[dict[str, Any]] = [
    {"chain": 1, "hinge": "base", "radius_mm": 2.3, "axis_deg": 183.0},
    {"chain": 2, "hinge": "elbow", "neck_mm": 0.83},
    {"chain": 3, "hinge": "platform", "radius_mm": 1.9, "neck_mm": 0.41, "axis_deg": 101.0},
]


class Solved(NamedTuple):
    """A stage, its mesh and its answer to unit loads."""

    stage: Stage
    mesh: StageMesh
    response: Response


def with_changes(changes: Mapping[str, Any] = MappingProxyType({})) -> Stage:
    """The generic stage with the values of some key paths, such as `hinges.base.neck_mm`, replaced."""
    content = copy.deepcopy(GENERIC)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = content
        for name in tables:
            table = table[name]
        table[key] = value
    return Stage.model_validate(content)


def solved(stage: Stage, resolution: int = RESOLUTION) -> Solved:
    mesh = build_mesh(stage, resolution)
    return Solved(stage, mesh, platform_response(mesh, plate_of(stage)))


def in_length(C: Array, lever: float) -> Array:
    """Compliance (3, 3) with rotations and moments made displacements and forces at `lever` mm."""
    scale = np.array([1.0, 1.0, lever])
    return C * np.outer(scale, scale)


@pytest.fixture(scope="session")
def make_stage() -> Callable[..., Stage]:
    """`with_changes`."""
    return with_changes


@pytest.fixture(scope="session")
def solve() -> Callable[..., Solved]:
    """`solved`."""
    return solved


@pytest.fixture(scope="session")
def made_lengths() -> Callable[[Array, float], Array]:
    """`in_length`."""
    return in_length


@pytest.fixture(scope="session")
def alike() -> Solved:
    """The generic stage: three chains alike."""
    return solved(with_changes())


@pytest.fixture(scope="session")
def unlike() -> Solved:
    """The generic stage with three hinges of different chains overridden."""
    return solved(with_changes({"override": UNLIKE}))


@pytest.fixture(scope="session", params=["alike", "unlike"])
def each(request: pytest.FixtureRequest) -> Solved:
    """Both generic stages."""
    found: Solved = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="session", params=["mobility3", "mobility6"])
def reference(request: pytest.FixtureRequest) -> Solved:
    """Both shipped stages."""
    return solved(load_stage(GEOMETRY / f"{request.param}.toml"))


def rectangle(length: float, height: float, columns: int, rows: int) -> StageMesh:
    """A bar along x that ends at the origin: `ground` at its left end, `hub` at its right end."""
    from skfem import MeshTri1

    x, y = np.linspace(-length, 0.0, columns + 1), np.linspace(-height / 2, height / 2, rows + 1)
    grid = MeshTri1.init_tensor(x, y)
    a, b, c = (grid.p[:, k] for k in grid.t)
    clockwise = (b - a)[0] * (c - a)[1] < (b - a)[1] * (c - a)[0]
    t = np.where(clockwise, grid.t[[0, 2, 1]], grid.t)
    grid = MeshTri1(grid.p, t, sort_t=False)
    middles = grid.p[:, grid.facets].mean(axis=1)
    triangles = np.vstack([grid.t, grid.nvertices + grid.t2f]).T
    nodes = np.hstack([grid.p, middles]).T
    ends = {"ground": -length, "hub": 0.0}
    edges = {}
    for name, place in ends.items():
        facets = np.flatnonzero(np.abs(middles[0] - place) < 1e-9 * length)
        edges[name] = np.column_stack([grid.facets[:, facets].T, grid.nvertices + facets])
    return StageMesh(nodes, triangles, np.zeros(len(triangles), dtype=np.int64), edges)


@pytest.fixture(scope="session")
def bar() -> Callable[[float, float, int, int], StageMesh]:
    """`rectangle`."""
    return rectangle
