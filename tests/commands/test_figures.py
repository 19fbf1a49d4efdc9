"""Figures of commands as files of pictures and pages, all drawn here; quick tests leave that out."""

from __future__ import annotations

import pytest

from ..conftest import ROOT

STAGE, FIXTURE, SLOPES, POINTS = ROOT / "geometry/mobility6.toml", ROOT / "cases/fixture.toml", "slopes.toml", "sn.csv"
MEASURED = 'name = "slopes"\n[measured]\nkxx_n_per_mm = 35.4\nkxx_sd_n_per_mm = 0.18\n'
MEASURED += "ktt_n_mm_per_rad = 3.28e4\nktt_sd_n_mm_per_rad = 160.0\n"
ASKED = {
    "converge": (STAGE, "--level", 2, "--level", 3, "--level", 4),
    "budget": (STAGE, "--plane"),
    "modes": (STAGE, "--resolution", 4, "--count", 1, "--drives", "engaged"),
    "command": (STAGE, "--pose", 2e-3, 0, 0, "--analytic"),
    "experiment": (STAGE, FIXTURE, "--resolution", 3),
    "identify": (STAGE, SLOPES),
    "life": (STAGE, "--amplitude", 0.05, 0, 0, "--analytic", "--fit", POINTS),
}


@pytest.mark.slow
@pytest.mark.parametrize("command", ASKED)
def test_every_command_that_draws_writes_a_picture_and_a_page(flexfem, tmp_path, command):
    (tmp_path / "empty" / SLOPES).write_text(MEASURED)  # where the command runs
    (tmp_path / "empty" / POINTS).write_text("stress_mpa, cycles\n948, 222\n703, 6004\n579, 43860\n524, 132150\n")
    code, _, err = flexfem(command, *ASKED[command], "--output", tmp_path / "out")
    assert code == 0, err
    made = {form: list((tmp_path / "out").glob(f"*.{form}")) for form in ("png", "pdf")}
    assert len(made["png"]) == len(made["pdf"]) > 0
    assert all(path.read_bytes().startswith(b"\x89PNG\r\n") for path in made["png"])
    assert all(path.read_bytes().startswith(b"%PDF-1.") for path in made["pdf"])
    assert all(path.stat().st_size > 5000 for paths in made.values() for path in paths)
