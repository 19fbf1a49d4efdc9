"""The platform as a plane body: its half notches against the hinge chart, its symmetries, its
elements.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from flexfem.paper import links as platform
from flexfem.paper.bodies import body_sides, necks
from flexfem.paper.links import _half_hinge, _lug_compliance, platform_compliance
from flexfem.paper.model import hinge_compliance
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

from ..tolerances import DENSE

ROOT = Path(__file__).parents[2]
SIZES = ("ACROSS", "GROWTH", "COARSEST", "RING", "ARC_ANGLE")
# half hinges of fine boundary elements against the chart's finite elements: 0.9e-3 was seen
CHART = 2e-3
# of what the platform adds, itself 2 % of the stage's, when all elements are halved: 2.3e-2 was
# seen
ELEMENTS = 4e-2


def stage(**changes: object) -> Stage:
    data = tomllib.loads((ROOT / "geometry/mobility6.toml").read_text())
    data["material"]["poissons_ratio"] = 0.29
    for path, value in changes.items():
        table, key = path.split("__")
        (data[table] if table != "top" else data)[key] = value
    return Stage.model_validate(data)


def added(of: Stage):
    return platform_compliance(of, of.elastic)


def finer(monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    for name in SIZES:
        monkeypatch.setattr(platform, name, getattr(platform, name) / factor)
    monkeypatch.setattr(
        platform, "_lug_compliance", platform._lug_compliance.__wrapped__
    )  # not cached


def test_half_a_hinge_of_boundary_elements_is_half_of_that_of_finite_elements(monkeypatch):
    """Two methods, one number: what bends and slides differently in the two halves cancels in the
    whole.
    """
    of = stage(chain__link_width_mm=9.3)
    hinges = hinge_compliance(of, "calibrated")
    expected = [hinges.rotation[0, 2] / 2, hinges.axial[0, 2] / 2, hinges.shear[0, 2] / 2]
    finer(monkeypatch, 8)
    E, nu = of.elastic
    half = _half_hinge(of.hinge(1, "platform"), of.chain.link_width, nu) / (E * of.thickness)
    np.testing.assert_allclose(np.diag(half), expected, rtol=CHART)
    assert abs(half[0, 1]) + abs(half[1, 2]) < DENSE * half[1, 1]  # stretch is even about the axis
    assert half[0, 2] < 0  # a force to the left at the neck turns it clockwise


def test_the_platform_is_reciprocal_positive_and_three_fold_symmetric():
    C = added(stage())
    size = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    np.testing.assert_allclose(C / size, C.T / size, atol=DENSE)
    assert np.linalg.eigvalsh(C / size).min() > 0
    c = np.cos(2 * np.pi / 3)
    s = np.sin(2 * np.pi / 3)
    R = np.kron(np.roll(np.eye(3), 1, axis=0), [[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(R @ C @ R.T / size, C / size, atol=DENSE)


def test_a_lug_moves_the_platform_by_what_a_load_on_the_lug_after_it_does_to_it():
    """Moment and forces of chain 2's neck about the centre, and the motion of chain 1's neck, by
    hand.
    """
    of = stage()
    C = added(of)
    left, right = (tuple(body_sides(of, 1, side)[3]) for side in (1, -1))
    place = left, right, necks(of, 1)[2], of.hinge(1, "platform")
    # motion of the first neck, the next and the last: loads on the first
    parts = _lug_compliance(*place, of.chain.link_width, of.platform, 0.29) / (71.7e3 * 10.0)
    neck = complex(
        24.0, 0.0
    )  # link 3, 24 mm long, leads from there along -x, and link 2 to there along y
    frames = []
    for chain in range(3):
        at = neck * np.exp(2j * np.pi / 3 * chain)
        along = 1j * np.exp(2j * np.pi / 3 * chain)
        frames.append(
            [
                [at.imag, -at.real, 1.0],
                [along.real, along.imag, 0.0],
                [-along.imag, along.real, 0.0],
            ]
        )
    one, two, three = np.array(frames)
    np.testing.assert_allclose(C[:3, 3:6], one.T @ parts[2] @ two, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(C[3:6, :3], two.T @ parts[1] @ one, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(C[6:, 3:6], three.T @ parts[1] @ two, rtol=1e-6, atol=1e-12)
    assert (
        np.abs(parts[1] - parts[1].T).max() > 0.05 * np.abs(parts[1]).max()
    )  # the order of the two counts


def test_one_other_hinge_changes_its_own_lug_and_what_the_others_do_to_it():
    other = {"chain": 2, "hinge": "platform", "neck_mm": 0.61}
    C, changed = (added(of).reshape(3, 3, 3, 3) for of in (stage(), stage(top__override=[other])))
    same = [
        np.allclose(C[i, :, j], changed[i, :, j], rtol=DENSE, atol=0)
        for i in range(3)
        for j in range(3)
    ]
    assert same == [i != 1 and j != 1 for i in range(3) for j in range(3)]
    np.testing.assert_allclose(changed.reshape(9, 9), changed.reshape(9, 9).T, rtol=1e-6)


def test_lugs_without_room_between_them_are_refused():
    with pytest.raises(BadInput, match=r"platform\.radius_mm"):
        added(stage(platform__radius_mm=6.0, chain__joint_angles_deg=[180.0, -90.0, 60.0]))
