"""Convergence of the platform compliance on meshes of increasing resolution."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import plates
from flexfem.questions import warnings as warning
from flexfem.questions.bands import refined, refinements
from flexfem.questions.setup import about, for_mechanisms, on_meshes, question, solved
from flexfem.results import COARSER as ON_COARSER
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

RESOLUTIONS = (3, 4, 6, 8, 11, 15)
LARGE = 1e-3  # of a compliance: the target accuracy of the default mesh


class MeshConvergence(Result):
    """Platform compliance of a stage on meshes of increasing resolution, and its extrapolated limit."""

    title = "mesh convergence"
    figure = "errors.convergence_figure"
    along = Quantity("compliance along each direction", "compliance", ("mesh", "direction"), ON_COARSER)
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), ON_COARSER)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.1))
    triangles = Quantity("triangles", "", ("mesh",), Gate(0.05))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))
    compliance = Quantity(
        "compliance", "compliance matrix", ("mesh", "component", "direction"), ON_COARSER, "matrix", shown=False
    )

    @property
    def resolutions(self) -> list[int]:
        """Triangles across every neck of each mesh, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """Verdict on the three finest meshes in each direction."""
        return [note.partition(": ")[2] for note in self.notes]


@for_mechanisms(plates.converge)
@question
def converge(
    stage: Stage, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> MeshConvergence:
    """Solve a stage or mechanism on finer and finer meshes: observed order, extrapolated compliance and mesh band.

    Parameters
    ----------
    resolutions : list of int, optional
        Triangles across every neck: three or more, each at least 1.3 times the previous one; by default 3 to 15.
    {shared}

    Notes
    -----
    I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001; the band is Roache's index, with his safety factors.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.converge(flexfem.load("geometry/mobility6.toml"), resolutions=[2, 3, 4])
    >>> found.verdicts
    ['converging', 'converging', 'converging']
    """
    check_feasible(stage)
    steps = refinements(RESOLUTIONS if resolutions is None else resolutions)
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    C = np.array([mesh.compliance for mesh in meshes])
    found = refined(steps, np.diagonal(C, axis1=1, axis2=2))
    values: dict[str, Any] = {name: [getattr(mesh, name) for mesh in meshes] for name in ("triangles", "unknowns")}
    values |= {"along": found.values["along"], "compliance": C, **found.values}
    large = [
        f"the mesh band of the compliance in {axis} is ±{100 * curve.band / abs(curve.extrapolated):.2g} % "
        f"({curve.verdict}); finer meshes reduce it"
        for axis, curve in zip(DIRECTIONS, found.curves, strict=True)
        if curve.band > LARGE * abs(curve.extrapolated)
    ]
    return MeshConvergence(
        about(stage),
        values,
        found.bands,
        found.labels,
        warnings=[*warning.of_numbers(stage), *large],
        notes=found.notes,
    )
