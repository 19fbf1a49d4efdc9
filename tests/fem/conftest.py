"""Small meshes, made once a session: gmsh starts in a process of its own, which takes longer than
most solutions.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from flexfem.fem.mesh import PlaneMesh, mapped
from flexfem.fem.response import Response, platform_response
from flexfem.paper.stage import Stage, load_stage
from flexfem.paper.stage_mesh import build_mesh, plate_of

from ..conftest import UNLIKE, with_changes

GEOMETRY = Path(__file__).parents[2] / "geometry"
RESOLUTION = (
    3  # triangles across a neck: within 0.5 % of the converged compliance, and a mesh takes 0.3 s
)


class Solved(NamedTuple):
    """A stage, its mesh and its answer to unit loads."""

    stage: Stage
    mesh: PlaneMesh
    response: Response


def solved(stage, resolution=RESOLUTION):
    mesh = build_mesh(stage, resolution)
    return Solved(stage, mesh, platform_response(mesh, plate_of(stage)))


@pytest.fixture(scope="session")
def alike():
    """The generic stage: three chains alike."""
    return solved(with_changes())


@pytest.fixture(scope="session")
def unlike():
    """The generic stage with three hinges of different chains overridden."""
    return solved(with_changes({"override": UNLIKE}))


@pytest.fixture(scope="session", params=["alike", "unlike"])
def each(request):
    """Both generic stages."""
    found: Solved = request.getfixturevalue(request.param)
    return found


@pytest.fixture(scope="session", params=["mobility3", "mobility6"])
def reference(request):
    """Both shipped stages."""
    return solved(load_stage(GEOMETRY / f"{request.param}.toml"))


def bar(length, height, columns, rows):
    """A bar along x that ends at the origin: `ground` at its left end, `hub` at its right end."""
    mesh = mapped(
        columns, rows, lambda u, v: np.stack([length * (u - 1), height * (v - 0.5)], axis=-1)
    )
    return mesh._replace(edges={"ground": mesh.edges["left"], "hub": mesh.edges["right"]})
