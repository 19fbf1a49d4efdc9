"""A study with its base stage and table of designs, and its designs: factor values, arrays or
stages.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from flexfem.arrays import AnyArray, Array
from flexfem.files.expressions import Evaluated, names_in, value_of
from flexfem.files.provenance import Assumptions, Sourced, is_assumed
from flexfem.files.refusals import key_path, one_line, place_of, shown, suggestion
from flexfem.files.toml import PathLike, bad_key, read_bytes, validate
from flexfem.files.writing import digest
from flexfem.hinges.strength import required_law
from flexfem.mechanism.keys import PARAMETERS, Key, keys
from flexfem.mechanism.loading import load
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.paper.designs import Designs, lower
from flexfem.paper.responses import require_expansion
from flexfem.paper.stage import Stage
from flexfem.paper.stage_file import of_drive, of_heat
from flexfem.questions import warnings as accuracy
from flexfem.refused import BadInput
from flexfem.study.factors import Column, Factor, columns_on
from flexfem.study.plan import EXTENSIBLE, Asked, Study, normal_correlation
from flexfem.units import without_unit


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its feasible base stage or mechanism and its columns; `stem` names its results.

    `table` : the user's own table of designs, where the study has one.
    """

    path: Path
    study: Study
    base: Mechanism
    columns: tuple[Column, ...]
    stem: str
    table: DesignTable | None = None

    @property
    def stage(self) -> Stage:
        """The base stage of a study that is not of a mechanism."""
        assert isinstance(self.base, Stage)
        return self.base

    @property
    def count(self) -> int:
        """Number of designs."""
        return self.study.count if self.table is None else self.table.rows

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return self.study.outputs

    @property
    def assumptions(self) -> Assumptions:
        """Key paths of the numbers of stage and file that are assumed or not stated; those of drive
        and expansion only where the study uses them."""
        return self.assumptions_with("study", self.study)

    def assumptions_with(self, prefix: str, file: Sourced) -> Assumptions:
        """Return the assumptions of the base, and of the file with the questions."""
        base = self.base
        of_base = [[*self.base.assumed], [*self.base.not_stated]]
        if isinstance(base, Stage):
            unused = [of_drive] * (not self.study.driven) + [of_heat] * (self.study.drift is None)
            pairs = zip(base.drive_assumptions, base.heat_assumptions, strict=True)
            of_base = [
                [key for key in dict.fromkeys(a + b) if not any(of(key) for of in unused)]
                for a, b in pairs
            ]
        of_file = (
            [key for key, source in file.provenance.items() if is_assumed(source)],
            [*file.not_stated],
        )
        both = zip(of_base, of_file, strict=True)
        return Assumptions(
            *(
                [*(f"stage: {key}" for key in a), *(f"{prefix}: {key}" for key in b)]
                for a, b in both
            )
        )

    @property
    def stress_accuracy(self) -> str:
        """Text on the error of the highest neck stress and of quantities computed from it."""
        study = self.study
        base = self.base
        if study.on_mechanism:
            return (
                "the command of a question, for one mechanism, gives bands and the values of "
                "other models"
            )
        if study.model != "analytic":
            return (
                f"neck stress by finite elements of resolution {study.resolution} is "
                f"{study.stress_below}"
            )
        assert isinstance(base, Stage)
        stress = accuracy.stress_accuracy(study.formula, study.links, base.model)
        driven = accuracy.driven_accuracy(study.formula, study.links, base.model)
        return f"{stress}; for the range of the drive, {driven}" if study.driven else stress

    @property
    def hash(self) -> str:
        """SHA-256 of all inputs of the rows: without titles, figures, provenance, paths and the
        time limit.

        The number of designs counts only where it changes the first designs too. Derived outputs,
        and constraints on outputs, are computed from the rows and do not count."""
        study = self.study
        stage = self.base
        unneeded = {
            "name",
            "stage",
            "factor",
            "figure",
            "provenance",
            "check",
            "time_limit",
            "output",
            "constraint",
        }
        content = study.model_dump(mode="json", exclude=unneeded)
        if self.table is not None:
            content["sampling"]["file"] = self.table.digest
        if study.sampling.method in EXTENSIBLE:
            content["sampling"] |= {"designs": None, "base": None}
        # a hinge with an override does not follow the factor of its kind, even if its numbers are
        # those of the others
        overrides = (o for o in getattr(stage, "override", ()) if o.hinge or study.driven)
        used = study.names_of(*(constraint.value for constraint in study.refusing))
        numbers = sorted(name for name in used if is_fixed(name, self.columns, stage))
        of_stage = stage.stated_hash if isinstance(stage, MechanismFile) else stage.hash
        content |= {
            "stage": stage.drive_hash if isinstance(stage, Stage) and study.driven else of_stage,
            "heat": stage.heat_hash
            if isinstance(stage, Stage) and study.drift is not None
            else None,
            "draws": study.draws,
            "override": sorted((*o.place, sorted(o.changes)) for o in overrides),
            "columns": [
                [name, paths, factor.model_dump(mode="json", exclude={"key", "keys", "label"})]
                for name, paths, factor in self.columns
            ],
            "refused": [[c.value, c.least, c.most, c.title] for c in study.refusing]
            + [[output.name, output.expression] for output in study.output if output.name in used]
            + [[name, keys()[name].value_in(stage)] for name in numbers],
        }
        return digest(content)


def load_study(path: PathLike) -> LoadedStudy:
    """Read a study file and its base stage.

    Raises BadInput as `toml.validate`, or for a base stage that cannot be read or made: one line
    with file, line, key."""
    study = validate(Study, path)
    stage, columns = base_of(path, study, study)
    table = None
    if study.sampling.file is not None:
        try:
            table = design_table_of(Path(path).parent / study.sampling.file, columns)
        except BadInput as error:
            raise bad_key(path, ("sampling", "file"), f"sampling.file: {error}") from None
    return LoadedStudy(Path(path), study, stage, columns, Path(path).stem, table)


def base_of(path: PathLike, asked: Asked, study: Study) -> tuple[Mechanism, tuple[Column, ...]]:
    """Return the base that a file names, and the columns of its factors on this base, as
    `columns_on`.

    Raises BadInput with file, line and key, also where an expression uses a key that the base
    leaves to a default."""
    base = base_stage(path, study)
    columns = list[Column]()
    for index, factor in enumerate(asked.varied):
        try:
            columns += columns_on(base, factor, asked.unused_keys)
        except BadInput as error:
            raise bad_key(path, (asked.array, index), f"{asked.array}[{index}].{error}") from None
    for place, expression in asked.expressions.items():
        for name in names_in(expression):
            if is_fixed(name, columns, base) and keys()[name].value_in(base) is None:
                raise bad_key(path, place, f"{key_path(place)}: the stage does not state {name}")
    return base, tuple(columns)


def base_stage(path: PathLike, study: Study) -> Mechanism:
    """Return the base that a study names. Raises BadInput where it does not fit."""
    try:
        stage = load(os.path.normpath(Path(path).parent / study.stage))
    except BadInput as error:
        raise bad_key(path, ("stage",), f"stage = {shown(study.stage)}: {error}") from None
    if isinstance(stage, MechanismFile) != study.on_mechanism:
        expected = (
            "a mechanism file"
            if study.on_mechanism
            else "factors with keys parameters.NAME for a mechanism"
        )
        raise bad_key(path, ("stage",), f"stage = {shown(study.stage)}, expected {expected}")
    if isinstance(stage, MechanismFile):
        return stage
    problem = f"model = {shown(study.model)} on a stage with model = {shown(stage.model)}, expected"
    if study.model in ("fe", "verify") and stage.model == "corrected":
        raise bad_key(path, ("model",), f'{problem} "analytic": the finite elements are plane')
    if study.model == "three_dimensional" and stage.model != "plane_stress":
        why = "it is for plane problems, and in three dimensions the faces are free"
        raise bad_key(path, ("model",), f"{problem} a stage without one: {why}")
    if study.driven and not stage.actuator:
        raise bad_key(
            path,
            ("drive", "actuators"),
            "drive.actuators = true, expected a base stage with [[actuator]]",
        )
    requirements: dict[str, Callable[[], object]] = {
        "life": lambda: required_law(stage.material),
        "drift": lambda: require_expansion(stage, frame=True),
    }
    for key, require in requirements.items():
        try:
            if getattr(study, key) is not None:
                require()
        except BadInput as error:
            raise bad_key(path, (key,), f"{key}, on the base stage: {error}") from None
    return stage


def is_fixed(name: str, columns: Sequence[Column], stage: Mechanism) -> bool:
    """Return whether a name is a key that no column sets, directly or, for one chain, by the key of
    all chains.
    """
    set_by = [path for column in columns for path in column.keys]
    if name not in keys() or name in set_by:
        return False
    if isinstance(stage, MechanismFile):
        return all(is_fixed(used, columns, stage) for used in _expression_of(name, stage)[1])
    places = keys()[name].places_in(stage) if name.startswith("override.") else []
    return not any(place in keys()[path].places_in(stage) for path in set_by for place in places)


def _expression_of(path: str, mechanism: Mechanism) -> tuple[str, dict[str, str]]:
    """Return the expression of a number, "" without one, and the key paths of its parameters with
    their names there.
    """
    key = keys()[path]
    stated = mechanism.parameters
    value = {PARAMETERS: stated, (): vars(mechanism)}.get(key.table, {}).get(key.attribute)
    text = value.text if isinstance(value, Evaluated) else ""
    used = names_in(text) if text else ()
    return text, {
        f"{PARAMETERS[0]}.{name}": without_unit(name)
        for name in stated
        if without_unit(name) in used
    }


MOST_BYTES = {
    ".csv": 2**26,
    ".parquet": 2**31,
}  # size of a table of designs, which is held in memory
BLOCK = 1024  # Monte Carlo designs in a block, which has its own random stream
INSIDE = (
    2.0**-53
)  # least distance of a quantile from 0 and 1, where a normal distribution is infinite


class DesignTable(NamedTuple):
    """A checked table of designs: its file, the SHA-256 of its content, and its number of rows."""

    path: Path
    digest: str
    rows: int


def design_table_of(path: Path, columns: Sequence[Column]) -> DesignTable:
    """Read a table of designs and check every value.

    Raises BadInput, one line with file, row, column, value and what was expected: the file is
    missing, not CSV or Parquet, or has no rows; a column is missing or repeated; a value is not
    finite or outside the limits of its key."""
    path = Path(os.path.abspath(path))
    where = place_of(path)
    if path.suffix not in MOST_BYTES:
        raise BadInput(f"{where}, expected a file name that ends in {' or '.join(MOST_BYTES)}")
    sha256, values = _read(path, columns)
    if len(values) == 0:
        raise BadInput(f"{where}: no rows, expected one for each design")
    for column, numbers in zip(columns, values.T, strict=True):
        for key in (keys()[path] for path in column.keys):
            for row in np.flatnonzero(~np.isfinite(numbers) | key.number.refuses(numbers))[:1]:
                at = f"row {row + 1}, column {shown(column.name)}"
                value = float(numbers[row])
                raise BadInput(
                    f"{where}: {at} = {value:g}, expected {key.number.expected(value)} for "
                    f"{key.path}"
                )
    return DesignTable(path, sha256, len(values))


def _read(path: Path, columns: Sequence[Column]) -> tuple[str, Array]:
    """Return SHA-256 and values (rows, columns) of a table of designs, cached until the file
    changes.
    """
    stat = os.stat(path) if path.exists() else None
    version = () if stat is None else (stat.st_ino, stat.st_size, stat.st_mtime_ns)
    return _table(path, version, tuple(column.name for column in columns))


@lru_cache(maxsize=2)
def _table(path: Path, version: tuple[int, ...], names: tuple[str, ...]) -> tuple[str, Array]:
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    where = place_of(path)
    content = read_bytes(path, MOST_BYTES[path.suffix])
    try:
        if path.suffix == ".csv":
            one_thread = pyarrow.csv.ReadOptions(use_threads=False)  # so that errors name the row
            numbers = pyarrow.csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.float64()), null_values=[]
            )
            table = pyarrow.csv.read_csv(
                pa.BufferReader(content), one_thread, convert_options=numbers
            )
        else:
            table = pq.read_table(pa.BufferReader(content))
        present = table.column_names
    except (pa.ArrowException, OSError, ValueError) as error:
        kind = (
            "CSV with commas between numbers"
            if path.suffix == ".csv"
            else "a Parquet file, or damaged"
        )
        raise BadInput(f"{where}: not {kind}: {one_line(str(error), 160)}") from None
    for name in names:
        column = f"{where}: column {shown(name)}"
        if present.count(name) != 1:
            close = suggestion(name, present) or f", found {one_line(', '.join(present), 160)}"
            fault = "appears twice" if name in present else "is missing"
            raise BadInput(
                f"{column} {fault}, expected one for each factor{'' if name in present else close}"
            )
        kind = table[name].type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise BadInput(f"{column} of type {kind}, expected numbers")
    values = [
        table[name].cast(pa.float64(), safe=False).to_numpy() for name in names
    ]  # empty cells are nan
    return hashlib.sha256(content).hexdigest(), np.column_stack(values)


def sample(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Return the factor values (stop - start, columns) of the designs from `start` up to `stop`, in
    file units.

    The last factor of a grid varies fastest. A sample of an `EXTENSIBLE` method begins with every
    smaller one."""
    factors = [column.factor for column in loaded.columns]
    sampling = loaded.study.sampling
    start = max(start, 0)
    stop = min(stop, loaded.count)
    if loaded.table is not None:
        sha256, values = _read(loaded.table.path, loaded.columns)
        if sha256 != loaded.table.digest:
            raise BadInput(
                f"{place_of(loaded.table.path)}: changed since the study was read: run again"
            )
        return values[start:stop]
    if sampling.method == "grid":
        points = [grid_points(factor) for factor in factors]
        places = np.unravel_index(np.arange(start, stop), [len(values) for values in points])
        return np.stack(
            [values[place] for values, place in zip(points, places, strict=True)], axis=-1
        )
    if sampling.method == "latin_hypercube":
        return _values_at(
            loaded, _latin_hypercube(sampling.seed, len(factors), loaded.count)[start:stop]
        )
    draw = {"monte_carlo": monte_carlo, "sobol": _sobol, "saltelli": _saltelli}[sampling.method]
    return _values_at(loaded, draw(sampling.seed or 0, len(factors), start, stop))


def _values_at(loaded: LoadedStudy, quantiles: Array) -> Array:
    """Return the factor values (n, columns) at independent quantiles (n, columns), with the
    correlations of the study.

    A Gaussian copula (R. B. Nelsen, An Introduction to Copulas, 2nd ed., Springer 2006): normal
    deviates `L z` with `L L' = R` of `plan.normal_correlation`; every factor keeps its own
    distribution."""
    names = [column.name for column in loaded.columns]
    pairs = loaded.study.correlation
    dependent = sorted({names.index(name) for pair in pairs for name in pair.factors})
    result = np.clip(quantiles, INSIDE, 1.0 - INSIDE)
    if dependent and len(result):
        L = np.linalg.cholesky(normal_correlation([names[index] for index in dependent], pairs))
        result[:, dependent] = np.clip(
            ndtr(ndtri(result[:, dependent]) @ L.T), INSIDE, 1.0 - INSIDE
        )
    return np.stack(
        [at_quantile(column.factor, u) for column, u in zip(loaded.columns, result.T, strict=True)],
        axis=-1,
    )


def grid_points(factor: Factor) -> Array:
    """Return the points (k,) of a factor in a grid."""
    if factor.values is not None:
        return np.array(factor.values)
    assert factor.start is not None and factor.end is not None and factor.points is not None
    return (np.geomspace if factor.scale == "log" else np.linspace)(
        factor.start, factor.end, factor.points
    )


def at_quantile(factor: Factor, u: Array) -> Array:
    """Return the values (n,) of a factor at quantiles `u` (n,) of its distribution, 0 < u < 1."""
    if factor.values is not None:
        return np.array(factor.values)[(u * len(factor.values)).astype(np.int64)]
    low, high = (
        (factor.start, factor.end) if factor.kind == "range" else (factor.lower, factor.upper)
    )
    if factor.kind == "normal":
        mean = factor.mean or 0.0
        sd = factor.sd or 1.0
        if low is high is None:
            return np.asarray(mean + sd * ndtri(u))
        from scipy.stats import truncnorm

        ends = (
            -np.inf if low is None else (low - mean) / sd,
            np.inf if high is None else (high - mean) / sd,
        )
        return np.asarray(truncnorm.ppf(u, *ends, loc=mean, scale=sd))
    assert low is not None and high is not None
    if factor.scale == "log":
        return np.asarray(low * (high / low) ** u)
    return np.asarray(low + u * (high - low))


def monte_carlo(seed: int, columns: int, start: int, stop: int) -> Array:
    """Return independent quantiles (stop - start, columns) of the designs from `start` up to
    `stop`, 0 <= u < 1.
    """
    blocks = range(start // BLOCK, -(-stop // BLOCK))
    streams = (
        np.random.Philox(np.random.SeedSequence(seed, spawn_key=(block,))) for block in blocks
    )
    drawn = [np.random.Generator(stream).random((BLOCK, columns)) for stream in streams]
    return np.concatenate([np.empty((0, columns)), *drawn])[start % BLOCK :][: stop - start]


@lru_cache(maxsize=1)
def _engine(seed: int, columns: int) -> Any:
    """Return a scrambled Sobol sequence, cached with its position because most parts are drawn in
    their order.
    """
    from scipy.stats import qmc

    return qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(seed))


def _sobol(seed: int, columns: int, start: int, stop: int) -> Array:
    """Return the points `start` up to `stop` of the Sobol sequence."""
    engine = _engine(seed, columns)
    if engine.num_generated > start:
        engine.reset()
    if start > engine.num_generated:
        engine.fast_forward(start - engine.num_generated)
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # warns of a number of points that is no power of two
        return np.asarray(engine.random(stop - start))


def _saltelli(seed: int, columns: int, start: int, stop: int) -> Array:
    """Return rows of the scheme of A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: for
    every Sobol point (A, B) the designs A, A with one column of B at a time, and B."""
    group = columns + 2
    k = np.arange(columns)
    first = start // group
    points = _sobol(seed, 2 * columns, first, -(-stop // group))
    rows = np.repeat(points[:, None, :columns], group, axis=1)
    rows[:, 1 + k, k] = rows[:, -1] = points[:, columns:]
    return rows.reshape(-1, columns)[start - group * first :][: stop - start]


@lru_cache(maxsize=1)
def _latin_hypercube(seed: int | None, columns: int, designs: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(columns, rng=np.random.default_rng(seed)).random(designs))


def designs_of(loaded: LoadedStudy, values: Array) -> Designs:
    """Return the designs with factor values (n, columns), file units, unchecked."""
    designs = lower(loaded.stage).repeated(len(values))
    for key, column in _settings(loaded):
        for field, place in key.places_in(loaded.stage):
            index: tuple[slice | int, ...] = (slice(None), *place)
            getattr(designs, field)[index] = key.number.factor * values[:, column]
    return designs


def plate_of(loaded: LoadedStudy, values: Array) -> Mechanism:
    """Return the stage or mechanism, without provenance, of the design with factor values
    (columns,), file units.

    Raises BadInput for a value that no file can give, one line that begins with its key.
    """
    base = loaded.base
    changes = dict[str, Any]()
    for key, column in _settings(loaded):
        value = float(values[column])
        expected = key.number.expected(value)
        if expected is not None:
            raise BadInput(f"{key.path} = {value:g}, expected {expected}")
        key.set_in(changes, base, value)
    if isinstance(base, MechanismFile):
        return base.replace(
            **changes | {"provenance": {}}
        )  # whose update takes a third of the time
    return Stage(**base.merged(changes) | {"provenance": {}})


def stage_of(loaded: LoadedStudy, values: Array) -> Stage:
    """Return the stage of the design with factor values (columns,) of a study that is not of a
    mechanism.
    """
    stage = plate_of(loaded, values)
    assert isinstance(stage, Stage)
    return stage


def _settings(loaded: LoadedStudy) -> list[tuple[Key, int]]:
    """Return every key that a column sets with the index of the column, keys of one chain after
    those of all three.
    """
    settings = [
        (keys()[path], index) for index, column in enumerate(loaded.columns) for path in column.keys
    ]
    return sorted(settings, key=lambda setting: setting[0].table[:1] == ("override",))


class Judged(NamedTuple):
    """Derived outputs (n,) by name, nan where not finite, and which designs (n,) keep all
    constraints.
    """

    derived: dict[str, Array]
    feasible: AnyArray


def judge(loaded: LoadedStudy, columns: Mapping[str, Array], ok: AnyArray) -> Judged:
    """Evaluate the derived outputs and constraints of designs.

    columns : factors and outputs of the model, (n,) each, by name, file units.   ok : which have a
    result, bool (n,)."""
    known = dict(columns)
    feasible = np.array(ok, dtype=bool)
    for output in loaded.study.output:
        value = evaluated(loaded, output.expression, known, len(ok))
        known[output.name] = np.where(ok & np.isfinite(value), value, np.nan)
    for constraint in loaded.study.constraint:
        feasible &= ~constraint.broken(evaluated(loaded, constraint.value, known, len(ok)))
    return Judged({output.name: known[output.name] for output in loaded.study.output}, feasible)


def refusals_of(loaded: LoadedStudy, values: Array) -> AnyArray:
    """Return reasons (n,) to refuse designs with factor values (n, columns), "" where there is
    none.

    Constraints on factors and keys only are evaluated here, before designs are solved.
    """
    study = loaded.study
    reason = np.full(len(values), "", dtype=object)
    known = dict(zip((column.name for column in loaded.columns), values.T, strict=True))
    for constraint in study.refusing:
        value = evaluated(loaded, constraint.value, known, len(values))
        for index in np.flatnonzero(constraint.broken(value) & (reason == "")):
            reason[index] = (
                f"constraint {constraint.title} = {value[index]:.6g}, expected "
                f"{constraint.expected}"
            )
    return reason


def evaluated(loaded: LoadedStudy, expression: str, known: dict[str, Array], size: int) -> Array:
    """Return the value (size,) of an expression in file units; nan where a column is missing.

    known : factors and outputs, (n,) each, by name; derived outputs and keys that are used are
    added to them."""
    derived = {output.name: output.expression for output in loaded.study.output}
    for name in names_in(expression):
        if name not in known:
            of = derived.get(name)
            known[name] = (
                _key_values(loaded, name, known)
                if of is None
                else evaluated(loaded, of, known, size)
            )
    return np.broadcast_to(value_of(expression, known), (size,))


def _key_values(loaded: LoadedStudy, path: str, columns: Mapping[str, Array]) -> Array:
    """Return the values (n,) of a key that a factor sets, or the value (1,) of the base stage, in
    file units.
    """
    if path not in keys():
        return np.full(1, np.nan)
    for column in loaded.columns:
        if path in column.keys:
            return columns[column.name]
    key = keys()[path]
    if is_fixed(path, loaded.columns, loaded.base):
        return np.full(1, key.value_in(loaded.base), dtype=np.float64)
    if isinstance(loaded.base, MechanismFile):
        text, used = _expression_of(path, loaded.base)
        return value_of(
            text, {name: _key_values(loaded, each, columns) for each, name in used.items()}
        )
    designs = designs_of(
        loaded, np.column_stack([columns[column.name] for column in loaded.columns])
    )
    ((field, place),) = key.places_in(loaded.stage)
    return np.asarray(getattr(designs, field)[:, *place] / key.number.factor)
