"""Fatigue lives and frequencies as outputs of studies: of many designs at once those of each alone,
by both models.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexfem
from flexfem.files.writing import toml_text
from flexfem.paper.model import analyse
from flexfem.paper.responses import dynamics
from flexfem.paper.vibration import payload_of
from flexfem.refused import BadInput
from flexfem.study.answer import answer
from flexfem.study.columns import FREQUENCIES
from flexfem.study.loaded import load_study, mechanism_of, sample
from flexfem.study.run import parts_of

from ..conftest import GENERIC, UNLIKE
from ..tolerances import DENSE, SOLVED
from .conftest import columns, random

FATIGUE = {
    "fatigue_strength_coefficient_mpa": 1320.0,
    "fatigue_strength_exponent": -0.093,
    "walker_exponent": 0.6,
}
FACTORS = (
    'key = "override.2.elbow.neck_mm"\nfrom = 0.45\nto = 0.9',
    'key = "hinges.base.radius_mm"\nfrom = 2.5\nto = 4.2',
    'key = "material.yield_strength_mpa"\nfrom = 300.0\nto = 500.0',
    'key = "material.fatigue_strength_coefficient_mpa"\nfrom = 900.0\nto = 1500.0',
    'key = "material.fatigue_strength_exponent"\nfrom = -0.12\nto = -0.08',
    'key = "material.walker_exponent"\nfrom = 0.4\nto = 0.9',
)
LIFE = (
    "[life]\namplitude_x_um = 61.0\namplitude_theta_mrad = -0.7\nratio = 0.3\ncycles = 4e5\n"
    "notch_sensitivity = 0.7"
)
HEAVY = (
    'key = "override.2.elbow.neck_mm"\nfrom = 0.35\nto = 0.8',
    'key = "chain.link_lengths_mm[1]"\nfrom = 30.0\nto = 36.0',
    'key = "material.density_kg_m3"\nfrom = 2000.0\nto = 8000.0',
    'key = "thickness_mm"\nfrom = 6.0\nto = 14.0',
)
PAYLOAD = "[frequencies]\npayload_kg = 0.07\npayload_kg_mm2 = 31.0"
HEAD = 'model = "analytic"\nformula = "calibrated"\nmobility = 21\n'


@pytest.fixture
def lasting(studies: Any) -> Any:
    """The folder of studies, its stage with unlike chains and of a material with fatigue constants."""
    stage = GENERIC | {
        "model": "plane_stress",
        "material": GENERIC["material"] | FATIGUE,
        "override": UNLIKE,
    }
    (studies.folder / "stage.toml").write_text(toml_text(stage))
    return studies


def study(
    studies: Any, head: str, count: int, tail: str = LIFE, factors: tuple[str, ...] = FACTORS
) -> Any:
    return random(studies, head, count, tail, factors)


def test_designs_at_once_have_the_lives_of_each_alone(lasting: Any) -> None:
    loaded = study(lasting, f"{HEAD}links = true\n", 2)
    assert loaded.outputs[-4:] == (
        "life_cycles",
        "life_amplitude_x_um",
        "life_amplitude_theta_mrad",
        "safety_factor",
    )
    rows = answer(loaded, 0, 2)
    found = columns(loaded, rows)
    assert list(rows.status) == ["ok"] * 2
    for k, values in enumerate(sample(loaded, 0, 2)):
        stage = mechanism_of(loaded, values)
        moved = [0.061, 0, -7e-4]
        assert stage.material.walker_exponent == values[5]
        asked = {"ratio": 0.3, "cycles": 4e5, "notch_sensitivity": 0.7}
        alone = flexfem.life(stage, amplitude=tuple(moved), models="analytic", **asked)
        assert found["life_cycles"][k] == pytest.approx(alone.at("life")[0], rel=DENSE)
        assert found["life_amplitude_x_um"][k] == pytest.approx(
            1e3 * alone.at("largest")[0, 0], rel=DENSE
        )
        assert found["life_amplitude_theta_mrad"][k] == pytest.approx(
            -1e3 * alone.at("largest")[0, 2], rel=DENSE
        )
        assert found["safety_factor"][k] == pytest.approx(alone.at("safety")[0], rel=DENSE)


def test_the_life_fully_reversed_along_one_direction_is_that_of_the_neck_stress(
    lasting: Any,
) -> None:
    """By hand from other columns: N = (stress / sigma'_f)^(1/b) / 2, amplitude for N cycles, yield
    over stress.
    """
    loaded = study(
        lasting, HEAD, 400, "[life]\namplitude_y_um = -390.0\ncycles = 2.5e6", FACTORS[:3]
    )
    found = columns(loaded, answer(loaded, 0, 400))
    stress = 390.0 * found["stress_y_mpa_per_um"]
    np.testing.assert_allclose(
        found["life_cycles"], 0.5 * (stress / 1320.0) ** (1 / -0.093), rtol=DENSE
    )
    allowed = 390.0 * 1320.0 * 5e6**-0.093 / stress
    np.testing.assert_allclose(found["life_amplitude_y_um"], allowed, rtol=DENSE)
    np.testing.assert_allclose(
        found["safety_factor"], sample(loaded, 0, 400)[:, 2] / stress, rtol=DENSE
    )


def test_finite_elements_of_a_design_have_the_life_of_their_own_neck_stress(lasting: Any) -> None:
    tail = "[life]\namplitude_x_um = 61.0\namplitude_theta_mrad = -0.7\ncycles = 4e5"
    loaded = study(lasting, 'model = "fe"\nresolution = 4\n', 1, tail)
    (values,) = sample(loaded, 0, 1)
    found = columns(loaded, answer(loaded, 0, 1))
    stage = mechanism_of(loaded, values)
    stress = np.max(flexfem.solve(stage, 4).neck_stress([0.061, 0, -7e-4]))
    strength = values[3]
    b = values[4]
    assert found["life_cycles"] == pytest.approx(0.5 * (stress / strength) ** (1 / b), rel=1e-5)
    assert found["life_amplitude_x_um"] == pytest.approx(
        61.0 * strength * 8e5**b / stress, rel=1e-6
    )
    assert found["safety_factor"] == pytest.approx(values[2] / stress, rel=1e-6)


def test_lives_are_asked_of_materials_that_have_constants(studies: Any) -> None:
    (studies.folder / "stage.toml").write_text(toml_text(GENERIC))
    with pytest.raises(
        BadInput, match=r"line \d+: life, on the base stage: .*coefficient_mpa is missing"
    ) as refused:
        study(studies, HEAD, 4, LIFE, FACTORS[:2])
    assert "\n" not in str(refused.value)


def test_a_number_that_no_question_has_is_refused_before_anything_runs(studies: Any) -> None:
    path = studies.write(("mobility = 21\n", 'mobility = 21\nask = ["stiffness.nope"]\n'))
    with pytest.raises(
        BadInput, match=r"study\.toml, line 6: ask: no number stiffness\.nope of this stage"
    ):
        flexfem.run_study(path, studies.folder / "out", workers=1)
    assert not (studies.folder / "out").exists()
    path = studies.write(("mobility = 21\n", 'mobility = 21\nask = ["reach.range.x"]\n'))
    assert (
        parts_of(load_study(path), studies.folder).size * 0.5 < 60
    )  # s, at half a second a design


@pytest.mark.parametrize("head", [HEAD, 'model = "fe"\n'])
def test_constants_that_no_material_has_together_are_refused_by_every_model(
    lasting: Any, head: str
) -> None:
    strong = 'key = "material.yield_strength_mpa"\nvalues = [3000.0]'
    for tail in (LIFE, ""):
        rows = answer(study(lasting, head, 1, tail, (strong,)), 0, 1)
        assert rows.status[0] == "refused" and "fatigue_strength_coefficient" in rows.reason[0]
        assert "expected 0.5 to 50 of" in rows.reason[0]


def test_lives_beyond_yield_and_beyond_the_law_are_counted_as_such(lasting: Any) -> None:
    """A stress of 411 MPa is yield; the law is assumed to hold from 1e3 to 1e6 cycles."""
    amplitudes = {
        900.0: "life from elastic stress, beyond yield",
        20.0: "life extrapolated, outside",
        560.0: "",
    }
    for amplitude, said in amplitudes.items():
        loaded = study(lasting, HEAD, 3, f"[life]\namplitude_x_um = {amplitude}", FACTORS[:1])
        for status, reason, _ in zip(*answer(loaded, 0, 3), strict=True):
            assert status == "ok" and reason.startswith(said) and bool(reason) == bool(said)


def frequencies(loaded: Any, rows: Any) -> Any:
    return rows.values[:, [loaded.outputs.index(name) for name in FREQUENCIES]]


@pytest.mark.parametrize("links", [False, True])
def test_designs_at_once_have_the_frequencies_of_each_alone(studies: Any, links: bool) -> None:
    loaded = random(studies, HEAD + ("links = true\n" if links else ""), 4, PAYLOAD, HEAVY)
    found = answer(loaded, 0, 4)
    assert list(found.status) == ["ok"] * 4
    for values, ours in zip(sample(loaded, 0, 4), frequencies(loaded, found), strict=True):
        stage = mechanism_of(loaded, values)
        alone = dynamics(
            stage, analyse(stage, 21, "calibrated", links), payload_of(0.07, 31.0)
        ).frequencies[:3]
        np.testing.assert_allclose(ours, alone / (2 * np.pi), rtol=DENSE)
        assert stage.material.density == values[2]


def test_finite_elements_of_a_design_have_the_frequencies_of_the_command(studies: Any) -> None:
    loaded = random(studies, 'model = "fe"\nresolution = 4\n', 1, PAYLOAD, HEAVY)
    (ours,) = frequencies(loaded, answer(loaded, 0, 1))
    stage = mechanism_of(loaded, sample(loaded, 0, 1)[0])
    found = flexfem.modes(stage, count=3, payload=(0.07, 31.0), resolution=4)
    np.testing.assert_allclose(
        ours, found.at("frequency", model="finite elements")[:3], rtol=SOLVED
    )
