"""Where a stage comes from, and refusals that say so."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from flexfem.files.keypath import path_of
from flexfem.files.refusals import place_of
from flexfem.files.toml import read_toml
from flexfem.refused import BadInput
from flexfem.stage.content import Origin, StageContent


def of_stage(stage: StageContent) -> dict[str, Any]:
    """What every answer says of its stage: which it is, and which of its numbers are in doubt."""
    doubts = {"assumed": list(stage.assumed), "not_stated": list(stage.not_stated)}
    return {"file": str(stage.origin), "name": stage.name, **doubts}


@contextmanager
def located(stage: StageContent) -> Iterator[None]:
    """Put file and line of a stage that has a file in front of refusals that begin with a key path of it."""
    try:
        yield
    except BadInput as refusal:
        if refusal.located or stage.origin.path is None:
            raise
        raise BadInput(str(refusal), _place(stage.origin, str(refusal))) from None


def _place(origin: Origin, refusal: str) -> str:
    if origin.path is None or origin.changed:
        return str(origin)
    try:
        data, lines = read_toml(origin.path)
        key = re.match(r"(?:\.?\w+|\[\d+\])*", refusal)
        return place_of(origin.path, lines.line(path_of(key[0] if key else "", data)))
    except BadInput:  # gone since
        return place_of(origin.path)
