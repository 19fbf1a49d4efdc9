"""How far a study is: read from its parts, whose footers count what is in them; nothing else is kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flexfem.refused import BadInput
from flexfem.study.content import RETRIED, Counts, counts_of_table, read_counts, read_part
from flexfem.study.parts import PART, WHOLE, Parts, Shard, listed, names_in
from flexfem.study.probes import unseen
from flexfem.study.study_table import counted_doubts


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


def facts_of(counts: Counts) -> dict[str, Any]:
    """Designs done, by status, and by kind of reason with the most frequent first."""
    by_status: Counter[str] = Counter()
    for (status, _), n in counts.items():
        by_status[status] += n
    reasons = {status: dict(_reasons(counts, status)) for status in sorted(by_status) if status != "ok"}
    bad = sum(n for status, n in by_status.items() if status in RETRIED)
    plain = {"done": by_status.total(), "ok": by_status["ok"], "refused": by_status["refused"], "failed": bad}
    doubts = counted_doubts(dict(_reasons(counts, "ok")), plain["ok"])
    return plain | {"reasons": reasons, "warnings": doubts}


def _reasons(counts: Counts, wanted: str) -> Iterator[tuple[str, int]]:
    for (status, reason), n in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        if status == wanted:
            yield reason, n


def status_facts(parts: Parts, shard: Shard = WHOLE) -> dict[str, Any]:
    """What `study status` says, of all chunks or of those of a shard."""
    loaded, found = parts.loaded, survey(parts, shard)
    about, designs = facts_of(found.counts), shard.designs(parts)
    return {
        "file": str(loaded.path),
        "name": loaded.study.name,
        "hash": loaded.hash,
        "designs": designs,
        **about,
        "warnings": [*unseen(loaded), *about["warnings"]],
        "open": designs - about["done"],
        "open_elsewhere": loaded.count - designs - found.elsewhere,
        "folder": str(parts.folder),
        "parts": len(found.done),
        "damaged": list(found.damaged.values()),
        "foreign": [path.name for path in found.foreign],
        "stale": sum(1 for name in names_in(parts.stale) if PART.fullmatch(name)),
        "assumed": list(loaded.assumed),
        "not_stated": list(loaded.not_stated),
    }
