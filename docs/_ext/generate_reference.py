"""Pages of docs/reference, made at every build from the code: keys of files, results, JSON schemas,
and commands.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from docutils import nodes

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from flexfem.commands.catalogue import GROUPS  # noqa: E402
from flexfem.commands.cli import app  # noqa: E402
from flexfem.files.provenance import is_assumed  # noqa: E402
from flexfem.files.writing import markdown_table  # noqa: E402
from flexfem.mechanism.actuators import catalogue  # noqa: E402
from flexfem.mechanism.materials import KEYS, REGISTERED, materials  # noqa: E402
from flexfem.schemas.command import FILE, schema  # noqa: E402
from flexfem.schemas.formats import FORMATS, results  # noqa: E402
from flexfem.schemas.keys import KeyRow, KeyTable, tables_of  # noqa: E402
from flexfem.study.columns import MEANINGS  # noqa: E402
from flexfem.units import unit_of  # noqa: E402

FOLDER = ROOT / "docs/reference"
OVERRIDE = "override"  # its other keys are those of hinges and actuators
MARKED = r"Keys marked \* are required. A file with other keys is refused."
COMMON = (
    "Options stand before or after arguments; `--json` prints the result as JSON. Exit code 0: "
    "done; 1: a check or a computation failed; 2: bad input; 128 + n: stopped by signal n."
)
SCHEMAS = """# JSON schemas

An editor that knows TOML completes and checks the files of flexfem by these schemas. `flexfem schema --output FOLDER`
writes them. If `--with FILE.py` precedes `schema`, they contain your own hinge formulas and materials. The first line
of a TOML file then names one:

```toml
#:schema FOLDER/flexfem-stage.schema.json
```

They refuse the faults that a schema can describe. `flexfem check` and the other commands also refuse other faults, such
as bodies that overlap. The stored results of commands also have schemas: `flexfem schema drift --json`.

"""
RESULTS = """# Results

Each result has the quantities below in its JSON document, in tables, as columns of studies and in `regression`. In
Python, `found.at("pose", model="analytic")` returns the part of a quantity at labels of its axes, `found.band` returns
its numerical uncertainty, `found.unit` returns its unit, and `found.to_frame()` returns all numbers. A number has the
unit of the table below in every place. Tables may add an SI prefix to lengths and angles.
"""
QUANTITIES = """## Quantities

Expressions may contain outputs of [studies](study.md), keys of the stage file, and the following quantities:

- `mass_kg`: mass of the drawn plate;
- `error_x_percent`, `error_y_percent`, `error_theta_percent`: error of the model of `paper_formula` along a command;
- with `[tolerance]`, `coupling_xy_95`, `coupling_xt_95`, `coupling_yt_95`: the 95 % quantile of the coupling over
  all stages, and `coupling_95`, that of the largest of the three."""


def pages() -> dict[str, str]:
    """Every page by its name."""
    links = (
        f"- {of.title}: {{download}}`{FILE.format(n)} <{FILE.format(n)}>`"
        for n, of in FORMATS.items()
    )
    found = {
        "schemas": SCHEMAS + "\n".join(links) + "\n",
        "results": results_page(),
        "commands": commands_page(),
    }
    for name, (title, parts, after) in PAGES.items():
        keys = [block for part in parts for block in _keys(*part, several=len(parts) > 1)]
        found[name] = "\n\n".join(filter(None, [f"# {title}", MARKED, *keys, after()])) + "\n"
    return found


# keys of files


def _keys(name: str, on_page: Callable[[str], bool], several: bool) -> Iterator[str]:
    """The tables of a format that are on a page; tables with the same keys are one."""
    every = tables_of(name)
    if several:
        yield f"## {FORMATS[name].title}"
    yield FORMATS[name].about if on_page("") else "A table of a [stage file](stage.md)."
    others = {
        (row.key, row.meaning) for table in every if table.name != OVERRIDE for row in table.rows
    }
    empty = [
        one
        for one in every
        if one.name and not any(each.name.startswith(f"{one.name}.") for each in every)
    ]
    left = [table for table in every if on_page(table.name) and (table.rows or table in empty)]
    while left:
        alike = [each for each in left if each.rows == left[0].rows]
        heading = ", ".join(
            f"`{each.header}`" if each.name else "Top of the file" for each in alike
        )
        yield f"{'###' if several else '##'} {heading}"
        yield _about(alike)
        rows = [
            row
            for row in left[0].rows
            if left[0].name != OVERRIDE or (row.key, row.meaning) not in others
        ]
        yield _key_table(rows) if rows else ""
        left = [each for each in left if each not in alike]


def _about(alike: list[KeyTable]) -> str:
    if len(alike) == 1:
        return f"{alike[0].about}." if alike[0].name else ""
    return "\n".join(f"- `{each.header}`: {each.about}." for each in alike)


def _key_table(rows: list[KeyRow]) -> str:
    """The keys of a table, where numbers come from last."""
    cells = [
        (
            f"`{row.key}`" + r" \*" * row.needed,
            row.meaning,
            row.unit,
            row.value,
            _code(row.default),
            _code(row.example),
        )
        for row in sorted(rows, key=lambda row: row.key == "provenance")
    ]
    return markdown_table(("key", "meaning", "unit", "value", "default", "example"), cells)


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def _materials() -> str:
    numbers = {
        name: one.model_dump(by_alias=True, exclude_none=True) for name, one in materials().items()
    }
    shown = [key for key in KEYS if any(key in each for each in numbers.values())]
    rows = []
    sources = []
    for name, each in numbers.items():
        of = REGISTERED[name]
        assumptions = {
            key: " (assumed)" * is_assumed(of.sources.get(key, of.source)) for key in shown
        }
        rows.append(
            (
                f"`{name}`",
                *(f"{each[key]}{assumptions[key]}" if key in each else "" for key in shown),
            )
        )
        sources.append(
            f"- `{name}`: "
            f"{'; '.join([of.source, *(f'`{k}`: {text}' for k, text in of.sources.items())])}"
        )
    about = (
        "The numbers are for room temperature. A fatigue constant or an expansion is missing if "
        "no source states it. `flexfem check` prints the source of every number; "
        "`register_material` in Python adds your own."
    )
    table = markdown_table(("`name`", *map(_code, shown)), rows, "l" + "r" * len(shown))
    return "\n\n".join(["## Registered materials", about, table, "\n".join(sources)])


def _stacks() -> str:
    head = (
        "`stack`",
        "maker",
        "stroke, µm",
        "blocking force, N",
        "stiffness, N/µm",
        "at, V",
        "length, mm",
    )
    rows = [
        (
            f"`{name}`",
            one.maker,
            f"{1e3 * one.stroke:g} ± {1e3 * one.tolerance:g}",
            f"{one.blocking_force:g}",
            f"{one.blocking_force / one.stroke / 1e3:.3g}",
            f"{one.voltage:g}",
            f"{one.length:g}",
        )
        for name, one in catalogue().items()
    ]
    (source,) = {one.source for one in catalogue().values()}
    about = f"Their mass is not stated by the sources, which are: {source}."
    table = markdown_table(head, rows, "llrrrrr")
    return "\n\n".join(["## Catalogue of stacks", about, table])


def _outputs() -> str:
    units = [
        dict.fromkeys(str(unit_of(each)) for each in group if str(unit_of(each)))
        for group in MEANINGS
    ]
    rows = [
        (", ".join(map(_code, group)), ", ".join(of), meaning)
        for (group, meaning), of in zip(MEANINGS.items(), units, strict=True)
    ]
    return "## Outputs\n\n" + markdown_table(("column", "unit", "meaning"), rows)


def _all(name: str) -> bool:
    return True


PAGES: dict[str, tuple[str, tuple[tuple[str, Callable[[str], bool]], ...], Callable[[], str]]] = {
    "stage": ("Stage files", (("stage", lambda name: name not in ("material", "actuator")),), str),
    "mechanism": ("Mechanism files", (("mechanism", lambda name: name != "material"),), str),
    "material": ("Materials", (("stage", "material".__eq__), ("material", _all)), _materials),
    "actuator": ("Actuators and stacks", (("stage", "actuator".__eq__),), _stacks),
    "case": ("Case files", (("case", _all),), str),
    "study": ("Study files", (("study", _all),), _outputs),
    "fixture": (
        "Set-ups of the experiment, and measurements",
        (("fixture", _all), ("measured", "measured".__ne__), ("necks", _all)),
        str,
    ),
    "requirements": ("Requirements files", (("requirements", _all),), lambda: QUANTITIES),
}


# results and commands


def results_page() -> str:
    """Every kind of result with its quantities."""
    parts = [RESULTS]
    for name, one in results().items():
        table = one.reference()
        parts.append(f"## `{name}`: {one.title}\n\n{markdown_table(table.head, table.rows)}\n")
    return "\n".join(parts)


def commands_page() -> str:
    """Every command of `flexfem` with its arguments and options."""
    import typer.main

    root: Any = typer.main.get_command(app)
    blocks = ["# All commands and options", "Before a command:", _options(root), COMMON]
    for title, names in GROUPS.items():
        blocks += [f"## {title}"]
        for name in names:
            blocks += _command(root.get_command(None, name), f"flexfem {name}")
    return "\n\n".join(blocks) + "\n"


def _command(of: Any, name: str) -> Iterator[str]:
    yield f"### `{name}`"
    yield " ".join((of.help or "").split())
    if hasattr(of, "list_commands"):
        for key in of.list_commands(None):
            yield from _command(of.get_command(None, key), f"{name} {key}")
        return
    arguments = [_metavar(each) for each in of.params if each.param_type_name == "argument"]
    yield f"```text\n{' '.join([name, *arguments, '[OPTIONS]'])}\n```"
    yield _options(of)


def _metavar(argument: Any) -> str:
    return str(argument.metavar or argument.name.upper())


def _options(of: Any) -> str:
    """Arguments and options in a table."""
    rows = []
    for each in of.params:
        if each.name in ("help", "install_completion", "show_completion"):
            continue
        names = (
            [*each.opts, *each.secondary_opts]
            if each.param_type_name == "option"
            else [_metavar(each)]
        )
        default = (
            ""
            if each.default in (None, False, ()) or callable(each.default)
            else f"`{each.default}`"
        )
        rows.append(
            (
                ", ".join(map(_code, names)) + r" \*" * each.required,
                " ".join((each.help or "").split()),
                default,
            )
        )
    return markdown_table(("option", "meaning", "default"), rows) if rows else ""


# files, and Sphinx


def write(folder: Path) -> None:
    """Write the pages and schemas that are not there as they are now."""
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    schema(output=folder)


def mark_tables(app: Any, doctree: nodes.document) -> None:
    """Give tables of keys and of options a class of their own, by which flexfem.css sets them."""
    if app.env.docname.startswith(f"{FOLDER.name}/"):
        for table in doctree.findall(nodes.table):
            head = next(table.findall(nodes.row)).astext().split()
            table["classes"] += {"key": ["keys"], "option": ["options"]}.get(head[0], [])


def without_validators(
    app: Any, what: str, name: str, of: Any, options: Any, *signature: Any
) -> tuple[str, None] | None:
    """Leave out the signature of a table of a file: its attributes are below, with their types."""
    return ("", None) if what == "class" and hasattr(of, "model_fields") else None


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write(FOLDER))
    app.connect("doctree-read", mark_tables)
    app.connect("autodoc-process-signature", without_validators)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write(FOLDER)
