"""NGSolve agrees to round-off, and would not if anything were wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pytest

from flexfem.fem.response import platform_response
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.validate import ngsolve
from flexfem.validate.compare import NGSOLVE, cross_check, field_difference, pose_difference
from flexfem.validate.frequencies import FULL
from flexfem.validate.records import Answer, Check

RESOLUTION = 2
LITERAL = {  # Hz, on the coarse mesh
    "mobility6": [131.540, 131.540, 193.962, 7214.78, 7214.78, 7622.14],
    "mobility3": [138.348, 138.348, 204.552, 8542.62, 8542.62, 9395.42],
}
ROUND_OFF = 1e-11  # where both integrate finely; measured 4e-13 in displacement
DEFAULT_ORDERS = 1e-6  # NGSolve's default integration is at least this far off on a coarse curved mesh


@pytest.mark.parametrize("name", [pytest.param("mobility3", marks=pytest.mark.slow), "mobility6"])
def test_ngsolve_agrees(stage_named: Callable[[str], Stage], name: str) -> None:
    found = cross_check(stage_named(name), RESOLUTION, "ngsolve")
    assert found.passed, found.checks
    assert {check.allowed for check in found.checks} == {1e-8, None}
    assert found.checks[0].quantity == "pose" and found.checks[0].difference < ROUND_OFF
    assert found.triangles > 1000 and found.unknowns > 5000 and found.their_seconds > 0 < found.seconds
    np.testing.assert_allclose(np.diag(found.their_compliance), np.diag(found.compliance), rtol=ROUND_OFF)
    vibrating = {check.quantity: check.difference for check in found.checks[-2:]}
    assert vibrating["natural frequencies"] < 1e-9 and 1e-6 < vibrating["natural frequencies, ours by default"] < 1e-3
    np.testing.assert_allclose(found.their_frequencies, found.frequencies, rtol=1e-9)
    assert found.frequencies == pytest.approx(LITERAL[name], rel=1e-4)


@pytest.fixture(scope="module")
def theirs(six) -> Answer:
    return ngsolve.solve(six.mesh, six.plate)


def test_displacements_come_in_the_order_of_our_nodes(six, theirs) -> None:
    ours = platform_response(six.mesh, six.plate, FULL)
    assert field_difference(ours.fields, theirs.fields) < NGSOLVE
    shuffled = theirs.fields[:, ::-1]
    assert field_difference(ours.fields, shuffled) > 0.1


def test_triangles_are_curved_and_its_default_integration_is_not_enough(six, theirs) -> None:
    """On straight triangles the orders would change nothing."""
    default, most = (ngsolve.solve(six.mesh, six.plate, orders).compliance for orders in (0, 8))
    assert pose_difference(most, default, 24.0) > DEFAULT_ORDERS
    assert pose_difference(most, theirs.compliance, 24.0) < NGSOLVE


def test_hub_is_rigid_and_ground_clamped_in_its_answer(six, theirs) -> None:
    hub, ground = (np.unique(six.mesh.edges[name]) for name in ("hub", "ground"))
    x, y = six.mesh.nodes[hub].T
    for (X, Y, theta), field in zip(theirs.compliance.T, theirs.fields, strict=True):
        rigid = np.stack([X - theta * y, Y + theta * x], axis=-1)
        np.testing.assert_allclose(field[hub], rigid, atol=ROUND_OFF * np.abs(field).max())
        np.testing.assert_array_equal(field[ground], 0.0)


@pytest.mark.parametrize(
    "break_it",
    [
        pytest.param(lambda mesh, plate: (mesh, plate._replace(poissons_ratio=0.3301)), id="poissons ratio"),
        pytest.param(
            lambda mesh, plate: (mesh, plate._replace(thickness=plate.thickness + 1e-5)),
            id="thickness",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda mesh, plate: (mesh._replace(edges=mesh.edges | {"ground": mesh.edges["ground"][:-1]}), plate),
            id="an edge unclamped",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda mesh, plate: (mesh._replace(edges=mesh.edges | {"hub": mesh.edges["hub"][:-1]}), plate),
            id="an edge of the hub free",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda mesh, plate: (mesh._replace(nodes=mesh.nodes * [1.0, 1 + 1e-6]), plate), id="a millionth in geometry"
        ),
    ],
)
@pytest.mark.usefixtures("six_once")
def test_a_wrong_problem_is_detected(six, monkeypatch: pytest.MonkeyPatch, break_it) -> None:
    right = ngsolve.solve
    monkeypatch.setattr(ngsolve, "solve", lambda mesh, plate: right(*break_it(mesh, plate)))
    found = cross_check(six.stage, RESOLUTION, "ngsolve")
    assert not found.passed
    assert not found.checks[0].passed, found.checks[0]


def test_missing_ngsolve_is_one_line_that_says_how_to_install_it(six, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    with pytest.raises(BadInput, match=r"^NGSolve .*pip install ngsolve$"):
        cross_check(six.stage, RESOLUTION, "ngsolve")


def test_unknown_solver_is_one_line_that_names_the_known(six) -> None:
    with pytest.raises(BadInput, match=r"^solver 'nastran', expected one of ngsolve, calculix$"):
        cross_check(six.stage, RESOLUTION, "nastran")


def test_a_difference_that_is_not_a_number_does_not_pass() -> None:
    assert not Check("pose", float("nan"), NGSOLVE).passed
    assert Check("pose", 1.0, None).passed


def test_rotations_differ_by_their_way_at_the_lever() -> None:
    """At a lever of 8 mm a rotation of 0.5 per N is 4 mm, and per N mm it counts 64 times."""
    ours = np.diag([4.0, 2.0, 0.01])
    for entry, change, expected in (
        ((0, 0), 0.25, 0.0625),
        ((2, 0), 0.5, 1.0),
        ((1, 2), 0.5, 1.0),
        ((2, 2), 0.01, 0.16),
    ):
        theirs = ours.copy()
        theirs[entry] += change
        assert pose_difference(ours, theirs, 8.0) == pytest.approx(expected)
