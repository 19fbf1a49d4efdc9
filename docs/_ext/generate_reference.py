"""Pages of docs/reference, made at every build from the code itself: files, their JSON schemas, and commands."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/reference"
HEAD = ("option", "meaning", "default")
COMMON = (
    "Options stand before or after arguments; `--json` prints for machines. Exit code 0: done; 1: a check or a "
    "computation failed; 2: bad input; 128 + n: stopped by signal n."
)
SCHEMAS = """# JSON schemas

An editor that knows TOML completes and checks the files of flexfem by these schemas. `flexfem schema --output FOLDER`
writes them, with your own hinge formulas and materials where `--with FILE.py` stands before `schema`; the first line of
a TOML file then names one:

```toml
#:schema FOLDER/flexfem-stage.schema.json
```

They refuse what a schema can say; `flexfem check` and the other commands refuse more, such as bodies that overlap.

"""


def pages() -> dict[str, str]:
    """Every page by its name."""
    from flexfem.reference.formats import FORMATS
    from flexfem.reference.pages import PAGES, page
    from flexfem.reference.schemas import FILE

    listed = "\n".join(
        f"- {of.title}: {{download}}`{FILE.format(name)} <{FILE.format(name)}>`" for name, of in FORMATS.items()
    )
    return {**{name: page(name) for name in PAGES}, "schemas": SCHEMAS + listed + "\n", "commands": commands_page()}


def commands_page() -> str:
    """Every command of `flexfem` with its arguments and options."""
    import typer.main

    from flexfem.cli import GROUPS
    from flexfem.commands.cli import app

    root: Any = typer.main.get_command(app)
    context = typer.Context(root, info_name="flexfem")
    blocks = ["# All commands and options", "Before a command:", _options(root), COMMON]
    known = [name for group in GROUPS.values() for name in group]
    others = [name for name in root.list_commands(context) if name not in known]
    for title, names in {**GROUPS, "Other commands": others}.items():
        there = [name for name in names if name in root.commands]
        if there:
            blocks.append(f"## {title}")
        for name in there:
            blocks += _command(root.commands[name], f"flexfem {name}")
    return "\n\n".join(blocks) + "\n"


def _command(command: Any, name: str) -> Iterator[str]:
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    yield f"### `{name}`"
    yield " ".join((command.help or "").split())
    inside = getattr(command, "commands", None)
    if inside is not None:
        for key, each in inside.items():
            yield from _command(each, f"{name} {key}")
        return
    yield f"```text\n{' '.join([name, *map(_metavar, arguments), '[OPTIONS]'])}\n```"
    yield _options(command)


def _metavar(argument: Any) -> str:
    return str(argument.metavar or argument.name.upper())


def _options(command: Any) -> str:
    """Arguments and options in a table."""
    from flexfem.files.writing import markdown_table

    rows = []
    for each in command.params:
        if each.name in ("help", "install_completion", "show_completion"):
            continue
        optional = each.param_type_name == "option"
        names = (
            ", ".join(f"`{one}`" for one in (*each.opts, *each.secondary_opts)) if optional else f"`{_metavar(each)}`"
        )
        must = " \\*" if each.required else ""
        default = "" if each.default in (None, False, ()) or callable(each.default) else f"`{each.default}`"
        rows.append((names + must, " ".join((each.help or "").split()), default))
    return markdown_table(HEAD, rows) if rows else ""


def write(folder: Path) -> None:
    """Write the pages and schemas that are not there as they are now."""
    from flexfem.reference.formats import FORMATS
    from flexfem.reference.schemas import write_schemas

    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    write_schemas([*FORMATS], folder)


def mark_tables(app: Any, doctree: nodes.document) -> None:
    """Give tables of keys and of options a class of their own, by which flexfem.css sets them."""
    if app.env.docname.startswith(f"{FOLDER.name}/"):
        for table in doctree.findall(nodes.table):
            head = next(table.findall(nodes.row)).astext().split()
            table["classes"] += {"key": ["keys"], "option": ["options"]}.get(head[0], [])


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write(FOLDER))
    app.connect("doctree-read", mark_tables)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    write(FOLDER)
