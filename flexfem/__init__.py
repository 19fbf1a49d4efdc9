"""Verification and design of planar flexure mechanisms: an analytic model against finite elements.

    import flexfem

    stage = flexfem.load("geometry/mobility6.toml")  # checked; or BadInput with file, line and key
    thin = stage.replace(neck={"elbow": 0.4})  # checked again
    found = flexfem.stiffness(thin)  # the result that `flexfem stiffness` prints; so for all
    commands found.at("stiffness", model="analytic")  # 3 x 3, in the units of its table budget =
    flexfem.budget(thin) flexfem.plot.plot_budget(ax, budget, "x")  # on axes of your own; so for
    all results flexfem.export(thin, "part.dxf", kerf=0.3)  # the part for the workshop, also .step
    and .svg reading = flexfem.Reading(thickness=10.0, material="al-7075-t6")
    flexfem.import_drawing("part.dxf", "mine.toml", reading=reading)
    flexfem.run_study("cases/study-reach.toml")  # many designs; flexfem.study.table reads its table

Arguments are in mm, N, MPa and rad, vectors x, y, theta. Numbers of a result have the units of its
tables, which `found.unit(name)` returns. Nothing is loaded before it is used: the tables below name
the module of every name.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors and type checkers; the same names as in the tables below
    from flexfem.baselines import baseline as baseline
    from flexfem.baselines import regression as regression
    from flexfem.cad.part import export as export
    from flexfem.design.run import run_design as run_design
    from flexfem.hinges.formulas import formulas as formulas
    from flexfem.hinges.formulas import register_formula as register_formula
    from flexfem.hinges.strength import Basquin as Basquin
    from flexfem.hinges.strength import fit_basquin as fit_basquin
    from flexfem.importing.drawings import Reading as Reading
    from flexfem.importing.drawings import import_drawing as import_drawing
    from flexfem.importing.drawings import load as load
    from flexfem.live.server import serve as serve
    from flexfem.mechanism.materials import Material as Material
    from flexfem.mechanism.materials import materials as materials
    from flexfem.mechanism.materials import register_material as register_material
    from flexfem.mechanism.mechanism_file import Mechanism as Mechanism
    from flexfem.mechanism.mechanism_file import MechanismFile as MechanismFile
    from flexfem.page.report import report as report
    from flexfem.page.show import show as show
    from flexfem.page.stored import plot_results as plot_results
    from flexfem.paper.actuators import Actuator as Actuator
    from flexfem.paper.experiment import experiment as experiment
    from flexfem.paper.identify import identify as identify
    from flexfem.paper.models import AnalyticModel as AnalyticModel
    from flexfem.paper.models import ElementModel as ElementModel
    from flexfem.paper.models import Errors as Errors
    from flexfem.paper.models import analyse as analyse
    from flexfem.paper.models import errors as errors
    from flexfem.paper.models import solve as solve
    from flexfem.paper.modes import dynamic_model as dynamic_model
    from flexfem.paper.stage import Stage as Stage
    from flexfem.paper.stage_file import Chain as Chain
    from flexfem.paper.stage_file import Hinge as Hinge
    from flexfem.paper.stage_file import Hinges as Hinges
    from flexfem.paper.stage_file import Override as Override
    from flexfem.paper.stage_file import Platform as Platform
    from flexfem.paper.verification import Verification as Verification
    from flexfem.questions.as_built import as_built as as_built
    from flexfem.questions.buckling import buckling as buckling
    from flexfem.questions.budget import budget as budget
    from flexfem.questions.check import check as check
    from flexfem.questions.check import hinge_review as hinge_review
    from flexfem.questions.check import known_formulas as known_formulas
    from flexfem.questions.check import thickness_review as thickness_review
    from flexfem.questions.compare import compare as compare
    from flexfem.questions.comparison import Comparison as Comparison
    from flexfem.questions.convergence import converge as converge
    from flexfem.questions.drive import drive as drive
    from flexfem.questions.forces import forces as forces
    from flexfem.questions.gravity import gravity as gravity
    from flexfem.questions.heat import drift as drift
    from flexfem.questions.large import large as large
    from flexfem.questions.life import life as life
    from flexfem.questions.modes import modes as modes
    from flexfem.questions.reach import reach as reach
    from flexfem.questions.setup import Analytic as Analytic
    from flexfem.questions.side_by_side import ComparedNumber as ComparedNumber
    from flexfem.questions.stiffness import stiffness as stiffness
    from flexfem.questions.summary import summary as summary
    from flexfem.questions.verification import verification as verification
    from flexfem.refused import BadInput as BadInput
    from flexfem.refused import ComputationFailed as ComputationFailed
    from flexfem.results import Result as Result
    from flexfem.schemas.command import schema as schema
    from flexfem.studies import clean_study as clean_study
    from flexfem.studies import collect_study as collect_study
    from flexfem.studies import plot_study as plot_study
    from flexfem.studies import run_study as run_study
    from flexfem.studies import study_findings as study_findings
    from flexfem.studies import study_status as study_status
    from flexfem.workshop import catalogue as catalogue
    from flexfem.workshop import hinge_formulas as hinge_formulas
    from flexfem.workshop import mesh as mesh
    from flexfem.workshop import new_stage as new_stage
    from flexfem.workshop import view as view

__version__ = "0.1.0"

MODULES = {  # module of each name of `__all__`
    "export": "cad.part",
    "Reading": "importing.drawings",
    "import_drawing": "importing.drawings",
    "load": "importing.drawings",
    "Material": "mechanism.materials",
    "Mechanism": "mechanism.mechanism_file",
    "MechanismFile": "mechanism.mechanism_file",
    "report": "page.report",
    "experiment": "paper.experiment",
    "identify": "paper.identify",
    "analyse": "paper.models",
    "errors": "paper.models",
    "solve": "paper.models",
    "Stage": "paper.stage",
    "verification": "questions.verification",
    "as_built": "questions.as_built",
    "buckling": "questions.buckling",
    "budget": "questions.budget",
    "check": "questions.check",
    "compare": "questions.compare",
    "converge": "questions.convergence",
    "drive": "questions.drive",
    "forces": "questions.forces",
    "gravity": "questions.gravity",
    "drift": "questions.heat",
    "large": "questions.large",
    "life": "questions.life",
    "modes": "questions.modes",
    "reach": "questions.reach",
    "Analytic": "questions.setup",
    "stiffness": "questions.stiffness",
    "summary": "questions.summary",
    "BadInput": "refused",
    "ComputationFailed": "refused",
}
OTHERS = {  # module of names that scripts may use, too; documented in their modules
    "baseline": "baselines",
    "regression": "baselines",
    "run_design": "design.run",
    "formulas": "hinges.formulas",
    "register_formula": "hinges.formulas",
    "Basquin": "hinges.strength",
    "fit_basquin": "hinges.strength",
    "Actuator": "paper.actuators",
    "serve": "live.server",
    "show": "page.show",
    "materials": "mechanism.materials",
    "register_material": "mechanism.materials",
    "plot_results": "page.stored",
    "AnalyticModel": "paper.models",
    "ElementModel": "paper.models",
    "Errors": "paper.models",
    "Chain": "paper.stage_file",
    "Hinge": "paper.stage_file",
    "Hinges": "paper.stage_file",
    "Override": "paper.stage_file",
    "Platform": "paper.stage_file",
    "Verification": "paper.verification",
    "Comparison": "questions.comparison",
    "ComparedNumber": "questions.side_by_side",
    "hinge_review": "questions.check",
    "known_formulas": "questions.check",
    "thickness_review": "questions.check",
    "dynamic_model": "paper.modes",
    "Result": "results",
    "schema": "schemas.command",
    "clean_study": "studies",
    "collect_study": "studies",
    "plot_study": "studies",
    "run_study": "studies",
    "study_findings": "studies",
    "study_status": "studies",
    "catalogue": "workshop",
    "hinge_formulas": "workshop",
    "mesh": "workshop",
    "new_stage": "workshop",
    "view": "workshop",
}
SUBJECTS = ("design", "plot", "studies", "study", "workshop")  # modules that are names here, too
__all__ = sorted(["__version__", *MODULES])


def home_of(name: str) -> str:
    """Return the module under `flexfem` that defines a name, "" for a name that is not offered."""
    return MODULES.get(name) or OTHERS.get(name, "")


def __getattr__(name: str) -> Any:
    home = home_of(name)
    if home:
        return getattr(import_module(f"flexfem.{home}"), name)
    if name in SUBJECTS:
        return import_module(f"flexfem.{name}")
    raise AttributeError(f"module 'flexfem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, *OTHERS, *SUBJECTS]
