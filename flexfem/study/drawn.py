"""What designs of a study are asked that has them drawn one by one: reasons against a drawing go to `reason` (n,).

`stages` gives each of the n designs as a stage, by its place.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.paper import Freedoms
from flexfem.analytic.responses import ON_BODIES, LinkParts, WarmBodies, elastic_bodies, link_parts
from flexfem.arrays import AnyArray, Array
from flexfem.hinges.formulas import Compliance
from flexfem.mechanism.bodies import Payload, body_moments, hub_moments
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.drives import StageDrive, drive_of, drives_of
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.questions.driven import DriveRanges
from flexfem.refused import BadInput
from flexfem.study.loaded import LoadedStudy
from flexfem.study.plan import Study
from flexfem.verify.modes import payload_of
from flexfem.verify.questions import Moments, ask_drives, ask_frequencies

Stages = Callable[[int], Stage]


def drawn_one_by_one(study: Study) -> bool:
    """Whether a study of the analytic model makes a stage of every design."""
    return study.draws or study.links or study.frequencies is not None


def elastic_parts(loaded: LoadedStudy, stages: Stages, reason: AnyArray) -> WarmBodies | None:
    """Draw the designs not refused so far, where the study draws them; what their elastic bodies do, None without."""
    study, n = loaded.study, len(reason)
    bodies = WarmBodies(np.zeros((n, 9, 9)), np.zeros((n, 3, 3, 3)))

    def draw(index: int, stage: Stage) -> None:
        if study.draws:
            check_feasible(stage)
        if study.links:
            bodies.compliance[index] = body_compliance(stage)
        if study.links and study.drift is not None:
            bodies.edges[index] = edge_motions(stage)

    if study.draws or study.links:
        _each(stages, reason, draw)
    return bodies if study.links else None


def driven(
    loaded: LoadedStudy, stages: Stages, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> DriveRanges:
    """What the drives of the designs do; reasons against their contacts and forces go to `reason`."""
    drive = drives_of(loaded.stage, designs, reason, stages)
    elastic = _link_parts(stages, reason, drive) if loaded.study.links else None
    drive.stiffness[reason != ""] = np.nan  # not asked: nan all through
    return ask_drives(designs, hinges, freedoms, drive, elastic)


def vibrating(
    loaded: LoadedStudy, stages: Stages, reason: AnyArray, designs: Designs, hinges: Compliance, freedoms: Freedoms
) -> Array:
    """Natural frequencies (n, 3), rad/s; every design is drawn, and reasons why it cannot be go to `reason`."""
    n, links = len(reason), loaded.study.links
    moments = Moments(np.ones((n, 3, 4, 4)) * [1.0, 0.0, 0.0, 1.0], np.ones((n, 4)) * [1.0, 0.0, 0.0, 1.0])
    shapes = (3, 3, 3), (3, 3, ON_BODIES), (ON_BODIES, ON_BODIES), (9, 9)
    elastic = LinkParts(*(np.zeros((n, *shape)) for shape in shapes)) if links else None

    def draw(index: int, stage: Stage) -> None:
        moments.bodies[index], moments.hub[index] = body_moments(stage), hub_moments(stage)
        if elastic is not None:
            _put(elastic, index, elastic_bodies(stage))

    _each(stages, reason, draw)
    return ask_frequencies(designs, hinges, freedoms, moments, payload(loaded) or Payload(), elastic)


def payload(loaded: LoadedStudy) -> Payload | None:
    """What the platform carries where natural frequencies are asked for, else None."""
    of = loaded.study.frequencies
    return None if of is None else payload_of(of.payload_kg, of.payload_kg_mm2)


def _link_parts(stages: Stages, reason: AnyArray, drive: StageDrive) -> LinkParts:
    """What elastic links add to the compliances of n designs, one by one; zero for those refused."""
    n, stacks = len(reason), len(drive.stacks)
    shapes = (3, 3, 3), (3, 3, stacks), (stacks, stacks), (9, 9)
    found = LinkParts(*(np.zeros((n, *shape)) for shape in shapes))
    _each(stages, reason, lambda index, stage: _put(found, index, link_parts(stage, drive_of(stage).stacks)))
    return found


def _each(stages: Stages, reason: AnyArray, draw: Callable[[int, Stage], None]) -> None:
    """Ask every design not refused so far; why one is refused goes to `reason`."""
    for index in map(int, np.flatnonzero(reason == "")):
        try:
            draw(index, stages(index))
        except BadInput as refusal:
            reason[index] = str(refusal)


def _put(parts: LinkParts, index: int, own: LinkParts) -> None:
    for all_of, one in zip(parts, own, strict=True):
        all_of[index] = one
