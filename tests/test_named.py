"""What docstrings, comments and pages name is there: files by their path, and names of the code in backticks."""

from __future__ import annotations

import ast
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from .conftest import nodes_of

ROOT = Path(__file__).parent.parent
SOURCES = sorted((ROOT / "flexfem").rglob("*.py"))
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("*/*.md"), *ROOT.glob("*/*.toml"), *ROOT.glob("benchmarks/*.py"), *SOURCES]
FILE = re.compile(r"(?<![\w/{*.<~-])((?:[\w-]+/)+[\w-]+\.(?:py|md|toml|json|npz))\b")
NAME = re.compile(r"`([A-Za-z_]\w*(?:\.\w+)*)`")
MADE = ("reports/",)  # by commands
LIBRARIES = ("pandas", "pyarrow", "numpy", "scipy", "skfem", "gmsh", "matplotlib")
NAMING = frozenset({"name", "id", "attr", "arg", "asname"})  # fields of nodes
OF_FILES = {"from", "b", "i", "T_c", "X", "Y", "sr", "backticks", "kxy_"}  # letters of equations; a key of studies


def test_every_file_that_is_named_exists() -> None:
    lost = set()
    for page in PAGES:
        for named in FILE.findall(page.read_text()):
            where = (ROOT, ROOT / "flexfem", page.parent)
            if not named.startswith(MADE) and not any((place / named).exists() for place in where):
                lost.add(f"{page.relative_to(ROOT)}: {named}")
    assert lost == set()


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_nothing_that_is_ignored_is_kept_by_git() -> None:
    """A link `.venv` that is kept takes the place of the folder of that name wherever the commit is checked out."""
    listed = ["git", "ls-files", "--cached", "--ignored", "--exclude-standard"]
    assert subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout == ""


@cache
def names_of(path: Path) -> frozenset[str]:
    """What a source names: identifiers, and words of its texts but docstrings."""
    found = {path.stem}
    said = {id(node.value) for node in nodes_of(path) if isinstance(node, ast.Expr)}
    for node in nodes_of(path):
        for field in NAMING.intersection(node._fields):
            found.update((getattr(node, field) or "").split("."))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            found.update(re.findall(r"\w+", node.value))
    return frozenset(found)


def test_every_name_in_backticks_is_one_of_the_code() -> None:
    """After the name of a module, one of that module; a private name, one of the very file."""
    everything = frozenset().union(*map(names_of, SOURCES)) | OF_FILES
    modules: dict[str, frozenset[str]] = {}
    for path in SOURCES:  # several folders have a module of one name
        modules[path.stem] = modules.get(path.stem, frozenset()) | names_of(path)
    lost = set()
    for path in SOURCES:
        for named in NAME.findall(path.read_text()):
            *before, last = named.split(".")
            if named.startswith(LIBRARIES) or (ROOT / "flexfem" / f"{named.replace('.', '/')}.py").exists():
                continue
            own = last.startswith("_") and not last.startswith("__") and not before
            where = names_of(path) if own else modules.get(before[-1], everything) if before else everything
            if last not in where | {"py", "json"} or not set(before) <= everything:
                lost.add(f"{path.relative_to(ROOT)}: {named}")
    assert lost == set()
