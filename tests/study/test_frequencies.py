"""Natural frequencies as outputs of studies: of many designs at once those of each alone, by both models."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexfem
from flexfem.analytic.model import analyse
from flexfem.analytic.responses import dynamics
from flexfem.questions.modes import payload_of
from flexfem.study.answer import answer
from flexfem.study.columns import FREQUENCIES
from flexfem.study.loaded import sample, stage_of

from .conftest import random

FACTORS = (
    'key = "override.2.elbow.neck_mm"\nfrom = 0.35\nto = 0.8',
    'key = "chain.link_lengths_mm[1]"\nfrom = 30.0\nto = 36.0',
    'key = "material.density_kg_m3"\nfrom = 2000.0\nto = 8000.0',
    'key = "thickness_mm"\nfrom = 6.0\nto = 14.0',
)
PAYLOAD = "[frequencies]\npayload_kg = 0.07\npayload_kg_mm2 = 31.0"


def frequencies(loaded: Any, rows: Any) -> Any:
    return rows.values[:, [loaded.outputs.index(name) for name in FREQUENCIES]]


@pytest.mark.parametrize("links", [False, True])
def test_designs_at_once_have_the_frequencies_of_each_alone(studies: Any, links: bool) -> None:
    head = 'model = "analytic"\nformula = "calibrated"\nmobility = 21\n' + ("links = true\n" if links else "")
    loaded = random(studies, head, 4, PAYLOAD, FACTORS)
    found = answer(loaded, 0, 4)
    assert list(found.status) == ["ok"] * 4
    for values, ours in zip(sample(loaded, 0, 4), frequencies(loaded, found), strict=True):
        stage = stage_of(loaded, values)
        alone = dynamics(stage, analyse(stage, 21, "calibrated", links), payload_of(0.07, 31.0)).frequencies[:3]
        np.testing.assert_allclose(ours, alone / (2 * np.pi), rtol=1e-9)
        assert stage.material.density == values[2]


def test_finite_elements_of_a_design_have_the_frequencies_of_the_command(studies: Any) -> None:
    loaded = random(studies, 'model = "fe"\nresolution = 4\n', 1, PAYLOAD, FACTORS)
    (ours,) = frequencies(loaded, answer(loaded, 0, 1))
    stage = stage_of(loaded, sample(loaded, 0, 1)[0])
    found = flexfem.modes(stage, count=3, payload=(0.07, 31.0), resolution=4)
    np.testing.assert_allclose(ours, found.at("frequency", model="finite elements")[:3] / (2 * np.pi), rtol=1e-8)
