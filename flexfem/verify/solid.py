"""The stage in three dimensions, with the band of its mesh in the plane and of its layers.

The material is the metal's own and both faces are free, whatever plane problem a stage's `model` says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.linalg import eigh

from flexfem.arrays import Array
from flexfem.clock import Limit
from flexfem.fem.cyclic import cyclic_response
from flexfem.fem.layers import layers_of
from flexfem.fem.mesh import LAYERS, SOLID_RESOLUTION, TIME_LIMIT
from flexfem.fem.plane_stress import Plate
from flexfem.fem.sectors import mesh_sectors
from flexfem.fem.solid import sheet_of
from flexfem.fem.solid_fields import NeckStress, solid_neck_stresses
from flexfem.fem.solid_response import SolidResponse, solid_response
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.verify.energy import RelativeError
from flexfem.verify.errors import ROUND_OFF, SAFETY, compliance_bands, levels, mesh_band

MODEL = "three_dimensional"
Found = TypeVar("Found")


class SolidLevels(NamedTuple):
    """Compliances by which that of `solve_solid` is bounded: coarser meshes of the plane, fewer layers.

    planes : (3 levels, 3, 3), of three resolutions with one layer, coarse to fine.
    few, many : (3, 3), of two numbers of layers on the coarsest of these.
    """

    planes: Array
    few: Array
    many: Array

    @property
    def of_layers(self) -> RelativeError:
        """The change from `few` to `many`, times `SAFETY`."""
        lowest, *_, highest = SAFETY * eigh(self.many - self.few, self.many, eigvals_only=True)
        return RelativeError(abs(lowest + highest) / 2, (highest - lowest) / 2)


class SolidBands(NamedTuple):
    """Half-widths (3, 3) of the uncertainty of a compliance, of every entry in its own unit."""

    plane: Array
    thickness: Array

    @property
    def total(self) -> Array:
        """Their sum: neither is known to take from the other."""
        return self.plane + self.thickness


def solve_solid(stage: Stage, resolution: int = SOLID_RESOLUTION, layers: int = LAYERS) -> SolidResponse:
    """Mesh and solve a feasible stage in three dimensions. Raises BadInput, ComputationFailed."""
    return _solved(stage, resolution, layers)


@once
def _solved(stage: Stage, resolution: int, layers: int, limit: float | Limit = TIME_LIMIT) -> SolidResponse:
    check_feasible(stage)
    return solid_response(mesh_sectors(stage, resolution, limit), sheet_of(stage), layers_of(stage, layers))


@once
def solid_levels(stage: Stage, resolution: int, layers: int) -> SolidLevels:
    """What bounds the compliance that `solve_solid` gives.

    Notes
    -----
    The errors of the mesh in the plane and of the layers hardly depend on each other: each is seen where the other is
    coarse, and the five solutions cost less than the one that they are of.
    """
    planes, (few, many) = coarser(lambda level, count: solve_solid(stage, level, count).compliance, resolution, layers)
    return SolidLevels(np.array(planes), few, many)


def coarser(
    solve: Callable[[int, int], Found], resolution: int, layers: int
) -> tuple[list[Found], tuple[Found, Found]]:
    """What bounds `solve(resolution, layers)`: one layer on three meshes, and two numbers of layers on the coarsest."""
    planes, (_, fewer, most) = levels(resolution), levels(layers)
    return [solve(level, 1) for level in planes], (solve(planes[0], fewer), solve(planes[0], most))


def solid_bands(stage: Stage, resolution: int, layers: int) -> SolidBands:
    """Bands of the compliance that `solve_solid` gives, by coarser meshes and fewer layers."""
    return bands_of(solid_levels(stage, resolution, layers), resolution)


def bands_of(of: SolidLevels, resolution: int) -> SolidBands:
    """Bands of a compliance on a mesh of some resolution.

    Notes
    -----
    So few layers show no order that could be trusted - uneven ones that are not graded for the necks have far less
    than theirs - and their band is the last change of all entries together, by Cauchy-Schwarz, times `SAFETY`.
    """
    size, change = np.sqrt(np.outer(np.diag(of.many), np.diag(of.many))), of.of_layers
    zero = np.maximum(np.abs(of.few), np.abs(of.many)) <= ROUND_OFF * size  # by symmetry
    thickness = np.where(zero, np.finfo(float).eps, change.common + change.spread) * size
    steps = np.array(levels(resolution))
    plane = compliance_bands(steps, of.planes)
    for k in range(3):
        plane[k, k] = mesh_band(steps, of.planes[:, k, k], 0.0)
    return SolidBands(plane, thickness)


def bounding(stage: Stage, response: SolidResponse) -> tuple[Array, Array]:
    """Compliances (3, 3) of plane stress and of plane strain on the mesh of the plane of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (cyclic_response(response.sectors, each).compliance for each in (plate, held))
    return soft, hard


def neck_stress_of(stage: Stage, response: SolidResponse, loads: Array) -> NeckStress:
    """Highest stress of every notch under loads (k, 3)."""
    return solid_neck_stresses(stage, sheet_of(stage), response, loads)


def held_faces(stage: Stage) -> list[str]:
    """That a stage whose model holds its faces has them free here."""
    if stage.model != "plane_strain":
        return []
    return ['model = "plane_strain" holds the faces of the stage; in three dimensions they are free']
