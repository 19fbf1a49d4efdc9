"""What `import flexfem` offers: a stage, the two models of it, and how far they differ. See `flexfem.__init__`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.model import DEFAULT_FORMULA, choose, model_of
from flexfem.analytic.model import analyse as analyse_stage
from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import RESOLUTION
from flexfem.files.toml import Path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.models import AnalyticModel, ElementModel, solved
from flexfem.questions.bands import error_bands, levels


class Errors(NamedTuple):
    """Error percentages of the protocol: finite-element displacement minus commanded, under the force of (18).

    percent : (3, 3), per cent; column j for a command in direction j, order x, y, theta. Rotations count with the lever
        l3, as CONVENTIONS says.
    band : (3, 3), percentage points, half-width of the numerical uncertainty by grid convergence.
    """

    percent: Array
    band: Array


def load(path: Path) -> Stage:
    """Read a stage file.

    Returns
    -------
    Stage, validated and feasible.

    Raises
    ------
    BadInput
        One line with file, line, key, value and what was expected.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.load("geometry/mobility6.toml").chain.link_lengths
    (30.0, 32.0, 24.0)
    """
    return load_feasible(path)


def analyse(
    stage: Stage, mobility: int | None = None, formula: str | None = None, links: bool = False
) -> AnalyticModel:
    """The analytic model of a stage at rest.

    Without mobility, formula and links it has calibrated hinges, corrected for their thickness unless the stage file
    states a `model`, and elastic links. With any of them it is the paper's model with that change.

    Parameters
    ----------
    mobility : 3, 6, 12 or 21; None takes the prismatic hinges of the stage itself.
    formula : a name of `flexfem.formulas()`; None takes `paros-weisbord`.
    links : pads, links and platform elastic, with all freedoms of the hinges (mobility 21 or None).

    Raises
    ------
    BadInput
        The stage cannot be made, or mobility and formula do not suit it.
    ComputationFailed
        The stage is at a singular configuration.

    Notes
    -----
    The stiffness is (18) of Yi et al., IEEE Trans. Robot. Autom. 19(4), 604-612 (2003).

    Examples
    --------
    >>> import flexfem
    >>> model = flexfem.analyse(flexfem.load("geometry/mobility6.toml"), mobility=6)
    >>> abs(model.force([0.05, 0, 0])).round(2)  # N, N, N mm that hold 50 um in x
    array([2.14, 0.  , 0.  ])
    """
    check_feasible(stage)
    chosen = choose(stage, model_of(mobility, formula, links), [])
    found = analyse_stage(*chosen)
    of = (found.mobility, found.formula, found.links)
    return AnalyticModel(stage, found.stiffness, found.compliance, *of, chosen, found)


def solve(stage: Stage, resolution: int = RESOLUTION) -> ElementModel:
    """Plane finite elements of a stage at rest: meshed, solved for the three unit loads, checked.

    Parameters
    ----------
    resolution : quadratic triangles across every neck, from 2.

    Raises
    ------
    BadInput
        The stage cannot be made, or its model is not plane.
    ComputationFailed
        The mesh or the solution does not pass its checks.
    """
    check_feasible(stage)
    resolution = arguments.resolution(resolution)
    found = solved(stage, resolution)
    compliance = found.response.compliance
    stiffness = inverse(compliance)
    return ElementModel(stage, (stiffness + stiffness.T) / 2, compliance, resolution, found)


def errors(
    stage: Stage,
    mobility: int | None = None,
    formula: str = DEFAULT_FORMULA,
    links: bool = False,
    resolution: int = RESOLUTION,
) -> Errors:
    """Error percentages of an analytic model against finite elements, with their numerical bands.

    Parameters
    ----------
    mobility, formula, links : of the model, see `analyse`.   resolution : of the finest of three meshes, from 4.

    Raises
    ------
    BadInput, ComputationFailed
        As `analyse` and `solve`.

    Notes
    -----
    The load on both is `K du`, (18); bands as of `converge`, of the whole compliance matrix.
    """
    check_feasible(stage)
    resolution = arguments.resolution(resolution, 4)
    model = analyse_stage(stage, mobility, formula, links)
    meshes = [solve(stage, level) for level in levels(resolution)]
    found = np.array([mesh.compliance for mesh in meshes])
    return Errors(*error_bands(model.stiffness, found, levels(resolution), stage.chain.link_lengths[2]))
