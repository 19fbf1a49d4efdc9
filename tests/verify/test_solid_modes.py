"""`flexfem modes --three-dimensional`: record, table, figure and file, on a small body; slow, on a stage."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

import flexfem as package
from flexfem.plot.modes import modes_figure, plot_solid_mode
from flexfem.verify import solid_modes as verify

from ..conftest import annular_vibration, annulus_for_stage

ROOT = Path(__file__).parents[2]
STAGE = ROOT / "geometry" / "mobility6.toml"


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The small body in place of every stage."""
    annulus_for_stage(monkeypatch)


@pytest.fixture(scope="module")
def found() -> Any:
    return annular_vibration()


def test_modes_of_both_kinds_stand_in_one_order(found: Any) -> None:
    of = found.record
    hertz = [one.frequency for one in of.modes]
    assert hertz == sorted(hertz) and {one.kind for one in of.modes} == {"in plane", "out of plane"}
    flat, tilting = (2 * np.pi * np.array([m.frequency for m in of.modes if m.kind == kind]) for kind in verify.KINDS)
    np.testing.assert_allclose(flat, found.halves[0].frequencies[: len(flat)])
    np.testing.assert_allclose(tilting, found.halves[1].frequencies[: len(tilting)])
    assert of.first_out_of_plane == next(one for one in of.modes if one.kind == "out of plane")
    alone = found.halves[1].frequencies[0] / 2 / np.pi
    assert of.first_out_of_plane.frequency == pytest.approx(alone)


def test_each_mode_has_its_bands_its_shares_and_its_frequency_in_plane_stress(found: Any) -> None:
    for one, (kind, k) in zip(found.record.modes, found.chosen, strict=True):
        half, share = found.halves[kind], one.share.model_dump()
        mine = ("x", "y", "theta") if kind == 0 else ("z", "tilt_x", "tilt_y")
        percent = 100 * half.participation[k] ** 2 / np.diag(half.total)
        np.testing.assert_allclose([share[name] for name in mine], percent, atol=1e-12)
        assert all(share[name] == 0 for name in set(share) - set(mine))
        assert one.band == pytest.approx(one.band_plane + one.band_thickness)
        assert one.mesh.resolutions == [2, 3, 4] and 0 < one.band_plane < 2 * one.frequency
        few, many = one.by_layers
        assert one.band_thickness == pytest.approx(1.25 * abs(many - few) / many * one.frequency)
        assert one.band_plane == pytest.approx(one.mesh.band / one.mesh.values[-1] * one.frequency)
        if kind == 1:
            assert one.plane_stress is None
        else:
            assert one.plane_stress == pytest.approx(one.frequency, rel=0.1) and one.plane_stress < one.frequency


def test_the_record_says_what_vibrates(found: Any) -> None:
    """The reference stage of 0.0892 kg with 0.3 kg; the mesh is of an annulus."""
    of = found.record
    assert of.mass == pytest.approx(0.3892, abs=1e-4) and of.hub_mass == pytest.approx(0.00565, abs=1e-5)
    assert (of.payload_mass, of.payload_inertia, of.payload_tilting) == pytest.approx((0.3, 20.0, 16.0))
    assert of.inertia == pytest.approx(137.7, abs=0.1)
    ring = 2810e-9 * np.pi * (60**2 - 12**2) * 10
    hub = 0.0056498
    assert of.meshed_mass == pytest.approx(ring + hub + 0.3, rel=2e-3)
    tilting = ring * ((60**2 + 12**2) / 4 + 100 / 12) + hub * (64 / 4 + 100 / 12) + 16.0
    assert of.tilting_inertia == pytest.approx((tilting, tilting), rel=4e-3)
    assert of.heights[0] == 0 and of.heights[-1] == 5.0 and np.all(np.diff(of.heights, 2) < 0)
    assert verify.AT_ITS_PLACE in of.warnings


def test_from_face_to_face_a_mode_is_even_or_odd(found: Any) -> None:
    for number, (kind, _) in enumerate(found.chosen):
        field, (u, _, w) = found.through(number), np.moveaxis(found.through(number), -1, 0)
        np.testing.assert_allclose(u, u[:, ::-1] * (1 if kind == 0 else -1), atol=1e-9 * np.abs(field).max())
        np.testing.assert_allclose(w, w[:, ::-1] * (-1 if kind == 0 else 1), atol=1e-9 * np.abs(field).max())
    np.testing.assert_allclose(found.heights, -found.heights[::-1])
    assert found.heights.shape == (field.shape[1],)


@pytest.mark.usefixtures("unrendered")
def test_the_command_prints_and_writes(small: None, flexfem: Any, tmp_path: Path) -> None:
    command = ("modes", STAGE, "--three-dimensional", "--count", 3, "--payload", 0.3, 20, "-o", tmp_path)
    code, out, err = flexfem(*command)
    assert code == 0 and "modes 2/2: out of plane:" in err
    of = json.loads((tmp_path / "mobility6-modes-solid.json").read_text())
    rows = [line for line in out.splitlines() if "plane  " in line and line[0].isdigit()]
    for row, one in zip(rows, of["modes"], strict=True):
        cells = row.split()
        assert cells[1:3] == [f"{one['frequency']:.6g}", f"{one['band']:.2g}"]
        shares = [f"{one['share'][name]:.2f}" for name in ("x", "y", "theta", "z", "tilt_x", "tilt_y")]
        here = cells[-7:-1]
        assert here == ([*shares[:3], "-", "-", "-"] if one["kind"] == "in plane" else ["-", "-", "-", *shares[3:]])
        assert cells[-1] == ("-" if one["plane_stress"] is None else f"{one['plane_stress']:.6g}")
    assert len(rows) == 3
    first = of["first_out_of_plane"]
    assert f"first mode out of the plane: {first['frequency']:.6g} ± {first['band']:.2g} Hz" in out
    assert "of it the payload 0.3 kg; 20 about the normal, 10 about x and y (kg mm^2)" in out
    grid = meshio.read(tmp_path / "mobility6-modes-solid.vtu")
    assert {"mode 1", "mode 2", "mode 3"} <= set(grid.point_data) and np.ptp(grid.points[:, 2]) == pytest.approx(10.0)


def test_contours_are_of_what_leaves_the_plane_and_the_rest_is_displaced(found: Any) -> None:
    figure = modes_figure(found)
    for number, (kind, _) in enumerate(found.chosen, start=1):
        ax = plot_solid_mode(None, found, number)
        levels = [each for each in ax.collections if hasattr(each, "levels")]
        assert len(levels) == kind
        if kind == 1:
            w = found.field(number - 1)[:, 0, 2]
            np.testing.assert_allclose(levels[0].levels, np.linspace(-0.8, 0.8, 9), atol=1e-12)
            drawn = np.concatenate([segment for each in levels[0].allsegs for segment in each])
            assert np.abs(drawn).max() <= np.abs(found.mesh.nodes).max() and np.abs(w).max() > 0
        assert figure.axes[number - 1].get_title().startswith(f"mode {number}, {found.record.modes[number - 1].kind}")
        assert any(isinstance(each, PolyCollection) for each in ax.collections)
    with pytest.raises(package.BadInput, match="mode 8, expected 1 to 7"):
        plot_solid_mode(None, found, 8)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--layers", 3), "--layers without --three-dimensional"),
        (("--tilting", 3), "--tilting without --three-dimensional"),
        (("--three-dimensional", "--drives", "engaged"), "--drives engaged --three-dimensional, expected disengaged"),
        (("--three-dimensional", "--payload", 1, 20, "--tilting", 9.9), "tilting 9.9, expected a number from 10 to"),
        (("--three-dimensional", "--count", 41), "count 41, expected an integer from 1 to 40"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(flexfem: Any, options: Any, said: str) -> None:
    code, out, err = flexfem("modes", STAGE, *options)
    assert code == 2 and out == "" and said in err and len(err.strip().splitlines()) == 1


@pytest.mark.slow
def test_the_reference_stage_vibrates_out_of_its_plane_at_five_times_its_first_frequency() -> None:
    """Within its bands of the limit by ten triangles across, and by six layers; 5 % above plane stress."""
    of = package.modes_solid(package.load(STAGE))
    truth = [137.938, 137.938, 203.378, 693.03, 1405.40, 1405.40]
    for one, exact in zip(of.modes, truth, strict=True):
        assert abs(one.frequency - exact) < one.band < 5e-3 * exact
    assert [one.kind for one in of.modes] == ["in plane"] * 3 + ["out of plane"] * 3
    assert of.modes[3].share.z == pytest.approx(79.5, abs=0.2)
    assert all(one.plane_stress == pytest.approx(one.frequency / 1.0511, rel=2e-3) for one in of.modes[:3])
    assert of.tilting_inertia[0] == pytest.approx(of.inertia / 2 + of.mass * 100 / 12, rel=1e-4)
