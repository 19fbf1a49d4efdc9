"""Numbers of questions about one mechanism, by their paths in the JSON output of a command."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np

import flexfem
from flexfem.arrays import Array
from flexfem.files.refusals import suggestion
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput

# path of a mode where some are out of the plane; a model of the plane has the others, by number
IN_THE_PLANE = re.compile(r"(?P<before>.*\.)\d+_in_the_plane(?P<after>\..*)")


class NoSuchNumber(BadInput):
    """A study requests a number that no result about the mechanism has."""


class _Banded(NamedTuple):
    """A number and the half-width of its band, nan without one."""

    value: float
    band: float


def asked_numbers(
    mechanism: Mechanism,
    paths: Sequence[str],
    settings: Mapping[str, Any],
) -> Array:
    """Return the numbers at paths and their bands, (paths, 2); nan without a band.

    Parameters
    ----------
    paths : each begins with the name of its question, such as `drift.pose.uniform.analytic.x`.
    settings : options by name; a question takes those that it has.

    Raises
    ------
    NoSuchNumber : a path denotes no number.
    BadInput, ComputationFailed : a question refuses the mechanism, or fails.
    """
    numbers = dict[str, _Banded]()
    for name in dict.fromkeys(path.split(".")[0] for path in paths):
        question = getattr(flexfem, name)
        found = question(mechanism, **_options_of(question, mechanism, settings))
        in_plane = Counter[tuple[str, str]]()
        for entry in found.entries():
            number = _Banded(entry.value, entry.band)
            numbers[f"{name}.{entry.path}"] = number
            mode = IN_THE_PLANE.fullmatch(entry.path)
            if mode is not None:
                in_plane[mode["before"], mode["after"]] += 1
                count = in_plane[mode["before"], mode["after"]]
                numbers.setdefault(f"{name}.{mode['before']}{count}{mode['after']}", number)
    for path in paths:
        if path not in numbers:
            close = suggestion(path, numbers) or f", such as {next(iter(numbers))}"
            raise NoSuchNumber(f"ask: no number {path} of this stage and model{close}")
    return np.array([numbers[path] for path in paths]).reshape(-1, 2)


def _options_of(
    question: Callable[..., Any], mechanism: Mechanism, settings: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the settings that a question takes about a mechanism."""
    accepted = set(inspect.signature(question).parameters)
    own = mechanism.answering(question.__name__)
    if own is not None:
        accepted &= set(inspect.signature(own).parameters)
    options = {name: value for name, value in settings.items() if name in accepted}
    models = get_args(get_type_hints(question).get("models"))
    if models and options.get("models", models[0]) not in models:
        options["models"] = "both"  # the question has no finite elements alone
    return options
