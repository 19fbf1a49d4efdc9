"""A study with all that its file names, and its designs: their factor values, as arrays or as stages."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections import ChainMap
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np

from flexfem.analytic.responses import require_expansion
from flexfem.arrays import AnyArray, Array
from flexfem.files.provenance import Doubts, is_assumed
from flexfem.files.refusals import key_path, one_line, place_of, shown, suggestion
from flexfem.files.toml import bad_key, validate
from flexfem.files.writing import digest
from flexfem.hinges.strength import required_law
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.keys import Key, keys
from flexfem.mechanism.stage import Stage, load_feasible
from flexfem.mechanism.stage_file import actuators_of, merged_changes
from flexfem.questions import warnings as accuracy
from flexfem.refused import BadInput
from flexfem.study.factors import Column, Factor, acting, columns_of, with_mean
from flexfem.study.plan import EXTENSIBLE, Study, names_in, normal_correlation, value_of

if TYPE_CHECKING:
    from flexfem.study.factors import Column


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its base stage read and found feasible, and its columns; `stem` names its results.

    `given` : the user's own table of designs, where the study samples from one.
    """

    path: Path
    study: Study
    stage: Stage
    columns: tuple[Column, ...]
    stem: str
    given: Given | None = None

    @property
    def count(self) -> int:
        """Number of designs."""
        return self.study.count if self.given is None else self.given.rows

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the output columns, in their order."""
        return self.study.outputs

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths, of the stage and of the study, whose provenance says that they are assumed."""
        own = (key for key, source in self.study.provenance.items() if is_assumed(source))
        return (*(f"stage: {key}" for key in self.doubts.assumed), *(f"study: {key}" for key in own))

    @property
    def not_stated(self) -> tuple[str, ...]:
        """Key paths of the numbers, of the stage and of the study, whose source is not stated."""
        stage = (f"stage: {key}" for key in self.doubts.not_stated)
        return (*stage, *(f"study: {key}" for key in self.study.not_stated))

    @property
    def stress_accuracy(self) -> str:
        """How far the highest neck stress, and what is found from it, may be off, in words."""
        study, plane = self.study, self.stage.model
        if study.model != "analytic":
            return f"neck stress by finite elements of resolution {study.resolution} is {study.stress_below}"
        said = accuracy.stress_accuracy(study.formula, study.links, plane)
        driven = accuracy.driven_accuracy(study.formula, study.links, plane)
        return f"{said}; in what the drive reaches, {driven}" if study.driven else said

    @property
    def doubts(self) -> Doubts:
        """Those of the stage, its drive and expansions included where they are asked."""
        stage = self.stage
        asked = [stage.drive_doubts] if self.study.driven else []
        asked += [stage.heat_doubts] if self.study.drift is not None else []
        asked = asked or [Doubts([*stage.assumed], [*stage.not_stated])]
        return Doubts(*(list(dict.fromkeys(chain(*each))) for each in zip(*asked, strict=True)))

    @property
    def hash(self) -> str:
        """SHA-256 of all that answers depend on: no title, figure, provenance, path, nor how long one may take.

        How many designs there are counts only where it changes the first ones too; derived outputs, and constraints on
        outputs, are found from the answers.
        """
        unneeded = {"name", "stage", "factor", "figure", "provenance", "check", "time_limit", "output", "constraint"}
        content = self.study.model_dump(mode="json", exclude=unneeded)
        content |= {"stage": self.stage.hash, "draws": self.study.draws}
        if content["drive"] is not None and not content["drive"]["actuators"]:  # hashes older than the key stay
            del content["drive"]["actuators"]
        for key in ("frequencies", "life", "drift", "ask"):
            if content[key] in (None, []):
                del content[key]
        if self.study.model != "three_dimensional":
            del content["layers"]
        if self.study.driven:
            content["stage"] = self.stage.drive_hash
        if self.study.drift is not None:
            content["drift"] = self.stage.heat_hash
        if self.given is not None:
            content["sampling"] = content["sampling"] | {"file": self.given.digest}
        if self.study.sampling.method in EXTENSIBLE:
            content["sampling"] = content["sampling"] | {"designs": None, "base": None}
        # a hinge with an override does not follow the factor of its like, though it may be as the others are
        followed = (o for o in self.stage.override if o.hinge or self.study.driven)
        content["override"] = sorted((*o.place, sorted(o.changes)) for o in followed)
        content["columns"] = [
            [name, keys, factor.model_dump(mode="json", exclude={"key", "keys", "label"})]
            for name, keys, factor in self.columns
        ]
        content["refused"] = [
            [self.study.in_full(each.value), each.least, each.most, each.said]
            for each in self.study.constraint
            if self.study.is_given(each.value)
        ]
        return digest(content)


def load_study(path: str | os.PathLike[str]) -> LoadedStudy:
    """Read a study file and its base stage.

    Raises
    ------
    BadInput
        As `toml.validate`, or the base stage cannot be read or made; one line naming file, line and key.
    """
    study = validate(Study, path)
    try:
        stage = load_feasible(os.path.normpath(Path(path).parent / study.stage))
    except BadInput as error:
        raise bad_key(path, ("stage",), f"stage = {shown(study.stage)}: {error}") from None
    require_model(path, study, stage)
    columns: list[Column] = []
    for index, factor in enumerate(study.factor):
        try:
            columns += [acting(with_mean(column, stage), stage, study.unasked) for column in columns_of([factor])]
        except BadInput as error:
            raise bad_key(path, ("factor", index), f"{key_path(('factor', index))}.{error}") from None
    loaded = LoadedStudy(Path(path), study, stage, tuple(columns), Path(path).stem, _given(path, study, columns))
    _require_key_values(loaded)
    return loaded


def require_model(path: str | os.PathLike[str], study: Study, stage: Stage) -> None:
    """Raise BadInput where the base stage is none for the model of the study, or has no drive that it asks for."""
    said = f"model = {shown(study.model)} on a stage with model = {shown(stage.model)}, expected"
    if study.model in ("fe", "verify") and stage.model == "corrected":
        raise bad_key(path, ("model",), f'{said} "analytic": the finite elements are plane')
    if study.model == "three_dimensional" and stage.model != "plane_stress":
        why = "it says how a stage is made plane, and here its faces are free"
        raise bad_key(path, ("model",), f"{said} a stage without one: {why}")
    if study.driven and not stage.actuator:
        raise bad_key(path, ("drive", "actuators"), "drive.actuators = true, expected a base stage with [[actuator]]")
    needs: dict[str, Callable[[], object]] = {
        "life": lambda: required_law(stage.material),
        "drift": lambda: require_expansion(stage, frame=True),
    }
    for key, require in needs.items():
        try:
            if getattr(study, key) is not None:
                require()
        except BadInput as error:
            raise bad_key(path, (key,), f"{key}, on the base stage: {error}") from None


def _given(path: str | os.PathLike[str], study: Study, columns: list[Column]) -> Given | None:
    """The table of designs that a study file names, read through; None where it names none."""
    if study.sampling.file is None:
        return None
    try:
        return given_of(Path(path).parent / study.sampling.file, columns)
    except BadInput as error:
        raise bad_key(path, ("sampling", "file"), f"sampling.file: {error}") from None


def _require_key_values(loaded: LoadedStudy) -> None:
    """Raise BadInput where an expression asks for a key that no factor sets and the stage leaves to a default."""
    study, set_by = loaded.study, {path for column in loaded.columns for path in column.keys}
    named = {*(column.name for column in loaded.columns), *study.every_output, *set_by}
    places = [(output.expression, ("output", k, "expression")) for k, output in enumerate(study.output)]
    places += [(constraint.value, ("constraint", k, "value")) for k, constraint in enumerate(study.constraint)]
    for expression, place in places:
        for name in names_in(expression):
            if name not in named and keys()[name].value_in(loaded.stage) is None:
                raise bad_key(loaded.path, place, f"{key_path(place)}: the stage has no {name} of its own")


FORMATS = (".csv", ".parquet")
MOST_NUMBERS = 2 * 10**8  # in a table of designs, which is held in memory
BLOCK = 1024  # Monte Carlo designs drawn together, each block from a stream of its own
INSIDE = 2.0**-53  # keeps quantiles off 0 and 1, where a normal distribution is infinite


class Given(NamedTuple):
    """A table of designs that was found sound: its file, the SHA-256 of what is in it, and how many rows it has."""

    path: Path
    digest: str
    rows: int


def given_of(path: Path, columns: Sequence[Column]) -> Given:
    """Read a table of designs, and check every value.

    Raises
    ------
    BadInput
        The file is missing, not CSV or Parquet, or without rows; a column is missing or there twice; a value is no
        finite number or outside the limits of its key. One line naming file, row, column, value and what was expected.
    """
    path = Path(os.path.abspath(path))
    given = Given(path, _digest(path, _signature(path)), 0)
    values = _rows(given, tuple(column.name for column in columns))
    if len(values) == 0:
        raise BadInput(f"{place_of(path)}: no rows, expected one for each design")
    for column, found in zip(columns, values.T, strict=True):
        for key in (keys()[path] for path in column.keys):
            bad = np.flatnonzero(~np.isfinite(found) | key.impossible(found))
            if len(bad):
                value = float(found[bad[0]])
                expected = f"{key.expected(value)} for {key.path}" if np.isfinite(value) else "a finite number"
                at = f"row {bad[0] + 1}, column {shown(column.name)}"
                raise BadInput(f"{place_of(path)}: {at} = {value:g}, expected {expected}")
    return given._replace(rows=len(values))


def _signature(path: Path) -> tuple[int, ...]:
    """What changes when a file is written: inode, size and time of its last change."""
    where = place_of(path)
    if path.suffix not in FORMATS:
        raise BadInput(f"{where}, expected a file name that ends in {' or '.join(FORMATS)}")
    if path.exists() and not path.is_file():
        raise BadInput(f"{where}: a folder, pipe or device, expected a table of designs")
    try:
        status = path.stat()
        return status.st_ino, status.st_size, status.st_mtime_ns
    except (OSError, ValueError) as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else "cannot be read"
        raise BadInput(f"{where}: {reason}, expected a table of designs") from None


@lru_cache(maxsize=4)
def _digest(path: Path, signature: tuple[int, ...]) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise BadInput(f"{place_of(path)}: cannot be read: {error.strerror}") from None


def _rows(given: Given, names: tuple[str, ...]) -> Array:
    """Values (rows, columns) of a table of designs. Raises BadInput when its file has changed."""
    if _digest(given.path, _signature(given.path)) != given.digest:
        raise BadInput(f"{place_of(given.path)}: changed since the study was read, expected its content: run again")
    return _table(given.path, given.digest, names)


@lru_cache(maxsize=2)
def _table(path: Path, digest: str, names: tuple[str, ...]) -> Array:
    """Values (rows, columns) of the file, which has that content."""
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    where, csv = place_of(path), path.suffix == ".csv"
    try:
        if csv:
            texts = pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()))
            found = pyarrow.csv.read_csv(path, convert_options=texts)
        else:
            found = pq.read_table(path)
    except (pa.ArrowException, OSError, ValueError) as error:
        kind = "CSV with commas between columns" if csv else "a Parquet file, or a damaged one"
        raise BadInput(f"{where}: not {kind}: {one_line(str(error), 160)}") from None
    if found.num_rows * len(names) > MOST_NUMBERS:
        size = f"{found.num_rows} rows of {len(names)} columns"
        raise BadInput(f"{where}: {size}, expected {MOST_NUMBERS} numbers at most")
    there, values = found.column_names, np.empty((found.num_rows, len(names)))
    for k, name in enumerate(names):
        at = f"column {shown(name)}"
        if there.count(name) != 1:
            close = suggestion(name, set(there)) or f", found {one_line(', '.join(there), 160)}"
            state = "is there twice" if name in there else "is missing"
            raise BadInput(f"{where}: {at} {state}, expected one for each factor{close}")
        if not (csv or pa.types.is_integer(found[name].type) or pa.types.is_floating(found[name].type)):
            raise BadInput(f"{where}: {at} of {found[name].type}, expected numbers")
        try:
            values[:, k] = found[name].cast(pa.float64()).to_numpy()  # empty cells of Parquet as nan
        except pa.ArrowException:
            texts = enumerate(found[name].to_pylist(), 1)
            row, text = next(each for each in texts if not _is_number(each[1]))
            raise BadInput(f"{where}: row {row}, {at} = {shown(text)}, expected a number") from None
    return values


def _is_number(text: Any) -> bool:
    try:
        return bool(text) and float(text) is not None
    except (TypeError, ValueError):
        return False


def sample(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Factor values (stop - start, columns) of the designs from `start` up to `stop`, in file units.

    Notes
    -----
    A grid counts its last factor fastest. Samples of methods that are `EXTENSIBLE` begin alike however large they are.
    """
    factors = [column.factor for column in loaded.columns]
    start, stop = max(start, 0), min(stop, loaded.count)
    if loaded.given is not None:
        return _rows(loaded.given, tuple(column.name for column in loaded.columns))[start:stop]
    if loaded.study.sampling.method == "grid":
        points = [grid_points(factor) for factor in factors]
        places = np.unravel_index(np.arange(start, stop), [len(each) for each in points])
        return np.stack([each[place] for each, place in zip(points, places, strict=True)], axis=-1)
    quantiles = correlated(loaded, np.clip(_quantiles(loaded, start, stop), INSIDE, 1.0 - INSIDE))
    return np.stack([at_quantile(factor, u) for factor, u in zip(factors, quantiles.T, strict=True)], axis=-1)


def correlated(loaded: LoadedStudy, quantiles: Array) -> Array:
    """Quantiles (n, columns) with the rank correlations of the study, from independent ones between 0 and 1.

    Notes
    -----
    A Gaussian copula (R. B. Nelsen, An Introduction to Copulas, 2nd ed., Springer 2006): normal deviates `L z` with
    `L L' = R` of `plan.normal_correlation`; every factor keeps its own distribution.
    """
    names = [column.name for column in loaded.columns]
    pairs = loaded.study.correlation
    among = sorted({names.index(name) for each in pairs for name in each.factors})
    if not among or not len(quantiles):
        return quantiles
    from scipy.special import ndtr, ndtri

    L = np.linalg.cholesky(normal_correlation([names[place] for place in among], pairs))
    found = quantiles.copy()
    found[:, among] = ndtr(ndtri(quantiles[:, among]) @ L.T)
    return np.clip(found, INSIDE, 1.0 - INSIDE)


def grid_points(factor: Factor) -> Array:
    """Points (k,) of a factor in a grid."""
    if factor.values is not None:
        return np.array(factor.values)
    assert factor.start is not None and factor.end is not None and factor.points is not None
    return (np.geomspace if factor.scale == "log" else np.linspace)(factor.start, factor.end, factor.points)


def at_quantile(factor: Factor, u: Array) -> Array:
    """Values (n,) of a factor at quantiles `u` (n,) of its distribution, 0 < u < 1."""
    from scipy import stats

    if factor.values is not None:
        return np.array(factor.values)[(u * len(factor.values)).astype(np.int64)]
    if factor.kind == "normal":
        assert factor.mean is not None and factor.sd is not None
        if factor.lower is factor.upper is None:
            return np.asarray(stats.norm.ppf(u, factor.mean, factor.sd))
        lower = -np.inf if factor.lower is None else factor.lower
        upper = np.inf if factor.upper is None else factor.upper
        ends = (lower - factor.mean) / factor.sd, (upper - factor.mean) / factor.sd
        return np.asarray(stats.truncnorm.ppf(u, *ends, loc=factor.mean, scale=factor.sd))
    low, high = (factor.start, factor.end) if factor.kind == "range" else (factor.lower, factor.upper)
    assert low is not None and high is not None
    if factor.scale == "log":
        return np.asarray(stats.loguniform.ppf(u, low, high))
    return np.asarray(stats.uniform.ppf(u, low, high - low))


def monte_carlo(seed: int, columns: int, start: int, stop: int) -> Array:
    """Independent quantiles (stop - start, columns) of the designs from `start` up to `stop`, 0 <= u < 1."""
    blocks = range(start // BLOCK, -(-stop // BLOCK))
    streams = (np.random.Philox(np.random.SeedSequence(seed, spawn_key=(block,))) for block in blocks)
    drawn = [np.random.Generator(stream).random((BLOCK, columns)) for stream in streams]
    return np.concatenate([np.empty((0, columns)), *drawn])[start % BLOCK :][: stop - start]


def _quantiles(loaded: LoadedStudy, start: int, stop: int) -> Array:
    """Quantiles (stop - start, columns) of a sample, 0 <= u < 1."""
    sampling, columns = loaded.study.sampling, len(loaded.columns)
    assert sampling.seed is not None
    match sampling.method:
        case "monte_carlo":
            return monte_carlo(sampling.seed, columns, start, stop)
        case "sobol":
            return _sobol(sampling.seed, columns, start, stop)
        case "saltelli":
            return _saltelli(sampling.seed, columns, start, stop)
    return _latin_hypercube(sampling.seed, columns, loaded.count)[start:stop]


_engines: dict[tuple[int, int], Any] = {}  # the last sequence that was drawn from: parts mostly follow one another


def _sobol(seed: int, columns: int, start: int, stop: int) -> Array:
    """Points `start` up to `stop` of a scrambled Sobol sequence, whatever comes before."""
    from scipy.stats import qmc

    engine = _engines.get((seed, columns))
    if engine is None or engine.num_generated > start:
        engine = qmc.Sobol(columns, scramble=True, rng=np.random.default_rng(seed))
        _engines.clear()
        _engines[seed, columns] = engine
    if start > engine.num_generated:
        engine.fast_forward(start - engine.num_generated)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a number of points that is no power of two
        return np.asarray(engine.random(stop - start))


def _saltelli(seed: int, columns: int, start: int, stop: int) -> Array:
    """Rows of A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: of every Sobol point (A, B) in turn the designs
    A, A with one column of B at a time, and B."""
    group, k = columns + 2, np.arange(columns)
    first = start // group
    points = _sobol(seed, 2 * columns, first, -(-stop // group))
    rows = np.repeat(points[:, None, :columns], group, axis=1)
    rows[:, 1 + k, k] = rows[:, -1] = points[:, columns:]
    return rows.reshape(-1, columns)[start - group * first :][: stop - start]


@lru_cache(maxsize=1)
def _latin_hypercube(seed: int, columns: int, designs: int) -> Array:
    from scipy.stats import qmc

    return np.asarray(qmc.LatinHypercube(columns, rng=np.random.default_rng(seed)).random(designs))


class Varied(Protocol):
    """A stage and the columns that set numbers of it: a study that is loaded, for one."""

    @property
    def stage(self) -> Stage: ...

    @property
    def columns(self) -> tuple[Column, ...]: ...


def designs_of(loaded: Varied, values: Array) -> Designs:
    """The designs whose factors take `values` (n, columns), file units; nothing is checked here."""
    designs = lower(loaded.stage).repeated(len(values))
    for key, column in _settings(loaded):
        for field, place in key.places_in(loaded.stage):
            everywhere: tuple[slice | int, ...] = (slice(None), *place)
            getattr(designs, field)[everywhere] = key.unit * values[:, column]
    return designs


def stage_of(loaded: Varied, values: Array) -> Stage:
    """The design whose factors take `values` (columns,), file units, as a stage.

    Raises
    ------
    BadInput : a value that no stage file can give; one line that begins with its key.
    """
    changes: dict[str, Any] = {}
    for key, column in _settings(loaded):
        value = float(values[column])
        expected = key.expected(value)
        if expected is not None:
            raise BadInput(f"{key.path} = {value:g}, expected {expected}")
        _set(changes, loaded.stage, key, key.check.validate_python(value))
    held = loaded.stage.model_dump(exclude_unset=True, exclude={"provenance"})
    return Stage.from_names(merged_changes(held, changes))


def _settings(loaded: Varied) -> list[tuple[Key, int]]:
    """Every key set and the column that sets it, those of one chain after those of all three."""
    found = [(keys()[path], index) for index, column in enumerate(loaded.columns) for path in column.keys]
    return sorted(found, key=lambda setting: setting[0].table[:1] == ("override",))


def _set(changes: dict[str, Any], stage: Stage, key: Key, value: float) -> None:
    """Set a number in changes as `Stage.replace` takes them; of an array all, those not set from the stage."""
    if key.of_drive:
        _set_of_drive(changes, stage, key, value)
        return
    if key.table[:1] == ("override",):
        place = int(key.table[1]), key.table[2]
        changes.setdefault("override", {}).setdefault(place, {})[key.attribute] = value
        return
    table, held = changes, stage
    for name in key.table:
        table, held = table.setdefault(name, {}), getattr(held, name)
    if key.element is None:
        table[key.attribute] = value
    else:
        table[key.attribute] = list(table.get(key.attribute, getattr(held, key.attribute)))
        table[key.attribute][key.element] = value


def _set_of_drive(changes: dict[str, Any], stage: Stage, key: Key, value: float) -> None:
    """As `_set`, of an actuator: of all chains, or of one as its override has it."""
    name = key.table[-1]
    place = [each.name for each in stage.actuator].index(name)
    if key.table[0] == "override":
        chain = int(key.table[1])
        held = actuators_of(stage)[chain - 1][place]
        table = changes.setdefault("override", {}).setdefault((chain, "actuator", name), {})
    else:
        held = stage.actuator[place]
        table = changes.setdefault("actuator", [one.model_dump(exclude_unset=True) for one in stage.actuator])[place]
    if key.element is None:
        table[key.attribute] = value
    else:
        table[key.attribute] = list(table.get(key.attribute) or getattr(held, key.attribute))
        table[key.attribute][key.element] = value


class Judged(NamedTuple):
    """Derived outputs (n,) by name, nan where there is no finite value, and whether a design keeps all constraints."""

    derived: dict[str, Array]
    feasible: AnyArray


def judge(loaded: LoadedStudy, columns: Mapping[str, Array], ok: AnyArray) -> Judged:
    """Derived outputs and constraints of designs.

    Parameters
    ----------
    columns : factors and outputs of the model, (n,) each, by name, file units.   ok : which have an answer, bool (n,).
    """
    known = ChainMap[str, Array]({}, cast("MutableMapping[str, Array]", columns))  # which may be read one by one
    feasible = np.array(ok, dtype=bool)
    for output in loaded.study.output:
        found = evaluated(loaded, output.expression, known, len(ok))
        known[output.name] = np.where(ok & np.isfinite(found), found, np.nan)
    for constraint in loaded.study.constraint:
        feasible &= ~constraint.broken(evaluated(loaded, constraint.value, known, len(ok)))
    return Judged({output.name: known[output.name] for output in loaded.study.output}, feasible)


def refusals_of(loaded: LoadedStudy, values: Array) -> AnyArray:
    """Why designs whose factors take `values` (n, columns) are not worth an answer, text (n,), "" where they are.

    A constraint that asks for factors and keys alone is decided here, before anything is solved.
    """
    reason = np.full(len(values), "", dtype=object)
    known = {column.name: values[:, index] for index, column in enumerate(loaded.columns)}
    for output in loaded.study.output:
        if loaded.study.is_given(output.expression):
            known[output.name] = evaluated(loaded, output.expression, known, len(values))
    for constraint in loaded.study.constraint:
        if loaded.study.is_given(constraint.value):
            found = evaluated(loaded, constraint.value, known, len(values))
            for place in np.flatnonzero(constraint.broken(found) & (reason == "")):
                reason[place] = f"constraint {constraint.said} = {found[place]:.6g}, expected {constraint.expected}"
    return reason


def evaluated(loaded: LoadedStudy, expression: str, columns: Mapping[str, Array], size: int) -> Array:
    """Value (size,) of an expression of columns by name, and keys, in file units; nan where one is missing."""
    found = {name: _named(loaded, name, columns) for name in names_in(expression)}
    return np.broadcast_to(value_of(expression, found), (size,))


def _named(loaded: LoadedStudy, name: str, columns: Mapping[str, Array]) -> Array:
    if name in columns:
        return columns[name]
    return _of_key(loaded, keys()[name], columns) if name in keys() else np.full(1, np.nan)


def _of_key(loaded: LoadedStudy, key: Key, columns: Mapping[str, Array]) -> Array:
    """Values (n,) or (1,) of a key of the stage file, file units: what a factor sets, else the stage's own."""
    for column in loaded.columns:
        if key.path in column.keys:
            return columns[column.name]
    if key.table[:1] != ("override",):
        return np.full(1, key.value_in(loaded.stage), dtype=np.float64)
    designs = designs_of(loaded, np.column_stack([columns[column.name] for column in loaded.columns]))
    ((field, place),) = key.places_in(loaded.stage)
    return np.asarray(getattr(designs, field)[:, *place] / key.unit)
