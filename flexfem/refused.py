"""The ways flexfem refuses: what the user gave is wrong, the computation cannot be trusted, or its code has changed."""

from __future__ import annotations

from typing import Any


class BadInput(Exception):  # noqa: N818  the exit code says error, the name says whose
    """A file, key or option that cannot be used; its text is one line, shown as it is, and the exit code is 2.

    reason : the text without file and line, where they stand in front.   located : whether they do.
    """

    __module__ = "flexfem"  # where users find it
    located = False

    def __init__(self, text: str, place: str = "") -> None:
        super().__init__(f"{place}: {text}" if place else text)
        self.reason, self.located = text, bool(place)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, str(self)[: -len(self.reason) - 2] if self.located else "")


class ComputationFailed(Exception):  # noqa: N818
    """A mesh or a solution that fails its own checks; its text is one line, shown as it is, and the exit code is 1."""


class SourcesChanged(Exception):  # noqa: N818
    """flexfem's own sources were edited under a command; its text is one line, and the exit code is 1."""
