"""Deliberate errors in the physics, and for each the test that must catch it.

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


BENCHMARKS = "tests/verification/test_benchmarks.py::"
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
        "np.sqrt(plate.thickness * strip.weights)",
        "np.sqrt(strip.weights)",
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
        "fem/mesh.py",
        "            edges.setdefault(name, [])",
        '            (edges if chain < 2 or name != "ground" else {}).setdefault(name, [])',
        "tests/fem/test_mesh.py::test_ground_is_the_straight_back_of_three_pads",
    ),
    Mutation(
        "drawn notches turned by 90 degrees",
        "layout/bodies.py",
        "along = cmath.exp(1j * neck.heading)\n    radius",
        "along = 1j * cmath.exp(1j * neck.heading)\n    radius",
        "tests/layout/test_bodies.py::test_narrowest_section_is_the_neck_across_its_axis_at_the_hinge_centre",
    ),
    Mutation(
        "hinge axes turned by 90 degrees in both models",
        "layout/frames.py",
        "axis + np.where(backwards, np.pi, 0.0)",
        "axis + np.pi / 2 + np.where(backwards, np.pi, 0.0)",
        "tests/layout/test_frames.py::test_default_necks_point_along_link_one_link_one_and_link_two",
    ),
    Mutation(
        "chains counted clockwise",
        "layout/frames.py",
        "CHAIN_TURN = 2.0",
        "CHAIN_TURN = -2.0",
        "tests/layout/test_frames.py::test_chains_are_chain_one_turned_by_120_degrees",
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
        "verify/protocol.py",
        "error = force @ compliance.T - command",
        "error = command - force @ compliance.T",
        "tests/verify/test_protocol.py::test_error_is_finite_element_displacement_minus_commanded",
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


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.error)
def test_the_text_to_spoil_is_there_once_and_its_test_exists(mutation: Mutation) -> None:
    assert (ROOT / "flexfem" / mutation.file).read_text().count(mutation.old) == 1
    file, name = mutation.test.split("::")
    assert f"def {name}(" in (ROOT / file).read_text()


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
