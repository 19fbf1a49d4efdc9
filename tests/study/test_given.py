"""A user's own table of designs: its rows are the designs, and what is wrong in it is named."""

from __future__ import annotations

import os
import pickle
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from flexfem.refused import BadInput
from flexfem.study.answer import answer
from flexfem.study.loaded import LoadedStudy, sample

VALUES = np.column_stack([np.linspace(0.41, 0.69, 11), np.linspace(72.5, 60.25, 11) ** 1.001])
FACTORS = 'label = "neck, base"\nkey = "hinges.base.neck_mm"', 'key = "material.youngs_modulus_gpa"'
NAMES = ("neck, base", "material.youngs_modulus_gpa")


def written(path: Path, values: np.ndarray = VALUES, names: tuple[str, ...] = NAMES) -> Path:
    columns = {"remark": ["a, b"] * len(values)} | dict(
        zip(names[::-1], values.T[::-1], strict=True)
    )
    if path.suffix == ".parquet":
        pq.write_table(pa.table(columns), path, row_group_size=4)
    else:
        rows = [columns, *zip(*columns.values(), strict=True)]
        lines = [
            ",".join(f'"{v}"' if isinstance(v, str) else repr(float(v)) for v in row)
            for row in rows
        ]
        path.write_text("\ufeff" + "\r\n".join(lines) + "\r\n")
    return path


def loaded_from(studies, name: str) -> LoadedStudy:
    return studies.of(f'method = "table"\nfile = "{name}"', *FACTORS)


@pytest.mark.parametrize("name", ["d.csv", "d.parquet"])
def test_the_rows_of_a_table_are_the_designs_in_their_order(studies, name: str) -> None:
    path = written(studies.folder / name)
    loaded = pickle.loads(pickle.dumps(loaded_from(studies, name)))
    assert loaded.count == 11
    np.testing.assert_array_equal(sample(loaded, 0, 11), VALUES)
    for start, stop in ((0, 4), (3, 5), (4, 8), (2, 11), (10, 11), (5, 5), (9, 99)):
        np.testing.assert_array_equal(sample(loaded, start, stop), VALUES[start:stop])
    rows = answer(loaded, 0, 11)
    assert set(rows.status) == {"ok"} and len(set(rows.values[:, 0])) == 11
    before = loaded.hash
    os.rename(path, studies.folder / f"moved-{name}")
    assert loaded_from(studies, f"moved-{name}").hash == before  # what is in it counts
    changed = VALUES.copy()
    changed[7, 1] += 1e-9
    written(path, changed)
    assert loaded_from(studies, name).hash != before
    with pytest.raises(BadInput, match=rf"{name}: changed since the study was read"):
        sample(loaded, 0, 1)  # never rows of one study under the name of another


WRONG = {
    "missing column": (
        VALUES,
        ("nek, base", NAMES[1]),
        ['column "neck, base" is missing', "did you mean nek, base"],
    ),
    "not a number": (
        np.where(np.arange(22).reshape(11, 2) == 14, np.nan, VALUES),
        NAMES,
        ["row 8", "nan", "finite"],
    ),
    "impossible": (
        np.where(np.arange(22).reshape(11, 2) == 18, -0.5, VALUES),
        NAMES,
        ["row 10", '"neck, base" = -0.5', "> 0 for hinges.base.neck_mm"],
    ),
    "infinite": (
        np.where(np.arange(22).reshape(11, 2) == 21, np.inf, VALUES),
        NAMES,
        ["row 11", "youngs", "finite"],
    ),
    "empty": (VALUES[:0], NAMES, ["no rows"]),
}


@pytest.mark.parametrize("name", ["d.csv", "d.parquet"])
@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_in_a_table_is_named_by_file_row_column_and_value(
    studies, what: str, name: str
) -> None:
    values, names, says = WRONG[what]
    written(studies.folder / name, values, names)
    with pytest.raises(BadInput) as refusal:
        loaded_from(studies, name)
    said = str(refusal.value)
    assert "\n" not in said and all(
        word in said for word in ("line 6: sampling.file", name, *says)
    ), said


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        (
            "d.csv",
            '"neck, base",material.youngs_modulus_gpa\n0.5,70\n0.5,"7O"\n',
            ["Row #3", "invalid value '7O'"],
        ),
        (
            "d.csv",
            '"neck, base",material.youngs_modulus_gpa\n0.5,70\n0.5,\n',
            ["Row #3", "invalid value ''"],
        ),
        (
            "d.csv",
            '"neck, base";material.youngs_modulus_gpa\n0,5;70\n',
            ["not CSV with commas between numbers"],
        ),
        (
            "d.csv",
            '"neck, base",material.youngs_modulus_gpa\n0.5,70,3\n',
            ["not CSV with commas between numbers"],
        ),
        (
            "d.csv",
            '"neck, base","neck, base",material.youngs_modulus_gpa\n1,2,3\n',
            ["appears twice"],
        ),
        ("d.csv", "", ["not CSV with commas between numbers"]),
        (
            "d.csv",
            '"\udcf6",material.youngs_modulus_gpa\n1,2\n',
            ["not CSV with commas between numbers"],
        ),
        ("d.parquet", "PAR1 not at all", ["not a Parquet file"]),
        ("d.txt", "a", ["ends in .csv or .parquet"]),
    ],
)
def test_files_that_are_no_table_are_refused_in_one_line(
    studies, name: str, content: str, says: list[str]
) -> None:
    (studies.folder / name).write_text(content, errors="surrogateescape")
    with pytest.raises(BadInput) as refusal:
        loaded_from(studies, name)
    assert "\n" not in str(refusal.value) and all(word in str(refusal.value) for word in says), str(
        refusal.value
    )


def test_a_parquet_column_of_text_and_a_pipe_are_refused(studies) -> None:
    pq.write_table(pa.table({NAMES[0]: ["0.5"], NAMES[1]: [70]}), studies.folder / "d.parquet")
    with pytest.raises(BadInput, match=r'column "neck, base" of type string, expected numbers'):
        loaded_from(studies, "d.parquet")
    pq.write_table(pa.table({NAMES[0]: [2**53 + 1], NAMES[1]: [70]}), studies.folder / "d.parquet")
    with pytest.raises(
        BadInput, match=r'row 1, column "neck, base" = 9.0072e\+15, expected <= 10000'
    ):
        loaded_from(studies, "d.parquet")
    os.mkfifo(studies.folder / "p.csv")
    with pytest.raises(BadInput, match="a pipe, socket or device"):
        loaded_from(studies, "p.csv")
