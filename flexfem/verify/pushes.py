"""What pushes on a pole and on its bar do to a stage, and what sensors make of it.

The set-up of Section VI, linear and at rest, all springs in series along the line of the push. A push of force F has
this way from the stroke of the actuator to the ground, of which the sensors read the parts in brackets:

    stroke = F (1/k_actuator + 1/k_sensor) + [pole at the push] + [bar at the push] + w^T C w F

with C (3, 3) the compliance of the platform and w the load of a unit push at the platform's centre. The pole stands at
p = (p_x, p_y) from the centre. Pushed along a unit vector n at a point r from the centre, `w = (n_x, n_y, r_x n_y -
r_y n_x)`: a push in x is `(1, 0, -p_y)`, one in y `(0, 1, p_x)`. The bar points along b and is pushed along n, which is
b turned by 90 degrees, at `r = p + a b`, so that `w = (n, p x n + a)`: moment and force. A sensor of displacement along
n at a point s reads `g^T C w F` with `g = (n, s x n)`, and what pole and bar add there when it reads them.

- Sensors of displacement stand on the ground: neither actuator nor force sensor is in what they read. These two cost
  force per stroke, and leave slopes as they are.
- x and y are free while the other is pushed: what is measured is `1/C_xx`, not `K_xx`, which is the same where K is
  diagonal.
- The moment is taken to be the force times the arm, as one does who takes the pole to be at the centre; by how much it
  is not, `p x n`, is an error of the slope in theta of the first order, and of those in x and y of the second.
- Rotation is the difference of two sensors over their distance, or, by "one end", one sensor over its arm, which takes
  the translation of the bar for rotation.

The pole is Timoshenko's cantilever (shear 10/9), the bar Bernoulli's. Not in it: out-of-plane tilt of the stage under
a push so high above it, contacts, friction, hysteresis and drift.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.mechanism.designs import direction
from flexfem.verify.fixture import Bar, Fixture, Pole

SHEAR = 10 / 9  # of a round section: energy of the parabolic shear stress of beam theory


class Pushes(NamedTuple):
    """Pushes in x, y and on the bar, and m sensors of displacement; mm, N, rad.

    load : (3, 3), on the platform at its centre, of each push by 1 N.   arm : (3,), reading of the load over the push.
    behind : (3,), compliance of actuator, force sensor, pole and bar along each push, mm/N.
    push : (m,), which push each sensor is for.   reading : (m, 3), what it reads of a pose, mm per mm, mm, rad.
    pole, bar : (m,), what these add to it, mm per N of its push.   weight : (m,), its share in the displacement read.
    """

    load: Array
    arm: Array
    behind: Array
    push: Index
    reading: Array
    pole: Array
    bar: Array
    weight: Array


def pushes_of(fixture: Fixture) -> Pushes:
    """The pushes of a set-up and its sensors."""
    pole, bar, lvdt = fixture.pole, fixture.bar, fixture.lvdt
    a, at = bar.arm, bar.arm if lvdt.arm is None else lvdt.arm
    along = direction(np.array(bar.angle))
    n = np.array([-along[1], along[0]])
    p = np.array(pole.offset)
    ends = (at, -at) if lvdt.rotation == "both ends" else (at,)
    bend, twist, own = pole_compliance(pole)
    on_pole = 1.0 if lvdt.at == "pole" else 0.0
    k = fixture.sensor.stiffness
    drive = 1 / fixture.actuator.stiffness + (0.0 if k is None else 1 / k)
    end = bend[1]
    return Pushes(
        load=np.array([wrench([1.0, 0.0], p), wrench([0.0, 1.0], p), wrench(n, p + a * along)]),
        arm=np.array([1.0, 1.0, a]),
        behind=drive + np.array([own, own, end + a**2 * twist + bar_deflection(bar, a, a)]),
        push=np.array([0, 1, *(2 for _ in ends)]),
        reading=np.array([wrench([1.0, 0.0], p), wrench([0.0, 1.0], p), *(wrench(n, p + s * along) for s in ends)]),
        pole=on_pole * np.array([bend[0], bend[0], *(end + s * a * twist for s in ends)]),
        bar=on_pole * np.array([0.0, 0.0, *(bar_deflection(bar, a, s) for s in ends)]),
        weight=np.array([1.0, 1.0, *(1 / (s * len(ends)) for s in ends)]),
    )


IDEAL = Pushes(
    load=np.eye(3),
    arm=np.ones(3),
    behind=np.zeros(3),
    push=np.arange(3),
    reading=np.eye(3),
    pole=np.zeros(3),
    bar=np.zeros(3),
    weight=np.ones(3),
)


def wrench(along: Array | list[float], at: Array) -> Array:
    """Load (3,) at the platform's centre of a unit force along (2,) at a point (2,); also what is read there."""
    return np.array([along[0], along[1], at[0] * along[1] - at[1] * along[0]])


class PoleCompliance(NamedTuple):
    """Of a pole: bending (push to end, end to end), mm/N; torsion, rad/(N mm); bending of the pushed point, mm/N."""

    bending: tuple[float, float]
    torsion: float
    pushed: float


def pole_compliance(pole: Pole) -> PoleCompliance:
    """Compliance of a pole by its dimensions or by its stiffnesses."""
    if pole.bending_stiffness is not None and pole.torsional_stiffness is not None:
        bending = 1 / pole.bending_stiffness
        return PoleCompliance((bending, bending), 1 / pole.torsional_stiffness, bending)
    assert pole.height and pole.diameter and pole.youngs_modulus and pole.poissons_ratio is not None and pole.pushed_at
    E, G = pole.youngs_modulus, pole.youngs_modulus / (2 * (1 + pole.poissons_ratio))
    second, A = np.pi * pole.diameter**4 / 64, np.pi * pole.diameter**2 / 4

    def bent(low: float, high: float) -> float:
        return float(low**2 * (3 * high - low) / (6 * E * second) + SHEAR * low / (G * A))

    h, pushed = pole.height, pole.pushed_at
    return PoleCompliance((bent(pushed, h), bent(h, h)), float(h / (G * 2 * second)), bent(pushed, pushed))


def bar_deflection(bar: Bar, push: float, at: float) -> float:
    """Deflection, mm, at a place on the bar, negative on its other side, by 1 N at `push`, less that of the pole."""
    if bar.stiffness is not None:
        EI = bar.stiffness * bar.arm**3 / 3
    elif bar.width and bar.thickness and bar.youngs_modulus:
        EI = bar.youngs_modulus * bar.thickness * bar.width**3 / 12
    else:
        return 0.0
    low, high = sorted((push, at))
    return max(low, 0.0) ** 2 * (3 * high - low) / (6 * EI)


def seen(of: Pushes, C: Array) -> Array:
    """What every sensor reads (..., m), mm per N of its push, of stages of compliance C (..., 3, 3)."""
    return np.asarray(np.einsum("mi,...ij,mj->...m", of.reading, C, of.load[of.push])) + of.pole + of.bar


def read(of: Pushes, displacements: Array) -> Array:
    """Displacements in x, y, theta (..., 3), mm, mm, rad, of those of all sensors (..., m)."""
    return np.asarray((of.weight * displacements) @ np.equal.outer(of.push, np.arange(3)))


def read_compliance(of: Pushes, C: Array) -> Array:
    """Displacement read over load read (..., 3), mm/N, mm/N, rad/(N mm): one over the slope, without noise."""
    return read(of, seen(of, C)) / of.arm


def stage_share(of: Pushes, C: Array) -> Array:
    """The stage's part (..., 3) of `read_compliance`: on a rigid fixture, which may still push beside the centre."""
    return read_compliance(of._replace(pole=np.zeros_like(of.pole), bar=np.zeros_like(of.bar)), C)


def pole_share(of: Pushes) -> Array:
    """The pole's part (3,) of `read_compliance`."""
    return read(of, of.pole) / of.arm


def bar_share(of: Pushes) -> Array:
    """The bar's part (3,) of `read_compliance`."""
    return read(of, of.bar) / of.arm


def force_of(of: Pushes, C: Array, stroke: Array) -> Array:
    """Force (3, n) of each push, N, at strokes (n,), mm, on a stage of compliance C (3, 3)."""
    way = of.behind + np.einsum("ki,ij,kj->k", of.load, C, of.load)
    return np.asarray(stroke / way[:, None])
