"""Small meshes, made once a session: gmsh starts in a process of its own, which takes longer than most solutions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.arrays import Array
from flexfem.fem.mesh import StageMesh, build_mesh
from flexfem.fem.response import StaticSolution, platform_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.stage import Stage, load_stage

from ..conftest import UNLIKE, with_changes

GEOMETRY = Path(__file__).parents[2] / "geometry"
RESOLUTION = 3  # triangles across a neck: within 0.5 % of the converged compliance, and a mesh takes 0.3 s


class Solved(NamedTuple):
    """A stage, its mesh and its answer to unit loads."""

    stage: Stage
    mesh: StageMesh
    response: StaticSolution


def solved(stage: Stage, resolution: int = RESOLUTION) -> Solved:
    mesh = build_mesh(stage, resolution)
    return Solved(stage, mesh, platform_response(mesh, plate_of(stage)))


def in_length(C: Array, lever: float) -> Array:
    """Compliance (3, 3) with rotations and moments made displacements and forces at `lever` mm."""
    scale = np.array([1.0, 1.0, lever])
    return C * np.outer(scale, scale)


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
