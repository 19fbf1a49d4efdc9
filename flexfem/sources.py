"""Hashes of the sources of flexfem and of a file of the user, so that all processes of a command run the same code.

A child process starts with the module path of its parent without the current folder, and compares all sources with the
hashes of its parent. `flexfem --with FILE ...` puts the path and the hash of a file that registers hinge formulas and
materials into the environment. Children, such as the workers of a study, inherit both and reject a changed file.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import pickle
import sys
import traceback
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from flexfem.refused import BadInput, SourcesChanged

PACKAGE = Path(__file__).parent
CHANGED = 3  # exit code of a child that found changed sources
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}  # its environment
WITH = "FLEXFEM_WITH"  # environment variable: hash, colon, absolute path of the file of the user
_begun: set[str] = set()  # values of the variable whose files were started, because a file may call `load_own`


def hashes(package: Path = PACKAGE) -> dict[str, str]:
    """Return the SHA-256 of every source and data file of a package, by its path in the package."""
    paths = sorted((*package.rglob("*.py"), *(package / "data").glob("*.[jt]*")))
    return {path.relative_to(package).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@lru_cache
def manifest() -> Mapping[str, str]:
    """Return the hashes of flexfem at the first call; a command calls this before it loads the models."""
    return MappingProxyType(hashes())


def require_unchanged(expected: Mapping[str, str] | None = None) -> None:
    """Raise SourcesChanged when a file differs from the `expected` hashes, by default those of `manifest`."""
    now, before = hashes(), manifest() if expected is None else expected
    for name in sorted({*now, *before}):
        if now.get(name) != before.get(name):
            raise SourcesChanged(
                f"flexfem/{name} changed after this command began; finished results are kept: run the command again"
            )


def read_data(name: str) -> str:
    """Return the text of a file in the folder `data`."""
    return (PACKAGE / "data" / name).read_text(encoding="utf-8")


def child_command(module: str) -> list[str]:
    """Return the command of a child that runs `main()` of a module; its standard input begins with the manifest."""
    code = f"import sys; sys.path[:] = sys.argv[1:]; from flexfem.sources import begin_child; begin_child({module!r})"
    return [sys.executable, "-P", "-c", code, *(entry for entry in sys.path if os.path.isabs(entry))]


def begin_child(module: str) -> None:
    """Run a module in a child process; exit with `CHANGED` when the sources differ from those of the parent."""
    try:
        require_unchanged(pickle.load(sys.stdin.buffer))
    except SourcesChanged as changed:
        print(changed, file=sys.stderr)
        sys.exit(CHANGED)
    importlib.import_module(module).main()


def use_own(path: Path) -> None:
    """Run a file of the user in this process and its children. Raises BadInput when it cannot be read or run."""
    os.environ[WITH] = f"{hashlib.sha256(_bytes(path)).hexdigest()}:{path.absolute()}"
    load_own()


def own_hash() -> str:
    """Return the SHA-256 of the file of the user, "" without one."""
    return os.environ.get(WITH, "").partition(":")[0]


def load_own() -> None:
    """Run the file named by the environment once. Raises BadInput with file and line of an error."""
    named = os.environ.get(WITH, "")
    if named and named not in _begun:
        _begun.add(named)
        try:
            _run(named)
        except BadInput:
            _begun.discard(named)
            raise


def _run(named: str) -> None:
    expected, _, name = named.partition(":")
    path, content = Path(name), _bytes(Path(name))
    if hashlib.sha256(content).hexdigest() != expected:
        raise BadInput(f"{path}: changed since this command began, expected the same file in every process")
    try:
        exec(compile(content, path, "exec"), {"__name__": "flexfem_with", "__file__": str(path)})
    except BadInput as refusal:
        raise BadInput(f"{_place(path, refusal)}: {refusal}") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the file may raise anything and call sys.exit
        raised = f"{type(error).__name__}: {error}".removesuffix(": ")
        message = f"{raised}, expected Python that registers formulas or materials"
        raise BadInput(f"{_place(path, error)}: {' '.join(message.split())}") from None


def _place(path: Path, error: BaseException) -> str:
    """Return the file of the user and its innermost line in the traceback of an error."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    lines = lines or [error.lineno] if isinstance(error, SyntaxError) else lines
    return f"{path}, line {lines[-1]}" if lines and lines[-1] else str(path)


def _bytes(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # reading a pipe would block
            raise BadInput(f"{path}: a directory, pipe, socket or device, expected a Python file")
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
