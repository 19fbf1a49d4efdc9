"""Printed tables: every cell from numbers that differ, below the head that names it and its unit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from flexfem.commands import comparisons, tables
from flexfem.plot.text import markdown_report
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


def test_errors_have_their_own_bands(cells, made):
    errors = {"one": (0.14071, 2e-4, -0.0312), "two": (0.0712, -0.031, 2.5)}
    rows = cells(comparisons.print_results, [made.result(errors, direction="y")], Path("there"))
    at = rows.index(["case", "commanded", "model", "X %", "Y %", "theta %"])
    assert rows[at + 1] == ["fig", "y", "one", "14.071 ± 0.017", "0.020 ± 0.027", "-3.120 ± 0.037"]
    assert rows[at + 2] == ["fig", "y", "two", "7.120 ± 0.117", "-3.100 ± 0.127", "250.000 ± 0.137"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"drive": "joints"}, "x, joints imposed"),
        ({"drive": "strokes"}, "x, strokes commanded"),
        ({"elements": "three_dimensional"}, "x, in three dimensions"),
    ],
)
def test_errors_say_how_the_metal_was_driven_and_which_it_was(cells, made, given, said):
    rows = cells(comparisons.print_results, [made.result({"one": (0.1, 0.2, 0.3)}, **given)], Path("there"))
    assert ("and the layers" in " ".join(rows[1])) == ("elements" in given)
    assert ["fig", said, "one"] in [row[:3] for row in rows]


def test_convergence_has_a_column_of_its_own_for_each_direction(cells, made):
    study = made.mesh_study()
    rows = cells(comparisons.print_convergence, study)
    at = rows.index(["triangles across a neck", "unknowns", "x mm/N", "y mm/N", "theta rad/(N mm)"])
    for row, resolution, unknowns, level in zip(
        rows[at + 1 : at + 5], (2, 3, 5, 8), (123, 234, 567, 1234), range(4), strict=True
    ):
        found = [study.uncertainty[axis].values[level] for axis in ("x", "y", "theta")]
        assert row[:2] == [str(resolution), str(unknowns)]
        assert numbers([row[2:]])[0] == pytest.approx(found, rel=1e-9)
    assert numbers([rows[at + 5][1:]]) == [[0.0271, 0.0263, 2.57e-5]] and rows[at + 5][0] == "extrapolated"
    assert rows[at + 6] == ["band of the finest", "7.0e-03 relative", "3.2e-02 relative", "1.6e-02 relative"]
    assert rows[at + 7] == ["observed order", "3.97", "2.96", "none"]
    assert rows[at + 8] == ["verdict", "converging", "out of range", "oscillatory"]


def test_the_budget_has_the_shares_along_each_command(cells, made):
    rows = cells(comparisons.print_budget, made.budget())
    at = rows.index(["share", "x", "y", "theta"])
    assert rows[at + 1 : at + 6] == [
        ["freedoms", "+0.216", "-0.411", "+0.137"],
        ["formula", "+11.796", "+8.523", "+9.685"],
        ["links", "+0.526", "+0.731", "-0.722"],
        ["what is left", "-0.308", "+0.092", "+0.051"],
        ["large displacement", "-0.139", "+0.253", "+0.326"],
    ]
    assert rows[at + 6] == ["total", "12.091 ± 0.013", "9.188 ± 0.127", "9.477 ± 0.245"]
    assert rows[at + 7] == ["outside it: hinges by the chart", "-10.533", "+6.217", "-8.461"]


def test_the_budget_has_what_three_dimensions_change_along_each_command(cells, made):
    rows = cells(comparisons.print_budget, made.budget(three_dimensional=made.three_dimensional))
    at = rows.index(["outside it: hinges by the chart", "-10.533", "+6.217", "-8.461"])
    assert rows[at + 1] == ["outside it: three dimensions", "-10.673 ± 0.121", "+5.217 ± 0.234", "-7.461 ± 0.345"]
    assert rows[at + 2] == ["total in three dimensions", "1.418 ± 0.134", "14.405 ± 0.361", "2.016 ± 0.590"]


def test_every_cell_of_the_page_is_its_own_number(made):
    other = made.model(
        stage="b",
        hash="fedcba9876543210" * 4,
        plane="plane_strain",
        mobility=3,
        formula="koster",
        formula_in_range=False,
        force=[[7.0, 8.0, 9.0], [0.0, 0.0, 0.0], [2.05, -0.31, 77.3]],
        resolution=7,
        triangles=777,
        unknowns=888,
    )
    errors = {"one": (0.14071, 2e-4, -0.0312), "two": (0.0712, -0.031, 2.5)}
    models = {"one": made.model(), "two": other}
    found = made.result(errors, models=models, assumed=["thickness_mm", "case: points"])
    bands = found.uncertainty["two"]
    changed = {"y": {"verdict": "divergent", "resolutions": [4, 5, 9]}, "x": {"resolutions": [4, 5, 9]}}
    changed = {axis: bands[axis].model_copy(update=new) for axis, new in changed.items()}
    found = found.model_copy(update={"uncertainty": found.uncertainty | {"two": bands | changed}})
    page = markdown_report([found]).replace("\N{NO-BREAK SPACE}", " ").splitlines()

    def below(head):
        at = page.index(head)
        return page[at + 2 : page.index("", at)]

    assert below("| case | command | curve | X | Y | θ |") == [
        "| fig | X = 50 µm | one | 14.071 ± 0.017 % | 0.020 ± 0.027 % | −3.120 ± 0.037 % |",
        "| fig | X = 50 µm | two | 7.12 ± 0.12 % | −3.10 ± 0.13 % | 250.00 ± 0.14 % |",
    ]
    assert below("| case | curve | triangles across a neck | X | Y | θ |") == [
        "| fig | one | 3, 4, 6 | ± 0.017 (converging) | ± 0.027 (converging) | ± 0.037 (converging) |",
        "| fig | two | 4, 5, 9 | ± 0.12 (converging) | ± 0.13 (divergent) | ± 0.14 (converging) |",
    ]
    head = "| case | curve | F_x | F_y | M | largest stress at the necks (finite elements) |"
    assert below(head) == [
        "| fig | one | 2.050 N | 0 | 0 | 31.7 MPa |",
        "| fig | two | 2.050 N | −0.3100 N | 77.30 N mm | 31.7 MPa |",
    ]
    head = "| stage | curve | mobility | hinge formula | stiffness | analytic | finite elements | difference |"
    rows = below(head)
    assert rows[:3] == [
        "| a stage $x_1$ | one | 6 | paros-weisbord | K_xx (N/mm) | 41.000 | 37.000 | 10.81 % |",
        "| a stage $x_1$ | one | 6 | paros-weisbord | K_yy (N/mm) | 43.000 | 38.500 | 11.69 % |",
        "| a stage $x_1$ | one | 6 | paros-weisbord | K_θθ (N mm/rad) | 47000 | 39000 | 20.51 % |",
    ]
    assert rows[3].startswith("| b | two | 3 | koster, outside its range, plane strain | K_xx (N/mm) |")
    head = "| stage | hash | triangles across a neck | triangles | unknowns |"
    assert below(head) == [
        "| a stage $x_1$ | 1234567890ab | 5 | 12345 | 54321 |",
        "| b | fedcba987654 | 7 | 777 | 888 |",
    ]
    text = "\n".join(page)
    assert "first multiplied by l₃ (21 mm)" in text and "| thickness_mm | assumed | fig |" in text
    assert "**assumed dimensions**" in text and "flexfem 0.1.0" in text and "| 1.5 s |" in text
