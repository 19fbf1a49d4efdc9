"""One arithmetic a folder: processors round differently, and neither are their rows mixed nor set each other's apart.

The first runner of a study says in the folder which arithmetic its rows are of; a runner of another one is refused.
"""

from __future__ import annotations

import hashlib
import json
import re
from contextlib import suppress
from pathlib import Path

from flexfem.refused import BadInput
from flexfem.study.parts import Parts

CURE = "processors differ: OPENBLAS_CORETYPE and NPY_DISABLE_CPU_FEATURES, set alike everywhere, make them one"


def require_same_arithmetic(parts: Parts) -> None:
    """Raise BadInput when this very study is computed in this folder with another arithmetic."""
    own, found = parts.versions["arithmetic"], _said(parts)
    if found not in (None, own):
        raise BadInput(
            f"{parts.folder.parent}: its rows are of arithmetic {found}, those of this machine would be of {own}: "
            f"{CURE}; else another --output, or flexfem study clean and begin anew"
        )


def claim_folder(parts: Parts) -> None:
    """Say of which arithmetic the rows of a folder are, unless somebody has. Raises BadInput."""
    path = _path(parts)
    try:
        if _said(parts) is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)  # a torn one
            with suppress(FileExistsError), path.open("x") as file:
                file.write(parts.versions["arithmetic"])
    except OSError as error:
        raise BadInput(f"{path}: cannot be written: {error.strerror or error}") from None
    require_same_arithmetic(parts)


def release_folder(parts: Parts) -> None:
    """Forget what runners of another arithmetic have said: their rows are removed."""
    if _said(parts) != parts.versions["arithmetic"]:
        with suppress(OSError):
            _path(parts).unlink(missing_ok=True)


def _said(parts: Parts) -> str | None:
    with suppress(OSError, UnicodeError):
        text = _path(parts).read_text(encoding="ascii")
        return text if re.fullmatch("[0-9a-f]{16}", text) else None
    return None


def _path(parts: Parts) -> Path:
    """A file whose name tells all that decides the rows but the arithmetic."""
    others = {name: text for name, text in parts.versions.items() if name != "arithmetic"}
    key = json.dumps([parts.loaded.hash, others], sort_keys=True)
    return parts.folder.parent / f".arithmetic-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
