"""The parts of a page of a stage, each computed when it comes to be put on the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem import api
from flexfem.analytic.responses import require_expansion
from flexfem.hinges.strength import required_law
from flexfem.mechanism.stage_file import located
from flexfem.page import answers, motion
from flexfem.page.section import PageSection
from flexfem.page.stage import asked_section, drawing_section, drive_table, provenance_section
from flexfem.questions import heat, life
from flexfem.questions.large import large
from flexfem.questions.reach import reach
from flexfem.questions.stiffness import stiffness
from flexfem.questions.summary import summary
from flexfem.reports import modes, verification
from flexfem.results import Result

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flexfem.mechanism.stage import Stage
    from flexfem.verify.stage_report import StageReport

Part = tuple[str, Callable[[], PageSection | None]]


def stage_parts(stage: Stage, found: StageReport, sections: Sequence[str], amplitude: ArrayLike | None) -> list[Part]:
    """What makes the sections of a stage that were asked, and those that are always there; see `report.report`.

    Raises BadInput for a section that needs a constant of the material which the stage does not state.
    """

    with located(stage):  # before anything is computed
        if "life" in sections:
            required_law(stage.material)
        if "drift" in sections:
            require_expansion(stage)

    def driven() -> PageSection | None:
        return motion.drive_section(reach(stage, models="analytic"), drive_table(found)) if stage.actuator else None

    makers: dict[str, Callable[[], PageSection | None]] = {
        "analytic": lambda: table_section("analytic", "Analytic model", stiffness(stage, models="analytic")),
        "elements": lambda: table_section("elements", "Finite elements", summary(stage)),
        "budget": lambda: answers.budget_section(verification.budget(stage, three_dimensional=False)),
        "stress": lambda: answers.stress_section(stage, api.solve(stage)),
        "drive": driven,
        "large": lambda: motion.large_section(large(stage)),
        "modes": lambda: motion.modes_section(modes.vibration(stage)),
        "drift": lambda: motion.drift_section(heat.drift(stage)),
        "life": lambda: motion.life_section(life.life(stage, amplitude=amplitude)),  # type: ignore[arg-type]
    }
    wanted = [name for name in makers if name in sections and (name != "drive" or stage.actuator)]
    return [
        ("asked", lambda: asked_section(stage, found, wanted)),
        ("drawing", lambda: drawing_section(stage, found)),
        *((name, makers[name]) for name in wanted),
        ("sources", lambda: provenance_section(stage, found)),
    ]


def table_section(name: str, title: str, found: Result) -> PageSection:
    """A section with the tables of a result."""
    return PageSection(name, title, Markup(found.to_html()))
