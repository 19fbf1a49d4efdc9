"""The kinds of files that flexfem reads, and the kinds of results that it writes."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any, NamedTuple

from flexfem.lazy import named
from flexfem.results import Result

ROOMS = ("flexfem.questions", "flexfem.paper")  # packages whose modules declare results


class Format(NamedTuple):
    """A kind of input file: the model that reads it, its title, and its purpose.

    model : pydantic model, by its module and name under `flexfem`.
    tables : what each table describes where the user names the tables; the model is then that of
    one table.
    expressions : whether a number may be an expression.
    """

    model: str
    title: str
    about: str
    tables: str = ""
    expressions: bool = False

    @property
    def table(self) -> Any:
        """The model that reads the file, or one of its tables."""
        return named(self.model)


STAGES = (
    "One TOML file for each stage. `flexfem new` writes a stage file, `flexfem check` explains it."
)
CASES = (
    "One TOML file for each comparison: (18) gives the force for a commanded platform "
    "displacement, finite elements give the displacement under this force, and the difference is "
    "the error. `flexfem verify` runs it."
)
STUDIES = (
    "One TOML file for each study: many designs of one base stage, run by `flexfem study run`."
)
DESIGNS = (
    "One TOML file for each design: free keys of a base stage, requirements and objective, for "
    "`flexfem design`."
)
FIXTURES = "One TOML file for each set-up of the stiffness experiment, for `flexfem experiment`."
SLOPES = (
    "Measured slopes without the set-up, for `flexfem identify` and `flexfem experiment "
    "--measured`."
)
MATERIALS = (
    "Your own materials, one table each, in a file that a stage file names: `name` and `file` in "
    "`[material]`."
)
NECKS = "The necks of a mechanism as measured, for `flexfem as-built`, which also reads a CSV file."
MECHANISMS = (
    "One TOML file for each mechanism that is cut from one plate, of any form: bodies, hinges, "
    "copies of both, actuators and an output. `flexfem new --kind` writes examples."
)
FORMATS = {
    "stage": Format("paper.stage.Stage", "Stage file", STAGES),
    "case": Format("paper.case.Case", "Case file", CASES),
    "study": Format("study.plan.Study", "Study file", STUDIES),
    "requirements": Format("design.requirements.Requirements", "Requirements file", DESIGNS),
    "fixture": Format("paper.fixture.Fixture", "Fixture file", FIXTURES),
    "measured": Format("paper.fixture.Measurement", "Measured slopes", SLOPES),
    "material": Format("mechanism.materials.Entry", "Materials file", MATERIALS, tables="material"),
    "necks": Format("questions.as_built.Necks", "Measured necks", NECKS),
    "mechanism": Format(
        "mechanism.mechanism_file.MechanismFile", "Mechanism file", MECHANISMS, expressions=True
    ),
}


def results() -> dict[str, type[Result]]:
    """Return all kinds of results of flexfem by name."""
    for room in ROOMS:
        for module in iter_modules(import_module(room).__path__):
            import_module(f"{room}.{module.name}")
    kinds = Result.kinds.items()
    return {name: kind for name, kind in kinds if kind.__module__.startswith("flexfem.")}
