"""Files that docstrings, comments and pages name are there, and git keeps no ignored ones."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = sorted((ROOT / "flexfem").rglob("*.py"))
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), *ROOT.glob("*/*.toml"), *ROOT.glob("benchmarks/*.py"), *SOURCES]
FILE = re.compile(r"(?<![\w/{*.<~-])((?:[\w-]+/)+[\w-]+\.(?:py|md|toml|json|npz))\b")
MADE = ("reports/",)  # by commands
PLACEHOLDER = re.compile(r"QUESTION|NAME")


def test_every_file_that_is_named_exists() -> None:
    lost = set()
    for page in PAGES:
        for named in FILE.findall(page.read_text()):
            where = (ROOT, ROOT / "flexfem", page.parent)
            if (
                not named.startswith(MADE)
                and not PLACEHOLDER.search(named)
                and not any((place / named).exists() for place in where)
            ):
                lost.add(f"{page.relative_to(ROOT)}: {named}")
    assert lost == set()


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_nothing_that_is_ignored_is_kept_by_git() -> None:
    """A link `.venv` that is kept takes the place of the folder of that name wherever the commit is checked out."""
    listed = ["git", "ls-files", "--cached", "--ignored", "--exclude-standard"]
    assert subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout == ""
