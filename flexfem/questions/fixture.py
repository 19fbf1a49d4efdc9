"""The set-up of a stiffness experiment: its file, what was measured with it, and what its pushes do to a stage.

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

import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from flexfem.arrays import Array, Index
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import Rule, beside, both, either, has, ruled, when, without
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, read_toml, validate
from flexfem.mechanism.actuators import Coordinate, Rate, Stroke
from flexfem.mechanism.designs import direction
from flexfem.mechanism.dimensioned import Angle, Dimensioned, Length, Modulus, Poisson, in_unit

Spring: TypeAlias = Annotated[float, *quantities.above_zero(quantities.SPRING)]
Torsion: TypeAlias = Annotated[float, *quantities.above_zero(quantities.TORSION)]
MEASURED = (
    "Measured slopes, one or more, each with its standard deviation where that is known. They are compared with the "
    "reciprocal of the compliance: a push leaves the other directions free"
)


class Slopes(NamedTuple):
    """Measured slopes (3,) in x, y, theta and their standard deviations, nan where not given: N/mm, N mm/rad."""

    value: Array
    sd: Array


def _slope(key: str, description: str, example: float) -> Any:
    return Field(default=None, alias=key, description=description, examples=[example])


def _one_or_more(schema: Rule) -> None:
    slopes = [key for key in schema["properties"] if "_sd_" not in key]
    deviations = {key: [key.replace("_sd", "")] for key in schema["properties"] if "_sd_" in key}
    schema["allOf"] = [either(*map(has, slopes)), beside(deviations)]


class MeasuredSlopes(Dimensioned):
    """Measured slopes, N/mm and N mm/rad, one or more, each with its standard deviation if that is known."""

    model_config = ConfigDict(json_schema_extra=ruled(also=lambda schema: _one_or_more(schema)))

    kxx: Spring | None = _slope("kxx_n_per_mm", "Slope as pushed in x", 1480.0)
    kxx_sd: Spring | None = _slope("kxx_sd_n_per_mm", "Standard deviation of `kxx_n_per_mm`, less than it", 12.0)
    kyy: Spring | None = _slope("kyy_n_per_mm", "Slope as pushed in y", 1490.0)
    kyy_sd: Spring | None = _slope("kyy_sd_n_per_mm", "Standard deviation of `kyy_n_per_mm`, less than it", 12.0)
    ktt: Torsion | None = _slope("ktt_n_mm_per_rad", "Moment over rotation as pushed at the bar", 1.1e6)
    ktt_sd: Torsion | None = _slope(
        "ktt_sd_n_mm_per_rad", "Standard deviation of `ktt_n_mm_per_rad`, less than it", 1.5e4
    )

    @model_validator(mode="after")
    def _each_with_what_it_is_of(self) -> MeasuredSlopes:
        names = {"kxx": "n_per_mm", "kyy": "n_per_mm", "ktt": "n_mm_per_rad"}
        if all(getattr(self, name) is None for name in names):
            raise refusal(f"one or more of {', '.join(f'{name}_{unit}' for name, unit in names.items())}")
        for name, unit in names.items():
            value, sd = getattr(self, name), getattr(self, f"{name}_sd")
            if sd is not None and (value is None or sd >= value):
                least = "with it" if value is None else "larger than it"
                raise refusal(f"{name}_{unit} {least}", f"{name}_sd_{unit}")
        return self

    @property
    def slopes(self) -> Slopes:
        """Slopes and standard deviations, order x, y, theta."""
        found = [[getattr(self, f"{name}{end}") for name in ("kxx", "kyy", "ktt")] for end in ("", "_sd")]
        return Slopes(*np.array(found, dtype=float))


POINTS = 100_000  # readings of one direction, repeats included

Reading: TypeAlias = Annotated[float, *quantities.from_zero(quantities.READING), *in_unit("um")]
Newton: TypeAlias = Annotated[float, *quantities.from_zero(quantities.READING)]


_DRAWN_POLE = ("diameter_mm", "height_mm", "youngs_modulus_gpa", "poissons_ratio")
_SPRINGS = ("bending_stiffness_n_per_mm", "torsional_stiffness_n_mm_per_rad")
_SPRUNG = both(has(*_SPRINGS), without(*_DRAWN_POLE, "push_height_mm"))
_DRAWN = both(has(*_DRAWN_POLE), without(*_SPRINGS))
_DRAWN_BAR = ("width_mm", "thickness_mm", "youngs_modulus_gpa")


class Pole(Dimensioned):
    """A round pole, clamped upright on the platform; mm, MPa, N/mm and N mm/rad."""

    model_config = ConfigDict(json_schema_extra=ruled(when(has(_SPRINGS[0]), _SPRUNG, _DRAWN)))

    diameter: Length | None = Field(
        default=None, alias="diameter_mm", description="Of a round pole, with its height and metal", examples=[10.0]
    )
    height: Length | None = Field(
        default=None,
        alias="height_mm",
        description="Of its end, which bears the bar and is what LVDTs read",
        examples=[40.0],
    )
    push_height: Length | None = Field(
        default=None,
        alias="push_height_mm",
        description="Where the actuator pushes it in X and Y; by default at its end",
        examples=[30.0],
    )
    youngs_modulus: Modulus | None = Field(
        default=None, alias="youngs_modulus_gpa", description="Young's modulus of the pole", examples=[206.0]
    )
    poissons_ratio: Poisson | None = Field(default=None, description="Poisson's ratio of the pole", examples=[0.3])
    bending_stiffness: Spring | None = Field(
        default=None,
        alias="bending_stiffness_n_per_mm",
        description="Instead of dimensions: of its end, pushed and read there",
        examples=[4800.0],
    )
    torsional_stiffness: Torsion | None = Field(
        default=None,
        alias="torsional_stiffness_n_mm_per_rad",
        description="Instead of dimensions: of its end about its axis",
        examples=[1.9e6],
    )
    offset: tuple[Coordinate, Coordinate] = Field(
        default=(0.0, 0.0),
        alias="offset_mm",
        description="x, y of its axis from the platform's centre: the moment about the centre is then not force "
        "times arm",
        examples=[[0.5, -0.3]],
    )

    @model_validator(mode="after")
    def _by_dimensions_or_by_stiffness(self) -> Pole:
        drawn = {
            "diameter_mm": self.diameter,
            "height_mm": self.height,
            "youngs_modulus_gpa": self.youngs_modulus,
            "poissons_ratio": self.poissons_ratio,
        }
        springs = (self.bending_stiffness, self.torsional_stiffness)
        given = [key for key, value in (drawn | {"push_height_mm": self.push_height}).items() if value is not None]
        if given and springs != (None, None):
            raise refusal("dimensions or stiffnesses of the pole, not both", given[0])
        if None in (drawn.values() if given else springs):
            wanted = "bending_stiffness_n_per_mm and torsional_stiffness_n_mm_per_rad"
            raise refusal(f"{', '.join(drawn)}, or {wanted}")
        if self.push_height is not None and self.height is not None and self.push_height > self.height:
            raise refusal(f"at most the height of the pole, {self.height:g}", "push_height_mm")
        return self

    @property
    def pushed_at(self) -> float | None:
        """Height of the push, mm; None for a pole that is given by its stiffness."""
        return self.height if self.push_height is None else self.push_height


class Bar(Dimensioned):
    """A horizontal bar on the pole's end, pushed at right angles at `arm`, mm, from the pole; `stiffness` in N/mm."""

    model_config = ConfigDict(
        json_schema_extra=ruled(
            when(has("stiffness_n_per_mm"), without(*_DRAWN_BAR), when({"not": without(*_DRAWN_BAR)}, has(*_DRAWN_BAR)))
        )
    )

    arm: Length = Field(
        alias="arm_mm", description="From the pole to the push, which is at right angles to the bar", examples=[50.0]
    )
    angle: Angle = Field(
        default=0.0, alias="angle_deg", description="Direction of the bar, from the x axis", examples=[30.0]
    )
    width: Length | None = Field(
        default=None, alias="width_mm", description="Of its section, in the plane in which it bends", examples=[12.0]
    )
    thickness: Length | None = Field(
        default=None, alias="thickness_mm", description="Of its section, the other side", examples=[8.0]
    )
    youngs_modulus: Modulus | None = Field(
        default=None, alias="youngs_modulus_gpa", description="Young's modulus of the bar", examples=[206.0]
    )
    stiffness: Spring | None = Field(
        default=None,
        alias="stiffness_n_per_mm",
        description="Instead of its section: at the push; without either it is rigid",
        examples=[900.0],
    )

    @model_validator(mode="after")
    def _by_dimensions_or_by_stiffness(self) -> Bar:
        drawn = {"width_mm": self.width, "thickness_mm": self.thickness, "youngs_modulus_gpa": self.youngs_modulus}
        given = [key for key, value in drawn.items() if value is not None]
        if given and self.stiffness is not None:
            raise refusal("dimensions or the stiffness of the bar, not both", given[0])
        if given and len(given) < len(drawn):
            raise refusal(f"{', '.join(drawn)} together", given[0])
        return self


class Pusher(Dimensioned):
    """The actuator that pushes: stroke, mm, and stiffness, N/mm."""

    name: Label = Field(description="Which it is", examples=["P-841.30"])
    stroke: Stroke = Field(alias="stroke_um", description="The largest", examples=[45.0])
    stiffness: Rate = Field(
        alias="stiffness_n_per_um",
        description="Costs force per stroke, and changes no slope; so does that of the sensor",
        examples=[19.0],
    )


class Lvdt(Dimensioned):
    """Displacement sensors on the ground: standard deviation of a reading, its step, and the arm, mm."""

    at: Literal["pole", "platform"] = Field(
        default="pole",
        description="What they read: `pole`, and the bar on it, or `platform`, which leaves the pole out of the "
        "readings",
    )
    rotation: Literal["both ends", "one end"] = Field(
        default="both ends",
        description="From the difference of two of them at both ends of the bar, or from one at one end, which takes "
        "translation for rotation",
    )
    arm: Length | None = Field(
        default=None,
        alias="arm_mm",
        description="How far from the pole those are that read rotation; by default at the push",
        examples=[50.0],
    )
    noise: Reading = Field(alias="noise_um", description="Standard deviation of a reading", examples=[0.05])
    resolution: Reading = Field(
        default=0.0, alias="resolution_um", description="Step of a reading, 0 for none", examples=[0.01]
    )


class ForceSensor(Dimensioned):
    """The force/torque sensor that the actuator is rooted in: noise and step, N; stiffness, N/mm, None for rigid."""

    stiffness: Rate | None = Field(
        default=None,
        alias="stiffness_n_per_um",
        description="Of the sensor and of what carries it; by default rigid",
        examples=[10.0],
    )
    noise: Newton = Field(alias="noise_n", description="Standard deviation of a reading", examples=[0.02])
    resolution: Newton = Field(
        default=0.0, alias="resolution_n", description="Step of a reading, 0 for none", examples=[0.005]
    )


class Run(Dimensioned):
    """What is commanded: `increments` of the stroke, mm each, from rest, `repeats` times; and how slopes are judged."""

    increments: int = Field(ge=2, le=10_000, description="How many strokes, from rest", examples=[20])
    increment: Stroke = Field(
        alias="increment_um", description="Of the stroke; all of them within that of the actuator", examples=[2.0]
    )
    repeats: int = Field(default=1, ge=1, le=1000, description="How often all strokes are commanded")
    seed: int = Field(default=0, ge=0, le=2**63 - 1, description="Of the noise")
    confidence_percent: float = Field(default=95.0, ge=50, le=99.9, description="Of the intervals of slopes")

    @property
    def strokes(self) -> Array:
        """Commanded strokes (increments + 1,), mm, from rest."""
        return np.asarray(self.increment * np.arange(self.increments + 1.0), dtype=np.float64)


class Fixture(Dimensioned, Sourced):
    """The set-up of Section VI, and what was measured with it where that is known."""

    kind: ClassVar[str] = "fixture file"

    name: Label = Field(description="Of the set-up", examples=["set-up of Fig. 10"])
    pole: Pole = Field(description="What is pushed: a pole upright on the platform, by its dimensions or its stiffness")
    bar: Bar = Field(description="What is pushed for a moment: a bar on the end of the pole")
    actuator: Pusher = Field(description="What pushes")
    lvdt: Lvdt = Field(description="Displacement sensors on the ground")
    sensor: ForceSensor = Field(description="Force/torque sensor that the actuator is rooted in")
    run: Run = Field(description="What is commanded, and how slopes are judged")
    measured: MeasuredSlopes | None = Field(default=None, description=MEASURED)

    @model_validator(mode="after")
    def _within_the_stroke(self) -> Fixture:
        most = self.actuator.stroke
        if self.run.strokes[-1] > most * (1 + 1e-12):
            raise refusal(f"increments that end within the stroke of the actuator, {1e3 * most:g} um", "run")
        if self.run.repeats * (self.run.increments + 1) > POINTS:
            raise refusal(f"at most {POINTS} readings of one direction, repeats included", "run")
        return self


class Measurement(Dimensioned, Sourced):
    """Measured slopes alone, without the set-up."""

    kind: ClassVar[str] = "measured file"

    name: Label = Field(description="Of the measurement", examples=["stage 3, first day"])
    measured: MeasuredSlopes = Field(description=MEASURED)


def read_fixture(path: str | os.PathLike[str]) -> Fixture:
    """Read a fixture file. Raises BadInput, naming file, line and key."""
    return validate(Fixture, path)


def read_measured(path: str | os.PathLike[str]) -> Fixture | Measurement:
    """Read a file that gives measured slopes, of either kind. Raises BadInput, naming file, line and key."""
    described = set(read_toml(Path(path)).data) & {"pole", "bar", "lvdt", "sensor", "run"}
    return validate(Fixture, path) if described else validate(Measurement, path)


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
