"""Arithmetic expressions of names: their names, and their values.

Angles in degrees, as in files.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache, reduce
from graphlib import CycleError, TopologicalSorter
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array
from flexfem.files.refusals import nearest, refusal, shown
from flexfem.units import without_unit

MOST_PARAMETERS = 300
LONGEST_NAME = 60  # characters, as of all words in files
LARGEST = 1e300  # absolute value of a parameter
LONGEST = 400  # characters of an expression, which also limits the depth of nesting
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
    "sin": lambda angle: np.sin(np.deg2rad(angle)),
    "cos": lambda angle: np.cos(np.deg2rad(angle)),
    "tan": lambda angle: np.tan(np.deg2rad(angle)),
    "atan": lambda ratio: np.rad2deg(np.arctan(ratio)),
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
}
_OPERATIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
_WORD = re.compile(
    rf"(?P<function>({'|'.join(_FUNCTIONS)})(?=\s*\())|`(?P<quoted>[^`]+)`"
    r"|(?<![\w.])(?P<name>[A-Za-z_]\w*(?:\.\w+|\[\d+\])*)|(?P<other>[^-+*/(),.\w\s])"
)
_ALLOWED = f"numbers, names (others in `backticks`), + - * / **, brackets, {', '.join(_FUNCTIONS)}"


class Scaled(str):
    """An expression whose value is multiplied by a factor: its unit is not that of its key."""

    factor: float

    def __new__(
        cls,
        text: str,
        factor: float,
    ) -> Scaled:
        """Return an expression with a factor."""
        found = super().__new__(cls, text)
        found.factor = factor
        return found

    @property
    def product(self) -> str:
        """The expression times the factor, for a text that `names_in` accepts: brackets may not
        close an outer one.
        """
        return f"({self}) * {self.factor!r}"


class NumberKind(Protocol):
    """What a number of a file is: its unit and its limits, as `quantities.Limits` has them."""

    @property
    def factor(self) -> float:
        """Inside units per unit of the file."""

    def expected(self, value: float) -> str | None:
        """Return what is expected of a number in the unit of the file, None of a valid one."""

    def refuses(self, values: Array) -> AnyArray:
        """Return which values (...), in the unit of the file, are not valid."""


class Evaluated(float):
    """The value of an expression in inside units, with its text and the kind of the number."""

    text: str
    kind: NumberKind

    def __new__(
        cls,
        value: float,
        text: str,
        kind: NumberKind,
    ) -> Evaluated:
        """Return a number with a text."""
        found = super().__new__(cls, value)
        found.text = text
        found.kind = kind
        return found

    def __getnewargs__(self) -> tuple[float, str, NumberKind]:  # type: ignore[override]
        """Return the arguments of a copy."""
        return float(self), self.text, self.kind


def text_of(value: float) -> str:
    """Return the text of an expression, "" of a number that is none."""
    return value.text if isinstance(value, Evaluated) else ""


def names_in(text: str) -> tuple[str, ...]:
    """Return the names in an expression, each once.

    Raises ValueError, which says what was expected, for other text.
    """
    return _parsed(text)[1]


def value_of(text: str, values: Mapping[str, ArrayLike]) -> Array:
    """Return the value of an expression, in the shape of the named values.

    It is not finite where the expression is not defined.
    """
    tree, names = _parsed(text)
    with np.errstate(all="ignore"):
        known = {f"_{k}": np.asarray(values[name], np.float64) for k, name in enumerate(names)}
        return np.asarray(_value(tree, known), dtype=np.float64)


@lru_cache(maxsize=256)
def _parsed(text: str) -> tuple[ast.expr, tuple[str, ...]]:
    """Return the syntax tree of an arithmetic expression, and its names, which the tree holds as
    `_0`, `_1`.
    """
    if len(text) > LONGEST:
        raise ValueError(f"at most {LONGEST} characters, not {len(text)}")
    names = list[str]()

    def numbered(word: re.Match[str]) -> str:
        name = word["quoted"] or word["name"]
        if word["other"]:
            raise ValueError(_ALLOWED)
        if name and name not in names:
            names.append(name)
        return f" _{names.index(name)} " if name else word["function"]

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", SyntaxWarning)  # of numbers that run into words
            tree = ast.parse(" ".join(_WORD.sub(numbered, text).split()), mode="eval").body
        with np.errstate(all="ignore"):
            _value(tree, {f"_{k}": np.ones(1) for k in range(len(names))})
    except (SyntaxError, MemoryError, RecursionError, KeyError, TypeError, OverflowError):
        raise ValueError(_ALLOWED) from None
    return tree, tuple(names)


def _value(node: ast.expr, known: Mapping[str, Array]) -> Any:
    """Return the value of a tree.

    Numbers are of numpy, whose powers neither raise nor take for ever.
    """
    match node:
        case ast.Constant(value=float() | int() as number):
            return np.float64(number)
        case ast.Name(id=name):
            return known[name]
        case ast.UnaryOp(op=operator, operand=operand):
            return _OPERATIONS[type(operator)](_value(operand, known))
        case ast.BinOp(left=left, op=operator, right=right):
            return _OPERATIONS[type(operator)](_value(left, known), _value(right, known))
        case ast.Call(func=ast.Name(id=name), args=[_, *others] as arguments, keywords=[]) if bool(
            others
        ) == (name in ("min", "max")):
            return _FUNCTIONS[name](*(_value(argument, known) for argument in arguments))
    raise ValueError(_ALLOWED)


def require_names(text: str, known: Mapping[str, Any], *at: str) -> tuple[str, ...]:
    """Return the names in an expression.

    Refuses, at a key path, other text and names that are not known.
    """
    try:
        names = names_in(text)
    except ValueError as error:
        raise refusal(f"an expression: {error}", *at) from None
    for name in names:
        if name not in known:
            near = nearest(name, known) or "; there are none"
            raise refusal(f"names of parameters, not {shown(name)}{near}", *at)
    return names


def parameter_values(stated: Mapping[str, Any]) -> dict[str, float]:
    """Return the values of parameters, in file units, by their names without units.

    Each may use all others. Refuses, at its key path, what is no number, an unknown name, a cycle,
    or a value that is not finite.
    """
    keys = _parameter_names(stated)
    given = {name: getattr(stated[key], "text", stated[key]) for name, key in keys.items()}
    values = dict[str, float]()
    for name in _order(given, keys):
        value = given[name]
        if isinstance(value, str):
            value = float(value_of(value, values))
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not abs(value) < LARGEST:
            expected = "a finite number, or an expression that has one"
            raise refusal(expected, "parameters", keys[name])
        values[name] = float(value)
    return values


def _parameter_names(stated: Mapping[str, Any]) -> dict[str, str]:
    """Return the keys of parameters by their names without units.

    Refuses keys that are no names.
    """
    if len(stated) > MOST_PARAMETERS:
        raise refusal(f"at most {MOST_PARAMETERS} parameters, not {len(stated)}", "parameters")
    keys = dict[str, str]()
    for key in stated:
        if not isinstance(key, str):
            raise refusal("names of parameters in quotes", "parameters")
        name = without_unit(key)
        if name in keys:
            expected = f"a name that differs from {keys[name]} also without its unit"
            raise refusal(expected, "parameters", key)
        if not (key.isidentifier() and key.isascii()) or len(key) > LONGEST_NAME:
            expected = f"a name of at most {LONGEST_NAME} letters, digits and _, a letter first"
            raise refusal(expected, "parameters", key)
        keys[name] = key
    return keys


def _order(given: Mapping[str, Any], keys: Mapping[str, str]) -> list[str]:
    """Return the names of parameters, each after those that it uses. Refuses a cycle."""
    uses = dict[str, tuple[str, ...]]()
    for name, value in given.items():
        text = value if isinstance(value, str) else None
        uses[name] = () if text is None else require_names(text, keys, "parameters", keys[name])
    try:
        return [*TopologicalSorter(uses).static_order()]
    except CycleError as error:
        cycle = error.args[1][:0:-1]  # every name uses the next one
        first = min(cycle, key=[*keys].index)
        start = cycle.index(first)
        said = " = ".join([*cycle[start:], *cycle[: start + 1]])
        expected = f"a value that does not depend on itself: {said}"
        raise refusal(expected, "parameters", keys[first]) from None
