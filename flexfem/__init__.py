"""Verification and design of planar flexure mechanisms: an analytic model against finite elements.

    import flexfem
    stage = flexfem.load("geometry/mobility6.toml")    # validated and feasible, or BadInput with
    file, line and key thin = stage.replace(neck={"elbow": 0.4})          # validated again model =
    flexfem.analyse(thin, mobility=6)          # stiffness, compliance, force, pose, neck_stress,
    range_at_yield fe = flexfem.solve(thin)                           # the same, and mesh,
    displacement, stress, band, plot flexfem.errors(thin, mobility=6)                   # per cent
    (3, 3) with bands found = flexfem.budget(thin)                       # the record that `flexfem
    budget` prints; so for every command flexfem.plot.plot_budget(ax, found, "x")           # on
    axes of one's own; so for every result flexfem.export(thin, "part.dxf", kerf=0.3)         # the
    part for the workshop, also .step and .svg flexfem.import_drawing("part.dxf", "mine.toml",
    reading=flexfem.Reading(thickness=10.0, material="al-7075-t6"))
    flexfem.run_study("cases/study-reach.toml")        # many designs; flexfem.study.table(path) for
    pandas

Arguments are in mm, N, MPa and rad, vectors x, y, theta. Numbers of a result have the units of its
tables, which `found.unit(name)` returns. Nothing is loaded before it is used."""

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the text of these imports also locates names at run time
    from flexfem.cad import export as export
    from flexfem.importing.drawings import Reading as Reading
    from flexfem.importing.drawings import import_drawing as import_drawing
    from flexfem.importing.drawings import load as load
    from flexfem.mechanism.materials import Material as Material
    from flexfem.mechanism.mechanism_file import Mechanism as Mechanism
    from flexfem.mechanism.mechanism_file import MechanismFile as MechanismFile
    from flexfem.page.report import report as report
    from flexfem.paper.experiment import experiment as experiment
    from flexfem.paper.identify import identify as identify
    from flexfem.paper.models import analyse as analyse
    from flexfem.paper.models import errors as errors
    from flexfem.paper.models import solve as solve
    from flexfem.paper.stage import Stage as Stage
    from flexfem.paper.verification import verification as verification
    from flexfem.questions.as_built import as_built as as_built
    from flexfem.questions.buckling import buckling as buckling
    from flexfem.questions.budget import budget as budget
    from flexfem.questions.check import check as check
    from flexfem.questions.compare import compare as compare
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
    from flexfem.questions.stiffness import stiffness as stiffness
    from flexfem.questions.stiffness import summary as summary
    from flexfem.refused import BadInput as BadInput
    from flexfem.refused import ComputationFailed as ComputationFailed

if TYPE_CHECKING:  # names that scripts may use, too; documented in their modules
    from flexfem.baselines import baseline as baseline
    from flexfem.baselines import regression as regression
    from flexfem.design.run import run_design as run_design
    from flexfem.hinges.formulas import formulas as formulas
    from flexfem.hinges.formulas import register_formula as register_formula
    from flexfem.hinges.strength import Basquin as Basquin
    from flexfem.hinges.strength import fit_basquin as fit_basquin
    from flexfem.mechanism.actuators import Actuator as Actuator
    from flexfem.mechanism.materials import materials as materials
    from flexfem.mechanism.materials import register_material as register_material
    from flexfem.page.report import plot_results as plot_results
    from flexfem.paper.models import AnalyticModel as AnalyticModel
    from flexfem.paper.models import ElementModel as ElementModel
    from flexfem.paper.models import Errors as Errors
    from flexfem.paper.stage_file import Chain as Chain
    from flexfem.paper.stage_file import Hinge as Hinge
    from flexfem.paper.stage_file import Hinges as Hinges
    from flexfem.paper.stage_file import Override as Override
    from flexfem.paper.stage_file import Platform as Platform
    from flexfem.paper.verification import Verification as Verification
    from flexfem.questions.check import hinge_review as hinge_review
    from flexfem.questions.check import known_formulas as known_formulas
    from flexfem.questions.check import thickness_review as thickness_review
    from flexfem.questions.modes import dynamic_model as dynamic_model
    from flexfem.results import Result as Result
    from flexfem.schemas import schema as schema
    from flexfem.studies import clean_study as clean_study
    from flexfem.studies import collect_study as collect_study
    from flexfem.studies import plot_study as plot_study
    from flexfem.studies import run_study as run_study
    from flexfem.studies import study_findings as study_findings
    from flexfem.studies import study_status as study_status
    from flexfem.workshop import hinge_formulas as hinge_formulas
    from flexfem.workshop import mesh as mesh
    from flexfem.workshop import new_stage as new_stage
    from flexfem.workshop import view as view


__version__ = "0.1.0"

_BLOCKS = Path(__file__).read_text().split("\nif TYPE_CHECKING:")[1:]
_LISTED, OTHERS = (
    re.findall(r"^    from flexfem\.([\w.]+) import \w+ as (\w+)$", text, re.M) for text in _BLOCKS
)
_HOMES: dict[str, str] = {name: home for home, name in (*_LISTED, *OTHERS)}
SUBJECTS = ("design", "plot", "studies", "study", "workshop")
__all__ = sorted(["__version__", *(name for _, name in _LISTED)])


def home_of(name: str) -> str:
    """Return the module under `flexfem` that defines a name, listed or not, "" for other names."""
    return _HOMES.get(name, "")


def __getattr__(name: str) -> Any:
    if home := home_of(name):
        return getattr(import_module(f"flexfem.{home}"), name)
    if name in SUBJECTS:
        return import_module(f"flexfem.{name}")
    raise AttributeError(f"module 'flexfem' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, *SUBJECTS]
