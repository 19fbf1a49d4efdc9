"""What lies in the folder of a study: its parts and how far it is, parts of other inputs or versions, and a claim.

Footers of parts count what is in them; nothing else is kept. Processors round differently, and neither are their rows
mixed nor set each other's apart: the first runner of a study says in the folder which arithmetic its rows are of; a
runner of another one is refused.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from flexfem.refused import BadInput
from flexfem.study.content import RETRIED, Counts, counts_of_table, read_counts, read_part
from flexfem.study.parts import PART, WHOLE, Parts, Shard, about_of, chunk_of, listed, names_in

CURE = "processors differ: OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES, set alike everywhere, make them one"


class Survey(NamedTuple):
    """What lies in the folder of a study.

    done : numbers of the chunks whose parts are sound.    counts : designs in them by status and kind of reason.
    unsure : of those that hold designs which another run may answer, what they hold.
    damaged : by chunk, one line on the part that is there but cannot be used.
    foreign : other Parquet files: of other inputs or versions, or not of flexfem.
    elsewhere : how many designs other shards have parts of, by the names of these alone.
    """

    done: frozenset[int]
    counts: Counts
    unsure: dict[int, Counts]
    damaged: dict[int, str]
    foreign: tuple[Path, ...]
    elsewhere: int


def survey(parts: Parts, shard: Shard = WHOLE, whole: bool = False) -> Survey:
    """Look at the parts of a shard: at their footers, or, where `whole`, at every byte."""
    done, unsure, damaged, elsewhere = set(), {}, {}, 0
    total: Counts = Counter()
    chunks, foreign = listed(parts)
    for chunk in chunks:
        if chunk.number % shard.step != shard.first:
            elsewhere += chunk.stop - chunk.start
            continue
        try:
            counts = counts_of_table(read_part(parts, chunk)) if whole else read_counts(parts, chunk)
        except FileNotFoundError:
            continue
        except BadInput as error:
            damaged[chunk.number] = str(error)
            continue
        done.add(chunk.number)
        total.update(counts)
        if any(status in RETRIED for status, _ in counts):
            unsure[chunk.number] = counts
    return Survey(frozenset(done), total, unsure, damaged, foreign, elsewhere)


class Moved(NamedTuple):
    """How many parts were set apart, and how many were taken back because they are those of the study again."""

    apart: int
    back: int

    def said(self, folder: Path) -> Iterator[str]:
        """A line on each, for the user."""
        if self.apart:
            yield f"{self.apart:,} stale parts of before are now in {folder}; flexfem study clean removes them"
        if self.back:
            yield f"{self.back:,} parts are no longer stale: taken back from {folder}"


class Stale(NamedTuple):
    """A part that is none of the study as it is now: which study it says it is of, and how many bytes it has."""

    path: Path
    stem: str
    hash: str
    size: int


def set_apart(parts: Parts) -> Moved:
    """Leave in the folder the parts of the study as it is now, and no others; nothing is lost.

    Other runners may do the same at once. Raises BadInput when the folder of stale parts takes none.
    """
    apart = [name for name in _regular(parts.folder) if chunk_of(parts, name) is None]
    present = set(names_in(parts.folder))
    back = [name for name in _regular(parts.stale) if name not in present and chunk_of(parts, name) is not None]
    if not apart and not back:
        return Moved(0, 0)
    try:
        parts.stale.mkdir(exist_ok=True)
        _require_plain(parts.stale)
        for names, source, target in ((apart, parts.folder, parts.stale), (back, parts.stale, parts.folder)):
            for name in names:
                with suppress(FileNotFoundError):  # another runner was quicker
                    (source / name).replace(target / name)
    except OSError as error:
        raise BadInput(f"{parts.stale}: cannot keep parts of other inputs: {error.strerror or error}") from None
    return Moved(len(apart), len(back))


def candidates(parts: Parts) -> dict[int, list[Path]]:
    """Stale parts by the number of their chunk: they may begin with what a larger or smaller sample needs."""
    found: dict[int, list[Path]] = {}
    for name in sorted(_regular(parts.stale)):
        found.setdefault(int(name.split("-")[1]), []).append(parts.stale / name)
    return found


def stale_parts(parts: Parts) -> list[Stale]:
    """Parts that `study clean` removes: beside those of the study as it is now, and set apart before.

    Only regular files named as parts are, in these two folders themselves, that say they are parts of a study; what
    cannot be read stays.
    """
    _require_plain(parts.stale)
    kept_apart = [parts.stale / name for name in _regular(parts.stale)]
    beside = [parts.folder / name for name in _regular(parts.folder) if chunk_of(parts, name) is None]
    return [found for path in sorted((*beside, *kept_apart)) if (found := _said(path)) is not None]


def remove(found: list[Stale], folder: Path) -> None:
    """Remove stale parts, and the folder of them when nothing is left in it. Raises BadInput where that is refused."""
    for part in found:
        try:
            part.path.unlink(missing_ok=True)
        except OSError as error:
            raise BadInput(f"{part.path}: cannot be removed: {error.strerror or error}") from None
    with suppress(OSError):  # not empty, or never made
        folder.rmdir()


def _regular(folder: Path) -> Iterator[str]:
    """Names of the regular files of a folder that are called as parts are; no links."""
    for name in names_in(folder):
        if PART.fullmatch(name):
            with suppress(OSError):
                if stat.S_ISREG((folder / name).lstat().st_mode):
                    yield name


def _require_plain(folder: Path) -> None:
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise BadInput(f"{folder}: a link or a file, expected a folder of parts that are kept apart")


def _said(path: Path) -> Stale | None:
    """What a part says of itself, None where it is no part of a study."""
    try:
        about = about_of(pq.read_metadata(path).metadata)
        return Stale(path, str(about["stem"]), str(about["hash"]), path.stat().st_size)
    except (OSError, ValueError, pa.ArrowException, KeyError):
        return None


def require_same_arithmetic(parts: Parts) -> None:
    """Raise BadInput when this very study is computed in this folder with another arithmetic."""
    own, found = parts.versions["arithmetic"], _claimed(parts)
    if found not in (None, own):
        raise BadInput(
            f"{parts.folder.parent}: its rows are of arithmetic {found}, those of this machine would be of {own}: "
            f"{CURE}; else another --output, or flexfem study clean and begin anew"
        )


def claim_folder(parts: Parts) -> None:
    """Say of which arithmetic the rows of a folder are, unless somebody has. Raises BadInput."""
    path = _claim(parts)
    try:
        if _claimed(parts) is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)  # a torn one
            with suppress(FileExistsError), path.open("x") as file:
                file.write(parts.versions["arithmetic"])
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror or error}") from None
    require_same_arithmetic(parts)


def release_folder(parts: Parts) -> None:
    """Forget what runners of another arithmetic have said: their rows are removed."""
    if _claimed(parts) != parts.versions["arithmetic"]:
        with suppress(OSError):
            _claim(parts).unlink(missing_ok=True)


def _claimed(parts: Parts) -> str | None:
    with suppress(OSError, UnicodeError):
        text = _claim(parts).read_text(encoding="ascii")
        return text if re.fullmatch("[0-9a-f]{16}", text) else None
    return None


def _claim(parts: Parts) -> Path:
    """A file whose name tells all that decides the rows but the arithmetic."""
    others = {name: text for name, text in parts.versions.items() if name != "arithmetic"}
    key = json.dumps([parts.loaded.hash, others], sort_keys=True)
    return parts.folder.parent / f".arithmetic-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
