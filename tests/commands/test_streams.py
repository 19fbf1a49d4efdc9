"""What runs is what was hashed, time is not eaten by stops, and nothing printed commands a terminal."""

from __future__ import annotations

import io
import os
import pickle
import subprocess

import pytest

from flexfem.clock import Stopwatch
from flexfem.commands.streams import Plain
from flexfem.errors import BadInput
from flexfem.files.toml import Table, validate
from flexfem.files.writing import write_atomically
from flexfem.sources import child_command, hashes


def test_a_child_refuses_sources_that_its_parent_did_not_hash():
    told = pickle.dumps(hashes() | {"fem/drawing.py": "0" * 64})
    child = subprocess.run(child_command("flexfem.fem.mesher"), input=told, capture_output=True)
    assert child.returncode == 3
    assert child.stderr.decode().startswith("flexfem/fem/drawing.py is not what it was")


def test_a_stop_adds_a_second_at_most(monkeypatch):
    now = iter([100.0, 100.25, 175.5])
    monkeypatch.setattr("flexfem.clock.time.monotonic", lambda: next(now))
    watch = Stopwatch()
    assert (watch.step(), watch.step()) == (0.25, 1.0)


def test_control_characters_are_printed_as_text():
    stream = io.StringIO()
    Plain(stream, True).write("a\x1b[31m\tb\x9b\r\u202e\n")
    assert stream.getvalue() == "a\\x1b[31m\tb\\x9b\\r\\u202e\n"


@pytest.mark.parametrize("name", ["...toml", "..toml", ".toml", "-x.toml", "a\x1b.toml", "a\\b.toml"])
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
