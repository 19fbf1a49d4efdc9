"""The command line, made from the signatures and docstrings of the functions that `import flexfem` offers.

A parameter `stage : Stage` is the argument STAGE, a file; parameters with a default are options; those of a named
tuple, such as the analytic model, are options each. The text of an option is that of the parameter in the docstring.
A function that gives a `Result` is printed as tables, or with `--json` as a document; with `--output` the document,
the figure and the fields are written. Modules are imported when their command is run.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperGroup

import flexfem
from flexfem.terminal import people, working

GROUPS = {
    "Start": ("new", "check", "view", "summary"),
    "Ask a stage": ("stiffness", "formulas"),
    "Compare with finite elements": ("verify", "plot", "budget", "converge"),
    "Drive and reach": ("drive", "reach", "large"),
    "Vibration, heat, weight and life": ("modes", "drift", "gravity", "life"),
    "Measure": ("experiment", "identify", "as-built"),
    "Many designs": ("study", "design"),
    "Pass on": ("export", "mesh", "report", "schema"),
    "Check and trust": ("regression", "baseline"),
}
ONE_NAME = (
    *("check", "view", "summary", "stiffness", "budget", "converge"),
    *("drive", "reach", "large"),
    *("modes", "drift", "gravity", "life"),
    *("experiment", "identify"),
    *("export", "mesh", "schema", "regression", "baseline"),
)
MADE = {  # commands made from signatures, and the functions behind them
    "new": "new_stage",
    "formulas": "hinge_formulas",
    "as-built": "as_built",
    "verify": "verification",
    **dict(zip(ONE_NAME, ONE_NAME, strict=True)),
}
RENAMED = {  # old names of commands, and what they are called now
    "solve": "stiffness --models elements",
    "command": "drive",
    "workspace": "large",
}
OF_PYTHON = ("progress", "law")  # parameters that are no options
OUTPUT = "Folder for what is written."
LONG = 40  # characters: texts of a list that are longer have lines of their own


class Commands(TyperGroup):
    """The commands in sections, each built when it is run."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse a name behind the options of completion, which are of the shell in which they are run."""
        if args and args[0] in ("--install-completion", "--show-completion") and args[1:]:
            ctx.fail(f"{args[0]} {args[1]}: expected nothing behind it, it is of the shell in which it is run")
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        """All names in the order of their sections."""
        known = [name for group in GROUPS.values() for name in group]
        return [name for name in known if name in MADE or name in self.commands]

    def get_command(self, ctx: Any, name: str) -> Any:
        """The command of a name; one that was renamed answers with its new name."""
        if name in RENAMED:
            ctx.fail(f"{name}: this command is now called `flexfem {RENAMED[name]}`")
        return command(name) if name in MADE else super().get_command(ctx, name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments begin with; an unknown one is refused with the nearest names."""
        known = self.list_commands(ctx)
        if args and args[0] not in known and args[0] not in RENAMED:
            near = " or ".join(f"'{each}'" for each in get_close_matches(args[0], known))
            ctx.fail(f"No such command '{args[0]}'.{f' Did you mean {near}?' if near else ''}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the sections, each command with its first sentence."""
        for title, group in GROUPS.items():
            rows = [(name, self._summary(name)) for name in group if name in self.list_commands(ctx)]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def _summary(self, name: str) -> str:
        """The first line of a command's docstring, read without importing its module."""
        if name not in MADE:
            return str(self.commands[name].get_short_help_str(400))
        function = MADE[name]
        source = (Path(__file__).parent / f"{flexfem.home_of(function).replace('.', '/')}.py").read_text()
        first = rf'^def {function}\(.*?\) -> [^\n]*:\n    r?"""(.*?)(?:\n\n|""")'
        found = re.search(first, source, re.DOTALL | re.MULTILINE)
        return " ".join(found[1].split()) if found else ""


def command(name: str) -> Any:
    """The command of a function that `flexfem` offers."""
    function = getattr(flexfem, MADE[name])
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name, help=_about(function.__doc__))(_runner(name, function))
    return typer.main.get_command(app)


def _runner(name: str, function: Callable[..., Any]) -> Callable[..., None]:
    """A function with the options of a command as its signature, which runs it and shows what it gives."""
    options = list(_options(function))
    own = any(each.name == "output" for each in options)  # the function writes itself

    def run(**given: Any) -> None:
        as_json = given.pop("json")
        folder = None if own else given.pop("output")
        show(*_called(name, function, given), as_json, folder)

    parameters = [*options, _json_option(), *([] if own else [_output_option()])]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run


def _options(function: Callable[..., Any]) -> Iterator[inspect.Parameter]:
    """Arguments and options of a function: those of its parameters, and of the fields of named tuples."""
    hints, texts = get_type_hints(function), parameters(function.__doc__)
    for name, one in inspect.signature(function).parameters.items():
        hint = hints[name]
        if name in OF_PYTHON:
            continue
        if name == "stage":
            about = typer.Argument(help="Stage file, see flexfem schema stage.", metavar="STAGE")
            yield _parameter(name, Annotated[Path, about], inspect.Parameter.empty)
        elif hasattr(hint, "_fields"):
            fields = parameters(hint.__doc__)
            for field, annotation in get_type_hints(hint).items():
                yield _parameter(field, _option(field, annotation, fields[field]), hint._field_defaults[field])
        elif name == "output":
            callback = _usable if one.default is None else None
            option = typer.Option("--output", "-o", callback=callback, help=texts[name])
            yield _parameter(name, Annotated[hint, option], one.default)
        elif one.kind is not one.KEYWORD_ONLY:
            metavar = name.upper() + ("..." if one.kind is one.VAR_POSITIONAL else "")
            annotation = list[hint] if one.kind is one.VAR_POSITIONAL else hint  # type: ignore[valid-type]
            yield _parameter(
                name, Annotated[annotation, typer.Argument(help=texts[name], metavar=metavar)], one.default
            )
        else:
            yield _parameter(name, _option(name, hint, texts[name]), one.default)


def _option(name: str, hint: Any, text: str) -> Any:
    flag = f"--{name.replace('_', '-')}"
    return Annotated[hint, typer.Option(flag, help=text)]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _json_option() -> inspect.Parameter:
    return _parameter("json", Annotated[bool, typer.Option("--json", help="Print JSON for machines.")], False)


def _output_option() -> inspect.Parameter:
    option = typer.Option("--output", "-o", callback=_usable, help=OUTPUT)
    return _parameter("output", Annotated[Path | None, option], None)


def _usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


def _called(name: str, function: Callable[..., Any], given: dict[str, Any]) -> tuple[Any, str]:
    """What a function gives for the options of its command, and the stem of the files for it."""
    from flexfem.mechanism.stage import load_feasible

    hints, arguments, positional, stem = get_type_hints(function), dict[str, Any](), list[Any](), name
    for parameter in inspect.signature(function).parameters.values():
        hint = hints[parameter.name]
        if parameter.name == "stage":
            path = given["stage"]
            arguments["stage"], stem = load_feasible(path), f"{path.stem}-{name}"
        elif parameter.name in OF_PYTHON:
            continue
        elif hasattr(hint, "_fields"):
            arguments[parameter.name] = hint(**{field: given[field] for field in hint._fields})
        elif parameter.kind is parameter.VAR_POSITIONAL:
            positional = given[parameter.name]
        else:
            arguments[parameter.name] = given[parameter.name]
    if "progress" not in hints:
        return function(*positional, **arguments), stem
    with working(name) as say:
        return function(*positional, **arguments, progress=say), stem


def show(found: Any, stem: str, as_json: bool, folder: Path | None) -> None:
    """Print what a command found, and write its document, figure and fields where a folder is given."""
    from flexfem.results import Result

    if isinstance(found, Result) and folder is not None:
        write(found, folder / f"{stem}.json")
    every = found if isinstance(found, list) else [found]
    if as_json:
        data = [each.to_dict() if isinstance(each, Result) else plain(each) for each in every]
        print(json.dumps(data if isinstance(found, list) else data[0], indent=1, allow_nan=False))
        every = []
    for each in every:
        if isinstance(each, Result):
            print_result(each)
        elif hasattr(each, "_asdict"):
            print_record(each)
        else:  # files written, or what says itself
            people().print(str(each))
    if getattr(found, "findings", None):  # of a check
        raise typer.Exit(1)


def plain(value: Any) -> Any:
    """Named tuples, paths and arrays as plain data; a number that is not finite is None."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value.tolist() if hasattr(value, "tolist") else value


def write(found: Any, path: Path) -> list[Path]:
    """Write the document of a result, its figures and its fields beside it; returns the paths.

    Raises BadInput when the folder takes no file, or a file that the command has read would be replaced.
    """
    from flexfem.files.inputs import require_unread

    require_unread(*(path.with_suffix(ending) for ending in (".json", ".png", ".pdf", ".vtu", ".npz", ".mat")))
    paths = [found.write(path)]
    if found.figure and (found.fields is not None or not found.drawn_from_fields):
        from flexfem.plot.write import write_beside

        module, _, draw = found.figure.rpartition(".")
        drawn = getattr(import_module(f"flexfem.plot.{module}"), draw)(found)
        for ending, one in (drawn if isinstance(drawn, dict) else {"": drawn}).items():  # figures, or what writes one
            beside = path.with_name(f"{path.stem}{ending}{path.suffix}")
            paths += one(beside) if callable(one) else write_beside(beside, one)
    return paths + (found.fields.write(path) if hasattr(found.fields, "write") else [])


def print_result(found: Any) -> None:
    """Print the heading, the tables, how they are read, warnings, and how many numbers are in doubt."""
    out = people()
    out.print(found.heading())
    for table in found.tables():
        if table.caption:
            out.print(f"{table.caption}:")
        out.print(_table(table.head, table.rows))
    for text in found.sentences():
        out.print(text)
    _print_doubts(out, found.warnings, found.about.assumed, found.about.not_stated)


def print_record(found: Any) -> None:
    """Print a named tuple: a line for each field, a table for a list of named tuples, keys with equal texts are one."""
    out, fields = people(), found._asdict()
    doubts = [fields.pop(name, []) for name in ("warnings", "assumed", "not_stated")]
    for name, value in fields.items():
        title = name.replace("_", " ")
        if isinstance(value, list) and value and hasattr(value[0], "_fields"):
            rows = [[_text(part) for part in one] for one in value]
            out.print(f"{title}:")
            out.print(_table([field.replace("_", " ") for field in value[0]._fields], rows))
        elif hasattr(value, "lines"):
            print(f"{title}:", *value.lines, sep="\n  ")
        elif isinstance(value, dict):
            for text in dict.fromkeys(map(_text, value.values())):
                out.print(f"{', '.join(key for key, each in value.items() if _text(each) == text)}: {text}")
        elif isinstance(value, list) and any(len(str(each)) > LONG for each in value):
            print(f"{title}:", *value, sep="\n")
        elif value not in (None, "", [], False):
            out.print(f"{title}: {_text(value)}")
    _print_doubts(out, *doubts)


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return f"{value:.8g}" if isinstance(value, float) else str(value)


def _table(head: list[str], rows: list[list[str]]) -> Any:
    from rich.table import Table

    shown = Table(*head, box=None, padding=(0, 2, 0, 0), show_header=any(head))
    for row in rows:
        shown.add_row(*row)
    return shown


def _print_doubts(out: Any, warnings: list[str], assumed: list[str], not_stated: list[str]) -> None:
    from flexfem.mechanism.stage_file import doubts_said

    for text in warnings:
        out.print(f"warning: {text}")
    for text in doubts_said(assumed, not_stated):
        out.print(f"{text}: --json lists them")


def parameters(doc: str | None) -> dict[str, str]:
    """The parameters of a numpydoc docstring with their texts."""
    text = inspect.cleandoc(doc or "")
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+$|\Z)", text, re.DOTALL | re.MULTILINE)
    parts = re.split(r"^\*?(\w+) : [^\n]*$", section[1] if section else "", flags=re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in zip(parts[1::2], parts[2::2], strict=True)}


def _about(doc: str | None) -> str:
    """The text of a docstring before its first section."""
    return re.split(r"^\w[^\n]*\n-+$", inspect.cleandoc(doc or ""), maxsplit=1, flags=re.MULTILINE)[0].strip()
