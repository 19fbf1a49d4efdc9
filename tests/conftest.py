"""What all tests share: the shipped stages and cases, generic ones, and variants of them."""

from __future__ import annotations

import ast
import copy
import gc
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

# Read when numpy is loaded: matrices are small here, and threads that wait for work take the
# processor from others.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import pytest
from hypothesis import settings
from typer.main import get_command

from flexfem.commands import cli
from flexfem.paper.stage import Stage

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / "benchmarks"))  # tests use some of these programs
gc.set_threshold(
    50_000
)  # by default all that libraries loaded is looked through again and again: a tenth of the time
settings.register_profile(
    "flexfem", deadline=None, derandomize=True
)  # the same examples on every machine
settings.load_profile("flexfem")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell began the tests in the background
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # what they start is to hear of Ctrl-C all the same


GENERIC: dict[str, Any] = {
    "name": "generic stage",
    "thickness_mm": 9.7,
    "material": {
        "name": "generic metal",
        "youngs_modulus_gpa": 68.3,
        "poissons_ratio": 0.29,
        "density_kg_m3": 2739.0,
        "yield_strength_mpa": 411.0,
    },
    "chain": {
        "link_lengths_mm": [31.0, 33.5, 25.0],
        "joint_angles_deg": [175.0, -85.0, 92.0],
        "link_width_mm": 8.9,
    },
    "hinges": {
        "base": {"radius_mm": 3.9, "neck_mm": 0.53, "prismatic": True},
        "elbow": {"radius_mm": 1.6, "neck_mm": 0.47},
        "platform": {"radius_mm": 1.4, "neck_mm": 0.61},
    },
    "platform": {"radius_mm": 16.3, "hub_radius_mm": 7.7},
}

UNLIKE: list[dict[str, Any]] = [
    {"chain": 1, "hinge": "base", "radius_mm": 2.3, "axis_deg": 183.0},
    {"chain": 2, "hinge": "elbow", "neck_mm": 0.83},
    {"chain": 3, "hinge": "platform", "radius_mm": 1.9, "neck_mm": 0.41, "axis_deg": 101.0},
]

StageMaker = Callable[..., Stage]


def with_changes(changes: Mapping[str, Any] = MappingProxyType({})) -> Stage:
    """The generic stage with the values of some key paths, such as `hinges.base.neck_mm`, replaced."""
    content = copy.deepcopy(GENERIC)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = content
        for name in tables:
            table = table[name]
        table[key] = value
    return Stage.model_validate(content)


@pytest.fixture(scope="session")
def make_stage() -> StageMaker:
    """`with_changes`."""
    return with_changes


@cache
def syntax_of(path: Path) -> ast.Module:
    """The tree of a source, parsed once for all tests that read sources; none of them may change
    it.
    """
    return ast.parse(path.read_text())


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of that tree."""
    return tuple(ast.walk(syntax_of(path)))


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


def stored(path: Path) -> Any:
    """What a stored record says, its digests left out."""
    return {
        key: value
        for key, value in json.loads(path.read_text()).items()
        if key not in ("digest", "fields")
    }


@pytest.fixture
def unrendered(monkeypatch: Any) -> None:
    """Figures are drawn, but their files hold the name of their form: pixels and pages take longest
    by far.
    """
    monkeypatch.setattr("flexfem.plot.write.rendered", lambda figure, form: form.encode())


COMMAND_OF = cache(get_command)  # 30 ms each time, of the 50 ms that many commands take


@pytest.fixture
def flexfem(monkeypatch: Any, capsys: Any, tmp_path: Path) -> Callable[..., tuple[Any, str, str]]:
    """Run a command in an empty folder; returns exit code, standard output and standard error."""
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr("typer.main.get_command", COMMAND_OF)

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


@pytest.fixture
def browser(request):
    """Chromium without a window, whose console is kept."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium")
    program = shutil.which("chromium")
    driver = shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("needs chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for switch in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    request.addfinalizer(opened.quit)
    return opened
