"""Answers of `flexfem claims --json` as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from flexfem.files.refusals import place_of
from flexfem.refused import BadInput
from flexfem.verify.result_files import first_mistake, stored_json, stores

if TYPE_CHECKING:
    from flexfem.verdicts.records import ClaimsReport


def is_claims(path: Path) -> bool:
    """Whether a file is plainly one of claims; what else it may be is not looked at."""
    return stores(path, "verdicts")


def read_claims(path: Path) -> ClaimsReport:
    """Read stored claims. Raises BadInput when they are none of this version."""
    from pydantic import ValidationError

    from flexfem.verdicts.records import ClaimsReport

    try:
        return ClaimsReport.model_validate_json(stored_json(path))
    except ValidationError as error:
        said = f"not what this version of flexfem claims stores: {first_mistake(error)}"
        raise BadInput(f"{place_of(path)}: {said}") from None
