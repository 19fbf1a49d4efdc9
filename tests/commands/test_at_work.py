"""What takes a while says so: on a terminal something moves, elsewhere there is a line now and then."""

from __future__ import annotations

import io
import time
from pathlib import Path

import pytest

from flexfem import terminal as at_work
from flexfem.refused import ComputationFailed
from flexfem.terminal import working

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_every_step_is_a_line_where_there_is_no_terminal(capsys):
    with working("refining", 2) as say:
        say("12 triangles")
        say("40 triangles")
    assert capsys.readouterr().err == "refining 1/2: 12 triangles\nrefining 2/2: 40 triangles\n"


def test_long_work_without_steps_says_how_long_and_short_work_nothing(capsys, monkeypatch):
    monkeypatch.setattr(at_work, "EVERY", 0.05)
    with working("meshing"):
        pass
    assert capsys.readouterr().err == ""
    with working("meshing"):
        time.sleep(0.3)
    lines = capsys.readouterr().err.splitlines()
    assert 2 <= len(lines) <= 6 and set(lines) == {"meshing: 0 s"}
    time.sleep(0.12)
    assert capsys.readouterr().err == ""


def test_work_that_fails_ends_its_lines_and_keeps_its_error(capsys, monkeypatch):
    monkeypatch.setattr(at_work, "EVERY", 0.02)
    with pytest.raises(ComputationFailed, match="no mesh"), working("meshing"):
        raise ComputationFailed("no mesh")
    time.sleep(0.06)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("steps", [0, 3])
def test_on_a_terminal_there_is_a_bar_with_the_step_as_plain_text(monkeypatch, steps):
    stream = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", stream)
    with working("workspace", steps) as say:
        say("along [red]x[/red]")
        time.sleep(0.25)
    shown = stream.getvalue()
    assert "workspace: along [red]x[/red]" in shown and "0:00:0" in shown
    assert ("\N{BOX DRAWINGS HEAVY HORIZONTAL}" in shown) == bool(steps)
    assert shown.endswith(("\x1b[2K", "\x1b[?25h\r\x1b[1A\x1b[2K"))  # gone, and the cursor is back
