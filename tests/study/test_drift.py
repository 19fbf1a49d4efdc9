"""Drift with temperature as outputs of studies: of many designs at once that of each alone, by the
analytic model.
"""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np
import pytest

import flexfem
from flexfem.files.writing import toml_text
from flexfem.questions.setup import Analytic
from flexfem.refused import BadInput
from flexfem.results import ANALYTIC, ELEMENTS
from flexfem.study.answer import answer
from flexfem.study.loaded import mechanism_of, sample

from ..conftest import GENERIC, ROOT, UNLIKE
from ..tolerances import DENSE
from .conftest import columns, random

EXPANDING = "material.expansion_um_per_m_k"
FACTORS = (
    'key = "override.2.elbow.neck_mm"\nfrom = 0.45\nto = 0.9',
    'key = "chain.link_lengths_mm[1]"\nfrom = 32.0\nto = 36.0',
    f'key = "{EXPANDING}"\nfrom = 8.0\nto = 24.0',
    'key = "frame.expansion_um_per_m_k"\nfrom = 1.5\nto = 12.0',
    'key = "material.poissons_ratio"\nfrom = 0.2\nto = 0.4',
)
NAMES = ("drift_x_um_per_k", "drift_y_um_per_k", "drift_theta_urad_per_k")
STEEPEST = ("drift_gradient_um_per_k_per_mm", "drift_gradient_theta_urad_per_k_per_mm")
HEAD = 'model = "analytic"\nformula = "calibrated"\nmobility = 21\n'
OWN = 'model = "analytic"\n'


def content(**changes: Any) -> dict[str, Any]:
    warm = GENERIC | {"frame": {"expansion_um_per_m_k": 11.3}, "override": UNLIKE} | changes
    return copy.deepcopy(warm) | {"material": GENERIC["material"] | {"expansion_um_per_m_k": 22.7}}


@pytest.fixture
def warm(studies: Any) -> Any:
    """The folder of studies, its stage with unlike chains on a frame of another metal."""
    (studies.folder / "stage.toml").write_text(toml_text(content()))
    return studies


def study(
    studies: Any, head: str, count: int, tail: str = "[drift]", factors: tuple[str, ...] = FACTORS
) -> Any:
    return random(studies, head, count, tail, factors)


def alone(stage: Any, model: str, **options: Any) -> list[float]:
    """As `flexfem.drift` has them, um and urad: the pose, and the largest over directions by trying
    many.
    """
    poses = flexfem.drift(stage, **options).at("pose", model=model).T * np.array(
        [[1e3], [1e3], [1e6]]
    )
    turn = np.linspace(0, np.pi, 200_001)
    x, y, theta = poses[:, 1:] @ [np.cos(turn), np.sin(turn)]
    return [*poses[:, 0], np.max(np.hypot(x, y)), np.max(np.abs(theta))]


@pytest.mark.parametrize(
    ("head", "plane", "asked"),
    [
        (f"{HEAD}links = true\n", "plane_stress", {"formula": "calibrated", "links": True}),
        (HEAD, "corrected", {"formula": "calibrated", "mobility": 21}),
        (OWN, "plane_strain", {"formula": "paros-weisbord"}),
        (f"{OWN}mobility = 3\n", "plane_stress", {"formula": "paros-weisbord", "mobility": 3}),
    ],
)
def test_designs_at_once_have_the_drift_of_each_alone(
    studies: Any, head: str, plane: str, asked: Any
) -> None:
    (studies.folder / "stage.toml").write_text(toml_text(content(model=plane)))
    loaded = study(studies, head, 2)
    assert loaded.outputs[-5:] == (*NAMES, *STEEPEST)
    rows = answer(loaded, 0, 2)
    assert list(rows.status) == ["ok"] * 2
    for values, row in zip(sample(loaded, 0, 2), rows.values, strict=True):
        stage = mechanism_of(loaded, values)
        assert stage.material.expansion == pytest.approx(1e-6 * values[2], rel=1e-12)
        expected = alone(stage, ANALYTIC, models="analytic", analytic=Analytic(**asked))
        np.testing.assert_allclose(row[-5:], expected, rtol=DENSE)


def test_the_drift_of_a_stage_with_unlike_chains_is_that_of_finite_elements(studies: Any) -> None:
    """The shipped stage with three other hinges; literals by `flexfem drift`, finite elements of
    resolution 4.
    """
    other = '\n[[override]]\nchain = 1\nhinge = "base"\nneck_mm = 0.61\n'
    other += '[[override]]\nchain = 2\nhinge = "elbow"\nneck_mm = 0.72\n'
    other += '[[override]]\nchain = 3\nhinge = "platform"\nradius_mm = 1.9\n'
    (studies.folder / "stage.toml").write_text(
        (ROOT / "geometry" / "mobility6.toml").read_text() + other
    )
    expansion = f'key = "{EXPANDING}"\nvalues = [23.6, 12.0]'
    loaded = studies.of('method = "grid"', expansion, head=f"{HEAD}links = true", tail="[drift]")
    found, still = answer(loaded, 0, 2).values[:, -5:]
    np.testing.assert_allclose(
        found, [-0.0729099, -0.1979209, 10.17053, 25.2996, 78.9677], rtol=2e-3
    )
    assert np.max(np.abs(still)) < 1e-12, "a frame of the stage's own metal leaves it at rest"


def test_drift_is_proportional_to_the_difference_of_both_coefficients(warm: Any) -> None:
    loaded = study(warm, HEAD, 300, factors=FACTORS[2:4])
    found = columns(loaded, answer(loaded, 0, 300))
    values = sample(loaded, 0, 300)
    difference = values[:, 0] - values[:, 1]
    for name in (*NAMES, *STEEPEST):
        size = found[name] / (difference if name in NAMES else np.abs(difference))
        np.testing.assert_allclose(size, size[0], rtol=DENSE, err_msg=name)


def test_expansion_is_part_of_what_a_study_on_drift_is_and_of_no_other(warm: Any) -> None:
    plain, asked = (study(warm, OWN, 4, tail, FACTORS[:2]) for tail in ("", "[drift]"))
    (warm.folder / "stage.toml").write_text(
        toml_text(content(frame={"expansion_um_per_m_k": 12.0}))
    )
    same, other = (study(warm, OWN, 4, tail, FACTORS[:2]) for tail in ("", "[drift]"))
    assert plain.hash == same.hash and len({plain.hash, asked.hash, other.hash}) == 3
    assert not {*NAMES, *STEEPEST} & set(plain.outputs)
    assert {f"stage: {EXPANDING}", "stage: frame.expansion_um_per_m_k"} <= {
        *asked.assumptions.not_stated
    }
    assert not any(
        "expansion" in key for key in (*plain.assumptions.not_stated, *plain.assumptions.assumed)
    )


def test_finite_elements_drift_as_the_command_says_on_the_same_mesh(studies: Any) -> None:
    (studies.folder / "stage.toml").write_text(toml_text(content(model="plane_strain")))
    loaded = study(studies, 'model = "fe"\nresolution = 6\n', 1)
    (row,) = answer(loaded, 0, 1).values
    (values,) = sample(loaded, 0, 1)
    expected = alone(mechanism_of(loaded, values), ELEMENTS, models="elements", resolution=6)
    np.testing.assert_allclose(row[-5:], expected, rtol=DENSE)
    model = study(studies, f"{HEAD}links = true\n", 1)
    np.testing.assert_allclose(
        row[-5:], answer(model, 0, 1).values[0, -5:], rtol=3e-3
    )  # meshes, up to 0.2 %


@pytest.mark.parametrize(
    ("left_out", "said"), [("material", "(aluminium 23.6)"), ("frame", "not move the platform")]
)
def test_a_stage_without_a_coefficient_is_refused_in_one_line(
    warm: Any, left_out: str, said: str
) -> None:
    bare = content()
    bare[left_out] = {
        key: value for key, value in bare[left_out].items() if not key.startswith("expansion")
    }
    (warm.folder / "stage.toml").write_text(
        toml_text({key: value for key, value in bare.items() if value})
    )
    missing = rf"line \d+: drift, on the base stage: {left_out}\.expansion_um_per_m_k is missing.*{re.escape(said)}"
    with pytest.raises(BadInput, match=missing) as refused:
        study(warm, OWN, 4, "[drift]", FACTORS[:2])
    assert "\n" not in str(refused.value)
    assert study(warm, OWN, 4, "", FACTORS[:2]).count == 4
