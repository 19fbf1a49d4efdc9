"""Bands of natural frequencies on random stages with unlike chains, and what analytic frequencies
are off by.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import flexfem
from flexfem.commands import cli
from flexfem.mechanism.layout import Payload
from flexfem.paper.figures.modes import modes_figure
from flexfem.paper.model import analyse
from flexfem.paper.modes import ABOVE_THIRD
from flexfem.paper.responses import dynamics
from flexfem.paper.stage import Stage
from flexfem.paper.vibration import frequency_convergence

from ..conftest import ROOT, UNLIKE, with_changes

KEPT = np.load(
    ROOT / "tests" / "questions" / "frequencies.npz"
)  # of benchmarks/frequencies.py: 40 stages, five meshes
LEVELS = np.array([4.0, 6.0, 8.0])


def test_bands_hold_the_truth_of_six_frequencies_on_forty_stages(benchmark):
    """95 %; not by the observed orders with the factor 1.25, which held 204 of 240."""
    ratio = np.array([benchmark("frequencies").ratios(each) for each in KEPT["elements"]])
    assert ratio.shape == (40, 6) and np.sum(ratio >= 1) >= 235
    assert np.all(np.sum(ratio >= 1, axis=0) >= 38) and np.median(ratio) < 7


def test_the_warning_states_what_was_measured(benchmark):
    truth = benchmark("frequencies").truth
    off = 100 * (
        np.moveaxis(KEPT["analytic"], 1, 0) / truth(KEPT["elements"]) - 1
    )  # own, calibrated, with links
    rigid = off[1]
    elastic = off[2]
    assert -28 < elastic[:, 3:].min() < -27 and -1 < elastic[:, 3:].max() < -0.75
    assert 10 < np.median(-elastic[:, 3:]) < 14
    assert 5 < rigid[:, 3:].min() < 6 and 162 < rigid[:, 3:].max() < 163
    assert 0.1 < np.abs(elastic[:, :3]).max() < 0.11 and 3.3 < np.abs(rigid[:, :3]).max() < 3.4
    for links, kept in (
        (False, rigid),
        (True, elastic),
    ):  # the two stages at either end, by the model of today
        for k in (np.argmin(kept[:, 3:].min(axis=1)), np.argmax(kept[:, 3:].max(axis=1))):
            stage = Stage.model_validate(json.loads(str(KEPT["stages"][k])))
            found = dynamics(stage, analyse(stage, 21, "calibrated", links), Payload()).frequencies[
                :6
            ]
            np.testing.assert_allclose(
                100 * (found / truth(KEPT["elements"])[k] - 1), kept[k], atol=1e-3
            )
    for said in (
        "0.8 to 28 % too low",
        "more than 10 %",
        "5 to 163 % too high",
        "0.11 % with elastic and 3.4 %",
    ):
        assert said in ABOVE_THIRD


def test_it_is_said_with_the_fourth_mode_and_not_before():
    stage = with_changes({"override": UNLIKE})
    said = [flexfem.modes(stage, count=count, models="analytic").warnings for count in (3, 4)]
    assert ABOVE_THIRD not in said[0] and ABOVE_THIRD in said[1]


def test_bands_hold_frequencies_whose_order_falls_to_one():
    """Above the third mode by the order of corners; by observed orders and the factor 3, 10 of 120
    were left out.
    """
    finest, before = (KEPT["elements"][:, level, 3:] for level in (4, 3))
    exact = finest + (finest - before) / ((16 / 11) ** 1.09 - 1)
    bands = [
        [frequency_convergence(LEVELS, values[:3]).band for values in each[:, 3:].T]
        for each in KEPT["elements"]
    ]
    assert np.all(bands >= np.abs(KEPT["elements"][:, 2, 3:] - exact))


@pytest.mark.parametrize(
    ("order", "factor"),
    [(3.9, None), (4.3, None), (3.0, 3.75), (2.5, 3.75), (2.0, 27 / 7), (1.3, 6.614)],
)
def test_an_order_that_is_not_the_theoretical_one_widens_the_band_of_the_grid_convergence_index(
    order, factor
):
    """By order one with 1.25, or by the observed order with 3, whichever is wider; of steps from 6
    to 8.
    """
    values = 131.0 + 0.7 * LEVELS**-order
    band = 1.25 * 0.7 * 8.0**-order if factor is None else factor * (values[1] - values[2])
    assert frequency_convergence(LEVELS, values).band == pytest.approx(band, rel=1e-3)
    oscillating = np.array([131.0, 131.8, 131.6])  # the larger step counts
    assert frequency_convergence(LEVELS, oscillating).band == pytest.approx(3.0)


def test_what_is_kept_comes_out_of_the_solver(benchmark):
    stage = Stage.model_validate(json.loads(str(KEPT["stages"][7])))
    found = benchmark("frequencies").element_values(stage, 4)
    np.testing.assert_allclose(
        found, KEPT["elements"][7, 0], rtol=5e-5
    )  # gmsh's versions mesh a little differently


# the question

SAME_PLANE = "calibrated, elastic links, plane stress"
HERTZ = 1 / (2 * np.pi)


def test_a_payload_far_heavier_than_the_stage_is_a_mass_on_a_spring():
    """500 kg with 4e5 kg mm^2: sqrt(k / m), k of the static stiffness, by both models, and in
    rotation too.
    """
    stage = with_changes()
    found = flexfem.modes(stage, count=3, payload=(500.0, 4e5), resolution=4)
    K = flexfem.solve(stage, 4).stiffness
    elements = found.at("frequency", model="finite elements")
    turning = found.share[:, 2] > 50
    np.testing.assert_allclose(elements[~turning], HERTZ * np.sqrt(K[0, 0] / 0.5), rtol=1e-3)
    np.testing.assert_allclose(elements[turning], HERTZ * np.sqrt(K[2, 2] / 400.0), rtol=1e-3)
    np.testing.assert_allclose(found.share[turning, 2], 100, atol=0.1)
    assert found.mass == pytest.approx(500.09, abs=0.03)
    assert float(found.meshed_mass) == pytest.approx(float(found.mass), rel=1e-7)
    np.testing.assert_allclose(found.at("frequency", model=SAME_PLANE), elements, rtol=2e-3)


def test_modes_of_the_reference_stage():
    """Literals of resolution 4; the analytic model with elastic links is the independent one."""
    found = flexfem.modes(flexfem.load(ROOT / "geometry/mobility6.toml"), count=3, resolution=4)
    elements, band = (each[:, -1] for each in (found.frequency, found.band("frequency")))
    np.testing.assert_allclose(elements, [131.3, 131.3, 193.6], atol=0.05)
    np.testing.assert_allclose(found.at("frequency", model=SAME_PLANE), elements, rtol=1e-3)
    assert np.all((band > 0) & (band < 0.01 * elements))
    assert found.mass == pytest.approx(0.0892, abs=1e-4)
    assert found.hub_mass == pytest.approx(0.00565, abs=1e-5)


def test_of_unlike_chains_the_shares_lie_in_all_directions():
    found = flexfem.modes(
        with_changes({"override": UNLIKE}), count=3, models="elements", resolution=4
    )
    assert np.all(found.share[:2, :2] > 0)
    assert found.frequency[0, 0] < found.frequency[1, 0] * (1 - 1e-4)


@pytest.mark.slow
def test_the_reference_stage_vibrates_out_of_its_plane_at_five_times_its_first_frequency(tmp_path):
    """Within its bands of the limit by ten triangles across, and by six layers; 5 % above plane
    stress.
    """
    found = flexfem.modes(
        flexfem.load(ROOT / "geometry/mobility6.toml"), models="elements", solid=True
    )
    exact = np.array([137.938, 137.938, 203.378, 693.03, 1405.40, 1405.40])
    solid, band = (each[:, -1] for each in (found.frequency, found.band("frequency")))
    assert np.all(np.abs(solid - exact) < band) and np.all(band < 5e-3 * exact)
    np.testing.assert_allclose(band, found.band_plane + found.band_thickness)
    assert [label.partition(" ")[2] for label in found.axes["mode"]] == ["in plane"] * 3 + [
        "out of plane"
    ] * 3
    assert found.share[3, 3] == pytest.approx(79.5, abs=0.2) and not np.any(found.share[:3, 3:])
    sheet = found.at("frequency", model="plane stress")
    np.testing.assert_allclose(sheet[:3], solid[:3] / 1.0511, rtol=2e-3)
    assert found.tilting_inertia[0] == pytest.approx(
        float(found.inertia / 2 + found.mass * 100 / 12), rel=1e-4
    )
    (path,) = found.fields.write(tmp_path / "modes")
    assert b"mode 6" in path.read_bytes()


@pytest.mark.usefixtures("unrendered")
def test_modes_write_shapes_animations_the_response_and_reduced_models(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("flexfem.paper.figures.modes.FRAMES", 2)
    command = ["modes", str(ROOT / "geometry/mobility3.toml"), "--resolution", "4", "--count", "1"]
    cli.app([*command, "--drives", "engaged", "-o", str(tmp_path / "out")], standalone_mode=False)
    out = capsys.readouterr().out
    assert (
        "drives engaged" in out
        and "the stacks is neglected" in out
        and "K_cb and M_cb are truncated" in out
    )
    ends = (
        ".json",
        ".png",
        ".pdf",
        ".vtu",
        ".npz",
        ".mat",
        "-1.gif",
        "-response.png",
        "-response.pdf",
    )
    assert {each.name for each in (tmp_path / "out").iterdir()} == {
        f"mobility3-modes{end}" for end in ends
    }


def test_a_payload_is_stated_in_kilograms(stage: Stage) -> None:
    bare, loaded = (
        flexfem.modes(stage, payload=each, models="analytic") for each in ((0.0, 0.0), (0.35, 60.0))
    )
    assert loaded.settings["payload"] == "0.35 kg, 60 kg mm^2"
    own, together = (float(found.internal.values["mass"]) for found in (bare, loaded))
    assert together - own == pytest.approx(0.35e-3, rel=1e-9)
    drawn = modes_figure(flexfem.modes(stage, count=3, models="elements", resolution=4))
    assert f"mass {1e3 * own:.4g} kg. Displacements" in " ".join(
        text.get_text() for text in drawn.texts
    )
