"""Error budget: the error of the analytic network with rigid bodies, split into shares that add up
to it.

A sequence of models leads from the network to finite elements, each with one refinement more. A
share is the change of the error from one model to the next, so the sum of the shares is the total
error."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.plates import respond, widened
from flexfem.arrays import Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import errors, plates
from flexfem.questions.bands import (
    amplification_errors,
    corner_bands,
    free_errors,
    held,
    levels,
)
from flexfem.questions.errors import Compared
from flexfem.questions.plates import ElasticParts
from flexfem.questions.setup import Mesh, answer, options, require_hinges
from flexfem.results import ELEMENTS, Progress, Quantity, Result

AMPLITUDES = (0.05, 0.05, 1e-3)  # mm, mm, rad: assumed, as in cases/
PLANE_SHARES = ("rigid bodies", "hinge formulas", "joining of parts", "total in the plane")
SHARES = (
    "rigid bodies",
    "hinge formulas",
    "thickness",
    "joining of parts",
    "total in three dimensions",
)


class Budget(Result):
    """Shares of the errors of the network with rigid bodies, which add up to the total."""

    kind_name = "mechanism_budget"
    title = "error budget"
    figure = "errors.budget_figure"
    main_result = ("share", {})
    labels: ClassVar = {"share": SHARES}
    footnotes: ClassVar[tuple[str, ...]] = (
        "shares are % of the commanded motion, by the single force or moment by which the "
        "network with rigid bodies moves the output as commanded, with the other directions free",
        errors.ALONG_READ,
        "rigid bodies: change by elastic bodies, from plane finite elements of each body",
        "hinge formulas: change from beam integrals to plane finite elements of each hinge",
        "thickness: change from its effect by plates as high as each hinge to that by "
        "three-dimensional finite elements of each hinge",
        "joining of parts: change from parts with rigid end sections to finite elements of the "
        "whole mechanism",
    )
    share = Quantity(
        "share of the error in the commanded direction",
        "percents",
        ("share", "direction"),
        errors.POINTS,
    )
    driven = Quantity(
        "share of the error of the amplification",
        "percent",
        ("share", "actuator"),
        errors.POINTS,
        note=errors.AMPLIFICATION_READ,
    )


@options(not_for="amplitude")
def budget(
    mechanism: Mechanism,
    *,
    amplitude: tuple[float, float, float] = AMPLITUDES,
    resolution: int = RESOLUTION,
    plane: bool = False,
    progress: Progress | None = None,
) -> Budget:
    """Split the error of the analytic model of a mechanism into named shares that add up
    to it.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : tuple of float
        Commands in x, y and theta for the share of large displacement: mm, mm, rad. Of a stage file
        only.
    plane : bool
        Neglect the effect of three dimensions.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Budget
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mechanism_budget` lists it. Of a stage file a result of kind `budget`.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.
    """
    arguments.resolution(resolution, 4)
    require_hinges(
        mechanism, "which the analytic model needs whose error is split", plates.BY_ELEMENTS
    )
    mesh = plates.mesh_of(mechanism, "both", resolution, None)
    assert mesh is not None
    layout = mechanism.layout
    finest = errors.compared(mechanism, mesh, progress)
    refined = _Refined(
        _refinements(mechanism, mesh, finest),
        finest,
        np.array([plates.solved(mechanism, n).compliance for n in levels(mesh.resolution)]),
        np.array(levels(mesh.resolution), dtype=float),
    )
    along = partial(_along, refined, layout.lever)
    values = {"share": refined.shares(along)}
    bands = {"share": refined.bands(along, refined.band_along(layout.lever))}
    if layout.actuators:
        driven = partial(_driven, layout, finest)
        values["driven"] = refined.shares(driven)
        of_driven = finest.driven_band(refined.networks[0], layout)
        bands["driven"] = refined.bands(driven, of_driven)
    labels = {"share": PLANE_SHARES if finest.label == ELEMENTS else SHARES}
    notes = errors.held_notes(finest.compliance[:3, :3], layout.lever)
    return answer(Budget, mechanism, {}, mesh, {}, values, labels, bands, notes=notes)


Errors = Callable[[Array], Array]  # of the rigid network, from compliances (..., k, k) of another


class _Refined(NamedTuple):
    """Compliances of the ports by models with one refinement more each.

    networks : (k, k) each, from rigid bodies to all parts elastic.   finest : finite elements.
    planes : (3, k, k), plane finite elements on meshes of these resolutions (3,).
    """

    networks: list[Array]
    finest: Compared
    planes: Array
    resolutions: Array

    def shares(self, error_of: Errors) -> Array:
        """Return the change of the errors by each refinement, then their sum."""
        sequence = [error_of(one) for one in (*self.networks, self.finest.compliance)]
        return np.array([*np.diff(sequence, axis=0), sequence[-1] - sequence[0]])

    def bands(
        self,
        error_of: Errors,
        of_total: Array,
    ) -> Array:
        """Return the bands of the shares, of which only those of the last and of the sum are known.

        of_total : in three dimensions; in the plane the meshes give both.
        """
        of_planes = corner_bands(self.resolutions, error_of(self.planes))
        unknown = np.full((len(self.networks) - 1, len(of_planes)), np.nan)
        total = of_planes if self.finest.label == ELEMENTS else of_total
        return np.array([*unknown, of_planes, total])

    def band_along(self, lever: float) -> Array:
        """Return the band (3,) of the error of the network with rigid bodies along each command."""
        return np.diagonal(self.finest.percent_band(self.networks[0][:3, :3], lever))


def _refinements(
    mechanism: Mechanism,
    mesh: Mesh,
    finest: Compared,
) -> list[Array]:
    """Return the compliances of the networks that lead from rigid bodies to all elastic parts."""
    layout = mechanism.layout
    parts = plates.parts_of(mechanism, mesh.resolution)
    networks = [ElasticParts(), ElasticParts(parts.bodies)]
    if finest.label == ELEMENTS:
        networks.append(parts)
    else:
        assert parts.hinges is not None
        networks.append(parts._replace(hinges=widened(layout, parts.hinges)))
        networks.append(plates.joined_parts(mechanism, True))
    return [respond(layout, one.bodies, hinges=one.hinges).compliance for one in networks]


def _along(
    refined: _Refined,
    lever: float,
    compliance: Array,
) -> Array:
    """Return the errors (..., 3) of the rigid network along each command.

    compliance : (..., k, k), of the model with which it is compared.
    """
    percent = free_errors(refined.networks[0][:3, :3], compliance[..., :3, :3], lever)
    unused = held(refined.finest.compliance[:3, :3], lever)
    return np.where(unused, np.nan, np.diagonal(percent, axis1=-2, axis2=-1))


def _driven(
    layout: Layout,
    finest: Compared,
    compliance: Array,
) -> Array:
    """Return the errors (..., a) of the amplification of the rigid network, up to a constant."""
    of_driven = plates.amplification(layout, finest.compliance)
    motions = plates.amplification(layout, compliance)
    return -amplification_errors(motions, of_driven, layout.lever)
