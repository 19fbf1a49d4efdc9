"""Convergence of the platform compliance on meshes of increasing resolution."""

from __future__ import annotations

import numpy as np

from flexfem.fem.response import Response
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.questions import plates
from flexfem.questions import warnings as warning
from flexfem.questions.bands import grid_convergence, refinements
from flexfem.questions.plates import ON_MESHES
from flexfem.questions.setup import answer, for_mechanisms, on_meshes, solved
from flexfem.results import COARSER, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

RESOLUTIONS, MECHANISM_RESOLUTIONS = (3, 4, 6, 8, 11, 15), (3, 4, 6, 8)
LARGE = 1e-3  # of a compliance: the target accuracy of the default mesh


class MeshConvergence(Result):
    """Platform compliance of a stage on meshes of increasing resolution, and its extrapolated limit."""

    title = "mesh convergence"
    main = ("extrapolated", {})
    figure = "errors.convergence_figure"
    along = Quantity("compliance along each direction", "compliance", ("mesh", "direction"), COARSER)
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), COARSER)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.1))
    triangles = Quantity("triangles", "", ("mesh",), Gate(0.05))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))
    compliance = Quantity(
        "compliance", "compliance matrix", ("mesh", "component", "direction"), COARSER, "matrix", shown=False
    )

    @property
    def resolutions(self) -> list[int]:
        """Triangles across every neck of each mesh, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """Verdict on the three finest meshes in each direction."""
        return [note.partition(": ")[2] for note in self.notes]


class MechanismConvergence(Result):
    """Output compliance on meshes of increasing resolution, and its extrapolated limit."""

    title = "mesh convergence"
    main = ("extrapolated", {})
    along = Quantity("compliance along each direction", "compliance", ("mesh", "direction"), ON_MESHES)
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), ON_MESHES)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.5))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))


@for_mechanisms(MeshConvergence, MechanismConvergence)
def converge(
    stage: Stage | Mechanism, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> MeshConvergence | MechanismConvergence:
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
    usual = MECHANISM_RESOLUTIONS if isinstance(stage, Mechanism) else RESOLUTIONS
    steps = refinements(usual if resolutions is None else resolutions)

    def solve(level: int) -> Response:
        return plates.solved(stage, level) if isinstance(stage, Mechanism) else solved(stage, level)

    meshes = on_meshes(steps, solve, progress)
    C = np.array([mesh.compliance for mesh in meshes])
    along = np.diagonal(C, axis1=1, axis2=2)[:, :3]
    curves = [grid_convergence(np.array(steps), values, round_off=0.0) for values in along.T]
    limits, orders, widths = np.transpose([(curve.extrapolated, curve.observed, curve.band) for curve in curves])
    values = {"along": along, "extrapolated": limits, "order": orders, "unknowns": [mesh.unknowns for mesh in meshes]}
    bands = {"along": np.full(along.shape, np.nan), "extrapolated": widths}
    bands["along"][-1] = widths
    labels = {"mesh": [f"{level} across a neck" for level in steps]}
    notes = [f"meshes in {axis}: {curve.verdict}" for axis, curve in zip(DIRECTIONS, curves, strict=True)]
    if isinstance(stage, Mechanism):
        return answer(MechanismConvergence, stage, {}, None, {}, values, labels, bands, notes=notes)
    values |= {"compliance": C, "triangles": [solved(stage, level).triangles for level in steps]}
    large = [
        f"the mesh band of the compliance in {axis} is ±{100 * curve.band / abs(curve.extrapolated):.2g} % "
        f"({curve.verdict}); finer meshes reduce it"
        for axis, curve in zip(DIRECTIONS, curves, strict=True)
        if curve.band > LARGE * abs(curve.extrapolated)
    ]
    texts = {"warnings": [*warning.of_numbers(stage), *large], "notes": notes}
    return answer(MeshConvergence, stage, {}, None, {}, values, labels, bands, **texts)
