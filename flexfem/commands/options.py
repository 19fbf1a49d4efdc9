"""Arguments and options of a command, made from the signature and docstring of its function.

A parameter `mechanism: Mechanism` becomes the argument FILE; parameters with a default, and the
fields of named tuples, become options, with their docstrings as help.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, get_origin, get_type_hints

import typer

import flexfem
from flexfem.units import FORCES, POSES, UNITS, in_unit

PYTHON_ONLY = ("executor", "law", "progress")  # parameters without an option
SUBJECTS = ("mechanism", "stage")  # names of the parameter that is what a question is about
ABOUT_SUBJECT = (
    "Mechanism file, whose keys flexfem schema mechanism explains, a stage file, or a drawing."
)
TYPES: dict[str, Any] = {  # of parameters, where typer cannot use the annotation
    **dict.fromkeys(SUBJECTS, Path),
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
KINDS_IN_WORDS = {"str": "<text>", "int": "<number>", "float": "<number>"}  # of values, in help
IN_EVERY_HELP = ("thickness", "material")  # options of drawings; `import` alone lists them all
IMPORT = "import_drawing"

Function = Callable[..., Any]


def options_of(function: Function) -> Iterator[inspect.Parameter]:
    """Yield the arguments and options of a function, as parameters with annotations for typer."""
    hints = get_type_hints(function)
    texts = documented_parameters(function.__doc__) | dict.fromkeys(SUBJECTS, ABOUT_SUBJECT)
    for name, parameter in inspect.signature(function).parameters.items():
        if name in PYTHON_ONLY:
            continue
        hint = hints[name]
        if is_record(hint):
            yield from _options_of_record(hint, function)
        elif name in SUBJECTS:
            argument = typer.Argument(help=texts[name], metavar="FILE")
            yield made_parameter(name, Annotated[Path, argument], parameter.default)
            yield from _options_of_record(flexfem.Reading, function)
        else:
            yield _of_parameter(function, parameter, hint, texts[name])


def is_record(hint: Any) -> bool:
    """Return whether an annotation is a named tuple, whose fields are options."""
    return hasattr(hint, "_fields")


def _of_parameter(
    function: Function, parameter: inspect.Parameter, hint: Any, text: str
) -> inspect.Parameter:
    """Return the argument or option of one parameter with its help."""
    name = parameter.name
    several = parameter.kind is parameter.VAR_POSITIONAL
    if several:
        kind: Any = list[Path] if "PathLike" in str(hint) else list[hint]
    elif "PathLike" in str(hint):
        kind = TYPES.get(name, Path)
    else:
        kind = TYPES.get(name, hint)
    if name == "output":  # a folder or a file, which the function checks
        flag = "--to" if function.__name__ == IMPORT else "--output"
        annotation: Any = Annotated[kind, typer.Option(flag, "-o", help=text)]
    elif parameter.kind is parameter.KEYWORD_ONLY:
        annotation = _option(name, kind, text)
    else:
        metavar = f"{name.upper()}..." if get_origin(kind) is list else name.upper()
        annotation = Annotated[kind, typer.Argument(help=text, metavar=metavar)]
    return made_parameter(name, annotation, parameter.default)


def _options_of_record(kind: Any, function: Function) -> Iterator[inspect.Parameter]:
    """Yield the fields of a named tuple as options, without those that the function has itself."""
    texts = documented_parameters(kind.__doc__)
    own = inspect.signature(function).parameters
    imports = function.__name__ == IMPORT
    for field, annotation in get_type_hints(kind).items():
        if field in own:
            continue
        hidden = kind is flexfem.Reading and field not in IN_EVERY_HELP and not imports
        flags = ("--output",) if field == "output_at" and imports else ()
        option = _option(field, annotation, texts[field], *flags, hidden=hidden)
        yield made_parameter(field, option, kind._field_defaults[field])


def _option(
    name: str,
    hint: Any,
    text: str,
    *flags: str,
    hidden: bool = False,
) -> Any:
    """Return the annotation of an option; numbers of `MEASURED` options may state their units."""
    flags = (f"--{name.replace('_', '-')}", *flags)
    count = str(hint).count("float")
    if not count or name not in MEASURED:
        plain = typer.Option(*flags, help=text, hidden=hidden, metavar=_in_words(hint))
        return Annotated[hint, plain]
    units = MEASURED[name][:count]
    is_read_by_function = "str" in str(hint)  # texts with units of other quantities

    def numbers(given: Any) -> Any:
        if given is None:
            return None
        texts = [given] if count == 1 else given
        try:
            found = [in_unit(*each) for each in zip(texts, units, strict=True)]
        except ValueError as error:
            if is_read_by_function:
                return given
            raise typer.BadParameter(str(error)) from None
        return found[0] if count == 1 else tuple(found)

    kind: Any = str if count == 1 else tuple[(str,) * count]  # type: ignore[misc]
    metavar = ", ".join(unit.plain for unit in units)
    option = typer.Option(
        *flags,
        help=text,
        hidden=hidden,
        callback=numbers,
        metavar=metavar,
    )
    return Annotated[kind, option]


def _in_words(hint: Any) -> str | None:
    """Return the kind of value of an option as help shows it; None for the usual name."""
    kinds = re.findall(r"\b(?:str|int|float)\b", str(hint))
    return KINDS_IN_WORDS[kinds[0]] if kinds else None


def made_parameter(
    name: str,
    annotation: Any,
    default: Any,
) -> inspect.Parameter:
    """Return a keyword parameter of the function that typer calls."""
    kind = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(name, kind, annotation=annotation, default=default)


def documented_parameters(doc: str | None) -> dict[str, str]:
    """Return the parameters of a numpydoc docstring with their texts."""
    text = inspect.cleandoc(doc or "")
    found = re.search(
        r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+$|\Z)", text, re.DOTALL | re.MULTILINE
    )
    section = found[1] if found else ""
    parts = re.split(r"^\*?(\w+) : [^\n]*$", section, flags=re.MULTILINE)
    named = zip(parts[1::2], parts[2::2], strict=True)
    return {name: " ".join(text.split()) for name, text in named}


def description(doc: str | None) -> str:
    """Return the text of a docstring before its first section."""
    text = inspect.cleandoc(doc or "")
    return re.split(r"^\w[^\n]*\n-+$", text, maxsplit=1, flags=re.MULTILINE)[0].strip()
