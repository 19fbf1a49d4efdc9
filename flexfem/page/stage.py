"""What a page says of a stage as it was read: what was asked, the drawing, where its numbers come from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from markupsafe import Markup

from flexfem.files.provenance import is_assumed, values_by_key
from flexfem.mechanism.stage_file import counted
from flexfem.page.drawn import shown_figure
from flexfem.page.section import Content, PageSection, facts, notes, table
from flexfem.plot.dimensions import drawing_figure
from flexfem.plot.told import hinge_spots
from flexfem.units import DEGREE, LENGTH, MICROMETRE, PLANES, RATE, STRESS, UNITS

if TYPE_CHECKING:
    from flexfem.mechanism.stage import Stage
    from flexfem.verify.stage_report import PlacedActuator, StageReport

TAG = Markup('<span class="tag">{}</span>')


def asked_section(stage: Stage, found: StageReport, sections: list[str]) -> PageSection:
    """Which stage it is, and which questions the page answers."""
    metal = stage.material
    pairs: list[tuple[str, str | Markup]] = [
        ("file", found.file or "none, made in Python"),
        ("hash of its content", Markup("<code>{}</code>").format(found.hash[:16])),
        ("mobility by (1)", f"{found.mobility}; chains {'alike' if found.chains_alike else 'differ'}"),
        ("modelled in", PLANES[found.model]),
        ("thickness", f"{stage.thickness:g} {LENGTH}"),
        (
            "material",
            f"{metal.name}: E {metal.youngs_modulus * UNITS['gpa'].factor:g} {UNITS['gpa']}, "
            f"ν {metal.poissons_ratio:g}, yield strength {metal.yield_strength:g} {STRESS}",
        ),
        ("answered here", ", ".join(sections)),
        ("numbers assumed", str(len(doubted(found)[0]))),
        ("numbers without a stated source", str(len(doubted(found)[1]))),
    ]
    return PageSection("asked", "What was asked", facts(pairs) + notes(found.warnings))


def doubted(found: StageReport) -> tuple[list[str], list[str]]:
    """Key paths of numbers assumed, and of those without a source, of the stage and of its drive."""
    drive = found.drive
    assumed = [*found.assumed, *(drive.assumed if drive else ())]
    not_stated = [*found.not_stated, *(drive.not_stated if drive else ())]
    return list(dict.fromkeys(assumed)), list(dict.fromkeys(not_stated))


def drawing_section(stage: Stage, found: StageReport) -> PageSection:
    """The stage with its dimensions, and a table of the hinges."""
    head = [
        "hinge",
        "chain",
        "freedoms",
        f"x ({LENGTH})",
        f"y ({LENGTH})",
        f"axis ({DEGREE})",
        f"R ({LENGTH})",
        f"t ({LENGTH})",
    ]
    rows = [
        [
            each.hinge,
            str(each.chain),
            "rotation, axial" if each.prismatic else "rotation",
            *(f"{value:z.4f}" for value in each.centre_mm),
            f"{each.axis_deg:.2f}",
            f"{each.radius_mm:g}",
            f"{each.neck_mm:g}",
        ]
        for each in found.hinges
    ]
    data = table(
        head, rows, caption="The nine hinges: centre, direction of the neck, notch radius R, neck t", numbers=5
    )
    description = (
        f"Drawing to scale of the stage {stage.name}: a platform of radius {stage.platform.radius:g} mm in the middle, "
        "three chains of two links and three notch hinges around it, 120 degrees apart, with dimension lines. "
        "The table of this figure lists all hinges."
    )
    figure = shown_figure(
        "drawing",
        lambda: drawing_figure(stage),
        description,
        lambda figure: hinge_spots(figure.axes[0], stage),
        data,
    )
    return PageSection("dimensions", "Drawing and dimensions", figure)


def provenance_section(stage: Stage, found: StageReport) -> PageSection:
    """Every value with where it comes from, those that no answer of the page takes too; those assumed first."""
    values = values_by_key(stage)
    sources = {key: text for key, text in stage.sources.items() if text and key in values}
    assumed, not_stated = doubted(found)
    assumed += [key for key, text in sources.items() if is_assumed(text) and key not in assumed]
    rows: list[list[Content]] = [
        [key, TAG.format("assumed"), sources.get(key, "not a number of the file")] for key in assumed
    ]
    rows += [[key, TAG.format("not stated"), "no source in the file"] for key in not_stated]
    rows += [[key, "stated", text] for key, text in sources.items() if key not in {*assumed, *not_stated}]
    opening = Markup("<p><strong>{} assumed</strong>, {} no stated source.</p>").format(
        counted(len(assumed), "of these numbers is", "of these numbers are"), counted(len(not_stated), "has", "have")
    )
    return PageSection(
        "provenance", "Where the numbers come from", opening + table(["key of the file", "kind", "source"], rows)
    )


def drive_table(found: StageReport) -> Markup:
    """The actuators of a stage."""
    if found.drive is None:
        return Markup("")
    head = ["actuator", "chains", "on, pushing", "stack", f"stroke ({MICROMETRE})", "blocking force (N)"]
    head += [f"stiffness ({RATE})", f"with contact ({RATE})", "preload (N)", "contact"]
    rows = [list(_actuator(each)) for each in found.drive.actuators]
    return table(head, rows, caption="The actuators", numbers=5)


def _actuator(one: PlacedActuator) -> Iterator[str]:
    kind = "pair of stacks" if len(one.contacts_mm) == 2 else "stack"
    yield from (one.name, ", ".join(map(str, one.chains)), ", ".join(one.between), f"{kind}, {one.stack or 'its own'}")
    yield from (f"{one.stroke * MICROMETRE.factor:g}", f"{one.blocking_force:.4g}")
    yield from (f"{k * RATE.factor:.4g}" for k in (one.stiffness, one.stiffness_with_contact))
    yield from (f"{one.preload:g}", one.contact)
