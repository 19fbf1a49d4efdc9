"""The command line, made from the signatures and docstrings of the functions of `import flexfem`.

A `Result` is printed as tables, or with `--json` as a document; `--output` writes document, figure
and fields. A command imports its modules when it runs.

Exit 0 done, 1 a check or a computation failed, 2 bad input, 128 + n stopped by signal n, for
example by a closed pipe.
"""

from __future__ import annotations

import inspect
import os
import re
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

import flexfem
from flexfem import terminal
from flexfem.commands.calling import Answer, called, returns_results
from flexfem.commands.catalogue import (
    COMMANDS,
    GROUPS,
    RENAMED,
    RENAMED_OPTIONS,
    STUDY,
)
from flexfem.commands.console import All, Json, OutputFolder, OutputOfResult, show
from flexfem.commands.of_study import OF_STUDIES, is_done, taken_file, write_study
from flexfem.commands.options import description, made_parameter, options_of
from flexfem.commands.written import lacking, write
from flexfem.files.inputs import recording_inputs
from flexfem.refused import BadInput, ComputationFailed, printed
from flexfem.sources import ONE_THREAD, manifest, use_own
from flexfem.study import MOST_WORKERS

try:
    from typer._click.exceptions import UsageError  # newer versions of typer contain click
except ImportError:
    from click.exceptions import UsageError  # type: ignore[assignment]

CLOSED_PIPE = 141  # 128 + SIGPIPE, the exit code of a program that does not handle that signal
ABOUT = "Verification and design of planar flexure mechanisms."
ON_DASK = (
    "Solve finite elements on a Dask cluster: host:port of its scheduler, or its scheduler file."
)
COMPLETION = ("--install-completion", "--show-completion")


class Commands(TyperGroup):
    """The commands in groups, each built when it is called."""

    groups = GROUPS
    listed = COMMANDS

    def parse_args(
        self,
        ctx: Any,
        args: list[str],
    ) -> list[str]:
        """Refuse arguments after the completion options, which apply to the current shell."""
        if len(args) > 1 and args[0] in COMPLETION:
            ctx.fail(
                f"{args[0]} {args[1]}: expected no argument after it: it applies to the current "
                "shell"
            )
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return all names in the order of the groups."""
        return list(self.listed)

    def get_command(
        self,
        ctx: Any,
        name: str,
    ) -> Any:
        """Return the command with a name."""
        if name in self.listed and self.listed[name].function:
            return command(name, self.listed[name].function)
        return super().get_command(ctx, name)

    def resolve_command(
        self,
        ctx: Any,
        args: list[str],
    ) -> Any:
        """Return the command that the first argument names; refuse an unknown one with similar
        ones.
        """
        if args and args[0] in RENAMED:
            ctx.fail(f"{args[0]}: this command is now: {RENAMED[args[0]]}")
        if args and args[0] not in self.listed:
            similar = " or ".join(f"'{name}'" for name in get_close_matches(args[0], self.listed))
            hint = f" Did you mean {similar}?" if similar else ""
            ctx.fail(f"No such command '{args[0]}'.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(
        self,
        ctx: Any,
        formatter: Any,
    ) -> None:
        """Write the groups, each command with its purpose."""
        for title, group in self.groups.items():
            with formatter.section(title):
                formatter.write_dl([(name, listed.purpose) for name, listed in group.items()])


class StudyCommands(Commands):
    """The commands of `flexfem study`."""

    groups = {"Commands": STUDY}  # noqa: RUF012
    listed = STUDY


class Command(TyperCommand):
    """A command whose options of integers take several after one flag: --resolutions 4 6 8."""

    def parse_args(
        self,
        ctx: Any,
        args: list[str],
    ) -> list[str]:
        """Repeat the flag before every further number; name the replacements of old options."""
        flags = {flag for option in self.params for flag in option.opts}
        for arg in args:
            flag = arg.partition("=")[0]
            replacement = RENAMED_OPTIONS.get(flag, ("",))
            if flag not in flags and replacement[0] in flags:
                ctx.fail(f"{flag}: this option is now: {' with '.join(replacement)}")
        multiple = {flag for option in self.params if option.multiple for flag in option.opts}
        repeated = list[str]()
        for arg in args:
            if arg.isdigit() and len(repeated) > 1 and repeated[-2] in multiple:
                repeated.append(repeated[-2])
            repeated.append(arg)
        return super().parse_args(ctx, repeated)


app = typer.Typer(
    help=ABOUT,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    cls=Commands,
    context_settings={"help_option_names": ["--help", "-h"]},  # of all commands
)
study = typer.Typer(
    help=COMMANDS["study"].purpose,
    no_args_is_help=True,
    cls=StudyCommands,
)
app.add_typer(study, name="study")


@app.command()
def design(
    requirements: Annotated[
        Path,
        typer.Argument(
            help="Requirements, whose keys flexfem schema requirements explains.", metavar="FILE"
        ),
    ],
    output: OutputFolder = None,
    workers: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_WORKERS,
            help="Processes for finite elements.",
        ),
    ] = 1,
    scheduler: Annotated[str | None, typer.Option(help=ON_DASK)] = None,
    json: Json = False,
) -> None:
    """Find the dimensions that meet requirements best, checked by finite elements.

    The exit code is 1 if none meets them.
    """
    # before the import of numpy: threads change the last bits of results
    os.environ.update(ONE_THREAD)
    from flexfem.design.run import run_design
    from flexfem.design.timing import Timing

    began = time.monotonic()
    timing = Timing()
    with terminal.showing_progress("design", terminal.EVERY, timing.text) as say:
        found = run_design(requirements, output, workers, say, scheduler, timing=timing)
    if output is not None:
        from flexfem.plot.write import write_design_figures

        written = write_design_figures(found, output / f"{requirements.stem}-design.json")
        print(*map(str, written), sep="\n", file=sys.stderr)
    show(found, json)
    print(f"{time.monotonic() - began:.1f} s", file=sys.stderr)
    raise typer.Exit(0 if found.feasible and found.agreed else 1)


def command(name: str, function_name: str) -> Any:
    """Return the command of a function that `flexfem` offers."""
    function = getattr(flexfem, function_name)
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(name, cls=Command, help=description(function.__doc__))(_runner(name, function))
    return typer.main.get_command(single)


def _runner(name: str, function: Callable[..., Any]) -> Callable[..., None]:
    """Return a function that calls another one and shows its result.

    Its signature holds the options of the command.
    """
    options = [*options_of(function), made_parameter("json", Json, False)]
    writes = returns_results(function)
    if writes:  # other functions have an output of their own
        options.append(made_parameter("output", OutputOfResult, None))
        options.append(made_parameter("whole", All, False))

    def run(**given: Any) -> None:
        target = taken_file(name, given) if function.__module__ == OF_STUDIES else None
        if target is not None and name == "plot":
            _say_written(write_study(given["study"], target, given["partial"]))
            return
        answer = called(name, function, given)
        found = answer.found
        if found is None:  # of a server
            return
        if writes and given["output"] is not None:
            _write(answer, given)
        if target is not None and is_done(found):
            _say_written(write_study(given["study"], target))
        show(found, given["json"], given.get("whole", False))
        if getattr(found, "findings", None) or getattr(found, "failed", False):
            raise typer.Exit(1)  # of a check, of a study

    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    run.__annotations__ = {option.name: option.annotation for option in options}
    return run


def _write(answer: Answer, given: dict[str, Any]) -> None:
    """Write a result to the output that is stated; one that cannot be written is shown."""
    refused = lacking(answer.found, given["output"])
    if refused:
        show(answer.found, given["json"], given["whole"])
        raise BadInput(refused)
    _say_written(write(answer.found, given["output"], answer.stem))


def _say_written(paths: list[Path]) -> None:
    """Name the files that were written."""
    print(f"written: {', '.join(map(str, paths))}", file=sys.stderr)


def _print_version(requested: bool) -> None:
    if requested:
        print(f"flexfem {flexfem.__version__}")
        raise typer.Exit


VERSION = typer.Option(
    "--version", callback=_print_version, is_eager=True, help="Print the version."
)
OWN = typer.Option(
    "--with", metavar="FILE", help="Python file that registers formulas and materials."
)


@app.callback(help=ABOUT)
def _common(
    version: Annotated[bool, VERSION] = False, formulas: Annotated[Path | None, OWN] = None
) -> None:
    manifest()  # before the import of modules that compute: part of the versions of a study
    if formulas is not None:
        use_own(formulas)


class Ended(NamedTuple):
    """How a command ended: its exit code, and its error message if any."""

    code: int
    text: str


def main() -> None:
    """Run the command line; any error is one line on standard error."""
    terminal.open_streams()
    os.environ["PYTHONSAFEPATH"] = "1"  # child processes must not import from the current folder
    # matrices are small: waiting threads take up to twice the time
    os.environ.update(ONE_THREAD | os.environ)
    ended = Ended(130, "stopped")
    with terminal.plain_streams(), recording_inputs():
        with suppress(KeyboardInterrupt), terminal.stoppable() as stops:
            ended = _run()
        if stops:  # libraries may have replaced the exception
            notes = getattr(stops[0], "__notes__", ["stopped"])
            ended = Ended(stops[0].code, notes[0])
        if ended.text:
            print(f"flexfem: {ended.text}", file=sys.stderr)
    if ended.code:
        sys.exit(ended.code)


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


def _run() -> Ended:
    """Run the command; turn every error into an exit code and a line."""
    try:
        try:
            return _ended_by_typer()
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BadInput as refusal:
        return Ended(2, str(refusal))
    except ComputationFailed as failure:
        return Ended(1, str(failure))
    except BrokenPipeError:  # the reader, such as head, has ended
        terminal.discard(sys.stdout)
        return Ended(CLOSED_PIPE, "")
    except OSError as error:  # a full disk or a closed output: the buffer cannot be written either
        terminal.discard(sys.stdout)
        return Ended(1, terminal.reason_of(error))
    except Exception as error:  # unforeseen errors, those of libraries included
        if os.environ.get("FLEXFEM_TRACEBACK"):
            raise
        return Ended(1, terminal.reason_of(error))


def _ended_by_typer() -> Ended:
    """Run the command; return how typer ended it."""
    try:
        _check_environment()
        return Ended(int(app(prog_name="flexfem", standalone_mode=False) or 0), "")
    except UsageError as error:
        return Ended(2, _usage(error))
    except SystemExit as stop:
        if isinstance(stop.__context__, BrokenPipeError):  # libraries exit after it
            raise stop.__context__ from None
        raised = terminal.deepest(stop)
        of_typer = os.path.dirname(typer.__file__)
        if raised is not None and raised.tb_frame.f_code.co_filename.startswith(of_typer):
            return Ended(int(stop.code or 0), "")  # completion of a shell
        # raised by the user's own code: no command raises it
        return Ended(1, terminal.reason_of(stop))


def _usage(error: Any) -> str:
    """Return a usage error as one line; for a command without arguments show its help instead."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        return ""
    if hasattr(error.__cause__, "errors"):  # of pydantic, by which typer converts values
        error.message = _conversion_error(error.__cause__.errors()[0])
    message = " ".join(error.format_message().split()).removesuffix(".")
    hint = f" (see {error.ctx.command_path} --help)" if error.ctx is not None else ""
    return f"{message[:1].lower()}{message[1:]}{hint}"


def _conversion_error(details: Any) -> str:
    """Return the text of a value that cannot be converted, from the details of pydantic."""
    introductions = r"^(Value error, .* is not |Input should be )|, unable to .*"
    expected = re.sub(introductions, "", details["msg"])
    expected = re.sub(r"^(greater|less) than", r"a number \1 than", expected)
    return f"{details['input']}, expected {expected}"
