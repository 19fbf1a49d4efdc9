"""Figures of the package as parts of a page: without the header, whose lines become the caption."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.page.inline import inline_svg
from flexfem.page.section import PageFigure, figure_html
from flexfem.plot.style import headless
from flexfem.plot.vector import Spot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def shown_figure(
    name: str,
    draw: Callable[[], Figure],
    description: str,
    spots: Callable[[Figure], Sequence[Spot]] = lambda figure: (),
    data: Markup | None = None,
    caption: str = "",
) -> Markup:
    """A figure as a part of a section.

    Parameters
    ----------
    name : its id, once on a page.   draw : makes it, as the functions `..._figure` of `flexfem.plot` do.
    description : what a screen reader says of it.   spots : places on it that tell their values.
    data : a table of its numbers.   caption : what stands below it, by default the lines of its header.
    """
    with headless() as lines:
        figure = draw()
        figure.draw_without_rendering()  # a layout engine places the axes then
        told = list(spots(figure))
    svg = inline_svg(figure, name, told)
    return figure_html(PageFigure(svg, caption or " ".join(map(sentence, lines)), description, data), name)


def sentence(text: str) -> str:
    """The text with a capital at its beginning and a full stop at its end."""
    whole = text.strip()
    return f"{whole[:1].upper()}{whole[1:]}{'' if whole.endswith(('.', '!', '?')) or not whole else '.'}"
