"""Thermal expansion of a mechanism and of the frame to which it is fixed."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.layout import Constants
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput

Rates = TypeVar("Rates", float, Array)

KEY = "expansion_um_per_m_k"
MISSING = "is missing, expected um/(m K), the coefficient of linear thermal expansion"


class Expansion(NamedTuple):
    """Expansion of plate and frame, and stress across the unstrained plane; all per kelvin.

    across : MPa, of the plate, or (h,) of the hinges of one whose parts have different materials.
    of_parts : of these bodies, then hinges; None if they are alike.
    """

    plate: float
    frame: float
    across: float | Array
    of_parts: Array | None = None

    def unlike_hinges(self, bodies: int) -> float | Array:
        """Expansion of hinges, which follow the bodies in `of_parts`, less that of the plate."""
        if self.of_parts is None:
            return 0.0
        return self.of_parts[bodies:] - self.plate


def require_expansion(mechanism: Mechanism) -> None:
    """Raise BadInput for a mechanism with a material whose expansion is not stated."""
    if mechanism.material.expansion is None:
        raise BadInput(f"material.{KEY} {MISSING} (aluminium 23.6)")
    for part in mechanism.layout.parts:
        if part.material is not None and part.material.expansion is None:
            raise BadInput(
                f"{part.key}.material.{KEY} {MISSING}: other parts have another material"
            )


def coefficients(mechanism: Mechanism) -> tuple[float, float]:
    """Return the coefficients of plate and frame, 1/K.

    A frame whose coefficient is not stated expands like the plate.
    """
    of_plate = float(mechanism.material.expansion or 0.0)
    of_frame = mechanism.frame.expansion
    return of_plate, of_plate if of_frame is None else of_frame


def expansion_in_plane(
    plate: Rates,
    frame: Rates,
    out_of_plane: Rates,
) -> Rates:
    """Return the effective expansion in the plane, 1/K, of a plate on a frame, with coefficients in
    1/K.

    Notes
    -----
    In plane strain, where `out_of_plane` is nu, the faces are held at the expansion of the frame.
    The strain `a_frame T` across the plate and `s_z = nu (s_x + s_y) + E (a_frame - a) T` leave `a
    T + nu (a - a_frame) T` in the plane. In plane stress, where `out_of_plane` is zero, the faces
    are free and the expansion is that of the plate.
    """
    return plate + out_of_plane * (plate - frame)


def expansion_of(mechanism: Mechanism) -> Expansion:
    """Return the expansion in the plane problem of a mechanism."""
    of_plate, of_frame = coefficients(mechanism)
    layout = mechanism.layout
    in_plane = expansion_in_plane(of_plate, of_frame, layout.out_of_plane)
    of_parts = None
    if layout.mixed:
        own = [_in_plane(material, of_frame) for material in layout.materials]
        of_parts = np.array(own)
    return Expansion(in_plane, of_frame, _stress_across(mechanism), of_parts)


def expansion_in_depth(mechanism: Mechanism) -> Expansion:
    """Return the expansion in three dimensions of a mechanism, whose faces are free."""
    of_plate, of_frame = coefficients(mechanism)
    layout = mechanism.layout
    of_parts = None
    if layout.mixed:
        of_parts = np.array([_coefficient(material) for material in layout.materials])
    return Expansion(of_plate, of_frame, _stress_across(mechanism), of_parts)


def _coefficient(material: Constants) -> float:
    return float(material.expansion or 0.0)


def _in_plane(material: Constants, frame: float) -> float:
    """Return the effective expansion in the plane of a material, 1/K."""
    return expansion_in_plane(_coefficient(material), frame, material.out_of_plane)


def _stress_across(mechanism: Mechanism) -> float | Array:
    """Return the stress across the held plane in plane strain, MPa per kelvin; else zero."""
    if mechanism.model != "plane_strain":
        return 0.0
    of_plate, of_frame = coefficients(mechanism)
    layout = mechanism.layout
    if not layout.mixed:
        return mechanism.material.youngs_modulus * (of_frame - of_plate)
    own = list[float]()
    for joint in layout.joints:
        material = layout.material_of(joint)
        youngs_modulus = material.youngs_modulus * (1 - material.out_of_plane**2)
        own.append(youngs_modulus * (of_frame - _coefficient(material)))
    return np.array(own)
