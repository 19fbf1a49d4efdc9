"""Printed tables: every cell from numbers that differ, below the head that names it and its unit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from flexfem.commands import tables
from flexfem.verify.answers import LoadReport, StiffnessReport
from flexfem.verify.result import Triple
from flexfem.verify.solid_report import SolidReport

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
MATRIX = [[41.5, 2.3, 310.0], [2.1, 43.5, -290.0], [330.0, -270.0, 47000.0]]
INVERSE = [[0.025, 1.5e-3, 2.5e-5], [1.25e-3, 0.0235, -3.5e-5], [4.5e-5, -5.5e-5, 2.15e-5]]
ALONG, ACROSS = Triple(x=14.071, y=13.5, theta=-12.25), Triple(x=0.125, y=0.375, theta=0.875)


@pytest.fixture
def cells(capsys):
    """What is printed of facts, line by line, as cells two or more spaces apart."""

    def read(show, *facts):
        show(*facts)
        lines = capsys.readouterr().out.splitlines()
        return [re.split(r"\s{2,}", line.strip()) for line in lines]

    return read


def numbers(rows):
    """Rows of cells that are numbers, as numbers."""
    return [[float(cell) for cell in row] for row in rows]


DOUBTS = {"warnings": [], "assumed": [], "not_stated": []}
STIFFNESS = StiffnessReport(
    *("", "S", "", "plane_stress", 6, False, "koster", "", False, MATRIX, INVERSE),
    hinge_compliance=None,
    neck_stress=np.arange(1.0, 28.0).reshape(3, 3, 3)[::-1, [1, 2, 0]] * [1.5, 2.5, 350.0],
    stress_accuracy="as far off as that",
    elements=None,
    **DOUBTS,
)
LOADED = LoadReport(
    *("", "S", "", "plane_stress", 8, 321, 654, MATRIX, INVERSE),
    force=np.array([1.5, -2.5, 35.0]),
    displacement=np.array([0.025, -0.035, 4.5e-3]),
    reaction=[-1.5, 2.5, -35.0],
    energy=1.0,
    neck_stress=[[1.5, 2.5, 3.5], [4.5, 5.5, 6.5], [7.5, 8.5, 9.5]],
    **DOUBTS,
)
ROWS = {  # of the compliance in three dimensions, %
    "band, mesh in the plane": [0.125, 0.25, 0.375],
    "band, layers through the thickness": [0.0625, 0.5, 0.75],
    "plane stress is softer by": [10.5, 9.5, 8.5],
    "plane strain is stiffer by": [1.5, 1.25, 2.5],
}
IN_PLANE, THROUGH, SOFTER, STIFFER = (np.diag(INVERSE) * np.diag(row) / 100 for row in ROWS.values())
SOLID = SolidReport(
    *("", "S", "", "three_dimensional", 8, 3, [0.0, 3.25, 4.5, 5.5], 321, 654),
    *(np.array(each) for each in (MATRIX, INVERSE, IN_PLANE + THROUGH, IN_PLANE, THROUGH)),
    plane_stress=INVERSE + SOFTER,
    plane_strain=INVERSE - STIFFER,
    neck_height=[[0.5, 1.25, 1.75], [2.25, 2.75, 3.5], [3.75, 4.25, 5.5]],
    **{name: getattr(LOADED, name) for name in ("force", "displacement", "reaction", "energy", "neck_stress")},
    **DOUBTS,
)


@pytest.mark.parametrize(
    ("show", "facts", "names"),
    [
        (tables.print_stiffness, STIFFNESS, (" K_uu", " C_uu")),
        (tables.print_load, LOADED, ("", "")),
        (tables.print_solid, SOLID, ("", "")),
    ],
)
def test_matrices_are_printed_row_by_row_with_their_units(cells, show, facts, names):
    rows = cells(show, facts)
    for matrix, title in (
        (MATRIX, f"stiffness{names[0]}, N/mm and N mm/rad (x, y, theta)"),
        (INVERSE, f"compliance{names[1]}, mm/N and rad/(N mm) (x, y, theta)"),
    ):
        at = rows.index([title])
        cut = [re.split(r"\s+", " ".join(row)) for row in rows[at + 1 : at + 4]]
        assert numbers(cut) == matrix


def test_the_highest_neck_stress_is_named_with_its_neck_in_units_of_each_direction(cells):
    """Of 1 to 27 MPa per mm, mm and rad, the highest are at the elbow hinge of chain 1."""
    rows = [" ".join(row) for row in cells(tables.print_stiffness, STIFFNESS)]
    at = rows.index("highest neck stress per displacement, the others held:")
    assert rows[at + 1 : at + 5] == [
        "x 0.0375 MPa/um, elbow hinge, chain 1",
        "y 0.065 MPa/um, elbow hinge, chain 1",
        "theta 9.45 MPa/mrad, elbow hinge, chain 1",
        "stress: as far off as that",
    ]


@pytest.mark.parametrize(("show", "facts"), [(tables.print_load, LOADED), (tables.print_solid, SOLID)])
def test_the_answer_to_a_load_is_in_n_mm_rad_and_mpa(cells, show, facts):
    """That of finite elements in three dimensions is also compared with the plane ones, and has heights."""
    printed = cells(show, facts)
    rows = [re.split(r"\s+", " ".join(row)) for row in printed]
    assert ["force", "1.500000e+00", "-2.500000e+00", "3.500000e+01", "N,", "N,", "N", "mm"] in rows
    assert ["displacement", "2.500000e-02", "-3.500000e-02", "4.500000e-03", "mm,", "mm,", "rad"] in rows
    at = next(k for k, row in enumerate(rows) if "necks," in row)
    assert "MPa," in rows[at] and " ".join(rows[at]).endswith("(base, elbow, platform):")
    assert rows[at + 1 : at + 4] == [["1", "1.5", "2.5", "3.5"], ["2", "4.5", "5.5", "6.5"], ["3", "7.5", "8.5", "9.5"]]
    assert "321 triangles" in " ".join(rows[0]) and "654 unknowns" in " ".join(rows[0])
    if facts is SOLID:
        assert printed[1] == ["bounds of the layers from the mid-plane, mm: 0, 3.25, 4.5, 5.5"]
        shares = printed.index(["of the compliance, %", "x", "y", "theta"])
        said = {row[0]: [float(cell) for cell in row[1:]] for row in printed[shares + 1 : shares + 5]}
        assert said == {name: pytest.approx(row, rel=0.005) for name, row in ROWS.items()}
        at = printed.index(["where, mm from the mid-plane (the face is at 5.5):"])
        assert [row[1:] for row in rows[at + 1 : at + 4]] == [[str(v) for v in row] for row in SOLID.neck_height]


def test_a_formula_outside_its_range_is_called_so(cells):
    assert "koster (outside its range" in cells(tables.print_stiffness, STIFFNESS)[0][0]
    assert "outside" not in cells(tables.print_stiffness, STIFFNESS._replace(formula_in_range=True))[0][0]
