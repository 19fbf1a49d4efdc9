"""The documentation names what is there: equations, functions, scripts of the gallery."""

from __future__ import annotations

import inspect
import os
import re
import runpy
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from matplotlib import pyplot

import flexfem

ROOT = Path(__file__).parent.parent
THEORY = (ROOT / "docs/theory.md").read_text()
API = "".join(page.read_text() for page in (ROOT / "docs/api").glob("*.md"))
EXAMPLES = sorted(set((ROOT / "examples").glob("*.py")) - {ROOT / "examples/claims.py"})


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
    others = {
        name: f"{home}.{name}" for name, home in flexfem.OTHERS.items()
    }  # imported from their modules
    assert sorted(listed) == sorted({*names, *others.values(), "study.table"})
    assert "automodule:: flexfem.plot\n" in API
    for name in {*names, *others}:
        assert (getattr(flexfem, name).__doc__ or "").strip(), name


def blocks(page, language):
    """Code of a page in one language, block by block."""
    return re.findall(
        rf"^```{language}\n(.*?)^```$", (ROOT / page).read_text(), re.MULTILINE | re.DOTALL
    )


def shell(text, folder, **variables):
    """Exit code, and what is printed, of lines as a reader types them."""
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    where = {
        "cwd": folder,
        "env": {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), **variables},
    }
    run = subprocess.run(["bash", "-ec", text], capture_output=True, text=True, **where)
    return run.returncode, run.stdout + run.stderr


@pytest.mark.slow
def test_the_page_on_continuous_integration_does_what_it_says(request, monkeypatch):
    first, every = (text.splitlines() for text in blocks("docs/howto/lab-ci.md", "bash"))
    (workflow,) = blocks("docs/howto/lab-ci.md", "yaml")
    assert all(f"run: {line}\n" in workflow for line in every)
    command = request.getfixturevalue("flexfem")
    only = {"paper": lambda stage: flexfem.stiffness(stage, models="analytic")}
    monkeypatch.setattr("flexfem.paper.baseline.QUESTIONS", only)

    def codes(*lines):
        return [
            command(*shlex.split(line)[1:])[:2] for line in lines if line.startswith("flexfem ")
        ]

    found = codes("flexfem new mine.toml --case", first[0], *every)
    assert [code for code, _ in found] == [0, 0, 0, 0], found
    stage = Path("mine.toml")
    stage.write_text(stage.read_text().replace("thickness_mm = 10.0", "thickness_mm = 9.0"))
    code, said = codes(*every)[-1]
    assert code == 1 and "thickness_mm was 10.0, is 9.0" in said


@pytest.mark.slow
def test_the_page_on_clusters_runs_a_study_in_two_tasks(tmp_path):
    page = blocks("docs/howto/cluster.md", "bash")
    job, after = (
        text.replace("/shared/reports", "shared") for text in page[:2]
    )  # then those on a Dask cluster
    assert shell("flexfem new mine.toml --study", tmp_path)[0] == 0
    for task in "12":
        slurm = {"CPUS_PER_TASK": "1", "ARRAY_TASK_ID": task, "ARRAY_TASK_COUNT": "2"}
        code, said = shell(
            job, tmp_path, **{f"SLURM_{name}": value for name, value in slurm.items()}
        )
        assert code == 0, said
    exports = "\n".join(line for line in job.splitlines() if line.startswith("export"))
    code, said = shell(f"{exports}\n{after}", tmp_path)
    assert code == 0 and "256 ok" in said, said


@pytest.mark.slow
@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_the_scripts_of_the_gallery_run_and_draw(script, monkeypatch):
    monkeypatch.chdir(ROOT / "examples")
    monkeypatch.setattr("sys.argv", [script.name])
    pyplot.close("all")
    runpy.run_path(script.name, run_name="__main__")
    assert pyplot.get_fignums()
    pyplot.close("all")
