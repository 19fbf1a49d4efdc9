"""The two models of a stage and their difference, as `import flexfem` offers them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.arguments import forces, poses
from flexfem.arrays import Array, inverse
from flexfem.fem.mesh import RESOLUTION, PlaneMesh
from flexfem.fem.response import Response
from flexfem.mechanism.feasibility import check_feasible
from flexfem.paper import warnings as warning
from flexfem.paper.equations import apply
from flexfem.paper.feasibility import check_closed_form
from flexfem.paper.fields import neck_stresses, plane_stress
from flexfem.paper.model import DEFAULT_FORMULA, AnalyticResult, ModelChoice, choose
from flexfem.paper.model import analyse as analyse_stage
from flexfem.paper.solutions import solved
from flexfem.paper.stage import Stage
from flexfem.questions.bands import compliance_bands, error_bands, levels
from flexfem.results import Fields, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(
    frozen=True,
    eq=False,
    repr=False,
)
class PlatformModel:
    """Common interface of both models.

    Poses (..., 3) are in mm, mm, rad, forces (..., 3) in N, N, N mm, in the order x, y, theta.

    stiffness, compliance : (3, 3), of the platform at rest: N, mm, rad.
    """

    stage: Stage
    stiffness: Array
    compliance: Array

    def __repr__(self) -> str:
        x, y, theta = map(number, 1.0 / self.compliance.diagonal())
        free = f"stiffness, other directions free: x {x} N/mm, y {y} N/mm, theta {theta} N mm/rad"
        return f"<{type(self).__name__} of {self.stage.name!r}: {free}>"

    def force(self, pose: ArrayLike) -> Array:
        """Return the load (..., 3) that holds the platform at poses (..., 3), by (18).

        Raises BadInput for another shape.
        """
        return apply(self.stiffness, poses("pose", pose))

    def pose(self, force: ArrayLike) -> Array:
        """Return the pose (..., 3) of the platform under loads (..., 3).

        Raises BadInput for another shape.
        """
        return apply(self.compliance, forces("force", force))

    def neck_stress(self, pose: ArrayLike) -> Array:
        """Return the largest von Mises stress at each neck (..., 3 chains, 3 hinges), MPa.

        poses : (..., 3).
        """
        raise NotImplementedError

    @cached_property
    def range_at_yield(self) -> Array:
        """Displacement (3,), mm, mm, rad, with the others held, at which the first neck yields."""
        highest: Array = np.max(self.neck_stress(np.eye(3)), axis=(1, 2))
        return self.stage.material.yield_strength / highest


@dataclass(
    frozen=True,
    eq=False,
    repr=False,
)
class AnalyticModel(PlatformModel):
    """The pseudo-rigid model of a stage at rest, as `analyse` returns it.

    mobility : by (1).   formula : of the hinges.
    links : whether pads, links and platform are elastic.
    chosen : settings of the model; its stage has the plane model that was used.
    """

    mobility: int
    formula: str
    links: bool
    chosen: ModelChoice
    result: AnalyticResult

    def neck_stress(self, pose: ArrayLike) -> Array:
        """See `PlatformModel`.

        It is `|6 M K_b / (b t^2)| + |N K_t / (b t)|`, see `profiles.concentration`.
        """
        return self.result.neck_stress(self.chosen.stage, poses("pose", pose))

    @property
    def warnings(self) -> list[str]:
        """Limits of validity that the stage exceeds, one sentence each."""
        found = [*warning.of_numbers(self.stage), *warning.of_formula(self.stage, self.formula)]
        if not self.links:
            found += warning.of_model(self.stage, self.result)
        return found


@dataclass(
    frozen=True,
    eq=False,
    repr=False,
)
class ElementModel(PlatformModel):
    """Plane finite elements of a stage, as `solve` returns them.

    resolution : quadratic triangles across every neck.
    """

    resolution: int
    solved: Response

    @property
    def mesh(self) -> PlaneMesh:
        """Nodes (n, 2), mm, quadratic triangles (m, 6), their bodies (m,) and named edges."""
        return self.solved.mesh

    def displacement(self, force: ArrayLike) -> Array:
        """Return the displacement (..., n, 2), mm, of every node under loads (..., 3)."""
        return np.tensordot(forces("force", force), self.solved.fields, axes=1)

    def stress(self, force: ArrayLike) -> Array:
        """Return the von Mises stress (..., n), MPa, at every node under loads (..., 3)."""
        return plane_stress(self.stage, self.mesh, self.displacement(force))

    def neck_stress(self, pose: ArrayLike) -> Array:
        """See `PlatformModel`."""
        loads = self.force(pose)
        stresses = neck_stresses(self.stage, self.solved, loads.reshape(-1, 3))
        return stresses.highest.reshape(*loads.shape[:-1], 3, 3)

    def fields(self, force: ArrayLike) -> Fields:
        """Return mesh, displacement and von Mises stress under one load (3,), for figures."""
        mesh = self.mesh
        load = forces("force", force, 1)
        displacement = self.displacement(load)
        return Fields(mesh.nodes, mesh.triangles, mesh.bodies, displacement, self.stress(load))

    @cached_property
    def band(self) -> Array:
        """Half-width (3, 3) of the mesh uncertainty of the compliance by two coarser meshes."""
        steps = levels(self.resolution)
        compliances = [solved(self.stage, level).compliance for level in steps]
        return compliance_bands(np.array(steps), np.array(compliances))

    @property
    def warnings(self) -> list[str]:
        """Limits of validity that the stage exceeds, one sentence each."""
        return [*warning.of_numbers(self.stage), *warning.of_thickness(self.stage)]

    def plot(
        self,
        force: ArrayLike,
        ax: Axes | None = None,
        factor: float | None = None,
    ) -> Axes:
        """Draw the displaced stage with its von Mises stress under one load (3,); returns the axes.

        ax : matplotlib axes, new ones by default.   factor : exaggeration, a round one by default.
        """
        from flexfem.plot.fields import plot_displacement

        return plot_displacement(ax, self.fields(force), factor=factor)


class Errors(NamedTuple):
    """Error percentages of an analytic model.

    They are the displacement by finite elements minus the commanded one, under the force of (18).

    percent : (3, 3), per cent; column j for a command in direction j, order x, y, theta. Rotations
    count with the lever l3, as CONVENTIONS says.   band : (3, 3), percentage points, half-width of
    the numerical uncertainty.
    """

    percent: Array
    band: Array

    def __repr__(self) -> str:
        values = ", ".join(map(number, self.percent.diagonal(), self.band.diagonal()))
        return f"<Errors in x, y, theta: {values} per cent>"


def analyse(
    stage: Stage, mobility: int | None = None, formula: str | None = None, links: bool = False
) -> AnalyticModel:
    """The analytic model of a stage at rest.

    Without mobility, formula and links it has calibrated hinges, corrected for their thickness
    unless the stage file states a `model`, and elastic links. With any of them it is the paper's
    model with that change.

    Parameters
    ----------
    mobility : 3, 6, 12 or 21; None takes the prismatic hinges of the stage itself.
    formula : a name of `formulas()` in `flexfem.hinges.formulas`; None takes `paros-weisbord`.
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
    check_closed_form(stage)
    check_feasible(stage)
    chosen = choose(stage, mobility, formula, links, [])
    found = analyse_stage(*chosen)
    return AnalyticModel(
        stage,
        found.stiffness,
        found.compliance,
        found.mobility,
        found.formula,
        found.links,
        chosen,
        found,
    )


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
    check_closed_form(stage)
    found = solved(stage, arguments.resolution(resolution))
    stiffness = inverse(found.compliance)
    return ElementModel(stage, (stiffness + stiffness.T) / 2, found.compliance, resolution, found)


def errors(
    stage: Stage,
    mobility: int | None = None,
    formula: str = DEFAULT_FORMULA,
    links: bool = False,
    resolution: int = RESOLUTION,
) -> Errors:
    """Error percentages of an analytic model against finite elements, with their bands.

    Both are under the load `K du`, (18).

    Parameters
    ----------
    mobility, formula, links : of the model, see `analyse`.
    resolution : of the finest of three meshes, from 4.

    Raises
    ------
    BadInput, ComputationFailed
        As `analyse` and `solve`.
    """
    check_closed_form(stage)
    steps = levels(arguments.resolution(resolution, 4))
    model = analyse_stage(stage, mobility, formula, links)
    found = np.array([solved(stage, level).compliance for level in steps])
    return Errors(*error_bands(model.stiffness, found, steps, stage.chain.link_lengths[2]))
