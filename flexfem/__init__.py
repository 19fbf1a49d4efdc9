"""Verification and design of planar flexure-hinge stages: an analytic model against finite elements.

    import flexfem
    stage = flexfem.load("geometry/mobility6.toml")    # validated and feasible, or BadInput with file, line and key
    thin = stage.replace(neck={"elbow": 0.4})          # validated again
    model = flexfem.analyse(thin, mobility=6)          # stiffness, compliance, force, pose, neck_stress, range_at_yield
    fe = flexfem.solve(thin)                           # the same, and mesh, displacement, stress, band, plot
    flexfem.errors(thin, mobility=6)                   # per cent (3, 3) with bands

Numbers are mm, N, MPa and rad, vectors x, y, theta. Nothing is loaded before it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flexfem.analytic.formulas import formulas as formulas
    from flexfem.analytic.formulas import register_formula as register_formula
    from flexfem.api import AnalyticModel as AnalyticModel
    from flexfem.api import ElementModel as ElementModel
    from flexfem.api import Errors as Errors
    from flexfem.api import analyse as analyse
    from flexfem.api import errors as errors
    from flexfem.api import load as load
    from flexfem.api import solve as solve
    from flexfem.refused import BadInput as BadInput
    from flexfem.refused import ComputationFailed as ComputationFailed
    from flexfem.stage.materials import Material as Material
    from flexfem.stage.materials import materials as materials
    from flexfem.stage.materials import register_material as register_material
    from flexfem.stage.schema import Chain as Chain
    from flexfem.stage.schema import Hinge as Hinge
    from flexfem.stage.schema import Hinges as Hinges
    from flexfem.stage.schema import Override as Override
    from flexfem.stage.schema import Platform as Platform
    from flexfem.stage.schema import Stage as Stage

__version__ = "0.1.0"

_HOMES = {
    "api": ("AnalyticModel", "ElementModel", "Errors", "analyse", "errors", "load", "solve"),
    "refused": ("BadInput", "ComputationFailed"),
    "stage.materials": ("Material", "materials", "register_material"),
    "stage.schema": ("Chain", "Hinge", "Hinges", "Override", "Platform", "Stage"),
    "analytic.formulas": ("formulas", "register_formula"),
}
__all__ = sorted(["__version__", *(name for names in _HOMES.values() for name in names)])


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"flexfem.{home}"), name)
    if name in ("plot", "study"):
        return import_module(f"flexfem.{name}")
    raise AttributeError(f"module 'flexfem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "plot", "study"]
