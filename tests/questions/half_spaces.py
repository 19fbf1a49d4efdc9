"""All limits of the commands of a driven stage as explicit half-spaces, a slow reference of
`StageLimits`.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from flexfem.arrays import Array
from flexfem.paper.driven import StageLimits


def half_spaces(limits: StageLimits) -> tuple[Array, Array]:
    """Rows (k, m) and bounds (k,) of one stage, of strokes and forces, then of both signs at all
    sections of necks.
    """
    rows = [limits.rows[0]]
    ends = [limits.bounds[0]]
    x, bending, tension = limits.sections[:, 0, ..., None]
    M, N, V = np.concatenate([limits.forces[:, 0], limits.at_rest[:, 0, :, None]], axis=-1)[
        :, :, None
    ]
    for bent, pulled in product((1.0, -1.0), repeat=2):
        stress = (bent * bending * (M + V * x) + pulled * tension * N).reshape(-1, M.shape[-1])
        rows.append(stress[:, :-1])
        ends.append(limits.strength[0] - stress[:, -1])
    return np.concatenate(rows), np.concatenate(ends)
