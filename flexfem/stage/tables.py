"""The tables of a stage: chain, hinges, platform and frame, in N-mm-MPa-rad.

File keys end in their unit; the attributes carry none and hold inside units (the file's degrees become radians).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Literal, TypeAlias, get_args

from pydantic import BaseModel, Field

from flexfem.files.keypath import key_path
from flexfem.files.refusals import shown
from flexfem.refused import BadInput
from flexfem.stage.inside import Angle, Dimensioned, FrameExpansion, Length, plain
from flexfem.stage.materials import with_changes

HingeName: TypeAlias = Literal["base", "elbow", "platform"]
HINGE_NAMES: tuple[HingeName, HingeName, HingeName] = ("base", "elbow", "platform")
Plane: TypeAlias = Literal["plane_stress", "plane_strain", "corrected"]
CHAINS = (1, 2, 3)


class Chain(Dimensioned):
    """Chain 1; the others are turned by 120 and 240 degrees. Lengths in mm, relative angles as in (19) in rad."""

    link_lengths: tuple[Length, Length, Length] = Field(
        alias="link_lengths_mm",
        description="l1 base to elbow hinge, l2 elbow to platform hinge, l3 platform hinge to platform centre",
        examples=[[30.0, 32.0, 24.0]],
    )
    joint_angles: tuple[Angle, Angle, Angle] = Field(
        alias="joint_angles_deg",
        description="phi_1, phi_2, phi_3 at rest, counter-clockwise, each relative to the link before it; the first to "
        "the x axis",
        examples=[[180.0, -90.0, 90.0]],
    )
    link_width: Length = Field(
        alias="link_width_mm", description="Width of links, clamped pads and lugs of the platform", examples=[9.0]
    )


class Hinge(Dimensioned):
    """A circular hinge: cutting `radius` and `neck` in mm; `axis` in rad, None for along the link."""

    radius: Length = Field(alias="radius_mm", description="R of the two circular cuts", examples=[4.0])
    neck: Length = Field(
        alias="neck_mm", description="t, the narrowest width, which the two cuts leave", examples=[0.5]
    )
    prismatic: bool = Field(default=False, description="Whether the model lets it stretch as well as turn")
    axis: Angle | None = Field(
        default=None,
        alias="axis_deg",
        description="Direction of the neck in the frame of chain 1, turned with each chain; by default of base and "
        "elbow hinge along link 1, of the platform hinge along link 2",
        examples=[180.0],
    )


class Hinges(Dimensioned):
    """The three hinges every chain has unless an override says otherwise."""

    base: Hinge = Field(description="The hinge at the clamped pad; link 1 starts here")
    elbow: Hinge = Field(description="The hinge between link 1 and link 2")
    platform: Hinge = Field(description="The hinge between link 2 and the platform")


class Platform(Dimensioned):
    """The platform disc and its rigid hub, where the load acts and the pose is read; radii in mm."""

    radius: Length = Field(alias="radius_mm", description="Of the disc", examples=[17.0])
    hub_radius: Length = Field(
        alias="hub_radius_mm",
        description="Of the hole in it, taken as filled by a rigid disc: loads act there, the pose is read there",
        examples=[8.0],
    )


class Frame(Dimensioned):
    """What the pads are clamped to: coefficient of linear thermal expansion, 1/K; None for that of the stage."""

    expansion: FrameExpansion | None = Field(
        default=None,
        alias="expansion_um_per_m_k",
        description="Coefficient of linear thermal expansion of the frame. Where it is not stated the frame is "
        "assumed to expand as the stage does",
        examples=[12.0],
    )


assert get_args(HingeName) == HINGE_NAMES


OF_HINGES = tuple(Hinge.model_fields)  # attributes that may be given without naming the table


def merged_changes(held: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a changed stage; `held` is its `model_dump`, changes are as `Stage.replace` takes them.

    Raises BadInput for an override that names no hinge or is no table.
    """
    content, given = plain(held), {name: _plain(value) for name, value in changes.items()}
    for name in [name for name in OF_HINGES if name in given]:
        value = given.pop(name)
        by_hinge = value if isinstance(value, dict) else dict.fromkeys(HINGE_NAMES, value)
        content = _merge(content, {"hinges": {hinge: {name: each} for hinge, each in by_hinge.items()}})
    if "material" in given:
        value = given.pop("material")
        named = {"name": value} if isinstance(value, str) else value
        content["material"] = with_changes(content["material"], value) if isinstance(value, dict) else named
    if isinstance(given.get("override"), dict):
        content["override"] = _overridden(content.get("override", []), given.pop("override"))
    return dict(_merge(content, given))


def _overridden(held: list[Any], given: Mapping[Any, Any]) -> list[Any]:
    found = {_place(each): each for each in held}
    for place, values in given.items():
        about = place if isinstance(place, tuple) else (None, place)
        match about:
            case (int(chain), str(hinge)) if chain in CHAINS and hinge in HINGE_NAMES:
                named: dict[str, Any] = {"chain": chain, "hinge": hinge}
            case (int(chain), "actuator", str(name)) if chain in CHAINS:
                named = {"chain": chain, "actuator": name}
            case _:
                names = ", ".join(HINGE_NAMES)
                expected = f'(1, 2 or 3, one of {names}) or (1, 2 or 3, "actuator", its name)'
                raise BadInput(f"override: no hinge {shown(str(place))}, expected {expected}")
        if not isinstance(values, Mapping):
            keys = f", any of {', '.join(OF_HINGES)}" if "hinge" in named else ""
            raise BadInput(f"{key_path(('override', *map(str, about)))} = {shown(values)}, expected a table{keys}")
        found[about] = found.get(about, named) | dict(values)
    return list(found.values())


def _place(override: Mapping[str, Any]) -> tuple[Any, ...]:
    """As `Override.place`, of what a stage holds."""
    if override.get("actuator") is not None:
        return override["chain"], "actuator", override["actuator"]
    return override["chain"], override["hinge"]


def _merge(old: Any, new: Any) -> Any:
    if not isinstance(old, dict) or not isinstance(new, dict):
        return new
    return old | {key: _merge(old.get(key), value) for key, value in new.items()}


def _said(member: Any) -> Any:
    """What a member of an array says; it replaces another whole, so that None says nothing."""
    said = member.model_dump(exclude_unset=True) if isinstance(member, BaseModel) else member
    return {key: each for key, each in said.items() if each is not None} if isinstance(said, Mapping) else said


def _plain(value: Any) -> Any:
    """A table built in Python by its content, which replaces what is held as far as it says anything."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_unset=True)
    if isinstance(value, list | tuple):
        return [_plain(_said(item)) for item in value]
    return {key: _plain(item) for key, item in value.items()} if isinstance(value, Mapping) else plain(value)


def of_drive(key: str) -> bool:
    """Whether a key path of a stage file, or of its provenance, is one of the drive."""
    return re.match(r"actuator|override\.\d\.actuator", key.removeprefix("provenance.").lstrip('"')) is not None


def of_heat(key: str) -> bool:
    """Whether a key path of a stage file, or of its provenance, is about expansion."""
    return re.match(r"frame|material\.expansion", key.removeprefix("provenance.").lstrip('"')) is not None


FILES = {"measured": "the measurements", "necks": "the measured necks"}  # where the word before a key is not the file's


def doubts_said(assumed: Collection[str], not_stated: Collection[str], of: str = "of these numbers ") -> list[str]:
    """How many numbers are assumed and how many have no stated source, in words, each if there are any."""
    verbs = ((assumed, ("is assumed", "are assumed")), (not_stated, ("has no stated source", "have no stated source")))
    return [f"{counted(len(keys), *(of + verb for verb in both))} ({scopes_of(keys)})" for keys, both in verbs if keys]


def counted(count: int, one: str, many: str) -> str:
    """A count with what agrees with it: "1 number is", "2 numbers are"."""
    return f"{count} {one if count == 1 else many}"


def scopes_of(doubted: Iterable[str]) -> str:
    """What key paths of numbers in doubt are of, counted: "17 of geometry and material, 2 of the case"."""
    counts: dict[str, int] = {}
    for key in doubted:
        file, _, own = key.rpartition(": ")
        scope = "the drive" if of_drive(own) else "expansion" if of_heat(own) else "geometry and material"
        scope = scope if file in ("", "stage") else FILES.get(file, f"the {file}")
        counts[scope] = counts.get(scope, 0) + 1
    return ", ".join(f"{count} of {scope}" for scope, count in counts.items())
