"""Drift in three dimensions: its tables and what is written; and how poses are printed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from flexfem.commands.tables import DIRECTIONS, people, print_ending, table
from flexfem.units import EXPANSION, LENGTH, STRESS, Direction, unit_for

if TYPE_CHECKING:
    from flexfem.arrays import Array
    from flexfem.verify.solid_drift import SolidDrift, SolidDriftCase, SolidDriftFields

ROUND_OFF = 1e-9  # of the largest component of a pose: zero by symmetry
THROUGH: tuple[Direction, ...] = ("x", "theta", "theta")  # what z and the tilts are like, in units
AT_EDGES = (
    "at clamped edges: highest stress of the pads there, without a fifth of each edge at both corners, where elastic "
    "stress has no bound"
)
TILTS = ("z", "tilt x", "tilt y")


def write_solid(found: SolidDriftFields, path: Path) -> None:
    """The record, and displacements and stresses of all cases in half of the thickness as fields of one VTU file."""
    from flexfem.fem.export import write_solid_vtu
    from flexfem.verify.result import write_record

    write_record(found.record, path)
    fields: dict[str, Array] = {}
    for case in found.record.cases:
        displacement, stress = found.field(case)
        fields |= {f"displacement, {case}": displacement, f"von Mises stress, {case}": stress}
    write_solid_vtu(found.mesh, found.heights, path.with_suffix(".vtu"), fields)


def print_solid_drift(of: SolidDrift) -> None:
    """Print pose, its band, what plane stress says, and the highest neck stress by case."""
    out = people()
    factor, unit = EXPANSION.factor, EXPANSION.plain
    out.print(f"{of.name}: expansion {factor * of.expansion:g} {unit}, frame {factor * of.frame_expansion:g} {unit}")
    out.print(
        f"finite elements in three dimensions, {of.triangles} triangles times {of.layers} layers in half the thickness"
    )
    through = "gradient in z"
    for freedoms, axes, cases in (
        (DIRECTIONS, DIRECTIONS, [name for name in of.cases if name != through]),
        (TILTS, THROUGH, [through]),
    ):
        head = ("temperature", "", *freedoms, f"highest neck stress ({STRESS})", "at clamped edges")
        rows = (row for name in cases for row in _rows(name, of.cases[name], axes, of.lever))  # type: ignore[index]
        out.print(table(head, rows))
    out.print(
        "uniform: per K; gradients: per K/mm about the platform's centre in the mid-plane, in stage and frame alike"
    )
    out.print("z and tilts: against the frame as it bows about that place; tilts are rotations about x and y")
    out.print(
        "proportional to the difference of both coefficients; the hub grows and bows as free metal, rigid otherwise"
    )
    out.print(
        f"band: of the mesh in the plane and of the layers (bounds {', '.join(f'{z:.3g}' for z in of.heights)} "
        f"{LENGTH} from the mid-plane); of stresses none"
    )
    out.print(f"{AT_EDGES}; in three dimensions also without that share of the half thickness below the faces")
    print_ending(out, of)


def _rows(name: str, case: SolidDriftCase, axes: tuple[Direction, ...], lever: float) -> Iterator[list[str]]:
    yield [
        name,
        "three dimensions",
        *pose_texts(case.pose, lever, axes),
        f"{highest(case.stress):.4g}",
        edge_text(case.edges),
    ]
    yield ["", "band (+-)", *band_texts(case.band, case.pose, lever, axes), "", ""]
    if case.plane_stress is not None:
        yield ["", "plane stress", *pose_texts(case.plane_stress, lever, axes), "", ""]


def pose_texts(pose: list[float], lever: float, axes: tuple[Direction, ...] = DIRECTIONS) -> list[str]:
    """A pose, each number with its prefix, round-off as zero; rotations count with the lever."""
    sizes = [lever if axis == "theta" else 1.0 for axis in axes]
    largest = max(abs(value) * size for value, size in zip(pose, sizes, strict=True))
    kept = [value if abs(value) * size > ROUND_OFF * largest else 0.0 for value, size in zip(pose, sizes, strict=True)]
    units = [unit_for(axis, abs(value)) for axis, value in zip(axes, kept, strict=True)]
    return [f"{v * unit.factor:.4g} {unit.plain}" if v else "0" for v, unit in zip(kept, units, strict=True)]


def band_texts(
    band: list[float], pose: list[float], lever: float, axes: tuple[Direction, ...] = DIRECTIONS
) -> list[str]:
    """Half-widths in the units of the pose, none of what is zero by symmetry."""
    zero = [text == "0" for text in pose_texts(pose, lever, axes)]
    units = [unit_for(axis, abs(value)) for axis, value in zip(axes, pose, strict=True)]
    return [
        "" if none else f"{each * unit.factor:.2g} {unit.plain}"
        for none, each, unit in zip(zero, band, units, strict=True)
    ]


def edge_text(edges: list[float] | None) -> str:
    """The largest stress at clamped edges, where it is known."""
    return "" if edges is None else f"{max(edges):.4g}"


def highest(stress: list[list[float]]) -> float:
    """The largest neck stress (3 chains, 3 hinges)."""
    return max(max(row) for row in stress)
