"""What all tests share: the shipped stages and cases, and variants of them."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from flexfem.commands import cli

ROOT = Path(__file__).parent.parent
settings.register_profile("flexfem", deadline=None, derandomize=True)  # the same examples on every machine
settings.load_profile("flexfem")


class Project:
    """A copy of the shipped stages, cases and baselines that a test may spoil."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in ("geometry", "cases", "tests/baselines"):
            shutil.copytree(ROOT / part, folder / part)

    def path(self, name: str) -> Path:
        return self.folder / name

    def edit(self, name: str, *edits: tuple[str, str]) -> Path:
        """Replace pieces of a file's text, each of which must be there."""
        text = self.path(name).read_text()
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new)
        self.path(name).write_text(text)
        return self.path(name)


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path / "project")


@pytest.fixture
def flexfem(monkeypatch: Any, capsys: Any, tmp_path: Path) -> Callable[..., tuple[Any, str, str]]:
    """Run a command in an empty folder; returns exit code, standard output and standard error."""
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)

    def run(*arguments: object) -> tuple[Any, str, str]:
        monkeypatch.setattr(sys, "argv", ["flexfem", *map(str, arguments)])
        try:
            cli.main()
            code: Any = 0
        except SystemExit as stop:
            code = stop.code or 0
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run
