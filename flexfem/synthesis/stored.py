"""Records of `flexfem design` as files."""

from __future__ import annotations

import os

from flexfem.synthesis.result import Designed
from flexfem.verify.result_files import read_record, stores


def is_design(path: str | os.PathLike[str]) -> bool:
    """Whether a file is plainly the record of a design."""
    return stores(path, "objectives", "sensitivities")


def read_design(path: str | os.PathLike[str]) -> Designed:
    """Read a stored design. Raises BadInput when it is none of this version, or not as it was stored."""
    return read_record(path, Designed, "flexfem design")
