"""What decides results besides the study: flexfem's own sources, found by their imports, and the libraries used."""

from __future__ import annotations

import ast
import hashlib
import json
import math
import platform
import re
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve_triangular
from scipy.special import ndtri

from flexfem.own import own_hash
from flexfem.sources import PACKAGE, hashes, require_unchanged

ABOVE = ("api.py", "commands/", "plot/")  # for people; a stage that can draw itself names them, no answer runs them
NAME = re.compile(r"flexfem(\.\w+)+")  # of a module as a text, by which child processes are begun
NUMERIC = ("flexfem", "numpy", "scipy", "shapely")
MESHED = ("gmsh", "scikit-fem")
CHARTS = re.compile(r"data/.*\.json")  # materials count by their numbers, in the hash of the stage
ROOTS = ("study/answer.py", "study/content.py")  # what answers designs, and what keeps the answers


def closure(roots: tuple[str, ...], package: Path) -> dict[str, ast.Module]:
    """Syntax trees of modules and of all that they import, inside functions too, without comments and docstrings.

    Keys, and `roots`, are paths below the package, such as "study/answer.py". The package's own `__init__.py` offers
    everything to others and is left out; what is imported for annotations alone is not run, nor is what is `ABOVE`.
    """
    found, ahead = dict[str, ast.Module](), list(roots)
    while ahead:
        path = ahead.pop()
        if path not in found and not path.startswith(ABOVE) and (package / path).is_file():
            found[path] = _bare(ast.parse((package / path).read_bytes()))
            ahead += [place for name in _named(found[path]) for place in _places(name)]
    return dict(sorted(found.items()))


def _bare(tree: ast.Module) -> ast.Module:
    """The tree without statements that are texts, and without what is imported for annotations alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = []
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [each for each in body if not _is_text(each)]
    return tree


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _named(tree: ast.Module) -> Iterator[str]:
    """Names of modules, and of what may be modules, that a source imports or names in a text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and NAME.fullmatch(node.value):
            yield node.value


def _places(name: str) -> Iterator[str]:
    """Paths that a name, or the packages it is in, may have below the package."""
    first, *parts = name.split(".")
    if first == "flexfem":
        for end in range(1, len(parts) + 1):
            yield from (f"{'/'.join(parts[:end])}{ending}" for ending in (".py", "/__init__.py"))


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
    found |= {path: content for path, content in hashes(package).items() if CHARTS.fullmatch(path)}
    if package == PACKAGE:
        require_unchanged()
    return hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:16]


def counts(name: str) -> bool:
    """Whether a file, by its path below the package, decides results."""
    return CHARTS.fullmatch(name) is not None or name in _deciding(PACKAGE)


@lru_cache
def _deciding(package: Path) -> MappingProxyType[str, str]:
    """Syntax trees as text of the modules that decide results, by path."""
    return MappingProxyType({path: ast.dump(tree) for path, tree in closure(ROOTS, package).items()})


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
