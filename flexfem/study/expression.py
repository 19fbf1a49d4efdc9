"""Arithmetic on the columns of a study, read from text: numbers, names, operators and a few functions, no more."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from functools import lru_cache, reduce
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array

LONGEST = 400  # characters
DEEPEST = 50  # operations one inside the other
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|`(?P<quoted>[^`]+)`"
    r"|(?P<name>[A-Za-z_]\w*(?:\.\w+|\[\d+\])*)|(?P<sign>\*\*|[-+*/(),]))\s*"
)
_OPERATORS: dict[type[Any], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
_ONE: dict[str, Callable[..., Any]] = {"abs": np.abs, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "log10": np.log10}
_SEVERAL: dict[str, Callable[..., Any]] = {"min": np.minimum, "max": np.maximum}
_ALLOWED = f"numbers, names (others in `backticks`), + - * / **, brackets, {', '.join((*_ONE, *_SEVERAL))}"


class Parsed(NamedTuple):
    """The tree of an expression, and by name what stands for it there."""

    tree: ast.expr
    names: Mapping[str, str]


def names_in(text: str) -> tuple[str, ...]:
    """Names that an expression uses, each once. Raises ValueError, saying what was expected, where it is none."""
    return tuple(_parsed(text).names)


def value_of(text: str, values: Mapping[str, Array]) -> Array:
    """Value of an expression, in the shape of the named values; not finite where it has none.

    Notes
    -----
    The text is parsed, never run: the tree is walked, and `names_in` has refused what is not arithmetic.
    """
    tree, names = _parsed(text)
    with np.errstate(all="ignore"):
        found = _value(tree, {place: np.asarray(values[name], dtype=np.float64) for name, place in names.items()})
    return np.asarray(found, dtype=np.float64)


@lru_cache(maxsize=256)
def _parsed(text: str) -> Parsed:
    if len(text) > LONGEST:
        raise ValueError(f"at most {LONGEST} characters, not {len(text)}")
    names, pieces, end = dict[str, str](), list[str](), 0
    while end < len(text):
        found = _TOKEN.match(text, end)
        if found is None:
            raise ValueError(_ALLOWED)
        end = found.end()
        pieces.append(_piece(found, names, text[end : end + 1] == "("))
    try:
        tree = ast.parse(" ".join(pieces), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise ValueError(_ALLOWED) from None
    _require_arithmetic(tree, set(names.values()), DEEPEST)
    if not names:
        raise ValueError("the name of a column or key, not numbers alone")
    return Parsed(tree, names)


def _piece(found: re.Match[str], names: dict[str, str], called: bool) -> str:
    """A token as Python: numbers as floats, so that no power takes for ever, and a short name for each name."""
    if found["number"]:
        return repr(float(found["number"]))
    if found["sign"] or (called and found["name"] in (*_ONE, *_SEVERAL)):
        return found["sign"] or found["name"]
    return names.setdefault(found["quoted"] or found["name"], f"_{len(names)}")


def _require_arithmetic(tree: ast.AST, names: set[str], depth: int) -> None:
    """Raise ValueError where a node is none of those that `_value` knows, or lies too deep."""
    if depth == 0:
        raise ValueError(f"at most {DEEPEST} operations one inside the other")
    match tree:
        case ast.Constant(value=float()):
            inner: list[ast.expr] = []
        case ast.Name(id=name) if name in names:
            inner = []
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            inner = [operand]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            inner = [left, right]
        case ast.Call(func=ast.Name(id=name), args=[_], keywords=[]) if name in _ONE:
            inner = tree.args
        case ast.Call(func=ast.Name(id=name), args=[_, _, *_], keywords=[]) if name in _SEVERAL:
            inner = tree.args
        case _:
            raise ValueError(_ALLOWED)
    for node in inner:
        _require_arithmetic(node, names, depth - 1)


def _value(tree: ast.AST, values: Mapping[str, Array]) -> Any:
    match tree:
        case ast.Constant(value=float(number)):
            return np.float64(number)
        case ast.Name(id=name):
            return values[name]
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_value(operand, values))
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, values), _value(right, values))
        case ast.Call(func=ast.Name(id=name), args=[*given]):
            each = [_value(one, values) for one in given]
            return _ONE[name](*each) if name in _ONE else reduce(_SEVERAL[name], each)
    raise AssertionError(tree)
