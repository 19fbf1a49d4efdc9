"""The set-up of a stiffness experiment: its file, measured slopes, and the readings of its sensors
under load.

The model of Section VI is linear and static. An actuator force F along the unit vector n at a point
r from the platform's centre is the load `w = (n_x, n_y, r_x n_y - r_y n_x)` per newton. With the
compliance C (3, 3) it needs

    stroke = F (1/k_actuator + 1/k_sensor) + [pole at the force] + [bar at the force] + w^T C w F

A displacement sensor along n at a point s reads `g^T C w F`, `g = (n, s x n)`, and the terms in
brackets if it sits on the pole. The rotation is the difference of two readings at both ends of the
bar over their distance. The unloaded one of x and y is free, so `1/C_xx` is measured, not `K_xx`.
The moment is taken as force times arm: the offset of the pole causes a first-order error of the
slope in theta. The pole is a Timoshenko cantilever (shear 10/9), the bar a Bernoulli beam.
Out-of-plane tilt, contacts, friction, hysteresis and drift are not modelled."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from flexfem.arrays import Array, Index, direction
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import (
    Angle,
    Coordinate,
    ForceReading,
    Length,
    Modulus,
    Poisson,
    Rate,
    Reading,
    Spring,
    Stroke,
    Torsion,
)
from flexfem.files.refusals import checked_path, place_of, refusal
from flexfem.files.tables import Label, Table
from flexfem.files.toml import KINDS, read_toml, validate
from flexfem.refused import BadInput

SHEAR = 10 / 9  # shear coefficient of a round section, by the energy of the parabolic shear stress
POINTS = 100_000  # largest number of readings in one direction, repeats included
MEASURED = (
    "One or more measured slopes, each with its standard deviation if that is known. They are "
    "compared with the reciprocal of the compliance, because the other directions are free under "
    "each load"
)


def _slope(
    key: str,
    description: str,
    example: float,
) -> Any:
    return Field(
        default=None,
        alias=key,
        description=description,
        examples=[example],
    )


class MeasuredSlopes(Table):
    """One or more measured slopes, N/mm and N mm/rad, each with its standard deviation if that is
    known.
    """

    kxx: Spring | None = _slope("kxx_n_per_mm", "Slope under a force in x", 1480.0)
    kxx_sd: Spring | None = _slope(
        "kxx_sd_n_per_mm", "Standard deviation of `kxx_n_per_mm`, less than the slope", 12.0
    )
    kyy: Spring | None = _slope("kyy_n_per_mm", "Slope under a force in y", 1490.0)
    kyy_sd: Spring | None = _slope(
        "kyy_sd_n_per_mm", "Standard deviation of `kyy_n_per_mm`, less than the slope", 12.0
    )
    ktt: Torsion | None = _slope(
        "ktt_n_mm_per_rad", "Moment over rotation under a force on the bar", 1.1e6
    )
    ktt_sd: Torsion | None = _slope(
        "ktt_sd_n_mm_per_rad",
        "Standard deviation of `ktt_n_mm_per_rad`, less than the slope",
        1.5e4,
    )

    @model_validator(mode="after")
    def _check_standard_deviations(self) -> MeasuredSlopes:
        keys = ("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad")
        if np.all(np.isnan(self.slopes[0])):
            raise refusal(f"one or more of {', '.join(keys)}")
        for key, value, sd in zip(keys, *self.slopes, strict=True):
            if not (np.isnan(sd) or sd < value):
                raise refusal(
                    f"{key} {'with' if np.isnan(value) else 'larger than'} it",
                    f"{key[:3]}_sd{key[3:]}",
                )
        return self

    @property
    def slopes(self) -> Array:
        """Slopes in x, y, theta and their standard deviations (2, 3), nan where not given: N/mm, N
        mm/rad.
        """
        values = [
            [getattr(self, f"{name}{end}") for name in ("kxx", "kyy", "ktt")] for end in ("", "_sd")
        ]
        return np.array(values, dtype=float)


class PoleCompliance(NamedTuple):
    """Compliance of a pole, mm/N: end under the push, end under a force there, pushed point;
    torsion, rad/(N mm).
    """

    read: float
    end: float
    pushed: float
    torsion: float


class Pole(Table):
    """A round pole clamped upright on the platform; mm, MPa."""

    diameter: Length = Field(
        alias="diameter_mm", description="Diameter of the pole", examples=[10.0]
    )
    height: Length = Field(alias="height_mm", examples=[40.0])
    """Height of the end of the pole, which carries the bar and is the target of the LVDTs"""
    push_height: Length | None = Field(
        default=None,
        alias="push_height_mm",
        examples=[30.0],
    )
    """Height of the actuator force in x and y; by default the end of the pole"""
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa", examples=[206.0])
    """Young's modulus of the pole"""
    poissons_ratio: Poisson = Field(description="Poisson's ratio of the pole", examples=[0.3])
    offset: tuple[Coordinate, Coordinate] = Field(
        default=(0.0, 0.0), alias="offset_mm", examples=[[0.5, -0.3]]
    )
    """x, y of the pole from the platform's centre; with an offset the moment about the centre is
    not force times arm
    """

    @model_validator(mode="after")
    def _check_push_height(self) -> Pole:
        if self.pushed_at > self.height:
            raise refusal(f"at most the height of the pole, {self.height:g}", "push_height_mm")
        return self

    @property
    def pushed_at(self) -> float:
        """Height of the actuator force, mm."""
        return self.height if self.push_height is None else self.push_height

    @property
    def compliance(self) -> PoleCompliance:
        """Compliance as a Timoshenko cantilever."""
        E = self.youngs_modulus
        G = self.youngs_modulus / (2 * (1 + self.poissons_ratio))
        d = self.diameter
        second = np.pi * d**4 / 64
        A = np.pi * d**2 / 4
        h = self.height
        pushed = self.pushed_at

        def bent(low: float, high: float) -> float:
            return float(low**2 * (3 * high - low) / (6 * E * second) + SHEAR * low / (G * A))

        return PoleCompliance(
            bent(pushed, h), bent(h, h), bent(pushed, pushed), float(h / (G * 2 * second))
        )


class Bar(Table):
    """A horizontal bar on the pole's end, loaded at right angles at `arm`, mm, from the pole."""

    arm: Length = Field(alias="arm_mm", examples=[50.0])
    """Distance from the pole to the force, which acts at right angles to the bar"""
    angle: Angle = Field(
        default=0.0,
        alias="angle_deg",
        examples=[30.0],
    )
    """Angle of the bar from the x axis"""
    width: Length = Field(alias="width_mm", examples=[12.0])
    """Side of the section in the plane of bending"""
    thickness: Length = Field(
        alias="thickness_mm", description="Other side of the section", examples=[8.0]
    )
    youngs_modulus: Modulus = Field(alias="youngs_modulus_gpa", examples=[206.0])
    """Young's modulus of the bar"""

    @property
    def compliance(self) -> float:
        """Deflection relative to the pole at the force, mm/N; the opposite half stays straight."""
        return 4 * self.arm**3 / (self.youngs_modulus * self.thickness * self.width**3)


class Pusher(Table):
    """The actuator: stroke, mm, and stiffness, N/mm."""

    name: Label = Field(description="Name of the actuator", examples=["P-841.30"])
    stroke: Stroke = Field(
        alias="stroke_um",
        description="Largest stroke",
        examples=[45.0],
    )
    stiffness: Rate = Field(alias="stiffness_n_per_um", examples=[19.0])
    """Stiffness; like that of the sensor it affects the force per stroke but no slope"""


class Lvdt(Table):
    """Displacement sensors on the ground: standard deviation and step of a reading, mm."""

    at: Literal["pole", "platform"] = "pole"
    """Target of the sensors: the `pole` and the bar on it, or the `platform`, whose readings
    exclude the pole; rotation is the difference of two readings at both ends of the bar """
    noise: Reading = Field(
        alias="noise_um", description="Standard deviation of a reading", examples=[0.05]
    )
    resolution: Reading = Field(
        default=0.0,
        alias="resolution_um",
        examples=[0.01],
    )
    """Step of a reading, 0 for none"""


class ForceSensor(Table):
    """The force/torque sensor that carries the actuator: noise and step, N; stiffness, N/mm, None
    for rigid.
    """

    stiffness: Rate | None = Field(
        default=None,
        alias="stiffness_n_per_um",
        examples=[10.0],
    )
    """Stiffness of the sensor and its support; by default rigid"""
    noise: ForceReading = Field(
        alias="noise_n", description="Standard deviation of a reading", examples=[0.02]
    )
    resolution: ForceReading = Field(
        default=0.0,
        alias="resolution_n",
        examples=[0.005],
    )
    """Step of a reading, 0 for none"""


class Run(Table):
    """Commands, `repeats` times `increments` of the stroke from rest, mm each, seed of the noise,
    confidence level.
    """

    increments: int = Field(
        ge=2, le=10_000, description="Number of increments from rest", examples=[20]
    )
    increment: Stroke = Field(alias="increment_um", examples=[2.0])
    """Size of an increment; all increments together must be within the stroke of the actuator"""
    repeats: int = Field(
        default=1, ge=1, le=1000, description="Number of times that all strokes are commanded"
    )
    seed: int = Field(
        default=0,
        ge=0,
        le=2**63 - 1,
        description="Seed of the noise",
    )
    confidence_percent: float = Field(
        default=95.0, ge=50, le=99.9, description="Confidence level of the slopes"
    )

    @property
    def strokes(self) -> Array:
        """Commanded strokes (increments + 1,), mm, from rest."""
        return np.asarray(self.increment * np.arange(self.increments + 1.0), dtype=np.float64)


class Fixture(Sourced):
    """The set-up of Section VI, and slopes measured with it if they are known."""

    kind: ClassVar[str] = "fixture file"

    name: Label = Field(description="Name of the set-up", examples=["set-up of Fig. 10"])
    pole: Pole = Field(
        description="Pole upright on the platform, which the actuator loads in x and y"
    )
    bar: Bar = Field(
        description="Bar on the end of the pole, which the actuator loads to apply a moment"
    )
    actuator: Pusher = Field(description="Actuator that loads the pole or the bar")
    lvdt: Lvdt = Field(description="Displacement sensors on the ground")
    sensor: ForceSensor = Field(description="Force/torque sensor on which the actuator is mounted")
    run: Run = Field(description="Commands of a run, and confidence level of the slopes")
    measured: MeasuredSlopes | None = Field(default=None, description=MEASURED)

    @model_validator(mode="after")
    def _check_strokes(self) -> Fixture:
        largest = self.actuator.stroke
        if self.run.strokes[-1] > largest * (1 + 1e-12):
            raise refusal(
                f"increments that end within the stroke of the actuator, {1e3 * largest:g} um",
                "run",
            )
        if self.run.repeats * (self.run.increments + 1) > POINTS:
            raise refusal(f"at most {POINTS} readings of one direction, repeats included", "run")
        return self


class Measurement(Sourced):
    """Measured slopes without a description of the set-up."""

    kind: ClassVar[str] = "measured file"

    name: Label = Field(description="Name of the measurement", examples=["stage 3, first day"])
    measured: MeasuredSlopes = Field(description=MEASURED)


def fixture_of(source: Path | Fixture) -> Fixture:
    """Return a fixture, read from its file if a path is given. Raises BadInput, naming file, line
    and key.
    """
    return source if isinstance(source, Fixture) else validate(Fixture, checked_path(source))


def measured_of(source: Path | Fixture | Measurement) -> Fixture | Measurement:
    """Return a source of measured slopes, or read a file of either kind. Raises BadInput, also if
    it has no slopes.
    """
    if isinstance(source, Fixture | Measurement):
        measurement = source
        place = source.name
    else:
        path = checked_path(source)
        described = set(read_toml(path).data) & set(KINDS["fixture file"])
        measurement = validate(Fixture, path) if described else validate(Measurement, path)
        place = place_of(path)
    if measurement.measured is None:
        raise BadInput(
            "no [measured] slopes, expected kxx_n_per_mm, kyy_n_per_mm or ktt_n_mm_per_rad", place
        )
    return measurement


class Pushes(NamedTuple):
    """The three pushes (actuator forces in x, in y and on the bar) and m displacement sensors; mm,
    N, rad.

    load : (3, 3), load at the platform's centre per newton of each push.   arm : (3,), load reading
    per actuator force.
    fixture : (3,), compliance of actuator, force sensor, pole and bar along each push, mm/N.
    push : (m,), index of the push that each sensor belongs to.   reading : (m, 3), its reading per
    unit pose, mm, rad.
    pole, bar : (m,), their part of the reading, mm per N of the push.   weight : (m,), of the
    sensor in the result."""

    load: Array
    arm: Array
    fixture: Array
    push: Index
    reading: Array
    pole: Array
    bar: Array
    weight: Array

    def stage(self, C: Array) -> Array:
        """Sensor readings (..., m) of stages of compliance C (..., 3, 3) without pole and bar, mm
        per N of the push.
        """
        return np.asarray(np.einsum("mi,...ij,mj->...m", self.reading, C, self.load[self.push]))

    def read(self, displacements: Array) -> Array:
        """Displacements in x, y, theta (..., 3), mm, mm, rad, from the readings of all sensors
        (..., m).
        """
        return np.asarray((self.weight * displacements) @ np.equal.outer(self.push, np.arange(3)))

    def shares(self, C: Array) -> tuple[Array, Array, Array]:
        """Measured compliance of stages (..., 3), of the pole (3,) and of the bar (3,), per N or N
        mm.

        Their sum is the reciprocal of the slope without noise; that of the stage holds for a rigid
        fixture."""
        return (
            self.read(self.stage(C)) / self.arm,
            self.read(self.pole) / self.arm,
            self.read(self.bar) / self.arm,
        )

    def force(
        self,
        C: Array,
        stroke: Array,
    ) -> Array:
        """Actuator force (3, n) of each push, N, at strokes (n,), mm, on a stage of compliance C
        (3, 3).
        """
        compliance = self.fixture + np.einsum("ki,ij,kj->k", self.load, C, self.load)
        return np.asarray(stroke / compliance[:, None])


IDEAL = Pushes(
    np.eye(3),
    np.ones(3),
    np.zeros(3),
    np.arange(3),
    np.eye(3),
    np.zeros(3),
    np.zeros(3),
    np.ones(3),
)


def pushes_of(fixture: Fixture) -> Pushes:
    """Return the pushes and the sensors of a set-up."""
    a = fixture.bar.arm
    p = np.array(fixture.pole.offset)
    along = direction(
        np.array(fixture.bar.angle)
    )  # the force on the bar acts at right angles to it
    unit = np.array([[1.0, 0.0], [0.0, 1.0], *2 * [[-along[1], along[0]]]])
    at = p + np.array([[0.0], [0.0], [a], [-a]]) * along
    reading = np.column_stack([unit, at[:, 0] * unit[:, 1] - at[:, 1] * unit[:, 0]])
    pole_read, pole_end, pole_pushed, twist = fixture.pole.compliance
    bar_bending = fixture.bar.compliance
    on_pole = float(fixture.lvdt.at == "pole")
    actuator = 1 / fixture.actuator.stiffness + 1 / (fixture.sensor.stiffness or np.inf)
    return Pushes(
        load=reading[:3],
        arm=np.array([1.0, 1.0, a]),
        fixture=actuator
        + np.array([pole_pushed, pole_pushed, pole_end + a**2 * twist + bar_bending]),
        push=np.array([0, 1, 2, 2]),
        reading=reading,
        pole=on_pole
        * np.array([pole_read, pole_read, pole_end + a**2 * twist, pole_end - a**2 * twist]),
        bar=on_pole * np.array([0.0, 0.0, bar_bending, 0.0]),
        weight=np.array([1.0, 1.0, 1 / (2 * a), -1 / (2 * a)]),
    )
