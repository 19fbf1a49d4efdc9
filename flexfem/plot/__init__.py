"""Figures: functions that draw a result on given axes, and pages made of them.

    figure, ax = plt.subplots()
    flexfem.plot.plot_budget(ax, flexfem.budget(stage), "x")

Every function `plot_...(ax, result, ...)` draws on `ax`, changes nothing outside it, solves nothing, and returns it.
The names below are loaded when they are first used.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "accuracy": ("plot_budget", "plot_convergence"),
    "command": ("plot_forces", "plot_open_loop", "plot_strokes"),
    "curves": ("plot_displaced", "plot_errors"),
    "design": ("plot_history", "plot_margins", "plot_tradeoff"),
    "design_front": ("plot_objectives",),
    "dimensions": ("plot_dimensions",),
    "displacement": ("plot_displacement",),
    "drift": ("plot_drift",),
    "drive_sketch": ("plot_drive",),
    "experiment": ("plot_push", "plot_region", "plot_remains"),
    "hinge_chart": ("plot_formulas", "plot_thickness"),
    "hinge_sketch": ("plot_hinge", "plot_hinge_table"),
    "life": ("plot_life",),
    "model_sketch": ("plot_model",),
    "modes": ("plot_mode",),
    "reach": ("plot_section", "plot_solid"),
    "frequency_response": ("plot_response",),
    "solid_modes": ("plot_solid_mode",),
    "sensitivity": ("plot_sensitivity",),
    "stage": ("plot_mesh", "plot_neck", "plot_notch", "plot_stage"),
    "study_map": ("plot_map",),
    "study_pareto": ("plot_front",),
    "study_scatter": ("plot_histogram", "plot_shares"),
    "workspace": ("plot_across", "plot_along", "plot_tangents"),
}
__all__ = sorted(name for names in _HOMES.values() for name in names)


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"flexfem.plot.{home}"), name)
    raise AttributeError(f"module 'flexfem.plot' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
