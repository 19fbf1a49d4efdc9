"""The front of two objectives from few answered designs: response surfaces foretell the others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from scipy.stats import qmc

from flexfem.arrays import AnyArray, Array, Index
from flexfem.study.findings import non_dominated
from flexfem.synthesis.model import Found, Model
from flexfem.synthesis.search import Say

FIRST, ADDED = 4, 32  # designs answered at first, more than there are dimensions; then one by one: 41 of five
SAMPLE, TRIES = 1024, 4  # designs of which the first are taken that have an answer; so many times as many are tried
TRIED, ROUNDS = 1000, 6  # designs that surfaces are asked for, and how often beside the best of them
NEAREST, FARTHEST = 1e-3, 0.3  # of a range, that they lie beside them
SMOOTHING = 1e-10  # of surfaces: two designs at one place of a list leave them regular
DRAWN = 20  # proposals in a row that cannot be drawn, after which it is given up
FEW = 20  # designs that are gone on with where none meets all
ROOM = 0.1  # of the span of an objective, that the reference point lies beyond the worst design

Foretold = Callable[[Array], tuple[Array, Array]]  # of places (n, d): both objectives (n, 2), what is missed (n,)


def sketched(model: Model, seed: int, added: int = ADDED, say: Say = lambda text: None) -> Array:
    """Designs (n, d) that no other of d + `FIRST` + `added` answered ones beats, from the best in the first objective.

    Of fewer where the first have too few answers for a surface; those that miss least where none meets all.

    Notes
    -----
    Surfaces are cubic radial basis functions with a linear trend. The next design answered is the one that by these
    adds most to the area that the front dominates, in logarithms: Ponweiser, Wagner, Biermann, Vincze, PPSN X, LNCS
    5199 (2008) 784-794, without its optimism.
    """
    sketch = _Sketch(model, seed)
    for k in range(added if sketch.enough else 0):
        if not sketch.add():
            break
        say(f"front: {k + 1} of {added} designs proposed by response surfaces")
    return sketch.front


class _Sketch:
    """Designs answered so far: `places` (n, d), their `quantities` (n, q)."""

    def __init__(self, model: Model, seed: int) -> None:
        self.model, self.space, self.rng = model, model.space, np.random.default_rng(seed)
        d = self.space.size
        self.places, self.quantities = np.empty((0, d)), np.empty((0, len(model.loaded.requirements.quantities)))
        self.lost = np.empty((0, d))
        places = self._allowed(qmc.Sobol(d, rng=self.rng).random(SAMPLE))
        for place in places[: TRIES * (d + FIRST)]:
            if len(self.places) == d + FIRST:
                break
            if self._drawn(place):
                self._answer(place[None])

    @property
    def enough(self) -> bool:
        """Whether there are more answers than coefficients of the trend."""
        return len(self.places) > self.space.size + 1

    def _allowed(self, places: Array) -> Array:
        """Those of places (n, d) that keep the closed conditions and are nearer one with an answer than one without."""
        places = places[np.all(self.model.gaps(self.space.of_unit(places)) >= 0, axis=1)]
        if not len(self.lost) or not len(self.places):
            return places
        near, lost = (cKDTree(each).query(places)[0] for each in (self.places, self.lost))
        return np.asarray(places[near <= lost])

    def _drawn(self, place: Array) -> bool:
        """Whether the design at a place (d,) can be drawn, which is remembered where it cannot."""
        if self.model.drawable(self.space.of_unit(place[None])[0]) == "":
            return True
        self.lost = np.vstack([self.lost, place])
        return False

    def _answer(self, places: Array) -> None:
        values = self.space.of_unit(places)
        found = self.model.found(values)
        kept = found.reason == ""
        self.lost = np.vstack([self.lost, places[~kept]])
        self.places = np.vstack([self.places, self.space.to_unit(values[kept])])
        self.quantities = np.vstack([self.quantities, found.quantities[kept]])

    def _judged(self, quantities: Array) -> tuple[Array, Array]:
        """Both objectives (n, 2), to be small, in logarithms where all have them, and what is missed in all (n,)."""
        both = self.model.signed(self._logarithms(quantities))
        missed = self.model.violations(Found(quantities, np.full(len(quantities), "", dtype=object)))
        return both, np.sum(missed, axis=1)

    def _logarithms(self, quantities: Array) -> Array:
        """Quantities (n, q), those as logarithms that are positive at every design."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.logarithmic, np.log(quantities), quantities)

    @property
    def logarithmic(self) -> AnyArray:
        """Which quantities (q,) are positive at every design."""
        return np.asarray(np.all(self.quantities > 0, axis=0))

    @property
    def front(self) -> Array:
        """The best designs (n, d) that were answered, those that miss least where none meets all."""
        if not len(self.places):
            return np.empty((0, self.space.size))
        both, missed = self._judged(self.quantities)
        return self.space.of_unit(np.asarray(self.places[_best(both, missed)]))

    def add(self) -> bool:
        """Answer the design that adds most by surfaces through all so far; False where there is none."""
        q = self.quantities
        try:
            surfaces = RBFInterpolator(self.places, self._logarithms(q), smoothing=SMOOTHING, kernel="cubic", degree=1)
        except np.linalg.LinAlgError:  # the places are all in one plane
            return False

        def foretold(places: Array) -> tuple[Array, Array]:
            values = surfaces(places)
            with np.errstate(over="ignore"):
                return self._judged(np.where(self.logarithmic, np.exp(values), values))

        for _ in range(DRAWN):
            places = self._searched(foretold)
            if not len(places):
                return False
            both, missed = foretold(places)
            own, own_missed = self._judged(q)
            gain = gains(own[own_missed <= 0], both, own.max(axis=0) + ROOM * np.ptp(own, axis=0))
            best = places[np.lexsort((-gain, missed))[0]]
            if self._drawn(best):
                self._answer(best[None])
                return True
        return False

    def _searched(self, foretold: Foretold) -> Array:
        """Places (n, d) that are best by surfaces, found at random, and ever nearer beside the best."""
        d = self.space.size
        every = self.rng.random((TRIED, d))
        ends = np.where(self.rng.random((TRIED, d)) < 2 / 3, np.round(self.rng.random((TRIED, d))), every)
        places = self._allowed(np.vstack([every, ends, self.places]))
        for turn in range(ROUNDS):
            places = places[_best(*foretold(places))]
            if turn == ROUNDS - 1 or not len(places):
                break
            from_ = places[self.rng.integers(len(places), size=TRIED)]
            far = NEAREST * (FARTHEST / NEAREST) ** self.rng.random((TRIED, 1))
            moves = far * self.rng.standard_normal((TRIED, d)) * (self.rng.random((TRIED, d)) < 0.6)
            places = np.vstack([places, self._allowed(np.clip(from_ + moves, 0, 1))])
        return np.asarray(places)


def gains(known: Array, both: Array, reference: Array) -> Array:
    """Areas (n,) that objectives `both` (n, 2) add to what `known` (m, 2) dominate, up to a reference point (2,)."""
    known = known[non_dominated(*-known.T)]
    edges = np.concatenate([[-np.inf], np.minimum(known[:, 0], reference[0]), reference[:1]])
    heights = np.concatenate([reference[1:], np.minimum(known[:, 1], reference[1])])
    widths = np.clip(edges[1:] - np.maximum(edges[:-1], both[:, :1]), 0, None)
    return np.asarray(np.sum(widths * np.clip(heights - both[:, 1:], 0, None), axis=1))


def _best(both: Array, missed: Array) -> Index:
    """Places (m,) of the designs that meet all and that no other beats; of those that miss least where none does."""
    if not np.any(missed <= 0):
        return np.argsort(missed, kind="stable")[:FEW]
    meet = np.flatnonzero(missed <= 0)
    return np.asarray(meet[non_dominated(*-both[meet].T)])
