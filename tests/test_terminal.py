"""Streams, signals, processes and progress of commands: what is printed, how a command is stopped,
what it runs.
"""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import nullcontext

import pytest

from flexfem import terminal
from flexfem.meshing.process import Limit
from flexfem.refused import ComputationFailed
from flexfem.sources import child_command
from flexfem.terminal import Plain, showing_progress

from .conftest import ROOT

STAGE = str(ROOT / "geometry/mobility6.toml")
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run(*arguments, **streams):
    command = [sys.executable, "-m", "flexfem", *map(str, arguments)]
    return subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE, **streams
    )


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        (
            "MPLBACKEND",
            "bogus",
            "MPLBACKEND = 'bogus', expected a backend of matplotlib, or no such variable",
        ),
        (
            "PYTHONOPTIMIZE",
            "2",
            "PYTHONOPTIMIZE or python -OO: the commands are made from docstrings, which it removes",
        ),
        (
            "FLEXFEM_WITH",
            "x",
            "FLEXFEM_WITH = 'x', expected no such variable, which flexfem --with FILE sets itself",
        ),
        (
            "SOURCE_DATE_EPOCH",
            "x",
            "SOURCE_DATE_EPOCH = 'x', expected seconds since 1970, or no such variable",
        ),
    ],
)
def test_what_the_environment_sets_wrongly_is_named_in_one_line(name, value, said, monkeypatch):
    monkeypatch.setenv(name, value)
    done = run("check", STAGE)
    assert (done.returncode, done.stderr.decode()) == (2, f"flexfem: {said}\n")


@pytest.fixture
def handlers():
    """Put back what signals do."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_completion_names_commands_options_and_commands_of_studies(flexfem, monkeypatch):
    monkeypatch.setenv("_FLEXFEM_COMPLETE", "complete_bash")
    for words, expected in (
        ("flexfem st", ["stiffness", "study"]),
        ("flexfem study c", ["clean", "collect"]),
        ("flexfem modes --so", ["--solid"]),
        ("flexfem modes geo", []),  # files, which the shell completes itself
    ):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
        code, out, err = flexfem()
        assert (code, sorted(out.split()), err) == (0, expected, "")


def test_linear_algebra_has_one_thread_unless_the_environment_says_otherwise(flexfem, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert flexfem("--version")[0] == 0
    assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["OMP_NUM_THREADS"]) == ("1", "3")


def test_children_import_nothing_from_the_current_folder(tmp_path, monkeypatch):
    for name in ("numpy", "signal", "json", "flexfem"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    child = subprocess.run(child_command("flexfem.meshing.serve"), input=b".", capture_output=True)
    assert child.returncode == 1 and b"pickle" in child.stderr  # of the job, after all imports


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
        (
            "class Own(BaseException): ...\nraise Own('mine')",
            2,
            "own.py, line 2: Own: mine, expected Python",
        ),
        (QUITS, 1, "SystemExit: 0 (own.py, line 4)"),
    ],
)
def test_code_of_the_user_that_ends_the_program_does_not_pass_for_a_result(
    tmp_path, text, code, said
):
    (tmp_path / "own.py").write_text(text)
    command = (
        "--with",
        tmp_path / "own.py",
        "stiffness",
        STAGE,
        "--models",
        "analytic",
        "--formula",
        "quits",
    )
    ended = run(*command, stdout=subprocess.PIPE)
    assert (ended.returncode, ended.stdout) == (code, b"")
    assert said in ended.stderr.decode() and ended.stderr.count(b"\n") == 1


def test_progress_to_a_full_stream_ends_nothing_results_to_one_do_and_control_characters_are_text():
    for silent in (True, False):
        with (
            open("/dev/full", "w") as full,
            nullcontext() if silent else pytest.raises(OSError, match="No space"),
        ):
            Plain(full, silent).write("x" * 10000)
            Plain(full, silent).flush()
    stream = io.StringIO()
    Plain(stream, True).write("a\x1b[31m\tb\x9b\r\u202e\n")
    assert stream.getvalue() == "a\\x1b[31m\tb\\x9b\\r\\u202e\n"


@pytest.mark.parametrize("arguments", [["check", STAGE], ["check", STAGE, "--json"], ["--help"]])
def test_a_reader_that_has_seen_enough_is_no_failed_check(arguments):
    """128 and the number of SIGPIPE, 13, whether Rich, typer or flexfem itself writes."""
    reader, writer = os.pipe()
    os.close(reader)
    ended = run(*arguments, stdout=writer)
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (141, b"")


def test_a_stop_adds_a_second_at_most(monkeypatch):
    now = iter([100.0, 100.25, 175.5])
    monkeypatch.setattr("flexfem.meshing.process.time.monotonic", lambda: next(now))
    limit = Limit(9.0)
    limit.start()
    limit.update()
    assert limit.left == 8.75
    limit.update()
    assert limit.left == 7.75


def test_a_stop_waits_for_the_import_that_is_going_on(tmp_path, monkeypatch, handlers):
    """A library that is broken off prints what it likes, or is there in part."""
    text = (
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(0.05)\nwhole = "
        "True\n"
    )
    (tmp_path / "slow_library.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(terminal.Stopped) as stop, terminal.stoppable() as raised:
        import slow_library

        assert slow_library and raised != []
        time.sleep(5.0)  # ended by the stop
    assert (
        raised == [stop.value] and stop.value.code == 130 and sys.modules.pop("slow_library").whole
    )


def test_a_stop_where_nothing_can_be_raised_comes_later(capsys, handlers):
    class Dropped:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    with pytest.raises(terminal.Stopped), terminal.stoppable():
        Dropped()
        time.sleep(2.0)  # ended by the stop
    assert capsys.readouterr().err == ""


def test_no_alarm_is_left_of_a_stop_during_an_import_that_ends_the_command(
    tmp_path, monkeypatch, handlers
):
    (tmp_path / "last_library.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGTERM)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with terminal.stoppable() as raised:
        import last_library
    assert sys.modules.pop("last_library") is last_library and len(raised) == 1
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_what_a_library_makes_of_a_stop_is_not_what_is_said(flexfem, monkeypatch, handlers):
    def load(*_):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1)
        except KeyboardInterrupt:
            raise ImportError("cannot load half of it") from None

    monkeypatch.setattr("flexfem.importing.drawings.load", load)
    assert flexfem("check", STAGE) == (143, "", "flexfem: stopped\n")


RUN = """
import os, sys
def begun(event, of):
    if event == "import" and of[0] == "flexfem.commands.cli":
        os.write(1, b"x")
sys.addaudithook(begun)
from flexfem.commands.start import main
main()
"""
TIMES = 12


@pytest.mark.slow
@pytest.mark.parametrize("command", [("modes", STAGE, "--solid"), ("view", STAGE, "-o", ".")])
def test_ctrl_c_ends_a_command_at_any_time_in_one_line(tmp_path, command):
    """Also while it loads numpy, skfem, gmsh or matplotlib, and in the processes that it started."""
    ended = []
    for wait in (3.0 * k / TIMES for k in range(TIMES)):
        where = {
            "cwd": tmp_path,
            "env": {**os.environ, "PYTHONPATH": str(ROOT)},
            "start_new_session": True,
        }
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen([sys.executable, "-c", RUN, *command], **streams, **where)
        assert process.stdout.read(1) == "x"
        time.sleep(wait)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: children too
        _, err = process.communicate(timeout=30)
        ended.append(
            (process.returncode, re.sub(r"modes: \d of 5 meshes\n", "", err))
        )  # progress until then
    ended = [
        each for each in ended if each not in [(0, ""), (-signal.SIGINT, "")]
    ]  # done, and Python closing down
    assert set(ended) == {(130, "flexfem: stopped\n")} and len(ended) > TIMES / 4
    assert not [
        path for path in tmp_path.rglob("*") if path.name.startswith(".")
    ]  # no file in part


def test_every_step_is_a_line_where_there_is_no_terminal(capsys):
    with showing_progress("refining") as say:
        say("12 triangles")
        say("40 triangles")
    assert capsys.readouterr().err == "refining: 12 triangles\nrefining: 40 triangles\n"


def test_work_that_takes_long_says_how_long_and_nothing_after_it_failed(capsys, monkeypatch):
    monkeypatch.setattr(terminal, "EVERY", 0.05)
    with pytest.raises(ComputationFailed, match="no mesh"), showing_progress("meshing"):
        time.sleep(0.3)
        raise ComputationFailed("no mesh")
    lines = capsys.readouterr().err.splitlines()
    assert 2 <= len(lines) <= 6 and set(lines) == {"meshing: 0 s"}
    time.sleep(0.12)
    assert capsys.readouterr().err == ""
