"""The sources of flexfem, the processes that it starts, and the file of the user, which they run as
well.

A child process starts with the module path of its parent without the current folder. `flexfem
--with FILE ...` puts the path and the hash of a file that registers hinge formulas and materials
into the environment. Children, such as the workers of a study, inherit both and reject a changed
file."""

from __future__ import annotations

import hashlib
import os
import sys
import traceback
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from flexfem.refused import BadInput, printed, text_of

PACKAGE = Path(__file__).parent
ONE_THREAD = {
    name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
}  # its environment
WITH = "FLEXFEM_WITH"  # environment variable: hash, colon, absolute path of the file of the user
_begun: set[str] = (
    set()
)  # values of the variable whose files were started, because a file may call `load_own`


@lru_cache
def manifest() -> Mapping[str, str]:
    """Return the SHA-256 of every source and data file of flexfem, by its path, at the first call.

    A command calls this before it loads the models.
    """
    paths = sorted((*PACKAGE.rglob("*.py"), *(PACKAGE / "data").glob("*.[jt]*")))
    files = {
        path.relative_to(PACKAGE).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in paths
    }
    return MappingProxyType(files)


def read_data(name: str) -> str:
    """Return the text of a file in the folder `data`."""
    return (PACKAGE / "data" / name).read_text(encoding="utf-8")


def child_command(module: str) -> list[str]:
    """Return the command of a child process that runs `main()` of a module."""
    code = f"import sys; sys.path[:] = sys.argv[1:]; from {module} import main; main()"
    return [
        sys.executable,
        "-P",
        "-c",
        code,
        *(entry for entry in sys.path if os.path.isabs(entry)),
    ]


def use_own(path: Path) -> None:
    """Run a file of the user in this process and its children. Raises BadInput when it cannot be
    read or run.
    """
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
    expected, colon, name = named.partition(":")
    if not colon:
        raise BadInput(
            f"{WITH} = {printed(named)}, expected no such variable, which flexfem --with FILE "
            "sets itself"
        )
    path = Path(name)
    content = _bytes(Path(name))
    if hashlib.sha256(content).hexdigest() != expected:
        raise BadInput(
            f"{path}: changed since this command began, expected the same file in every process"
        )
    try:
        exec(compile(content, path, "exec"), {"__name__": "flexfem_with", "__file__": str(path)})
    except BadInput as refusal:
        raise BadInput(f"{_place(path, refusal)}: {refusal}") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the file may raise anything and call sys.exit
        raised = f"{type(error).__name__}: {text_of(error)}".removesuffix(": ")
        message = f"{raised}, expected Python that registers formulas or materials"
        raise BadInput(f"{_place(path, error)}: {' '.join(message.split())}") from None


def _place(path: Path, error: BaseException) -> str:
    """Return the file of the user and its innermost line in the traceback of an error."""
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == str(path)
    ]
    lines = lines or [error.lineno] if isinstance(error, SyntaxError) else lines
    return f"{path}, line {lines[-1]}" if lines and lines[-1] else str(path)


def _bytes(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # reading a pipe would block
            raise BadInput(f"{path}: a directory, pipe, socket or device, expected a Python file")
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
