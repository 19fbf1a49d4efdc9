"""The analytic model of the stage for many designs at once: 8 to 11 us a design."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from flexfem.analytic.network import Dynamics
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.chart import Compliance
from flexfem.hinges.strength import KEY
from flexfem.mechanism.keys import keys
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.materials import STRENGTHS, UNLIKELY, unlikely
from flexfem.paper import responses
from flexfem.paper.contacts import Stack
from flexfem.paper.designs import Designs, design_arrays, envelope
from flexfem.paper.driven import DriveRanges, drive_ranges
from flexfem.paper.drives import drive_of, drives_of
from flexfem.paper.equations import freedoms_of, mobility
from flexfem.paper.feasibility import Broken, conditions
from flexfem.paper.life import by_wrenches, lives
from flexfem.paper.links import body_compliance, edge_motions
from flexfem.paper.model import at_rest, hinge_compliances, invalid_hinges
from flexfem.paper.outputs import DesignAnswers, values_of
from flexfem.paper.responses import LinkParts, WarmBodies
from flexfem.paper.stage import Stage
from flexfem.paper.vibration import payload_of
from flexfem.questions.driven import DriveSystem
from flexfem.questions.life import CyclicMotion, cyclic_motion
from flexfem.refused import BadInput
from flexfem.study.batch import BatchRows
from flexfem.study.columns import sizes_of
from flexfem.study.factors import Column
from flexfem.study.family import Setting
from flexfem.study.plan import Study

LOWEST = 3  # natural frequencies: the three modes of the rigid platform on its hinges
MOST = 4096  # designs at a time, which bounds the memory
# the same where every design needs a stage, which takes 60 kB until the batch is done
MOST_STAGES = 512
# designs in a part: by arrays, with stages, and with elastic links
BROADCAST = 8192
DRAWN = 512
LINKED = 32
FATIGUE = f"{KEY}: expected {UNLIKELY.format(*STRENGTHS, 'material.yield_strength_mpa')}"
UNMOVED = (
    "actuator: the drive does not move the platform in three directions, or its preloads make a "
    "neck yield"
)
SINGULAR = (
    "chain: singular to working precision at rest: its hinges are in line, or its necks differ "
    "too much"
)
StageAt = Callable[[int], Stage]  # the stage of a design by its index
Result = TypeVar("Result")


def for_stages(
    stage_at: StageAt, reason: AnyArray, function: Callable[[Stage], Result]
) -> dict[int, Result]:
    """Return the results of a function of each stage not yet refused, by index; its refusals go to
    `reason`.
    """
    results = dict[int, Result]()
    for index in map(int, np.flatnonzero(reason == "")):
        try:
            results[index] = function(stage_at(index))
        except BadInput as refusal:
            reason[index] = str(refusal)
    return results


def designs_of(
    base: Stage,
    settings: Sequence[Setting],
    values: Array,
) -> Designs:
    """Return the designs with factor values (n, columns), file units, unchecked."""
    designs = design_arrays(base).repeated(len(values))
    for key, column in settings:
        for field, place in key.places_in(base):
            index: tuple[slice | int, ...] = (slice(None), *place)
            getattr(designs, field)[index] = key.number.factor * values[:, column]
    return designs


def payload_of_study(study: Study) -> Payload | None:
    """Return the payload of a study with natural frequencies, else None."""
    table = study.frequencies
    return None if table is None else payload_of(table.payload_kg, table.payload_kg_mm2)


def motion_of_study(study: Study) -> CyclicMotion | None:
    """Return the cyclic pose of a study with lives, else None."""
    life = study.life
    if life is None:
        return None
    amplitude = np.array(life.amplitude)
    return cyclic_motion(amplitude, None, life.ratio, life.cycles, life.notch_sensitivity)


@dataclass(frozen=True, eq=False)
class StageBatch:
    """Designs of a stage as arrays; a `Batch` of studies.

    settings : of all columns.   stage_of : makes a stage of factor values (columns,).
    """

    base: Stage
    study: Study
    columns: tuple[Column, ...]
    settings: Sequence[Setting]
    stage_of: Callable[[Array], Stage]

    @property
    def outputs(self) -> tuple[str, ...]:
        """All outputs but numbers of questions."""
        return self.study.columns

    @property
    def makes_stages(self) -> bool:
        """Whether the model needs a `Stage` of every design, not only its arrays."""
        study = self.study
        return study.draws or study.links or study.frequencies is not None or bool(study.ask)

    @property
    def most(self) -> int:
        """Most designs of one call."""
        return MOST_STAGES if self.makes_stages else MOST

    @property
    def part(self) -> int:
        """Designs in one part of a study."""
        if self.study.links:
            return LINKED
        return DRAWN if self.makes_stages or self.study.driven else BROADCAST

    def designs(self, values: Array) -> Designs:
        """Return the designs with factor values (n, columns), file units, unchecked."""
        return designs_of(self.base, self.settings, values)

    def rows(
        self,
        values: Array,
        reasons: AnyArray,
    ) -> BatchRows:
        """Return the results of designs (n, columns)."""
        with np.errstate(all="ignore"):  # numbers of impossible designs, which are refused
            solution = _Solution(self, values, reasons)
            found = values_of(solution.answers(), self.study.columns, self.study.rotation)
        reason = solution.reason
        found[reason != ""] = np.nan
        return BatchRows(reason, found, np.zeros(len(values), dtype=bool))

    def rooms(self, values: Array) -> Array:
        """Return the rooms (n, conditions) of the geometric conditions, over the link width."""
        with np.errstate(all="ignore"):
            designs = self.designs(values)
            checks = conditions(designs)
            notch, clear, apart, hub = (
                np.column_stack([check.room.min(axis=1) for check in checks if word in check.wrong])
                for word in ("notch", "covers", "closer", "hub larger")
            )
            rooms = np.hstack([notch, clear, apart.min(axis=1, keepdims=True), hub])
            return np.asarray(rooms / designs.link_width[:, None])

    def sizes(self, columns: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the reference size of each column that symmetry can make zero."""
        return sizes_of(columns)


class _Solution:
    """The analytic model of n designs; `reason` (n,) collects why designs are refused."""

    def __init__(
        self,
        batch: StageBatch,
        values: Array,
        reasons: AnyArray,
    ) -> None:
        self.batch = batch
        self.study = batch.study
        self.values = values
        self.designs = batch.designs(values)
        self.hinges: Compliance = hinge_compliances(self.designs, self.study.formula)
        self.freedoms = freedoms_of(self.study.mobility, self.designs.prismatic)
        self.reason = self._refused(reasons)
        self._stages = dict[int, Stage]()

    def _refused(self, reasons: AnyArray) -> AnyArray:
        """Return the reasons (n,) to refuse designs before they are solved."""
        designs = self.designs
        broken = list[Broken]()
        for column, value in zip(self.batch.columns, self.values.T, strict=True):
            for path in column.keys:
                text = f"{path}: outside the limits of a stage file"
                broken.append(Broken(text, keys()[path].number.refuses(value)))
        broken += [condition.broken for condition in conditions(designs)]
        broken += invalid_hinges(designs, self.study.formula, self.hinges)
        broken.append(Broken(FATIGUE, unlikely(designs.fatigue[:, 0], designs.yield_strength)))
        texts = [np.array(each.reason, object) for each in broken]
        return np.select([each.where for each in broken], texts, reasons)

    def stage_at(self, index: int) -> Stage:
        """Return a design as a stage."""
        if index not in self._stages:
            self._stages[index] = self.batch.stage_of(self.values[index])
        return self._stages[index]

    def stacked(self, function: Callable[[Stage], tuple[Array, ...]]) -> list[Array]:
        """Return the arrays (n, ...) of a function of every stage, with the base in place of
        refused designs.
        """
        results = for_stages(self.stage_at, self.reason, function)
        instead = function(self.batch.base) if len(results) < len(self.reason) else ()
        rows = [results.get(index, instead) for index in range(len(self.reason))]
        return [np.stack(arrays) for arrays in zip(*rows, strict=True)]

    def links_at(self, loads: Callable[[Stage], tuple[Stack, ...]]) -> LinkParts | None:
        """Return the parts of elastic links for loads on the bodies, None with rigid links."""
        if not self.study.links:
            return None
        parts = self.stacked(lambda stage: responses.link_parts(stage, loads(stage)))
        return LinkParts(*parts)

    @cached_property
    def warm_bodies(self) -> WarmBodies | None:
        """The elastic bodies and their thermal motions, None with rigid links."""
        if not self.study.links:
            return None
        if self.study.drift is None:
            return WarmBodies(
                *self.stacked(lambda stage: (body_compliance(stage), np.zeros((3, 3, 3))))
            )
        return WarmBodies(
            *self.stacked(lambda stage: (body_compliance(stage), edge_motions(stage)))
        )

    def answers(self) -> DesignAnswers:
        """Return the results that the study requests; reasons of refusals are completed."""
        if self.study.draws:
            for_stages(self.stage_at, self.reason, Stage.check)
        found = self._at_rest()
        if self.study.driven:
            found = found._replace(drives=self._drives())
        payload = payload_of_study(self.study)
        if payload is not None:
            found = found._replace(frequencies=self._frequencies(payload))
        if self.study.drift is not None:
            found = found._replace(drift=self._drift())
        self._refuse_unsolved(found)
        return found

    def _at_rest(self) -> DesignAnswers:
        designs = self.designs
        bodies = None if self.warm_bodies is None else self.warm_bodies.compliance
        found = at_rest(designs, self.hinges, self.freedoms, bodies)
        strength = designs.yield_strength
        highest = np.max(found.stress, axis=(1, 2))
        answers = DesignAnswers(
            found.stiffness, highest, found.base_rotation, strength, envelope(designs)
        )
        motion = motion_of_study(self.study)
        if motion is None:
            return answers
        cycles = by_wrenches(designs, found.wrench, motion)
        return answers._replace(lives=lives(cycles, designs.fatigue, strength, motion))

    def _drives(self) -> DriveRanges:
        drive = drives_of(self.batch.base, self.designs, self.reason, self.stage_at)
        links = self.links_at(lambda stage: drive_of(stage).stacks)
        drive.stiffness[self.reason != ""] = np.nan  # makes all results of refused designs nan
        response = responses.driven(
            self.designs.frames, self.hinges, self.freedoms, drive.stacks, links
        )
        return drive_ranges(
            self.designs, DriveSystem.of(response.compliance, drive), response.necks
        )

    def _frequencies(self, payload: Payload) -> Array:
        (mass,) = self.stacked(lambda stage: (responses.mass_matrix(stage, payload),))
        links = self.links_at(responses.body_loads)
        loads = responses.body_loads()
        response = responses.driven(self.designs.frames, self.hinges, self.freedoms, loads, links)
        moving = responses.FREEDOMS if self.study.links else mobility(self.freedoms)
        return Dynamics(response.compliance, mass, moving).frequencies[:, :LOWEST]

    def _drift(self) -> responses.DriftRates:
        elastic = responses.in_plane(self.designs)
        drift = responses.drift(
            self.designs, self.hinges, self.freedoms, *elastic, self.warm_bodies
        )
        return responses.rates_of(drift.pose)

    def _refuse_unsolved(self, found: DesignAnswers) -> None:
        """Refuse designs without a solution."""
        singular = np.isnan(found.stiffness[:, 0, 0])
        if found.drift is not None:
            singular |= np.isnan(found.drift.uniform).any(axis=1)
        self.reason[singular & (self.reason == "")] = SINGULAR
        if found.drives is not None:
            unmoved = np.isnan(found.drives.range).any(axis=1)
            self.reason[unmoved & (self.reason == "")] = UNMOVED
