"""Cycles to failure of the necks."""

from __future__ import annotations

from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.hinges.strength import Basquin, BasquinFit, checked_law, required_law
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.reports.given import LARGEST_LIFE, LARGEST_POSE, RESOLUTION, Progress, finest_of, solver
from flexfem.verify import life as verify_life
from flexfem.verify.life import Life
from flexfem.verify.strained import Repeated, scaled


def checked_amplitude(amplitude: ArrayLike) -> Array:
    """An amplitude (3,) of the platform, mm, mm, rad. Raises BadInput for anything else, and for none at all."""
    moved = arguments.vectors("amplitude", amplitude, 1, LARGEST_POSE)
    if not moved.any():
        raise BadInput("amplitude: expected a motion, not zero in all directions")
    return moved


def life(
    stage: Stage,
    amplitude: ArrayLike,
    mean: ArrayLike | None = None,
    ratio: float = -1.0,
    cycles: float = 1e6,
    law: Basquin | BasquinFit | None = None,
    resolution: int | None = RESOLUTION,
    progress: Progress | None = None,
    notch_sensitivity: float = 1.0,
) -> Life:
    """Cycles to failure of the necks at an amplitude of the platform, and the amplitude for a wanted life.

    Parameters
    ----------
    amplitude : (3,), of the pose about its mean, mm, mm, rad; the platform is held in all directions.
    mean : (3,), of the pose; by default that of `ratio`, with which it grows for the wanted life.
    ratio : least displacement over the greatest, from -1 to 0.99; -1 is fully reversed.
    cycles : the wanted life.
    law : of Basquin, or a fit of it; None takes the material's own.
    resolution : of the finest of three meshes; None leaves finite elements out.   progress : called after each mesh.
    notch_sensitivity : q from 0 to 1: `(1 + q (K - 1)) / K` of the stress at a notch of concentration K counts for
        fatigue, all of it for yield.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the material has no fatigue constants, or the law has them in another unit.

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml").replace(material="al-2024-t4")
    >>> found = flexfem.life(stage, [0.1, 0, 0], resolution=None)
    >>> neck = found.analytic.necks[found.analytic.first]
    >>> round(neck.equivalent, 1), neck.hinge, f"{neck.cycles:.3g}"
    (79.9, 'elbow', '1.03e+10')
    """
    check_feasible(stage)
    moved = checked_amplitude(amplitude)
    about = None if mean is None else arguments.vectors("mean", mean, 1, LARGEST_POSE)
    if not isinstance(ratio, int | float) or not -1 <= ratio <= 0.99:
        raise BadInput(f"ratio {ratio!r}, expected a number from -1 to 0.99: least over greatest displacement")
    if about is not None and ratio != -1:
        raise BadInput("mean and ratio, expected one of the two")
    wanted = arguments.positive("cycles", cycles, LARGEST_LIFE)
    sensitivity = arguments.between("notch_sensitivity", notch_sensitivity, 0, 1)
    finest = finest_of(resolution, 4)
    taken = required_law(stage.material, ", or a fit of S-N points") if law is None else checked_law(law)
    if unlikely(taken.coefficient, stage.material.yield_strength):
        expected = UNLIKELY.format(*STRENGTHS, f"the yield strength of {stage.material.yield_strength:g} MPa")
        raise BadInput(f"law: coefficient {taken.coefficient:.4g} MPa, expected {expected}")
    source = verify_life.source_in(stage) if law is None else "given in Python or fitted to S-N points"
    of = Repeated(scaled(moved, about, float(ratio)), wanted, sensitivity)
    asked = verify_life.Asked(of, taken, source)
    return verify_life.life(stage, asked, finest, solver(progress))
