"""A stage on finer and finer meshes: where its platform compliance goes, and how fast."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from flexfem import arguments
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings
from flexfem.questions.bands import COARSER, grid_convergence
from flexfem.questions.setup import about, on_meshes, question, solved
from flexfem.refused import BadInput
from flexfem.results import COARSER as ON_COARSER
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

RESOLUTIONS = (3, 4, 6, 8, 11, 15)
LARGE = 1e-3  # of a compliance: the accuracy that the default mesh is made for


class MeshConvergence(Result):
    """Platform compliance of a stage on meshes of growing resolution, and what it tends to."""

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
        """Triangles across every neck, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """How the three finest meshes behave, by direction."""
        return [note.partition(": ")[2] for note in self.notes]


@question
def converge(
    stage: Stage, *, resolutions: list[int] | None = None, progress: Progress | None = None
) -> MeshConvergence:
    """Solve a stage on finer and finer meshes: observed order, extrapolated compliance, band.

    Parameters
    ----------
    resolutions : list of int, optional
        Triangles across every neck, coarse to fine, three or more, each 1.3 times the one before; by default 3 to 15.
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
    steps = tuple(arguments.resolutions(RESOLUTIONS if resolutions is None else resolutions))
    if len(steps) < 3 or min(steps) < 2 or min(fine / coarse for coarse, fine in pairwise(steps)) < COARSER:
        raise BadInput(
            f"resolutions {', '.join(map(str, steps))}, expected three or more from 2 upwards, each at least "
            f"{COARSER:g} times the one before"
        )
    meshes = on_meshes(steps, lambda level: solved(stage, level), progress)
    C = np.array([each.compliance for each in meshes])
    own = np.diagonal(C, axis1=1, axis2=2)
    found = [grid_convergence(np.array(steps), values, round_off=0.0) for values in own.T]
    band = np.full(own.shape, np.nan)
    band[-1] = [each.band for each in found]
    large = [
        f"the mesh band of the compliance in {axis} is ±{100 * each.band / abs(each.extrapolated):.2g} % "
        f"({each.verdict}); finer meshes narrow it"
        for axis, each in zip(DIRECTIONS, found, strict=True)
        if each.band > LARGE * abs(each.extrapolated)
    ]
    return MeshConvergence(
        about(stage),
        {
            "along": own,
            "extrapolated": [each.extrapolated for each in found],
            "order": [each.observed for each in found],
            "triangles": [each.triangles for each in meshes],
            "unknowns": [each.unknowns for each in meshes],
            "compliance": C,
        },
        {"along": band, "extrapolated": band[-1]},
        {"mesh": [f"{level} across a neck" for level in steps]},
        warnings=[*warnings.of_numbers(stage), *large],
        notes=[f"meshes in {axis}: {each.verdict}" for axis, each in zip(DIRECTIONS, found, strict=True)],
    )
