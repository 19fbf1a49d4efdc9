"""What was answered, design after design: named columns as arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import AnyArray, Array, Index

OK = "ok"


class Texts:
    """Texts (n,) of which few differ, a code for each; taken out of it they are an array of objects."""

    def __init__(self, codes: AnyArray, words: list[str]) -> None:
        self.codes, self.words = codes, words

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, place: Any) -> Any:
        return np.array(self.words, dtype=object)[self.codes[place]]

    def __eq__(self, other: object) -> AnyArray:  # type: ignore[override]
        if other not in self.words:
            return np.zeros(len(self.codes), dtype=bool)
        return np.asarray(self.codes == self.words.index(other))

    __hash__ = None  # type: ignore[assignment]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> AnyArray:
        return np.asarray(self[:])

    def tolist(self) -> list[str]:
        """All of them."""
        return list(self[:])


class StudyTable(NamedTuple):
    """What was answered, design after design.

    design : (n,), numbers of the designs, ascending.   status, reason : (n,), text.
    columns : factors in file units, outputs and derived outputs, (n,) each, by name; the latter two are nan where the
        status is not ok.
    feasible : (n,), which designs have an answer and keep all constraints; None in a study without constraints.

    Columns of a table on disk are read when they are asked for, and not kept.
    """

    design: Index
    status: AnyArray | Texts
    reason: AnyArray | Texts
    columns: Mapping[str, Array]
    feasible: AnyArray | None = None

    @property
    def ok(self) -> AnyArray:
        """Which designs have an answer, bool (n,)."""
        return np.asarray(self.status == OK)

    @property
    def counts(self) -> dict[str, int]:
        """How many designs have each status, the most frequent first."""
        return _counted(self.status, slice(None))

    @property
    def unanswered(self) -> dict[str, AnyArray]:
        """Which designs, bool (n,), have no answer, by status, the most frequent first."""
        return {status: np.asarray(self.status == status) for status in self.counts if status != OK}

    @property
    def doubts(self) -> dict[str, int]:
        """How many designs have an answer with something to know of it, by what it is."""
        return {reason: n for reason, n in _counted(self.reason, self.ok).items() if reason}

    @property
    def warnings(self) -> list[str]:
        """What is to be known of some of the answers, a sentence each."""
        return counted_doubts(self.doubts, int(self.ok.sum()))

    @property
    def infeasible(self) -> AnyArray:
        """Which designs, bool (n,), have an answer but break a constraint."""
        return np.zeros(len(self.design), dtype=bool) if self.feasible is None else self.ok & ~self.feasible

    @property
    def considered(self) -> StudyTable:
        """The table without the designs that break a constraint."""
        keep = ~self.infeasible
        if keep.all():
            return self._replace(feasible=None)
        status, reason = (
            Texts(texts.codes[keep], texts.words) if isinstance(texts, Texts) else texts[keep]
            for texts in (self.status, self.reason)
        )
        return StudyTable(self.design[keep], status, reason, SomeRows(self.columns, keep))

    def answered(self, *names: str) -> list[Array]:
        """Columns of the designs that have an answer."""
        ok = self.ok
        return [self.columns[name] if ok.all() else self.columns[name][ok] for name in names]


def _counted(texts: AnyArray | Texts, rows: Any) -> dict[str, int]:
    """How often each text is there in some rows, the most frequent first."""
    if not isinstance(texts, Texts):
        return dict(Counter(texts[rows].tolist()).most_common())
    numbers = np.bincount(texts.codes[rows], minlength=len(texts.words)).tolist()
    return dict(Counter({word: n for word, n in zip(texts.words, numbers, strict=True) if n}).most_common())


def counted_doubts(reasons: Mapping[str, int], ok: int) -> list[str]:
    """Warnings on the designs with an answer, by what stands as their reason, and how many."""
    return [f"{n:,} of {ok:,} designs with an answer: {reason}" for reason, n in reasons.items() if reason]


class SomeRows(Mapping[str, Array]):
    """Some rows, bool (n,), of columns by name."""

    def __init__(self, columns: Mapping[str, Array], keep: AnyArray) -> None:
        self._columns, self._keep = columns, keep

    def __getitem__(self, name: str) -> Array:
        return self._columns[name][self._keep]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)
