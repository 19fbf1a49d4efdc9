"""What temperature does to a stage."""

from __future__ import annotations

from flexfem.analytic.model import model_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.reports.given import RESOLUTION, Progress, finest_of, meshed_solid
from flexfem.verify import drift as verify_drift
from flexfem.verify import solid_drift as verify_solid_drift
from flexfem.verify.drift import Drift, DriftFields
from flexfem.verify.solid_drift import SolidDrift, SolidDriftFields


def drift(
    stage: Stage,
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Drift:
    """What one kelvin, and gradients of 1 K/mm along X and Y about the platform's centre, do to a stage on its frame.

    Parameters
    ----------
    mobility, formula, links : of the analytic model, as of `command`.
    resolution : of the finest of three meshes of finite elements, from 4; None leaves them out.

    Raises
    ------
    BadInput
        The stage says no `material.expansion_um_per_m_k`, cannot be made, or mobility and formula do not suit it.
    ComputationFailed
        As `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drift(flexfem.load("geometry/mobility6.toml"), resolution=None).cases
    >>> round(1e6 * found["uniform"].analytic.pose[2], 2)  # urad/K; none in x and y, by symmetry
    5.5
    >>> [round(1e3 * value, 2) for value in found["gradient in x"].analytic.pose[:2]]  # um per K/mm
    [-22.6, 2.97]
    """
    return drift_fields(stage, mobility, formula, links, resolution).record


def drift_fields(
    stage: Stage,
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> DriftFields:
    """As `drift`, with displacement and von Mises stress of all nodes by case, mm and MPa per kelvin or per K/mm."""
    check_feasible(stage)
    model = model_of(mobility, formula, links)
    finest = finest_of(resolution, 4)
    return verify_drift.drift(stage, model, finest)


def drift_solid(
    stage: Stage, resolution: int | None = None, layers: int | None = None, progress: Progress | None = None
) -> SolidDrift:
    """As `drift`, in three dimensions and also per K/mm through the thickness: z and tilts. Finite elements alone.

    Parameters
    ----------
    resolution : triangles across every neck, finest mesh, from 6.   layers : in half the thickness, from 3.
    progress : called with a line when cases in the plane are done, and when the one out of it is.

    Raises
    ------
    BadInput, ComputationFailed
        As `drift` and `under_load_solid`.
    """
    return drift_fields_solid(stage, resolution, layers, progress).record


def drift_fields_solid(
    stage: Stage, resolution: int | None = None, layers: int | None = None, progress: Progress | None = None
) -> SolidDriftFields:
    """As `drift_solid`, with displacement and von Mises stress of all nodes by case."""
    check_feasible(stage)
    finest, through = meshed_solid(resolution, layers, verify_solid_drift.LEAST_RESOLUTION)
    return verify_solid_drift.solid_drift(stage, finest, through, progress)
