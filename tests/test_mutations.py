"""Deliberate errors in the physics and in numbers derived from it, and for each the test that must catch it.

Every row is put into a copy of the project, one at a time, and exactly the named test is run there.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parent.parent
PARTS = ("flexfem", "tests", "geometry", "cases", "pyproject.toml")
NOT_THE_COPY = 77  # exit code when the editable install was imported instead of the copy
FAILED = 1  # pytest's exit code for tests that ran and failed; a node that is not found is another
TIME_LIMIT = 180.0  # s, for one test
GUARD = f"""
import os, sys
from pathlib import Path
import flexfem
if not Path(flexfem.__file__).is_relative_to(os.environ["FLEXFEM_COPY"]):
    print(f"imported from {{flexfem.__file__}}", flush=True)
    os._exit({NOT_THE_COPY})
"""


class Mutation(NamedTuple):
    """An error: in a file of the package, a piece of text (there once) becomes another; and the test that sees it."""

    error: str
    file: str
    old: str
    new: str
    test: str


BENCHMARKS = "tests/validate/test_benchmarks.py::"
MUTATIONS = [
    Mutation(
        "Lame constants swapped",
        "fem/plane_stress.py",
        "return e * nu / (1 - nu**2), e / (2 * (1 + nu))",
        "return e / (2 * (1 + nu)), e * nu / (1 - nu**2)",
        BENCHMARKS + "test_roache_manufactured_solution_has_orders_three_and_two",
    ),
    Mutation(
        "plane strain for plane stress",
        "fem/plane_stress.py",
        "return e * nu / (1 - nu**2), e / (2 * (1 + nu))",
        "return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))",
        BENCHMARKS + "test_timoshenko_goodier_cantilever",
    ),
    Mutation(
        "thickness forgotten",
        "fem/plane_stress.py",
        "np.sqrt(plate.thickness * batch.weights)",
        "np.sqrt(batch.weights)",
        BENCHMARKS + "test_macneal_harder_1985_curved_beam_is_not_the_printed_beam_value",
    ),
    Mutation(
        "rotation costs energy",
        "fem/plane_stress.py",
        "mu * m.transpose(0, 1, 4, 3, 2)",
        "mu * m",
        BENCHMARKS + "test_the_plane_has_three_rigid_body_motions",
    ),
    Mutation(
        "shear stress twice as large",
        "fem/plane_stress.py",
        "stress = mu * (slopes",
        "stress = 2 * mu * (slopes",
        BENCHMARKS + "test_irons_patch_test",
    ),
    Mutation(
        "straight triangles, middle nodes on chords",
        "fem/mesher.py",
        '"Mesh.SecondOrderLinear": 0',
        '"Mesh.SecondOrderLinear": 1',
        BENCHMARKS + "test_roache_manufactured_solution_has_orders_three_and_two",
    ),
    Mutation(
        "moment arm of the hub with the wrong sign",
        "fem/response.py",
        "one, zero, -y, zero, one, x",
        "one, zero, y, zero, one, -x",
        "tests/fem/test_response.py::test_ground_rests_and_hub_moves_as_a_rigid_body",
    ),
    Mutation(
        "one chain unclamped",
        "fem/sectors.py",
        'if not label.startswith(("cut", "free")):',
        'if not label.startswith(("cut", "free")) and (chain < 2 or label != "ground"):',
        "tests/fem/test_mesh.py::test_ground_is_the_straight_back_of_three_pads",
    ),
    Mutation(
        "drawn notches turned by 90 degrees",
        "stage/bodies.py",
        "along = cmath.exp(1j * neck.heading)\n    radius",
        "along = 1j * cmath.exp(1j * neck.heading)\n    radius",
        "tests/stage/test_bodies.py::test_narrowest_section_is_the_neck_across_its_axis_at_the_hinge_centre",
    ),
    Mutation(
        "hinge axes turned by 90 degrees in both models",
        "stage/designs.py",
        "axis + np.where(backwards, np.pi, 0.0)",
        "axis + np.pi / 2 + np.where(backwards, np.pi, 0.0)",
        "tests/stage/test_frames.py::test_default_necks_point_along_link_one_link_one_and_link_two",
    ),
    Mutation(
        "chains counted clockwise",
        "stage/designs.py",
        "CHAIN_TURN = 2.0",
        "CHAIN_TURN = -2.0",
        "tests/stage/test_frames.py::test_chains_are_chain_one_turned_by_120_degrees",
    ),
    Mutation(
        "1 per cent in hinge formula (2), seen by the finite elements",
        "analytic/beam.py",
        "return 1.5 / q * (short",
        "return 1.515 / q * (short",
        BENCHMARKS + "test_paros_weisbord_1965_notch_as_the_neck_grows_thin",
    ),
    Mutation(
        "1 per cent in hinge formula (2), seen by the beam integral",
        "analytic/beam.py",
        "return 1.5 / q * (short",
        "return 1.515 / q * (short",
        "tests/analytic/test_notch.py::test_stated_freedoms_follow_the_beam_integrals",
    ),
    Mutation(
        "wrong dependent joints",
        "analytic/loops.py",
        "turning & (joints.hinge <= 1)",
        "turning & (joints.hinge >= 1)",
        "tests/analytic/test_loops.py::test_the_papers_independent_joints_are_taken_where_it_names_them",
    ),
    Mutation(
        "a sign in (16)",
        "analytic/stiffness.py",
        "S = dot(tau_p, first.H_p) + dot(F_u, first.H_u)",
        "S = dot(tau_p, first.H_p) - dot(F_u, first.H_u)",
        "tests/analytic/test_equilibrium.py::test_loaded_stiffness_is_the_tangent_of_exact_equilibrium",
    ),
    Mutation(
        "commanded minus finite-element displacement",
        "verify/comparison.py",
        "error = force @ compliance.T - command",
        "error = command - force @ compliance.T",
        "tests/verify/test_protocol.py::test_error_is_finite_element_displacement_minus_commanded",
    ),
    Mutation(
        "a neck bent as if it were half as strong",
        "analytic/chains.py",
        "(6.0 * K.bending",
        "(3.0 * K.bending",
        "tests/analytic/test_stress.py::test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation(
        "a pulled neck concentrates stress as a bent one",
        "analytic/chains.py",
        "(K.tension / area)",
        "(K.bending / area)",
        "tests/analytic/test_stress.py::test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation(
        "no safety factor in the mesh band",
        "verify/convergence.py",
        "SAFETY, CAUTIOUS = 1.25, 3.0",
        "SAFETY, CAUTIOUS = 1.0, 3.0",
        "tests/verify/test_convergence.py::test_celik_2008_worked_example_of_table_1",
    ),
    Mutation(
        "thick hinges softer instead of stiffer",
        "verify/budget.py",
        "steps.percent(direction, steps.thick) - rungs[len(steps.ladder) - 1]",
        "rungs[len(steps.ladder) - 1] - steps.percent(direction, steps.thick)",
        "tests/verify/test_budget.py::test_hinges_wide_out_of_plane_are_stiffer_by_up_to_nu_squared",
    ),
    Mutation(
        "the band of X for every command",
        "verify/budget.py",
        "band=found[axis].band",
        "band=found[0].band",
        "tests/verify/test_budget.py::test_the_band_and_the_amplitude_are_those_of_the_commanded_direction",
    ),
    Mutation(
        "share of the wrong error",
        "verify/measures.py",
        "100 * (without - _along(on.six)) / without",
        "100 * (without - _along(on.six)) / _along(on.six)",
        "tests/verify/test_measures.py::test_the_axial_share_is_of_the_error_without_the_axial_freedom",
    ),
    Mutation(
        "gain of compliance for loss of stiffness",
        "verify/measures.py",
        "100 * (1 - 1 / np.diag(on.six.compliance @ on.six.stiffness))",
        "100 * (np.diag(on.six.compliance @ on.six.stiffness) - 1)",
        "tests/verify/test_measures.py::test_the_loss_of_stiffness_is_of_the_models",
    ),
    Mutation(
        "cross errors of the direction for those of the command",
        "verify/alternatives.py",
        "np.abs(percent - np.diag(np.diag(percent))), axis=0)",
        "np.abs(percent - np.diag(np.diag(percent))), axis=1)",
        "tests/verify/test_claims.py::test_an_alternative_errs_along_its_commands_and_at_most_so_much_across_each",
    ),
    Mutation(
        "R/t upside down",
        "verify/alternatives.py",
        '"neck": hinge.radius / ratio',
        '"neck": hinge.radius * ratio',
        "tests/verify/test_claims.py::test_stubby_necks_are_a_third_of_their_radius_and_all_of_it",
    ),
    Mutation(
        "a mesh study of X alone",
        "verify/converge.py",
        "compliance[:, k, k]",
        "compliance[:, 0, 0]",
        "tests/verify/test_converge.py::test_each_direction_has_its_own_values_order_limit_and_band",
    ),
    Mutation(
        "a stage known without its platform's radius",
        "stage/schema.py",
        '"override": True, "material": {"name"}}',
        '"override": True, "material": {"name"}, "platform": {"radius"}}',
        "tests/study/test_hash.py::test_every_key_of_a_stage_changes_its_hash_but_names_and_provenance",
    ),
    Mutation(
        "first-order and total Sobol indices swapped",
        "study/statistics.py",
        "first, total = found.first_order[:factors], found.total_order[:factors]",
        "total, first = found.first_order[:factors], found.total_order[:factors]",
        "tests/study/test_findings.py::test_shares_are_by_factor_and_first_order_is_not_total",
    ),
    Mutation(
        "a thousandth in the axial compliance of the hinge chart",
        "analytic/notch.py",
        "axial=factors.axial * slender.axial + 0.0 * nu",
        "axial=1.001 * factors.axial * slender.axial + 0.0 * nu",
        "tests/analytic/test_chart.py::test_calibrated_hinges_are_those_of_direct_finite_elements",
    ),
    Mutation(
        "a lever upside down in the error over the workspace",
        "analytic/second_order.py",
        "found, scale = tangents(of, poses), np.array([1.0, 1.0, lever])",
        "found, scale = tangents(of, poses), np.array([1.0, 1.0, 1 / lever])",
        "tests/verify/test_workspace.py::test_the_box_is_searched_at_its_corners_edges_and_faces",
    ),
]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """What the tests need of the project, somewhere else."""
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__", ".*"))
        else:
            shutil.copy(ROOT / part, tmp_path / part)
    (tmp_path / "imported_from_the_copy.py").write_text(GUARD)
    return tmp_path


def run(copy: Path, *tests: str) -> subprocess.CompletedProcess[str]:
    """Run tests of the copy on the package of the copy."""
    command = [sys.executable, "-m", "pytest", "-p", "imported_from_the_copy", "-p", "no:cacheprovider", "-x", *tests]
    environment = {**os.environ, "PYTHONPATH": str(copy), "FLEXFEM_COPY": str(copy)}
    for name in [name for name in environment if name.startswith("PYTEST_")]:
        del environment[name]
    return subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT, check=False
    )


def test_every_error_can_be_made_and_its_test_exists() -> None:
    for mutation in MUTATIONS:
        assert (ROOT / "flexfem" / mutation.file).read_text().count(mutation.old) == 1, mutation.error
        assert mutation.old != mutation.new
        file, name = mutation.test.split("::")
        assert f"def {name}(" in (ROOT / file).read_text(), mutation.test


def test_the_readme_counts_the_errors() -> None:
    assert len({mutation.error for mutation in MUTATIONS}) == len(MUTATIONS)
    assert f"{len(MUTATIONS)} deliberate errors" in (ROOT / "README.md").read_text()


@pytest.mark.slow
def test_every_named_test_passes_on_an_unspoiled_copy(copy: Path) -> None:
    done = run(copy, *dict.fromkeys(mutation.test for mutation in MUTATIONS))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.error)
def test_a_deliberate_error_is_caught_by_its_test(mutation: Mutation, copy: Path) -> None:
    spoiled = copy / "flexfem" / mutation.file
    spoiled.write_text(spoiled.read_text().replace(mutation.old, mutation.new))
    done = run(copy, mutation.test)
    assert done.returncode == FAILED, done.stdout + done.stderr


@pytest.mark.slow
def test_a_run_on_the_installed_package_would_be_noticed(copy: Path) -> None:
    shutil.rmtree(copy / "flexfem")
    done = run(copy, MUTATIONS[0].test)
    assert done.returncode not in (0, FAILED)
