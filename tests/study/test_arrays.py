"""Designs of any mechanism as arrays against the same designs one after the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexfem
from flexfem.arrays import Array
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions.designs import at_rest
from flexfem.refused import BadInput
from flexfem.study.answer import answer, answer_designs
from flexfem.study.arrays import ArrayBatch
from flexfem.study.loaded import load_study, sample

from ..conftest import ROOT
from ..importing.random_plates import random_mechanism
from ..tolerances import DENSE

ARRAYS = 1e-9  # relative to the size of a number, of two orders of elimination
FITTED = 2e-6  # relative: ratios of wide hinges are fitted to 5e-7, and have round-off of 2e-6
SHIPPED = sorted(
    path
    for path in (ROOT / "geometry").glob("*.toml")
    if isinstance(flexfem.load(path), MechanismFile) and flexfem.load(path).parameters
)
DESIGNS = 8


def sizes(name: str, values: Array) -> Array:
    """Sizes to which round-off of a quantity is relative: symmetry makes parts of it zero."""
    if name in ("compliance", "stiffness"):
        diagonal = np.sqrt(np.abs(np.diagonal(values)))
        return np.outer(diagonal, diagonal)
    if name in ("amplification", "stress"):
        return np.maximum(np.abs(values), np.max(np.abs(values)) / 100)
    return np.abs(values)


def content_of(mechanism: MechanismFile) -> dict:
    """The content of a file, with its expressions."""
    content = mechanism.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
    return {**content, "provenance": {}}


def require_equal(base: MechanismFile, given: dict[str, Array], relative: float = ARRAYS) -> None:
    """Compare all numbers of designs in a plane model with those of one design after the other."""
    assert base.without_arrays(given) == ""
    count = len(next(iter(given.values())))
    found = at_rest(base.layouts(given, count), lambda hinge: None)
    content = content_of(base)
    stated = content["parameters"]
    compared = 0
    for design in range(count):
        one = {path.removeprefix("parameters."): values[design] for path, values in given.items()}
        content["parameters"] = {**stated, **one}
        try:
            changed = MechanismFile.model_validate(content)
            alone = flexfem.stiffness(changed, models="analytic", no_limits=True).internal.values
        except BadInput:  # its bodies do not meet, which arrays do not see
            continue
        compared += 1
        for name, values in found.items():
            if name in alone:
                expected = np.reshape(alone[name], values[design].shape)
                error = np.abs(values[design] - expected) / sizes(name, expected)
                assert np.max(error) < relative, (name, design)
    assert compared


def spread(base: MechanismFile, share: float, seed: int) -> dict[str, Array]:
    """Parameters that are plain numbers, varied by a share: all at once, and one after the other."""
    rng = np.random.default_rng(seed)
    plain = {key: value for key, value in base.parameters.items() if not hasattr(value, "text")}
    apart = np.ones((DESIGNS, len(plain)))
    apart[: DESIGNS // 2] = rng.uniform(1 - share, 1 + share, (DESIGNS // 2, len(plain)))
    for design in range(DESIGNS // 2, DESIGNS):
        apart[design, design % len(plain)] = 1 + share * rng.uniform(-1, 1)
    return {
        f"parameters.{key}": value * apart[:, place]
        for place, (key, value) in enumerate(plain.items())
    }


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
@pytest.mark.parametrize("model", ["plane_stress", "plane_strain"])
def test_arrays_have_the_numbers_of_each_design(path: Path, model: str) -> None:
    base = flexfem.load(path).replace(model=model)
    require_equal(base, spread(base, 0.02, 3), DENSE)


@pytest.mark.parametrize("seed", range(8))
def test_arrays_have_the_numbers_of_random_mechanisms_of_all_shapes(seed: int) -> None:
    """Necks, thickness and the place of the output depend on parameters."""
    drawn = content_of(random_mechanism(seed))
    drawn |= {"model": "plane_stress", "thickness_mm": "height"}
    drawn["parameters"] = {"height_mm": 9.0, "scale": 1.0, "shift_mm": 0.3}
    for hinge in drawn["hinge"]:
        if "neck_mm" in hinge:
            hinge["neck_mm"] = f"scale * {hinge['neck_mm']!r}"
    x, y = drawn["output"]["at_mm"]
    drawn["output"]["at_mm"] = [f"{x!r} + shift", y]
    base = MechanismFile.model_validate(drawn)
    require_equal(base, spread(base, 0.05, seed), DENSE)


SIDED = {  # keys of hinges that are not symmetric, and half their length
    "circular": ({"radius_mm": "2 * scale", "side": "left"}, "2 * scale"),
    "elliptical": (
        {"length_mm": "5 * scale", "depth_mm": 1.5, "side": "right"},
        "2.5 * scale",
    ),
    "leaf": (
        {"length_mm": "9 * scale", "fillet_mm": 0.4, "flush": ["first left"]},
        "4.5 * scale",
    ),
    "parabolic": ({"length_mm": 5.0, "depth_mm": "1.5 * scale", "side": "left"}, "2.5"),
    "v": (
        {"angle_deg": 60, "root_radius_mm": "0.5 * scale", "depth_mm": 2, "side": "right"},
        "0.5 * scale * cos(30) + (2 - 0.25 * scale) * tan(30)",
    ),
}


@pytest.mark.parametrize("shape", SIDED)
def test_arrays_have_the_numbers_of_hinges_that_are_not_symmetric(shape: str) -> None:
    """A hinge and its mirror image between two blocks."""
    keys, half = SIDED[shape]
    between = {"between": ["base", "tip"], "at_mm": [0, "10 * scale"], "direction_deg": 0}
    hinge = {"name": "one", **between, "shape": shape, "neck_mm": "0.5 * scale", **keys}
    left, right = f"-({half})", half
    content = {
        "name": "two hinges",
        "model": "plane_stress",
        "thickness_mm": 8.0,
        "material": {"name": "al-7075-t6"},
        "parameters": {"scale": 1.0, "depth_mm": 30.0},
        "body": [
            {
                "name": "base",
                "outline_mm": [[-30, -20], [left, -20], [left, 20], [-30, 20]],
                "fixed": True,
            },
            {
                "name": "tip",
                "outline_mm": [[right, -20], ["depth", -20], ["depth", 20], [right, 20]],
            },
        ],
        "hinge": [hinge],
        "copy": [{"parts": ["one"], "mirror_mm": [[0, 0], [1, 0]]}],
        "output": {"body": "tip", "at_mm": ["depth - 5", "scale"]},
    }
    base = MechanismFile.model_validate(content)
    require_equal(base, spread(base, 0.05, 5), DENSE)


STUDY = """name = "leaves"
stage = "guide.toml"
model = "analytic"
ask = ["stiffness.free.analytic.x", "stiffness.yield_range.analytic.x", "stiffness.stress.analytic.leaf.theta"]
CHECK
[sampling]
method = "sobol"
designs = 256
seed = 4
[[factor]]
key = "parameters.length_mm"
from = LOW
to = 60.0
[[factor]]
key = "parameters.neck_mm"
from = 0.3
to = 0.7
"""


def study_of(folder: Path, low: float = 20.0, check: str = "") -> Path:
    if not (folder / "guide.toml").exists():
        flexfem.new_stage(folder / "guide.toml", kind="parallelogram")
    path = folder / "study.toml"
    path.write_text(STUDY.replace("LOW", str(low)).replace("CHECK", check))
    return path


def test_fitted_hinges_in_three_dimensions_have_the_numbers_of_each_design(tmp_path: Path) -> None:
    loaded = load_study(study_of(tmp_path))
    assert isinstance(loaded.family.batch, ArrayBatch)
    together = answer(loaded, 0, 256)
    assert set(together.status) == {"ok"}
    drawn = load_study(study_of(tmp_path, check='check = "drawing"'))
    assert drawn.family.batch is None
    for design in (0, 77, 255):
        alone = answer(drawn, design, design + 1)
        np.testing.assert_allclose(together.values[design], alone.values[0], rtol=FITTED)


def test_designs_that_are_refused_are_refused_as_arrays_or_when_they_are_drawn(
    tmp_path: Path,
) -> None:
    """Leaves shorter than their fillets have no profile; leaves that touch are found by drawing."""
    loaded = load_study(study_of(tmp_path, low=0.5))
    values = np.vstack([[0.9, 0.5], sample(loaded, 0, 200)])
    rows = answer_designs(loaded, values)
    drawn = load_study(study_of(tmp_path, low=0.5, check='check = "drawing"'))
    assert rows.status[0] == "refused"
    assert "fillet_mm" in rows.reason[0]
    for row, status in zip(values[:40], rows.status[:40], strict=True):
        alone = answer_designs(drawn, row[None]).status[0]
        assert status == alone or (status, alone) == ("ok", "refused")
        made = loaded.family.drawable(row) is not None
        assert made == (alone == "ok")


def test_a_fillet_that_vanishes_in_some_designs_is_a_leaf_without_fillets() -> None:
    base = flexfem.load(ROOT / "geometry/parallelogram.toml")
    content = content_of(base)
    content["hinge"][0]["fillet_mm"] = "max(fillet, 0)"
    content["parameters"] = {**content["parameters"], "fillet_mm": 0.3}
    changed = MechanismFile.model_validate({**content, "model": "plane_stress"})
    for fillets in ([0.2, 0.4], [0.0, 0.0]):
        require_equal(changed, {"parameters.fillet_mm": np.array(fillets)})
