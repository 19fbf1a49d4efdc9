"""S-N points of a material, measured: a CSV file with columns stress_mpa, the amplitude, and cycles, to failure."""

from __future__ import annotations

import csv
import math
import os

from flexfem.files.refusals import checked_path, one_line, place_of
from flexfem.files.toml import read_text
from flexfem.refused import BadInput

COLUMNS = ["stress_mpa", "cycles"]


def read_points(path: str | os.PathLike[str]) -> tuple[list[float], list[float]]:
    """Stresses, MPa, and cycles of a file. Raises BadInput, naming file and line."""
    path = checked_path(path)
    rows = [(k, line) for k, line in enumerate(read_text(path).splitlines(), 1) if line.strip() and line[0] != "#"]
    if not rows:
        raise BadInput(f"{place_of(path)}: empty, expected columns {', '.join(COLUMNS)}")
    cells = [(line, [cell.strip() for cell in next(csv.reader([text]))]) for line, text in rows]
    (line, head), *points = cells
    if sorted(head) != sorted(COLUMNS):
        said = one_line(", ".join(head), 60)
        raise BadInput(f"{place_of(path, line)}: columns {said}, expected {', '.join(COLUMNS)}")
    read = [dict(zip(head, _row(path, line, head, row), strict=True)) for line, row in points]
    return [row[COLUMNS[0]] for row in read], [row[COLUMNS[1]] for row in read]


def _row(path: os.PathLike[str], line: int, head: list[str], row: list[str]) -> list[float]:
    if len(row) != len(head):
        raise BadInput(f"{place_of(path, line)}: {len(row)} values, expected {len(head)}, as the first line has")
    found = []
    for key, cell in zip(head, row, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > 0):
            raise BadInput(f"{place_of(path, line)}: {key} = {one_line(cell, 60)}, expected a number above 0")
        found.append(value)
    return found
