"""The stage's own choice of plane problem, through both models: plane stress, plane strain,
corrected for thickness.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from flexfem.fem.response import platform_response
from flexfem.hinges.chart import thickness_factors as factors
from flexfem.paper.fields import neck_stresses
from flexfem.paper.model import analyse, hinge_compliance
from flexfem.paper.solutions import solved as solve_stage
from flexfem.paper.stage import Stage, load_stage
from flexfem.paper.stage_mesh import build_mesh, plate_of
from flexfem.refused import BadInput

PATH = Path(__file__).parents[1] / "geometry" / "mobility6.toml"
REFERENCE = load_stage(PATH)
ROUND_OFF = 1e-12


def of(model: str, **material: float) -> Stage:
    changed = REFERENCE.material.model_copy(update={"poissons_ratio": 0.29, **material})
    return REFERENCE.model_copy(update={"model": model, "material": changed})


def test_the_analytic_model_is_stiffer_in_plane_strain_by_the_sheet_modulus_of_its_hinges():
    stress, strain = (analyse(of(model), 3).stiffness for model in ("plane_stress", "plane_strain"))
    np.testing.assert_allclose(strain, stress / (1 - 0.29**2), rtol=ROUND_OFF, atol=1e-9)


def test_both_models_take_plane_strain_alike():
    """The calibrated analytic model is as near to the finite elements in plane strain as in plane
    stress.
    """
    near = 3e-3  # 1.0e-3 in x, y and 1.5e-3 in theta in plane stress, and the mesh of resolution 6
    for model in ("plane_stress", "plane_strain"):
        solved = np.diag(solve_stage(of(model), 6).compliance)
        np.testing.assert_allclose(
            np.diag(analyse(of(model), 21, "calibrated", links=True).compliance), solved, rtol=near
        )


def test_under_one_load_necks_in_plane_strain_have_the_von_mises_stress_of_a_held_uniaxial_one():
    """The load fixes the stress in the plane; at a neck's edge it is uniaxial, and zz = nu xx in
    plane strain.
    """
    # in-plane stress depends on the constants through the links alone, and nodal averages on the
    # mesh
    uneven = 2e-2
    mesh = build_mesh(of("plane_strain"), 4)
    force = np.array([3.0, -2.0, 40.0])
    stress, strain = (
        neck_stresses(stage, platform_response(mesh, plate_of(stage)), force[None]).highest
        for stage in (of("plane_stress"), of("plane_strain"))
    )
    np.testing.assert_allclose(strain / stress, np.sqrt(1 - 0.29 + 0.29**2), rtol=uneven)


def test_a_corrected_stage_multiplies_its_hinges_by_the_thickness_chart_and_leaves_its_links():
    stage = of("corrected")
    plain = hinge_compliance(of("plane_stress"), "koster")
    found = hinge_compliance(stage, "koster")
    expected = factors(stage.array("radius"), stage.array("neck"), stage.thickness, 0.29)
    for one, other, factor in zip(plain, found, expected, strict=True):
        np.testing.assert_allclose(other, one * factor, rtol=ROUND_OFF)
    assert stage.elastic == of("plane_stress").elastic


def test_plane_stress_is_the_default_and_leaves_the_hash_while_the_others_change_it():
    unsaid = tomllib.loads(PATH.read_text())
    assert (
        Stage.model_validate({**unsaid, "model": "plane_stress"}).hash
        == Stage.model_validate(unsaid).hash
    )
    assert len({of(model).hash for model in ("plane_stress", "plane_strain", "corrected")}) == 3


def test_finite_elements_refuse_a_corrected_stage_in_one_line():
    with pytest.raises(
        BadInput, match=r'^model = "corrected".*expected "plane_stress" or "plane_strain"'
    ):
        solve_stage(of("corrected"), 4)


def test_a_corrected_stage_off_the_thickness_chart_names_the_hinge():
    thin = of("corrected").model_copy(update={"thickness": 0.2})
    with pytest.raises(
        BadInput, match=r"^hinges\.base\.neck_mm = 0\.5: .*thickness chart.*b/t = 0\.4"
    ):
        hinge_compliance(thin)
