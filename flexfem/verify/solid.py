"""The stage in three dimensions, beside plane stress and plane strain."""

from __future__ import annotations

from flexfem.arrays import Array
from flexfem.fem.elements import Plate
from flexfem.fem.fields import NeckStress, solid_neck_stresses
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import sheet_of
from flexfem.mechanism.stage import Stage

MODEL = "three_dimensional"


def bounding(stage: Stage, response: Response) -> tuple[Array, Array]:
    """Compliances (3, 3) of plane stress and of plane strain on the mesh of the plane of a response."""
    plate = sheet_of(stage)
    nu = plate.poissons_ratio
    held = Plate(plate.youngs_modulus / (1 - nu**2), nu / (1 - nu), plate.thickness)
    soft, hard = (unit_response(response.sectors, each).compliance for each in (plate, held))
    return soft, hard


def neck_stress_of(stage: Stage, response: Response, loads: Array) -> NeckStress:
    """Highest stress of every notch under loads (k, 3)."""
    return solid_neck_stresses(stage, sheet_of(stage), response, loads)
