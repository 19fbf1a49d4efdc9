"""The arrows of the design go one way, and heavy libraries stay where they belong."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "flexfem").rglob("*.py"))
FORBIDDEN = {
    "analytic": (
        "flexfem.fem",
        "flexfem.verify",
        "flexfem.study",
        "flexfem.report",
        "gmsh",
        "skfem",
        "matplotlib",
        "meshio",
    ),
    "fem": (
        "flexfem.analytic",
        "flexfem.benchmark",
        "flexfem.peers",
        "flexfem.verify",
        "flexfem.study",
        "flexfem.report",
        "matplotlib",
    ),
    "layout": ("flexfem.analytic", "flexfem.fem", "flexfem.verify", "flexfem.report", "gmsh", "skfem", "matplotlib"),
    "verify": ("flexfem.study", "flexfem.report", "gmsh", "skfem", "matplotlib", "meshio"),
    "peers": ("flexfem.analytic", "flexfem.verify", "flexfem.report", "gmsh", "matplotlib", "meshio"),
    "benchmark": ("flexfem.verify", "flexfem.report", "gmsh", "matplotlib", "meshio"),
    "study": ("gmsh", "skfem", "matplotlib", "meshio"),
    "report": ("flexfem.fem", "flexfem.analytic", "gmsh", "skfem", "meshio"),
}


def imports(module: Path) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            found += [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [f"{node.module}.{name.name}" for name in node.names]
    return found


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_arrows_go_one_way(module):
    folder = module.relative_to(ROOT / "flexfem").parts[0]
    for name in imports(module):
        for forbidden in FORBIDDEN.get(folder, ()):
            assert name != forbidden and not name.startswith(forbidden + "."), f"{module} imports {name}"


def test_only_the_mesher_imports_gmsh():
    users = [module.name for module in MODULES if any(name.split(".")[0] == "gmsh" for name in imports(module))]
    assert users == ["mesher.py"]


@pytest.mark.parametrize("command", [["--help"], ["stiffness", "geometry/mobility6.toml", "--json"]])
def test_light_commands_load_no_heavy_library(command):
    script = (
        "import sys; sys.argv = ['flexfem', *sys.argv[1:]]\n"
        "from flexfem.cli import app\n"
        "try: app(standalone_mode=False)\n"
        "except SystemExit: pass\n"
        "heavy = {'gmsh', 'skfem', 'matplotlib', 'meshio'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", script, *command], cwd=ROOT, check=True, capture_output=True, timeout=60)
