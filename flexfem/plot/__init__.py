"""Figures: functions that draw a result on given axes, and pages composed of them.

    figure, ax = plt.subplots()
    flexfem.plot.plot_budget(ax, flexfem.budget(stage), "x")

Every function `plot_...(ax, result, ...)` draws on `ax` alone and returns it; none of them solves
anything. The functions below are imported on first use.
"""

import os
from importlib import import_module
from typing import Any

from flexfem.lazy import named
from flexfem.refused import BadInput, printed

_NAMES = {  # functions by their module under `flexfem`
    "paper.figures.budget": "plot_budget",
    "paper.figures.drift": "plot_drift",
    "paper.figures.drive": "plot_drive plot_forces plot_strokes",
    "paper.figures.errors": "plot_errors",
    "paper.figures.experiment": "plot_push plot_remains",
    "paper.figures.hinge": "plot_hinge_table",
    "paper.figures.identification": "plot_region",
    "paper.figures.large": "plot_large",
    "paper.figures.mesh": "plot_mesh plot_neck",
    "paper.figures.pseudo_rigid": "plot_model",
    "paper.figures.reach": "plot_section plot_solid",
    "plot.compare": "plot_overlay",
    "plot.curves": "plot_curves plot_effect",
    "plot.design": "plot_history plot_margins plot_sensitivity plot_tradeoff",
    "plot.errors": "plot_convergence plot_mechanism_errors plot_shares_of_error plot_steps",
    "plot.fields": "plot_displacement",
    "plot.hinge": "plot_formulas plot_hinge plot_thickness",
    "plot.life": "plot_life plot_lives",
    "paper.figures.modes": "plot_mode plot_response",
    "plot.plate": "plot_plate",
    "plot.study": "plot_front plot_histogram plot_map plot_shares",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_MODULES)


def figures_of(result: Any) -> dict[str, Any]:
    """Return the figures of a result by file-name suffix.

    Each is a figure, or a function that writes files beside a path. The class of the result names
    the function that draws them: `figure = "module.function"` of a module of this package, or of
    the paper's, `figure = "paper.figures.module.function"`.
    """
    place = result.figure if result.figure.startswith("paper.") else f"plot.{result.figure}"
    figures = named(place)(result)
    return figures if isinstance(figures, dict) else {"": figures}


def check_backend() -> None:
    """Raise BadInput when the environment names a backend that matplotlib does not know."""
    try:
        import_module("matplotlib")  # fails with an unknown backend
    except ValueError:
        backend = printed(os.environ.get("MPLBACKEND"))
        raise BadInput(
            f"MPLBACKEND = {backend}, expected a backend of matplotlib, or no such variable"
        ) from None


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return named(f"{_MODULES[name]}.{name}")
    raise AttributeError(f"module 'flexfem.plot' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
