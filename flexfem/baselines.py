"""Baselines: accepted numbers of input files, and the comparison of new numbers with them.

A stage, a mechanism and a case are also solved on a mesh that is stored beside the baseline. When
these numbers are unchanged and others move, the mesh generator has changed and not the solver. A
baseline holds numbers in internal units, so that another unit of a quantity does not move them."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import partial, reduce
from importlib import import_module
from operator import getitem, methodcaller
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from pydantic import BaseModel, Field

import flexfem
from flexfem.arrays import Array, short_repr
from flexfem.fem.mesh import RESOLUTION, PlaneMesh, check_triangles
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import plate_response
from flexfem.files.refusals import checked_path, key_path, place_of
from flexfem.files.toml import kind_of as kind_of_toml
from flexfem.files.toml import paths_in, read_bytes, read_toml
from flexfem.files.writing import check_folder, read_arrays, write_atomically
from flexfem.mechanism.loading import load
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import components, plate_polygon
from flexfem.questions.bands import levels
from flexfem.questions.errors import errors_of
from flexfem.questions.stiffness import stiffness
from flexfem.refused import BadInput, ComputationFailed
from flexfem.results import EXACT, LARGEST_FILE, Number, Progress, Result, versions
from flexfem.study import table
from flexfem.study.columns import ERRORS, sizes_of
from flexfem.units import NONE

COARSE = 2  # triangles across the necks of a stored mesh
EDGES = "edges."  # before the names of edges of a stored mesh
ON_KEPT = 1e-7  # accepted change of a compliance on a stored mesh, relative to the diagonal
FORCE = (1.0, -2.0, 30.0)  # N, N, N mm; unequal components
AMPLITUDE = (0.05, -0.02, 5e-4)  # mm, mm, rad
# by model or prefix of the column
STUDY_GATES = {
    "analytic": EXACT.relative,
    "stress": 3e-2,
    "range": 3e-2,
    "band": 1e-3,
}
COARSER_TABLE = 3e-4  # for other columns
Numbers: TypeAlias = dict[str, Number]  # by path


class Stored(BaseModel, extra="forbid"):
    """Content of a baseline; numbers with or without a band, by question and path."""

    kind: str
    file: str
    history: Annotated[list[dict[str, Any]], Field(min_length=1)]
    inputs: dict[str, dict[str, Any]]
    numbers: dict[str, dict[str, Annotated[list[float], Field(min_length=1, max_length=2)]]]


# of a mechanism; those that do not apply are omitted
QUESTIONS: dict[str, Callable[[Any], Result]] = {
    "stiffness": partial(stiffness, force=FORCE),
    "drift": flexfem.drift,
    "modes": partial(flexfem.modes, resolution=4),
    "life": partial(flexfem.life, amplitude=AMPLITUDE, law=flexfem.Basquin(900.0, -0.1)),
    "drive": flexfem.drive,
    "reach": flexfem.reach,
    "large": partial(flexfem.large, amplitude=0.2),
    "gravity": flexfem.gravity,
    "budget": partial(flexfem.budget, plane=True),
    "convergence": partial(flexfem.converge, resolutions=[*levels(RESOLUTION)]),
    "errors": errors_of,
}
# module with `case_result` and `case_stages` of a kind of file that compares mechanisms
CASES = {"case": "flexfem.paper.baseline"}


@short_repr
class Checked(NamedTuple):
    """Compared baselines, and the differences found; the command ends with exit code 1 when there
    are any.
    """

    checked: list[str]
    findings: list[str]


def regression(
    *files: Path, baselines: Path | None = None, progress: Progress | None = None
) -> Checked:
    """Compare present results with accepted baselines: changed inputs; numbers that moved, appeared
    or disappeared.

    Parameters
    ----------
    *files : Path
        Baselines, folders of baselines, or the input files of baselines.
    baselines : Path, optional
        Folder of the baselines of input files; by default `baselines` beside each file.
    progress : callable, optional
        Called with the name of every baseline.

    Raises
    ------
    BadInput
        A folder has no baselines, or a file has or is none.
    """
    checked = list[str]()
    findings = list[str]()
    for place in [_baseline_of(path, baselines) for path in map(checked_path, files)]:
        inside = sorted(place.glob("*.json")) if place.is_dir() else [place]
        if not inside:
            raise BadInput(f"{place}: no baselines in this folder")
        if not place.is_dir():
            read(place)
        for path in inside:
            if progress is not None:
                progress(path.stem)
            checked.append(path.stem)
            try:
                findings += check(path)
            except (BadInput, ComputationFailed) as error:
                findings.append(str(error))
        if place.is_dir():
            findings += unaccepted(place, inside)
    return Checked(checked, list(dict.fromkeys(findings)))


def baseline(
    *files: Path, reason: str, baselines: Path | None = None, progress: Progress | None = None
) -> list[Path]:
    """Accept the present results of input files as their baselines; returns the files written.

    Parameters
    ----------
    *files : Path
        Stages, mechanisms, cases and studies.
    reason : str
        The reason why numbers may move; stored in the history of each baseline.
    baselines : Path, optional
        Folder of the baselines; by default `baselines` beside each file.
    progress : callable, optional
        Called with the name of every file.

    Raises
    ------
    BadInput, ComputationFailed
        A file cannot be used, its baseline is that of another one, the reason is empty, or a
        question fails.
    """
    if not isinstance(reason, str) or not reason.strip():
        raise BadInput("reason is empty, expected the reason why the numbers may move")
    targets = _targets(files, baselines)
    for target, path in targets.items():
        if progress is not None:
            progress(path.stem)
        made = _made(path, target, reason.strip())
        write_atomically(target, methodcaller("write", _text_of(made).encode()), again=True)
    return list(targets)


def _baseline_of(path: Path, baselines: Path | None) -> Path:
    """Return the baseline of an input file; a baseline or a folder of them itself."""
    if path.suffix != ".toml":
        return path
    (target,) = _targets([path], baselines)
    return target


def _targets(files: Iterable[Path], baselines: Path | None) -> dict[Path, Path]:
    """Return the input file of each baseline. Raises BadInput where a file cannot have its own."""
    targets: dict[Path, Path] = {}
    for path in map(checked_path, files):
        kind_of(path)
        folder = path.parent / "baselines" if baselines is None else checked_path(baselines)
        check_folder(folder)
        target = folder / f"{path.stem}.json"
        owner = read(target)["file"] if target.exists() else _relative(path, folder)
        if targets.setdefault(target, path) != path or owner != _relative(path, folder):
            raise BadInput(
                f"{path}: {target} is the baseline of another file, expected another name or folder"
            )
    return targets


def _made(
    path: Path,
    target: Path,
    reason: str,
) -> dict[str, Any]:
    """Return the content of a new baseline, with the history of the present one."""
    history = read(target)["history"] if target.exists() else []
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {
        "kind": kind_of(path),
        "file": _relative(path, target.parent),
        "history": [*history, {"when": now, "reason": reason, "versions": versions()}],
        "inputs": inputs_of(path),
        "numbers": {
            question: {key: _stored(number) for key, number in found.items()}
            for question, found in numbers_of(path, target.parent)
        },
    }


def _text_of(made: Mapping[str, Any]) -> str:
    """Return a baseline as JSON with a line for every number."""
    text = json.dumps(made, indent=1, allow_nan=False)
    return text.replace("[\n    ", "[").replace(",\n     ", ", ") + "\n"


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _stored(number: Number) -> list[Any]:
    """Return a number and its band in internal units for JSON: "inf" where unlimited, one entry
    without a band.
    """
    value = number.value / number.unit.factor
    band = number.band / number.unit.factor
    plain = value if np.isfinite(value) else str(value)
    return [plain] if np.isnan(band) else [plain, band if np.isfinite(band) else str(band)]


def read(path: Path) -> dict[str, Any]:
    """Read a baseline. Raises BadInput when it is missing or damaged."""
    content = read_bytes(path, LARGEST_FILE)
    try:
        data: dict[str, Any] = json.loads(content)
        Stored.model_validate(data)
    except (ValueError, RecursionError):  # also of pydantic
        raise BadInput(f"{place_of(path)}: not a baseline of this version of flexfem") from None
    return data


def check(path: Path) -> list[str]:
    """Return the changed inputs, or if there are none the changed numbers. Raises BadInput,
    ComputationFailed.
    """
    data = read(path)
    source = Path(os.path.normpath(path.parent / data["file"]))
    if not source.exists():
        return [f"{path}: its input file is missing: {source}"]
    if source.stem != path.stem or kind_of(source) != data["kind"]:
        return [
            f"{path}: the baseline of a {data['kind']}, but {source} is of kind {kind_of(source)}"
        ]
    was = _flat(data["inputs"])
    now = _flat(inputs_of(source))
    changes = [
        f"the input changed: {os.path.normpath(source.parent / place[0])}: {place[1]} "
        + _became(was.get(place), now.get(place))
        for place in dict.fromkeys([*was, *now])
        if was.get(place) != now.get(place)
    ]
    if changes:
        return [*changes, *_after_changes(source, path, data["numbers"])]
    return [*_moved(path.stem, data["numbers"], dict(numbers_of(source, path.parent)))]


def _after_changes(
    source: Path,
    path: Path,
    was: Mapping[str, Any],
) -> list[str]:
    """Return how far the numbers of each question moved after a change of the input.

    Numbers on the stored mesh are left out: the mesh belongs to the input before.
    """
    found = list[str]()
    try:
        for question, now in numbers_of(source, path.parent, on_stored_meshes=False):
            old = was.get(question, {})
            moves = [_move(key, old[key], now[key]) for key in now if key in old]
            moved = [move for move in moves if move is not None]
            found.append(_said_of_moves(f"{path.stem}: {question}", moved, len(moves)))
    except (BadInput, ComputationFailed) as error:
        found.append(f"{path.stem}: no further numbers after this change: {error}")
    return found


class _Move(NamedTuple):
    """A number that moved beyond its gate: both values, and the change relative to the first."""

    key: str
    was: float
    value: float
    unit: str
    relative: float


def _move(
    key: str,
    stored: Sequence[Any],
    number: Number,
) -> _Move | None:
    """Return how a number moved, None within its gate."""
    was = float(stored[0]) * number.unit.factor
    change = number.value - was
    if math.isclose(number.value, was, rel_tol=0.0, abs_tol=number.accepted):
        return None
    relative = change / abs(was) if abs(was) > number.accepted else math.copysign(math.inf, change)
    return _Move(key, was, number.value, _unit_after(number), relative)


def _said_of_moves(
    name: str,
    moved: Sequence[_Move],
    count: int,
) -> str:
    """Return one line on the numbers of a question, with the one that moved most."""
    if not moved:
        return f"{name}: none of {count} numbers moved"
    finite = [move for move in moved if math.isfinite(move.relative)]
    most = max(finite or moved, key=lambda move: abs(move.relative))
    share = f" ({100 * most.relative:+.3g} %)" if math.isfinite(most.relative) else ""
    return (
        f"{name}: {len(moved)} of {count} numbers moved, most {most.key} from {most.was:.6g} to "
        f"{most.value:.6g}{most.unit}{share}"
    )


def _flat(inputs: Mapping[str, Mapping[str, Any]]) -> dict[tuple[str, str], Any]:
    """Return the values of input files by file and key path."""
    return {(file, key): value for file, keys in inputs.items() for key, value in keys.items()}


def _became(old: Any, new: Any) -> str:
    if old is None:
        return f"is new: {new}"
    return f"is gone, was {old}" if new is None else f"was {old}, is {new}"


def _moved(
    name: str,
    was: Mapping[str, Any],
    now: Mapping[str, Numbers],
) -> Iterator[str]:
    """Yield numbers that moved beyond their gates, appeared or disappeared."""
    for question in dict.fromkeys([*was, *now]):
        old = was.get(question, {})
        new = now.get(question, {})
        for key in dict.fromkeys([*old, *new]):
            place = f"{name}: {question}.{key}"
            if key not in new:
                yield f"{place} is gone, was {float(old[key][0]):.12g} in internal units"
            elif key not in old:
                yield f"{place} is new: {new[key].value:.12g}{_unit_after(new[key])}"
            else:
                yield from _changes(place, old[key], new[key])
        # round-off decides which of equal stresses has the band, so bands are compared by quantity
        had = {_quantity(key) for key, each in old.items() if len(each) == 2}
        has = {_quantity(key) for key, each in new.items() if not np.isnan(each.band)}
        for quantity in had ^ has:
            yield f"{name}: {question}.{quantity}: its bands appeared or disappeared"


def _quantity(path: str) -> str:
    """Return the quantity in the path of a number."""
    return path.partition(".")[0]


def _unit_after(number: Number) -> str:
    return f" {number.unit.plain}".rstrip()


def _changes(
    place: str,
    stored: Sequence[Any],
    number: Number,
) -> Iterator[str]:
    """Yield how a number and its band differ from the stored ones, beyond their gates."""
    unit = _unit_after(number)
    before, *bands = (float(each) * number.unit.factor for each in stored)
    if not math.isclose(number.value, before, rel_tol=0.0, abs_tol=number.accepted):
        moved = f"moved {number.value - before:+.3g}, accepted {number.accepted:.2g}"
        yield f"{place} was {before:.15g}, is {number.value:.15g}{unit}, {moved}"
    if not bands or np.isnan(number.band):
        return
    (band,) = bands
    larger = max(1.0, band / number.band) if number.band > 0 else 1.0
    accepted = number.accepted_band * larger + number.accepted
    if not math.isclose(number.band, band, rel_tol=0.0, abs_tol=accepted):
        yield (
            f"{place}: its band was {band:.6g}, is {number.band:.6g}{unit}, accepted "
            f"{number.accepted_band:.2g}"
        )


def unaccepted(folder: Path, baselines: Iterable[Path]) -> Iterator[str]:
    """Yield input files without a baseline, in the folders and of the kinds of files that have one."""
    known: dict[Path, str] = {}
    for path in baselines:
        with suppress(BadInput):  # a damaged baseline is reported by `check`
            made = read(path)
            known[Path(os.path.normpath(folder / made["file"]))] = made["kind"]
    for place, kind in sorted({(path.parent, kind) for path, kind in known.items()}):
        for other in sorted(place.glob("*.toml")):
            with suppress(BadInput):
                if other not in known and kind_of(other) == kind:
                    make = f"flexfem baseline {other} --baselines {folder} --reason TEXT"
                    yield f"{other}: no baseline in {folder}; {make}"


# inputs


def kind_of(path: Path) -> str:
    """Return the kind of an input file. Raises BadInput for a kind that has no baselines."""
    kind = (kind_of_toml(read_toml(path).data) or "").removesuffix(" file")
    if kind not in ("stage", "mechanism", "case", "study"):
        raise BadInput(f"{path}: expected a stage, a mechanism, a case or a study")
    return kind


def inputs_of(path: Path) -> dict[str, dict[str, Any]]:
    """Return the values of an input file and of the files that it names, by file name and key path."""
    own = _values_of(path)
    named = {value: path.parent / value for value in own.values() if isinstance(value, str)}
    return {path.name: own} | {
        value: _values_of(other) for value, other in named.items() if os.path.isfile(other)
    }


def _values_of(path: Path) -> dict[str, Any]:
    """Return the values of a TOML file by key path, the hash of any other file."""
    if path.suffix != ".toml":
        return {"sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    data: Any = read_toml(path).data
    values = {key_path(at, data): reduce(getitem, at, data) for at in paths_in(data)}
    plain = {key: value for key, value in values.items() if not isinstance(value, dict | list)}
    return {
        key: value if isinstance(value, str | int | float) else str(value)
        for key, value in plain.items()
    }


# numbers


def numbers_of(
    path: Path, folder: Path, on_stored_meshes: bool = True
) -> Iterator[tuple[str, Numbers]]:
    """Yield the numbers of an input file by question; `folder` holds meshes. Raises BadInput,
    ComputationFailed.
    """
    kind = kind_of(path)
    if kind == "study":
        yield "table", _by_path(_of_study(path))
    elif kind in CASES:
        cases = import_module(CASES[kind])
        yield "errors", _compared(cases.case_result(path))
        stages = cases.case_stages(path) if on_stored_meshes else ()
        for label, mechanism, file in stages:
            yield f"mesh of {label}", kept(mechanism, file, folder)
    else:
        yield from _of_mechanism(path, folder, on_stored_meshes)


def _of_mechanism(
    path: Path, folder: Path, on_stored_meshes: bool
) -> Iterator[tuple[str, Numbers]]:
    """Yield the numbers of a mechanism by question, then those on its stored mesh."""
    mechanism = load(path)
    own = mechanism.answering("accepted_questions")
    questions = QUESTIONS if own is None else own(mechanism)
    for name, question in questions.items():
        with suppress(BadInput):  # the question does not apply to the mechanism
            yield name, _compared(question(mechanism))
    if on_stored_meshes:
        yield "mesh", kept(mechanism, path, folder)


def _compared(found: Result) -> Numbers:
    """Return the numbers of a result by path, without those that repeat others."""
    repeated = {name for name, quantity in found.quantities.items() if quantity.repeated}
    return _by_path(each for each in found.entries() if _quantity(each.path) not in repeated)


def _by_path(found: Iterable[Number]) -> Numbers:
    """Return numbers by path, without nan."""
    return {each.path: each for each in found if not np.isnan(each.value)}


def _number(
    path: str,
    value: float,
    accepted: float,
) -> Number:
    """Return a number without unit and band."""
    return Number(path, value, np.nan, NONE, accepted, 0.0)


def kept(
    mechanism: Mechanism,
    path: Path,
    folder: Path,
) -> Numbers:
    """Return the compliance on the stored mesh, which is made if missing. Raises BadInput when it
    is damaged.
    """
    place = folder / f"{path.stem}-{mechanism.hash[:8]}.npz"
    if not place.exists():
        _store_mesh(mechanism, place)
    held = read_arrays(place, "a stored mesh")
    layout = mechanism.layout
    try:
        mesh = _mesh_of(held)
        check_triangles(mesh, plate_polygon(layout).area, len(components(layout)))
        own = mechanism.answering("stored_compliance") or _compliance_on
        ports, C = own(mechanism, mesh)
    except (KeyError, IndexError, ValueError, ComputationFailed) as error:
        raise BadInput(f"{place}: not a mesh of {path}: {error}") from None
    size = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    return _by_path(
        _number(f"compliance.{ports[i]}.{ports[j]}", float(C[i, j]), ON_KEPT * float(size[i, j]))
        for i, j in np.ndindex(C.shape)
    )


def _store_mesh(mechanism: Mechanism, place: Path) -> None:
    made = (mechanism.answering("stored_mesh") or _mesh_for)(mechanism, COARSE)
    arrays: dict[str, Any] = {f"{EDGES}{name}": edge for name, edge in made.edges.items()}
    arrays |= {
        "nodes": made.nodes,
        "triangles": made.triangles.astype(np.int32),
        "bodies": made.bodies.astype(np.int16),
    }
    write_atomically(place, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))


def _mesh_for(mechanism: Mechanism, resolution: int) -> PlaneMesh:
    return mesh_layout(mechanism.layout, resolution)


def _mesh_of(held: Mapping[str, Any]) -> PlaneMesh:
    """Return a stored mesh. Raises KeyError, IndexError or ValueError where it is damaged."""
    edges = {name.removeprefix(EDGES): held[name] for name in held if name.startswith(EDGES)}
    triangles = held["triangles"].astype(np.int64)
    return PlaneMesh(held["nodes"], triangles, held["bodies"].astype(np.int64), edges)


def _compliance_on(mechanism: Mechanism, mesh: PlaneMesh) -> tuple[list[str], Array]:
    """Return the names of the ports, and the compliance (ports, ports) on a mesh."""
    ports = [port.label.replace(" ", "_") for port in mechanism.layout.ports]
    return ports, plate_response(mechanism.layout, mesh).compliance


def _of_study(path: Path) -> Iterator[Number]:
    """Yield the numbers of the collected table of a study."""
    model = str(read_toml(path).data.get("model"))
    columns = _table_of(path)
    # the largest number of the column for others
    sizes = sizes_of(columns) | dict.fromkeys(ERRORS, np.asarray(100.0))
    for name, values in columns.items():
        relative = STUDY_GATES.get(model) or STUDY_GATES.get(name.partition("_")[0], COARSER_TABLE)
        largest = np.max(np.abs(values), initial=0.0, where=~np.isnan(values))
        accepted = relative * np.broadcast_to(sizes.get(name, largest), values.shape)
        for k, (value, change) in enumerate(zip(values.tolist(), accepted.tolist(), strict=True)):
            yield _number(f"{name}.{k}", value, change)


def _table_of(path: Path) -> dict[str, Array]:
    """Return the columns of numbers of a study that is run and collected here."""
    with tempfile.TemporaryDirectory() as folder:
        status = flexfem.run_study(path, folder, workers=1, no_figures=True)
        if status["failed"]:
            raise ComputationFailed(f"{path}: {', '.join(status['reasons']['failed'])}")
        found = table(flexfem.collect_study(path, folder)["written"][0], as_arrow=True)
    every = {name: found[name].to_numpy() for name in found.column_names}
    return {name: values for name, values in every.items() if values.dtype.kind in "fi"}
