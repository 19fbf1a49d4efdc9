"""The arrows of the design go one way, and heavy libraries stay where they belong."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

from .conftest import nodes_of, syntax_of

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "flexfem").rglob("*.py"))
LAYERS = (  # each takes from those before it, and from no other folder of its own layer
    ("arguments", "arrays", "lazy", "refused", "units", "sources"),
    ("files",),
    ("results",),
    ("mechanism",),
    ("hinges",),
    ("meshing",),
    ("analytic", "fem"),
    ("cad",),
    ("importing",),
    ("questions",),
    ("study",),
    ("design",),
    ("plot", "schemas"),
    ("studies", "workshop"),
    ("page", "baselines", "live"),
    ("paper",),  # uses all of the core; nothing of the core imports it
    ("terminal",),
    ("commands",),
    ("__main__",),
)
LAYER = {name: layer for layer, names in enumerate(LAYERS) for name in names}
HEAVY = {
    "skfem": ("fem",),
    "matplotlib": ("plot", "paper/figures"),
    "meshio": ("fem",),
    "ezdxf": ("cad", "importing"),
    "svgelements": ("importing",),
    "starlette": ("live",),
    "uvicorn": ("live",),
    "tomlkit": ("live",),
}  # who may import what


MODELS = ("flexfem.analytic.", "flexfem.fem.")
# tables of names that are read when they are needed, which alone may name modules of the paper
TABLES = {
    "__init__",
    "baselines",
    "mechanism/keys",
    "mechanism/loading",
    "page/report",
    "plot/__init__",
    "questions/verification",
    "schemas/formats",
}
OF_STAGE = {"Stage", "StageContent", "MechanismFile"}  # classes of which no other class asks


@cache
def imports(module: Path, types: bool = True) -> tuple[str, ...]:
    """Names that a module imports anywhere in it; without `types`, only those that are there when
    it runs.
    """
    found = list[str]()
    nodes = nodes_of(module)
    checking = [
        node
        for node in nodes
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
    ]
    unseen = (
        set()
        if types
        else {id(node) for branch in checking for part in branch.body for node in ast.walk(part)}
    )
    for node in nodes:
        if id(node) in unseen:
            continue
        if isinstance(node, ast.Import):
            found += [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [f"{node.module}.{name.name}" for name in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            found += [
                one.value.removeprefix(".") for one in node.args if isinstance(one, ast.Constant)
            ]
    return tuple(found)


def place_of(module: Path) -> Path:
    return module.relative_to(ROOT / "flexfem").with_suffix("")


def folder_of(module: Path) -> str:
    return place_of(module).parts[0]


def test_heavy_libraries_are_loaded_where_they_belong():
    for module, name in ((path, name) for path in MODULES for name in imports(path, types=False)):
        place = place_of(module)
        allowed = HEAVY.get(name.split(".")[0])
        within = {str(place), *map(str, place.parents)}
        assert allowed is None or within & set(allowed), f"{module} imports {name}"


def test_arrows_go_one_way():
    """Those of types, too; what the package itself offers is from all its folders."""
    for module, name in ((path, name) for path in MODULES for name in imports(path)):
        own = folder_of(module)
        parts = name.split(".")
        if parts[0] == "flexfem" and own != "__init__" and parts[1:] not in ([], ["__version__"]):
            below = LAYER[parts[1]] < LAYER[own] or (LAYER[own] == 0 and parts[1] != own)
            assert below or parts[1] == own, f"{module} imports {name}"


def test_modules_are_imported_by_a_name_that_can_be_read_here():
    """Else an import would go past the tests of this file; the names of those that may are in
    tables.
    """
    allowed = {
        f"flexfem/{name}.py"
        for name in (
            "__init__",
            "baselines",
            "mechanism/keys",
            "mechanism/loading",
            "paper/stage",
            "lazy",
            "schemas/formats",
            "sources",
        )
    }
    for module in MODULES:
        calls = [node for node in nodes_of(module) if isinstance(node, ast.Call)]
        by_name = [
            node
            for node in calls
            if re.search(r"\b(import_module|__import__)$", ast.unparse(node.func))
        ]
        plain = all(
            len(node.args) == 1 and isinstance(node.args[0], ast.Constant) for node in by_name
        )
        assert plain or str(module.relative_to(ROOT)) in allowed, module


def knows_the_paper(module: Path) -> set[str]:
    """Imports, names and texts of a module that are of the paper, and questions of a class."""
    found = {name for name in imports(module) if name.startswith("flexfem.paper")}
    for node in nodes_of(module):
        if isinstance(node, ast.Name) and node.id == "Stage":
            found.add(node.id)
        if isinstance(node, ast.Constant) and re.match(r"(flexfem\.)?paper[.:]", str(node.value)):
            found.add(str(node.value))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass"):
            asked = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)}
            found |= asked & OF_STAGE
    return found


def test_nothing_outside_its_room_knows_the_paper():
    core = [module for module in MODULES if folder_of(module) != "paper"]
    knowing = {str(place_of(module)) for module in core if knows_the_paper(module)}
    assert knowing <= TABLES


def test_no_file_leads_back_to_itself():
    """Nor by types alone."""
    below = [module for module in MODULES if folder_of(module) != "__init__"]
    names = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in below
    }
    ahead = {}
    for name, module in names.items():
        taken = imports(module)
        ahead[name] = {
            part for each in taken for part in (each, each.rpartition(".")[0]) if part in names
        } - {name}
    TopologicalSorter(ahead).prepare()  # raises CycleError, which names the files


@cache
def reached(name: str) -> frozenset[str]:
    """Modules of the package that a module, itself among them, runs or may come to run through
    others.
    """
    seen = set[str]()
    ahead = [name]
    while ahead:
        one = ahead.pop()
        path = ROOT / f"{one.replace('.', '/')}.py"
        if one not in seen and path.exists():
            seen.add(one)
            names = [each for each in imports(path, types=False) if each.startswith("flexfem.")]
            ahead += [*names, *(each.rpartition(".")[0] for each in names)]
    return frozenset(seen)


REPORTS = [
    f"flexfem.{folder.replace('/', '.')}.{path.stem}"
    for folder in ("plot", "paper/figures")
    for path in MODULES
    if path.parent == ROOT / "flexfem" / folder
]


def test_what_is_drawn_was_answered_before():
    answering = {"flexfem.study.answer", "flexfem.paper.batch", "flexfem.paper.study"}
    assert [report for report in REPORTS if reached(report) & answering] == []


def test_from_a_module_that_may_solve_reports_take_records_and_no_function():
    """Results and settings are described beside what computes them; knowing them is no way to
    compute.
    """
    for report in REPORTS:
        for name in imports(ROOT / f"{report.replace('.', '/')}.py", types=False):
            module, _, thing = name.rpartition(".")
            if not name.startswith(("flexfem.plot.", "flexfem.paper.figures.")) and any(
                each.startswith(MODELS) for each in reached(module)
            ):
                assert not inspect.isroutine(getattr(import_module(module), thing)), (
                    f"{report} takes {name}"
                )


def test_reach_goes_through_other_modules():
    assert "flexfem.fem.response" in reached("flexfem.commands.cli")
    assert "flexfem.study.answer" in reached("flexfem.study.run")


def test_only_the_session_imports_gmsh():
    users = [
        module.name
        for module in MODULES
        if any(name.split(".")[0] == "gmsh" for name in imports(module))
    ]
    assert users == ["session.py"]


HEAVIEST = {"ezdxf", "gmsh", "matplotlib", "meshio", "pyarrow"}


@pytest.mark.parametrize(
    ("command", "heavy"),
    [
        (["--help"], HEAVIEST | {"numpy", "pydantic", "rich", "scipy", "shapely", "skfem"}),
        (["stiffness", "geometry/mobility6.toml", "--models", "analytic", "--json"], HEAVIEST),
    ],
)
def test_light_commands_load_no_heavy_library(command, heavy):
    script = (
        "import sys; sys.argv = ['flexfem', *sys.argv[1:]]\n"
        "from flexfem.commands.cli import app\n"
        "try: app(standalone_mode=False)\n"
        "except SystemExit: pass\n"
        f"heavy = {heavy!r} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run(
        [sys.executable, "-c", script, *command],
        cwd=ROOT,
        check=True,
        capture_output=True,
        timeout=60,
    )


def test_no_module_takes_the_place_of_a_name_that_its_package_offers():
    """A module that is imported becomes an attribute of its package, and would hide a function of
    that name.
    """
    for package in (path.parent for path in MODULES if path.name == "__init__.py"):
        loaded = import_module(".".join(package.relative_to(ROOT).parts))
        defined = {
            name
            for name, thing in vars(loaded).items()
            if inspect.isroutine(thing) or inspect.isclass(thing)
        }
        inside = {path.stem for path in package.iterdir() if path.suffix == ".py" or path.is_dir()}
        assert not inside & (defined | set(getattr(loaded, "__all__", ()))), package


def test_no_class_has_the_name_of_another_and_no_private_name_is_taken():
    """A name for one thing: neither two classes of one name nor, from another file, what begins
    with an underline.
    """
    where: dict[str, list[str]] = {}
    for module in MODULES:
        for node in syntax_of(module).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                where.setdefault(node.name, []).append(str(module.relative_to(ROOT)))
        taken = [name.rpartition(".")[2] for name in imports(module) if name.startswith("flexfem.")]
        assert not [name for name in taken if re.match("_(?!_)", name)], module
    assert {name: files for name, files in where.items() if len(files) > 1} == {}
