"""The designs of a study: mechanisms that differ from a base in the values of some keys."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.fem.mesh import RESOLUTION
from flexfem.files.expressions import Evaluated, names_in, value_of
from flexfem.files.provenance import Assumptions
from flexfem.files.refusals import KeyPath
from flexfem.mechanism.keys import PARAMETERS, Key, keys
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.setup import WITHOUT_PRELOAD
from flexfem.questions.stiffness import LIMITS
from flexfem.refused import BadInput
from flexfem.study import arrays
from flexfem.study.batch import Batch
from flexfem.study.columns import Rows
from flexfem.study.factors import Column, Factor, columns_of
from flexfem.study.numbers import asked_numbers
from flexfem.study.plan import Study
from flexfem.units import without_unit

# designs in a part, which takes some seconds: by finite elements, and by questions of the analytic
# model
MESHED = {"fe": 4, "verify": 4, "three_dimensional": 2, "both": 4}
ASKED = 32
PRELOADED = ("modes", "stiffness")  # questions whose results contain residual stress and preloads
OUT_OF_PLANE = "out_of_plane"  # in the paths of numbers of such a motion
MODELS = {
    "analytic": "analytic",
    "verify": "both",
    "both": "both",
}  # of questions; others are finite elements


class Misfit(NamedTuple):
    """Why a base does not suit a study.

    key : of the study file at fault; () for the key that names the base.
    """

    key: KeyPath
    text: str


class Setting(NamedTuple):
    """A key that a column of factor values sets."""

    key: Key
    column: int


class Flag(NamedTuple):
    """A warning, and the designs (n,) to which it applies."""

    text: str
    where: AnyArray


class _Expression(NamedTuple):
    """The expression of a number, "" without one, and its parameters: key paths by name."""

    text: str
    parameters: dict[str, str]


class Family:
    """The designs of a study on one base, and what the study asks of each.

    This one is for any mechanism: the numbers of its designs are those of questions (`Study.ask`).
    A kind of mechanism with outputs of its own overrides methods, and returns its family from
    `Mechanism.answering("family")`.
    """

    # whether the numbers of one design by finite elements have bands of their own
    has_bands = True
    # whether every design is a mechanism that was checked when it was made
    makes_checked = True

    def __init__(
        self,
        base: Mechanism,
        study: Study,
        columns: Sequence[Column],
    ) -> None:
        self.base = base
        self.study = study
        self.columns = tuple(columns)

    # what the study file may ask of the base

    def misfit(self) -> Misfit | None:
        """Return why the base does not suit the study, None where it does."""
        if self.study.on_mechanism:
            return None
        expected = "expected factors with keys parameters.NAME for a mechanism"
        return Misfit((), expected)

    def columns_of(
        self,
        factor: Factor,
        unused_keys: frozenset[str],
    ) -> list[Column]:
        """Return the columns of a factor on the base.

        A normal distribution without a mean takes the value of the base. unused_keys : key paths on
        which no output depends.

        Raises BadInput: the base has no value for the mean, or several; or no output depends on the
        keys.
        """
        return [self._on_base(column, unused_keys) for column in columns_of([factor])]

    def _on_base(
        self,
        column: Column,
        unused_keys: frozenset[str],
    ) -> Column:
        names = ", ".join(column.keys)
        column_keys = [keys()[path] for path in column.keys]
        factor = column.factor
        if factor.kind == "normal" and factor.mean is None:
            means = {key.value_in(self.base) for key in column_keys}
            if len(means) != 1 or means == {None}:
                raise BadInput(f"mean is missing, and the stage has no single value of {names}")
            column = column._replace(factor=factor.model_copy(update={"mean": means.pop()}))
        for key in column_keys:
            expected = self.base.expected_of(key)
            if expected:
                raise BadInput(f"key = {key.path}, expected {expected}")
        used = [key for key in column_keys if key.path not in unused_keys]
        if not any(key.places_in(self.base) for key in used):
            raise BadInput(
                f"key = {names}, expected a number that affects outputs: overrides replace it, or "
                "no requested output needs it"
            )
        return column

    # keys in expressions

    @property
    def settings(self) -> list[Setting]:
        """All keys that columns set, those of one part after those of several."""
        found = [
            Setting(keys()[path], index)
            for index, column in enumerate(self.columns)
            for path in column.keys
        ]
        return sorted(found, key=lambda setting: setting.key.table[:1] == ("override",))

    @property
    def set_paths(self) -> list[str]:
        """Paths of the keys that columns set."""
        return [path for column in self.columns for path in column.keys]

    def is_fixed(self, name: str) -> bool:
        """Return whether a name is a key on which no column has an effect."""
        if name not in keys() or name in self.set_paths:
            return False
        return all(self.is_fixed(path) for path in self._expression_of(name).parameters.values())

    def values_of_key(
        self,
        path: str,
        known: dict[str, Array],
    ) -> Array:
        """Return the values (n,) of a key in the designs, or (1,) of the base; file units.

        known : factor values (n,) by the name of their column.
        """
        if path not in keys():
            return np.full(1, np.nan)
        for column in self.columns:
            if path in column.keys:
                return known[column.name]
        if self.is_fixed(path):
            return np.full(1, keys()[path].value_in(self.base), dtype=np.float64)
        return self._dependent_values(path, known)

    def _dependent_values(
        self,
        path: str,
        known: dict[str, Array],
    ) -> Array:
        """Return the values (n,) of a key that depends on columns."""
        text, parameters = self._expression_of(path)
        values = {name: self.values_of_key(key, known) for name, key in parameters.items()}
        return value_of(text, values)

    def _expression_of(self, path: str) -> _Expression:
        key = keys()[path]
        value = None
        if key.table in (PARAMETERS, ()):
            value = self._stated(key.table).get(key.attribute)
        text = value.text if isinstance(value, Evaluated) else ""
        used = names_in(text) if text else ()
        named = {without_unit(key): f"{PARAMETERS[0]}.{key}" for key in self._stated(PARAMETERS)}
        return _Expression(text, {name: key for name, key in named.items() if name in used})

    def _stated(self, table: tuple[str, ...]) -> dict[str, Any]:
        """Return the entries of a table of the base, by name."""
        stated = vars(self.base)
        for name in table:
            stated = stated.get(name, {})
        return dict(stated)

    # one design

    def mechanism(self, values: Array) -> Mechanism:
        """Return the design with factor values (columns,), file units, without provenance.

        Raises BadInput for a value that no file can give, one line that begins with its key.
        """
        return self._changed(self._changes(values))

    def _changes(self, values: Array) -> dict[str, Any]:
        changes = dict[str, Any]()
        for key, column in self.settings:
            value = float(values[column])
            expected = key.number.expected(value)
            if expected is not None:
                raise BadInput(f"{key.path} = {value:g}, expected {expected}")
            key.set_in(changes, self.base, value)
        return changes

    def _changed(self, changes: dict[str, Any]) -> Mechanism:
        """Return the base with changes as `replace` takes them, checked."""
        return self.base.replace(**changes, provenance={})

    def drawable(self, values: Array) -> Mechanism | None:
        """Return a design (columns,) that was checked by drawing, None where it cannot be made."""
        try:
            design = self.mechanism(values)
            design.check()
        except BadInput:
            return None
        return design

    def solved(self, design: Mechanism) -> Array:
        """Return all outputs (outputs,) of a design that was checked, in the order of the study.

        Raises BadInput, ComputationFailed.
        """
        found = self.numbers(design)
        return found.T.ravel() if self.study.banded else found[:, 0]

    def with_bands(self, design: Mechanism) -> list[float]:
        """Return all outputs of a design; where the family `has_bands`, followed by the bands.

        Raises BadInput, ComputationFailed.
        """
        return [float(each) for each in self.numbers(design).T.flat]

    def numbers(
        self,
        design: Mechanism,
        paths: Sequence[str] | None = None,
    ) -> Array:
        """Return numbers of questions about a design and their bands, (paths, 2).

        paths : by default those of `Study.ask`. Raises BadInput, ComputationFailed.
        """
        paths = self.study.ask if paths is None else paths
        return asked_numbers(design, paths, self.question_settings) if paths else np.empty((0, 2))

    @property
    def question_settings(self) -> dict[str, Any]:
        """Options of the questions, by name."""
        return self._mesh_settings | self._limit_settings | self._mode_settings

    @property
    def _mesh_settings(self) -> dict[str, Any]:
        # questions have the usual resolution themselves, and fewer triangles for slender bodies
        study = self.study
        settings: dict[str, Any] = {"models": MODELS.get(study.model, "elements")}
        if study.model not in ("analytic", "three_dimensional") and study.resolution != RESOLUTION:
            settings["resolution"] = study.resolution
        if study.model == "three_dimensional":
            settings["resolution"] = study.resolution
            settings |= {"solid": True, "thickness_resolution": study.layers}
        return settings

    @property
    def _limit_settings(self) -> dict[str, Any]:
        """The limits of stiffness at finite displacement, only where they are asked for."""
        limits = tuple(f"stiffness.{name}" for name in LIMITS)
        if any(path.startswith(limits) for path in self.study.ask):
            return {}
        return {"no_limits": True}

    @property
    def _mode_settings(self) -> dict[str, Any]:
        """The first frequency out of the plane only where it is asked for."""
        return {"in_plane": not any(OUT_OF_PLANE in path for path in self.study.ask)}

    # many designs

    @cached_property
    def batch(self) -> Batch | None:
        """The analytic model for many designs at once, None where each is computed alone."""
        if self.study.model != "analytic":
            return None
        return arrays.batch(self.base, self.study, self.columns)

    @property
    def part(self) -> int:
        """Designs in one part of the study, which takes some seconds."""
        if self.study.model in MESHED:
            return MESHED[self.study.model]
        if self.batch is None or {*self.study.outputs} - {*self.batch.outputs}:
            return ASKED
        return self.batch.part

    def flags(
        self,
        values: Array,
        rows: Rows,
    ) -> list[Flag]:
        """Return warnings about the results of designs (n, columns)."""
        everywhere = np.ones(len(values), dtype=bool)
        return [Flag(text, everywhere) for text in self.left_out]

    @property
    def left_out(self) -> list[str]:
        """Warnings that numbers leave out what the file of the base states."""
        questions = {path.partition(".")[0] for path in self.study.ask}
        layout = self.base.layout
        stated = bool(layout.residual_stress) or bool(np.any(layout.preload))
        return [WITHOUT_PRELOAD] if stated and questions - {*PRELOADED} else []

    # effects of factors

    def moves_no_mesh(self, column: Column) -> bool:
        """Return whether the analytic model shows all that a factor changes in finite elements."""
        return False

    def is_without_effect(
        self,
        one: Array,
        other: Array,
    ) -> bool:
        """Return whether two designs (columns,) are the same mechanism."""
        try:
            first = self.mechanism(one)
            second = self.mechanism(other)
        except BadInput:
            return False
        alike = first.frame == second.frame and first.material == second.material
        return first.hash == second.hash and alike

    # descriptions

    @property
    def identity(self) -> dict[str, Any]:
        """What of the base the rows depend on, for the hash of the study."""
        return {"stage": self.base.stated_hash, "heat": None, "override": []}

    @property
    def assumptions(self) -> Assumptions:
        """Key paths of the numbers of the base that are assumed or not stated."""
        return Assumptions([*self.base.assumed], [*self.base.not_stated])

    @property
    def analytic_words(self) -> str:
        """The analytic model in words."""
        return "rigid bodies and beam integrals of the hinges"

    @property
    def accuracy(self) -> str:
        """Text on the error of the numbers."""
        single = "the command of a question, for one mechanism, gives bands and other models"
        if self.batch is None:
            return single
        return f"{single}; {arrays.HOW_CHECKED}"


def family_of(
    base: Mechanism,
    study: Study,
    columns: Sequence[Column] = (),
) -> Family:
    """Return the designs of a study on a base."""
    make = base.answering("family") or Family
    family: Family = make(base, study, columns)
    return family
