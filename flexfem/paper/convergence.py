"""Convergence of the compliance of the platform on meshes of increasing resolution."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from flexfem.paper import warnings as warning
from flexfem.paper.answers import about
from flexfem.paper.solutions import solved
from flexfem.paper.stage import Stage
from flexfem.questions.bands import refinements
from flexfem.questions.convergence import MeshConvergence, refined
from flexfem.questions.setup import on_meshes
from flexfem.results import COARSE_MESHES, Gate, Progress, Quantity

RESOLUTIONS = (3, 4, 6, 8, 11, 15)


class StageConvergence(MeshConvergence):
    """Compliance of the platform on meshes of increasing resolution, and its extrapolated limit."""

    kind_name = "mesh_convergence"
    along = replace(MeshConvergence.along, gate=COARSE_MESHES)
    extrapolated = replace(MeshConvergence.extrapolated, gate=COARSE_MESHES)
    order = replace(MeshConvergence.order, gate=Gate(0.1))
    unknowns = replace(MeshConvergence.unknowns, gate=Gate(0.05))
    triangles = Quantity("triangles", "", ("mesh",), Gate(0.05))
    compliance = Quantity(
        "compliance",
        "compliance matrix",
        ("mesh", "component", "direction"),
        COARSE_MESHES,
        "matrix",
        shown=False,
    )


def converge(
    stage: Stage, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> StageConvergence:
    """Answer `flexfem.converge` for a stage; the arguments are those of that function."""
    steps = refinements(RESOLUTIONS if resolutions is None else resolutions)
    meshes = on_meshes(steps, partial(solved, stage), progress)
    values, bands, axes, warnings, notes = refined(steps, meshes)
    values["compliance"] = np.array([mesh.compliance for mesh in meshes])
    values["triangles"] = [mesh.triangles for mesh in meshes]
    texts = [*warning.of_numbers(stage), *warnings]
    return StageConvergence(about(stage), values, bands, axes, warnings=texts, notes=notes)
