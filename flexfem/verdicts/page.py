"""Verdicts as a page."""

from __future__ import annotations

from flexfem.files.writing import markdown_table
from flexfem.verdicts.records import ClaimsReport, EnsembleReport, Verdict
from flexfem.verify.alternatives import markdown_alternatives


def markdown_claims(verdicts: list[Verdict]) -> str:
    """The verdicts as a Markdown table."""
    rows = []
    for each in verdicts:
        claimed = each.statement + (f" *Read as: {each.reading}.*" if each.reading else "")
        found = ". ".join(_sentence(part) for part in (each.found, each.ensemble, each.argument) if part)
        rows.append((claimed, each.where, f"**{each.verdict}**", found))
    return markdown_table(("claim", "where", "verdict", "found"), rows) + "\n"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] if not text.startswith("(") else text


def said_of_ensemble(of: EnsembleReport) -> str:
    """Over which stages claims were judged, in a sentence."""
    off = "" if of.metal_off is None else f", {of.metal_off:.3f} points from finite elements on the stages of the file"
    ranges = "; ".join(f"{each.name} {each.least:.3g} to {each.most:.3g}" for each in of.ranges)
    return (
        f"Judged over {of.judged} pairs of stages: {of.drawn} drawn with seed {of.seed}, {of.infeasible} that cannot be"
        f" made and {of.off_chart} off the hinge chart left out. Their metal is calibrated hinges with elastic pads,"
        f" links and platform{off}." + (f" They differ in {ranges}." if ranges else "")
    )


def claims_page(report: ClaimsReport) -> str:
    """Verdicts and alternatives as a Markdown page."""
    kinds = (("assumed", report.assumed), ("without a source", report.not_stated))
    doubt = " and ".join(f"partly {what}" for what, keys in kinds if keys)
    opening = f"Dimensions and workspace are {doubt}.\n\n" if doubt else ""
    opening += "".join(f"Warning: {text}.\n\n" for text in report.warnings)
    opening += f"{said_of_ensemble(report.ensemble)}\n\n" if report.ensemble else ""
    return (
        f"# {report.name}\n\n{opening}{markdown_claims(report.verdicts)}\n"
        f"## What else could have produced the errors, in per cent\n\n{markdown_alternatives(report.alternatives)}"
    )
