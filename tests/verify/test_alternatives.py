"""What else could have produced the paper's curves: every alternative, with its own model and its own metal."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flexfem.analytic.large import close_loops
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, analyse, assemble
from flexfem.analytic.paper import AXIAL, stiffness
from flexfem.fem.cyclic import cyclic_response
from flexfem.fem.response import plate_of, platform_response
from flexfem.fem.sectors import build_mesh, mesh_sectors, welded
from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.stage import load_stage
from flexfem.questions.bands import error_matrix
from flexfem.refused import BadInput
from flexfem.verify import alternatives as other
from flexfem.verify import other_elements as meshed
from flexfem.verify import other_stages as made
from flexfem.verify import solid_budget as extruded

ROOT = Path(__file__).parents[2]
ROUND_OFF = 1e-8  # per cent; 3 x 3 products of matrices whose entries differ by 1e5


def test_an_alternative_errs_along_its_commands_and_at_most_so_much_across_each():
    percent = np.array([[1.0, -7.0, 3.0], [5.0, -2.0, -4.0], [-6.0, 8.0, 9.0]])  # column j for command j
    found = other._row("made up", 6, percent)
    assert found.along.model_dump() == {"x": 1.0, "y": -2.0, "theta": 9.0}
    assert found.across.model_dump() == {"x": 6.0, "y": 8.0, "theta": 4.0}
    assert "| made up | 6 | 1.000 | 6.000 | -2.000 | 8.000 | 9.000 | 4.000 |" in other.markdown_alternatives([found])


def test_errors_of_a_command_stand_in_its_column():
    """Softer by 10, 20 and 50 %, and moved across by the force of the command."""
    K, C = np.diag([40.0, 50.0, 46000.0]), np.diag([1.1 / 40, 1.2 / 50, 1.5 / 46000])
    C[1, 0], C[2, 0], C[0, 2] = 3e-4, 2e-6, 2e-6
    found = error_matrix(K, C, 24.0)
    expected = [[10.0, 0.0, 100 * 2e-6 * 46000 / 24], [1.2, 20.0, 0.0], [100 * 2e-6 * 40 * 24, 0.0, 50.0]]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_stubby_necks_are_a_third_of_their_radius_and_all_of_it(six):
    for ratio, base, elbow in ((3.0, 4.0 / 3, 0.5), (1.0, 4.0, 1.5)):
        stage = made.with_necks(six, ratio)
        np.testing.assert_allclose(stage.array("neck"), [[base, elbow, elbow]] * 3, rtol=1e-12)
        np.testing.assert_array_equal(stage.array("radius"), [[4.0, 1.5, 1.5]] * 3)


def test_every_alternative_is_measured_with_its_own_model_on_its_own_stage(three, six, monkeypatch):
    """Stand-ins for everything slow; what remains is which stage, model, formula and mesh go together."""
    real = {stage: 1.13 * analyse(stage).compliance for stage in (three, six)}
    monkeypatch.setattr(meshed, "linear_compliance", lambda mesh, plate: 1.5 * mesh)
    monkeypatch.setattr(
        meshed, "cyclic_response", lambda sectors, plate: SimpleNamespace(compliance=sectors * plate.youngs_modulus)
    )
    monkeypatch.setattr(meshed, "uneven_sectors", lambda stage, thirds: real[stage] * sum(thirds))
    monkeypatch.setattr(meshed, "welded", lambda sectors: (sectors, None))
    monkeypatch.setattr(other, "joint_command", lambda stage, model, real=CALIBRATED: np.eye(3) * len(real))
    on_metal = {"joints": 5.0, "strokes": 7.0}
    monkeypatch.setattr(made, "joints_on_metal", lambda stage, model, drive: np.eye(3) * model * on_metal[drive])
    monkeypatch.setattr(made, "scatter", lambda stage, model: np.arange(1.0, 101.0)[:, None, None] * np.eye(3))

    monkeypatch.setattr(other, "other_thickness", lambda stage, C: {"extruded": 0.9 * C, "charted": 0.8 * C})

    def solve(stage, resolution):
        compliance = real.get(stage, analyse(stage).compliance)
        finer = compliance * resolution
        return SimpleNamespace(mesh=finer, response=SimpleNamespace(compliance=compliance, sectors=finer))

    found = {(each.name, each.mobility): each.along.x for each in other.alternatives(three, six, solve)}

    def error(stage, model, compliance, formula=DEFAULT_FORMULA):
        return 100 * (analyse(stage, model, formula).stiffness[0, 0] * compliance - 1)

    for stage, model in ((three, 3), (six, 6)):
        E, metal = 71.7e3, real[stage][0, 0]
        thick = stage.replace(neck={"base": 0.51, "elbow": 0.51, "platform": 0.51})
        K = analyse(stage, model).stiffness
        pressed = np.linalg.inv(np.linalg.inv(real[stage]) + made.preload_stiffness(stage, 30.0))[0, 0]
        expected = {
            "none: curved quadratic triangles, as verified": error(stage, model, metal),
            "linear triangles, 2 across every neck": error(stage, model, 2 * 1.5 * metal),
            "asymmetric mesh, 3, 4, 4 linear triangles": error(stage, model, 11 * 1.5 * metal),
            "asymmetric mesh, 1, 2, 2 quadratic triangles": error(stage, model, 5 * E * metal),
            "finite elements in plane strain, the limit of wide necks": error(
                stage, model, 8 * E / (1 - 0.33**2) * metal
            ),
            "extruded": error(stage, model, 0.9 * metal),
            "charted": error(stage, model, 0.8 * metal),
            "hinge formula koster": error(stage, model, metal, "koster"),
            "hinge formula calibrated": error(stage, model, metal, "calibrated"),
            "necks of the metal 10 um thicker than drawn": error(stage, model, analyse(thick).compliance[0, 0]),
            "necks scattered by 5 um, median of 200 stages": 50.5,
            "necks scattered by 5 um, 95 % of 200 stages": 95.05,
            "load applied and pose read 0.5 mm off the centre in X and in Y": 100
            * (K[0, 0] * (metal + 0.25 * real[stage][2, 2]) - 1),
            "base necks pressed with 30 N, which the model leaves out": error(stage, model, pressed),
            "joints commanded instead of the platform": 5.0 * model,
            "strokes commanded instead of the platform": 7.0 * model,
        }
        for name, value in expected.items():
            assert found[name, model] == pytest.approx(value, rel=1e-9), name
    left_out = error(six, 3, real[six][0, 0])
    assert found["axial freedom left out, on the mobility-six stage", 3] == pytest.approx(left_out, rel=1e-9)
    crossed = "stiffness of its own stage on the metal of the mobility-"
    assert found[f"{crossed}six stage", 3] == pytest.approx(error(three, 3, real[six][0, 0]), rel=1e-9)
    assert found[f"{crossed}three stage", 6] == pytest.approx(error(six, 6, real[three][0, 0]), rel=1e-9)
    for ratio in (3.0, 1.0):
        stage, name = made.with_necks(six, ratio), f"R/t = {ratio:g} in the mobility-six stage, all freedoms as metal"
        for model in (3, 6):
            metal = error(stage, model, analyse(stage, 21).compliance[0, 0])
            assert found[name, model] == pytest.approx(metal, rel=1e-9) and metal > 0
            assert found[f"{name}, joints commanded", model] == len("paros-weisbord")
    formulas = len(FORMULAS) - 1
    assert len(found) == 2 * (1 + 4 + 4 + 1 + 2 + formulas + 4 + 3 + 3 + 2) + 3 + 8


def test_the_errors_of_joints_commanded_are_those_of_the_cases(six):
    """Finite elements of the same resolution as `cases/joints-x.toml`; rows of `alternatives` are no other numbers."""
    kept = json.loads((ROOT / "tests/baselines/joints-x.json").read_text())["record"]["result"]["error_percent"]
    rows = json.loads((ROOT / "tests/baselines/claims.json").read_text())["record"]["claims"]["alternatives"]
    for model, label in ((3, "mobility three"), (6, "mobility six")):
        (row,) = [
            each
            for each in rows
            if (each["name"], each["mobility"]) == ("joints commanded instead of the platform", model)
        ]
        assert row["along"]["x"] == pytest.approx(kept[label]["x"], abs=1e-5)
        assert row["across"]["x"] == pytest.approx(abs(kept[label]["y"]), abs=1e-5)


def test_a_stage_without_stacks_has_no_strokes_and_with_thin_necks_none_thinner(six, monkeypatch):
    monkeypatch.setattr(made, "joints_on_metal", lambda stage, model, drive: np.eye(3))
    passive = six.replace(actuator=[])
    assert list(made.driven_joints(passive, 6)) == ["joints commanded instead of the platform"]
    with pytest.raises(BadInput, match=r"a neck of 0\.009 mm"):
        made.necks_changed(six.replace(override={(2, "elbow"): {"neck": 0.009}}), -0.01)


def test_thicker_necks_are_thicker_in_every_hinge(six):
    stage = six.replace(override={(2, "elbow"): {"neck": 0.61}, (3, "base"): {"radius": 3.1}})
    np.testing.assert_allclose(made.necks_changed(stage, 0.01).array("neck") - stage.array("neck"), 0.01, rtol=1e-9)
    np.testing.assert_array_equal(made.necks_changed(stage, 0.01).array("radius"), stage.array("radius"))


def test_a_load_off_the_centre_turns_and_a_pose_read_there_moves_with_the_rotation(six):
    """A unit force at (0.5, 0.5) mm by hand: its moment about the centre is 0.5 Fy - 0.5 Fx."""
    C = np.array([[0.026, 0.001, 2e-5], [0.001, 0.024, -1e-5], [2e-5, -1e-5, 2.4e-5]])
    K = analyse(six, 6).stiffness
    expected = {name: np.zeros((3, 3)) for name in ("load applied", "pose read", "load applied and pose read")}
    for axis in range(3):
        F = K[:, axis]
        there = F + np.array([0.0, 0.0, 0.5 * F[1] - 0.5 * F[0]])
        for name, load, read in (
            ("load applied", there, False),
            ("pose read", F, True),
            ("load applied and pose read", there, True),
        ):
            u = C @ load
            moved = u + np.array([-0.5 * u[2], 0.5 * u[2], 0.0]) * read
            expected[name][:, axis] = (moved - np.eye(3)[axis]) * [1, 1, 24] / (24 if axis == 2 else 1) * 100
    found = made.off_centre(six, 6, C)
    for name, percent in expected.items():
        np.testing.assert_allclose(found[f"{name} 0.5 mm off the centre in X and in Y"], percent, rtol=1e-9, atol=1e-9)


def test_an_axial_force_in_the_base_necks_is_worth_what_the_energy_says():
    """-1.2 % of K_xx for 10 N on the reference stage; with unlike chains by central differences of the energy."""
    six = load_stage(ROOT / "geometry/mobility6.toml")
    change = 100 * np.diag(made.preload_stiffness(six, 10.0)) / np.diag(analyse(six, 6).stiffness)
    np.testing.assert_allclose(change, [-1.17, -1.17, -2.79], atol=0.005)
    stage = six.replace(override={(2, "elbow"): {"neck": 0.61}, (3, "base"): {"radius": 3.1}})
    of, h, force = assemble(stage, 6), 2e-5, 10.0
    sliding = (of.joints.kind == AXIAL) & (of.joints.hinge == 0)
    steps = h * np.array([np.eye(6)[i] * a + np.eye(6)[j] * b for i, j in np.ndindex(6, 6) for a, b in SIGNS])
    start = np.zeros((len(steps), len(sliding)))
    start[:, of.choice.independent] = steps
    phi = close_loops(of, start)
    work = {N: np.sum(of.springs * phi**2, axis=-1) / 2 - N * np.sum(phi * sliding, axis=-1) for N in (0.0, force)}
    second = {N: (E.reshape(6, 6, 4) @ [1, -1, -1, 1]) / (4 * h**2) for N, E in work.items()}
    G = stiffness(of).influence.G_u
    K = {N: np.linalg.inv(G @ np.linalg.inv(H) @ G.T) for N, H in second.items()}
    found = made.preload_stiffness(stage, force)
    np.testing.assert_allclose(found, K[force] - K[0.0], atol=1e-3 * np.max(np.abs(np.diag(found))))


SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def test_without_scatter_nothing_errs_across(modelled):
    stage, model = modelled
    exact = made.scatter(stage, model, deviation=0.0, draws=1)[0]
    lever = stage.chain.link_lengths[2]
    expected = error_matrix(
        analyse(stage, model).stiffness, analyse(stage, 21, CALIBRATED, links=True).compliance, lever
    )
    np.testing.assert_allclose(exact, expected, atol=ROUND_OFF)
    assert np.max(np.abs(exact[~np.eye(3, dtype=bool)])) < ROUND_OFF


def test_cross_errors_grow_in_proportion_to_a_small_scatter(modelled):
    one, two = (made.scatter(*modelled, deviation=d, draws=5)[:, 0, 1] for d in (1e-6, 2e-6))
    np.testing.assert_allclose(two, 2 * one, rtol=1e-4)  # relative scatter of 4e-6, second order below


def test_commanding_all_joints_of_the_metal_is_exact(modelled):
    error = made.joint_command(modelled[0], 21, DEFAULT_FORMULA)
    assert np.max(np.abs(error)) < 1e-6  # per cent; constraints of stiff shear joints next to soft rotations


def test_commanding_few_joints_errs_across_even_in_a_symmetric_stage(modelled):
    error = made.joint_command(*modelled)
    assert abs(error[1, 0]) > 1e-3 and error[1, 0] == pytest.approx(-error[0, 1], rel=1e-6)  # no mirror symmetry
    assert np.max(np.abs([*error[:2, 2], *error[2, :2]])) < ROUND_OFF  # three-fold symmetry


def test_linear_triangles_err_to_the_stiff_side(modelled):
    stage, _ = modelled
    mesh, plate = build_mesh(stage, 2), plate_of(stage)
    linear = meshed.linear_compliance(mesh, plate)
    np.testing.assert_allclose(linear, linear.T, atol=1e-9 * np.max(np.abs(linear)))
    assert np.all(np.diag(linear) < 0.9 * np.diag(platform_response(mesh, plate).compliance))  # far stiffer in bending


def test_uneven_mesh_of_equal_thirds_is_the_mesh(modelled):
    stage, _ = modelled
    one, two = welded(meshed.uneven_sectors(stage, (2, 2, 2)))[0], build_mesh(stage, 2)
    found, expected = (meshed.linear_compliance(mesh, plate_of(stage)) for mesh in (one, two))
    np.testing.assert_allclose(np.diag(found), np.diag(expected), rtol=1e-9)


def test_three_dimensions_change_the_plane_stage_by_what_is_measured_and_by_what_is_charted(six, monkeypatch):
    C, solid, plane = (
        np.diag(values) for values in ([0.026, 0.027, 2e-5], [0.024, 0.023, 1.8e-5], [0.03, 0.031, 3e-5])
    )
    asked = []
    monkeypatch.setattr(
        extruded, "solve_solid", lambda *given: asked.append(given[1:]) or SimpleNamespace(compliance=solid, sectors=())
    )
    monkeypatch.setattr(extruded, "cyclic_response", lambda *_: SimpleNamespace(compliance=plane))
    found = extruded.other_thickness(six, C)
    measured, charted = found.values()
    assert asked == [(4, 3)]
    np.testing.assert_allclose(measured, np.diag([0.020, 0.019, 0.8e-5]))
    flat = analyse(six, 21, CALIBRATED, links=True).compliance
    thick = analyse(six.model_copy(update={"model": "corrected"}), 21, CALIBRATED, links=True).compliance
    np.testing.assert_allclose(charted, C + thick - flat)
    assert charted[0, 0] < C[0, 0] - 0.08 * flat[0, 0]
    wide = six.model_copy(update={"thickness": 400.0})  # off the chart
    assert list(extruded.other_thickness(wide, C)) == ["finite elements in three dimensions"]


@pytest.mark.parametrize("model", ["plane_stress", "plane_strain"])
def test_plane_strain_is_that_of_the_metal_whatever_the_stage_is(six, model, monkeypatch):
    """The constants of the held solid from Hooke's law in three dimensions, not from those of the stage's own model."""
    E, nu, lever = 207e3, 0.29, 24.0
    metal = six.material.model_copy(update={"youngs_modulus": E, "poissons_ratio": nu})
    stage = six.model_copy(update={"material": metal, "model": model})
    sectors = mesh_sectors(stage, 2)
    mesh, _ = welded(sectors)
    monkeypatch.setattr(meshed, "linear_compliance", lambda mesh, plate: np.eye(3))
    monkeypatch.setattr(meshed, "uneven_sectors", lambda stage, thirds: sectors)
    own = SimpleNamespace(mesh=mesh, response=cyclic_response(sectors, plate_of(stage)))
    K, metals = analyse(stage, 6).stiffness, meshed.other_elements(stage, lambda stage, resolution: own)
    found = {name: error_matrix(K, C, lever)[0, 0] for name, C in metals.items()}
    lame, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    held = platform_response(mesh, SimpleNamespace(lame=(lame, mu), thickness=10.0)).compliance
    expected = error_matrix(analyse(stage, 6).stiffness, held, lever)[0, 0]
    strained = found["finite elements in plane strain, the limit of wide necks"]
    assert strained == pytest.approx(expected, rel=1e-9)
    repeated = strained == pytest.approx(found["none: curved quadratic triangles, as verified"], rel=1e-9)
    assert repeated == (model == "plane_strain")
