"""Natural frequencies by NGSolve and by CalculiX: on our mesh, with the hub's mass, and not without it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.fem.export import write_frequency_deck
from flexfem.fem.mesh import determinants
from flexfem.fem.modes import structure, total_mass
from flexfem.fem.response import tie_hub
from flexfem.fem.sectors import build_mesh
from flexfem.refused import ComputationFailed
from flexfem.validate import calculix, frequencies
from flexfem.validate.frequencies import ComparedFrequencies, Vibrating

from ..conftest import UNLIKE, with_changes

PRINTED = """
     E I G E N V A L U E   O U T P U T

 MODE NO    EIGENVALUE                       FREQUENCY
                                     REAL PART            IMAGINARY PART
                           (RAD/TIME)      (CYCLES/TIME     (RAD/TIME)

      1   0.6830485E+06   0.8264675E+03   0.1315364E+03   0.0000000E+00
      2   0.2076296E+10   0.4556639E+05   0.7252116E+04   0.0000000E+00

     P A R T I C I P A T I O N   F A C T O R S

MODE NO.   X-COMPONENT     Y-COMPONENT     Z-COMPONENT     X-ROTATION      Y-ROTATION      Z-ROTATION

      1  -0.1330072E-03   0.7925738E-02  -0.7148776E-20   0.1092244E-18
"""


@pytest.fixture(scope="module")
def vibrating(six) -> Vibrating:
    return frequencies.vibrating(six.stage, six.mesh)


@pytest.fixture(scope="module")
def drawn(vibrating) -> Vibrating:
    return frequencies.drawn_hub(vibrating)


def test_a_drawn_hub_weighs_what_the_disc_does_and_follows_the_pose(vibrating, drawn) -> None:
    """Nine curved edges make a disc of 8 mm radius to 1.3e-3 in mass, 2.6e-3 in inertia; no triangle is turned over."""
    whole = [
        total_mass(structure(of.mesh, of.plate, of.density, tie_hub(of.mesh), of.carried)) for of in (vibrating, drawn)
    ]
    disc = np.pi * 8.0**2 * 10.0 * 2810e-12
    np.testing.assert_allclose((whole[1] - whole[0])[[0, 2], [0, 2]] / [disc, disc * 32], 0, atol=3e-3)
    assert abs(whole[1][0, 1]) < 1e-12 and abs(whole[1][0, 2]) < 1e-9
    new = drawn.mesh.nodes[len(vibrating.mesh.nodes) :]
    assert set(range(len(vibrating.mesh.nodes), len(drawn.mesh.nodes))) <= set(tie_hub(drawn.mesh).hub.tolist())
    assert np.hypot(*new.T).max() < 4.001 and np.hypot(*new.T).min() == 0
    added = drawn.mesh.triangles[len(vibrating.mesh.triangles) :]
    assert determinants(drawn.mesh.nodes[added], np.array([[0.2, 0.3], [0.6, 0.2], [0.1, 0.8]])).min() > 0


def test_the_rim_may_be_given_either_way_round(vibrating, drawn) -> None:
    rim = vibrating.mesh.edges["hub"].copy()
    rim[::2] = rim[::2, [1, 0, 2]]
    again = frequencies.drawn_hub(
        vibrating._replace(mesh=vibrating.mesh._replace(edges=vibrating.mesh.edges | {"hub": rim}))
    )
    np.testing.assert_array_equal(np.sort(again.mesh.triangles), np.sort(drawn.mesh.triangles))
    added = again.mesh.triangles[len(vibrating.mesh.triangles) :]
    assert determinants(again.mesh.nodes[added], np.array([[0.3, 0.3]])).min() > 0


def test_the_disc_of_the_other_solver_has_its_own_mass_and_inertia(vibrating) -> None:
    """8 mm, 10 mm thick, 2810 kg/m^3: m = 5.65 g, J = m r^2 / 2."""
    m = 5.64984e-6
    np.testing.assert_allclose(vibrating.disc, np.diag([m, m, 32 * m]), rtol=1e-5, atol=0)
    np.testing.assert_allclose(vibrating.carried, vibrating.disc, rtol=1e-12, atol=1e-20)


@pytest.mark.slow
@pytest.mark.usefixtures("ccx")
def test_calculix_has_the_frequencies_to_the_digits_printed(vibrating) -> None:
    found = frequencies.against_calculix(vibrating)
    np.testing.assert_allclose(found.theirs, found.ours, rtol=5e-7)
    np.testing.assert_allclose(found.theirs, [131.54, 131.54, 193.95, 7214.6, 7214.6, 7621.9], rtol=5e-5)
    assert 1e-6 < frequencies.apart(found.theirs, found.default) < 1e-4


def test_the_mass_of_the_hub_lowers_the_frequencies(vibrating) -> None:
    light, own = (frequencies.ours(each) for each in (vibrating._replace(carried=np.zeros((3, 3))), vibrating))
    assert light[0] / own[0] > 1.05 and light[2] / own[2] > 1.003


@pytest.mark.slow
@pytest.mark.usefixtures("ccx")
@pytest.mark.parametrize("model", ["plane_stress", "plane_strain"])
def test_both_solvers_have_the_frequencies_of_unlike_chains(model: str) -> None:
    stage = with_changes({"override": UNLIKE, "model": model})
    of = frequencies.vibrating(stage, build_mesh(stage, 3))
    ng, ccx = frequencies.against_ngsolve(of), frequencies.against_calculix(of)
    np.testing.assert_allclose(ng.theirs, ng.ours, rtol=1e-9)
    np.testing.assert_allclose(ccx.theirs, ccx.ours, rtol=5e-7)
    assert np.all(np.diff(ng.theirs) > 1e-4 * ng.theirs[:-1])


@pytest.mark.parametrize(("solver", "off", "passed"), [
    ("ngsolve", 0.9e-8, True), ("ngsolve", 1.1e-8, False), ("calculix", 0.9e-6, True), ("calculix", 1.1e-6, False),
    ("ngsolve", float("nan"), False),
])  # fmt: skip
def test_one_frequency_too_far_off_fails(six, monkeypatch, solver: str, off: float, passed: bool) -> None:
    values = np.array([100.0, 200.0, 300.0])
    found = ComparedFrequencies(values, values * [1, 1 - off, 1], values * 1.5, 3.0)
    monkeypatch.setitem(frequencies.AGAINST, solver, (lambda _: found, frequencies.AGAINST[solver][1]))
    both, (ours, default) = frequencies.compared(six.stage, six.mesh, solver)
    assert both is found and ours.passed == passed and default.passed
    assert default.difference == pytest.approx(0.5, rel=1e-5, nan_ok=True) or np.isnan(off)


def test_theirs_are_held_against_ours_by_their_quadrature_and_against_ours_by_default(six, monkeypatch) -> None:
    """Theirs 1.25 times ours, and our defaults 1.5 times: 25 % and 20 % apart."""
    values = np.array([100.0, 200.0, 300.0])
    found = ComparedFrequencies(values, values * [1, 1.25, 1], values * [1, 1.5, 1], 3.0)
    monkeypatch.setitem(frequencies.AGAINST, "ngsolve", (lambda _: found, 1e-8))
    _, (ours, default) = frequencies.compared(six.stage, six.mesh, "ngsolve")
    assert (ours.difference, default.difference) == (pytest.approx(0.25), pytest.approx(0.2))
    assert not ours.passed and default.passed


def test_frequencies_are_read_in_hertz_from_the_first_table() -> None:
    np.testing.assert_array_equal(frequencies.printed_frequencies(PRINTED), [131.5364, 7252.116])
    assert len(frequencies.printed_frequencies("nothing")) == 0
    with pytest.raises(ComputationFailed, match="not numbers"):
        frequencies.printed_frequencies(PRINTED.replace("0.1315364E+03", "*************"))


def test_calculix_without_frequencies_is_one_line(vibrating, monkeypatch) -> None:
    monkeypatch.setattr(calculix, "find_program", lambda: "ccx")
    monkeypatch.setattr(calculix, "run", lambda *_: " *ERROR: too few\n equations\n")
    with pytest.raises(ComputationFailed, match=r"^CalculiX gave no frequencies: \*ERROR: too few equations$"):
        frequencies.by_calculix(vibrating)


def test_the_deck_has_the_density_of_the_sheet_and_asks_for_frequencies(six, tmp_path: Path) -> None:
    path = tmp_path / "stage.inp"
    write_frequency_deck(six.mesh, six.plate, path, 2739e-12, 7)
    lines = path.read_text().splitlines()
    assert lines[-4:] == ["*STEP", "*FREQUENCY", "7", "*END STEP"] and "*STATIC" not in lines
    at = lines.index("*DENSITY")
    assert float(lines[at + 1]) == 2.739e-9 and lines.index("*MATERIAL, NAME=sheet") < at
    assert at < lines.index("*SOLID SECTION, ELSET=stage, MATERIAL=sheet")
    assert "*ELASTIC, TYPE=ENGINEERING CONSTANTS" in lines
