"""A hinge profile as a beam of its local height: compliance, and stress on its edges."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import Array
from flexfem.mechanism.edges import Bezier, ends_of, rise_of
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.profile_shape import LEFT, ProfileShape
from flexfem.mechanism.stress_concentration import Concentration, concentration

SHEAR_CORRECTION = 1.2  # kappa of the rectangular section
# left and right edge of a section, of opposite stress; a positive moment pulls the right one
SIDES = (-1.0, 1.0)
MIDPLANE_SHEAR = 1.5 * math.sqrt(3.0)  # von Mises stress on the axis, per mean shear stress
SLIGHTEST = 1e-6  # neck over root radius below which there is no stress concentration
STRESSED = 400  # steps in all between which the largest stress is searched


def _double_exponential(steps: int, end: float) -> tuple[Array, Array]:
    """Positions and weights (2 steps + 1,) on (0, 1) of the rule of Takahasi and Mori (1974).

    Its points crowd at both ends. There heights have vertical tangents, and 1/height^3 has poles
    near a neck.
    """
    u = end * np.arange(-steps, steps + 1) / steps
    x = 1 / (1 + np.exp(-np.pi * np.sinh(u)))
    return x, np.pi * np.cosh(u) * x * (1 - x) * end / steps


RULE = _double_exponential(64, 3.3)
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(3)
UNIFORM_RULE = ((1 + POINTS) / 2, WEIGHTS / 2)  # exact for the squares of positions


@dataclass(frozen=True)
class ProfileBeam(ProfileShape):
    """A hinge profile with its integrals as a Timoshenko beam."""

    def compliance(
        self,
        youngs_modulus: float,
        poissons_ratio: float,
        thickness: float,
        thicker: ArrayLike = 0.0,
    ) -> Array:
        """Compliance (..., 3, 3) of the far end relative to the near one, at the centre: axial,
        transverse, rotation.

        thicker : (...), mm, added to all heights, as a thicker neck does.   nan where no height is
        left.

        Notes
        -----
        A Timoshenko beam of the local height: `int dx / (E A)`, `int x^2 / (E I) dx + kappa int dx
        / (G A)` and `int dx / (E I)`. A force at the centre and a moment are uncoupled for a
        profile symmetric about its centre. Where the mid-line is m off the axis, the section
        carries the moment `M - V x + N m`: an axial force bends, and `int m^2 / (E I) dx`, `int m /
        (E I) dx` and `-int x m / (E I) dx` are added.
        """
        x, weights = self.quadrature
        added = np.asarray(thicker, dtype=float)[..., None]
        height = self.height(x) + np.where(added > -self.neck, added, np.nan)
        axial = np.sum(weights / height, axis=-1)
        cube = height**3
        rotation, moment, bending = (12 * np.sum(weights * x**n / cube, axis=-1) for n in range(3))
        found = np.zeros((*axial.shape, 3, 3))
        found[..., 0, 0] = axial
        found[..., 2, 2] = rotation
        found[..., 1, 1] = bending + SHEAR_CORRECTION * 2 * (1 + poissons_ratio) * axial
        found[..., 1, 2] = found[..., 2, 1] = -moment
        if not self.symmetric:
            middle = self.middle(x)
            found[..., 0, 0] += 12 * np.sum(weights * middle**2 / cube, axis=-1)
            found[..., 0, 1] = found[..., 1, 0] = -12 * np.sum(weights * x * middle / cube, axis=-1)
            found[..., 0, 2] = found[..., 2, 0] = 12 * np.sum(weights * middle / cube, axis=-1)
        return found / (youngs_modulus * thickness)

    def right_half(self) -> Iterator[tuple[Array, Array, Array]]:
        """Yield positions, weights of integrals and heights (..., q) along each curve of `half`.

        They are those of `quadrature` from the centre to the far end, fewer where the height is
        uniform, and without the terms that vanish in a curve.
        """
        height = np.asarray(self.neck)
        for curve in self.half():
            first, last = ends_of(curve)
            step = last - first
            is_uniform = isinstance(curve, Segment) and not np.any(step.imag)
            shares, weights = UNIFORM_RULE if is_uniform else RULE
            along = step.real * shares
            if isinstance(curve, Bezier):
                heights = self.height(first.real + along)
            else:
                heights = height + self._notches * rise_of(along, curve, step)
            yield first.real + along, step.real * weights, heights
            height = height + self._notches * step.imag

    def opened_before(self, poissons_ratio: ArrayLike) -> Array:
        """Return the share (..., n, 3, 3) of an opening of the hinge that arises before each
        position of `quadrature`.

        Under loads on its ends alone, the section there moves by the motion of the near end plus
        this share of the motion of the far end relative to it, as twists at the centre: axial,
        transverse, rotation.

        poissons_ratio : (...).
        """
        x, weights = self.quadrature
        height = self.height(x)
        axial = weights / height
        bending = 12 * weights / height**3
        shear = 2 * (1 + np.asarray(poissons_ratio, dtype=float))[..., None]
        # moments in the section by unit loads, and the integrands of `compliance`
        moment = np.stack([self.middle(x), -x, np.ones_like(x)], axis=-1)
        parts = moment[..., :, None] * moment[..., None, :] * bending[..., None, None]
        parts = np.array(np.broadcast_to(parts, (*np.broadcast_shapes(shear.shape, x.shape), 3, 3)))
        parts[..., 0, 0] += axial
        parts[..., 1, 1] += SHEAR_CORRECTION * shear * axial
        before = np.cumsum(parts, axis=-3) - parts / 2
        whole = np.linalg.inv(np.sum(parts, axis=-3))
        return np.asarray(before @ whole[..., None, :, :])

    @cached_property
    def quadrature(self) -> tuple[Array, Array]:
        """Positions (..., n) on the axis and weights (..., n) of integrals over it."""
        return self._between(*RULE)

    def _between(
        self,
        shares: Array,
        weights: Array,
    ) -> tuple[Array, Array]:
        """Return positions (..., n) at shares (q,) between all breaks, and their weights (..., n).

        weights : (q,), for an integral from 0 to 1.
        """
        ends = np.stack(np.broadcast_arrays(*self.breaks))
        ends = ends.reshape(len(ends), *(ends.shape[1:] or (1,)))
        low = ends[:-1]
        step = np.diff(ends, axis=0)
        return _joined(low + step * shares), _joined(step * weights)

    def concentration(
        self,
        x: Array,
        edge: float,
    ) -> Concentration:
        """Return the stress concentration at positions x (n,) of an edge of `SIDES`, (n,) or ().

        It is that of Neuber's notch with the root radius, in bending times the factor of the inner
        or outer edge of a bar whose mid-line has a curvature k, `1 +- k t / 3` (E. Winkler, to
        first order).
        """
        K = concentration(np.maximum(self.neck / self.root_radius, SLIGHTEST))
        return K._replace(bending=K.bending * (1 - edge * self._middle_curvature * self.neck / 3))

    @property
    def _middle_curvature(self) -> float:
        """Curvature of the mid-line at the neck, 1/mm, positive with the centre to the left."""
        if self.side is None:
            return 0.0
        return (0.5 if self.side == LEFT else -0.5) / self.edge_radius

    def stress(
        self,
        wrench: Array,
        thickness: ArrayLike,
        out_of_plane: float = 0.0,
        across: ArrayLike = 0.0,
    ) -> Array:
        """Largest von Mises stress (...), MPa, of the hinge under wrenches (..., 3) on its far end.

        wrench : axial force, transverse force, N, and counter-clockwise moment, N mm, which act on
        the far end (the
            second body) at the centre of the hinge and in its frame.   thickness : (...), mm.
        out_of_plane : ratio of the stress out of the plane to that along the axis, Poisson's ratio
        in plane strain.
        across : (...), MPa, a further stress out of the plane, such as that of a warm plate in
        plane strain.

        Notes
        -----
        The section at x carries the moment `M - V x`, and `m = M - V x_n` at the neck; where the
        mid-line is off the axis, `M` contains the axial force times this distance. The surface
        stress, in plane stress, is the sum of `N K_t / (b h)` and `6 (m K_b - V (x - x_n) K_s) / (b
        h^2)` with `concentration`; it is nominal at sharp inner corners, such as the roots of a
        leaf without fillets. On the axis, where bending vanishes, the axial stress combines with
        `tau = 1.5 V / (b h)`; this governs in short hinges only. Finite elements agree within 2 %
        in moment and tension (`benchmarks/hinge_shapes.py`); transverse forces give up to 18 % less
        in short notches deeper than long and between flanks at more than 90 degrees. Of notches on
        one side, with necks of up to a fifth of the radius, they give 0.2 % less by a moment, 2 %
        less in tension, and 10 % more by a transverse force at the centre.
        """
        x = self.sections
        return np.asarray(
            np.max(
                self.section_stress(x, wrench[..., None, :], thickness, out_of_plane, across),
                axis=-1,
            )
        )

    @cached_property
    def sections(self) -> Array:
        """Positions (n,) on the axis between which the largest stress is searched, mm."""
        ends = np.concatenate(np.broadcast_arrays(*map(np.atleast_1d, self.breaks)), axis=-1)
        within = _double_exponential(max(4, STRESSED // len(self.breaks)), 3.0)[0]
        return np.concatenate([ends, self._between(within, within)[0]], axis=-1)

    def section_stress(
        self,
        x: Array,
        wrench: Array,
        thickness: ArrayLike,
        out_of_plane: float | Array = 0.0,
        across: ArrayLike = 0.0,
    ) -> Array:
        """Largest von Mises stress (..., n), MPa, of the sections at x (n,), as `stress`.

        wrench : (..., n, 3) or (..., 1, 3), at the centre of the hinge.   thickness : (...), mm.
        """
        height = self.height(x)
        area = np.asarray(thickness, dtype=float)[..., None] * height
        N, V, M = (wrench[..., k] for k in range(3))
        neck = self.neck_place
        at_middle = M + N * self.middle(x) - V * neck

        def von_mises(along: Array) -> Array:
            z = out_of_plane * along + np.asarray(across)[..., None]
            return np.asarray(np.sqrt(along**2 - along * z + z**2))

        edges = list[Array]()
        for side in SIDES:
            K = self.concentration(x, side)
            bending = 6 * (at_middle * K.bending - V * (x - neck) * K.shear) / height
            edges.append(von_mises((N * K.tension + side * bending) / area))
        axis = np.hypot(von_mises(N / area), MIDPLANE_SHEAR * V / area)
        return np.asarray(np.maximum(axis, np.maximum(*edges)))


def _joined(pieces: Array) -> Array:
    """Return positions (..., pieces times q) of positions (pieces, ..., q)."""
    return np.moveaxis(pieces, 0, -2).reshape(*pieces.shape[1:-1], -1)
