"""What `flexfem study` answers, as plain data: how far a study is, what is stale, what its figures show."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from flexfem.refused import BadInput
from flexfem.study.content import RETRIED, Counts, under_way
from flexfem.study.folder import Stale, survey
from flexfem.study.parts import PART, WHOLE, Parts, Shard, names_in
from flexfem.study.probes import unseen
from flexfem.study.study_table import counted_doubts

if TYPE_CHECKING:
    from flexfem.study.findings import Shown
    from flexfem.study.statistics import Percentile


def shard_of(text: str) -> Shard:
    """The shard that --shard I/N says, I from 1. Raises BadInput."""
    found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text) if isinstance(text, str) else None
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise BadInput(f"--shard {text}, expected I/N with 1 <= I <= N, such as 3/8")
    return Shard(int(found[1]) - 1, int(found[2]))


def counts_facts(counts: Counts) -> dict[str, Any]:
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
    about, designs = counts_facts(found.counts), shard.designs(parts)
    return {
        "file": str(loaded.path),
        "name": loaded.study.name,
        "hash": loaded.hash,
        "designs": designs,
        **about,
        "warnings": [*unseen(loaded), *about["warnings"]],
        "open": designs - about["done"],
        "under_way": under_way(parts, shard),
        "open_elsewhere": loaded.count - designs - found.elsewhere,
        "folder": str(parts.folder),
        "parts": len(found.done),
        "damaged": list(found.damaged.values()),
        "foreign": [path.name for path in found.foreign],
        "stale": sum(1 for name in names_in(parts.stale) if PART.fullmatch(name)),
        "stress_accuracy": loaded.stress_accuracy,
        "assumed": list(loaded.assumed),
        "not_stated": list(loaded.not_stated),
    }


def clean_facts(found: list[Stale]) -> dict[str, Any]:
    """What `study clean` says: how many parts and bytes of which study."""
    sizes: dict[tuple[str, str], list[int]] = {}
    for part in found:
        sizes.setdefault((part.stem, part.hash), []).append(part.size)
    listed = [
        {"study": stem, "hash": digits, "parts": len(each), "bytes": sum(each)}
        for (stem, digits), each in sorted(sizes.items())
    ]
    return {"stale": listed}


def facts_of(finding: Shown) -> dict[str, Any]:
    """A finding as plain numbers by name; an open end of an interval is None."""
    from flexfem.study.findings import Best, Extremes, Marks, Refused, Shares

    match finding:
        case Extremes(least, most):
            names = ("value", "x", "y")
            return {"least": dict(zip(names, least, strict=True)), "most": dict(zip(names, most, strict=True))}
        case Marks(found):
            return {name: [_percentile(one) for one in marks] for name, marks in found.items()}
        case Shares(factors, indices):
            return {
                name: {
                    key: None if part is None else dict(zip(factors, part.tolist(), strict=True))
                    for key, part in one._asdict().items()
                }
                for name, one in indices.items()
            }
        case Refused(reason):
            return {"refused": reason}
        case Best():
            return {"front": len(finding.front.places), "power": finding.power, "gain": finding.gain}


def _percentile(one: Percentile) -> dict[str, float | None]:
    return {name: float(value) if np.isfinite(value) else None for name, value in one._asdict().items()}
