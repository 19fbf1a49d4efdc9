"""Natural frequencies and numbers of the drive of designs as arrays, against one after the other."""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions.designs import QUANTITIES, answers
from flexfem.refused import BadInput

from ..conftest import ROOT

ALIKE = 1e-8  # relative: two orders of elimination
VARIED = {
    "pivot": {},
    "rhombic-amplifier": {"angle_deg": 7.0, "arm_mm": 21.0, "neck_mm": 0.45},
    "bridge-amplifier": {},
    "lever-amplifier": {},
    "double-parallelogram": {"length_mm": 33.0, "outer_mm": 71.0, "width_mm": 8.0},
}


def designs_of(base: MechanismFile, stated: dict[str, float]) -> list[dict[str, float]]:
    """Designs that differ from the base in numbers of unlike size."""
    plain = {key: float(x) for key, x in base.parameters.items() if not hasattr(x, "text")}
    found = [plain, {**plain, **stated}]
    for place, key in enumerate(plain):
        found.append({**plain, key: plain[key] * (1.02 + 0.003 * place)})
    return found


def require_alike(base: MechanismFile, question: str, designs: list[dict[str, float]]) -> None:
    """Compare every quantity that arrays have."""
    given = {f"parameters.{key}": np.array([one[key] for one in designs]) for key in designs[0]}
    assert base.without_arrays(given) == ""
    names = QUANTITIES[question]
    found = answers(base.layouts(given, len(designs)), lambda hinge: None, {question: names})
    compared = 0
    for design, parameters in enumerate(designs):
        try:
            changed = base.replace(parameters=parameters, provenance={})
        except BadInput:  # its bodies do not meet, which arrays do not see
            continue
        compared += 1
        alone = getattr(flexfem, question)(changed, models="analytic").internal.values
        for name in names:
            expected = np.ravel(alone[name])
            values = np.ravel(found[question][name][design])[: len(expected)]
            known = np.isfinite(expected)
            assert np.array_equal(known, np.isfinite(values)), (name, design)
            size = np.max(np.abs(expected[known]), initial=0.0)
            assert values[known] == pytest.approx(expected[known], rel=ALIKE, abs=ALIKE * size)
    assert compared > 1


@pytest.mark.parametrize("name", VARIED)
def test_frequencies_of_designs_as_arrays(name: str) -> None:
    base = flexfem.load(ROOT / f"geometry/{name}.toml").replace(model="plane_stress")
    require_alike(base, "modes", designs_of(base, VARIED[name]))


@pytest.mark.parametrize("name", ["rhombic-amplifier", "bridge-amplifier", "lever-amplifier"])
def test_driven_designs_as_arrays(name: str) -> None:
    base = flexfem.load(ROOT / f"geometry/{name}.toml").replace(model="plane_strain")
    require_alike(base, "drive", designs_of(base, VARIED[name]))


def test_masses_that_are_carried_count_in_frequencies() -> None:
    """A payload off the centre of its body, and a heavy actuator, both with numbers that vary."""
    path = ROOT / "geometry/lever-amplifier.toml"
    content = flexfem.load(path).model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
    content |= {"model": "plane_stress", "provenance": {}}
    content["parameters"] = {**content["parameters"], "load_g": 200.0}
    content["payload"] = {"mass_g": "load", "inertia_kg_mm2": "load / 40"}
    content["actuator"][0]["mass_g"] = "load / 7"
    base = MechanismFile.model_validate(content)
    require_alike(base, "modes", designs_of(base, {"load_g": 1700.0}))
