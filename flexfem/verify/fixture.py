"""The set-up of a stiffness experiment as a file describes it, and what was measured with one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from flexfem.arrays import Array
from flexfem.files import quantities
from flexfem.files.json_schema import both, has, ruled, when, without
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import refusal
from flexfem.files.toml import Label, read_toml, validate
from flexfem.mechanism.actuators import Coordinate, Rate, Stroke
from flexfem.mechanism.dimensioned import Angle, Dimensioned, Length, Modulus, Poisson, converted
from flexfem.verify.measured import MEASURED, MeasuredSlopes, Spring, Torsion

POINTS = 100_000  # readings of one direction, repeats included

Reading: TypeAlias = Annotated[
    float, *quantities.from_zero(quantities.READING), *converted(lambda um: 1e-3 * um, lambda mm: mm / 1e-3)
]
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
