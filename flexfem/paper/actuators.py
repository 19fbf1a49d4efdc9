"""Actuators of a stage file: piezo stacks, single or in antagonistic pairs, and their contacts."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, field_validator, model_validator

from flexfem.arrays import AnyArray, Array
from flexfem.files import quantities
from flexfem.files.quantities import Modulus
from flexfem.files.refusals import refusal
from flexfem.files.tables import one_form
from flexfem.mechanism.actuators import BLOCKING_ROUND_OFF, RatedActuator

# bearing steel, E in MPa and Poisson's ratio: assumed for balls and ends of stacks
STEEL = (206e3, 0.3)

Body: TypeAlias = Literal["frame", "link 1", "link 2", "platform"]
HingeName: TypeAlias = Literal["base", "elbow", "platform"]
HINGE_NAMES: tuple[HingeName, HingeName, HingeName] = ("base", "elbow", "platform")
BODY_NAMES: tuple[Body, ...] = get_args(Body)
ENDS: dict[str, tuple[HingeName, HingeName]] = {
    "link 1": ("base", "elbow"),
    "link 2": ("elbow", "platform"),
}
OF_BALLS = ("ball_loose", "ball_youngs_modulus", "ball_poissons_ratio")


class ActuatorNumbers(NamedTuple):
    """Numbers of actuators (...) in inside units, as in `Actuator`.

    They are nan if not stated. x and y belong to `point`.
    """

    arm: AnyArray
    tilt: AnyArray
    x: AnyArray
    y: AnyArray
    direction: AnyArray
    stroke: AnyArray
    stiffness: AnyArray
    blocking_force: AnyArray
    contact_stiffness: AnyArray
    ball_radius: AnyArray
    ball_youngs_modulus: AnyArray
    ball_poissons_ratio: AnyArray
    preload: AnyArray


GEOMETRY = ActuatorNumbers._fields[:5]  # position and direction of the contact


def series_stiffness(
    numbers: ActuatorNumbers,
    stack: ArrayLike,
    E: ArrayLike,
    nu: ArrayLike,
    loose: ArrayLike = False,
) -> Array:
    """Stiffness (...), N/mm, of stacks of stiffness `stack` (...) in series with their contacts on
    a body (E, nu).

    loose : (...), bool, whether the ball also touches a steel end of the stack.
    """
    stated = (numbers.ball_youngs_modulus, numbers.ball_poissons_ratio)
    ball = tuple(
        np.where(np.isnan(value), steel, value) for value, steel in zip(stated, STEEL, strict=True)
    )
    without_ball = np.where(np.isnan(numbers.contact_stiffness), np.inf, numbers.contact_stiffness)
    on_body, on_steel = (
        hertz(numbers.ball_radius, numbers.preload, ball, flat) for flat in ((E, nu), STEEL)
    )
    contact = np.where(np.isnan(numbers.ball_radius), without_ball, on_body)
    return np.asarray(
        1 / (1 / np.asarray(stack) + 1 / contact + np.where(loose, 1 / on_steel, 0.0))
    )


def hertz(
    radius: ArrayLike, force: ArrayLike, ball: tuple[Any, ...], flat: tuple[Any, ...]
) -> Array:
    """Contact stiffness (...), N/mm, of a ball (E, nu) of `radius` mm pressed on a flat (E, nu) by
    `force` N.

    The approach is `(9 F^2 / (16 R E*^2))^(1/3)` and the stiffness dF/d(approach) is `(6 R E*^2
    F)^(1/3)`, with `1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2`: K. L. Johnson, Contact Mechanics,
    1985, (4.23).
    """
    modulus = 1 / sum((1 - nu**2) / E for E, nu in (ball, flat))
    return np.asarray((6 * np.asarray(radius) * modulus**2 * np.asarray(force)) ** (1 / 3))


class Actuator(RatedActuator):
    """One stack, or an antagonistic pair, at the same position on every chain; mm, N, rad."""

    between: tuple[Body, Body] = Field(
        examples=[["frame", "link 1"]], json_schema_extra={"uniqueItems": True}
    )
    """The body that carries the stack, and the body on which the stack acts"""
    hinge: HingeName | None = None
    """For a contact on a link: the hinge at one end of the link from which `arm_mm` is measured"""
    arm: quantities.Length | None = Field(
        default=None,
        alias="arm_mm",
        examples=[10.0],
    )
    """Distance of the contact from the neck of `hinge`, measured along the centreline of the link,
    bends included
    """
    side: Literal["left", "right"] | None = None
    """Side of the link, seen from the base, on which the contact is"""
    tilt: quantities.Tilt | None = Field(
        default=None,
        alias="tilt_deg",
        examples=[5.0],
    )
    """Rotation of the force from the inward normal of the link, counter-clockwise; zero by default
    """
    point: tuple[quantities.Coordinate, quantities.Coordinate] | None = Field(
        default=None, alias="point_mm", examples=[[-40.0, 12.0]]
    )
    """Alternative to `hinge`, `arm_mm` and `side`: x, y of a contact anywhere on the outline of the
    body, in the frame of chain 1, whose origin is the platform centre """
    direction: quantities.Angle | None = Field(
        default=None,
        alias="direction_deg",
        examples=[90.0],
    )
    """With `point_mm`: direction of the force on the body, counter-clockwise from the x axis of
    chain 1
    """
    pair: bool = False
    """Whether a second stack acts on the opposite side of the body along the same line; the two are
    commanded in opposite senses about half their stroke """
    contact_stiffness: quantities.Rate | None = Field(
        default=None, alias="contact_stiffness_n_per_um", examples=[40.0]
    )
    """Stiffness of the contact, instead of a ball; without either the contact is rigid"""
    ball_radius: quantities.Length | None = Field(
        default=None, alias="ball_radius_mm", examples=[2.0]
    )
    """Radius of a ball between stack and body; Hertzian contact on the stage's material, linearized
    at the preload
    """
    ball_loose: bool | None = Field(default=None, examples=[True])
    """Whether the ball lies between two flats, the body and a steel end of the stack: two contacts
    in series, and the steel of the end is reported as assumed. By default the ball is fixed to the
    stack, like a domed tip: one contact, which is reported as assumed unless the key is stated """
    ball_youngs_modulus: Modulus | None = Field(
        default=None, alias="ball_youngs_modulus_gpa", examples=[206.0]
    )
    """Young's modulus of the ball; by default that of steel, which is reported as assumed"""
    ball_poissons_ratio: quantities.Poisson | None = Field(default=None, examples=[0.3])
    """Poisson's ratio of the ball; by default that of steel, which is reported as assumed"""
    preload: quantities.ForceOrZero = Field(
        default=0.0,
        alias="preload_n",
        examples=[50.0],
    )
    """Force of every stack at rest, at most its blocking force. A contact transmits compression
    only and opens when the preload is used up. The preloads of a pair balance each other; that of a
    single stack stresses the necks """
    friction: quantities.Friction | None = Field(default=None, examples=[0.15])
    """Coefficient of Coulomb friction at the contact, for which `flexfem drive` reports the
    uncertainty of the pose; by default none is reported """

    @field_validator("between")
    @classmethod
    def _two_bodies(cls, between: tuple[Body, Body]) -> tuple[Body, Body]:
        if between[0] == between[1]:
            raise refusal("two bodies: the one that carries the stack and the one that it pushes")
        if between[1] == "frame":
            raise refusal(
                "a moving body in second place, the one that is pushed; the frame comes first"
            )
        return between

    @model_validator(mode="after")
    def _keys_go_together(self) -> Actuator:
        one_form(self, ("hinge", "arm", "side"), ("point", "direction"))
        if self.tilt is not None and self.arm is None:
            raise refusal("also hinge, arm_mm and side", "tilt_deg")
        ends = ENDS.get(self.between[1], ())
        if self.hinge is not None and self.hinge not in ends:
            where = (
                f"{' or '.join(ends)}, at an end of {self.between[1]}"
                if ends
                else "point_mm on a platform"
            )
            raise refusal(where, "hinge")
        if self.ball_radius is not None and self.contact_stiffness is not None:
            raise refusal(
                "a ball or the stiffness of the contact, not both", "contact_stiffness_n_per_um"
            )
        for name in OF_BALLS:
            if getattr(self, name) is not None and self.ball_radius is None:
                raise refusal("also ball_radius_mm", type(self).model_fields[name].alias or name)
        if self.ball_radius is not None and self.preload == 0:
            raise refusal(
                "also a preload_n: a ball without preload has no stiffness", "ball_radius_mm"
            )
        blocking_force = self.rating.blocking_force
        if self.preload > blocking_force * (1 + BLOCKING_ROUND_OFF):
            raise refusal(
                f"at most the blocking force of the stack, {blocking_force:g}", "preload_n"
            )
        return self

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of `ActuatorNumbers`; a stack of the catalogue has the catalogue's rating."""
        values = {name: getattr(self, name, None) for name in ActuatorNumbers._fields}
        values["x"], values["y"] = self.point or (None, None)
        if self.stack is not None:
            values["stroke"] = self.rating.stroke
            values["blocking_force"] = self.rating.blocking_force
        return tuple(np.nan if value is None else float(value) for value in values.values())

    @property
    def assumed_of_ball(self) -> list[str]:
        """Properties of the ball that are assumed because the file does not state them.

        The list is empty without a ball.
        """
        if self.ball_radius is None:
            return []
        stated = self.ball_youngs_modulus is not None and self.ball_poissons_ratio is not None
        support = {
            None: ["fixed to the stack"],
            True: ["steel end of the stack"],
            False: list[str](),
        }[self.ball_loose]
        return support if stated else ["steel", *support]

    @property
    def contact(self) -> str:
        """Description of the contact with the driven body."""
        if self.ball_radius is None:
            return (
                "a rigid contact"
                if self.contact_stiffness is None
                else "a contact of stated stiffness"
            )
        if self.ball_loose:
            return "a loose ball, two contacts"
        return (
            "a ball fixed to the stack, one "
            f"contact{', assumed' if self.ball_loose is None else ''}"
        )
