"""Many designs at once are the designs one by one: same stiffness, same refusals; stresses are in
equilibrium.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flexfem.hinges.formulas import FORMULAS
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.outlines import polygon_points
from flexfem.paper.bodies import draw_sector
from flexfem.paper.designs import stage_frames
from flexfem.paper.equations import FREEDOMS_BY_MOBILITY, inverse_kinematics, stiffness
from flexfem.paper.feasibility import check_closed_form
from flexfem.paper.model import analyse, assemble
from flexfem.paper.stage_file import Plane
from flexfem.refused import BadInput
from flexfem.study.answer import answer
from flexfem.study.loaded import mechanism_of, sample

from ..tolerances import DENSE

LOOPS = DENSE  # relative to the diagonal: the loop equations and stiff springs of the scalar path
GENTLE = (
    'key = "override.*.*.radius_mm"\nfrom = 1.5\nto = 3.9',
    'key = "override.*.*.neck_mm"\nfrom = 0.35\nto = 0.8',
    'key = "chain.link_lengths_mm[0]"\nfrom = 28.0\nto = 36.0',
    'key = "chain.link_lengths_mm[1]"\nfrom = 28.0\nto = 36.0',
    'key = "chain.joint_angles_deg[1]"\nfrom = -95.0\nto = -75.0',
    'key = "override.3.base.axis_deg"\nfrom = 150.0\nto = 200.0',
    'key = "material.youngs_modulus_gpa"\nfrom = 60.0\nto = 210.0',
    'key = "material.poissons_ratio"\nfrom = 0.22\nto = 0.38',
    'key = "thickness_mm"\nfrom = 6.0\nto = 14.0',
    'key = "material.yield_strength_mpa"\nfrom = 200.0\nto = 900.0',
)
WILD = (
    'key = "hinges.*.radius_mm"\nfrom = 0.5\nto = 5.0',
    'key = "hinges.*.neck_mm"\ndistribution = "normal"\nmean = 0.6\nsd = 0.5',
    'key = "chain.link_lengths_mm[0]"\nfrom = 4.0\nto = 60.0',
    'key = "chain.link_lengths_mm[1]"\nfrom = 4.0\nto = 60.0',
    'key = "chain.joint_angles_deg[1]"\nfrom = -180.0\nto = 180.0',
    'key = "chain.link_width_mm"\nfrom = 3.0\nto = 15.0',
    'key = "platform.radius_mm"\nfrom = 5.0\nto = 25.0',
)
PLANES: tuple[Plane, ...] = ("plane_stress", "plane_strain", "corrected")
DRIVE = "[drive]\nstroke_um = 17.4\nlever_arm_mm = 10.0"


def study(
    studies: Any, factors: tuple[str, ...], formula: str, mobility: Any, count: int, more: str = ""
) -> Any:
    head = (
        f'model = "analytic"\nformula = "{formula}"\n'
        + (f"mobility = {mobility}\n" if mobility else "")
        + more
    )
    return studies.of(
        f'method = "monte_carlo"\ndesigns = {count}\nseed = 29', *factors, head=head, tail=DRIVE
    )


def test_the_kernel_is_the_scalar_model(studies: Any) -> None:
    """Chains in parallel against loop equations: every mobility, and every formula with one of them
    and in a plane.
    """
    mobilities = [*FREEDOMS_BY_MOBILITY, None]
    pairs = [("calibrated", mobility) for mobility in mobilities]
    pairs += [
        (formula, mobilities[place % len(mobilities)]) for place, formula in enumerate(FORMULAS)
    ]
    for turn, (formula, mobility) in enumerate(pairs):
        loaded = study(studies, GENTLE, formula, mobility, 4)
        loaded = replace(
            loaded, base=loaded.base.model_copy(update={"model": PLANES[turn % len(PLANES)]})
        )
        rows = answer(loaded, 0, loaded.count)
        assert set(rows.status) == {"ok"}, rows.reason
        for found, values in zip(rows.values, sample(loaded, 0, loaded.count), strict=True):
            K = found[:6][[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
            expected = stiffness(assemble(mechanism_of(loaded, values), mobility, formula)).K_uu
            size = np.sqrt(np.diagonal(expected))
            np.testing.assert_allclose(
                K / np.outer(size, size), expected / np.outer(size, size), rtol=0, atol=LOOPS
            )


@pytest.mark.parametrize("check", ["closed_form", "drawing"])
def test_what_the_scalar_path_refuses_is_refused_and_nothing_else(check: str, studies: Any) -> None:
    count = 400 if check == "closed_form" else 150
    loaded = study(studies, WILD, "calibrated", 21, count, f'check = "{check}"')
    rows = answer(loaded, 0, loaded.count)
    for values, status, reason in zip(
        sample(loaded, 0, count), rows.status, rows.reason, strict=True
    ):
        try:
            stage = mechanism_of(loaded, values)
            (check_feasible if check == "drawing" else check_closed_form)(stage)
            analyse(stage, 21, "calibrated")
        except BadInput:
            assert status == "refused" and reason
        else:
            assert status == "ok" and reason == ""
    assert 0 < np.sum(rows.status == "ok") < count
    assert np.array_equal(np.isnan(rows.values).any(axis=1), rows.status == "refused")
    assert np.array_equal(np.isnan(rows.values).all(axis=1), rows.status == "refused")


def test_a_singular_stage_is_refused(studies: Any) -> None:
    """Three hinges in line leave a chain of mobility three no compliance along it."""
    straight = tuple(
        f'key = "chain.joint_angles_deg[{k}]"\nvalues = [{angle}]'
        for k, angle in enumerate((180.0, 0.0))
    )
    (reason,) = set(answer(study(studies, straight, "paros-weisbord", 3, 2), 0, 2).reason)
    assert reason.startswith("chain: singular to working precision at rest")


def test_hinge_deformations_under_the_neck_wrenches_add_up_to_the_displacement(
    studies: Any,
) -> None:
    """Compatibility, chain by chain: with rotation and stretch alone the neck wrenches say it all."""
    loaded = study(studies, GENTLE, "calibrated", 12, 5)
    for values in sample(loaded, 0, 5):
        stage = mechanism_of(loaded, values)
        found = analyse(stage, 12, "calibrated")
        placed = stage_frames(stage)
        wrench = found.wrench
        turn = found.hinges.rotation[..., None] * wrench.moment
        stretch = found.hinges.axial[..., None] * wrench.normal
        x = placed.centres[..., 0, None]
        y = placed.centres[..., 1, None]
        c = np.cos(placed.axes)[..., None]
        s = np.sin(placed.axes)[..., None]
        moved = np.stack([y * turn + c * stretch, -x * turn + s * stretch, turn], axis=2).sum(
            axis=1
        )
        np.testing.assert_allclose(
            moved, np.broadcast_to(np.eye(3), (3, 3, 3)), atol=DENSE
        )  # mm per mm and rad


def test_travel_is_where_the_first_base_hinge_has_turned_by_stroke_over_arm(studies: Any) -> None:
    """Base rotations by the paper's inverse kinematics (29)-(31) instead of the chains' forces."""
    loaded = study(studies, GENTLE, "calibrated", 6, 5)
    rows = answer(loaded, 0, 5)
    for values, found in zip(sample(loaded, 0, 5), rows.values, strict=True):
        mechanism = assemble(mechanism_of(loaded, values), 6, "calibrated")
        at_rest = stiffness(mechanism)
        for axis in range(3):
            joints = inverse_kinematics(mechanism, at_rest, np.eye(3)[axis]).joints
            base = [joints[k] for k, slot in enumerate(mechanism.joints.slot) if slot in (0, 9, 18)]
            expected = 17.4e-3 / 10.0 / np.max(np.abs(base)) * 1e3
            assert found[loaded.outputs.index("travel_x_um") + axis] == pytest.approx(
                expected, rel=1e-7
            )


def test_the_envelope_holds_the_drawn_stage_and_no_more(studies: Any) -> None:
    loaded = study(studies, GENTLE, "calibrated", 21, 8)
    sizes = answer(loaded, 0, 8).values[:, loaded.outputs.index("envelope_mm")]
    for values, size in zip(sample(loaded, 0, 8), sizes, strict=True):
        stage = mechanism_of(loaded, values)
        faces = [face for chain in (1, 2, 3) for face in draw_sector(stage, chain).values()]
        drawn = 2 * max(np.hypot(*polygon_points(face.loop).T).max() for face in faces)
        assert size == pytest.approx(drawn, rel=1e-12)
