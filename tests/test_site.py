"""The documentation names what is there: equations, functions, scripts of the gallery."""

from __future__ import annotations

import inspect
import re
import runpy
from importlib import import_module
from pathlib import Path

import pytest
from matplotlib import pyplot

import flexfem
import flexfem.plot

ROOT = Path(__file__).parent.parent
THEORY = (ROOT / "docs/theory.md").read_text()
API = (ROOT / "docs/api.md").read_text()
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_every_equation_of_the_paper_stands_in_the_theory_once_and_in_order():
    assert [int(number) for number in re.findall(r"\\tag\{(\d+)\}", THEORY)] == list(range(1, 34))


def test_what_the_theory_names_of_the_code_is_there():
    named = re.findall(r"`(flexfem(?:\.\w+){2,})`", THEORY)
    assert len(named) > 20
    for name in named:
        module, _, thing = name.rpartition(".")
        assert inspect.isroutine(getattr(import_module(module), thing)), name


def test_every_public_name_is_documented_once_and_says_what_it_is():
    listed = re.findall(r"auto(?:function|class):: flexfem\.([\w.]+)", API)
    names = {*flexfem.__all__} - {"__version__"}
    assert sorted(listed) == sorted({*names, "study.table", *(f"plot.{name}" for name in flexfem.plot.__all__)})
    for name in names:
        assert (getattr(flexfem, name).__doc__ or "").strip(), name


@pytest.mark.slow
@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_the_scripts_of_the_gallery_run_and_draw(script, monkeypatch):
    monkeypatch.chdir(ROOT / "examples")
    monkeypatch.setattr("sys.argv", [script.name])
    pyplot.close("all")
    runpy.run_path(script.name, run_name="__main__")
    assert pyplot.get_fignums()
    pyplot.close("all")


def test_the_gallery_has_scripts_that_say_what_they_ask():
    assert len(EXAMPLES) >= 6
    for script in EXAMPLES:
        title, rule, *_ = script.read_text().removeprefix('"""\n').splitlines()
        assert rule == "=" * len(title), script
