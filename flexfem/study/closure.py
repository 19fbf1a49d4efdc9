"""What a module may come to run, found from the imports in its source."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ABOVE = ("api.py", "commands/", "plot/")  # for people; a stage that can draw itself names them, no answer runs them
NAME = re.compile(r"flexfem(\.\w+)+")  # of a module as a text, by which child processes are begun


def closure(roots: tuple[str, ...], package: Path) -> dict[str, ast.Module]:
    """Syntax trees of modules and of all that they import, inside functions too, without comments and docstrings.

    Keys, and `roots`, are paths below the package, such as "study/answer.py". The package's own `__init__.py` offers
    everything to others and is left out; what is imported for annotations alone is not run, nor is what is `ABOVE`.
    """
    found, ahead = dict[str, ast.Module](), list(roots)
    while ahead:
        path = ahead.pop()
        if path not in found and not path.startswith(ABOVE) and (package / path).is_file():
            found[path] = _bare(ast.parse((package / path).read_bytes()))
            ahead += [place for name in _named(found[path]) for place in _places(name)]
    return dict(sorted(found.items()))


def _bare(tree: ast.Module) -> ast.Module:
    """The tree without statements that are texts, and without what is imported for annotations alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = []
        if isinstance(body := getattr(node, "body", None), list):
            body[:] = [each for each in body if not _is_text(each)]
    return tree


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _named(tree: ast.Module) -> Iterator[str]:
    """Names of modules, and of what may be modules, that a source imports or names in a text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and NAME.fullmatch(node.value):
            yield node.value


def _places(name: str) -> Iterator[str]:
    """Paths that a name, or the packages it is in, may have below the package."""
    first, *parts = name.split(".")
    if first == "flexfem":
        for end in range(1, len(parts) + 1):
            yield from (f"{'/'.join(parts[:end])}{ending}" for ending in (".py", "/__init__.py"))
