"""Convergence of the platform compliance on meshes of increasing resolution."""

from __future__ import annotations

from functools import partial

import numpy as np

from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.stage import Stage
from flexfem.questions import plates
from flexfem.questions import warnings as warning
from flexfem.questions.bands import grid_convergence, refinements
from flexfem.questions.setup import answer, on_meshes, question
from flexfem.results import COARSER, Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

RESOLUTIONS = (3, 4, 6, 8, 11, 15)
MECHANISM_RESOLUTIONS = (3, 4, 6, 8)
LARGE = 1e-3  # of a compliance: the target accuracy of the default mesh


class MeshConvergence(Result):
    """Compliance of the platform or output on meshes of increasing resolution, and its extrapolated
    limit.
    """

    title = "mesh convergence"
    main = ("extrapolated", {})
    figure = "errors.convergence_figure"
    along = Quantity(
        "compliance along each direction", "compliance", ("mesh", "direction"), COARSER
    )
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), COARSER)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.1), uneven=Gate(0.5))
    triangles = Quantity("triangles", "", ("mesh",), Gate(0.05), only="stage")
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05))
    compliance = Quantity(
        "compliance",
        "compliance matrix",
        ("mesh", "component", "direction"),
        COARSER,
        "matrix",
        shown=False,
        only="stage",
    )

    @property
    def resolutions(self) -> list[int]:
        """Triangles across every neck of each mesh, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """Verdict on the three finest meshes in each direction."""
        return [note.partition(": ")[2] for note in self.notes]


class MechanismConvergence(MeshConvergence, mechanism=True):
    """The same of the output of a mechanism."""


@question
def converge(
    stage: Mechanism,
    *,
    resolutions: list[int] | None = None,
    progress: Progress | None = None,
) -> MeshConvergence:
    """Solve a stage or mechanism on finer and finer meshes: observed order, extrapolated compliance
    and mesh band.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    resolutions : list of int, optional
        Triangles across every neck: three or more, each at least 1.3 times the previous one; by
        default 3 to 15.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MeshConvergence
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mesh_convergence` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Notes
    -----
    I. B. Celik et al., J. Fluids Eng. 130 (2008) 078001; the band is Roache's index, with his
    safety factors.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.converge(flexfem.load("geometry/mobility6.toml"), resolutions=[2, 3, 4])
    >>> found.verdicts
    ['converging', 'converging', 'converging']
    """
    usual = MECHANISM_RESOLUTIONS if isinstance(stage, MechanismFile) else RESOLUTIONS
    steps = refinements(usual if resolutions is None else resolutions)
    meshes = on_meshes(steps, partial(plates.solved, stage), progress)
    C = np.array([mesh.compliance for mesh in meshes])
    along = np.diagonal(C, axis1=1, axis2=2)[:, :3]
    curves = [grid_convergence(np.array(steps), values, round_off=0.0) for values in along.T]
    limits, orders, widths = np.transpose(
        [(curve.extrapolated, curve.observed, curve.band) for curve in curves]
    )
    values = {
        "along": along,
        "extrapolated": limits,
        "order": orders,
        "unknowns": [mesh.unknowns for mesh in meshes],
    }
    bands = {"along": np.full(along.shape, np.nan), "extrapolated": widths}
    bands["along"][-1] = widths
    labels = {"mesh": [f"{level} across a neck" for level in steps]}
    notes = [
        f"meshes in {axis}: {curve.verdict}" for axis, curve in zip(DIRECTIONS, curves, strict=True)
    ]
    warnings = [
        f"the mesh band of the compliance in {axis} is "
        f"±{100 * curve.band / abs(curve.extrapolated):.2g} % ({curve.verdict}); finer meshes "
        "reduce it"
        for axis, curve in zip(DIRECTIONS, curves, strict=True)
        if curve.band > LARGE * abs(curve.extrapolated)
    ]
    if isinstance(stage, Stage):
        values |= {"compliance": C, "triangles": [mesh.triangles for mesh in meshes]}
        warnings = [*warning.of_numbers(stage), *warnings]
    return answer(
        MeshConvergence, stage, {}, None, {}, values, labels, bands, warnings=warnings, notes=notes
    )
