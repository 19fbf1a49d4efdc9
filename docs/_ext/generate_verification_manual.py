"""The page docs/verification-manual.md and its figure, made at every build by tests/validation: some 15 s."""

from __future__ import annotations

from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "verification-manual.md"  # not kept by git


def write() -> None:
    """Solve the problems that need no other program, and write the page."""
    from tests.validation.manual import write as write_manual
    from tests.validation.problem import PROBLEMS

    write_manual(PAGE, list(PROBLEMS), "reference/verification-elastica.png")


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write())
    return {"parallel_read_safe": True}
