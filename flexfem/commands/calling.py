"""What a command does: load its files, call its function, and write the result."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from types import UnionType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import flexfem
from flexfem import terminal
from flexfem.commands.catalogue import STUDY
from flexfem.commands.options import MEASURED, PYTHON_ONLY, SUBJECTS, is_record
from flexfem.commands.written import check_ending
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, POSES

POINT = r"[-+\d.e ]+,[-+\d.e ]+"  # X,Y of the output of a drawing


class Answer(NamedTuple):
    """What the function of a command returned, and the stem of the files that it is written to."""

    found: Any
    stem: str


class _Call(NamedTuple):
    """Arguments of a function, its mechanism if it has one, and the stem of its files."""

    positional: list[Any]
    named: dict[str, Any]
    stem: str


def called(
    name: str,
    function: Callable[..., Any],
    given: dict[str, Any],
) -> Answer:
    """Call the function of a command with the options as given."""
    call = _arguments(name, function, given)
    hints = get_type_hints(function)
    _check_ending(function, call, given)
    if "progress" not in hints:
        return Answer(function(*call.positional, **call.named), call.stem)
    with _progress_of(name) as say:
        found = function(*call.positional, **call.named, progress=say)
    return Answer(found, call.stem)


def _check_ending(
    function: Callable[..., Any],
    call: _Call,
    given: dict[str, Any],
) -> None:
    """Refuse the name of a file that the result of a question about a mechanism cannot give."""
    from flexfem.questions.setup import kind_of_answer

    if not returns_results(function):
        return
    subjects = [call.named[key] for key in SUBJECTS if key in call.named]
    kind = get_type_hints(function)["return"]
    check_ending(given.get("output"), kind_of_answer(function, subjects[0]) if subjects else kind)


def returns_results(function: Callable[..., Any]) -> bool:
    """Return whether a function returns a result, whose files `--output` names."""
    kind = get_type_hints(function)["return"]
    kinds = get_args(kind) if get_origin(kind) is UnionType else (kind,)
    return all(hasattr(each, "to_csv") for each in kinds)


def _progress_of(name: str) -> AbstractContextManager[Any]:
    if name in STUDY:
        return terminal.showing_progress("study", terminal.EVERY)
    return terminal.showing_progress(name)


def _arguments(
    name: str,
    function: Callable[..., Any],
    given: dict[str, Any],
) -> _Call:
    """Return the arguments of a function from the options of its command."""
    hints = get_type_hints(function)
    call = _Call([], {}, name)
    subject: Any = None
    for key, parameter in inspect.signature(function).parameters.items():
        if key in PYTHON_ONLY:
            continue
        if key in SUBJECTS:
            path = given[key]
            subject = _loaded(path, _record(flexfem.Reading, function, given))
            call.named[key] = subject
            call = call._replace(stem=f"{path.stem}-{name}")
        elif is_record(hints[key]):
            call.named[key] = _record(hints[key], function, given)
        elif parameter.kind is parameter.VAR_POSITIONAL:
            call.positional.extend(given[key])
        else:
            value = given[key]
            call.named[key] = parameter.default if value == [] else value
            if subject is not None and value not in (None, parameter.default):
                _check_size(key, value, subject)
    return call


def _loaded(path: Path, reading: Any) -> Any:
    """Load a mechanism; say what was recognised in a drawing."""
    from flexfem.importing.drawings import imported, is_drawing

    if not is_drawing(path):
        return flexfem.load(path, reading)
    report = imported(path, reading)
    warnings = [f"warning: {text}" for text in report.warnings]
    print(report.summary, *warnings, sep="\n", file=sys.stderr)
    return report.mechanism


def _record(
    kind: Any,
    function: Callable[..., Any],
    given: dict[str, Any],
) -> Any:
    """Return a named tuple of options.

    An --output X,Y is the point of the output of a drawing, as of import.
    """
    own = inspect.signature(function).parameters
    fields = {field: given[field] for field in kind._fields if field not in own}
    if kind is flexfem.Reading and re.fullmatch(POINT, str(given.get("output"))):
        fields["output_at"] = str(given["output"])
        given["output"] = None
    return kind(**fields)


def _check_size(
    name: str,
    motion: Any,
    mechanism: Any,
) -> None:
    """Refuse a motion beyond the size of a mechanism, which is likely meant in another unit."""
    import numpy as np

    from flexfem.mechanism.plate import extent, plate_polygon

    if MEASURED.get(name) is not POSES or isinstance(motion, str):
        return
    size = extent(plate_polygon(mechanism.layout))
    kind = mechanism.kind.removesuffix(" file")
    length = (size, f", the size of the {kind}", "um for micrometres")
    limits = (length, length, (1.0, "", "mrad for milliradians"))
    components = zip(np.atleast_1d(motion), limits, POSES, DIRECTIONS, strict=False)
    for number, (most, reason, unit), own, direction in components:
        if abs(number) > most:
            where = name if np.isscalar(motion) else f"{name} {direction}"
            expected = f"expected at most {most:.3g} {own}{reason}; write {number:g}{unit}"
            raise BadInput(f"{where} = {number:g} {own}, {expected}")
