"""Answers of `flexfem claims` as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from flexfem.verify.result_files import read_record, stores

if TYPE_CHECKING:
    from flexfem.verdicts.records import ClaimsReport


def is_claims(path: Path) -> bool:
    """Whether a file is plainly one of claims; what else it may be is not looked at."""
    return stores(path, "verdicts")


def read_claims(path: Path) -> ClaimsReport:
    """Read stored claims. Raises BadInput when they are none of this version, or not as they were stored."""
    from flexfem.verdicts.records import ClaimsReport

    return read_record(path, ClaimsReport, "flexfem claims")
