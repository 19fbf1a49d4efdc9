"""The page of one mechanism in a notebook or, from a script, in a browser."""

from __future__ import annotations

import os
import sys
import tempfile
import webbrowser
from datetime import UTC, datetime
from functools import partial
from html import escape
from pathlib import Path

from markupsafe import Markup

from flexfem.files.provenance import assumptions_said
from flexfem.files.toml import PathLike
from flexfem.importing.drawings import load
from flexfem.mechanism.mechanism import Mechanism
from flexfem.page.handle import handled_drawing
from flexfem.page.section import html_of, parts, section, sentence, shown_figure
from flexfem.plot.plate import drawing_figure
from flexfem.questions.handling import quick_stiffness
from flexfem.questions.stiffness import Stiffness
from flexfem.results import versions

HEIGHT = 720  # pixels of the page in a notebook


class Shown:
    """A page: `html` is its text, and a notebook shows it."""

    def __init__(self, html: str) -> None:
        self.html = html

    def _repr_html_(self) -> str:
        content = escape(self.html, quote=True)
        style = f"width: 100%; height: {HEIGHT}px; border: 0"
        return f'<iframe style="{style}" sandbox="allow-scripts" srcdoc="{content}"></iframe>'


def show(mechanism: Mechanism | PathLike, at_rest: Stiffness | None = None) -> Shown:
    """Show a mechanism: a drawing that a hand moves, and its stiffness by the analytic model.

    In a notebook the last expression of a cell is shown inline. Elsewhere the page is written to a
    temporary file, which the browser opens.

    Parameters
    ----------
    mechanism : Mechanism or path
        What `flexfem.load` returns, or its file.
    at_rest : Stiffness, optional
        The answer of `flexfem.stiffness`, which the page then shows. Its ranges at finite
        displacement end the motion; without it a hinge that yields by linear theory does.

    Returns
    -------
    Shown
        Its attribute `html` is the text of the page.

    Raises
    ------
    BadInput
        Like `flexfem.load` and `flexfem.stiffness`.
    """
    subject = load(mechanism) if isinstance(mechanism, str | os.PathLike) else mechanism
    shown = Shown(_page(subject, at_rest))
    if not _in_notebook():
        _open(shown.html)
    return shown


def _page(mechanism: Mechanism, at_rest: Stiffness | None) -> str:
    """Return the text of the page."""
    answer = _quick_answer(mechanism) if at_rest is None else at_rest
    draw = partial(drawing_figure, mechanism, small=True)
    still = shown_figure("drawing", draw, f"Drawing to scale of {mechanism.name}")
    moved = handled_drawing(mechanism, at_rest)
    numbers = Markup() if answer is None else parts.answered(answer)
    kind = mechanism.kind.removesuffix(" file")
    return html_of(
        [section(kind, f"The {kind}", moved, still, numbers)],
        title=mechanism.name,
        subtitle=str(mechanism.origin),
        assumptions="" if answer is None else _doubts(answer),
        command="flexfem.show(...)",
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=versions(),
    )


def _quick_answer(mechanism: Mechanism) -> Stiffness | None:
    """Return the stiffness by the analytic model without ranges, None for a plate without hinges."""
    if not mechanism.layout.joints:
        return None
    return quick_stiffness(mechanism, models="analytic")


def _doubts(answer: Stiffness) -> str:
    """Return the counts of numbers that are assumed, and of those without a source."""
    about = answer.about
    counts = assumptions_said(about.assumed, about.not_stated, "of the numbers of this page ")
    return sentence("; ".join(counts))


def _in_notebook() -> bool:
    """Whether Python runs in the kernel of a notebook."""
    interactive = sys.modules.get("IPython")
    running = interactive and interactive.get_ipython()
    return getattr(running, "kernel", None) is not None


def _open(html: str) -> None:
    """Open a page in the browser; its file remains, since the browser reads it later."""
    with tempfile.NamedTemporaryFile(
        prefix="flexfem-",
        suffix=".html",
        delete=False,
    ) as file:
        file.write(html.encode(errors="backslashreplace"))
    webbrowser.open(Path(file.name).as_uri())
