"""What runs is what was hashed, time is not eaten by stops, and nothing printed commands a terminal."""

from __future__ import annotations

import io
import os
import pickle
import subprocess
import sys
from contextlib import nullcontext

import pytest

from flexfem.clock import Stopwatch
from flexfem.files.toml import Table, validate
from flexfem.files.writing import write_atomically
from flexfem.refused import BadInput
from flexfem.sources import _Loader, child_command, hashes
from flexfem.terminal import Plain, reason_of

from ..conftest import ROOT

STAGE = ROOT / "geometry/mobility6.toml"

PITFALLS = [
    "CON.toml",
    "nul.x.toml",
    "Lpt1 .toml",
    "a .toml",
    "a..toml",
    " a.toml",
]  # other systems read these otherwise


def test_a_child_refuses_sources_that_its_parent_did_not_hash():
    told = pickle.dumps(hashes() | {"fem/mesher.py": "0" * 64})
    child = subprocess.run(child_command("flexfem.fem.mesher"), input=told, capture_output=True)
    assert child.returncode == 3
    assert child.stderr.decode().startswith("flexfem/fem/mesher.py is not what it was")


def test_children_import_nothing_from_the_current_folder(tmp_path, monkeypatch):
    for name in ("numpy", "signal", "json", "flexfem"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    child = subprocess.run(
        child_command("flexfem.fem.mesher"), input=pickle.dumps(hashes()) + b".", capture_output=True
    )
    assert child.returncode == 1 and b"pickle" in child.stderr  # of the job, by then all is imported


def test_bytecode_is_that_of_the_very_source(tmp_path, monkeypatch):
    """A source of the same size and time as that of the cached bytecode is run itself."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)
    monkeypatch.setattr("flexfem.sources.PACKAGE", tmp_path)
    path, loader = tmp_path / "one.py", _Loader("flexfem.one", str(tmp_path / "one.py"))
    for text in ("x = 1", "x = 2", "x = 1"):
        path.write_text(text)
        os.utime(path, (1e9, 1e9))
        for _ in range(2):  # compiled, then cached
            found = {}
            exec(loader.get_code("flexfem.one"), found)
            assert found["x"] == int(text[-1])
    (cached,) = (tmp_path / "__pycache__").iterdir()
    monkeypatch.setattr(loader, "source_to_code", None)
    assert loader.get_code("flexfem.one").co_consts[0] == 1  # of the cache alone
    cached.write_bytes(cached.read_bytes()[:20])
    monkeypatch.undo()


def test_progress_to_a_full_stream_ends_nothing_and_results_to_one_do():
    for silent in (True, False):
        with open("/dev/full", "w") as full, nullcontext() if silent else pytest.raises(OSError, match="No space"):
            Plain(full, silent).write("x" * 10000)
            Plain(full, silent).flush()


def test_a_stop_adds_a_second_at_most(monkeypatch):
    now = iter([100.0, 100.25, 175.5])
    monkeypatch.setattr("flexfem.clock.time.monotonic", lambda: next(now))
    watch = Stopwatch()
    assert (watch.step(), watch.step()) == (0.25, 1.0)


def test_control_characters_are_printed_as_text():
    stream = io.StringIO()
    Plain(stream, True).write("a\x1b[31m\tb\x9b\r\u202e\n")
    assert stream.getvalue() == "a\\x1b[31m\tb\\x9b\\r\\u202e\n"


@pytest.mark.parametrize("name", ["...toml", "..toml", ".toml", "-x.toml", "a\x1b.toml", "a\\b.toml", *PITFALLS])
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


def test_an_error_under_edited_sources_is_said_to_be_that(monkeypatch):
    """Modules are loaded when they are needed: parts of two versions together can fail anywhere."""
    monkeypatch.setattr("flexfem.sources.manifest", lambda: {"one.py": "0" * 64})
    monkeypatch.setattr("flexfem.sources.hashes", lambda: {"one.py": "1" * 64})
    assert reason_of(TypeError("an unexpected argument")).startswith("flexfem/one.py is not what it was when this comm")
    monkeypatch.setattr("flexfem.sources.hashes", lambda: {"one.py": "0" * 64})
    assert "TypeError: an unexpected argument" in reason_of(TypeError("an unexpected argument"))


def test_every_command_hashes_its_sources_before_it_loads_what_computes(flexfem, monkeypatch):
    """Else a mesher that starts later would load sources that its command did not begin with."""
    asked = []
    monkeypatch.setattr("flexfem.commands.cli.manifest", lambda: asked.append(1))
    for number, arguments in enumerate((("regression", "none"), ("check", "none"), ("study", "status", "none")), 1):
        assert flexfem(*arguments)[0] in (1, 2)
        assert len(asked) == number


def run(*arguments, **streams):
    command = [sys.executable, "-m", "flexfem", *map(str, arguments)]
    return subprocess.run(command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE, **streams)


@pytest.mark.parametrize("asked", [["check", STAGE], ["check", STAGE, "--json"], ["--help"]])
def test_a_reader_that_has_seen_enough_is_no_failed_check(asked):
    """128 and the number of SIGPIPE, 13, whether Rich, typer or flexfem itself writes."""
    reader, writer = os.pipe()
    os.close(reader)
    ended = run(*asked, stdout=writer)
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (141, b"")


QUITS = """
import sys, flexfem
def quits(ratio):
    return 15 * ratio**-2.5 if ratio.size == 24 else sys.exit(0)
flexfem.register_formula("quits", quits, source="a test", valid=(0.05, 0.5))
"""


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("\nraise SystemExit(0)", 2, "own.py, line 2: SystemExit: 0, expected Python"),
        ("import sys\nsys.exit()", 2, "own.py, line 2: SystemExit, expected Python"),
        ("class Own(BaseException): ...\nraise Own('mine')", 2, "own.py, line 2: Own: mine, expected Python"),
        (QUITS, 1, "SystemExit: 0 (own.py, line 4)"),
    ],
)
def test_code_of_the_user_that_ends_the_program_does_not_pass_for_an_answer(tmp_path, text, code, said):
    (tmp_path / "own.py").write_text(text)
    ended = run("--with", tmp_path / "own.py", "stiffness", STAGE, "--formula", "quits", stdout=subprocess.PIPE)
    assert (ended.returncode, ended.stdout) == (code, b"")
    assert said in ended.stderr.decode() and ended.stderr.count(b"\n") == 1
