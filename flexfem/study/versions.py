"""What decides results besides the study: flexfem's own sources and the libraries that compute."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType

SOURCES = Path(__file__).parent.parent
NUMERIC = ("flexfem", "numpy", "scipy", "shapely")
MESHED = ("gmsh", "scikit-fem")
DECIDES_NOTHING = (  # shows, runs or keeps what others decide; a new module counts until it is named here
    "__main__.py",
    "benchmark",
    "cli.py",
    "console.py",
    "facts.py",
    "files.py",
    "peers",
    "report",
    "study/cells.py",
    "study/collect.py",
    "study/commands.py",
    "study/figure.py",
    "study/findings.py",
    "study/pareto.py",
    "study/percentiles.py",
    "study/cluster.py",
    "study/pool.py",
    "study/progress.py",
    "study/run.py",
    "study/shard.py",
    "study/sensitivity.py",
    "study/stale.py",
    "study/status.py",
    "study/table.py",
    "tables.py",
    "verify/baseline",
    "verify/claims.py",
    "verify/workspace.py",
)


@lru_cache
def versions_of(meshed: bool) -> MappingProxyType[str, str]:
    """Versions by name of what decides the results of a study, `meshed` when finite elements take part in it."""
    names = (*NUMERIC, *MESHED) if meshed else NUMERIC
    found = {name: _version(name) for name in names} | {"sources": digest()}
    if meshed:
        installed = _version("cvxopt")
        found["solver"] = "superlu" if installed == "none" else f"cvxopt {installed}"
    return MappingProxyType(found)


@lru_cache
def digest(sources: Path = SOURCES) -> str:
    """First 16 digits of the SHA-256 of every source and data file that decides results, paths included."""
    total = hashlib.sha256()
    for path in sorted((*sources.rglob("*.py"), *sources.rglob("data/*.json"))):
        name = path.relative_to(sources).as_posix()
        if counts(name):
            total.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()[:16]


def counts(name: str) -> bool:
    """Whether a file, by its path below the package, decides results."""
    return not any(name == silent or name.startswith(f"{silent}/") for silent in DECIDES_NOTHING)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
