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
    d, places = int(may.sum()), np.flatnonzero(may)
    u0 = np.clip(model.space.to_unit(start[None])[0], 0, 1)
    found = model.found(start[None])
    elastic = bool(np.sum(model.violations(found)) > TIGHT)
    size = max(abs(float(model.wanted(found)[0])), 1e-30)
    soft = model.soft if elastic else 0
    cache: dict[bytes, tuple[float, Array, Array, Array]] = {}

    def at(z: Array) -> tuple[float, Array, Array, Array]:
        key = z[:d].tobytes()
        if key not in cache:
            cache[key] = _differences(model, u0, places, np.clip(z[:d], 0, 1), size)
        return cache[key]

    def wanted(z: Array) -> float:
        return float(np.sum(z[d:])) if elastic else at(z)[0]

    def slope(z: Array) -> Array:
        return np.concatenate([np.zeros(d), np.ones(soft)]) if elastic else at(z)[1]

    def margins(z: Array) -> Array:
        return np.asarray(at(z)[2] - INWARD + np.concatenate([z[d:], np.zeros(len(at(z)[2]) - soft)]))

    def slopes(z: Array) -> Array:
        inner = at(z)[3]
        return np.hstack([inner, np.eye(len(inner), soft)])

    missed = np.maximum(0.0, -model.smooth(start[None], size).margins[0, :soft])
    result = minimize(
        wanted,
        np.concatenate([u0[may], missed]),
        jac=slope,
        bounds=Bounds(np.zeros(d + soft), np.concatenate([np.ones(d), np.full(soft, 100.0)])),
        constraints=[{"type": "ineq", "fun": margins, "jac": slopes}],
        method="SLSQP",
        options={"maxiter": ITERATIONS, "ftol": 1e-10},
    )
    u = u0.copy()
    u[may] = np.clip(result.x[:d], 0, 1)
    end = model.space.of_unit(u[None])[0]
    end[~may] = start[~may]
    return np.asarray(end)


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
