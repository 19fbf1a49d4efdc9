"""NGSolve and CalculiX on our wedges; both are slow and not always installed."""

from __future__ import annotations

import json
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexfem
from flexfem.fem.layers import layers_of, mirrored, rigid_fields
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import rigid_motion
from flexfem.fem.sectors import mesh_sectors, welded
from flexfem.fem.solid import sheet_of
from flexfem.fem.solid_response import solid_response
from flexfem.validate import compare_solid, prisms, solids
from flexfem.validate.frequencies import Vibrating

from ..conftest import UNLIKE, with_changes

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"


KINDS = ["in plane"] * 6 + ["out of plane"] * 6


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
def test_ngsolve_has_the_same_wedges(make_stage: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(compare_solid, "LAYERS", 1)
    found = compare_solid.cross_check_solid(make_stage(), 2, "ngsolve")
    pose, quadrature, hertz, of_default = found.checks
    assert found.passed and pose.difference < 1e-9 and hertz.difference < 1e-9
    assert 1e-9 < quadrature.difference < 1e-6 and 1e-9 < of_default.difference < 1e-6
    assert list(found.kinds) == KINDS


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_both_have_the_frequencies_of_unlike_chains_in_and_out_of_the_plane(monkeypatch: Any) -> None:
    """Another thickness and density, so that the hub tilts otherwise; no two modes of one frequency."""
    monkeypatch.setattr(compare_solid, "LAYERS", 1)
    stage = with_changes({"override": UNLIKE, "thickness_mm": 13.7, "material.density_kg_m3": 4430.0})
    for solver, most in (("ngsolve", 1e-9), ("calculix", 5e-7)):
        found = compare_solid.cross_check_solid(stage, 2, solver)
        assert found.passed and found.checks[0].difference < most and found.checks[2].difference < most
        assert np.all(np.diff(found.their_frequencies[[0, 1, 2]]) > 1e-3)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_has_the_part_of_our_wedges_that_lacks_the_middles_of_rectangles(
    flexfem: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(compare_solid, "LAYERS", 1)
    code, out, _ = flexfem("cross-check", STAGE, "--solver", "calculix", "--three-dimensional", "--json")
    assert code == 0 and '"2.' in out
    found = json.loads(out)
    pose, whole, hertz, of_all = found["checks"]
    assert pose["difference"] < 1e-6 and hertz["difference"] < 5e-7
    assert 2e-6 < whole["difference"] < 5e-4  # which is why the digits printed cannot be met by 18 nodes
    assert 2e-6 < of_all["difference"] < 1e-3
    assert found["their_compliance"][0][0] < 0.0238 and found["kinds"] == KINDS
    np.testing.assert_allclose(found["their_frequencies"][6:8], [697.28, 1417.2], rtol=5e-5)


@pytest.mark.slow
def test_wedges_of_fifteen_nodes_are_stiffer_and_in_the_plane_the_same(make_stage: Any) -> None:
    """Without Poisson's ratio nothing depends on z, and middles are of no use."""
    for nu, least, most in ((0.29, 1e-6, 1e-3), (0.0, -1e-5, 1e-5)):
        stage = make_stage({"material.poissons_ratio": nu})
        sectors, layers = mesh_sectors(stage, 2, inside=True), layers_of(stage, 1)
        mesh, plate = welded(sectors)[0], sheet_of(stage)
        few = solids.serendipity_compliance(mesh, plate, layers)
        all_nodes = solid_response(sectors, plate, layers, 2).compliance
        off = 1 - np.diag(few) / np.diag(all_nodes)
        assert np.all((off > least) & (off < most))


def test_hub_and_disc_of_the_other_solvers_move_and_weigh_as_ours() -> None:
    """Their own formulas: motions of the hub's rim, and 8 mm, 10 mm thick, 2810 kg/m^3 about a diameter."""
    nodes, flat = np.array([[3.1, -2.2], [0.4, 5.9]]), mirrored(13.7, 2, 0.8)
    for layers in (flat, flat.antisymmetric):
        theirs = solids.hub_motions(nodes, layers.heights, bool(layers.fixed))
        np.testing.assert_allclose(theirs, rigid_fields(layers, rigid_motion(nodes)), atol=1e-15)
    tilted = solids.hub_motions(nodes, np.array([6.0]), True) @ [0.1, 0.02, 0.03]
    np.testing.assert_allclose(tilted[0, 0], [0.18, -0.12, 0.1 - 0.044 - 0.093], atol=1e-12)
    of = Vibrating(None, Plate(71.7e3, 0.33, 10.0), 2810e-12, 8.0, np.zeros((3, 3)))  # type: ignore[arg-type]
    tilting = 5.64984e-6 * (64 / 4 + 100 / 12)
    np.testing.assert_allclose(prisms.tilting_disc(of), np.diag([5.64984e-6, tilting, tilting]), rtol=1e-5)


@pytest.mark.parametrize("missing", ["ngsolve", "calculix"])
def test_a_solver_that_is_missing_is_named_before_anything_is_meshed(missing: str, monkeypatch: Any) -> None:
    monkeypatch.setattr(compare_solid, "mesh_sectors", lambda *_: pytest.fail("meshed"))
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    with pytest.raises(flexfem.BadInput, match="expected it installed"):
        flexfem.cross_check(flexfem.load(STAGE), missing, three_dimensional=True)
    with pytest.raises(flexfem.BadInput, match="solver 'nastran', expected one of"):
        flexfem.cross_check(flexfem.load(STAGE), "nastran", three_dimensional=True)
