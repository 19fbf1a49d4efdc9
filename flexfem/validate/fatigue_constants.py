"""Basquin's law with published constants: Dowling's example of a fit, and his table of materials."""

from __future__ import annotations

from flexfem.hinges.strength import fit_basquin, required_law
from flexfem.mechanism.materials import materials
from flexfem.validate.records import Finding

BOOK = "N. E. Dowling, Mechanical Behavior of Materials, 4th ed., Pearson (2013)"
STRESS, CYCLES = (948, 834, 703, 631, 579, 524), (222, 992, 6004, 14130, 43860, 132150)  # MPa; Table E9.1
TABLE = {"steel-4340": 1643.0, "al-2024-t4": 839.0, "ti-6al-4v-sta": 1889.0}  # A, MPa
ROUNDED = 0.5  # MPa


def dowling_fit() -> list[Finding]:
    """The constants of AISI 4340 from six S-N points."""
    found, source = fit_basquin(STRESS, CYCLES), f"{BOOK}, Example 9.1"
    rows = [
        ("A (MPa)", 1587.0, found.A, ROUNDED),
        ("B", -0.0945, found.B, 5e-5),
        ("sigma'_f (MPa)", 1695.0, found.coefficient, ROUNDED),
    ]
    return [Finding("Dowling's fit", source, *row, row[-1], unknowns=2) for row in rows]


def dowling_table() -> list[Finding]:
    """The stress at one cycle of the table, by the coefficient and exponent that the library has from it."""
    source, note = f"{BOOK}, Table 9.1", "A recalled, not copied from a print: 2^b sigma'_f of the same row"
    known = {name: float(required_law(materials()[name]).amplitude(1.0)) for name in TABLE}
    return [
        Finding("Dowling's table", source, f"A of {name} (MPa)", target, known[name], ROUNDED, ROUNDED, 1, note)
        for name, target in TABLE.items()
    ]
