"""Figures: functions that draw a result on given axes, and pages composed of them.

    figure, ax = plt.subplots()
    flexfem.plot.plot_budget(ax, flexfem.budget(stage), "x")

Every function `plot_...(ax, result, ...)` draws on `ax` alone and returns it; none of them solves
anything. The functions below are imported on first use."""

import os
from importlib import import_module
from typing import Any

from flexfem.refused import BadInput, printed

_NAMES = {
    "design": "plot_history plot_margins plot_sensitivity plot_tradeoff",
    "drive": "plot_drive plot_forces plot_large plot_section plot_solid plot_strokes",
    "errors": "plot_budget plot_convergence plot_errors plot_mechanism_errors",
    "experiment": "plot_life plot_push plot_region plot_remains",
    "fields": "plot_displacement plot_drift",
    "hinge": "plot_formulas plot_hinge plot_hinge_table plot_thickness",
    "modes": "plot_mode plot_response",
    "plate": "plot_plate",
    "stage": "plot_mesh plot_model plot_neck",
    "study": "plot_front plot_histogram plot_map plot_shares",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_MODULES)


def figures_of(result: Any) -> dict[str, Any]:
    """Figures of a result by file-name suffix: each a figure, or a function that writes files
    beside a path.
    """
    module, _, draw = result.figure.rpartition(".")
    figures = getattr(import_module(f"flexfem.plot.{module}"), draw)(result)
    return figures if isinstance(figures, dict) else {"": figures}


def check_backend() -> None:
    """Raise BadInput when the environment names a backend that matplotlib does not know: it cannot
    be imported then.
    """
    try:
        import_module("matplotlib")
    except ValueError:
        backend = printed(os.environ.get("MPLBACKEND"))
        raise BadInput(
            f"MPLBACKEND = {backend}, expected a backend of matplotlib, or no such variable"
        ) from None


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f"flexfem.plot.{_MODULES[name]}"), name)
    raise AttributeError(f"module 'flexfem.plot' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
