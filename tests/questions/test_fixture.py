"""Files of set-ups and of measured slopes: what is read, and what is refused in one line."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.paper.fixture import Fixture, Measurement, fixture_of, measured_of
from flexfem.refused import BadInput

from ..conftest import ROOT

SHIPPED = ROOT / "cases" / "fixture.toml"
SLOPES = "[measured]\nkxx_n_per_mm = 37.0\nkxx_sd_n_per_mm = 0.2\nktt_n_mm_per_rad = 3.9e4\n"


def test_the_shipped_set_up_is_read_in_mm_and_n_and_every_number_has_a_source():
    found = fixture_of(SHIPPED)
    assert (found.pole.diameter, found.pole.pushed_at, found.pole.youngs_modulus) == (
        8.0,
        20.0,
        206e3,
    )
    assert (found.actuator.stroke, found.actuator.stiffness) == (0.045, 19e3)
    assert (found.lvdt.noise, found.lvdt.resolution) == (5e-5, 2e-5)
    assert (found.sensor.stiffness, found.sensor.noise, found.sensor.resolution) == (
        1e4,
        0.004,
        0.002,
    )
    np.testing.assert_allclose(found.run.strokes, 0.002 * np.arange(21))
    assert found.not_stated == () and {*found.numbers} <= set(found.assumed)


def test_measured_slopes_are_read_with_a_set_up_or_alone(tmp_path):
    (tmp_path / "both.toml").write_text(
        SHIPPED.read_text().replace("[provenance]", SLOPES + "[provenance]")
    )
    (tmp_path / "alone.toml").write_text(f'name = "slopes"\n{SLOPES}')
    for name, kind in (("both", Fixture), ("alone", Measurement)):
        found = measured_of(tmp_path / f"{name}.toml")
        assert type(found) is kind
        np.testing.assert_array_equal(found.measured.slopes[0], [37.0, np.nan, 3.9e4])
        np.testing.assert_array_equal(found.measured.slopes[1], [0.2, np.nan, np.nan])
    with pytest.raises(BadInput, match=r"fixture\.toml: no \[measured\] slopes"):
        measured_of(SHIPPED)


BAD = [
    ("diameter_mm = 8.0", "diameter_mm = -8.0", "pole.diameter_mm = -8.0, expected > 0"),
    (
        "push_height_mm = 20.0",
        "push_height_mm = 41.0",
        "pole.push_height_mm = 41.0, expected at most the height",
    ),
    ("poissons_ratio = 0.3", "poissons_ratio = 0.5", "pole.poissons_ratio = 0.5, expected < 0.5"),
    ("stroke_um = 45.0", "stroke_um = 39.0", "within the stroke of the actuator, 39 um"),
    ("increments = 20", "increments = 1", "run.increments = 1, expected >= 2"),
    (
        "confidence_percent = 95.0",
        "confidence_percent = 0.95",
        "run.confidence_percent = 0.95, expected >= 50",
    ),
    ('at = "pole"', 'at = "bar"', "lvdt.at = \"bar\", expected 'pole' or 'platform'"),
    (
        "noise_n = 0.004",
        "noise_um = 0.004",
        "sensor.noise_um is an unknown key, did you mean noise_n?",
    ),
    ("[sensor]", "[sonsor]", "sonsor is an unknown key, did you mean sensor?"),
    ('"lvdt" = "assumed', '"lvdts" = "assumed', "provenance.lvdts"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD, ids=[said for _, _, said in BAD])
def test_a_set_up_that_cannot_be_is_refused_in_one_line(tmp_path, old, new, said):
    text = SHIPPED.read_text()
    assert text.count(old) >= 1
    (tmp_path / "fixture.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput) as refused:
        fixture_of(tmp_path / "fixture.toml")
    assert (
        said in str(refused.value)
        and "\n" not in str(refused.value)
        and "fixture.toml" in str(refused.value)
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "measured is missing"),
        ("[measured]\n", "expected one or more of kxx_n_per_mm"),
        (
            "[measured]\nkxx_sd_n_per_mm = 1.0\nkyy_n_per_mm = 1.0\n",
            "kxx_sd_n_per_mm = 1.0, expected kxx_n",
        ),
        (
            "[measured]\nkxx_n_per_mm = 1.0\nkxx_sd_n_per_mm = 1.0\n",
            "expected kxx_n_per_mm larger than it",
        ),
        ("[measured]\nkxx_n_per_mm = -1.0\n", "measured.kxx_n_per_mm = -1.0, expected > 0"),
        ("[measured]\nkxx = 1.0\n", "measured.kxx is an unknown key"),
        ("[measure]\nkxx_n_per_mm = 1.0\n", "measure is an unknown key, did you mean measured?"),
    ],
)
def test_slopes_that_cannot_be_are_refused_in_one_line(tmp_path, text, said):
    (tmp_path / "slopes.toml").write_text(f'name = "slopes"\n{text}')
    with pytest.raises(BadInput) as refused:
        measured_of(tmp_path / "slopes.toml")
    assert said in str(refused.value) and "\n" not in str(refused.value)
