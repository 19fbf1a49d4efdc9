"""The verification manual: a section for every published problem, what it verifies, and what was found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

from flexfem.files.writing import markdown_table
from flexfem.validate.records import Finding
from flexfem.validate.registry import BENCHMARKS

HEAD = ("quantity", "target", "target ±", "ours", "difference", "allowed ±", "unknowns", "")
VERIFIES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "manufactured-solution": ("Manufactured solution", "the discretisation on curved, graded triangles"),
        "patch-test": ("Patch test", "consistency of curved quadratic triangles"),
        "rigid-body-motions": ("Rigid-body motions", "that nothing but the three rigid motions is free of energy"),
        "reciprocity": ("Reciprocity", "symmetry of the stiffness matrix and of its solution (Betti)"),
        "balances": ("Balances", "energies, and the recovery of reactions"),
        "kirsch-hole": ("Kirsch's hole", "stresses at a notch and their convergence"),
        "howland-strips": ("Howland's strips", "stress concentration in a strip of finite width"),
        "nafems-le1": ("NAFEMS LE1, elliptic membrane", "stress at a curved edge under an edge load"),
        "cook-membrane": ("Cook's membrane", "bending and shear of a skew body"),
        "macneal-harder-straight-beam": ("MacNeal and Harder's straight beam", "slender bodies of distorted triangles"),
        "macneal-harder-curved-beam": ("MacNeal and Harder's curved beam", "bending of a curved body"),
        "timoshenko-cantilever": ("Timoshenko's cantilever", "the full order under a cubic field"),
        "circular-notch": ("Circular notch", "hinge formulas (2) and (3) in the limit of a thin neck"),
        "elastica": ("Elastica", "large displacements and rotations"),
        "tangent": ("Tangent stiffness", "that the tangent is the derivative of the internal forces"),
        "nafems-fv32": ("NAFEMS FV32, tapered membrane", "the mass matrix and natural frequencies in the plane"),
        "vibrating-rods": ("Vibrating rods", "axial and bending modes, and the shares of mass in them"),
        "free-body": ("Free body", "rigid motions at zero frequency in the plane"),
        "dowling-fit": ("Dowling's Example 9.1", "the fit of Basquin's law to points"),
        "dowling-table": ("Dowling's Table 9.1", "the fatigue constants of the registered materials"),
        "warm-free-body": ("Warm free body", "that even warming and a gradient leave a free body without stress"),
        "hot-spot": ("Hot spot", "thermal stress against an exact solution"),
        "wedge-patch-test": ("Patch test of wedges", "consistency of the wedges of 18 nodes"),
        "wedge-rigid-motions": ("Motions of wedges", "that nothing but six motions is free of energy"),
        "thickness-limits": ("Limits of the thickness", "three dimensions where they become plane problems"),
        "zettl-bounds": ("Zettl's bounds", "compliance between plane stress and plane strain"),
        "bent-beam": ("Bent beam", "bending modes in and out of the plane, in each half of the thickness"),
        "annular-plate": ("Annular plate", "modes out of the plane, in one sector of three and in the whole"),
        "free-solid": ("Free solid", "rigid motions at zero frequency in three dimensions"),
    }
)


def manual(found: Mapping[str, Sequence[Finding]], figures: Mapping[str, str] = MappingProxyType({})) -> str:
    """The verification manual in Markdown, of findings by the name of their problem; `figures`: a path each."""
    findings = [finding for each in found.values() for finding in each]
    failed, count = sum(not finding.passed for finding in findings), len(findings)
    said = f"{failed} of {count} fail" if failed else f"All {count} agree"
    blocks = [
        "# Verification manual",
        f"What `flexfem benchmark` finds. Every target is published or exact, none is a value of our own. {said} "
        "within what is allowed: a limit stated beside the target, in its unit, from the error that the mesh is "
        "expected to have and from the digits that the source prints.",
        *(block for name, own in found.items() for block in _section(name, own, figures.get(name))),
    ]
    return "\n\n".join(blocks) + "\n"


def _section(name: str, own: Sequence[Finding], figure: str | None) -> Iterator[str]:
    title, verifies = VERIFIES[name]
    yield f"## {title}"
    yield f"Verifies {verifies}. {(BENCHMARKS[name].__doc__ or '').strip()}"
    yield f"`flexfem benchmark --name {name}`"
    yield markdown_table(HEAD, map(_row, own), "lrrrrrr")
    yield "\n".join(f"- Source: {source}." for source in dict.fromkeys(found.source for found in own))
    notes = [f"- {found.quantity}: {found.note}." for found in own if found.note]
    if notes:
        yield "\n".join(notes)
    if figure is not None:
        yield f"![{title}]({figure})"


def _row(found: Finding) -> list[str]:
    uncertainty = f"{found.target_uncertainty:.2g}" if found.target_uncertainty else "exact"
    cells = [found.quantity, f"{found.target:.6g}", uncertainty, f"{found.ours:.6g}", f"{found.difference:+.1e}"]
    return [*cells, f"{found.allowed:.2g}", f"{found.unknowns or ''}", "" if found.passed else "**fails**"]
