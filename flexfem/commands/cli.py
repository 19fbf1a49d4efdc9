"""The command line, put together from its groups. Exit 0 done, 1 a check or a computation failed, 2 bad input, 128 + n
stopped by signal n.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from flexfem.commands import drive, experiment, heat, life, modes, part, stage, streams, study, validation, verification
from flexfem.refused import BadInput, ComputationFailed, SourcesChanged
from flexfem.sources import manifest

USAGE_ERROR: Any = typer.BadParameter.__base__  # click's UsageError: typer has a click of its own, or the installed one
ABOUT = "Verification and design of planar flexure-hinge stages."
app = typer.Typer(
    help=ABOUT, no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
)
for group in (part, stage, drive, heat, life, modes, experiment, verification, validation):
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
    with streams.stoppable() as signals, streams.plain_streams():
        code = _run()
    if signals:
        code = 128 + signals[0]
    if code:
        sys.exit(code)


def _run() -> int:
    """Exit code of the command."""
    try:
        try:
            return int(app(prog_name="flexfem", standalone_mode=False) or 0)
        except SystemExit as stop:
            return int(stop.code or 0)
        except USAGE_ERROR as error:
            return _say_usage(error)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BadInput as refusal:
        return _say(str(refusal), 2)
    except (ComputationFailed, SourcesChanged) as failure:
        return _say(str(failure), 1)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader, such as head, has seen enough
        return _silence(1)
    except OSError as error:  # a full disk, a closed output: what is still held cannot be written either
        return _silence(_say(streams.reason_of(error), 1))
    except Exception as error:  # whatever nobody has foreseen, libraries' errors too, is one line and exit code 1
        if os.environ.get("FLEXFEM_TRACEBACK"):
            raise
        return _say(streams.reason_of(error), 1)
    return 0


def _say_usage(error: Any) -> int:
    """One line on an unknown option or command, a missing argument; for a command without any, its help."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        return 2
    said = " ".join(error.format_message().split()).removesuffix(".")
    help_of = f" (see {error.ctx.command_path} --help)" if error.ctx is not None else ""
    return _say(f"{said[:1].lower()}{said[1:]}{help_of}", 2)


def _silence(code: int) -> int:
    """Let what standard output still holds go nowhere."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _say(text: str, code: int) -> int:
    print(f"flexfem: {text}", file=sys.stderr)
    return code
