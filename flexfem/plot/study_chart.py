"""The map or front of a study alone, without a header, for a page that says the rest beside it."""

from __future__ import annotations

import matplotlib.figure

from flexfem.plot.study_map import StudyMap, plot_map
from flexfem.plot.study_pareto import ParetoFront, plot_front
from flexfem.plot.style import in_house_style, new_figure, wrapped

WIDTH, HEIGHT = 5.4, 4.4  # in, with its legend
ACROSS, UP, LETTERS = 4.2, 3.2, 9.5  # in, room for the names of the axes; points


@in_house_style
def chart_figure(shown: StudyMap | ParetoFront) -> matplotlib.figure.Figure:
    """Draw a map, or a front without letters: its designs are not drawn below it. The figure has one axes first."""
    figure = new_figure(WIDTH, HEIGHT)
    figure.set_layout_engine("constrained", w_pad=0.1, h_pad=0.1)
    axes = figure.subplots()
    if isinstance(shown, StudyMap):
        plot_map(axes, shown)
    else:
        plot_front(axes, shown._replace(chosen=()))
    for axis, room in ((axes.xaxis, ACROSS), (axes.yaxis, UP)):
        if not axis.label.get_parse_math():
            axis.set_label_text(wrapped(axis.get_label_text(), room, LETTERS))
    return figure
