"""The sources that run are those that were hashed: children of a command import what it began with, or nothing.

A child starts with the parent's path less the current folder, so that no file lying there is imported, and loads
modules of flexfem from their sources alone, each checked against the hashes that the parent took when it began.
"""

from __future__ import annotations

import hashlib
import importlib
import marshal
import os
import pickle
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import MAGIC_NUMBER, cache_from_source, source_hash
from pathlib import Path
from types import CodeType, MappingProxyType, ModuleType
from typing import cast

from flexfem.refused import SourcesChanged

PACKAGE = Path(__file__).parent
CHANGED = 3  # exit code of a child
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}  # its environment
CHECKED_HASH = b"\3\0\0\0"  # flags of bytecode that Python takes only for a source of the hash that follows (PEP 552)
_expected: dict[str, str] = {}  # of a child; empty in a process that nobody guards


def hashes(package: Path = PACKAGE) -> dict[str, str]:
    """SHA-256 of every source and data file of a package as it is now, by its path below the package."""
    paths = sorted((*package.rglob("*.py"), *(package / "data").glob("*.[jt]*")))
    return {path.relative_to(package).as_posix(): _hash(path.read_bytes()) for path in paths}


@lru_cache
def manifest() -> Mapping[str, str]:
    """The hashes of flexfem when they were first asked for: a command asks before it loads what computes."""
    return MappingProxyType(hashes())


def require_unchanged() -> None:
    """Raise SourcesChanged when a file is not what it was when `manifest` was taken."""
    now = hashes()
    for name in sorted({*now, *manifest()}):
        if now.get(name) != manifest().get(name):
            raise _changed(name)


def guard(expected: Mapping[str, str]) -> None:
    """In a child: load no module of flexfem that differs from the hash `expected` of it."""
    _expected.update(expected)
    sys.meta_path.insert(0, _Finder())


def read_data(name: str) -> str:
    """Text of a file under `data`. Raises SourcesChanged in a child whose parent had another."""
    path = PACKAGE / "data" / name
    return _checked(path, path.read_bytes()).decode("utf-8")


def child_command(module: str) -> list[str]:
    """Command of a child that runs `main()` of a module of flexfem; to its standard input the manifest goes first."""
    code = f"import sys; sys.path[:] = sys.argv[1:]; from flexfem.sources import begin_child; begin_child({module!r})"
    return [sys.executable, "-P", "-c", code, *(entry for entry in sys.path if os.path.isabs(entry))]


def begin_child(module: str) -> None:
    """In a child: run a module under the guard; exits with `CHANGED` when it is not what the parent hashed."""
    guard(pickle.load(sys.stdin.buffer))
    try:
        importlib.import_module(module).main()
    except SourcesChanged as changed:
        print(changed, file=sys.stderr)
        sys.exit(CHANGED)


class _Loader(SourceFileLoader):
    """Runs the very bytes that were checked, from the cache only where it says that it was compiled from these."""

    def get_code(self, fullname: str) -> CodeType | None:
        path = self.get_filename(fullname)
        source, cached = _checked(Path(path), self.get_data(path)), cache_from_source(path)
        head = MAGIC_NUMBER + CHECKED_HASH + source_hash(source)
        with suppress(OSError, EOFError, TypeError, ValueError):
            content = self.get_data(cached)
            if content.startswith(head):
                return cast(CodeType, marshal.loads(content[len(head) :]))
        code: CodeType = self.source_to_code(source, path)
        if not sys.dont_write_bytecode:
            self.set_data(cached, head + marshal.dumps(code))  # whole or not at all; where it may not write, none
        return code


class _Finder(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if not fullname.startswith("flexfem."):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def _checked(path: Path, content: bytes) -> bytes:
    name = path.relative_to(PACKAGE).as_posix()
    if _expected.get(name, _hash(content)) != _hash(content):
        raise _changed(name)
    return content


def _changed(name: str) -> SourcesChanged:
    return SourcesChanged(f"flexfem/{name} is not what it was when this command began; what is done is kept, run again")


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
