"""Studies of the stage: their outputs, and the finite elements of one design."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.modes import modes
from flexfem.fem.response import Response, heat_response, unit_response
from flexfem.files.provenance import Assumptions
from flexfem.files.refusals import shown
from flexfem.hinges.strength import required_law
from flexfem.mechanism.keys import LIFE_CONSTANTS, keys
from flexfem.mechanism.layout import Payload
from flexfem.mechanism.mechanism import Mechanism
from flexfem.meshing.process import Limit, MeshTimeout
from flexfem.paper import fields
from flexfem.paper import warnings as warning
from flexfem.paper.batch import (
    LOWEST,
    UNMOVED,
    StageBatch,
    motion_of_study,
    payload_of_study,
)
from flexfem.paper.commanding import element_ranges
from flexfem.paper.designs import design_arrays
from flexfem.paper.life import element_values, lives, preload_warnings
from flexfem.paper.model import analyse, in_range
from flexfem.paper.outputs import DesignAnswers, ErrorPercentages, values_of
from flexfem.paper.responses import in_plane, rates_of, require_expansion
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import of_drive, of_heat
from flexfem.paper.stage_mesh import layers_of, mesh_sectors, plate_of, sheet_of
from flexfem.paper.vibration import vibrating
from flexfem.questions.bands import error_matrix, levels, mesh_band
from flexfem.questions.life import CyclicMotion
from flexfem.questions.setup import Analytic
from flexfem.refused import BadInput, ComputationFailed
from flexfem.study.columns import Rows
from flexfem.study.factors import Column
from flexfem.study.family import Family, Flag, Misfit
from flexfem.study.plan import Study

# attributes that leave mesh and stiffness as they are
INELASTIC = frozenset({"yield_strength", "density", "expansion", *LIFE_CONSTANTS})
# models without an analytic part, to whose hinges no formula applies
ELEMENTS_ALONE = ("fe", "three_dimensional")


def family(
    base: Stage,
    study: Study,
    columns: Sequence[Column],
) -> StageFamily:
    """Return the designs of a study on a stage."""
    return StageFamily(base, study, columns)


class StageFamily(Family):
    """The designs of a study on a stage, whose outputs are the columns of `study.columns`."""

    has_bands = False
    makes_checked = False

    def __init__(
        self,
        base: Stage,
        study: Study,
        columns: Sequence[Column],
    ) -> None:
        super().__init__(base, study, columns)
        self.stage = base

    def misfit(self) -> Misfit | None:
        """Return why the stage does not suit the study, None where it does."""
        study = self.study
        stage = self.stage
        if study.on_mechanism:
            return Misfit((), "expected a mechanism file")
        problem = (
            f"model = {shown(study.model)} on a stage with model = {shown(stage.model)}, expected"
        )
        if study.model in ("fe", "verify") and stage.model == "corrected":
            text = f'{problem} "analytic": the finite elements are plane'
            return Misfit(("model",), text)
        if study.model == "three_dimensional" and stage.model != "plane_stress":
            why = "it is for plane problems, and in three dimensions the faces are free"
            return Misfit(("model",), f"{problem} a stage without one: {why}")
        if study.driven and not stage.actuator:
            text = "drive.actuators = true, expected a base stage with [[actuator]]"
            return Misfit(("drive", "actuators"), text)
        if study.life is not None:
            unmet = _refusal_of(lambda: required_law(stage.material))
            if unmet:
                return Misfit(("life",), f"life, on the base stage: {unmet}")
        if study.drift is not None:
            unmet = _refusal_of(lambda: require_expansion(stage, frame=True))
            if unmet:
                return Misfit(("drift",), f"drift, on the base stage: {unmet}")
        return None

    def is_fixed(self, name: str) -> bool:
        """Return whether a name is a key that no column sets, directly or, for one chain, by the
        key of all chains.
        """
        set_by = self.set_paths
        if name not in keys() or name in set_by:
            return False
        if not name.startswith("override."):
            return True
        places = keys()[name].places_in(self.stage)
        return not any(
            place in keys()[path].places_in(self.stage) for path in set_by for place in places
        )

    def _dependent_values(
        self,
        path: str,
        known: dict[str, Array],
    ) -> Array:
        """Return the values (n,) of a key of one chain that a column sets by the key of all."""
        values = np.column_stack([known[column.name] for column in self.columns])
        designs = self._batch.designs(values)
        key = keys()[path]
        ((field, place),) = key.places_in(self.stage)
        return np.asarray(getattr(designs, field)[:, *place] / key.number.factor)

    def _changed(self, changes: dict[str, Any]) -> Stage:
        """Return the stage with changes, not checked."""
        return Stage(**self.stage.merged(changes) | {"provenance": {}})

    def solved(self, design: Mechanism) -> Array:
        """Return all outputs (outputs,) of a design by finite elements.

        Raises BadInput, ComputationFailed, as `solved_design` and `analyse`.
        """
        study = self.study
        stage = cast(Stage, design)
        found = solved_design(
            stage, study.resolution, Limit(study.time_limit), requests_of(study, stage)
        )
        if found.drives is not None and np.isnan(found.drives.range).any():
            raise BadInput(UNMOVED)
        columns = values_of(found, study.columns, study.rotation)[0]
        return np.array([*columns, *self.numbers(design)[:, 0]])

    def with_bands(self, design: Mechanism) -> list[float]:
        """Return all outputs of a design, without bands."""
        return [float(value) for value in self.solved(design)]

    @property
    def question_settings(self) -> dict[str, Any]:
        """Options of the questions, by name."""
        study = self.study
        settings = self._mesh_settings
        if settings["models"] != "elements":
            settings["analytic"] = Analytic(study.mobility, study.formula, study.links)
        return settings

    @cached_property
    def batch(self) -> StageBatch | None:
        """The analytic model for many designs at once; finite elements solve one at a time."""
        return self._batch if self.study.model == "analytic" else None

    @cached_property
    def _batch(self) -> StageBatch:
        return StageBatch(self.stage, self.study, self.columns, self.settings, self._stage)

    def _stage(self, values: Array) -> Stage:
        return self._changed(self._changes(values))

    def flags(
        self,
        values: Array,
        rows: Rows,
    ) -> list[Flag]:
        """Return warnings about the results of designs (n, columns)."""
        return [*self._flags(values, rows)]

    def _flags(
        self,
        values: Array,
        rows: Rows,
    ) -> Iterator[Flag]:
        study = self.study
        everywhere = np.ones(len(values), dtype=bool)
        if study.model not in ELEMENTS_ALONE:
            with np.errstate(all="ignore"):
                inside = in_range(self._batch.designs(values), study.formula).all(axis=(1, 2))
            text = f"hinge formula {study.formula} outside its range of t/R"
            yield Flag(text, np.asarray(~inside))
        if study.life is not None:
            yield from self._flags_of_life(rows)
            for text in preload_warnings(self.stage):
                yield Flag(text, everywhere)
        if study.drift is not None:
            for text in warning.of_stacks(self.stage):
                yield Flag(f"drift: {text}", everywhere)

    def _flags_of_life(self, rows: Rows) -> Iterator[Flag]:
        outputs = self.study.outputs
        cycles = rows.values[:, outputs.index("life_cycles")]
        safety = rows.values[:, outputs.index("safety_factor")]
        low, high = required_law(self.stage.material).range
        yields = np.asarray(safety < 1)
        outside = np.asarray((cycles < low) | (cycles > high))
        yield Flag("life from elastic stress, beyond yield", yields)
        yield Flag("life extrapolated, outside the cycles of Basquin's law", outside & ~yields)

    def moves_no_mesh(self, column: Column) -> bool:
        """Return whether a factor leaves mesh and stiffness as they are, such as a yield strength."""
        return {keys()[path].attribute for path in column.keys} <= INELASTIC

    def is_without_effect(
        self,
        one: Array,
        other: Array,
    ) -> bool:
        """Return False: every key of a stage changes the stage."""
        return False

    @property
    def analytic_words(self) -> str:
        """The analytic model in words."""
        study = self.study
        mobility = study.mobility or self.stage.mobility
        return f"{study.formula}, mobility {mobility}{', elastic links' * study.links}"

    @property
    def identity(self) -> dict[str, Any]:
        """What of the stage the rows depend on, for the hash of the study.

        A hinge with an override does not follow the factor of its kind, even if its numbers are
        those of the others.
        """
        study = self.study
        stage = self.stage
        used = [each for each in stage.override if each.hinge or study.driven]
        return {
            "stage": stage.drive_hash if study.driven else stage.hash,
            "heat": None if study.drift is None else stage.heat_hash,
            "override": sorted((*each.place, sorted(each.changes)) for each in used),
        }

    @property
    def assumptions(self) -> Assumptions:
        """Key paths of the numbers of the stage that are assumed or not stated; those of drive and
        expansion only where the study uses them.
        """
        both = zip(self.stage.drive_assumptions, self.stage.heat_assumptions, strict=True)
        return Assumptions(
            *([key for key in dict.fromkeys(a + b) if self._is_used(key)] for a, b in both)
        )

    def _is_used(self, key: str) -> bool:
        if of_drive(key) and not self.study.driven:
            return False
        return not of_heat(key) or self.study.drift is not None

    @property
    def accuracy(self) -> str:
        """Text on the error of the highest neck stress and of what is computed from it."""
        study = self.study
        if study.model != "analytic":
            return (
                f"neck stress by finite elements of resolution {study.resolution} is "
                f"{study.stress_below}"
            )
        stress = warning.stress_accuracy(study.formula, study.links, self.stage.model)
        if not study.driven:
            return stress
        driven = warning.driven_accuracy(study.formula, study.links, self.stage.model)
        return f"{stress}; for the range of the drive, {driven}"


def _refusal_of(require: Callable[[], object]) -> str:
    """Return the text of the error that a requirement raises, "" without one."""
    try:
        require()
    except BadInput as error:
        return str(error)
    return ""


# finite elements of one design


class Requests(NamedTuple):
    """What finite elements compute of a design beside its stiffness.

    predicted : (3, 3), stiffness that predicts the loads in (18); its errors are computed.
    bands : compute the mesh bands of these errors too, from coarser meshes.
    payload : on the platform, for natural frequencies.
    repeated : repeated motion, for fatigue lives.
    driven, warm : compute the ranges of the stage's own drive, and its thermal drift.
    layers : solve in three dimensions, without the above; rotations of base hinges are those of the
    mid-plane.
    """

    predicted: Array | None = None
    bands: bool = True
    payload: Payload | None = None
    repeated: CyclicMotion | None = None
    driven: bool = False
    warm: bool = False
    layers: int = 0


AT_REST = Requests()


def requests_of(study: Study, stage: Stage) -> Requests:
    """Return what a study requests of the finite elements of a stage. Raises as `analyse`."""
    if study.model == "three_dimensional":
        return Requests(layers=study.layers)
    predicted = None
    if study.model == "verify":
        predicted = analyse(stage, study.mobility, study.formula).stiffness
    return Requests(
        predicted,
        study.bands,
        payload_of_study(study),
        motion_of_study(study),
        study.driven,
        study.drift is not None,
    )


def solved_design(
    stage: Stage, resolution: int, limit: Limit, requests: Requests = AT_REST
) -> DesignAnswers:
    """Return the finite-element results of one feasible design, n = 1.

    Raises
    ------
    BadInput : the finite elements do not accept the design.
    ComputationFailed : mesh or solver failed; MeshTimeout after the time limit, in three dimensions
    that of gmsh.
    """
    response = elements(stage, resolution, limit, requests.layers)
    found = _at_rest(stage, response)
    if requests.payload is not None:
        structure = vibrating(stage, response.mesh, requests.payload)
        found = found._replace(frequencies=modes(structure, LOWEST).frequencies[None])
    if requests.repeated is not None:
        cycles = element_values(stage, response, requests.repeated)
        fatigue = design_arrays(stage).fatigue
        found = found._replace(
            lives=lives(cycles, fatigue, found.yield_strength, requests.repeated)
        )
    if requests.driven:
        found = found._replace(drives=element_ranges(stage, response.mesh))
    if requests.warm:
        expansions = [coefficient.item() for coefficient in in_plane(design_arrays(stage))]
        warm = heat_response(response.mesh, plate_of(stage), *expansions)
        found = found._replace(drift=rates_of(warm.motions[None]))
    if requests.predicted is not None:
        found = found._replace(errors=_errors(stage, resolution, limit, requests, response))
    return found


def _at_rest(stage: Stage, response: Response) -> DesignAnswers:
    """Return stiffness, stress and rotations of one design by finite elements."""
    K = np.linalg.inv(response.compliance)
    K = (K + K.T) / 2  # round-off
    turning = np.abs(K @ fields.base_rotations(stage, response)).max(axis=1)
    highest = fields.neck_stresses(stage, response, K).highest.max(axis=(1, 2))
    envelope = np.array([fields.envelope(response)])
    strength = design_arrays(stage).yield_strength
    return DesignAnswers(K[None], highest[None], turning[None], strength, envelope)


def elements(
    stage: Stage,
    resolution: int,
    limit: Limit,
    layers: int = 0,
) -> Response:
    """Mesh a stage and condense it sector by sector. Raises as `solved_design`."""
    sectors = mesh_sectors(stage, resolution, limit)
    if layers:
        return unit_response(sectors, sheet_of(stage), layers_of(stage, layers))
    return unit_response(sectors, plate_of(stage))


def _errors(
    stage: Stage, resolution: int, limit: Limit, requests: Requests, response: Response
) -> ErrorPercentages:
    """Return the errors of a predicted stiffness, with bands from coarser meshes; one that fails is
    left out.
    """
    predicted = requests.predicted
    assert predicted is not None
    lever = stage.lever
    errors = error_matrix(predicted, response.compliance, lever)
    along = np.diag(errors)
    across = np.max(np.abs(errors - np.diag(along)), axis=0)
    if not requests.bands:
        return ErrorPercentages(along[None], across[None], None)
    on_meshes = _on_coarser_meshes(stage, resolution, limit, predicted) | {resolution: along}
    resolutions = np.array(list(on_meshes))
    by_direction = np.transpose(list(on_meshes.values()))
    half_widths = [mesh_band(resolutions, values) for values in by_direction]
    return ErrorPercentages(along[None], across[None], np.array([half_widths]))


def _on_coarser_meshes(
    stage: Stage, resolution: int, limit: Limit, predicted: Array
) -> dict[int, Array]:
    """Return the errors (3,) along the commands on coarser meshes, coarse to fine; one mesh may
    fail.
    """
    found = dict[int, Array]()
    failures = list[ComputationFailed]()
    for coarser in levels(resolution)[:2]:
        try:
            C = elements(stage, coarser, limit).compliance
            found[coarser] = np.diag(error_matrix(predicted, C, stage.lever))
        except MeshTimeout:
            raise
        except ComputationFailed as failure:
            failures.append(failure)
    if not found:
        raise failures[0]
    return found
