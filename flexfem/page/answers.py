"""What models say of a stage at rest: stiffness and ranges, finite elements with bands, stress, the error budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from flexfem.arrays import Array, alone, without_round_off
from flexfem.mechanism.designs import stage_frames
from flexfem.page.drawn import sentence, shown_figure
from flexfem.page.section import PageSection, notes, table
from flexfem.plot.accuracy import budget_figure
from flexfem.plot.commanded import CommandedStage, commanded_figure, neck_spots
from flexfem.plot.text import SPACE, banded, percent, significant
from flexfem.plot.told import budget_spots
from flexfem.questions.budget import TOTAL
from flexfem.units import COMMANDS, COMPLIANCE, DIRECTIONS, FORCES, STIFFNESS, STRESS, STRESSES, Unit
from flexfem.verify.result import Fields

if TYPE_CHECKING:
    from flexfem.api import Errors
    from flexfem.mechanism.stage import Stage
    from flexfem.models import ElementModel
    from flexfem.questions.budget import Budget
    from flexfem.verify.answers import StiffnessReport
    from flexfem.verify.summary import ModelSummary, Summary

SYMBOLS = ("X", "Y", "θ")
AT = np.array([0.05, 0.05, 1e-3])  # mm, mm, rad: commands at which stress is drawn, assumed, as in cases/


def analytic_section(found: StiffnessReport, summary: Summary) -> PageSection:
    """Stiffness and compliance by the paper's model, and safe ranges by the model that suits stress."""
    opening = Markup("<p>Pseudo-rigid model of mobility {}, hinge formula <em>{}</em>: {}.</p>").format(
        found.mobility, found.formula, found.formula_source.rstrip(".")
    )
    matrices = Markup('<div class="columns">{}{}</div>').format(
        matrix_table("Stiffness of the platform, (18)", "K", found.stiffness, STIFFNESS),
        matrix_table("Compliance of the platform", "C", found.compliance, COMPLIANCE),
    )
    parts = (
        opening
        + matrices
        + alone_table(found.stiffness)
        + Markup("<h3>Range until the first neck yields</h3>")
        + ranges_table(summary.analytic)
    )
    parts += Markup(
        '<p class="soft">One direction at a time, the others held; force along the displacement. {}</p>'
    ).format(sentence(summary.accuracy))
    return PageSection("analytic", "Analytic model", parts + notes([*found.warnings, *_others(summary, found)]))


def _others(summary: Summary, found: StiffnessReport) -> list[str]:
    return [text for text in summary.warnings if text not in found.warnings]


def matrix_table(caption: str, letter: str, matrix: Array, units: list[list[Unit]]) -> Markup:
    """A matrix (3, 3) as a table of its entries, what is round-off as 0."""
    shown = without_round_off(matrix)
    rows = [
        [f"{letter} {SYMBOLS[i]}{SYMBOLS[j]}", significant(float(shown[i, j]), 5), str(units[i][j])]
        for i in range(3)
        for j in range(i, 3)
    ]
    return table(["entry", "value", "unit"], rows, sortable=False, caption=caption)


def alone_table(stiffness: Array) -> Markup:
    """Stiffness along each direction, with the others held and with them free."""
    rows = [
        [SYMBOLS[k], *(f"{significant(value, 5)}{SPACE}{STIFFNESS[k][k]}" for value in both)]
        for k, both in enumerate(zip(np.diag(stiffness).tolist(), alone(stiffness).tolist(), strict=True))
    ]
    head = ["direction", "stiffness, the others held: K_ii", "the others free: 1 / C_ii"]
    return table(head, rows, sortable=False, caption="Stiffness along one direction")


def ranges_table(side: ModelSummary) -> Markup:
    """Safe range, force, stress per displacement and the neck, by direction."""
    rows = []
    for axis, direction in enumerate(DIRECTIONS):
        limit = side.limits[direction]
        rows.append(
            [
                SYMBOLS[axis],
                f"±{significant(limit.range_at_yield * COMMANDS[axis].factor)}{SPACE}{COMMANDS[axis]}",
                f"{significant(getattr(limit.force, direction) * FORCES[axis].factor)}{SPACE}{FORCES[axis]}",
                f"{significant(limit.stress * STRESSES[axis].factor)}{SPACE}{STRESSES[axis]}",
                f"{limit.hinge} hinge, chain {limit.chain}",
            ]
        )
    head = ["direction", "range at yield", "force there", "neck stress per displacement", "first to yield"]
    return table(head, rows, caption=f"By {side.model}", sortable=False)


def elements_section(model: ElementModel, side: ModelSummary, errors: Errors, analytic: Array) -> PageSection:
    """Stiffness by finite elements with the band of the meshes, and the error of the paper's model against them."""
    solved, compliance = model.solved, np.diag(model.compliance)
    spread = np.diag(model.band) / compliance
    opening = Markup(
        "<p>{} curved quadratic triangles, {} across every neck, {} unknowns; bands (±) by grid convergence over three "
        "meshes.</p>"
    ).format(f"{solved.triangles:,}", model.resolution, f"{solved.response.unknowns:,}")
    rows = []
    for k, name in enumerate(SYMBOLS):
        stiff, free = float(np.linalg.inv(model.compliance)[k, k]), 1 / float(compliance[k])
        error = banded(float(errors.percent[k, k]), float(errors.band[k, k]))
        unit = STIFFNESS[k][k]
        own = f"{significant(float(analytic[k, k]), 5)} {unit}"
        rows.append(
            [
                f"K {name}{name}",
                own,
                f"{significant(stiff, 5)} ± {significant(stiff * float(spread[k]), 2)} {unit}",
                f"{significant(free, 5)} ± {significant(free * float(spread[k]), 2)} {unit}",
                error,
            ]
        )
    head = ["stiffness, the others held", "analytic", "finite elements", "the same, the others free: 1 / C_ii"]
    head.append("error of the displacement under the analytic force")
    parts = opening + table(head, rows, sortable=False, numbers=4)
    coupled = float(np.max(np.abs(errors.percent - np.diag(np.diag(errors.percent)))))
    parts += Markup("<p>Largest error across the commanded direction: {}.</p>").format(percent(coupled))
    parts += Markup("<h3>Range until the first neck yields</h3>") + ranges_table(side)
    return PageSection("elements", "Finite elements", parts + notes(model.warnings))


def stress_section(stage: Stage, model: ElementModel) -> PageSection:
    """The metal at 50 um in X and 1 mrad, with its von Mises stress."""
    found = [_commanded(model, axis) for axis in (0, 2)]
    centres = np.asarray(stage_frames(stage).centres)
    size = 1.2 * max(
        2 * hinge.radius + hinge.neck for hinge in (stage.hinge(1, name) for name in ("base", "elbow", "platform"))
    )
    head = ["neck", *(f"{each.said} ({STRESS})" for each in found)]
    rows = [
        [f"{name} hinge, chain {chain + 1}", *(significant(float(each.neck_stress[chain, k])) for each in found)]
        for chain in range(3)
        for k, name in enumerate(("base", "elbow", "platform"))
    ]
    data = table(head, rows, caption="Largest von Mises stress at each neck", numbers=len(found))
    highest = "; ".join(
        f"{each.said}: {significant(float(each.neck_stress.max()))} {STRESS} at most, {_share(stage, each)}"
        for each in found
    )
    figure = shown_figure(
        "stress-figure",
        lambda: commanded_figure("", found, stage.platform.hub_radius, ([], [])),
        f"The deformed stage coloured by von Mises stress. {highest}.",
        lambda figure: neck_spots(figure, found, centres, size),
        data,
    )
    said = Markup(
        "<p>The platform commanded by the finite elements' own stiffness, the other directions held, at amplitudes "
        "that are assumed. {}.</p>"
    ).format(highest)
    return PageSection("stress", "Stress", said + figure)


def _commanded(model: ElementModel, axis: int) -> CommandedStage:
    pose = AT * np.eye(3)[axis]
    load = model.force(pose)
    mesh, unit = model.mesh, COMMANDS[axis]
    fields = Fields(
        nodes=mesh.nodes,
        triangles=mesh.triangles,
        bodies=mesh.bodies,
        displacement=model.displacement(load),
        stress=model.stress(load),
    )
    said = f"{SYMBOLS[axis]} = {AT[axis] * unit.factor:g} {unit}"
    return CommandedStage(said, fields, model.neck_stress(pose))


def _share(stage: Stage, each: CommandedStage) -> str:
    return f"{percent(100 * float(each.neck_stress.max()) / stage.material.yield_strength)} of the yield strength"


def budget_section(found: Budget) -> PageSection:
    """The shares of the error of the paper's model."""
    values, bands = found.at("share", share=TOTAL), found.band("share", share=TOTAL)
    totals = ", ".join(
        f"{name} {banded(value, band)}" for name, value, band in zip(SYMBOLS, values, bands, strict=True)
    )
    figure = shown_figure(
        "budget-figure",
        lambda: budget_figure(found),
        f"Bars of the shares of the error in the commanded direction, a panel for each direction. Totals: {totals}.",
        lambda figure: budget_spots(figure, found),
        Markup(found.to_html()),
    )
    return PageSection("budget", "Error budget", figure)
