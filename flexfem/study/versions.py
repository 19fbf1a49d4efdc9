"""What decides results besides the study: flexfem's own sources and the libraries that compute."""

from __future__ import annotations

import ast
import hashlib
import json
import math
import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve_triangular
from scipy.special import ndtri

from flexfem.own import own_hash
from flexfem.sources import PACKAGE, hashes, require_unchanged
from flexfem.study.closure import closure

NUMERIC = ("flexfem", "numpy", "scipy", "shapely")
MESHED = ("gmsh", "scikit-fem")
DATA = "data/"
ROOTS = ("study/answer.py", "study/parts.py")  # what answers designs, and what keeps the answers


@lru_cache
def versions_of(meshed: bool) -> MappingProxyType[str, str]:
    """Versions by name of what decides the results of a study, `meshed` when finite elements take part in it."""
    return MappingProxyType({"sources": digest(), **libraries_of(meshed)})


@lru_cache
def libraries_of(meshed: bool) -> MappingProxyType[str, str]:
    """As `versions_of`, but for flexfem's sources."""
    names = (*NUMERIC, *MESHED) if meshed else NUMERIC
    found = {"python": ".".join(platform.python_version_tuple()[:2])} | {name: _version(name) for name in names}
    found["arithmetic"] = arithmetic()
    if meshed:
        installed = _version("cvxopt")
        found["solver"] = "superlu" if installed == "none" else f"cvxopt {installed}"
    if own_hash():
        found["with"] = own_hash()[:16]
    return MappingProxyType(found)


@lru_cache
def arithmetic() -> str:
    """First 16 digits of the SHA-256 of what this machine makes of some sums that are never exact.

    Notes
    -----
    The last bits of a result are those of the processor's kernels in BLAS, LAPACK, numpy and the C library. They are
    asked for what studies use, on sizes around the kernels' blocks and too small for several threads.
    """
    total = hashlib.sha256()
    for n in (8, 24, 48, 56):
        a = np.sin(1.7 * np.arange(1.0, n * n + 1).reshape(n, n))
        b = a @ a.T + n * np.eye(n)
        factor, triangle = lu_factor(a + n * np.eye(n)), np.linalg.cholesky(b)
        found = [
            a @ a,
            a @ a[0],
            a[0] @ a[0],
            np.einsum("ij,jk,k->i", a, b, a[1]),
            np.linalg.inv(b),
            lu_solve(factor, a),
        ]
        found += [triangle, solve_triangular(triangle, a, lower=True), np.linalg.solve(b, a), a.sum(axis=0), a.sum()]
        found += [f(a) for f in (np.cos, np.arctan, np.exp, np.cbrt, np.tan)] + [np.hypot(a, b), np.arctan2(a, b)]
        found += [np.log(b * b + 1), np.sqrt(b * b), np.abs(b) ** 1.7, ndtri(0.5 + a / 3)]
        found += [np.array([math.sin(x) + math.atan2(x, 0.3) + math.exp(x) for x in a[0]])]
        total.update(b"".join(np.ascontiguousarray(each).tobytes() for each in found))
    return total.hexdigest()[:16]


@lru_cache
def digest(package: Path = PACKAGE) -> str:
    """First 16 digits of the SHA-256 of what decides results: code as Python reads it, and the bytes of data files.

    Comments, docstrings and how lines are broken change nothing. Raises SourcesChanged as `require_unchanged`.
    """
    found = dict(_deciding(package))
    found |= {path: content for path, content in hashes(package).items() if path.startswith(DATA)}
    if package == PACKAGE:
        require_unchanged()
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:16]


def counts(name: str) -> bool:
    """Whether a file, by its path below the package, decides results."""
    return name.startswith(DATA) or name in _deciding(PACKAGE)


@lru_cache
def _deciding(package: Path) -> MappingProxyType[str, str]:
    """Syntax trees as text of the modules that decide results, by path."""
    return MappingProxyType({path: ast.dump(tree) for path, tree in closure(ROOTS, package).items()})


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
