"""The command line, put together from its groups. Exit 0 done, 1 a check or a computation failed, 2 bad input, 128 + n
stopped by signal n, of which a closed pipe is one.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from flexfem import terminal as streams
from flexfem.cli import Commands
from flexfem.commands import (
    design,
    page,
    study,
    verification,
)
from flexfem.files.inputs import noted
from flexfem.refused import BadInput, ComputationFailed, SourcesChanged
from flexfem.sources import ONE_THREAD, manifest

USAGE_ERROR: Any = typer.BadParameter.__base__  # click's UsageError: typer has a click of its own, or the installed one
CLOSED_PIPE = 141  # 128 and the number of SIGPIPE, as programs end that do not take that signal
ABOUT = "Verification and design of planar flexure-hinge stages."
app = typer.Typer(help=ABOUT, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None, cls=Commands)
for group in (page, design, verification):
    app.add_typer(group.app)
app.add_typer(study.app, name="study")


def _print_version(wanted: bool) -> None:
    if wanted:
        from flexfem import __version__

        print(f"flexfem {__version__}")
        raise typer.Exit


@app.callback(help=ABOUT)
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    formulas: Annotated[
        Path | None,
        typer.Option("--with", metavar="FILE", help="Python file, run to register formulas and materials."),
    ] = None,
) -> None:
    manifest()  # before what computes is loaded
    if formulas is not None:
        from flexfem.own import use

        use(formulas)


def main() -> None:
    """Run the command line; whatever goes wrong is one line on standard error."""
    streams.open_streams()
    os.environ["PYTHONSAFEPATH"] = "1"  # no Python started from here looks into the current folder
    os.environ.update(ONE_THREAD | os.environ)  # matrices are small: threads that wait take up to twice the time
    code, text = 130, streams.Stopped.said
    with streams.plain_streams(), noted():
        with suppress(KeyboardInterrupt), streams.stoppable() as stops:
            code, text = _run()
        if stops:  # whatever libraries have made of it
            code, text = stops[0].code, stops[0].said
        if text:
            print(f"flexfem: {text}", file=sys.stderr)
    if code:
        sys.exit(code)


def _run() -> tuple[int, str]:
    """Exit code of the command, and what there is to say of it."""
    try:
        try:
            return int(app(prog_name="flexfem", standalone_mode=False) or 0), ""
        except SystemExit as stop:
            if isinstance(stop.__context__, BrokenPipeError):  # as libraries end then
                raise stop.__context__ from None
            raised = streams.deepest(stop)
            if raised is not None and raised.tb_frame.f_code.co_filename.startswith(os.path.dirname(typer.__file__)):
                return int(stop.code or 0), ""  # completion of a shell
            return 1, streams.reason_of(stop)  # of the user's own code: no command ends so
        except USAGE_ERROR as error:
            return 2, _usage(error)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BadInput as refusal:
        return 2, str(refusal)
    except (ComputationFailed, SourcesChanged) as failure:
        return 1, str(failure)
    except BrokenPipeError:  # the reader, such as head, has seen enough
        _silence()
        return CLOSED_PIPE, ""
    except OSError as error:  # a full disk, a closed output: what is still held cannot be written either
        _silence()
        return 1, streams.reason_of(error)
    except Exception as error:  # whatever nobody has foreseen, libraries' errors too, is one line and exit code 1
        if os.environ.get("FLEXFEM_TRACEBACK"):
            raise
        return 1, streams.reason_of(error)


def _usage(error: Any) -> str:
    """One line on an unknown option or command, a missing argument; a command without any shows its help instead."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        return ""
    said = " ".join(error.format_message().split()).removesuffix(".")
    help_of = f" (see {error.ctx.command_path} --help)" if error.ctx is not None else ""
    return f"{said[:1].lower()}{said[1:]}{help_of}"


def _silence() -> None:
    """Let what standard output still holds go nowhere."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
