"""The sources that run are those that were hashed: children of a command run what it began with, or nothing.

A child starts with the parent's path less the current folder, so that no file lying there is imported, and compares all
sources of flexfem with the hashes that the parent took when it began.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import sys
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from flexfem.refused import SourcesChanged

PACKAGE = Path(__file__).parent
CHANGED = 3  # exit code of a child
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}  # its environment


def hashes(package: Path = PACKAGE) -> dict[str, str]:
    """SHA-256 of every source and data file of a package as it is now, by its path below the package."""
    paths = sorted((*package.rglob("*.py"), *(package / "data").glob("*.[jt]*")))
    return {path.relative_to(package).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@lru_cache
def manifest() -> Mapping[str, str]:
    """The hashes of flexfem when they were first asked for: a command asks before it loads what computes."""
    return MappingProxyType(hashes())


def require_unchanged(expected: Mapping[str, str] | None = None) -> None:
    """Raise SourcesChanged when a file is not what is `expected`, by default what it was when `manifest` was taken."""
    now, before = hashes(), manifest() if expected is None else expected
    for name in sorted({*now, *before}):
        if now.get(name) != before.get(name):
            raise SourcesChanged(
                f"flexfem/{name} is not what it was when this command began; what is done is kept, run again"
            )


def read_data(name: str) -> str:
    """Text of a file under `data`."""
    return (PACKAGE / "data" / name).read_text(encoding="utf-8")


def child_command(module: str) -> list[str]:
    """Command of a child that runs `main()` of a module of flexfem; to its standard input the manifest goes first."""
    code = f"import sys; sys.path[:] = sys.argv[1:]; from flexfem.sources import begin_child; begin_child({module!r})"
    return [sys.executable, "-P", "-c", code, *(entry for entry in sys.path if os.path.isabs(entry))]


def begin_child(module: str) -> None:
    """In a child: run a module; exits with `CHANGED` when the sources are not what the parent hashed."""
    try:
        require_unchanged(pickle.load(sys.stdin.buffer))
    except SourcesChanged as changed:
        print(changed, file=sys.stderr)
        sys.exit(CHANGED)
    importlib.import_module(module).main()
