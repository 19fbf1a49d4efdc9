"""How the program begins and is stopped: its help, completion in shells, and Ctrl-C at any time."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flexfem import terminal as streams
from flexfem.cli import GROUPS

ROOT = Path(__file__).parents[2]
STAGE = str(ROOT / "geometry/mobility6.toml")


def test_help_lists_every_command_once_under_what_people_want(flexfem):
    code, out, _ = flexfem("--help")
    listed = out.partition("\nStart:\n")[2]
    assert code == 0 and "Other commands" not in out
    sections = dict(part.split(":\n", 1) for part in f"Start:\n{listed}".split("\n\n"))
    assert set(sections) <= set(GROUPS)
    for title, section in sections.items():
        names = [line.split()[0] for line in section.splitlines() if line[:2] == "  " and line[2] != " "]
        assert names == [name for name in GROUPS[title] if name in names] != [], title
    assert sections["Start"].split()[0] == "new" and "  identify " in sections["Measure"]
    assert "..." not in listed  # whole sentences


def test_completion_names_commands_options_and_commands_of_studies(flexfem, monkeypatch):
    monkeypatch.setenv("_FLEXFEM_COMPLETE", "complete_bash")
    for words, expected in (
        ("flexfem st", ["stiffness", "study"]),
        ("flexfem study c", ["clean", "collect"]),
        ("flexfem solve --lay", ["--layers"]),
        ("flexfem solve geo", []),  # the shell's own: files
    ):
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(words.count(" ")))
        code, out, err = flexfem()
        assert (code, sorted(out.split()), err) == (0, expected, "")


def test_linear_algebra_has_one_thread_unless_it_is_given_others(flexfem, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert flexfem("--version")[0] == 0
    assert (os.environ["OPENBLAS_NUM_THREADS"], os.environ["OMP_NUM_THREADS"]) == ("1", "3")


@pytest.mark.parametrize("option", ["--show-completion", "--install-completion"])
def test_completion_of_a_named_shell_is_refused_and_nothing_is_installed(option, flexfem, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    code, out, err = flexfem(option, "nosh")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"flexfem: {option} nosh: expected nothing behind it")
    assert not (tmp_path / "home").exists()


SHELLS = {
    "bash": 'source "$1"; COMP_WORDS=(flexfem st); COMP_CWORD=1; _flexfem_completion flexfem; echo "${COMPREPLY[@]}"',
    "zsh": 'compdef() {}; _arguments() { echo "$@" }; source "$1"; words=(flexfem st); CURRENT=2; _flexfem_completion',
    "fish": "source $argv[1]; complete -C 'flexfem st'",
}


@pytest.mark.slow
@pytest.mark.parametrize("shell", SHELLS)
def test_shells_complete_by_the_script_that_is_shown(shell, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    program = tmp_path / "flexfem"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m flexfem "$@"\n')
    program.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "HOME": str(tmp_path)}
    environment["PYTHONPATH"] = str(ROOT)

    def run(*command: str) -> str:
        done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=tmp_path, timeout=60)
        assert (done.returncode, done.stderr) == (0, ""), done
        return done.stdout

    script = tmp_path / "script"
    script.write_text(run(shell, "-c", "flexfem --show-completion; true"))  # which shell asks is found out
    call = [shell, "-c", SHELLS[shell], *([str(script)] if shell == "fish" else ["-", str(script)])]
    found = run(*call)
    assert "stiffness" in found and "study" in found and "verify" not in found


def test_a_stop_waits_for_the_import_that_is_going_on(tmp_path, monkeypatch):
    """A library that is broken off prints what it likes, or is there in part."""
    text = "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(0.05)\nwhole = True\n"
    (tmp_path / "slow_library.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(streams.Stopped) as stop, streams.stoppable() as raised:
        import slow_library

        assert slow_library and raised != []
        time.sleep(5.0)  # ended by the stop
    assert raised == [stop.value] and stop.value.code == 130 and sys.modules.pop("slow_library").whole
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL if number != signal.SIGINT else signal.default_int_handler)


def test_no_alarm_is_left_of_a_stop_during_an_import_that_ends_the_command(tmp_path, monkeypatch):
    (tmp_path / "last_library.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGTERM)\n")
    monkeypatch.syspath_prepend(tmp_path)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        with streams.stoppable() as raised:
            import last_library
        assert last_library and len(raised) == 1
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    finally:
        sys.modules.pop("last_library", None)
        for number, handler in before.items():
            signal.signal(number, handler)


def test_what_a_library_makes_of_a_stop_is_not_what_is_said(flexfem, monkeypatch):
    def load(*_):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1)
        except KeyboardInterrupt:
            raise ImportError("cannot load half of it") from None

    monkeypatch.setattr("flexfem.reports.stage.check", load)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        assert flexfem("check", STAGE) == (143, "", "flexfem: stopped\n")
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


RUN = """
import os, sys
def begun(event, of):
    if event == "import" and of[0] == "flexfem.commands.cli":
        os.write(1, b"x")
sys.addaudithook(begun)
from flexfem.commands.start import main
main()
"""
TIMES = 40


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "seconds"), [(["solve", STAGE, "--three-dimensional"], 3.0), (["view", STAGE, "-o", "out"], 2.0)]
)
def test_ctrl_c_ends_a_command_at_any_time_in_one_line(tmp_path, command, seconds):
    """Also while it loads the command line, numpy, skfem, gmsh or matplotlib, and in the processes that it started."""
    ended = []
    for wait in (seconds * k / TIMES for k in range(TIMES)):
        process = subprocess.Popen(
            [sys.executable, "-c", RUN, *command],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            start_new_session=True,
        )
        assert process.stdout.read(1) == "x"
        time.sleep(wait)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: children too
        _, err = process.communicate(timeout=30)
        ended.append((process.returncode, err))
    ended = [each for each in ended if each not in [(0, ""), (-signal.SIGINT, "")]]  # done, and Python closing down
    assert set(ended) == {(130, "flexfem: stopped\n")} and len(ended) > TIMES / 4
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]  # no file in part
