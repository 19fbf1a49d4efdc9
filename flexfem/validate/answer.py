"""What every other solver is asked for."""

from __future__ import annotations

from typing import NamedTuple

from flexfem.arrays import Array


class Answer(NamedTuple):
    """Another solver's answer to a unit force in x, in y and a unit moment on the platform, order x, y, theta.

    version : of the solver.
    compliance : (3, 3), mm and rad per N and N mm; column j is the pose under unit load j.
    fields : (3, n, 2), mm, displacement of every node, in the order of the mesh.
    stress : (3, n, 3), MPa, as xx, yy, xy at the nodes, averaged over the triangles around each, by the solver's own
        means.
    seconds : from the mesh to these arrays.
    """

    version: str
    compliance: Array
    fields: Array
    stress: Array
    seconds: float
