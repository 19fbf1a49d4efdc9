"""Records of `flexfem design` as files."""

from __future__ import annotations

import os

from pydantic import ValidationError

from flexfem.files.refusals import place_of
from flexfem.refused import BadInput
from flexfem.synthesis.result import Designed
from flexfem.verify.result_files import first_mistake, stored_json, stores


def is_design(path: str | os.PathLike[str]) -> bool:
    """Whether a file is plainly the record of a design."""
    return stores(path, "objectives", "sensitivities")


def read_design(path: str | os.PathLike[str]) -> Designed:
    """Read a stored design. Raises BadInput when it is none of this version."""
    try:
        return Designed.model_validate_json(stored_json(path))
    except ValidationError as error:
        said = f"not what this version of flexfem design stores: {first_mistake(error)}"
        raise BadInput(f"{place_of(path)}: {said}") from None
