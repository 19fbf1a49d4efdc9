"""A Python file of the user's that registers hinge formulas, run in every process of a command that names it.

`flexfem --with FILE ...` puts the file and its hash into the environment; children, such as the workers of a study,
inherit both and refuse the file when it is no longer that one.
"""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path

from flexfem.refused import BadInput

VARIABLE = "FLEXFEM_WITH"  # hash, colon, absolute path


def use(path: Path) -> None:
    """Let this process and its children take formulas from a file. Raises BadInput when it cannot be read or run."""
    os.environ[VARIABLE] = f"{hashlib.sha256(_bytes(path)).hexdigest()}:{path.absolute()}"
    load()


def own_hash() -> str:
    """SHA-256 of the file, "" when there is none."""
    return os.environ.get(VARIABLE, "").partition(":")[0]


def load() -> None:
    """Run the file that the environment names, once."""
    if VARIABLE in os.environ:
        _run(os.environ[VARIABLE])


@cache
def _run(named: str) -> None:
    expected, _, name = named.partition(":")
    path = Path(name)
    content = _bytes(path)
    if hashlib.sha256(content).hexdigest() != expected:
        raise BadInput(f"{path}: changed since this command began, expected the same formulas in every process")
    try:
        exec(compile(content, path, "exec"), {"__name__": "flexfem_with", "__file__": str(path)})
    except BadInput as refusal:
        raise BadInput(f"{path}: {refusal}") from None
    except Exception as error:
        raise BadInput(f"{path}: {type(error).__name__}: {error}, expected Python that registers formulas") from None


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
