"""The set-up of a stiffness experiment: its file, what was measured with it, and what its pushes do to a stage.

Section VI, linear and at rest. Of a push F along the unit vector n at a point r from the platform's centre, with the
load `w = (n_x, n_y, r_x n_y - r_y n_x)` of 1 N there and the compliance C (3, 3), the sensors read what is in brackets:

    stroke = F (1/k_actuator + 1/k_sensor) + [pole at the push] + [bar at the push] + w^T C w F

A sensor along n at a point s reads `g^T C w F`, `g = (n, s x n)`, and what pole and bar add there where it reads them;
rotation is the difference of two, at both ends of the bar, over their distance. x and y are free while the other is
pushed: measured is `1/C_xx`, not `K_xx`. The moment is taken to be the force times the arm: what the pole's offset adds
is an error of the slope in theta of the first order. The pole is Timoshenko's cantilever (shear 10/9), the bar
Bernoulli's. Not in it: out-of-plane tilt, contacts, friction, hysteresis and drift.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from flexfem.arrays import Array, Index
from flexfem.files import quantities
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import checked_path, place_of, refusal
from flexfem.files.toml import KINDS, Label, read_toml, validate
from flexfem.mechanism.actuators import Coordinate, Rate, Stroke
from flexfem.mechanism.designs import direction
from flexfem.mechanism.dimensioned import Angle, Dimensioned, Length, Modulus, Poisson, in_unit
from flexfem.refused import BadInput

SHEAR = 10 / 9  # of a round section: energy of the parabolic shear stress of beam theory
POINTS = 100_000  # readings of one direction, repeats included
Spring: TypeAlias = Annotated[float, *quantities.above_zero(quantities.SPRING)]
Torsion: TypeAlias = Annotated[float, *quantities.above_zero(quantities.TORSION)]
Reading: TypeAlias = Annotated[float, *quantities.from_zero(quantities.READING), *in_unit("um")]
Newton: TypeAlias = Annotated[float, *quantities.from_zero(quantities.READING)]
MEASURED = (
    "Measured slopes, one or more, each with its standard deviation where that is known. They are compared with the "
    "reciprocal of the compliance: a push leaves the other directions free"
)


def _slope(key: str, description: str, example: float) -> Any:
    return Field(default=None, alias=key, description=description, examples=[example])


class MeasuredSlopes(Dimensioned):
    """Measured slopes, N/mm and N mm/rad, one or more, each with its standard deviation if that is known."""

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
        keys = ("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad")
        if np.all(np.isnan(self.slopes[0])):
            raise refusal(f"one or more of {', '.join(keys)}")
        for key, value, sd in zip(keys, *self.slopes, strict=True):
            if not (np.isnan(sd) or sd < value):
                least = "with it" if np.isnan(value) else "larger than it"
                raise refusal(f"{key} {least}", f"{key[:3]}_sd{key[3:]}")
        return self

    @property
    def slopes(self) -> Array:
        """Slopes in x, y, theta and their standard deviations (2, 3), nan where not given: N/mm, N mm/rad."""
        found = [[getattr(self, f"{name}{end}") for name in ("kxx", "kyy", "ktt")] for end in ("", "_sd")]
        return np.array(found, dtype=float)


class Pole(Dimensioned):
    """A round pole, clamped upright on the platform; mm, MPa."""

    diameter: Length = Field(alias="diameter_mm", description="Of its section", examples=[10.0])
    height: Length = Field(alias="height_mm", examples=[40.0])
    """Of its end, which bears the bar and is what LVDTs read"""
    push_height: Length | None = Field(default=None, alias="push_height_mm", examples=[30.0])
    """Where the actuator pushes it in X and Y; by default at its end"""
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa", examples=[206.0])
    """Young's modulus of the pole"""
    poissons_ratio: Poisson = Field(description="Poisson's ratio of the pole", examples=[0.3])
    offset: tuple[Coordinate, Coordinate] = Field(default=(0.0, 0.0), alias="offset_mm", examples=[[0.5, -0.3]])
    """x, y of its axis from the platform's centre: the moment about the centre is then not force times arm"""

    @model_validator(mode="after")
    def _pushed_below_its_end(self) -> Pole:
        if self.pushed_at > self.height:
            raise refusal(f"at most the height of the pole, {self.height:g}", "push_height_mm")
        return self

    @property
    def pushed_at(self) -> float:
        """Height of the push, mm."""
        return self.height if self.push_height is None else self.push_height


class Bar(Dimensioned):
    """A horizontal bar on the pole's end, pushed at right angles at `arm`, mm, from the pole."""

    arm: Length = Field(alias="arm_mm", examples=[50.0])
    """From the pole to the push, which is at right angles to the bar"""
    angle: Angle = Field(default=0.0, alias="angle_deg", examples=[30.0])
    """Direction of the bar, from the x axis"""
    width: Length = Field(alias="width_mm", examples=[12.0])
    """Of its section, in the plane in which it bends"""
    thickness: Length = Field(alias="thickness_mm", description="Of its section, the other side", examples=[8.0])
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa", examples=[206.0])
    """Young's modulus of the bar"""


class Pusher(Dimensioned):
    """The actuator that pushes: stroke, mm, and stiffness, N/mm."""

    name: Label = Field(description="Which it is", examples=["P-841.30"])
    stroke: Stroke = Field(alias="stroke_um", description="The largest", examples=[45.0])
    stiffness: Rate = Field(alias="stiffness_n_per_um", examples=[19.0])
    """Costs force per stroke, and changes no slope; so does that of the sensor"""


class Lvdt(Dimensioned):
    """Displacement sensors on the ground: standard deviation of a reading and its step, mm."""

    at: Literal["pole", "platform"] = "pole"
    """What they read: `pole`, and the bar on it, or `platform`, which leaves the pole out of the readings; rotation is
    the difference of two of them, at both ends of the bar"""
    noise: Reading = Field(alias="noise_um", description="Standard deviation of a reading", examples=[0.05])
    resolution: Reading = Field(default=0.0, alias="resolution_um", examples=[0.01])
    """Step of a reading, 0 for none"""


class ForceSensor(Dimensioned):
    """The force/torque sensor that the actuator is rooted in: noise and step, N; stiffness, N/mm, None for rigid."""

    stiffness: Rate | None = Field(default=None, alias="stiffness_n_per_um", examples=[10.0])
    """Of the sensor and of what carries it; by default rigid"""
    noise: Newton = Field(alias="noise_n", description="Standard deviation of a reading", examples=[0.02])
    resolution: Newton = Field(default=0.0, alias="resolution_n", examples=[0.005])
    """Step of a reading, 0 for none"""


class Run(Dimensioned):
    """What is commanded: `increments` of the stroke, mm each, from rest, `repeats` times; and how slopes are judged."""

    increments: int = Field(ge=2, le=10_000, description="How many strokes, from rest", examples=[20])
    increment: Stroke = Field(alias="increment_um", examples=[2.0])
    """Of the stroke; all of them within that of the actuator"""
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


def fixture_of(source: Path | Fixture) -> Fixture:
    """A fixture, or that of a file. Raises BadInput, naming file, line and key."""
    return source if isinstance(source, Fixture) else validate(Fixture, checked_path(source))


def measured_of(source: Path | Fixture | Measurement) -> Fixture | Measurement:
    """What gives measured slopes, or that of a file of either kind. Raises BadInput, also where there are none."""
    if isinstance(source, Fixture | Measurement):
        found = source
    else:
        path = checked_path(source)
        described = set(read_toml(path).data) & set(KINDS["fixture file"])
        found = validate(Fixture, path) if described else validate(Measurement, path)
    if found.measured is None:
        place = found.name if found is source else place_of(path)
        raise BadInput("no [measured] slopes, expected kxx_n_per_mm, kyy_n_per_mm or ktt_n_mm_per_rad", place)
    return found


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

    def stage(self, C: Array) -> Array:
        """What every sensor reads of stages of compliance C (..., 3, 3): (..., m), mm per N of its push."""
        return np.asarray(np.einsum("mi,...ij,mj->...m", self.reading, C, self.load[self.push]))

    def read(self, displacements: Array) -> Array:
        """Displacements in x, y, theta (..., 3), mm, mm, rad, of those of all sensors (..., m)."""
        return np.asarray((self.weight * displacements) @ np.equal.outer(self.push, np.arange(3)))

    def shares(self, C: Array) -> tuple[Array, Array, Array]:
        """Displacement read over load read: of stages (..., 3), of the pole (3,) and of the bar (3,), per N or N mm.

        Together one over the slope without noise; that of the stage is what is read on a rigid fixture.
        """
        stage, pole, bar = (self.read(each) / self.arm for each in (self.stage(C), self.pole, self.bar))
        return stage, pole, bar

    def force(self, C: Array, stroke: Array) -> Array:
        """Force (3, n) of each push, N, at strokes (n,), mm, on a stage of compliance C (3, 3)."""
        way = self.behind + np.einsum("ki,ij,kj->k", self.load, C, self.load)
        return np.asarray(stroke / way[:, None])


IDEAL = Pushes(np.eye(3), np.ones(3), np.zeros(3), np.arange(3), np.eye(3), np.zeros(3), np.zeros(3), np.ones(3))


def pushes_of(fixture: Fixture) -> Pushes:
    """The pushes of a set-up and its sensors."""
    a, p = fixture.bar.arm, np.array(fixture.pole.offset)
    b = direction(np.array(fixture.bar.angle))  # along the bar; pushed at right angles to it
    unit = np.array([[1.0, 0.0], [0.0, 1.0], *2 * [[-b[1], b[0]]]])
    at = p + np.array([[0.0], [0.0], [a], [-a]]) * b
    reading = np.column_stack([unit, at[:, 0] * unit[:, 1] - at[:, 1] * unit[:, 0]])
    read, end, own, twist = pole_compliance(fixture.pole)
    bent, seen = bar_compliance(fixture.bar), float(fixture.lvdt.at == "pole")
    drive = 1 / fixture.actuator.stiffness + 1 / (fixture.sensor.stiffness or np.inf)
    return Pushes(
        load=reading[:3],
        arm=np.array([1.0, 1.0, a]),
        behind=drive + np.array([own, own, end + a**2 * twist + bent]),
        push=np.array([0, 1, 2, 2]),
        reading=reading,
        pole=seen * np.array([read, read, end + a**2 * twist, end - a**2 * twist]),
        bar=seen * np.array([0.0, 0.0, bent, 0.0]),
        weight=np.array([1.0, 1.0, 1 / (2 * a), -1 / (2 * a)]),
    )


class PoleCompliance(NamedTuple):
    """Deflection, mm/N, of a pole's end by the push and by a force there, of the pushed point; torsion, rad/(N mm)."""

    read: float
    end: float
    pushed: float
    torsion: float


def pole_compliance(pole: Pole) -> PoleCompliance:
    """Compliance of a pole."""
    E, G = pole.youngs_modulus, pole.youngs_modulus / (2 * (1 + pole.poissons_ratio))
    second, A = np.pi * pole.diameter**4 / 64, np.pi * pole.diameter**2 / 4

    def bent(low: float, high: float) -> float:
        return float(low**2 * (3 * high - low) / (6 * E * second) + SHEAR * low / (G * A))

    h, pushed = pole.height, pole.pushed_at
    return PoleCompliance(bent(pushed, h), bent(h, h), bent(pushed, pushed), float(h / (G * 2 * second)))


def bar_compliance(bar: Bar) -> float:
    """Deflection, mm/N, of a bar at the push, less that of the pole; its other side stays straight."""
    return 4 * bar.arm**3 / (bar.youngs_modulus * bar.thickness * bar.width**3)
