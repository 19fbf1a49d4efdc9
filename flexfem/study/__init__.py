"""Design studies; `flexfem.study.table` hands a collected one to pandas or Arrow."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

REPORTS = Path("reports")  # folder for results where none is given
MOST_WORKERS = 1024


def table(path: str | os.PathLike[str], as_arrow: bool = False) -> Any:
    """The table that `flexfem study collect` wrote, a row for each design.

    Parameters
    ----------
    path : a file, Parquet or CSV, or a folder of Parquet files.
    as_arrow : a `pyarrow.Table` instead of a `pandas.DataFrame`, which needs pandas.

    Returns
    -------
    Columns `design`, `status`, `reason`, the factors and outputs in file units, their names ending in the unit; outputs
    are nan where the status is not "ok".

    Raises
    ------
    BadInput
        The file is missing, or no table of a study.
    """
    from pyarrow import ArrowException, BufferReader, concat_tables, csv, parquet

    from flexfem.files.refusals import checked_path
    from flexfem.refused import BadInput

    place, tables = checked_path(path), []
    try:
        for each in sorted(place.glob("*.parquet")) if place.is_dir() else [place]:
            content = BufferReader(each.read_bytes())  # pyarrow takes no name that is not UTF-8
            tables.append(csv.read_csv(content) if each.suffix == ".csv" else parquet.read_table(content))
        found = concat_tables(tables)
    except (OSError, ArrowException) as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else "damaged, or neither Parquet nor CSV"
        raise BadInput(f"{place}: expected the table of a study: {reason}") from None
    if not {"design", "status", "reason"} <= set(found.column_names):
        raise BadInput(f"{place}: expected the table of a study, with columns design, status and reason")
    return found if as_arrow else found.to_pandas()
