"""Sequential quadratic programming of a design, with differences in one batch."""

from __future__ import annotations

import numpy as np
from scipy.optimize import Bounds, minimize

from flexfem.arrays import AnyArray, Array, Index
from flexfem.synthesis.model import Model

STEP = 1e-5  # of finite differences, of the range of a dimension
ITERATIONS = 60
INWARD = 2e-9  # of a size, by which a program keeps inside an end: its own round-off
TIGHT = 1e-9  # part of a requirement's size: less is round-off


def programmed(model: Model, start: Array, may: AnyArray) -> Array:
    """The end (d,) of sequential quadratic programming from `start`; what is missed is least where all cannot be met.

    Notes
    -----
    Differences in one batch for each iterate. Where the start misses a requirement, each has a slack of its own and
    their sum is to be least (an elastic program).
    """
    of = _Program(model, start, may)
    d, soft = len(of.places), of.soft
    missed = np.maximum(0.0, -model.smooth(start[None], of.size).margins[0, :soft])
    result = minimize(
        of.wanted,
        np.concatenate([of.u0[may], missed]),
        jac=of.slope,
        bounds=Bounds(np.zeros(d + soft), np.concatenate([np.ones(d), np.full(soft, 100.0)])),
        constraints=[{"type": "ineq", "fun": of.margins, "jac": of.slopes}],
        method="SLSQP",
        options={"maxiter": ITERATIONS, "ftol": 1e-10},
    )
    u = of.u0.copy()
    u[may] = np.clip(result.x[:d], 0, 1)
    end = model.space.of_unit(u[None])[0]
    end[~may] = start[~may]
    return np.asarray(end)


class _Program:
    """What is to be least, and what not negative, of (d + soft,): dimensions between 0 and 1, then a slack each."""

    def __init__(self, model: Model, start: Array, may: AnyArray) -> None:
        self.model, self.places = model, np.flatnonzero(may)
        self.u0 = np.clip(model.space.to_unit(start[None])[0], 0, 1)
        found = model.found(start[None])
        self.elastic = bool(np.sum(model.violations(found)) > TIGHT)
        self.size = max(abs(float(model.wanted(found)[0])), 1e-30)
        self.soft = model.soft if self.elastic else 0
        self._known = dict[bytes, tuple[float, Array, Array, Array]]()

    def _at(self, z: Array) -> tuple[float, Array, Array, Array]:
        x = z[: len(self.places)]
        if (key := x.tobytes()) not in self._known:
            self._known[key] = _differences(self.model, self.u0, self.places, np.clip(x, 0, 1), self.size)
        return self._known[key]

    def wanted(self, z: Array) -> float:
        return float(np.sum(z[len(self.places) :])) if self.elastic else self._at(z)[0]

    def slope(self, z: Array) -> Array:
        return np.concatenate([np.zeros(len(self.places)), np.ones(self.soft)]) if self.elastic else self._at(z)[1]

    def margins(self, z: Array) -> Array:
        inner = self._at(z)[2]
        return np.asarray(inner - INWARD + np.concatenate([z[len(self.places) :], np.zeros(len(inner) - self.soft)]))

    def slopes(self, z: Array) -> Array:
        inner = self._at(z)[3]
        return np.hstack([inner, np.eye(len(inner), self.soft)])


def _differences(model: Model, u0: Array, places: Index, x: Array, size: float) -> tuple[float, Array, Array, Array]:
    """Objective, its slope (d,), margins (k,) and theirs (k, d) at places `x` (d,), from 2 d + 1 designs at once."""
    d = len(places)
    low, high = np.clip(x - STEP, 0, 1), np.clip(x + STEP, 0, 1)
    u = np.tile(u0, (2 * d + 1, 1))
    u[:, places] = x
    u[np.arange(1, d + 1), places], u[np.arange(d + 1, 2 * d + 1), places] = low, high
    f, g = model.smooth(model.space.of_unit(u), size)
    lost = ~(np.isfinite(f) & np.isfinite(g).all(axis=1))
    if lost[0]:
        return 1e3, np.zeros(d), np.full(g.shape[1], -1e3), np.zeros((g.shape[1], d))
    minus, plus = np.arange(1, d + 1), np.arange(d + 1, 2 * d + 1)
    a, b = np.where(lost[minus], 0, minus), np.where(lost[plus], 0, plus)
    width = np.where(lost[plus], x, high) - np.where(lost[minus], x, low)
    width = np.where(width > 0, width, 1.0)
    return float(f[0]), (f[b] - f[a]) / width, g[0], ((g[b] - g[a]) / width[:, None]).T
