"""The stage: what a stage file says, validated; changed stages, validated again; files that are not finished."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from flexfem.arrays import AnyArray
from flexfem.files.provenance import Assumptions, key_paths, values_by_key
from flexfem.files.refusals import Problem, checked_path, key_path, needed
from flexfem.files.toml import PathLike, validate
from flexfem.files.writing import canonical, check_file, digest, toml_text, write_atomically
from flexfem.mechanism.actuators import Actuator
from flexfem.mechanism.designs import Elastic, lower
from flexfem.mechanism.dimensioned import KEPT
from flexfem.mechanism.drives import check_drive
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.materials import materials, sources_of, with_material_of_file
from flexfem.mechanism.stage_file import CHAINS as CHAINS
from flexfem.mechanism.stage_file import HINGE_NAMES as HINGE_NAMES
from flexfem.mechanism.stage_file import Hinge as Hinge
from flexfem.mechanism.stage_file import (
    Origin,
    StageContent,
    actuators_of,
    hinges_of,
    merged_changes,
    of_drive,
    of_heat,
)
from flexfem.refused import BadInput
from flexfem.sources import read_data


class Stage(StageContent):
    """A planar 3-RRR flexure stage; `thickness` out of plane in mm, `provenance` by key path of the file.

    model : how the stage is made a plane problem; "corrected" has hinges of three dimensions, in the analytic model.
    """

    def replace(self, **changes: Any) -> Stage:
        """A changed stage, validated and feasible; what is not named keeps its value bit for bit.

        Parameters
        ----------
        **changes : by attribute name, in mm, N, MPa and rad, nested as the tables are: `thickness=12.0`,
            `material={"youngs_modulus": 70e3}`, `chain={"link_width": 9.5}`; `material="ti-6al-4v"` takes a registered
            one. `radius`, `neck`, `prismatic` and `axis` are those of the hinges, one value for all three or by name,
            `neck={"elbow": 0.4}`; a hinge with an override keeps it. One of the nine hinges alone:
            `override={(2, "elbow"): {"neck": 0.52}}`; an actuator on one chain, `override={(2, "actuator", "base"):
            {"preload": 40.0}}`; a sequence replaces all overrides.

        Raises
        ------
        BadInput
            A name is not known, a value is not possible, or the stage cannot be made.

        Examples
        --------
        >>> import flexfem
        >>> stage = flexfem.load("geometry/mobility6.toml")
        >>> stage.replace(neck={"elbow": 0.4}).hinges.elbow.neck
        0.4
        >>> stage.replace(neck=20.0)
        Traceback (most recent call last):
            ...
        flexfem.BadInput: geometry/mobility6.toml, changed: hinges.base.neck_mm = 20, neck as wide as the \
link, expected < chain.link_width_mm = 9
        """
        origin = self.origin._replace(changed=self.origin.path is not None)
        try:
            changed = self._holding(merged_changes(self.model_dump(exclude_unset=True), changes))
            if "provenance" not in changes:
                changed = changed.model_copy(update={"provenance": self._sources_of(changed)})
        except BadInput as refusal:
            raise BadInput(refusal.reason.removeprefix("Stage: "), str(origin)) from None
        changed.__dict__["origin"] = origin
        check_feasible(changed)
        if "actuator" in changes or changed.override != self.override:
            check_drive(changed)
        return changed

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Stage:
        """A copy with values replaced by name, validated like any other, of no file; whether it can be made is open."""
        return self._holding({name: getattr(self, name) for name in self.model_fields_set} | dict(update or {}))

    def _holding(self, content: dict[str, Any]) -> Stage:
        """A stage of this content; what was the provenance of this one's keys that are gone goes too."""
        sources = content.pop("provenance", {})
        made = Stage(**content)
        gone = {key for key in sources if key in self.provenance} - set(key_paths(made))
        kept = {key: source for key, source in sources.items() if key not in gone}
        return Stage(**content, provenance=kept) if kept else made

    def _sources_of(self, changed: Stage) -> dict[str, str]:
        """The provenance of a changed stage: values that differ have no source of this one's."""
        before, stated = values_by_key(self), changed.sources
        different = [key for key, value in values_by_key(changed).items() if before.get(key) != value]
        found = dict(changed.provenance) | {key: "replaced in Python" for key in different if stated[key] is not None}
        sources = sources_of(changed.material.name)
        if not sources or changed.material == self.material:
            return found
        return sources | {key: text for key, text in found.items() if not key.startswith("material")}

    def to_toml(self) -> str:
        """The text of a stage file that reads back as an equal stage, with the same hash, bit for bit."""
        content = self.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
        sources = content.pop("provenance", {})
        return toml_text(content | ({"provenance": sources} if sources else {}))

    def save(self, path: PathLike) -> None:
        """Write `to_toml` to a file. Raises BadInput when its folder is not there or does not take it."""
        target = checked_path(path)
        check_file(target)
        write_atomically(target, lambda file: file.write(self.to_toml().encode()))

    def __getstate__(self) -> dict[Any, Any]:
        """Fields and origin: what was computed is computed again elsewhere."""
        state = super().__getstate__()
        content = {key: value for key, value in state["__dict__"].items() if key != KEPT}
        return state | {"__dict__": content}

    def __eq__(self, other: object) -> bool:
        """Whether all that a file says is equal; what was computed and where it was read do not count."""
        return isinstance(other, Stage) and all(getattr(self, n) == getattr(other, n) for n in Stage.model_fields)

    def __hash__(self) -> int:
        """Hash consistently with equality, so that a stage can be a key."""
        return hash(self.hash)

    def array(self, attr: str) -> AnyArray:
        """Return radius, neck (mm) or prismatic (bool) of all hinges, (3 chains, 3 hinges), read-only."""
        if attr not in ("radius", "neck", "prismatic"):
            raise ValueError(f"no array of {attr!r}: expected radius, neck or prismatic")
        found: AnyArray = getattr(lower(self), attr)
        return found if attr == "prismatic" else found[0]

    @property
    def mobility(self) -> int:
        """Mobility by Gruebler-Kutzbach (1): three, and one for every prismatic hinge."""
        return 3 + int(self.array("prismatic").sum())  # (1)

    @property
    def elastic(self) -> Elastic:
        """Elastic constants of the plane problem, by `model`; `material` keeps the metal's own."""
        return Elastic(*(value[0] for value in lower(self).elastic))

    @property
    def chains_alike(self) -> bool:
        """Whether the hinges of chains 2 and 3 equal those of chain 1, so that the stage is three-fold symmetric."""
        return len(set(hinges_of(self))) == 1

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content: inside units, overrides applied, no names, no provenance, drive or heat."""
        content = self.model_dump(exclude={"name", "provenance", "override", "actuator", "frame"})
        others = ("name", "expansion")  # what is not stated is in no hash, as before those keys
        numbers = content["material"].items()
        content["material"] = {key: value for key, value in numbers if key not in others and value is not None}
        if self.model == "plane_stress":  # the hashes of stages older than the key stay
            del content["model"]
        content["hinges"] = [[hinge.model_dump() for hinge in chain] for chain in hinges_of(self)]
        return digest(canonical(content))

    @property
    def drive_hash(self) -> str:
        """SHA-256 of the physical content and of the drive, without names: what answers on a driven stage are of.

        Friction that is not stated and balls that are not loose are left out, as in hashes older than those keys.
        """

        def said(one: Actuator) -> list[Any]:
            left_out = {"name", "stack"} | ({"friction"} if one.friction is None else set())
            return [one.model_dump(exclude=left_out | (set() if one.ball_loose else {"ball_loose"})), one.rating]

        chains = [[said(one) for one in row] for row in actuators_of(self)]
        alike = all(chain == chains[0] for chain in chains)
        return digest(canonical({"stage": self.hash, "drive": chains[0] if alike else chains}))

    @property
    def heat_hash(self) -> str:
        """SHA-256 of the physical content and of both coefficients of expansion: what answers on heat are of."""
        return digest(canonical({"stage": self.hash, "expansion": [self.material.expansion, self.frame.expansion]}))

    @property
    def numbers(self) -> tuple[str, ...]:
        """As of every file, without the drive and without expansion, which are asked by answers on them alone."""
        return tuple(key for key in super().numbers if not of_drive(key) and not of_heat(key))

    @property
    def assumed(self) -> tuple[str, ...]:
        """As of every file, without the drive and without expansion."""
        return tuple(key for key in super().assumed if not of_drive(key) and not of_heat(key))

    @property
    def heat_assumptions(self) -> Assumptions:
        """What is assumed and what is not stated, expansion included; a frame of none is assumed as the stage's."""
        assumed, not_stated = ([key for key in keys if not of_drive(key)] for keys in self.drive_assumptions)
        frame = ["frame.expansion_um_per_m_k"] if self.frame.expansion is None else []
        return Assumptions(assumed + frame, not_stated)

    @property
    def drive_assumptions(self) -> Assumptions:
        """What is assumed and what is not stated, the drive included; a ball of no stated metal is of assumed steel."""
        ball = [
            f"{key_path(('actuator', k), self)}.ball ({what})"
            for k, chains in enumerate(zip(*actuators_of(self), strict=True))
            for what in dict.fromkeys(what for one in chains for what in one.assumed_of_ball)
        ]
        sources = self.sources
        return Assumptions([*super().assumed, *ball], [key for key in super().numbers if sources[key] is None])


def load_stage(path: PathLike) -> Stage:
    """Read a stage file. Raises BadInput, naming file, line, key, value and expectation, for what no stage can have."""
    return _read(path, partial(with_material_of_file, path))


def _read(path: PathLike, completed: Callable[[dict[str, Any]], dict[str, Any]]) -> Stage:
    stage = validate(Stage, path, completed)
    stage.__dict__["origin"] = Origin(os.fspath(path))
    return stage


def load_feasible(path: PathLike) -> Stage:
    """Read a stage file and refuse what cannot be made or driven as it says. Raises BadInput, naming the file."""
    stage = load_stage(path)
    check_feasible(stage)
    check_drive(stage)
    return stage


DRAWN = ("chain.", "hinges.", "platform.")  # tables of what a drawing shows


class PartialStage(NamedTuple):
    """A stage, and the keys that its file does not give: their values in the stage mean nothing."""

    stage: Stage
    missing: list[str]

    @property
    def whole(self) -> bool:
        """Whether all is there that a drawing shows."""
        return not any(key.startswith(DRAWN) for key in self.missing)

    @property
    def assumptions(self) -> Assumptions:
        """What of the numbers that are given is assumed, and what has no stated source."""
        both = self.stage.assumed, self.stage.not_stated
        return Assumptions(*([key for key in keys if key not in self.missing] for keys in both))

    def states(self, *keys: str) -> bool:
        """Whether the file gives all of some keys."""
        return not set(keys) & set(self.missing)


def load_partly(path: PathLike) -> PartialStage:
    """Read a stage file in which keys may be missing.

    Raises BadInput as `load_stage` for what is wrong in it, and as `check_feasible` where nothing is missing.
    """
    metal = materials()["al-6061-t6"].model_dump(by_alias=True, exclude_none=True)  # nothing that is drawn shows it
    spare = tomllib.loads(read_data("new-stage.toml")) | {"material": metal | {"name": "unnamed"}, "name": "unnamed"}
    missing = list[str]()

    def completed(data: dict[str, Any]) -> dict[str, Any]:
        data = with_material_of_file(path, data)
        material = data.get("material")
        known = isinstance(material, dict) and material.get("name") in materials()
        for key in needed(Problem("missing", (), ""), Stage):
            *tables, name = key.split(".")
            table: Any = data
            source: Any = spare
            for each in tables:
                table, source = table.setdefault(each, {}) if isinstance(table, dict) else None, source[each]
            if isinstance(table, dict) and name not in table and not (known and tables == ["material"]):
                table[name] = source[name]
                missing.append(key)
        return data

    found = PartialStage(_read(path, completed), missing)
    if found.whole:
        check_feasible(found.stage)
    return found
