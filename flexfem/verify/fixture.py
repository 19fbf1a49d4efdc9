"""The set-up of a stiffness experiment as a file describes it, and what was measured with one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from flexfem.arrays import Array
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, read_toml, validate
from flexfem.stage.actuators import Coordinate, Rate, Stroke
from flexfem.stage.inside import Angle, Dimensioned, Length, Modulus, at_least, converted

POINTS = 100_000  # readings of one direction, repeats included

Reading: TypeAlias = Annotated[float, Field(ge=0, le=1e3), *converted(lambda um: 1e-3 * um, lambda mm: mm / 1e-3)]
Newton: TypeAlias = Annotated[float, Field(ge=0, le=1e3)]
Spring: TypeAlias = Annotated[float, Field(gt=0, le=1e9), at_least(1e-6)]
Torsion: TypeAlias = Annotated[float, Field(gt=0, le=1e12), at_least(1e-3)]


class Pole(Dimensioned):
    """A round pole, clamped upright on the platform at `offset` (x, y), mm, from its centre.

    diameter, height, youngs_modulus, poissons_ratio : of a prismatic one; the bar is at its end, and what reads the
        pole reads there. It is pushed at `push_height`, by default at its end.
    bending_stiffness, torsional_stiffness : instead, N/mm and N mm/rad, of its end, where it is pushed and read.
    """

    diameter: Length | None = Field(default=None, alias="diameter_mm")
    height: Length | None = Field(default=None, alias="height_mm")
    push_height: Length | None = Field(default=None, alias="push_height_mm")
    youngs_modulus: Modulus | None = Field(default=None, alias="youngs_modulus_gpa")
    poissons_ratio: float | None = Field(default=None, ge=0, lt=0.5)
    bending_stiffness: Spring | None = Field(default=None, alias="bending_stiffness_n_per_mm")
    torsional_stiffness: Torsion | None = Field(default=None, alias="torsional_stiffness_n_mm_per_rad")
    offset: tuple[Coordinate, Coordinate] = Field(default=(0.0, 0.0), alias="offset_mm")

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
    """A horizontal bar on the pole's end, pushed at right angles at `arm` from the pole, `angle` from the x axis.

    width, thickness, youngs_modulus : of a rectangular one, its width in the plane in which it bends.
    stiffness : instead, N/mm, at the push.   Neither : rigid.
    """

    arm: Length = Field(alias="arm_mm")
    angle: Angle = Field(default=0.0, alias="angle_deg")
    width: Length | None = Field(default=None, alias="width_mm")
    thickness: Length | None = Field(default=None, alias="thickness_mm")
    youngs_modulus: Modulus | None = Field(default=None, alias="youngs_modulus_gpa")
    stiffness: Spring | None = Field(default=None, alias="stiffness_n_per_mm")

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

    name: Label
    stroke: Stroke = Field(alias="stroke_um")
    stiffness: Rate = Field(alias="stiffness_n_per_um")


class Lvdt(Dimensioned):
    """Displacement sensors on the ground: standard deviation of a reading and its step, mm.

    at : whether they read the pole (and the bar on it) or the platform itself.
    rotation : from the difference of two of them, at both ends of the bar, or from one of them over its arm, which
        takes what the pole is translated for rotation.
    arm : of those that read rotation, mm; default that of the push.
    """

    at: Literal["pole", "platform"] = "pole"
    rotation: Literal["both ends", "one end"] = "both ends"
    arm: Length | None = Field(default=None, alias="arm_mm")
    noise: Reading = Field(alias="noise_um")
    resolution: Reading = Field(default=0.0, alias="resolution_um")


class ForceSensor(Dimensioned):
    """The force/torque sensor that the actuator is rooted in: standard deviation of a reading and its step, N.

    stiffness : of it and of what carries it, N/mm; None for rigid.
    """

    stiffness: Rate | None = Field(default=None, alias="stiffness_n_per_um")
    noise: Newton = Field(alias="noise_n")
    resolution: Newton = Field(default=0.0, alias="resolution_n")


class Run(Dimensioned):
    """What is commanded: `increments` of the stroke, mm each, from rest, `repeats` times; and how slopes are judged."""

    increments: int = Field(ge=2, le=10_000)
    increment: Stroke = Field(alias="increment_um")
    repeats: int = Field(default=1, ge=1, le=1000)
    seed: int = Field(default=0, ge=0, le=2**63 - 1)
    confidence_percent: float = Field(default=95.0, ge=50, le=99.9)

    @property
    def strokes(self) -> Array:
        """Commanded strokes (increments + 1,), mm, from rest."""
        return np.asarray(self.increment * np.arange(self.increments + 1.0), dtype=np.float64)


class Slopes(NamedTuple):
    """Measured slopes (3,) in x, y, theta and their standard deviations, nan where not given: N/mm, N mm/rad."""

    value: Array
    sd: Array


class MeasuredSlopes(Dimensioned):
    """Measured slopes, N/mm and N mm/rad, one or more, each with its standard deviation if that is known."""

    kxx: Spring | None = Field(default=None, alias="kxx_n_per_mm")
    kxx_sd: Spring | None = Field(default=None, alias="kxx_sd_n_per_mm")
    kyy: Spring | None = Field(default=None, alias="kyy_n_per_mm")
    kyy_sd: Spring | None = Field(default=None, alias="kyy_sd_n_per_mm")
    ktt: Torsion | None = Field(default=None, alias="ktt_n_mm_per_rad")
    ktt_sd: Torsion | None = Field(default=None, alias="ktt_sd_n_mm_per_rad")

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


class Fixture(Dimensioned, Sourced):
    """The set-up of Section VI, and what was measured with it where that is known."""

    kind: ClassVar[str] = "fixture file"

    name: Label
    pole: Pole
    bar: Bar
    actuator: Pusher
    lvdt: Lvdt
    sensor: ForceSensor
    run: Run
    measured: MeasuredSlopes | None = None

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

    name: Label
    measured: MeasuredSlopes


def read_fixture(path: str | os.PathLike[str]) -> Fixture:
    """Read a fixture file. Raises BadInput, naming file, line and key."""
    return validate(Fixture, path)


def read_measured(path: str | os.PathLike[str]) -> Fixture | Measurement:
    """Read a file that gives measured slopes, of either kind. Raises BadInput, naming file, line and key."""
    described = set(read_toml(Path(path)).data) & {"pole", "bar", "lvdt", "sensor", "run"}
    return validate(Fixture, path) if described else validate(Measurement, path)
