"""Warnings about results outside the range of validity of a model; each function returns sentences,
or none.
"""

from __future__ import annotations

import numpy as np

from flexfem.files.refusals import key_path
from flexfem.mechanism.materials import Material
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import plate_mass, size_of
from flexfem.mechanism.plate_checks import triangles_needed
from flexfem.units import LENGTH, STRESS, short

Warnings = list[str]

# per cent at resolution 4, falling with its square: 0.6 to 1.02 on reference and random stages
STRESS_BELOW = 1.0
YIELD_STRAIN = (1e-5, 0.2)  # of hinge materials, from soft metals to rubbers
DENSITIES = (10.0, 23_000.0)  # kg/m^3, foam to osmium
# mm: from the smallest mechanisms cut from sheet to more than the length of plates
ACROSS = (1.0, 5000.0)
# size of a plate / thickness / neck: a larger ratio is more likely a number in another unit
SLENDER = 1000.0
# masses of the plate; with a payload in kg for g the ratio is a thousand times too large
HEAVY = 100.0
RIGHT_UNIT = "is the unit right?"
MANY_TRIANGLES = 200_000  # with 8 across the necks; three meshes take more than a minute


def of_yield(
    stress: float,
    yield_strength: float,
    where: str,
) -> Warnings:
    """Warn of a highest stress above the yield strength, MPa; `where` names the load or command."""
    if stress <= yield_strength:
        return []
    return [
        f"{where}: the highest stress is {stress:.4g} {STRESS}, beyond the yield strength of "
        f"{yield_strength:.4g} {STRESS}; the elastic result is not valid there"
    ]


def implausible(
    kind: str, material: Material, thickness: float, across: float, neck: float
) -> Warnings:
    """Warn of the material and the size of a plate that are possible, but probably in another unit.

    kind : what the plate is called.   thickness, across, neck : of the plate, its largest extent
    and its smallest neck, mm."""
    strength = material.yield_strength
    strain = strength / material.youngs_modulus
    flat = f"thickness_mm = {thickness:g} is below a thousandth of"
    plausible = {
        f"material.yield_strength_mpa = {strength:g} is {strain:.2g} of Young's modulus": (
            strain,
            YIELD_STRAIN,
        ),
        f"material.density_kg_m3 = {material.density:g} is not that of a solid": (
            material.density,
            DENSITIES,
        ),
        f"the {kind} is {short(across, '.3g')} {LENGTH} across": (across, ACROSS),
        f"{flat} the {kind}, {across:.3g} {LENGTH} across": (across / thickness, (0.0, SLENDER)),
        f"neck_mm = {neck:g} is below a thousandth of the thickness, {thickness:g} {LENGTH}": (
            thickness / neck,
            (0.0, SLENDER),
        ),
    }
    return [
        f"{text}: {RIGHT_UNIT}"
        for text, (value, (low, high)) in plausible.items()
        if not low <= value <= high
    ]


def of_numbers(mechanism: Mechanism) -> Warnings:
    """Warn of numbers of a file that are possible, but probably in another unit."""
    layout = mechanism.layout
    neck = min((joint.profile.neck for joint in layout.joints), default=np.inf)
    kind = mechanism.kind.removesuffix(" file")
    doubts = implausible(kind, mechanism.material, mechanism.thickness, size_of(layout), neck)
    needed = triangles_needed(layout)
    if needed > MANY_TRIANGLES:
        doubts.append(
            f"finite elements need about {needed:.2g} triangles with 8 across the necks, which "
            "take minutes"
        )
    return doubts + of_payload(mechanism, sum(load.mass for load in layout.payloads))


def of_payload(mechanism: Mechanism, mass: float) -> Warnings:
    """Warn of a payload, tonne, that is far heavier than its plate."""
    if mass == 0.0:
        return []
    own = plate_mass(mechanism.layout)
    ratio = mass / own
    if ratio <= HEAVY:
        return []
    return [
        f"the payload of {1e3 * mass:.4g} kg is {ratio:.3g} times as heavy as the plate of "
        f"{1e3 * own:.3g} kg: {RIGHT_UNIT}"
    ]


def of_parameters(mechanism: Mechanism) -> Warnings:
    """Warn of parameters on which nothing depends; a name may be misspelt, or kept for later."""
    unused = mechanism.unused_parameters
    return [
        f"{key_path(('parameters', key))}: no number depends on this parameter" for key in unused
    ]


def stress_below(resolution: int) -> str:
    """Describe the largest error of the highest neck stress by finite elements of a resolution."""
    return f"up to {STRESS_BELOW * (4 / resolution) ** 2:.2g} % low"
