"""The Python that runs is that which was hashed: flexfem's own sources, and a file of the user's.

Children of a command run what it began with, or nothing: they start with the parent's path less the current folder, so
that no file lying there is imported, and compare all sources of flexfem with the hashes that the parent took when it
began. `flexfem --with FILE ...` puts a file that registers hinge formulas and materials, and its hash, into the
environment; children, such as the workers of a study, inherit both and refuse the file when it is no longer that one.
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
CHANGED = 3  # exit code of a child
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}  # its environment
WITH = "FLEXFEM_WITH"  # variable: hash, colon, absolute path of the user's file
_begun: set[str] = set()  # values of the variable whose files ran or run: what a file calls may ask for it again


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


def use_own(path: Path) -> None:
    """Let this process and its children take what a file registers. Raises BadInput when it cannot be read or run."""
    os.environ[WITH] = f"{hashlib.sha256(_bytes(path)).hexdigest()}:{path.absolute()}"
    load_own()


def own_hash() -> str:
    """SHA-256 of the user's file, "" when there is none."""
    return os.environ.get(WITH, "").partition(":")[0]


def load_own() -> None:
    """Run the file that the environment names, once. Raises BadInput, naming file and line, when it cannot be."""
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
    except BaseException as error:  # the user's file may raise anything, and call sys.exit
        raised = f"{type(error).__name__}: {error}".removesuffix(": ")
        said = f"{raised}, expected Python that registers formulas or materials"
        raise BadInput(f"{_place(path, error)}: {' '.join(said.split())}") from None


def _place(path: Path, error: BaseException) -> str:
    """File and line of the user's file, the deepest on the way to an error."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    lines = lines or [error.lineno] if isinstance(error, SyntaxError) else lines
    return f"{path}, line {lines[-1]}" if lines and lines[-1] else str(path)


def _bytes(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise BadInput(f"{path}: a directory, pipe, socket or device, expected a Python file")
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
