"""Rows of a part under way outlive their run, exactly, and nothing else is taken for one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from flexfem.study.content import forget_rows, journal_path, keep_rows, kept_rows
from flexfem.study.outputs import Rows
from flexfem.study.parts import parts_of


def test_rows_come_back_exactly_and_torn_or_changed_lines_do_not(studies: Any, tmp_path: Path) -> None:
    parts = parts_of(studies.of("method = 'grid'", 'key = "thickness_mm"\nvalues = [9.7, 9.8]'), tmp_path, 2)
    chunk = parts.chunk(0)
    values = np.array([[1 / 3, np.nan, 1e-300]])
    for design in (0, 1):
        keep_rows(parts, chunk, design, Rows(np.array(["ok"], object), np.array([""], object), values + design))
    path = journal_path(parts, chunk)
    path.write_bytes(path.read_bytes().replace(b"1.3333", b"1.3433") + b"\n0123 [0, ")
    found = kept_rows(parts, chunk)
    assert list(found) == [0]
    np.testing.assert_array_equal(found[0].values, values)
    forget_rows(parts, chunk)
    assert kept_rows(parts, chunk) == {} and not path.exists()
