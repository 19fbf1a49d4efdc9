"""The figure of a result as an element of a notebook."""

from __future__ import annotations

import base64
from html import escape
from typing import Any

from matplotlib.figure import Figure

from flexfem.plot import figures_of
from flexfem.plot.style import rendered

TYPES = {"svg": "image/svg+xml", "png": "image/png"}

LARGEST = 300_000  # bytes of a vector image


def inline_figure(found: Any) -> str:
    """Return the first figure of a result as an HTML element, "" for a result without one.

    It is a vector image, or one of pixels where that would be large: a figure of finite-element
    fields has thousands of triangles.
    """
    if not found.figure or (found.drawn_from_fields and found.fields is None):
        return ""
    figures = [each for each in figures_of(found).values() if isinstance(each, Figure)]
    if not figures:
        return ""
    return inline_image(figures[0], f"Figure: {found.heading()}")


def inline_image(figure: Figure, description: str) -> str:
    """Return a figure with a description for a screen reader as an HTML element."""
    form = "svg"
    image = rendered(figure, form)
    if len(image) > LARGEST:
        form = "png"
        image = rendered(figure, form)
    content = base64.b64encode(image).decode()
    about = escape(description, quote=True)
    source = f"data:{TYPES[form]};base64,{content}"
    return f'<p><img alt="{about}" style="max-width: 100%; width: 50rem" src="{source}"></p>'
