"""What a study may ask beside stiffness, stress and size: ranges of a drive, natural frequencies, drift, lives."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import ConfigDict, Field, model_validator

from flexfem.files import quantities
from flexfem.files.json_schema import COUNT, Rule, beside, either, has, ruled, says
from flexfem.files.refusals import refusal
from flexfem.files.toml import Table

Stroke: TypeAlias = Annotated[float, *quantities.above_zero(quantities.COMMAND_UM)]
Length: TypeAlias = Annotated[float, *quantities.above_zero(quantities.LENGTH)]
Mass: TypeAlias = Annotated[float, *quantities.from_zero(quantities.MASS)]
Inertia: TypeAlias = Annotated[float, *quantities.from_zero(quantities.INERTIA)]
Amplitude: TypeAlias = Annotated[float, *quantities.either_sign(quantities.AMPLITUDE)]
Cycles: TypeAlias = Annotated[float, *quantities.above_zero(quantities.CYCLES)]


class DriveQuestion(Table):
    """Which drive a study asks about: the base stage's own actuators, or a stroke that turns the base hinges alone."""

    model_config = ConfigDict(
        json_schema_extra=ruled(
            beside({"stroke_um": ["lever_arm_mm"], "lever_arm_mm": ["stroke_um"]}),
            either(says("actuators", True), has("stroke_um")),
        )
    )

    actuators: bool = Field(
        default=False,
        description="Not with `three_dimensional`: asks about the base stage's own `[[actuator]]` tables, outputs "
        "`drive_range_x_um` and `engaged_kxx_n_per_mm` and their like. Their numbers are then keys, too: "
        "`actuator.base.arm_mm`, and on one chain `override.2.actuator.base.preload_n` (a star for the chain); a "
        "number that the actuator does not state is none. The drive is part of such a study's identity. Contacts on "
        "straight links are placed for all designs at once; on a bent link, or by `point_mm`, every geometry is "
        "drawn, 6 ms each",
    )
    stroke_um: Stroke | None = Field(
        default=None,
        description="Of a piezo: gives the travels, which count the base hinges alone and are no range of a drive",
        examples=[17.4],
    )
    lever_arm_mm: Length | None = Field(
        default=None, description="From the base hinge to where that piezo pushes link 1", examples=[10.0]
    )

    @model_validator(mode="after")
    def _asks_something(self) -> DriveQuestion:
        both = {"stroke_um": self.stroke_um, "lever_arm_mm": self.lever_arm_mm}
        missing = [key for key, value in both.items() if value is None]
        if len(missing) == 1:
            raise refusal(f"stroke_um and lever_arm_mm together: {missing[0]} is missing")
        if missing and not self.actuators:
            raise refusal("actuators = true, or stroke_um and lever_arm_mm")
        return self

    @property
    def rotation(self) -> float | None:
        """Largest rotation of a base hinge, rad; None where no stroke is given."""
        if self.stroke_um is None or self.lever_arm_mm is None:
            return None
        return 1e-3 * self.stroke_um / self.lever_arm_mm


class Frequencies(Table):
    """Natural frequencies of the platform in the plane are asked for, with a payload on it or without."""

    payload_kg: Mass = Field(default=0.0, description="Mass on the platform at its centre", examples=[0.2])
    payload_kg_mm2: Inertia = Field(default=0.0, description="Its moment of inertia about that", examples=[40.0])


class Drifting(Table):
    """Pose by a change of temperature, and the largest by its gradients, are asked for; it has no keys."""


_AMPLITUDES = ("amplitude_x_um", "amplitude_y_um", "amplitude_theta_mrad")


def _not_zero(key: str) -> Rule:
    return {"required": [key], "properties": {key: {"not": {"const": 0}}}}


class Lasting(Table):
    """Fatigue lives are asked for, at an amplitude of the pose about its mean, and the amplitude for a wanted life."""

    model_config = ConfigDict(json_schema_extra=ruled(either(*map(_not_zero, _AMPLITUDES))))

    amplitude_x_um: Amplitude = Field(
        default=0.0, description="Of the pose in x; one of the three or more", examples=[20.0]
    )
    amplitude_y_um: Amplitude = Field(default=0.0, description="Of the pose in y", examples=[20.0])
    amplitude_theta_mrad: Amplitude = Field(default=0.0, description="Of the pose in theta", examples=[0.5])
    ratio: float = Field(
        default=-1.0, ge=-1, le=0.99, description="Least over greatest displacement", json_schema_extra=COUNT
    )
    cycles: Cycles = Field(default=1e6, description="The wanted life", json_schema_extra=COUNT)
    notch_sensitivity: float = Field(
        default=1.0,
        ge=0,
        le=1,
        description="What of the stress concentration counts: 0 nothing, 1 all of it",
        json_schema_extra=COUNT,
    )

    @model_validator(mode="after")
    def _moves(self) -> Lasting:
        if not any(self.moved):
            raise refusal("amplitude_x_um, amplitude_y_um or amplitude_theta_mrad, other than zero")
        return self

    @property
    def amplitude(self) -> tuple[float, float, float]:
        """Amplitude of the pose, mm, mm, rad."""
        return 1e-3 * self.amplitude_x_um, 1e-3 * self.amplitude_y_um, 1e-3 * self.amplitude_theta_mrad

    @property
    def moved(self) -> tuple[bool, ...]:
        """Which directions the amplitude has."""
        return tuple(each != 0 for each in self.amplitude)
