"""What is read of a stage: hinges, drive, where its numbers come from."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.drives import contacts
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import Plane, actuators_of, of_drive, of_heat, of_stage
from flexfem.questions import warnings as warning
from flexfem.questions.setup import question
from flexfem.units import RATE


class PlacedHinge(NamedTuple):
    """One of the nine hinges: chain 1 to 3, name, centre (x, y), direction of the neck, radius and neck."""

    chain: int
    hinge: str
    centre_mm: tuple[float, float]
    axis_deg: float
    radius_mm: float
    neck_mm: float
    prismatic: bool


class PlacedActuator(NamedTuple):
    """An actuator with its chains, 1 to 3, where it is the same, and what each of its stacks can do.

    contacts_mm, directions_deg : in the frame of chain 1.   contact : in words.
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
    """The drive of a stage: its hash is that of stage and drive; doubts and sources of all numbers of both."""

    actuators: list[PlacedActuator]
    hash: str
    provenance: dict[str, str]
    assumed: list[str]
    not_stated: list[str]


class StageReport(NamedTuple):
    """A valid, feasible stage as it was read: `dimensions` by keys of the file, `provenance` by key path.

    drive : None without actuators; nothing else says anything of it.
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


@question
def check(stage: Stage) -> StageReport:
    """Validate a stage file; show hinges, drive, mobility and where the numbers come from.

    Parameters
    ----------
    {shared}

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    check_feasible(stage)
    others = {"name", "model", "hinges", "override", "actuator", "provenance", "frame"}  # said elsewhere
    left_out: dict[str, Any] = dict.fromkeys(others, True) | {"material": {"expansion"}}
    return StageReport(
        **of_stage(stage),
        mobility=stage.mobility,
        model=stage.model,
        chains_alike=stage.chains_alike,
        hash=stage.hash,
        dimensions=stage.model_dump(mode="json", by_alias=True, exclude=left_out, exclude_none=True),
        hinges=[_hinge(stage, chain, position) for chain, position in np.ndindex(3, 3)],
        provenance={key: text for key, text in stage.sources.items() if text and not (of_drive(key) or of_heat(key))},
        warnings=warning.of_stage(stage),
        drive=_drive(stage) if stage.actuator else None,
    )


def _drive(stage: Stage) -> DriveReport:
    """The drive; an actuator of the file stands once for all chains on which it is the same."""
    found = list[PlacedActuator]()
    for index, chain in np.ndindex(len(stage.actuator), len(CHAINS)):
        one = _actuator(stage, CHAINS[chain], index)
        alike = next((each for each in found if one._replace(chains=each.chains) == each), None)
        if alike is None:
            found.append(one)
        else:
            alike.chains.extend(one.chains)
    sources = {key: text for key, text in stage.sources.items() if text and of_drive(key)}
    return DriveReport(found, stage.drive_hash, sources, **stage.drive_doubts._asdict())


def _actuator(stage: Stage, chain: int, index: int) -> PlacedActuator:
    one, placed = actuators_of(stage)[chain - 1][index], contacts(stage, chain, index)
    return PlacedActuator(
        name=one.name,
        chains=[chain],
        between=one.between,
        stack=one.stack,
        contacts_mm=[(_rounded(each.point.real), _rounded(each.point.imag)) for each in placed],
        directions_deg=[_rounded(np.rad2deg(each.direction)) % 360.0 for each in placed],
        stroke_um=_rounded(1e3 * one.rating.stroke),
        stiffness_n_per_um=_rounded(RATE.factor * one.rating.stiffness),
        blocking_force_n=one.rating.blocking_force,
        stiffness_with_contact_n_per_um=RATE.factor * one.stiffness_with(stage.material),
        preload_n=one.preload,
        contact=one.contact,
    )


def _rounded(value: float) -> float:
    """Without what chains that are alike differ by in round-off."""
    return round(float(value), 9) + 0.0


def _hinge(stage: Stage, chain: int, position: int) -> PlacedHinge:
    name, placed = HINGE_NAMES[position], stage_frames(stage)
    hinge = stage.hinge(chain + 1, name)
    x, y = placed.centres[chain, position].tolist()
    axis = float(np.rad2deg(placed.axes[chain, position]) % 360.0)
    return PlacedHinge(chain + 1, name, (x, y), axis, hinge.radius, hinge.neck, hinge.prismatic)
