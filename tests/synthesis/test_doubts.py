"""What a record warns of: lives beyond cycles of the law or beyond yield, amplitudes for them, stacks of drift."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.synthesis.doubts import doubts_of
from flexfem.synthesis.model import Model

from .conftest import HEAD, NECK, RADIUS, ROOT, best

ALLOY = HEAD.replace(str(ROOT / "geometry/mobility6.toml"), str(ROOT / "cases/stage-2024.toml"))
LAW = "outside the 1000 to 1e+06 cycles of Basquin's law"
VALUES = np.array([0.5, 1.5])


def doubts(load, amplitude: float, cycles: float, goal: str, **changed: float) -> list[str]:
    """What is said of one design at an amplitude, um, for a wanted life, with columns as they are or changed."""
    life = f"[life]\namplitude_x_um = {amplitude}\ncycles = {cycles}\n"
    loaded = load(NECK, RADIUS, life, best("maximise", goal), head=ALLOY)
    columns, _ = Model(loaded).columns(VALUES[None])
    return doubts_of(loaded, VALUES, {name: float(column[0]) for name, column in columns.items()} | changed)


@pytest.mark.parametrize(
    ("cycles", "safety", "said"),
    [
        (9e5, 1.2, []),
        (2e6, 1.2, ["life extrapolated, outside the cycles of Basquin's law"]),
        (8e2, 1.2, ["life extrapolated, outside the cycles of Basquin's law"]),
        (9e5, 0.9, ["life by elastic stress, beyond yield"]),
    ],
)
def test_a_life_beyond_the_cycles_of_its_law_or_beyond_yield_is_said(load, cycles, safety, said):
    assert doubts(load, 100.0, 5e5, "life_cycles", life_cycles=cycles, safety_factor=safety) == said


@pytest.mark.parametrize(
    ("wanted", "largest", "said"),
    [
        (5e5, 119.0, []),
        (1e7, 119.0, [f"amplitudes for 1e+07 cycles extrapolated, {LAW}"]),
        (5e5, 121.0, ["amplitudes for 500000 cycles by elastic stress, beyond yield"]),
    ],
)
def test_an_amplitude_for_a_life_that_the_law_does_not_hold_to_is_said(load, wanted, largest, said):
    """At 100 um the necks bear 1/1.2 of the yield strength, so that 120 um reach it."""
    columns = {"life_cycles": 9e5, "safety_factor": 1.2, "life_amplitude_x_um": largest}
    assert doubts(load, -100.0, wanted, "life_amplitude_x_um", **columns) == said


def test_an_amplitude_that_is_not_asked_is_not_doubted(load):
    columns = {"life_cycles": 9e5, "safety_factor": 1.2, "life_amplitude_x_um": 130.0}
    assert doubts(load, 100.0, 1e7, "life_cycles", **columns) == []


def test_a_drift_says_that_stacks_are_not_in_it(load):
    loaded = load(NECK, RADIUS, "[drift]\n", best("minimise", "drift_gradient_um_per_k_per_mm"))
    columns, _ = Model(loaded).columns(VALUES[None])
    (said,) = doubts_of(loaded, VALUES, {name: float(column[0]) for name, column in columns.items()})
    assert said == "drift: the stacks, their preloads and their own expansion are left out"
