"""What a stage file says, validated, and what is read of it before anything is computed: overrides applied, keys."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

from pydantic import Field, ValidationError, model_validator

from flexfem.files.keypath import key_path
from flexfem.files.provenance import Sourced
from flexfem.files.refusals import problem_of, refusal, suggestion
from flexfem.files.toml import Label
from flexfem.stage.actuators import Actuator
from flexfem.stage.cache import once
from flexfem.stage.inside import Dimensioned, Length
from flexfem.stage.materials import Material, sources_of
from flexfem.stage.overrides import ABOUT_IT, Override
from flexfem.stage.tables import CHAINS, HINGE_NAMES, Chain, Frame, Hinge, Hinges, Plane, Platform


class Origin(NamedTuple):
    """The file of a stage, None without one, and whether it was changed since it was read."""

    path: str | None = None
    changed: bool = False

    def __str__(self) -> str:
        return "" if self.path is None else self.path + ", changed" * self.changed


class StageContent(Dimensioned, Sourced):
    """The content of a stage file, without what `Stage` computes of it."""

    kind: ClassVar[str] = "stage file"

    name: Label = Field(description="Shown in tables and figures", examples=["my stage"])
    model: Plane = Field(
        default="plane_stress",
        description="How the stage is made a plane problem, in both models: `plane_stress`, the paper's; "
        "`plane_strain`; or `corrected`: plane stress with the hinges' compliances and neck stresses corrected for "
        "their thickness by three-dimensional finite elements, in the analytic model alone, because the finite "
        "elements of the stage are plane",
    )
    thickness: Length = Field(alias="thickness_mm", description="b, out of plane", examples=[10.0])
    material: Material = Field(description="What the stage is made of, isotropic")
    chain: Chain = Field(description="Chain 1; the others are the same, turned by 120 and 240 degrees")
    hinges: Hinges = Field(description="The hinges of every chain, from the base to the platform")
    platform: Platform = Field(description="The disc that is moved")
    frame: Frame = Field(
        default_factory=Frame,
        description="What the pads are clamped to. Drift alone asks for it: `flexfem drift`, and studies with "
        "`[drift]`",
    )
    override: tuple[Override, ...] = Field(
        default=(),
        description="What differs at one of the nine hinges alone, or at an actuator on one chain: beside what it is "
        "about, keys of that hinge or actuator with their values there. As many as wanted, in any order, each about "
        "something else",
    )
    actuator: tuple[Actuator, ...] = Field(
        default=(),
        description="A piezo stack, or a pair of them, at the same place of every chain; as many as wanted. They "
        "make the stage a driven one; what is asked of the passive stage does not depend on them",
    )

    @model_validator(mode="before")
    @classmethod
    def _registered_material_has_its_source(cls, data: Any) -> Any:
        material, stated = (data.get(key) for key in ("material", "provenance")) if isinstance(data, dict) else (0, 0)
        sources = sources_of(material.get("name") if isinstance(material, dict) else getattr(material, "name", None))
        if not sources or not isinstance(stated, dict | None):
            return data
        return data | {"provenance": sources | (stated or {})}

    @model_validator(mode="after")
    def _names_each_actuator_once(self) -> Self:
        names = [actuator.name for actuator in self.actuator]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise refusal("a name that no other actuator has", "actuator", index, "name")
        check_overrides(self)
        return self

    @cached_property
    def origin(self) -> Origin:
        """Where the stage comes from; no part of its hash, and two stages may be equal without it."""
        return Origin()

    def hinge(self, chain: int, name: str) -> Hinge:
        """Return a hinge of chain 1, 2 or 3 with its override applied; ValueError when there is no such hinge."""
        if chain not in CHAINS or name not in HINGE_NAMES:
            raise ValueError(f"no hinge {name!r} in chain {chain}: chains are {CHAINS}, hinges {HINGE_NAMES}")
        return hinges_of(self)[chain - 1][HINGE_NAMES.index(name)]


def check_overrides(stage: StageContent) -> None:
    """Raise a refusal where two are about the same, or one makes an actuator that there is not or cannot be."""
    places = [override.place for override in stage.override]
    names = [actuator.name for actuator in stage.actuator]
    for index, override in enumerate(stage.override):
        if places[index] in places[:index]:
            raise refusal(f"each {'hinge' if override.hinge else 'actuator'} overridden once", "override", index)
        if override.actuator is not None:
            if override.actuator not in names:
                close = suggestion(override.actuator, names) or (f", one of {', '.join(names)}" if names else "")
                raise refusal(f"an actuator of this stage{close}", "override", index, "actuator")
            _check(stage.actuator[names.index(override.actuator)], override, index)


def _check(actuator: Actuator, override: Override, index: int) -> None:
    held = _content(actuator, override)
    try:
        Actuator.model_validate(held)
    except ValidationError as error:
        problem = problem_of(error.errors(include_url=False)[0], held)
        said = override.model_dump(by_alias=True, exclude_none=True)
        raise refusal(problem.expected, "override", index, *(part for part in problem.path if part in said)) from None


def _content(actuator: Actuator, override: Override) -> dict[str, Any]:
    """What a file would say of an overridden actuator."""
    own = override.model_dump(by_alias=True, exclude_none=True, exclude=set(ABOUT_IT))
    return actuator.model_dump(by_alias=True, exclude_unset=True, exclude_none=True) | own


@once
def hinges_of(stage: StageContent) -> tuple[tuple[Hinge, ...], ...]:
    """The nine hinges, 3 chains by 3 hinges, overrides applied."""
    changes = {override.place: override.changes for override in stage.override}
    own = [(name, getattr(stage.hinges, name)) for name in HINGE_NAMES]
    return tuple(
        tuple(hinge.model_copy(update=changes[i, name]) if (i, name) in changes else hinge for name, hinge in own)
        for i in CHAINS
    )


@once
def actuators_of(stage: StageContent) -> tuple[tuple[Actuator, ...], ...]:
    """The actuators of every chain, overrides applied."""
    own = {override.place: override for override in stage.override}
    return tuple(
        tuple(
            Actuator.model_validate(_content(each, own[place]))
            if (place := (chain, "actuator", each.name)) in own
            else each
            for each in stage.actuator
        )
        for chain in CHAINS
    )


def drive_content(stage: StageContent) -> list[Any]:
    """What of the drive is part of a hash, of every chain, or of one where all are alike: no names.

    Friction that is not stated, and balls that are not loose, are left out, as in hashes older than those keys.
    """

    def said(one: Actuator) -> dict[str, Any]:
        newer = {"friction": one.friction is None, "ball_loose": not one.ball_loose}
        return one.model_dump(exclude={"name", "stack", *(key for key, left_out in newer.items() if left_out)})

    chains = [[[said(one), one.rating] for one in chain] for chain in actuators_of(stage)]
    return chains[0] if all(chain == chains[0] for chain in chains) else chains


def key_of_actuator(stage: StageContent, chain: int, index: int, key: str) -> str:
    """Key path in the stage file of a value of an actuator on a chain, an override's where there is one."""
    for place, override in enumerate(stage.override):
        mine = (chain, "actuator", stage.actuator[index].name)
        if override.place == mine and key in override.model_dump(by_alias=True, exclude_none=True):
            return key_path(("override", place, key), stage)
    return key_path(("actuator", index, key), stage)


def key_of(stage: StageContent, chain: int, hinge: str, key: str) -> str:
    """Key path in the stage file that sets a hinge's value, an override's where there is one."""
    attribute = key.rsplit("_", 1)[0]
    for index, override in enumerate(stage.override):
        if override.place == (chain, hinge) and getattr(override, attribute) is not None:
            return key_path(("override", index, key), stage)
    return key_path(("hinges", hinge, key))
