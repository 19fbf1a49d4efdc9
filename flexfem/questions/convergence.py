"""Convergence of the compliance of the output on meshes of increasing resolution."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.response import Response
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates
from flexfem.questions.bands import Convergence, grid_convergence, refinements
from flexfem.questions.plates import ON_MESHES
from flexfem.questions.setup import answer, on_meshes, question
from flexfem.results import Gate, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

RESOLUTIONS = (3, 4, 6, 8)
LARGE = 1e-3  # of a compliance: the target accuracy of the default mesh


class MeshConvergence(Result):
    """Compliance of the output on meshes of increasing resolution, and its extrapolated limit."""

    kind_name = "mechanism_convergence"
    title = "mesh convergence"
    main_result = ("extrapolated", {})
    figure = "errors.convergence_figure"
    along = Quantity(
        "compliance along each direction", "compliance", ("mesh", "direction"), ON_MESHES
    )
    extrapolated = Quantity("extrapolated compliance", "compliance", ("direction",), ON_MESHES)
    order = Quantity("observed order", ("", "", ""), ("direction",), Gate(0.5))
    unknowns = Quantity("unknowns", "", ("mesh",), Gate(0.05, 0.9))

    @property
    def resolutions(self) -> list[int]:
        """Triangles across every neck of each mesh, coarse to fine."""
        return [int(label.split()[0]) for label in self.axes["mesh"]]

    @property
    def verdicts(self) -> list[str]:
        """Verdict on the three finest meshes in each direction."""
        return [note.partition(": ")[2] for note in self.notes]


class Refined(NamedTuple):
    """What a refinement of meshes shows: values, bands and axes of a result, warnings and notes."""

    values: dict[str, Any]
    bands: dict[str, Array]
    axes: dict[str, list[str]]
    warnings: list[str]
    notes: list[str]


@question
def converge(
    mechanism: Mechanism,
    *,
    resolutions: list[int] | None = None,
    progress: Progress | None = None,
) -> MeshConvergence:
    """Solve on finer and finer meshes: observed order, extrapolated compliance and mesh band.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    resolutions : list of int, optional
        Triangles across every neck: three or more, each at least 1.3 times the previous one; by
        default 3 to 8, of a stage file 3 to 15.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MeshConvergence
        Of a stage file `StageConvergence`. Every number has the unit that its quantity declares:
        `unit` returns it, and `flexfem schema mechanism_convergence` or `flexfem schema
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
    steps = refinements(RESOLUTIONS if resolutions is None else resolutions)
    meshes = on_meshes(steps, partial(plates.solved, mechanism), progress)
    values, bands, axes, warnings, notes = refined(steps, meshes)
    return answer(
        MeshConvergence,
        mechanism,
        {},
        None,
        values=values,
        axes=axes,
        bands=bands,
        warnings=warnings,
        notes=notes,
    )


def refined(steps: Sequence[int], meshes: Sequence[Response]) -> Refined:
    """Return what solutions on meshes of resolutions `steps`, coarse to fine, show."""
    C = np.array([mesh.compliance for mesh in meshes])
    along = np.diagonal(C, axis1=1, axis2=2)[:, :3]
    curves = [grid_convergence(np.array(steps), values, round_off=0.0) for values in along.T]
    widths = np.array([curve.band for curve in curves])
    of_meshes = np.full(along.shape, np.nan)
    of_meshes[-1] = widths
    values = {
        "along": along,
        "extrapolated": [curve.extrapolated for curve in curves],
        "order": [curve.observed for curve in curves],
        "unknowns": [mesh.unknowns for mesh in meshes],
    }
    return Refined(
        values,
        {"along": of_meshes, "extrapolated": widths},
        {"mesh": [f"{level} across a neck" for level in steps]},
        _wide_bands(curves),
        [
            f"meshes in {axis}: {curve.verdict}"
            for axis, curve in zip(DIRECTIONS, curves, strict=True)
        ],
    )


def _wide_bands(curves: Sequence[Convergence]) -> list[str]:
    """Warn of directions in which the mesh band is wider than that of the default mesh."""
    warnings = list[str]()
    for axis, curve in zip(DIRECTIONS, curves, strict=True):
        relative = curve.band / abs(curve.extrapolated)
        if relative > LARGE:
            warnings.append(
                f"the mesh band of the compliance in {axis} is ±{100 * relative:.2g} % "
                f"({curve.verdict}); finer meshes reduce it"
            )
    return warnings
