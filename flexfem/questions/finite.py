"""What finite displacements change in the answers of linear theory: motions, forces and hinge
stress of a mechanism.

Beams with finite rotations show in milliseconds how far linear theory is off. Where this counts,
plane finite elements with finite rotations give the change, on a coarse mesh whose error cancels
from it, and beams with hinges in three dimensions against beams in plane stress give the effect of
the thickness on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexfem.analytic.paths import DrivenPlate
from flexfem.analytic.plates import weights
from flexfem.analytic.strokes import STIFF, Applied, Displaced, displaced_by, linear
from flexfem.arrays import Array, Index
from flexfem.fem.nonlinear import Equilibria, driven, equilibria, stress_in_parts
from flexfem.fem.ports import PlateModel
from flexfem.files.tables import memoized
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import levels
from flexfem.questions.plates import (
    ElasticParts,
    model_of,
    parts_of,
    responses,
    solved,
    thickness_of,
)
from flexfem.questions.setup import Mesh, ModelAnswer
from flexfem.refused import ComputationFailed
from flexfem.results import ANALYTIC, ELEMENTS, SOLID

HOLDS = 1e-4  # of the motion: linear theory holds if beams change it by less; the bands are wider
STRESS_HOLDS = 1e-3  # the same of the highest stress, whose bands are from 1 %
# possible error of a change by finite displacement, from meshes and bodies in plane stress
OF_THE_CHANGE = 0.05
OF_THE_THICKNESS = 0.25  # possible error of the effect of the thickness on it
CLOSE = 1e-3  # of the openings: a smaller correction is linear
MOST_CORRECTIONS = 3
WORTH_A_WARNING = 0.01  # of motion or stress, where no band contains the change


class Change(NamedTuple):
    """Change of what linear theory states at a command.

    models : of `ANALYTIC`, by beams, and of the finite elements; they have none where linear theory
    holds.
    error : possible error of that of finite elements.
    motion, stress : change of the motion of the output, relative to its largest component, and of
    the highest stress."""

    models: dict[str, Displaced]
    error: Displaced
    motion: float
    stress: float


def by_strokes(layout: Layout, strokes: Array) -> Applied:
    """Return the command of strokes (a,) of the actuators, mm, without other loads."""
    count = len(layout.ports)
    drives = layout.drive_ports
    at_ports = np.zeros(count)
    springs = np.zeros(count)
    at_ports[drives] = strokes
    springs[drives] = layout.drive.stiffness
    return Applied(np.zeros(count), at_ports, springs)


def by_loads(layout: Layout, loads: Array) -> Applied:
    """Return the command of dead loads (n,) on the first ports, N and N mm, without actuators."""
    count = len(layout.ports)
    on_ports = np.zeros(count)
    on_ports[: len(loads)] = loads
    return Applied(on_ports, np.zeros(count), np.zeros(count))


def by_pose(layout: Layout, pose: Array) -> Applied:
    """Return the command that holds the output at a pose (3,), mm, mm and rad."""
    count = len(layout.ports)
    at_ports = np.zeros(count)
    springs = np.zeros(count)
    at_ports[:3] = pose
    springs[:3] = np.inf
    return Applied(np.zeros(count), at_ports, springs)


def change(
    mechanism: Mechanism,
    mesh: Mesh | None,
    command: Applied,
) -> Change:
    """Return the change of linear theory at a command, without a mesh that by beams alone.

    Raises ComputationFailed without an equilibrium.
    """
    return _change(mechanism, mesh, *(tuple(part.tolist()) for part in command))


@memoized
def _change(mechanism: Mechanism, mesh: Mesh | None, *parts: tuple[float, ...]) -> Change:
    command = Applied(*map(np.array, parts))
    layout = mechanism.layout
    if not np.any(command.loads) and not np.any(command.strokes):
        on_ports = np.zeros(len(layout.ports))
        nothing = Displaced(on_ports, on_ports, np.zeros(len(layout.joints)))
        return Change(dict.fromkeys((ANALYTIC, ELEMENTS, SOLID), nothing), nothing, 0.0, 0.0)
    if not layout.joints:
        assert mesh is not None
        before, added = _of_elements(mechanism, mesh, command, np.zeros(len(layout.ports)))
        return _related({ELEMENTS: added}, added.error(OF_THE_CHANGE), before, layout)
    before, by_beams = _of_beams(mechanism, ElasticParts(), command)
    rough = _related({ANALYTIC: by_beams}, by_beams.error(1.0), before, layout)
    if mesh is None or (rough.motion < HOLDS and abs(rough.stress) < STRESS_HOLDS):
        return rough
    _, plane = _of_beams(mechanism, parts_of(mechanism), command)
    before, added = _of_elements(mechanism, mesh, command, plane.motions)
    error = added.error(OF_THE_CHANGE)
    models = {ANALYTIC: by_beams, ELEMENTS: added}
    if thickness_of(mechanism):
        _, solid = _of_beams(mechanism, thickness_of(mechanism)[0].solid, command)
        by_thickness = solid.plus(plane, -1.0)
        models[SOLID] = added.plus(by_thickness)
        error = error.plus(by_thickness.error(OF_THE_THICKNESS))
    return _related(models, error, before, layout)


def _related(
    models: dict[str, Displaced], error: Displaced, before: Displaced, layout: Layout
) -> Change:
    """Return a change with its size relative to linear theory."""
    last = list(models.values())[-1]
    lengths = np.array([1.0, 1.0, layout.lever])
    largest = float(np.max(np.abs(before.motions[:3] * lengths)))
    motion = 0.0
    if largest > 0:
        motion = float(np.max(np.abs(last.motions[:3] * lengths))) / largest
    highest = float(np.max(before.stress, initial=0.0))
    stress = 0.0
    if highest > 0:
        stress = float(np.max(before.stress + last.stress)) / highest - 1
    return Change(models, error, motion, stress)


def _of_beams(
    mechanism: Mechanism, parts: ElasticParts, command: Applied
) -> tuple[Displaced, Displaced]:
    """Return linear theory by beams with the hinges of parts, and its change. Raises
    ComputationFailed.
    """
    thickness = thickness_of(mechanism) if parts.hinges is not None else ()
    solid = bool(thickness) and parts is thickness[0].solid
    plate = DrivenPlate(
        mechanism.layout, parts.hinges, thickness[0].stress_ratios if solid else None
    )
    found = displaced_by(plate, command)
    if found is None:
        raise ComputationFailed(
            "the beams find no equilibrium there: the mechanism buckles, or snaps"
        )
    before = linear(plate, command)
    return before, found.plus(before, -1.0)


def _of_elements(
    mechanism: Mechanism, mesh: Mesh, command: Applied, by_beams: Array
) -> tuple[Displaced, Displaced]:
    """Return linear theory by plane finite elements, and its change; that of the motions (k,) by
    beams is a start.
    """
    level = levels(mesh.resolution)[0]
    model = model_of(mechanism, level)
    response = responses(mechanism, solved(mechanism, level))
    C = response.compliance
    springs = np.where(np.isfinite(command.springs), command.springs, STIFF / np.diag(C))
    command = command._replace(springs=springs)
    loads = command.loads + springs * command.strokes
    motions = np.linalg.solve(np.eye(len(C)) + C * springs, C @ loads)
    forces = np.asarray(loads - springs * motions)
    before = Displaced(np.asarray(motions), forces, response.stress(forces))
    driving = np.flatnonzero(springs)
    if len(driving):
        found = _engaged(model, command, driving, (motions + by_beams)[driving])
    else:
        found = equilibria(model, command.loads[None])
    stress = stress_in_parts(model, found.fields[-1])[0] if model.regions else np.zeros(0)
    after = Displaced(found.pose[-1], found.load[-1], stress)
    if len(driving):
        after = _balanced(after, found.compliance[-1], command, driving)
    return before, after.plus(before, -1.0)


def _engaged(
    model: PlateModel,
    command: Applied,
    driving: Index,
    openings: Array,
) -> Equilibria:
    """Return equilibria of which the last has nearly the forces (a,) of the actuators, which hold
    their openings.
    """
    targets = [openings]
    for _ in range(MOST_CORRECTIONS):
        found = driven(model, driving.tolist(), np.array(targets))
        correction = _correction(
            found.load[-1], found.pose[-1], found.compliance[-1], command, driving
        )
        if np.abs(correction).max() < CLOSE * np.abs(openings).max():
            break
        targets.append(targets[-1] + correction)
    return found


def _correction(
    loads: Array, motions: Array, compliance: Array, command: Applied, driving: Index
) -> Array:
    """Return the change (a,) of the openings until the actuators have the forces that hold them."""
    springs = command.springs[driving]
    tangent = np.linalg.inv(compliance[np.ix_(driving, driving)])
    left = springs * (command.strokes - motions)[driving] - loads[driving]
    return np.asarray(np.linalg.solve(tangent + np.diag(springs), left))


def _balanced(
    at: Displaced,
    compliance: Array,
    command: Applied,
    driving: Index,
) -> Displaced:
    """Return an equilibrium after the last correction of the openings, which is linear."""
    opened = _correction(at.loads, at.motions, compliance, command, driving)
    added = np.zeros_like(at.loads)
    added[driving] = np.linalg.solve(compliance[np.ix_(driving, driving)], opened)
    return at._replace(motions=at.motions + compliance @ added, loads=at.loads + added)


def by_weight(mechanism: Mechanism, acceleration: Array) -> Changes:
    """Return the change of linear theory by beams under the weight in an acceleration (2,), mm/s^2."""
    layout = mechanism.layout
    ports, masses = weights(layout)
    plate = DrivenPlate(layout, ports=(*layout.ports, *ports))
    nothing = np.zeros(plate.ports)
    loads = np.concatenate(
        [np.zeros(len(layout.ports)), masses * np.resize(acceleration, len(masses))]
    )
    applied = Applied(loads, nothing, nothing)
    before = linear(plate, applied)
    found = displaced_by(plate, applied)
    if found is None:
        return Changes(
            [], "the beams find no equilibrium under the weight: the mechanism buckles, or snaps"
        )
    added = found.plus(before, -1.0)
    return Changes([_related({ANALYTIC: added}, added.error(1.0), before, layout)])


class Changes(NamedTuple):
    """Changes of linear theory at several commands.

    each : those found.   failure : why there are none; then no band of linear theory holds.
    """

    each: list[Change]
    failure: str = ""

    def of(self, model: str) -> list[Displaced] | None:
        """Return the changes to add to linear theory by a model; None where it stays linear."""
        if not self.each or any(model not in one.models for one in self.each):
            return None
        return [one.models[model] for one in self.each]

    def errors(self) -> list[Displaced]:
        """Return the possible errors of the changes of finite elements, one for each command."""
        return [one.error for one in self.each]

    @property
    def largest(self) -> str:
        """The largest changes of motion and stress as a text."""
        motion = 100 * max(one.motion for one in self.each)
        stress = 100 * max((one.stress for one in self.each), key=abs)
        return (
            f"the motion of the output by up to {motion:.2g} % and the highest hinge stress by "
            f"{stress:+.2g} %"
        )

    def notes(
        self,
        where: str,
        mesh: Mesh | None,
    ) -> list[str]:
        """Say whether the numbers of finite elements are those at finite displacement, and by how
        much they differ.
        """
        if mesh is None or not self.each:
            return []
        if all(set(one.models) == {ANALYTIC} for one in self.each):
            return [
                f"{where}, linear theory holds: by beams, finite displacement changes "
                f"{self.largest}"
            ]
        return [
            f"{where}, finite elements with finite rotations change {self.largest} from linear "
            "theory"
        ]

    def warnings(
        self, where: str, mesh: Mesh | None, motion: float = 0.0, stress: float = 0.0
    ) -> list[str]:
        """Warn of numbers by linear theory that do not hold.

        mesh : None if the numbers are those of linear theory.   motion, stress : relative bands
        that they have."""
        if self.failure:
            return [
                f"{where}, the numbers are those of linear theory, and may be far off: "
                f"{self.failure}"
            ]
        of_motion = max((one.motion for one in self.each), default=0.0)
        of_stress = max((abs(one.stress) for one in self.each), default=0.0)
        moved = of_motion > (motion or WORTH_A_WARNING)
        stressed = of_stress > (stress or WORTH_A_WARNING)
        if mesh is None and (moved or stressed):
            return [
                f"{where}, the numbers are those of linear theory: by beams, finite displacement "
                f"changes {self.largest}"
            ]
        return []


def changes(
    mechanism: Mechanism,
    mesh: Mesh | None,
    commands: Sequence[Applied],
) -> Changes:
    """Return the changes of linear theory at commands."""
    try:
        return Changes([change(mechanism, mesh, command) for command in commands])
    except ComputationFailed as failure:
        return Changes([], str(failure))


def relative_bands(
    found: ModelAnswer,
    motion: str,
    stress: str,
) -> tuple[float, float]:
    """Return the bands of two quantities of a model relative to their largest values; 0 without a
    band.
    """
    widths = list[float]()
    for name in (motion, stress):
        largest = float(np.max(np.abs(found.values[name]), initial=0.0))
        band = float(np.nanmax(found.bands.get(name, 0.0)))
        widths.append(band / largest if largest > 0 else 0.0)
    return widths[0], widths[1]
