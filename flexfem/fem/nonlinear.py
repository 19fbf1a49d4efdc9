"""Large displacements of the stage: total-Lagrangian plane stress, a hub that turns by finite angles, Newton."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.errors import ComputationFailed
from flexfem.fem.assembly import Pairing, pairing, summed, with_rigid_part
from flexfem.fem.finite_strain import (
    Factor,
    Hub,
    factoriser,
    first_piola,
    green_lagrange,
    hub_at,
    strain_rate,
    tangent_matrices,
)
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import QUADRATURE, Plate, Strip, add_nodal_forces, integration, slopes_of, stress_tensor
from flexfem.fem.response import Tied, tie_hub

ITERATIONS = 25  # for one load step
ALL_ITERATIONS = 1000  # for one load; a stage takes 4 to 6
SMALLEST = 1 / 1024  # of the way from one load to the next
LARGEST_TURN = 0.5  # change of a displacement gradient, about rad, in one iteration; beyond it the load is divided
CONVERGED = 1e-11  # root of energy that the next Newton step would have, over the stored energy: rounding


class Equilibria(NamedTuple):
    """Equilibria of the stage at k loads or poses, reached one after the other from rest.

    load : (k, 3), on the hub, N and N mm.   pose : (k, 3), displacement of the hub, mm and rad.
    fields : (k, n, 2), mm, displacement of every node.
    energy : (k,), N mm, stored in the material.
    compliance : (k, 3, 3), tangent: change of the pose per change of the load, mm and rad per N and N mm.
    stable : (k,), whether the tangent stiffness is positive definite: the equilibrium keeps itself under the dead load.
    strain : (k,), largest magnitude of a Green-Lagrange strain component; the material law assumes it small.
    residual : (k,), root of the energy of the remaining Newton step over the stored energy.
    iterations : (k,), Newton iterations, those of load steps that failed included.
    """

    load: Array
    pose: Array
    fields: Array
    energy: Array
    compliance: Array
    stable: NDArray[np.bool_]
    strain: Array
    residual: Array
    iterations: NDArray[np.int64]
