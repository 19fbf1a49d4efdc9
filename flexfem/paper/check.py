"""A report without a solution: the content of a stage file."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import short_repr
from flexfem.mechanism.mechanism import of_stage
from flexfem.paper import warnings as warning
from flexfem.paper.designs import stage_frames
from flexfem.paper.drives import drive_of
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.paper.stage_file import Plane, actuators_of, of_drive, of_heat
from flexfem.questions.check import placed, rounded
from flexfem.units import RATE

# keys of a stage file that are reported elsewhere, or are no dimensions
LEFT_OUT = (
    "name",
    "units",
    "model",
    "hinges",
    "override",
    "actuator",
    "provenance",
    "frame",
)


class PlacedHinge(NamedTuple):
    """One of the nine hinges; `axis_deg` is the direction of the neck."""

    chain: int
    hinge: str
    centre_mm: tuple[float, float]
    axis_deg: float
    radius_mm: float
    neck_mm: float
    prismatic: bool


class PlacedActuator(NamedTuple):
    """An actuator and the chains with identical data, its contacts as on chain 1, and the ratings
    of its stacks.
    """

    name: str
    chains: list[int]
    between: tuple[str, str]
    stack: str | None
    contacts_mm: list[tuple[float, float]]
    directions_deg: list[float]
    stroke_um: float
    stiffness_n_per_um: float
    blocking_force_n: float
    stiffness_with_contact_n_per_um: float
    preload_n: float
    contact: str


class DriveReport(NamedTuple):
    """The drive of a stage; the hash, assumptions and sources are those of the stage and the drive
    together.
    """

    actuators: list[PlacedActuator]
    hash: str
    provenance: dict[str, str]
    assumed: list[str]
    not_stated: list[str]


@short_repr
class StageReport(NamedTuple):
    """A valid, feasible stage: `dimensions` by keys of the file, `provenance` by key path; `drive`
    if it has one.
    """

    file: str
    name: str
    mobility: int
    model: Plane
    chains_alike: bool
    hash: str
    dimensions: dict[str, Any]
    hinges: list[PlacedHinge]
    provenance: dict[str, str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]
    drive: DriveReport | None = None


def check(stage: Stage) -> StageReport:
    """Answer `flexfem.check` for a stage."""
    left_out: dict[str, Any] = dict.fromkeys(LEFT_OUT, True) | {"material": {"expansion"}}
    sources = {key: text for key, text in stage.sources.items() if text}
    return StageReport(
        **of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=stage.model_dump(
            mode="json", by_alias=True, exclude=left_out, exclude_none=True
        ),
        hinges=_hinges(stage),
        provenance={
            key: text for key, text in sources.items() if not (of_drive(key) or of_heat(key))
        },
        warnings=warning.of_stage(stage),
        drive=_drive(stage) if stage.actuator else None,
    )


def _hinges(stage: Stage) -> list[PlacedHinge]:
    frames = stage_frames(stage)
    found = list[PlacedHinge]()
    for (row, k), axis in np.ndenumerate(frames.axes):
        hinge = stage.hinge(row + 1, HINGE_NAMES[k])
        x, y = frames.centres[row, k].tolist()
        found.append(
            PlacedHinge(
                chain=row + 1,
                hinge=HINGE_NAMES[k],
                centre_mm=(x, y),
                axis_deg=float(np.rad2deg(axis) % 360.0),
                radius_mm=hinge.radius,
                neck_mm=hinge.neck,
                prismatic=hinge.prismatic,
            )
        )
    return found


def _drive(stage: Stage) -> DriveReport:
    """Return the drive; actuators of a file that are identical on several chains are listed once."""
    found = list[PlacedActuator]()
    for index, chain in np.ndindex(len(stage.actuator), len(CHAINS)):
        one = _placed_actuator(stage, index, chain)
        same = [known for known in found if one._replace(chains=known.chains) == known]
        if same:
            same[0].chains.extend(one.chains)
        else:
            found.append(one)
    sources = {key: text for key, text in stage.sources.items() if text and of_drive(key)}
    return DriveReport(found, stage.drive_hash, sources, **stage.drive_assumptions._asdict())


def _placed_actuator(
    stage: Stage,
    index: int,
    chain: int,
) -> PlacedActuator:
    """Return one actuator of a chain (from 0) with the ratings of its stacks."""
    actuator = actuators_of(stage)[chain][index]
    drive = drive_of(stage)
    column = drive.names.index(f"{actuator.name}, chain {CHAINS[chain]}")
    numbers = np.flatnonzero(drive.differential[:, column])
    contacts = [drive.stacks[k] for k in numbers]
    headings = [np.angle(contact.direction, deg=True) for contact in contacts]
    return PlacedActuator(
        name=actuator.name,
        chains=[CHAINS[chain]],
        between=actuator.between,
        stack=actuator.stack,
        contacts_mm=[placed(contact.point) for contact in contacts],
        directions_deg=[rounded(heading) % 360.0 for heading in headings],
        stroke_um=rounded(1e3 * actuator.rating.stroke),
        stiffness_n_per_um=rounded(RATE.factor * actuator.rating.stiffness),
        blocking_force_n=actuator.rating.blocking_force,
        stiffness_with_contact_n_per_um=RATE.factor * float(drive.stiffness[numbers[0]]),
        preload_n=actuator.preload,
        contact=actuator.contact,
    )
