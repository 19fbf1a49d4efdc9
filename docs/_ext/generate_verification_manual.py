"""The pages on published problems and on verified mechanisms with their figures, made at every
build: some 30 s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
MANUAL = DOCS / "verification-manual.md"  # neither page is kept by git
MECHANISMS = DOCS / "verified-mechanisms.md"


def write() -> None:
    """Solve the problems that need no other program, and write both pages."""
    from tests.validation import manual
    from tests.validation.problem import PROBLEMS

    mechanisms = [name for name, problem in PROBLEMS.items() if problem.mechanism]
    others = [name for name in PROBLEMS if name not in mechanisms]
    manual.write(MANUAL, others, manual.MANUAL, "reference")
    manual.write(MECHANISMS, mechanisms, manual.MECHANISMS, "reference")


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write())
    return {"parallel_read_safe": True}
