"""Natural frequencies in three dimensions: their table and what is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from flexfem.commands import console
from flexfem.commands.tables import print_ending, table
from flexfem.terminal import people, working
from flexfem.units import LENGTH, UNITS

if TYPE_CHECKING:
    from flexfem.verify.solid_modes import SolidMode, SolidNaturalModes, SolidVibration

HERTZ, KILOGRAM, INERTIA = UNITS["hz"].plain, UNITS["kg"].plain, UNITS["kg_mm2"].plain
SHARES = {"x": "x", "y": "y", "theta": "theta", "z": "z", "tilt_x": "tilt x", "tilt_y": "tilt y"}
OF_KIND = {"in plane": ("x", "y", "theta"), "out of plane": ("z", "tilt_x", "tilt_y")}


def show_solid_modes(solve: Callable[[Callable[[str], None]], SolidVibration], path: Path | None, json: bool) -> None:
    """Solve, write to `path`, where there is one, and show."""
    with working("modes", 2) as say:
        found = solve(say)
    if path is not None:
        _write(found, path)
    console.show(found.record, json, print_solid_modes)


def _write(found: SolidVibration, path: Path) -> None:
    """The record and its figure, and all shapes from face to face as fields of one VTU file."""
    from flexfem.fem.export import write_solid_vtu
    from flexfem.plot.modes import modes_figure

    console.keep(found.record, path, lambda _: modes_figure(found))
    shapes = {f"mode {k + 1}": found.through(k) for k in range(len(found.record.modes))}
    write_solid_vtu(found.mesh, found.heights, path.with_suffix(".vtu"), shapes)


def print_solid_modes(of: SolidNaturalModes) -> None:
    """Print frequencies with bands and kinds, shares of the mass that moves, and what plane stress says."""
    out = people()
    wedges = f"{of.triangles} triangles times {of.layers} layers in half the thickness"
    out.print(f"{of.name}: finite elements in three dimensions, {wedges}, drives disengaged")
    tilting = ", ".join(f"{value:.4g}" for value in of.tilting_inertia)
    out.print(
        f"mass {of.mass:.4g} {KILOGRAM}, of it the hub {of.hub_mass:.3g}; moments of inertia {of.inertia:.4g} "
        f"about the normal, {tilting} about x and y ({INERTIA})"
    )
    if of.payload_mass or of.payload_inertia:
        about = f"{of.payload_inertia:g} about the normal, {of.payload_tilting:g} about x and y ({INERTIA})"
        out.print(f"of it the payload {of.payload_mass:g} {KILOGRAM}; {about}")
    shares = (f"{name} mass (%)" for name in SHARES.values())
    head = ("mode", f"frequency ({HERTZ})", "band", "kind", *shares, f"plane stress ({HERTZ})")
    out.print(table(head, _rows(of.modes)))
    first = of.first_out_of_plane
    most = max(OF_KIND[first.kind], key=lambda name: getattr(first.share, name))
    out.print(
        f"first mode out of the plane: {first.frequency:.6g} ± {first.band:.2g} {HERTZ}, "
        f"{getattr(first.share, most):.3g} % of {SHARES[most]}"
    )
    out.print(
        f"band: of the mesh in the plane and of the layers (bounds {', '.join(f'{z:.3g}' for z in of.heights)} "
        f"{LENGTH} from the mid-plane); mass: effective modal mass, of the whole mass or moment of inertia"
    )
    print_ending(out, of)


def _rows(modes: list[SolidMode]) -> Iterator[list[str]]:
    for number, one in enumerate(modes, start=1):
        shares = (f"{getattr(one.share, name):.2f}" if name in OF_KIND[one.kind] else "-" for name in SHARES)
        flat = "-" if one.plane_stress is None else f"{one.plane_stress:.6g}"
        yield [str(number), f"{one.frequency:.6g}", f"{one.band:.2g}", one.kind, *shares, flat]
