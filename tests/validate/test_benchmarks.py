"""The published benchmarks, each named after its source; whatever is registered is run and must pass."""

from __future__ import annotations

from functools import cache

import pytest

from flexfem.fem.plane_stress import nodal_stress
from flexfem.fem.problem import nearest_node, on_chords
from flexfem.validate import beams, bending, exact, holes, membranes, vibrating
from flexfem.validate.records import Finding
from flexfem.validate.registry import BENCHMARKS


@cache
def findings(name: str) -> list[Finding]:
    return BENCHMARKS[name]()


def passing(name: str) -> dict[str, Finding]:
    """Findings by quantity, all of which passed."""
    failed = [
        f"{f.quantity}: {f.ours:.6g}, expected {f.target:.6g} +- {f.allowed:.2g}"
        for f in findings(name)
        if not f.passed
    ]
    assert not failed, failed
    return {found.quantity: found for found in findings(name)}


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_registered_benchmark_passes(name: str) -> None:
    assert passing(name)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_every_finding_names_its_source_and_how_well_the_target_is_known(name: str) -> None:
    for found in findings(name):
        assert found.name and found.quantity and len(found.source) > 15
        assert found.target_uncertainty >= 0 and found.unknowns > 0
        assert found.allowed >= found.target_uncertainty  # else the target itself could fail


def test_roache_manufactured_solution_has_orders_three_and_two() -> None:
    found = passing("manufactured-solution")
    assert found["order of displacement in L2"].target == 3.0
    assert found["order of its gradient in L2"].target == 2.0


def test_roache_manufactured_solution_sees_straight_geometry() -> None:
    """Middle nodes on chords cost the displacement a whole order: the arcs are part of what is verified."""
    mesh = exact.plate_mesh(0.1)
    assert exact.field_errors(on_chords(mesh)).displacement > 3 * exact.field_errors(mesh).displacement


def test_irons_patch_test() -> None:
    passing("patch-test")


def test_the_plane_has_three_rigid_body_motions() -> None:
    passing("rigid-body-motions")


def test_betti_reciprocity() -> None:
    passing("reciprocity")


def test_clapeyron_energy_and_reactions_balance() -> None:
    passing("balances")


def test_kirsch_1898_hole_in_an_infinite_plate() -> None:
    passing("kirsch-hole")


def test_howland_1930_table() -> None:
    targets = {found.quantity.split()[-1]: found.target for found in passing("howland-strips").values()}
    assert targets == {"0.1": 3.03, "0.2": 3.14, "0.3": 3.36, "0.5": 4.32}


def test_howland_1930_does_not_depend_on_poissons_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """J. H. Michell 1899: without body forces and with one free hole, plane stresses do not know the material."""
    monkeypatch.setattr(holes, "HOWLAND_TABLE", {0.3: 3.36})
    ours = holes.howland()[0].ours
    monkeypatch.setattr(holes, "PLATE", holes.PLATE._replace(poissons_ratio=0.11))
    assert holes.howland()[0].ours == pytest.approx(ours, rel=2e-4)  # of the mesh


def test_nafems_le1_elliptic_membrane() -> None:
    found = passing("nafems-le1")["stress yy at D (MPa)"]
    assert found.target == 92.7 and 17_000 < found.unknowns < 19_000


def test_nafems_le1_inner_ellipse_is_free() -> None:
    mesh = membranes.elliptic_membrane(22)
    _, solution = membranes.solve_le1(mesh)
    stress = nodal_stress(mesh, membranes.LE1_PLATE, solution.field)
    assert abs(stress[nearest_node(mesh, 2000.0, 0.0), 0]) < 0.01 * 92.7  # of the mesh


def test_cook_1974_membrane() -> None:
    assert all(found.target == 23.96 for found in passing("cook-membrane").values())


def test_macneal_harder_1985_straight_beam() -> None:
    assert {found.target for found in passing("macneal-harder-straight-beam").values()} == {0.1081, 3e-5}


def test_macneal_harder_1985_curved_beam_is_not_the_printed_beam_value() -> None:
    """0.08734 is printed; plane stress gives 0.0885, as Golovin's exact field says without any mesh."""
    passing("macneal-harder-curved-beam")
    assert beams.end_displacement() == pytest.approx(0.0885, abs=1e-4)
    assert abs(beams.clamped_end(beams.quarter_ring(*beams.CURVED_CELLS)) / 0.08734 - 1) > 0.01


def test_timoshenko_goodier_cantilever() -> None:
    passing("timoshenko-cantilever")


def test_paros_weisbord_1965_notch_as_the_neck_grows_thin() -> None:
    found = passing("circular-notch")
    assert found["rotation over (2), limit"].allowed <= 2e-5
    assert found["axial over (3), limit"].allowed <= 5e-4


def test_bisshopp_drucker_1945_elastica() -> None:
    """The elliptic integrals are those of the published table, to its five digits."""
    assert len(passing("elastica")) == 6
    for load, printed in bending.PRINTED.items():
        assert bending.tip(load) == pytest.approx(printed, abs=6e-6)
    assert bending.cantilever_bent().across[-1] > 0.8  # and the displacements are large


def test_taylor_remainder_of_the_tangent_stiffness_is_of_second_order() -> None:
    passing("tangent")
    found = bending.remainders()
    assert found.slope(found.material, bending.SMALL) == pytest.approx(1.0, abs=0.01)  # the geometric part is needed
    assert found.ours.min() < 1e-13  # down to round-off


def test_nafems_fv32_tapered_membrane() -> None:
    found = passing("nafems-fv32")
    assert [each.target for each in found.values()] == [44.623, 130.03, 162.70, 246.05, 379.90, 391.44]
    assert vibrating.tapered(2).nodes.max() == 10e3  # mm


def test_inman_bar_and_beam_vibrate_at_their_closed_forms() -> None:
    """In Hz: of the bar sqrt(70e9 / 2700) m/s over four times 0.12 m."""
    assert passing("vibrating-rods")["fixed-free bar, frequency 1 (Hz)"].target == pytest.approx(10607.8, abs=0.05)


def test_a_free_body_has_three_motions_of_no_frequency() -> None:
    passing("free-body")


def test_wedges_pass_the_patch_test_and_have_six_rigid_body_motions() -> None:
    assert passing("wedge-patch-test") and passing("wedge-rigid-motions")


def test_the_limits_of_thickness_are_plane_problems() -> None:
    found = {quantity.split(":")[0]: each for quantity, each in passing("thickness-limits").items()}
    assert list(found) == ["nu = 0", "held faces", "thin", "thick, free faces"]
    assert all(each.target == 0 for each in found.values())
    assert -5e-4 < found["thin"].ours < -2e-4  # stiffer, by the mesh
    assert found["thick, free faces"].note == "+0.250 % at b/t = 100, +0.074 % at b/t = 300"


def test_zettl_2005_plane_stress_and_plane_strain_bound_a_hinge_of_any_depth() -> None:
    """Ever nearer to plane strain; 1 - 1/1.122 and 12.2 % are what nu = 0.33 leaves between the two."""
    ours = [found.ours for found in passing("zettl-bounds").values()]
    assert ours == pytest.approx([0.018, 0.045, 0.463, 0.784, 0.951, 0.986], abs=0.003)
    notes = [found.note for found in findings("zettl-bounds")][::2]
    for note, (soft, hard) in zip(notes, [("0.2", "12.2"), ("8.7", "2.7"), ("10.9", "0.2")], strict=True):
        assert f"plane stress is {soft} % less stiff, plane strain {hard} % more" in note
