"""Exceptions: input that cannot be used, and a computation that cannot be trusted; how their texts
show a value.
"""

from __future__ import annotations

from reprlib import Repr
from typing import Any

_LONGEST = 80  # characters of a value, and members of a list, in a message
_SHORTENED = Repr()
_SHORTENED.maxstring = _SHORTENED.maxother = _SHORTENED.maxlong = _SHORTENED.maxlist = (
    _SHORTENED.maxtuple
) = _LONGEST


def printed(value: Any) -> str:
    """Return the `repr` of a value of the caller, short; objects whose `repr` fails, and lists in
    themselves, too.
    """
    return _SHORTENED.repr(value)


def text_of(error: BaseException) -> str:
    """Return the text of an exception of the caller, whose class may fail to make one."""
    try:
        return str(error)
    except (Exception, SystemExit):
        return "an exception without a printable text"


def line_of(error: BaseException) -> str:
    """Return the text of an exception in one line, its white space as single blanks."""
    return " ".join(text_of(error).split())


class BadInput(Exception):  # noqa: N818  the name says whose error it is
    """A file, key or option that cannot be used; its text is one line, shown unchanged, and the
    exit code is 2.

    reason : the text without its leading file and line.   located : whether the text has them.
    """

    __module__ = "flexfem"  # the public name in tracebacks and documentation
    has_place = False

    def __init__(
        self,
        text: str,
        place: str = "",
    ) -> None:
        super().__init__(f"{place}: {text}" if place else text)
        self.reason, self.has_place = text, bool(place)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (
            self.reason,
            str(self)[: -len(self.reason) - 2] if self.has_place else "",
        )


class ComputationFailed(Exception):  # noqa: N818
    """A mesh or a solution that fails its own checks; its text is one line, shown unchanged, and
    the exit code is 1.
    """
