"""Many baselines at once: accept those of input files, check those of a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path

from flexfem.commands.baseline.inputs import DATA, Kind, kind_of
from flexfem.commands.baseline.store import (
    Checked,
    Difference,
    accept,
    check,
    file_of,
    folder_of,
    places,
    read_baseline,
)
from flexfem.files.refusals import checked_path
from flexfem.files.writing import check_folder
from flexfem.refused import BadInput, ComputationFailed
from flexfem.verify.protocol import Solve, solve_stage


def listed(places: Sequence[Path]) -> list[Path]:
    """Baselines given as files or in folders. Raises BadInput when a folder has none."""
    found = []
    for place in places:
        inside = sorted(place.glob("*.json")) if place.is_dir() else [place]
        if not inside:
            raise BadInput(f"{place}: no baselines in this folder")
        found += inside
    return found


def regression(
    *baselines: str | os.PathLike[str], each: Callable[[list[Path]], Iterable[Path]] = iter
) -> list[Checked]:
    """Compare what flexfem answers now with accepted baselines, or with all in folders of them.

    Parameters
    ----------
    each : goes through the baselines, for progress.

    Returns
    -------
    By baseline what changed in its input, else every number that moved; nothing when all is as accepted.

    Raises
    ------
    BadInput
        A folder has no baselines.
    """
    places = [checked_path(place) for place in baselines]
    paths, solve = listed(places), cache(solve_stage)
    found = [checked(path, solve) for path in each(paths)]
    return found + [Checked(str(place), list(unaccepted(place))) for place in places if place.is_dir()]


def baseline(
    *files: str | os.PathLike[str],
    reason: str,
    baselines: str | os.PathLike[str] | None = None,
    each: Callable[[list[tuple[Path, Path]]], Iterable[tuple[Path, Path]]] = iter,
) -> list[Path]:
    """Accept what flexfem answers of input files now as their baselines; returns the files written.

    Parameters
    ----------
    files : stages, cases, studies.   reason : why numbers may move; kept in the history of each.
    baselines : folder of the baselines, by default `baselines` beside each file.
    each : goes through the files with their folders, for progress.

    Raises
    ------
    BadInput
        A file cannot be used or its baseline is that of another one, the reason is empty, or a folder takes no file.
    ComputationFailed
        As `flexfem.solve`.
    """
    if not isinstance(reason, str) or not reason.strip():
        raise BadInput("reason is empty, expected why the numbers may move")
    paths, solve = [checked_path(file) for file in files], cache(solve_stage)
    folder = None if baselines is None else checked_path(baselines)
    known = places([(path, folder or folder_of(path)) for path in paths])
    for _, target in known:
        check_folder(target)
    return [accept(path, target, reason, solve) for path, target in each(known)]


def checked(path: Path, solve: Solve) -> Checked:
    """Check one baseline; what prevents it is a finding."""
    return Checked(path.stem, _findings(path, solve))


def _findings(path: Path, solve: Solve) -> list[Difference]:
    try:
        baseline = read_baseline(path)
        source = Path(os.path.normpath(path.parent / baseline.file))
        if not source.exists():
            return [f"{path}: its input is gone: {source}"]
        if file_of(source, path.parent) != path:
            return [f"{path}: the baseline of {source}, expected the name {source.stem}.json"]
        if kind_of(source) != baseline.kind:
            return [f"{path}: the baseline of a {baseline.kind}, but {source} is of kind {kind_of(source)}"]
        return check(source, path.parent, solve)
    except (BadInput, ComputationFailed) as error:
        return [str(error)]


def unaccepted(folder: Path) -> Iterator[str]:
    """Input files beside those of a folder's baselines, of the same kind, that have none."""
    known, places = set[Path](), set[tuple[Path, Kind]]()
    for path in listed([folder]):
        baseline = read_baseline(path)
        source = Path(os.path.normpath(folder / baseline.file))
        known.add(source)
        places.add((source.parent, baseline.kind))
    for place, kind in sorted(places):
        for other in sorted(place.glob("*.json" if place.resolve() == DATA.resolve() else "*.toml")):
            if other not in known and _is(other, kind):
                yield f"{other}: no baseline in {folder}; flexfem baseline {other} --baselines {folder} --reason TEXT"


def _is(path: Path, kind: Kind) -> bool:
    try:
        return kind_of(path) == kind
    except BadInput:
        return False
