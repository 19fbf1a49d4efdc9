"""A Python file of the user's that registers hinge formulas and materials, run in every process of a command.

`flexfem --with FILE ...` puts the file and its hash into the environment; children, such as the workers of a study,
inherit both and refuse the file when it is no longer that one.
"""

from __future__ import annotations

import hashlib
import os
import traceback
from pathlib import Path

from flexfem.refused import BadInput

VARIABLE = "FLEXFEM_WITH"  # hash, colon, absolute path
_begun: set[str] = set()  # values of the variable whose files ran or run: what a file calls may ask for it again


def use(path: Path) -> None:
    """Let this process and its children take what a file registers. Raises BadInput when it cannot be read or run."""
    os.environ[VARIABLE] = f"{hashlib.sha256(_bytes(path)).hexdigest()}:{path.absolute()}"
    load()


def own_hash() -> str:
    """SHA-256 of the file, "" when there is none."""
    return os.environ.get(VARIABLE, "").partition(":")[0]


def load() -> None:
    """Run the file that the environment names, once. Raises BadInput, naming file and line, when it cannot be."""
    named = os.environ.get(VARIABLE, "")
    if named and named not in _begun:
        _begun.add(named)
        try:
            _run(named)
        except BadInput:
            _begun.discard(named)
            raise


def _run(named: str) -> None:
    expected, _, name = named.partition(":")
    path = Path(name)
    content = _bytes(path)
    if hashlib.sha256(content).hexdigest() != expected:
        raise BadInput(f"{path}: changed since this command began, expected the same file in every process")
    try:
        exec(compile(content, path, "exec"), {"__name__": "flexfem_with", "__file__": str(path)})
    except BadInput as refusal:
        raise BadInput(f"{_place(path, refusal)}: {refusal}") from None
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the user's file may raise anything, and call sys.exit
        place = _place(path, error)
        raised = f"{type(error).__name__}: {error}".removesuffix(": ")
        said = f"{raised}, expected Python that registers formulas or materials"
        raise BadInput(f"{place}: {' '.join(said.split())}") from None


def _place(path: Path, error: BaseException) -> str:
    """File and line of the user's file, the deepest on the way to an error."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    lines = lines or [error.lineno] if isinstance(error, SyntaxError) else lines
    return f"{path}, line {lines[-1]}" if lines and lines[-1] else str(path)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
