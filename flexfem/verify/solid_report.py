"""What is said of a stage in three dimensions at rest and under one load."""

from __future__ import annotations

from typing import NamedTuple

from flexfem.arrays import Array, inverse
from flexfem.fem.response import Response
from flexfem.mechanism.stage import Stage
from flexfem.mechanism.stage_file import of_stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import solid_bands, solid_levels
from flexfem.questions.warnings import held_faces
from flexfem.verify.answers import UNITS
from flexfem.verify.solid import MODEL, bounding, neck_stress_of


class SolidReport(NamedTuple):
    """Finite elements in three dimensions at rest and under one load (3,) in the plane.

    layers : in half the thickness.   heights : (layers + 1,), mm, their bounds above the mid-plane.
    stiffness, compliance : (3, 3), of the platform.   band_plane, band_thickness, band : (3, 3), half-widths of the
    uncertainty of the compliance, by the mesh of the plane, by the layers, and their sum.
    plane_stress, plane_strain : compliances (3, 3) of these on the same mesh of the plane: they bound it.
    displacement : (3,), of the platform.   reaction : (3,), of the ground.   energy : N mm.
    neck_stress, neck_height : (3 chains, 3 hinges), largest von Mises stress, MPa, and where: mm from the mid-plane.
    """

    file: str
    name: str
    units: str
    model: str
    resolution: int
    layers: int
    heights: Array
    triangles: int
    unknowns: int
    stiffness: Array
    compliance: Array
    band: Array
    band_plane: Array
    band_thickness: Array
    plane_stress: Array
    plane_strain: Array
    force: Array
    displacement: Array
    reaction: Array
    energy: float
    neck_stress: Array
    neck_height: Array
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def report_solid(stage: Stage, response: Response, load: Array, resolution: int) -> SolidReport:
    """Finite elements in three dimensions under a load (3,), with what is to be known of that."""
    layers = response.layers
    plane, thickness = solid_bands(solid_levels(stage, resolution, layers.number), resolution)
    soft, hard = bounding(stage, response)
    necks, pose = neck_stress_of(stage, response, load[None]), response.compliance @ load
    doubts = warning.of_yield(float(necks.highest.max()), stage.material.yield_strength, "under this load")
    return SolidReport(
        **of_stage(stage),
        units=f"{UNITS}; stress MPa",
        model=MODEL,
        resolution=resolution,
        layers=layers.number,
        heights=layers.heights[::2],
        triangles=response.triangles,
        unknowns=response.unknowns,
        stiffness=inverse(response.compliance),
        compliance=response.compliance,
        band=plane + thickness,
        band_plane=plane,
        band_thickness=thickness,
        plane_stress=soft,
        plane_strain=hard,
        force=load,
        displacement=pose,
        reaction=load @ response.reactions,
        energy=float(load @ response.energy @ load / 2),
        neck_stress=necks.highest[0],
        neck_height=necks.height[0],
        warnings=[
            *warning.of_numbers(stage),
            *doubts,
            *warning.of_motion(stage, pose, "under this load"),
            *held_faces(stage),
        ],
    )
