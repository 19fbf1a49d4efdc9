"""Design studies; `flexfem.study.table` reads the table of a collected study for pandas or Arrow."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

REPORTS = Path("reports")  # default folder of results
MOST_WORKERS = 1024


def table(path: str | os.PathLike[str], as_arrow: bool = False) -> Any:
    """Read the table that `flexfem study collect` wrote, one row per design.

    Parameters
    ----------
    path : a Parquet or CSV file, or a folder of Parquet files.
    as_arrow : return a `pyarrow.Table` instead of a `pandas.DataFrame`, which needs pandas.

    Returns
    -------
    A table with the columns `design`, `status`, `reason`, and the factors and outputs in file
    units. The names of outputs end in their unit; outputs are nan where the status is not "ok".

    Raises
    ------
    BadInput
        The file is missing, or is not the table of a study.
    """
    from pyarrow import ArrowException, BufferReader, concat_tables, csv, parquet

    from flexfem.files.refusals import checked_path
    from flexfem.refused import BadInput

    source = checked_path(path)
    files = sorted(source.glob("*.parquet")) if source.is_dir() else [source]
    tables = []
    try:
        for file in files:
            # pyarrow opens no file whose name is not UTF-8
            content = BufferReader(file.read_bytes())
            read = csv.read_csv if file.suffix == ".csv" else parquet.read_table
            tables.append(read(content))
        joined = concat_tables(tables)
    except (OSError, ArrowException) as error:
        reason = "damaged, or neither Parquet nor CSV"
        if isinstance(error, FileNotFoundError):
            reason = "no such file"
        raise BadInput(f"{source}: expected the table of a study: {reason}") from None
    if not {"design", "status", "reason"} <= set(joined.column_names):
        raise BadInput(
            f"{source}: expected the table of a study, with columns design, status and reason"
        )
    return joined if as_arrow else joined.to_pandas()
