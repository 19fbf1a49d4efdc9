"""Refusals on one short line; names and rights of files."""

from __future__ import annotations

import os

import pytest

from flexfem.files.tables import Table
from flexfem.files.toml import validate
from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput

PITFALLS = (
    "CON.toml",
    "nul.x.toml",
    "Lpt1 .toml",
    "a .toml",
    "a..toml",
    " a.toml",
)  # other systems read otherwise


@pytest.mark.parametrize(
    "name", ["...toml", "..toml", ".toml", "-x.toml", "a\x1b.toml", "a\\b.toml", *PITFALLS]
)
def test_a_name_that_is_no_plain_stem_is_refused(tmp_path, name):
    path = tmp_path / name
    path.write_text("")
    with pytest.raises(BadInput, match="expected a plain file name"):
        validate(Table, path)


def test_files_respect_the_umask(tmp_path):
    before = os.umask(0o007)
    try:
        write_atomically(tmp_path / "x", lambda file: file.write(b"1"))
    finally:
        os.umask(before)
    assert (tmp_path / "x").stat().st_mode & 0o777 == 0o660
