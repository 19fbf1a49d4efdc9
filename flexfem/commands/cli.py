"""The command line, made from the signatures and docstrings of the functions that `import flexfem`
offers.

A parameter `stage : Stage` becomes the argument STAGE, a file; parameters with a default, and the
fields of named tuples, become options, with their docstring as help. A `Result` is printed as
tables, or with `--json` as a document; `--output` writes document, figure and fields. A command
imports its modules when it runs.

Exit 0 done, 1 a check or a computation failed, 2 bad input, 128 + n stopped by signal n, for
example by a closed pipe."""

from __future__ import annotations

import inspect
import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

import flexfem
from flexfem import terminal as streams
from flexfem.commands.console import Json, OutputFolder, show
from flexfem.files.inputs import noted
from flexfem.refused import BadInput, ComputationFailed, printed
from flexfem.sources import ONE_THREAD, manifest, use_own
from flexfem.study import MOST_WORKERS
from flexfem.units import DIRECTIONS, FORCES, POSES, UNITS, in_unit

GROUPS = {
    "Start": ("new", "import", "check", "view", "summary"),
    "Stiffness and hinges": ("stiffness", "forces", "buckling", "formulas"),
    "Compare with finite elements": ("verify", "plot", "budget", "converge"),
    "Drive and reach": ("drive", "reach", "large"),
    "Vibration, heat, weight and life": ("modes", "drift", "gravity", "life"),
    "Measure": ("compare", "experiment", "identify", "as-built"),
    "Many designs": ("study", "design"),
    "Export and report": ("export", "mesh", "report", "schema"),
    "Regression checks": ("regression", "baseline"),
}
RENAMED = {  # old names of commands, with their replacements
    "solve": "flexfem stiffness --models elements",
    "command": "flexfem drive",
    "workspace": "flexfem large, or flexfem reach for the poses of the drive",
    "claims": "make claims",
    "benchmark": "make validation",
    "cross-check": "make validation",
}
RENAMED_OPTIONS = {
    "--layers": ("--solid", "--thickness-resolution N")
}  # old options, with their replacements
STUDY = {  # commands of `flexfem study`, with their functions
    "run": "run_study",
    "status": "study_status",
    "clean": "clean_study",
    "collect": "collect_study",
    "plot": "plot_study",
}
HAND_WRITTEN = ("study", "design")  # the other commands are made from the functions in MADE
MADE = {
    name: name.replace("-", "_")
    for group in GROUPS.values()
    for name in group
    if name not in HAND_WRITTEN
}
MADE |= {
    "new": "new_stage",
    "import": "import_drawing",
    "formulas": "hinge_formulas",
    "verify": "verification",
    "plot": "plot_results",
}
ON_DASK = (
    "Solve finite elements on a Dask cluster: host:port of its scheduler, or its scheduler file."
)
PYTHON_ONLY = ("executor", "law", "progress")  # parameters without an option
TYPES: dict[str, Any] = {  # of parameters, for typer
    "stage": Path,
    "mechanism": Path,
    "files": list[Path],
    "sections": list[str],
    "force_at": list[str],
    "hold": list[str],
    "section": list[str],
}
MEASURED = {  # units of plain numbers of options, by direction for a vector
    **dict.fromkeys(("force", "load"), FORCES),
    **dict.fromkeys(("displacement", "pose", "amplitude", "mean"), POSES),
    "payload": (UNITS["kg"], UNITS["kg_mm2"]),
    "force_out_of_plane": (UNITS["n"], UNITS["n_mm"], UNITS["n_mm"]),
    "tilting": (UNITS["kg_mm2"],),
    "angle": (UNITS["deg"],),
    **dict.fromkeys(("kerf", "holes", "thickness", "tolerance"), (UNITS["mm"],)),
}
SUBJECTS = ("mechanism", "stage")  # names of the parameter that is what a question is about
ABOUT_SUBJECT = (
    "Mechanism or stage file, see flexfem schema mechanism and flexfem schema stage, or a drawing."
)
STAGE = dict.fromkeys(SUBJECTS, ABOUT_SUBJECT)
SHOWN = (
    "thickness",
    "material",
)  # options of drawings in the help of every command; import lists them all
USAGE_ERROR: Any = (
    typer.BadParameter.__base__
)  # click's UsageError: typer bundles click, or uses the installed one
CLOSED_PIPE = 141  # 128 + SIGPIPE, the exit code of a program that does not handle that signal
ABOUT = "Verification and design of planar flexure mechanisms."


class Commands(TyperGroup):
    """The commands in sections, each built when it is called."""

    groups = GROUPS
    made = MADE

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse arguments after the completion options, which apply to the current shell."""
        if args and args[0] in ("--install-completion", "--show-completion") and args[1:]:
            ctx.fail(
                f"{args[0]} {args[1]}: expected no argument after it: it applies to the current "
                "shell"
            )
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return all names in the order of the sections."""
        return [name for group in self.groups.values() for name in group]

    def get_command(self, ctx: Any, name: str) -> Any:
        """Return the command with a name."""
        return (
            command(name, self.made[name]) if name in self.made else super().get_command(ctx, name)
        )

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command named by the first argument; refuse an unknown one with similar names."""
        known = self.list_commands(ctx)
        if args and args[0] in RENAMED:
            ctx.fail(f"{args[0]}: this command is now: {RENAMED[args[0]]}")
        if args and args[0] not in known:
            similar = " or ".join(f"'{name}'" for name in get_close_matches(args[0], known))
            ctx.fail(
                f"No such command '{args[0]}'.{f' Did you mean {similar}?' if similar else ''}"
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the sections, each command with a summary."""
        for title, group in self.groups.items():
            with formatter.section(title):
                formatter.write_dl([(name, self._summary(name)) for name in group])

    def _summary(self, name: str) -> str:
        """Return the first sentence of a command's docstring, read without an import of its module."""
        if name not in self.made:
            return str(self.commands[name].get_short_help_str(400))
        function = self.made[name]
        source = (
            Path(__file__).parents[1] / f"{flexfem.home_of(function).replace('.', '/')}.py"
        ).read_text()
        pattern = rf'^def {function}\(.*?\) -> [^\n]*:\n    r?"""(.*?)(?:\n\n|""")'
        found = re.search(pattern, source, re.DOTALL | re.MULTILINE)
        return " ".join(found[1].split()) if found else ""


class StudyCommands(Commands):
    """The commands of `flexfem study`."""

    groups = {"Commands": tuple(STUDY)}  # noqa: RUF012
    made = STUDY


class Command(TyperCommand):
    """A command whose integer list options take several numbers after one flag: --resolutions 4 6
    8.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the flag before every further number."""
        flags = {flag for option in self.params if option.multiple for flag in option.opts}
        repeated = list[str]()
        for arg in args:
            repeated += (
                [repeated[-2]]
                if arg.isdigit() and repeated[-2:-1] and repeated[-2] in flags
                else []
            )
            repeated.append(arg)
        flags |= {flag for option in self.params for flag in option.opts}
        for flag in (arg.partition("=")[0] for arg in args):
            if flag in RENAMED_OPTIONS and flag not in flags and RENAMED_OPTIONS[flag][0] in flags:
                ctx.fail(f"{flag}: this option is now: {' with '.join(RENAMED_OPTIONS[flag])}")
        return super().parse_args(ctx, repeated)


app = typer.Typer(
    help=ABOUT,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    cls=Commands,
    context_settings={"help_option_names": ["--help", "-h"]},  # of all commands
)
about_studies = "Study many designs: run, count finished designs, collect the table, plot."
app.add_typer(
    typer.Typer(help=about_studies, no_args_is_help=True, cls=StudyCommands), name="study"
)


@app.command()
def design(
    requirements: Annotated[
        Path, typer.Argument(help="See flexfem schema requirements.", metavar="FILE")
    ],
    output: OutputFolder = None,
    workers: Annotated[
        int, typer.Option(min=1, max=MOST_WORKERS, help="Processes for finite elements.")
    ] = 1,
    scheduler: Annotated[str | None, typer.Option(help=ON_DASK)] = None,
    json: Json = False,
) -> None:
    """Find the best stage or mechanism for requirements, checked by finite elements; exit code 1 if
    none meets them.
    """
    os.environ.update(
        ONE_THREAD
    )  # before the import of numpy: threads change the last bits of results
    from flexfem.design.run import run_design

    began = time.monotonic()
    with streams.working("design", pause=streams.EVERY) as say:
        found = run_design(requirements, output, workers, say, scheduler)
    if output is not None:
        from flexfem.plot.write import write_design_figures

        written = write_design_figures(found, output / f"{requirements.stem}-design.json")
        print(*map(str, written), sep="\n", file=sys.stderr)
    show(found, json)
    print(f"{time.monotonic() - began:.1f} s", file=sys.stderr)
    raise typer.Exit(0 if found.feasible and found.agreed else 1)


def command(name: str, made_from: str) -> Any:
    """Return the command of a function that `flexfem` offers."""
    function = getattr(flexfem, made_from)
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(name, cls=Command, help=_description(function.__doc__))(_runner(name, function))
    return typer.main.get_command(single)


def _runner(name: str, function: Callable[..., Any]) -> Callable[..., None]:
    """Return a function that calls another one and shows its result; its signature holds the
    options of the command.
    """
    options = [*_options(function), _parameter("json", Json, False)]
    kind = get_type_hints(function)["return"]
    kinds = get_args(kind) if get_origin(kind) is UnionType else (kind,)
    if all(
        hasattr(each, "quantities") for each in kinds
    ):  # results; other functions have their own output
        options.append(_parameter("output", OutputFolder, None))

    def run(**given: Any) -> None:
        from flexfem.results import Result

        found, stem = _called(name, function, given)
        if isinstance(found, Result) and given["output"] is not None:
            write(found, given["output"] / f"{stem}.json")
        show(found, given["json"])
        if getattr(found, "findings", None) or getattr(
            found, "failed", False
        ):  # of a check, of a study
            raise typer.Exit(1)

    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    run.__annotations__ = {option.name: option.annotation for option in options}
    return run


def _options(function: Callable[..., Any]) -> Iterator[inspect.Parameter]:
    """Yield the arguments and options of a function, from its parameters and the fields of named
    tuples.
    """
    hints = get_type_hints(function)
    texts = parameters(function.__doc__) | STAGE
    for name, parameter in inspect.signature(function).parameters.items():
        several = parameter.kind is parameter.VAR_POSITIONAL
        default = parameter.default
        hint = (
            hints[name]
            if several
            else TYPES.get(name, Path if "PathLike" in str(hints[name]) else hints[name])
        )
        if name in PYTHON_ONLY:
            continue
        if hasattr(hint, "_fields"):
            yield from _of_record(hint, function)
        elif name in SUBJECTS:
            yield _parameter(
                name, Annotated[hint, typer.Argument(help=texts[name], metavar="FILE")], default
            )
            yield from _of_record(flexfem.Reading, function)
        elif name == "output":
            long = "--to" if function.__name__ == "import_drawing" else "--output"
            option = typer.Option(
                long, "-o", help=texts[name]
            )  # a folder or a file, which the function checks
            yield _parameter(name, Annotated[hint, option], default)
        elif parameter.kind is parameter.KEYWORD_ONLY:
            yield _parameter(name, _option(name, hint, texts[name]), default)
        else:
            hint = list[hint] if several else hint  # type: ignore[valid-type]
            metavar = name.upper() + "..." * (get_origin(hint) is list)
            yield _parameter(
                name, Annotated[hint, typer.Argument(help=texts[name], metavar=metavar)], default
            )


def _of_record(kind: Any, function: Callable[..., Any]) -> Iterator[inspect.Parameter]:
    """Yield the fields of a named tuple as options, without those that the function has itself."""
    texts = parameters(kind.__doc__)
    own = inspect.signature(function).parameters
    imports = function.__name__ == "import_drawing"
    for field, annotation in get_type_hints(kind).items():
        if field not in own:
            hidden = kind is flexfem.Reading and field not in SHOWN and not imports
            flags = ("--output",) if field == "output_at" and imports else ()
            option = _option(field, annotation, texts[field], *flags, hidden=hidden)
            yield _parameter(field, option, kind._field_defaults[field])


def _option(name: str, hint: Any, text: str, *flags: str, hidden: bool = False) -> Any:
    """Return the annotation of an option; its numbers may have units of their own where `MEASURED`
    has the option.
    """
    more = dict[str, Any]()
    count = str(hint).count("float")
    if count and name in MEASURED:
        units = MEASURED[name][:count]
        is_read_by_function = "str" in str(hint)  # texts with units of other quantities

        def numbers(given: Any) -> Any:
            if given is None:
                return None
            try:
                found = [
                    in_unit(*each)
                    for each in zip([given] if count == 1 else given, units, strict=True)
                ]
            except ValueError as error:
                if is_read_by_function:
                    return given
                raise typer.BadParameter(str(error)) from None
            return found[0] if count == 1 else tuple(found)

        hint = str if count == 1 else tuple[(str,) * count]  # type: ignore[misc]
        more = {"callback": numbers, "metavar": ", ".join(unit.plain for unit in units)}
    return Annotated[
        hint, typer.Option(f"--{name.replace('_', '-')}", *flags, help=text, hidden=hidden, **more)
    ]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default
    )


def _called(name: str, function: Callable[..., Any], given: dict[str, Any]) -> tuple[Any, str]:
    """Call a function with the options of its command; return its result and the stem of its files."""
    hints = get_type_hints(function)
    arguments = dict[str, Any]()
    positional = list[Any]()
    stem = name
    subject: Any = None
    for parameter in inspect.signature(function).parameters.values():
        hint = hints[parameter.name]
        if parameter.name in SUBJECTS:
            path = given[parameter.name]
            subject = _loaded(path, _record(flexfem.Reading, function, given))
            arguments[parameter.name] = subject
            stem = f"{path.stem}-{name}"
        elif hasattr(hint, "_fields"):
            arguments[parameter.name] = _record(hint, function, given)
        elif parameter.kind is parameter.VAR_POSITIONAL:
            positional = given[parameter.name]
        elif parameter.name not in PYTHON_ONLY:
            value = given[parameter.name]
            arguments[parameter.name] = parameter.default if value == [] else value
            stated = given[parameter.name] not in (None, parameter.default)
            motion = MEASURED.get(parameter.name) is POSES and not isinstance(
                given.get(parameter.name), str
            )
            if stated and motion and subject is not None:
                _check_size(parameter.name, given[parameter.name], subject)
    pause = streams.EVERY if name in STUDY else 0.0
    with (
        streams.working("study" if pause else name, pause)
        if "progress" in hints
        else nullcontext() as say
    ):
        return function(
            *positional, **arguments, **({} if say is None else {"progress": say})
        ), stem


def _loaded(path: Path, reading: Any) -> Any:
    """Load a stage or mechanism; say what was recognised in a drawing."""
    from flexfem.importing.drawings import imported, is_drawing

    if not is_drawing(path):
        return flexfem.load(path, reading)
    plate = imported(path, reading)
    print(
        plate.summary, *(f"warning: {text}" for text in plate.warnings), sep="\n", file=sys.stderr
    )
    return plate.mechanism


def _record(kind: Any, function: Callable[..., Any], given: dict[str, Any]) -> Any:
    """Return a named tuple of options. An --output X,Y is the point of the output of a drawing, as
    of import.
    """
    own = inspect.signature(function).parameters
    fields = {field: given[field] for field in kind._fields if field not in own}
    if kind is flexfem.Reading and re.fullmatch(r"[-+\d.e ]+,[-+\d.e ]+", str(given.get("output"))):
        fields["output_at"] = str(given["output"])
        given["output"] = None
    return kind(**fields)


def _check_size(name: str, motion: Any, plate: Any) -> None:
    """Refuse a motion beyond the size of a stage or mechanism, which is likely meant in another
    unit.
    """
    import numpy as np

    from flexfem.mechanism.plate import extent, plate_polygon

    size = extent(plate_polygon(plate.layout))
    lengths = (size, f", the size of the {type(plate).__name__.lower()}", "um for micrometres")
    limits = (lengths, lengths, (1.0, "", "mrad for milliradians"))
    for number, (most, of, unit), own, direction in zip(
        np.atleast_1d(motion), limits, POSES, DIRECTIONS, strict=False
    ):
        if abs(number) > most:
            where = name if np.isscalar(motion) else f"{name} {direction}"
            expected = f"expected at most {most:.3g} {own}{of}; write {number:g}{unit}"
            raise BadInput(f"{where} = {number:g} {own}, {expected}")


def write(found: Any, path: Path) -> list[Path]:
    """Write the document, the figures and the fields of a result; return the paths.

    Raises BadInput when the folder is not writable, or when an input file of the command would be
    replaced."""
    from flexfem.files.writing import check_name

    for ending in (".json", ".png", ".pdf", ".vtu", ".npz", ".mat"):
        check_name(path.with_suffix(ending))
    paths = [found.write(path)]
    if found.figure and (found.fields is not None or not found.drawn_from_fields):
        from flexfem.plot.write import write_of_result

        paths += write_of_result(found, path)
    return paths + (found.fields.write(path) if hasattr(found.fields, "write") else [])


def parameters(doc: str | None) -> dict[str, str]:
    """Return the parameters of a numpydoc docstring with their texts."""
    text = inspect.cleandoc(doc or "")
    section = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+$|\Z)", text, re.DOTALL | re.MULTILINE
    )
    parts = re.split(r"^\*?(\w+) : [^\n]*$", section[1] if section else "", flags=re.MULTILINE)
    return {
        name: " ".join(text.split()) for name, text in zip(parts[1::2], parts[2::2], strict=True)
    }


def _description(doc: str | None) -> str:
    """Return the text of a docstring before its first section."""
    return re.split(r"^\w[^\n]*\n-+$", inspect.cleandoc(doc or ""), maxsplit=1, flags=re.MULTILINE)[
        0
    ].strip()


def _print_version(requested: bool) -> None:
    if requested:
        print(f"flexfem {flexfem.__version__}")
        raise typer.Exit


@app.callback(help=ABOUT)
def _common(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
    formulas: Annotated[
        Path | None,
        typer.Option(
            "--with", metavar="FILE", help="Python file that registers formulas and materials."
        ),
    ] = None,
) -> None:
    manifest()  # before the import of modules that compute: part of the versions of a study
    if formulas is not None:
        use_own(formulas)


def main() -> None:
    """Run the command line; any error is one line on standard error."""
    streams.open_streams()
    os.environ["PYTHONSAFEPATH"] = "1"  # child processes must not import from the current folder
    os.environ.update(
        ONE_THREAD | os.environ
    )  # matrices are small: waiting threads take up to twice the time
    code = 130
    text = "stopped"
    with streams.plain_streams(), noted():
        with suppress(KeyboardInterrupt), streams.stoppable() as stops:
            code, text = _run()
        if stops:  # libraries may have replaced the exception
            code = stops[0].code
            text = getattr(stops[0], "__notes__", ["stopped"])[0]
        if text:
            print(f"flexfem: {text}", file=sys.stderr)
    if code:
        sys.exit(code)


def _check_environment() -> None:
    """Refuse what the environment sets, where libraries or the commands themselves fail with it."""
    if sys.flags.optimize > 1:
        raise BadInput(
            "PYTHONOPTIMIZE or python -OO: the commands are made from docstrings, which it removes"
        )
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "0")
    if not re.fullmatch("[0-9]{1,11}", epoch):
        raise BadInput(
            f"SOURCE_DATE_EPOCH = {printed(epoch)}, expected seconds since 1970, or no such "
            "variable"
        )
    if "MPLBACKEND" in os.environ:
        from flexfem.plot import check_backend

        check_backend()


def _run() -> tuple[int, str]:
    """Run the command; return its exit code, and its error message if any."""
    try:
        try:
            _check_environment()
            return int(app(prog_name="flexfem", standalone_mode=False) or 0), ""
        except SystemExit as stop:
            if isinstance(stop.__context__, BrokenPipeError):  # libraries exit after it
                raise stop.__context__ from None
            raised = streams.deepest(stop)
            if raised is not None and raised.tb_frame.f_code.co_filename.startswith(
                os.path.dirname(typer.__file__)
            ):
                return int(stop.code or 0), ""  # completion of a shell
            return 1, streams.reason_of(stop)  # raised by the user's own code: no command raises it
        except USAGE_ERROR as error:
            return 2, _usage(error)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BadInput as refusal:
        return 2, str(refusal)
    except ComputationFailed as failure:
        return 1, str(failure)
    except BrokenPipeError:  # the reader, such as head, has ended
        streams.discard(sys.stdout)
        return CLOSED_PIPE, ""
    except OSError as error:  # a full disk or a closed output: the buffer cannot be written either
        streams.discard(sys.stdout)
        return 1, streams.reason_of(error)
    except Exception as error:  # unforeseen errors, those of libraries included
        if os.environ.get("FLEXFEM_TRACEBACK"):
            raise
        return 1, streams.reason_of(error)


def _usage(error: Any) -> str:
    """Return a usage error as one line; for a command without arguments show its help instead."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        return ""
    if hasattr(
        error.__cause__, "errors"
    ):  # of pydantic, with which typer converts the values of options
        details = error.__cause__.errors()[0]
        expected = re.sub(
            r"^(Value error, .* is not |Input should be )|, unable to .*", "", details["msg"]
        )
        expected = re.sub(r"^(greater|less) than", r"a number \1 than", expected)
        error.message = f"{details['input']}, expected {expected}"
    message = " ".join(error.format_message().split()).removesuffix(".")
    hint = f" (see {error.ctx.command_path} --help)" if error.ctx is not None else ""
    return f"{message[:1].lower()}{message[1:]}{hint}"
