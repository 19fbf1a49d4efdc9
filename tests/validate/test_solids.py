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
from flexfem.fem.sectors import mesh_sectors, welded
from flexfem.fem.solid import layers_of, sheet_of
from flexfem.fem.solid_response import solid_response
from flexfem.validate import compare, solids

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
def test_ngsolve_has_the_same_wedges(make_stage: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(compare, "SOLID_LAYERS", 1)
    found = compare.cross_check_solid(make_stage(), 2, "ngsolve")
    pose, quadrature = found.checks
    assert found.passed and pose.difference < 1e-9
    assert 1e-9 < quadrature.difference < 1e-6


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_has_the_part_of_our_wedges_that_lacks_the_middles_of_rectangles(flexfem: Any) -> None:
    code, out, _ = flexfem("cross-check", STAGE, "--solver", "calculix", "--three-dimensional", "--json")
    assert code == 0 and '"2.' in out
    found = json.loads(out)
    pose, whole = found["checks"]
    assert pose["difference"] < 1e-6
    assert 2e-6 < whole["difference"] < 5e-4  # which is why the digits printed cannot be met by 18 nodes
    assert found["their_compliance"][0][0] < 0.0238


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


@pytest.mark.parametrize("missing", ["ngsolve", "calculix"])
def test_a_solver_that_is_missing_is_named_before_anything_is_meshed(missing: str, monkeypatch: Any) -> None:
    monkeypatch.setattr(compare, "mesh_sectors", lambda *_: pytest.fail("meshed"))
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "ngsolve", None)
    with pytest.raises(flexfem.BadInput, match="expected it installed"):
        flexfem.cross_check(flexfem.load(STAGE), missing, three_dimensional=True)
    with pytest.raises(flexfem.BadInput, match="solver 'nastran', expected one of"):
        flexfem.cross_check(flexfem.load(STAGE), "nastran", three_dimensional=True)
