"""Every registered problem is solved and must agree; and the problems see what they are there to
see.
"""

from __future__ import annotations

import os
from functools import cache

import numpy as np
import pytest

from . import consistency, hinge, large, manual, solvers
from .fields import on_chords
from .problem import PROBLEMS, Finding, MissingSolverError, extrapolated, order

REGISTERED = (manual.REGISTERED, solvers)


@cache
def findings(name: str) -> dict[str, Finding]:
    """Findings by quantity. Skipped without the other solver, but where CI runs."""
    try:
        return {found.quantity: found for found in PROBLEMS[name].run()}
    except MissingSolverError as missing:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(missing))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * each.slow) for name, each in PROBLEMS.items()],
)
def test_every_registered_problem_agrees_with_its_source(name: str) -> None:
    for found in findings(name).values():
        assert found.passed, (
            f"{found.quantity}: {found.ours:.6g}, expected {found.target:.6g} +- "
            f"{found.allowed:.2g}"
        )
        assert (
            found.unknowns > 0 and found.allowed >= found.uncertainty >= 0
        )  # else the target itself could fail


def test_a_manufactured_solution_sees_straight_geometry() -> None:
    """Middle nodes on chords cost the displacement a whole order: the arcs are part of what is
    verified.
    """
    mesh = consistency.plate_mesh(0.1)
    straight = consistency.field_errors(on_chords(mesh)).displacement
    assert straight > 3 * consistency.field_errors(mesh).displacement


def test_macneal_harder_1985_curved_beam_is_not_the_printed_beam_value() -> None:
    """0.08734 is printed; plane stress gives 0.0885, as Golovin's exact field says without any
    mesh.
    """
    found = findings("macneal-harder-curved-beam")["end displacement, clamped, even load"]
    assert found.target == pytest.approx(0.0885, abs=1e-4) and abs(found.ours / 0.08734 - 1) > 0.01


def test_bisshopp_drucker_1945_elliptic_integrals_are_those_of_the_published_table() -> None:
    for load, printed in large.PRINTED.items():
        assert large.tip(load) == pytest.approx(printed, abs=6e-6)
    assert large.bent()[0][-1, 0] > 0.8  # and the displacements are large


def test_a_tangent_without_its_geometric_part_leaves_a_remainder_of_first_order() -> None:
    found = large.remainders()
    assert large.observed(found.material, large.SMALL) == pytest.approx(1.0, abs=0.01)
    assert found.ours.min() < 1e-13  # down to round-off


def test_zettl_2005_a_hinge_comes_ever_nearer_to_plane_strain() -> None:
    ours = [found.ours for found in findings("zettl-bounds").values()]
    assert ours == pytest.approx([0.018, 0.045, 0.463, 0.784, 0.951, 0.986], abs=0.003)
    soft, hard = (hinge.plane(0.33, strain)[2, 2] for strain in (False, True))
    assert soft / hard == pytest.approx(1.122, abs=0.003)  # 1 / (1 - nu^2), of a slender neck


def test_order_and_limit_of_a_power_law() -> None:
    sizes = (0.4, 0.2, 0.1)
    assert order(sizes, [3 * h**2.3 for h in sizes]) == pytest.approx(2.3)
    assert extrapolated(sizes, [5.1 - 3 * h**1.7 for h in sizes]) == pytest.approx(5.1)
    assert extrapolated(sizes, [1.0, 2.0, 1.5]) == 1.5  # no monotonic convergence, no extrapolation
    with pytest.raises(ValueError, match="one ratio"):
        extrapolated((0.4, 0.2, 0.15), (1.0, 2.0, 3.0))


def test_not_a_number_never_passes_and_the_manual_says_what_fails() -> None:
    found = [Finding("a", 1.0, ours, 0.5) for ours in (float("nan"), 1.5, 0.4)]
    assert [each.passed for each in found] == [False, True, False]
    page = manual.manual({"patch-test": found}, {})
    assert "2 of 3 fail" in page and page.count("**fails**") == 2 and "## Patch test" in page


@pytest.fixture(scope="module")
def sheet() -> solvers.Sheet:
    return solvers.sheets()["mobility six"]


@pytest.mark.parametrize(
    "wrong",
    [
        lambda mesh, plate: (mesh, plate._replace(poissons_ratio=0.3301)),
        lambda mesh, plate: (mesh, plate._replace(thickness=plate.thickness + 1e-5)),
        lambda mesh, plate: (
            mesh._replace(edges=mesh.edges | {"ground": mesh.edges["ground"][:-1]}),
            plate,
        ),
        lambda mesh, plate: (mesh._replace(nodes=mesh.nodes * [1.0, 1 + 1e-6]), plate),
    ],
    ids=["poissons ratio", "thickness", "an edge unclamped", "a millionth in geometry"],
)
def test_a_wrong_problem_is_seen_beside_ngsolve(sheet: solvers.Sheet, wrong) -> None:
    pytest.importorskip("ngsolve")
    differences = solvers.against_ngsolve(
        sheet, solvers.ngsolve.solve(*wrong(sheet.mesh, sheet.plate))
    )
    assert differences["pose"] > solvers.NGSOLVE


def test_rotations_differ_by_their_way_at_the_lever() -> None:
    """At a lever of 8 mm a rotation of 0.5 per N is 4 mm, and per N mm it counts 64 times."""
    ours = np.diag([4.0, 2.0, 0.01])
    for entry, change, expected in (
        ((0, 0), 0.25, 0.0625),
        ((2, 0), 0.5, 1.0),
        ((2, 2), 0.01, 0.16),
    ):
        theirs = ours.copy()
        theirs[entry] += change
        assert solvers.pose_difference(ours, theirs, 8.0) == pytest.approx(expected)


def test_printed_displacements_are_sorted_and_mend_fortrans_long_exponents() -> None:
    printed = (
        "\n displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n         2  "
        "1.500000E+00 -2.500000-101  0.000000E+00\n         1  3.000000E-04  4.000000E+00  "
        "1.000000+100\n"
    )
    (found,) = solvers.calculix.printed_displacements(printed, "all")
    np.testing.assert_array_equal(found, [[3e-4, 4.0], [1.5, -2.5e-101]])
