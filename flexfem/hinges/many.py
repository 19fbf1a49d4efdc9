"""Compliance and stress of one hinge in n designs, whose profile has dimensions (n, 1).

The compliance is the beam integral of `Profile.compliance`, and the stress that of `Profile.stress`
at the same sections: both agree with the profile of every design to round-off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profile_beam import MIDPLANE_SHEAR, SHEAR_CORRECTION, SIDES
from flexfem.mechanism.tabulated import Tabulated

AT_ONCE = 256  # designs, whose positions along a hinge stay in the cache of the processor
STRESSES = 40_000  # that do: designs times sections times wrenches


class BeamIntegrals(NamedTuple):
    """Compliance (n, 3, 3) times E b at Poisson's ratio -1, without shear, and that of shear (n,).

    The latter is to be multiplied by `1 + nu` and added to the transverse compliance.
    """

    bending: Array
    shear: Array

    def compliance(
        self,
        E: Any,
        nu: Any,
        thickness: Any,
    ) -> Array:
        """Return the compliance (n, 3, 3), axial, transverse, rotation; arguments may be (n,)."""
        count = np.broadcast_shapes(*map(np.shape, (E, nu, thickness)), self.shear.shape)
        found = np.array(np.broadcast_to(self.bending, (*count, 3, 3)))
        found[..., 1, 1] += self.shear * (1 + np.asarray(nu))
        rigidity = np.broadcast_to(np.asarray(E) * thickness, count)
        return np.asarray(found / rigidity[..., None, None])


def is_same(one: Profile, other: Profile) -> bool:
    """Whether two profiles are equal in all designs."""
    if type(one) is not type(other):
        return False
    names = [each.name for each in fields(one)]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def varying(profile: Profile) -> list[str]:
    """Return the names of the dimensions that are arrays."""
    names = [each.name for each in fields(profile)]
    return [name for name in names if isinstance(getattr(profile, name), np.ndarray)]


def in_parts(profile: Profile, count: int) -> Iterator[tuple[slice, Profile]]:
    """Yield the profile of `AT_ONCE` of n designs at a time."""
    names = varying(profile)
    for start in range(0, count, AT_ONCE):
        part = slice(start, start + AT_ONCE)
        dimensions = {name: getattr(profile, name)[part] for name in names}
        yield part, replace(profile, **dimensions)


def beam_integrals(profile: Profile, count: int) -> BeamIntegrals:
    """Return the beam integrals of n designs, or of one where no dimension varies."""
    if not varying(profile):
        return BeamIntegrals(*_integrals(profile))
    found = [_integrals(part) for _, part in in_parts(profile, count)]
    return BeamIntegrals(*(np.concatenate(each) for each in zip(*found, strict=True)))


def _integrals(profile: Profile) -> tuple[Array, Array]:
    """Return bending and shear of a few designs."""
    if not (profile.symmetric and profile.even):
        without = profile.compliance(1.0, -1.0, 1.0)
        return without, profile.compliance(1.0, 0.0, 1.0)[..., 1, 1] - without[..., 1, 1]
    axial: Any = 0.0
    rotation: Any = 0.0
    transverse: Any = 0.0
    for x, weights, height in profile.right_half():
        share = weights / height
        bent = share / height**2
        axial = axial + 2 * np.sum(share, axis=-1)
        rotation = rotation + 24 * np.sum(bent, axis=-1)
        transverse = transverse + 24 * np.sum(bent * x**2, axis=-1)
    found = np.zeros((*np.shape(axial), 3, 3))
    found[..., 0, 0] = axial
    found[..., 1, 1] = transverse
    found[..., 2, 2] = rotation
    return found, np.asarray(2 * SHEAR_CORRECTION * axial)


def highest_stress(
    profile: Profile,
    wrenches: Array,
    out_of_plane: Any = 0.0,
) -> Array:
    """Return the highest von Mises stress (n, c), MPa times mm of thickness, of n designs.

    wrenches : (n, c, 3), on the far end at the centre, N and N mm.
    out_of_plane : as in `Profile.stress`, a number or (n,).
    """
    names = varying(profile)
    count = len(wrenches)
    along = np.empty(wrenches.shape[:2])
    axis = np.empty(wrenches.shape[:2])
    ratio = np.broadcast_to(out_of_plane, (count,))[:, None]
    free_edge = np.sqrt(1 - ratio + ratio**2)
    once = None if names else _envelope(profile)
    for part, some in in_parts(profile, count):
        envelope = _envelope(some) if once is None else once
        along[part] = envelope.highest(wrenches[part])
        neck = some.neck
        along_axis = free_edge[part] * wrenches[part, :, 0] / neck
        across = MIDPLANE_SHEAR * wrenches[part, :, 1] / neck
        axis[part] = np.hypot(along_axis, across)
    return np.asarray(np.maximum(free_edge * along, axis))


class _Envelope(NamedTuple):
    """Stress along the surface per N, V, M at sections: (..., sections, 3), times thickness.

    even : whether the stress is that of their sizes, with the same sign for all three.
    """

    rates: Array
    even: bool

    def highest(self, wrenches: Array) -> Array:
        """Return the highest stress (n, c) under wrenches (n, c, 3)."""
        loads = np.swapaxes(np.abs(wrenches) if self.even else wrenches, -1, -2)
        size = max(1, STRESSES // (self.rates.shape[-2] * loads.shape[-1]))
        starts = range(0, len(loads), size)
        found = [self._highest(slice(start, start + size), loads) for start in starts]
        return np.concatenate(found)

    def _highest(
        self,
        some: slice,
        loads: Array,
    ) -> Array:
        """Return the highest stress of some designs under loads (n, 3, c)."""
        rates = self.rates[some] if self.rates.ndim > 2 else self.rates
        at_sections = rates @ loads[some]
        if not self.even:
            np.abs(at_sections, out=at_sections)
        return np.asarray(np.max(at_sections, axis=-2))


def _envelope(profile: Profile) -> _Envelope:
    """Return the stress of a few designs at those sections where it may be highest.

    From the neck of a symmetric hinge on, the height grows: beyond the section where a transverse
    force causes the highest stress, all three fall. Along a uniform part they do not fall.
    """
    if not (profile.symmetric and profile.even) or isinstance(profile, Tabulated):
        sides = [_rates(profile, profile.sections, side) for side in SIDES]
        return _Envelope(np.concatenate(sides, axis=-2), False)
    x = _right_sections(profile)
    last = int(np.max(np.argmax(x / profile.height(x) ** 2, axis=-1)))
    return _Envelope(np.abs(_rates(profile, x[..., : last + 1], SIDES[1])), True)


def _right_sections(profile: Profile) -> Array:
    """Return the sections (..., m) from the centre of an even profile to the far end, in order.

    Those of a uniform part at the centre are left out, but for its end.
    """
    first, *_ = profile.half()
    is_uniform = isinstance(first, Segment) and not np.any((first.end - first.start).imag)
    sections = profile.sections
    ends = len(profile.breaks)
    within = (sections.shape[-1] - ends) // (ends - 1)
    order = list[int]()
    for piece in range(ends // 2 + is_uniform, ends - 1):
        order += [piece, *range(ends + piece * within, ends + (piece + 1) * within)]
    return np.asarray(sections[..., [*order, ends - 1]])


def _rates(
    profile: Profile,
    x: Array,
    side: float,
) -> Array:
    """Return `Profile.section_stress` (..., m, 3) per N, V, M at (..., m), times thickness."""
    K = profile.concentration(x, side)
    height = profile.height(x)
    neck = profile.neck_place
    bent = side * 6 / height**2
    along = K.tension / height + bent * profile.middle(x) * K.bending
    across = -bent * (neck * K.bending + (x - neck) * K.shear)
    return np.stack(np.broadcast_arrays(along, across, bent * K.bending), axis=-1)
