"""What a page says when it is asked: drive, large displacements, natural modes, drift, fatigue life."""

from __future__ import annotations

from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.page.drawn import shown_figure
from flexfem.page.section import PageSection, notes, table
from flexfem.plot.drift import drift_figure
from flexfem.plot.life import life_figure
from flexfem.plot.modes import modes_figure
from flexfem.plot.reach import reach_figure
from flexfem.plot.text import significant
from flexfem.plot.workspace import workspace_figure
from flexfem.units import UNITS

if TYPE_CHECKING:
    from flexfem.questions.heat import Drift
    from flexfem.questions.large import Large
    from flexfem.questions.life import Life
    from flexfem.questions.reach import Reach
    from flexfem.verify.modes import Vibration


def drive_section(found: Reach, actuators: Markup) -> PageSection:
    """The actuators, how far they move the platform, and what stops them."""
    figure = shown_figure("reach-figure", lambda: reach_figure(found), "Poses that the drive reaches.", caption="")
    return PageSection("drive", "Drive", actuators + Markup(found.to_html()) + figure)


def modes_section(found: Vibration) -> PageSection:
    """Natural frequencies in the plane, with their shapes."""
    of = found.record
    rows = [
        [
            str(number),
            f"{one.frequency:.6g}",
            significant(one.band, 2),
            *(f"{value:.2f}" for value in one.share.model_dump().values()),
        ]
        for number, one in enumerate(of.modes, start=1)
    ]
    head = ["mode", f"frequency ({UNITS['hz']})", f"± ({UNITS['hz']})", "mass in X (%)", "in Y (%)", "inertia in θ (%)"]
    data = table(head, rows, numbers=5, caption="Natural frequencies in the plane, effective modal masses")
    figure = shown_figure("modes-figure", lambda: modes_figure(found), "Shapes of the modes listed in the table.")
    return PageSection("modes", "Natural modes", data + figure + notes(of.warnings))


def drift_section(found: Drift) -> PageSection:
    """The pose per kelvin and per gradient of temperature."""
    figure = shown_figure(
        "drift-figure", lambda: drift_figure(found), "The warm stage under each change of temperature."
    )
    return PageSection("drift", "Drift by temperature", Markup(found.to_html()) + figure)


def large_section(found: Large) -> PageSection:
    """What large displacements change."""
    said = "Tangent stiffness and errors of linear theory over the command, a row for each direction."
    figure = shown_figure("large-figure", lambda: workspace_figure(found), said)
    return PageSection("large", "Large displacements", Markup(found.to_html()) + figure)


def life_section(found: Life) -> PageSection:
    """Cycles of the necks, and the S-N curve with the necks on it."""
    figure = shown_figure("life-figure", lambda: life_figure(found), "The S-N curve of the material with the necks.")
    return PageSection("life", "Fatigue life", Markup(found.to_html()) + figure)
