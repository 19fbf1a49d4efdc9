"""The two models of a stage that `import flexfem` offers, with what they answer. See `flexfem.api`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from flexfem.analytic.model import AnalyticResult, ModelChoice
from flexfem.analytic.paper import apply
from flexfem.arguments import forces, poses
from flexfem.arrays import Array
from flexfem.fem.fields import load_case
from flexfem.fem.mesh import StageMesh
from flexfem.hinges.strength import range_at_yield
from flexfem.mechanism.designs import lower
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import compliance_bands, levels
from flexfem.questions.stiffness import element_stress
from flexfem.verify.protocol import Solved, solve_stage
from flexfem.verify.result import Fields

if TYPE_CHECKING:
    from matplotlib.axes import Axes


solved: Callable[[Stage, int], Solved] = once(solve_stage)


@dataclass(frozen=True, eq=False)
class PlatformModel:
    """What both models answer; poses (..., 3) in mm, mm, rad, forces (..., 3) in N, N, N mm, order x, y, theta.

    stiffness, compliance : (3, 3), of the platform at rest: N, mm, rad.
    """

    stage: Stage
    stiffness: Array
    compliance: Array

    def force(self, pose: ArrayLike) -> Array:
        """Load (..., 3) that holds the platform at poses (..., 3), by (18). Raises BadInput for another shape."""
        return apply(self.stiffness, poses("pose", pose))

    def pose(self, force: ArrayLike) -> Array:
        """Pose (..., 3) of the platform under loads (..., 3). Raises BadInput for another shape."""
        return apply(self.compliance, forces("force", force))


@dataclass(frozen=True, eq=False)
class AnalyticModel(PlatformModel):
    """The pseudo-rigid model of a stage at rest, as `analyse` gives it.

    mobility : by (1).   formula : of the hinges.   links : whether pads, links and platform are elastic.
    chosen : what the result is of; its stage has the plane model that was taken.
    """

    mobility: int
    formula: str
    links: bool
    chosen: ModelChoice
    result: AnalyticResult

    def neck_stress(self, pose: ArrayLike) -> Array:
        """Largest von Mises stress at each neck (..., 3 chains, 3 hinges), MPa, with the platform at poses (..., 3).

        Notes
        -----
        `|6 M K_b / (b t^2)| + |N K_t / (b t)|`, see `strength.concentration`, which states how far it is from finite
        elements.
        """
        return self.result.neck_stress(self.chosen.stage, poses("pose", pose))

    @property
    def range_at_yield(self) -> Array:
        """Displacement (3,) in each direction, the others held, at which the first neck yields: mm, mm, rad."""
        return range_at_yield(self.result.stress, lower(self.stage).yield_strength[0])

    @property
    def warnings(self) -> list[str]:
        """Where the answers leave what they are meant for, one plain sentence each."""
        found = [*warning.of_numbers(self.stage), *warning.of_formula(self.stage, self.formula)]
        return found if self.links else [*found, *warning.of_model(self.stage, self.result)]


@dataclass(frozen=True, eq=False)
class ElementModel(PlatformModel):
    """Plane finite elements of a stage, as `solve` gives them.

    resolution : quadratic triangles across every neck.
    """

    resolution: int
    solved: Solved

    @property
    def mesh(self) -> StageMesh:
        """Nodes (n, 2), mm, curved quadratic triangles (m, 6), their bodies (m,) and named edges."""
        return self.solved.mesh

    def displacement(self, force: ArrayLike) -> Array:
        """Displacement (..., n, 2), mm, of every node under loads (..., 3)."""
        return np.tensordot(forces("force", force), self.solved.response.fields, axes=1)

    def stress(self, force: ArrayLike) -> Array:
        """Von Mises stress (..., n), MPa, at every node under loads (..., 3)."""
        return self._per_load(forces("force", force), lambda case: case.stress)

    def neck_stress(self, pose: ArrayLike) -> Array:
        """Largest von Mises stress at each neck (..., 3 chains, 3 hinges), MPa, with the platform at poses (..., 3)."""
        return self._per_load(self.force(pose), lambda case: case.neck_stress)

    @cached_property
    def range_at_yield(self) -> Array:
        """Displacement (3,) in each direction, the others held, at which the first neck yields: mm, mm, rad."""
        return range_at_yield(element_stress(self.stage, self.solved.response), lower(self.stage).yield_strength[0])

    @cached_property
    def band(self) -> Array:
        """Half-width (3, 3) of the mesh uncertainty of the compliance, N, mm, rad.

        By grid convergence over this mesh and two coarser ones, which are made when first asked for; what is zero by
        symmetry has the size of its round-off.
        """
        steps = levels(self.resolution)
        found = np.array([solved(self.stage, level).response.compliance for level in steps])
        return compliance_bands(np.array(steps), found)

    @property
    def warnings(self) -> list[str]:
        """Where the answers leave what they are meant for, one plain sentence each."""
        return [*warning.of_numbers(self.stage), *warning.of_thickness(self.stage)]

    def plot(self, force: ArrayLike, ax: Axes | None = None, factor: float | None = None) -> Axes:
        """Draw the displaced stage with its von Mises stress under one load (3,).

        Parameters
        ----------
        ax : matplotlib axes, new ones by default.   factor : exaggeration, a round one by default.

        Returns
        -------
        The axes.
        """
        from flexfem.plot.fields import plot_displacement

        mesh, load = self.mesh, forces("force", force, 1)
        fields = Fields(
            nodes=mesh.nodes,
            triangles=mesh.triangles,
            bodies=mesh.bodies,
            displacement=self.displacement(load),
            stress=self.stress(load),
        )
        return plot_displacement(ax, fields, factor=factor, hub_radius=self.stage.platform.hub_radius)

    def _per_load(self, loads: Array, read: Callable[[Any], Array]) -> Array:
        mesh, answer = self.solved.mesh, self.solved.response
        cases = [read(load_case(self.stage, mesh, answer, load)) for load in loads.reshape(-1, 3)]
        return np.reshape(cases, (*loads.shape[:-1], *np.shape(cases)[1:]))
