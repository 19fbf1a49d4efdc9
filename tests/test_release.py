"""What is given away: wheel and source distribution, citation, the workflow of continuous
integration, the image.
"""

from __future__ import annotations

import os
import re
import shutil
import site
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

import flexfem

ROOT = Path(__file__).parents[1]
DATA = {
    "hinge_chart.json",
    "hinge_chart_high.json",
    "thickness_chart.json",
    "materials.toml",
    "stacks.toml",
} | {f"new-{kind}.toml" for kind in ("stage", "case", "study")}
EPOCH = "1577836800"  # 2020-01-01, as the time of all that is packed


class Built(NamedTuple):
    """Where the distributions are, and the tree that they are of."""

    source: Path
    sdist: Path
    wheel: Path


def run(*command: object, cwd: Path, **environment: str) -> str:
    where = {"cwd": cwd, "env": {**os.environ, "PYTHONPATH": "", **environment}}
    done = subprocess.run(
        [*map(str, command)], **where, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def kept() -> set[str]:
    """Files that git keeps; of a source distribution, where it keeps none, all there are."""
    if (ROOT / ".git").exists():
        names = run(
            "git", "ls-files", "--cached", "--others", "--exclude-standard", cwd=ROOT
        ).splitlines()
        return {name for name in names if (ROOT / name).is_file()}
    return {path.relative_to(ROOT).as_posix() for path in ROOT.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """The wheel from the source distribution, and that from a copy of what git keeps."""
    folder = tmp_path_factory.mktemp("release")
    for name in kept():
        (folder / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / "tree" / name)
    run(
        sys.executable,
        "-m",
        "build",
        "--outdir",
        folder,
        folder / "tree",
        cwd=folder,
        SOURCE_DATE_EPOCH=EPOCH,
    )
    ((sdist,), (wheel,)) = (list(folder.glob(pattern)) for pattern in ("*.tar.gz", "*.whl"))
    with tarfile.open(sdist) as packed:
        packed.extractall(folder, filter="data")
    return Built(folder / sdist.name.removesuffix(".tar.gz"), sdist, wheel)


@pytest.mark.slow
def test_a_source_distribution_holds_what_git_keeps(built):
    inside = {
        path.relative_to(built.source).as_posix()
        for path in built.source.rglob("*")
        if path.is_file()
    }
    added = {
        name
        for name in inside
        if re.match(r"PKG-INFO$|setup\.cfg$|flexfem\.egg-info/|MANIFEST\.in$", name)
    }
    assert inside - added == kept() - {"MANIFEST.in"}


@pytest.mark.slow
def test_a_wheel_carries_the_package_and_its_data_and_nothing_else(built):
    with zipfile.ZipFile(built.wheel) as packed:
        names = set(packed.namelist())
        own = [name for name in kept() if name.startswith("flexfem/")]
        assert [name for name in own if packed.read(name) != (ROOT / name).read_bytes()] == []
    assert {f"flexfem/data/{name}" for name in DATA} | {"flexfem/py.typed"} <= names
    assert not [name for name in names if not re.match(r"flexfem[-/]", name)]


COMMANDS = (
    ("new mine.toml --case --study", "written: mine.toml"),
    ("check mine.toml", "my stage"),
    ("view mine.toml -o out", "out/mine-drawing.png"),
    ("export mine.toml -o part.dxf", "part.dxf"),
    ("export mine.toml -o part.step", "29733.138"),
    ("stiffness mine.toml --models analytic --formula calibrated --links", "N/mm"),
    ("drift mine.toml --models analytic", "change of temperature"),
    ("verify mine-case.toml -o out", "12.5376"),
    ("plot out/mine-case.json -o out", "out/mine-case.png"),
    ("study run mine-study.toml -o out", "done 256: 256 ok"),
    ("report mine.toml -o report.html", "report.html"),
)


@pytest.mark.slow
def test_an_installed_wheel_runs_outside_the_repository(built, tmp_path):
    """In an environment of its own, with the libraries of this one; the program is what pip
    installed.
    """
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv", cwd=tmp_path)
    (python,) = (tmp_path / "venv").glob("*/python")
    packages = run(
        python, "-c", "import site; print(site.getsitepackages()[0])", cwd=tmp_path
    ).strip()
    quiet = ("--quiet", "--disable-pip-version-check", "--no-deps", "--no-index")
    run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        *quiet,
        built.wheel,
        cwd=tmp_path,
    )
    (Path(packages) / "libraries.pth").write_text("\n".join(site.getsitepackages()))
    (tmp_path / "empty").mkdir()
    program = python.parent / "flexfem"
    listed = run(program, "--help", cwd=tmp_path)
    for arguments, expected in COMMANDS:
        if f"  {arguments.split()[0]} " in listed:
            assert expected in run(program, *arguments.split(), cwd=tmp_path / "empty"), arguments
    where = run(
        python,
        "-c",
        "import flexfem; print(flexfem.__file__, flexfem.__version__)",
        cwd=tmp_path / "empty",
    )
    assert where.startswith(packages) and where.split()[1] == flexfem.__version__


def test_the_version_stands_in_one_place():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"] and "version" not in project["project"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "flexfem.__version__"}
    assert "\nversion:" not in (ROOT / "CITATION.cff").read_text()
    assert f"\n## {flexfem.__version__}, " in (ROOT / "CHANGELOG.md").read_text()


def test_the_image_and_the_workflow_install_what_gmsh_needs():
    """The image by itself, the workflow through `.ci/run`: every Debian package that is named when
    one is missing.
    """
    from flexfem.meshing.session import LIBRARIES

    for name in ("Dockerfile", ".ci/run"):
        assert set(LIBRARIES.values()) <= set((ROOT / name).read_text().split()), name
    assert "run: .ci/run" in (ROOT / ".github/workflows/ci.yml").read_text()
    image = (ROOT / "Dockerfile").read_text()
    assert 'CMD ["make", "reproduce-figures"]' in image
    assert (
        tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
        == ">=3.11"
    )
    assert "FROM python:3.11-slim-bookworm" in image
