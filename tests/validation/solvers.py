"""Our answers beside those of NGSolve and CalculiX on the same elements, in the plane and in three
dimensions.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import SOLID_QUADRATURE, Plate, nodal_stress, von_mises
from flexfem.fem.mesh import PlaneMesh, welded
from flexfem.fem.modes import modes, sector_modes, vibrating_structure
from flexfem.fem.response import platform_response, unit_response
from flexfem.fem.structure import mass_of, structure
from flexfem.mechanism.layout import Payload
from flexfem.paper.bodies import carried, carried_out_of_plane
from flexfem.paper.fields import neck_maxima
from flexfem.paper.stage import Stage, load_stage
from flexfem.paper.stage_mesh import build_mesh, layers_of, mesh_sectors, plate_of, sheet_of
from flexfem.units import DENSITY, UNITS

from ..conftest import UNLIKE, with_changes
from ..tolerances import SOLVED
from . import calculix, ngsolve
from .ngsolve import COUNT
from .problem import Finding, problem

HERTZ = UNITS["hz"].factor
RESOLUTION = (
    2  # triangles across a neck: the algebra does not care, and CalculiX takes a minute for more
)
NGSOLVE = SOLVED  # measured: pose 1e-12, displacement 6e-12, stress 2e-10, frequencies 2e-11
# degree of our quadrature; with two triangles across a neck 4 leave 7e-7 of the pose, 8 leave 1e-9
FULL = 12
THIN_PARTS = 50.0
THIN = (
    32e-5  # of the narrowest neck make the thin sheet; of its pose, falls with the mesh (calculix)
)
SAME = "exact: the same equations, by another program"


class Sheet(NamedTuple):
    """A stage with a coarse mesh."""

    stage: Stage
    mesh: PlaneMesh
    plate: Plate

    @property
    def lever(self) -> float:
        """l3, mm."""
        return self.stage.chain.link_lengths[2]

    @property
    def density(self) -> float:
        """tonne/mm^3."""
        return self.stage.material.density * DENSITY

    def disc(self, tilting: bool = False) -> Array:
        """Mass matrix (3, 3), tonne, tonne mm^2, of the hub as a disc: for x, y, theta, or z and
        tilts.
        """
        r = self.stage.platform.hub_radius
        b = self.plate.thickness
        mass = self.density * b * math.pi * r**2
        diameter = (3 * r**2 + b**2) / 12
        return mass * np.diag([1.0, diameter, diameter] if tilting else [1.0, 1.0, r**2 / 2])


def unlike() -> Stage:
    """Chains that differ; another thickness and density, so that the hub tilts otherwise."""
    return with_changes(
        {"override": UNLIKE, "thickness_mm": 13.7, "material.density_kg_m3": 4430.0}
    )


@cache
def sheets() -> dict[str, Sheet]:
    """A shipped stage and one of unlike chains, each with its coarse mesh."""
    shipped = load_stage(Path(__file__).parents[2] / "geometry" / "mobility6.toml")
    stages = {"mobility six": shipped, "unlike chains": unlike()}
    return {
        name: Sheet(stage, build_mesh(stage, RESOLUTION), plate_of(stage))
        for name, stage in stages.items()
    }


def pose_difference(ours: Array, theirs: Array, lever: float) -> float:
    """Largest difference of two compliances (3, 3), rotations by the lever l3, mm, over the largest
    of ours.
    """
    scale = np.outer([1.0, 1.0, lever], [1.0, 1.0, lever])
    return float(np.max(np.abs(theirs - ours) * scale) / np.max(np.abs(ours) * scale))


def field_difference(ours: Array, theirs: Array) -> float:
    """Largest difference of two fields (k loads, ...), each load's over its largest."""
    axes = tuple(range(1, ours.ndim))
    return float(np.max(np.max(np.abs(theirs - ours), axis=axes) / np.max(np.abs(ours), axis=axes)))


def frequency_difference(ours: Array, theirs: Array) -> float:
    """The largest relative difference of frequencies (k,)."""
    return float(np.max(np.abs(theirs / ours - 1)))


def _rows(
    where: str, differences: dict[str, float], allowed: float, unknowns: int, note: str = ""
) -> list[Finding]:
    return [
        Finding(
            f"{where}, largest relative difference of {what}",
            0.0,
            value,
            allowed,
            unknowns=unknowns,
            note=note,
        )
        for what, value in differences.items()
    ]


def against_ngsolve(sheet: Sheet, theirs: ngsolve.Solved) -> dict[str, float]:
    """Largest relative differences, ours integrated as finely."""
    stage, mesh, plate = sheet
    ours = platform_response(mesh, plate, FULL)
    compliance = np.linalg.inv(theirs.stiffness)
    fields = compliance @ np.array([motion.vec.FV().NumPy() for motion in theirs.motions])
    wanted = np.array([theirs.curved.coefficients(field[:, None]) for field in ours.fields])
    stress = [nodal_stress(mesh, plate, field) for field in ours.fields], theirs.nodal_stress(mesh)
    necks = [
        np.array([neck_maxima(stage, mesh, von_mises(nodal)) for nodal in each]) for each in stress
    ]
    mass = mass_of(
        structure(mesh, plate, degree=FULL), sheet.density, carried(stage, Payload()), FULL
    )
    of = vibrating_structure(mass)
    hertz = modes(of, COUNT).frequencies * HERTZ
    return {
        "pose": pose_difference(ours.compliance, compliance, sheet.lever),
        "displacement": field_difference(wanted, fields),
        "neck stress": field_difference(*necks),
        "frequencies": frequency_difference(hertz, theirs.frequencies(sheet.density, sheet.disc())),
    }


@problem(
    "NGSolve in the plane",
    "stiffness, mass, stresses and the rigid hub, beside another program",
    SAME,
)
def ngsolve_in_the_plane() -> list[Finding]:
    """Our own mesh solved by NGSolve, integrated as finely: pose, displacement, neck stress, six
    frequencies.
    """
    rows = []
    for name, sheet in sheets().items():
        found = against_ngsolve(sheet, ngsolve.solve(sheet.mesh, sheet.plate))
        rows += _rows(name, found, NGSOLVE, 2 * len(sheet.mesh.nodes))
    return rows


@problem(
    "CalculiX in the plane", "stiffness and the rigid hub, beside another program", SAME, slow=True
)
def calculix_in_the_plane() -> list[Finding]:
    """Our own mesh solved by CalculiX: an uncoupled sheet, to the digits printed, and a thin one."""
    rows = []
    for name, sheet in sheets().items():
        stage, mesh, plate = sheet
        ours = platform_response(mesh, plate, calculix.INTEGRATION)
        thin = float(stage.array("neck").min()) / THIN_PARTS
        for what, b, allowed in (
            ("uncoupled", plate.thickness, calculix.DIGITS),
            ("thin", thin, THIN),
        ):
            compliance, fields = calculix.solve(mesh, plate, b, what == "uncoupled")
            found = {
                "pose": pose_difference(ours.compliance, compliance, sheet.lever),
                "displacement": field_difference(ours.fields, fields),
            }
            rows += _rows(f"{name}, {what} sheet of {b:g} mm", found, allowed, 2 * len(mesh.nodes))
    return rows


@problem(
    "NGSolve in three dimensions",
    "wedges, their mass and the hub out of the plane",
    SAME,
    slow=True,
)
def ngsolve_in_three_dimensions() -> list[Finding]:
    """Our own wedges as NGSolve's quadratic prisms, integrated as finely: pose and twelve natural
    frequencies.
    """
    stage = unlike()
    sectors = mesh_sectors(stage, RESOLUTION)
    layers = layers_of(stage, 1)
    sheet = Sheet(stage, welded(sectors)[0], sheet_of(stage))
    shipped, ours = (
        unit_response(sectors, sheet.plate, layers, degree) for degree in (SOLID_QUADRATURE, FULL)
    )
    loads = {"in": carried(stage, Payload()), "out of": carried_out_of_plane(stage, Payload())}
    compliance = np.zeros((3, 3))
    found = {}
    for (which, load), half in zip(loads.items(), (layers, layers.antisymmetric), strict=True):
        theirs = ngsolve.solve(sheet.mesh, sheet.plate, half)
        hertz = theirs.frequencies(sheet.density, sheet.disc(which == "out of"))
        modes = sector_modes(
            sectors, sheet.plate, half, sheet.density, load, COUNT, FULL
        ).frequencies
        found[f"frequencies {which} the plane"] = frequency_difference(modes * HERTZ, hertz)
        if which == "in":
            compliance = np.linalg.inv(theirs.stiffness)
            found["pose"] = pose_difference(ours.compliance, compliance, sheet.lever)
    apart = pose_difference(compliance, shipped.compliance, sheet.lever)
    return _rows(
        "unlike chains",
        found,
        NGSOLVE,
        ours.unknowns,
        f"ours by default quadrature is {apart:.1e} apart in pose",
    )
