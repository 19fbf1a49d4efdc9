"""How far a study is: read from its parts, for nothing else is kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flexfem.errors import BadInput
from flexfem.study.parts import PART, RETRIED, Chunk, Counts, Parts, counts_of_table, read_part


class Survey(NamedTuple):
    """What lies in the folder of a study.

    done : numbers of the chunks whose parts are sound.    counts : designs in them by status and kind of reason.
    unsure : of those that hold designs which another run may answer, what they hold.
    damaged : by chunk, one line on the part that is there but cannot be used.
    foreign : other Parquet files: of other inputs or versions, or not of flexfem.
    """

    done: frozenset[int]
    counts: Counts
    unsure: dict[int, Counts]
    damaged: dict[int, str]
    foreign: tuple[Path, ...]


def survey(parts: Parts, first: int = 0, step: int = 1) -> Survey:
    """Read the parts of a study: of every chunk, or of number `first` and every `step` after it."""
    done, unsure, damaged = set(), {}, {}
    total: Counts = Counter()
    chunks, foreign = listed(parts)
    for chunk in chunks:
        if chunk.number % step != first:
            continue
        try:
            counts = counts_of_table(read_part(parts, chunk))
        except FileNotFoundError:
            continue
        except BadInput as error:
            damaged[chunk.number] = str(error)
            continue
        done.add(chunk.number)
        total.update(counts)
        if any(status in RETRIED for status, _ in counts):
            unsure[chunk.number] = counts
    return Survey(frozenset(done), total, unsure, damaged, foreign)


def listed(parts: Parts) -> tuple[list[Chunk], tuple[Path, ...]]:
    """Chunks for which there is a part, in order, and the other Parquet files."""
    chunks, foreign = [], []
    for path in sorted(parts.folder.glob("*.parquet")):
        found = PART.fullmatch(path.name)
        chunk = parts.chunk(int(found[1])) if found and int(found[1]) < parts.count else None
        if chunk is not None and parts.path(chunk) == path:
            chunks.append(chunk)
        else:
            foreign.append(path)
    return chunks, tuple(foreign)


def facts_of(counts: Counts) -> dict[str, Any]:
    """Designs done, by status, and by kind of reason with the most frequent first."""
    by_status: Counter[str] = Counter()
    for (status, _), n in counts.items():
        by_status[status] += n
    reasons = {status: dict(_reasons(counts, status)) for status in sorted(by_status) if status != "ok"}
    bad = sum(n for status, n in by_status.items() if status in RETRIED)
    plain = {"done": by_status.total(), "ok": by_status["ok"], "refused": by_status["refused"], "failed": bad}
    return plain | {"reasons": reasons}


def _reasons(counts: Counts, wanted: str) -> Iterator[tuple[str, int]]:
    for (status, reason), n in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        if status == wanted:
            yield reason, n


def status_facts(parts: Parts) -> dict[str, Any]:
    """What `study status` says."""
    loaded, found = parts.loaded, survey(parts)
    about = facts_of(found.counts)
    return {
        "file": str(loaded.path),
        "name": loaded.study.name,
        "hash": loaded.hash,
        "designs": loaded.count,
        **about,
        "open": loaded.count - about["done"],
        "folder": str(parts.folder),
        "parts": len(found.done),
        "damaged": list(found.damaged.values()),
        "foreign": [path.name for path in found.foreign],
        "assumed": list(loaded.assumed),
        "not_stated": list(loaded.not_stated),
    }
