"""Every number of every kind of file at sizes that no quantity has: one line that refuses it, or an answer."""

from __future__ import annotations

import copy
import math
import tomllib
import warnings
from pathlib import Path

import pytest

from flexfem.design.requirements import load_requirements
from flexfem.files.toml import validate
from flexfem.files.writing import toml_text
from flexfem.mechanism.actuators import Catalogue
from flexfem.reference.formats import FORMATS
from flexfem.reference.schemas import schema_of
from flexfem.refused import BadInput
from flexfem.verify.case import LoadedCase

ROOT = Path(__file__).parents[2]
STAGE = str(ROOT / "geometry/mobility6.toml")
EXTREMES = (1e308, 1e-300, 5e-324, math.nan, math.inf, -1.0)
COMPARED = {"least", "most", "low_percent", "high_percent", "equals", "at_least", "at_most"}  # with what is found


def read(path):
    content = tomllib.loads((ROOT / path).read_text())
    content.pop("provenance", None)
    return content


def whole_stage():
    """The reference stage with every number that a file may state."""
    content = read("geometry/mobility6.toml")
    content["material"] |= {
        "fatigue_strength_coefficient_mpa": 900.0, "fatigue_strength_exponent": -0.1, "walker_exponent": 0.5,
        "fatigue_range_cycles": [1e3, 1e6],
    }  # fmt: skip
    content["hinges"]["base"]["axis_deg"] = 180.0
    content["hinges"]["elbow"]["axis_deg"] = 180.0
    content["hinges"]["platform"]["axis_deg"] = 90.0
    base, _ = content["actuator"]
    base |= {"ball_youngs_modulus_gpa": 210.0, "ball_poissons_ratio": 0.3, "friction": 0.1, "tilt_deg": 1.0}
    own = {"name": "own", "stroke_um": 20.0, "stiffness_n_per_um": 40.0, "contact_stiffness_n_per_um": 30.0}
    blocked = {"name": "blocked", "stroke_um": 20.0, "blocking_force_n": 800.0, "preload_n": 9.0}
    place = {"between": ["frame", "link 1"], "hinge": "base", "arm_mm": 12.0, "side": "left"}
    point = {"between": ["frame", "link 1"], "point_mm": [44.0, -36.5], "direction_deg": 90.0}
    content["actuator"] += [own | place, blocked | point]
    content["override"] = [
        {"chain": 2, "hinge": "elbow", "radius_mm": 1.4, "neck_mm": 0.52, "axis_deg": 180.0},
        {"chain": 1, "actuator": "base", "arm_mm": 9.0, "tilt_deg": 2.0, "ball_radius_mm": 1.5, "preload_n": 40.0,
         "ball_youngs_modulus_gpa": 200.0, "ball_poissons_ratio": 0.28, "friction": 0.2},
        {"chain": 1, "actuator": "own", "stroke_um": 19.0, "stiffness_n_per_um": 39.0,
         "contact_stiffness_n_per_um": 20.0},
        {"chain": 1, "actuator": "blocked", "point_mm": [43.0, -36.5], "direction_deg": 89.0,
         "blocking_force_n": 700.0},
    ]  # fmt: skip
    return content


def whole_studies():
    """Studies that state every number between them, as the base of others that are designs of the same stage."""
    base = {
        "name": "x", "stage": STAGE, "model": "analytic",
        "sampling": {"method": "sobol", "designs": 4, "seed": 1},
        "factor": [
            {"key": "thickness_mm", "from": 8.0, "to": 12.0},
            {"key": "hinges.base.neck_mm", "distribution": "normal", "mean": 0.5, "sd": 0.01, "lower": 0.4,
             "upper": 0.6},
            {"key": "hinges.elbow.neck_mm", "values": [0.4, 0.5]},
        ],
        "correlation": [{"factors": ["thickness_mm", "hinges.base.neck_mm"], "coefficient": 0.3}],
        "drive": {"stroke_um": 17.0, "lever_arm_mm": 10.0},
        "frequencies": {"payload_kg": 0.1, "payload_kg_mm2": 40.0},
        "constraint": [{"value": "kxx_n_per_mm", "least": 1.0, "most": 1e5}],
        "figure": [{"kind": "pareto", "x": "range_x_um", "y": "kxx_n_per_mm", "drawn": 3}],
    }  # fmt: skip
    uniform = {"key": "hinges.base.neck_mm", "distribution": "uniform", "lower": 0.4, "upper": 0.6}
    lasting = base | {
        "sampling": {"method": "monte_carlo", "designs": 4, "seed": 1}, "factor": [uniform], "correlation": [],
        "stage": "fatigue.toml", "drive": {"actuators": True},
        "life": {"amplitude_x_um": 20.0, "amplitude_y_um": 10.0, "amplitude_theta_mrad": 0.4, "ratio": -0.5,
                 "cycles": 1e6, "notch_sensitivity": 0.8},
    }  # fmt: skip
    log = {"key": "hinges.base.neck_mm", "from": 0.4, "to": 0.6, "scale": "log", "points": 3}
    meshed = {
        "name": "x", "stage": STAGE, "model": "three_dimensional", "resolution": 4, "layers": 2, "time_limit_s": 60.0,
        "sampling": {"method": "grid"}, "factor": [log],
    }  # fmt: skip
    verified = {
        "name": "x", "stage": STAGE, "model": "verify", "mobility": 6,
        "sampling": {"method": "saltelli", "base": 2, "seed": 1}, "factor": [uniform],
    }  # fmt: skip
    return [base, lasting, meshed, verified]


def contents_of(name):
    """Files of a kind that together state every number."""
    metal = read("flexfem/data/materials.toml")["al-6061-t6"] | {
        "fatigue_strength_coefficient_mpa": 900.0, "fatigue_strength_exponent": -0.1, "walker_exponent": 0.5,
        "fatigue_range_cycles": [1e3, 1e6],
    }  # fmt: skip
    metal.pop("sources", None)
    case = read("cases/fig5.toml")
    for curve in case["curve"]:
        curve["stage"] = STAGE
    turning = {key: value for key, value in case.items() if key != "amplitude_um"}
    solid = {"model": "three_dimensional", "layers": 3, "resolution": 4}
    wanted = read("cases/design-range.toml") | {
        "stage": STAGE, "accuracy_percent": 0.1, "resolution": 8, "front": 5, "mobility": 21,
        "drive": {"actuators": True, "stroke_um": 17.0, "lever_arm_mm": 10.0},
        "frequencies": {"payload_kg": 0.1, "payload_kg_mm2": 40.0},
        "tolerance": {"neck_um": 5.0, "stages": 100, "checked": 16},
    }  # fmt: skip
    wanted["free"] = [
        {"key": "thickness_mm", "from": 8.0, "to": 12.0, "step": 0.5},
        {"key": "hinges.base.neck_mm", "values": [0.4, 0.5]},
    ]
    lasting = wanted | {"stage": "fatigue.toml", "life": whole_studies()[1]["life"]}
    slopes = {"kxx": 37.0, "kyy": 37.5, "ktt": 41e3}
    measured = {f"{key}_n{'_mm_per_rad' if key == 'ktt' else '_per_mm'}": value for key, value in slopes.items()}
    measured |= {key.replace("_n", "_sd_n", 1): value / 100 for key, value in measured.items()}
    fixture = read("cases/fixture.toml")
    fixture["lvdt"]["arm_mm"] = 30.0
    fixture["measured"] = measured
    springs = fixture | {
        "pole": {"bending_stiffness_n_per_mm": 4e3, "torsional_stiffness_n_mm_per_rad": 2e6, "offset_mm": [0.5, 0.1]},
        "bar": {"arm_mm": 30.0, "angle_deg": 3.0, "stiffness_n_per_mm": 900.0},
    }  # fmt: skip
    whole = whole_stage()
    necks = [{"chain": c, "hinge": h, "neck_um": 507.0, "sd_um": 3.0} for c in (1, 2, 3) for h in (
        "base", "elbow", "platform")]  # fmt: skip
    return {
        "stage": [whole | {"actuator": [], "override": whole["override"][:1]}, whole],
        "case": [case, turning | {"direction": "theta", "amplitude_mrad": 1.0}, case | solid],
        "study": whole_studies(),
        "requirements": [wanted, lasting],
        "fixture": [fixture, springs],
        "measured": [{"name": "day 1", "measured": measured}],
        "material": [{"mine": metal}],
        "stack": [read("flexfem/data/stacks.toml")],
        "necks": [{"neck": necks}],
    }[name]


def numbers_in(content, path=()):
    """Paths of the numbers of a content."""
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        if isinstance(value, dict | list):
            yield from numbers_in(value, (*path, key))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield (*path, key)


def key_of(path):
    return next(part for part in reversed(path) if isinstance(part, str))


def numeric_keys(schema):
    """Keys of a schema that are numbers, or arrays of them."""
    found, entry = set(), schema.get("additionalProperties")
    for name, inner in schema.get("properties", {}).items():
        member = inner.get("items", inner)
        found |= numeric_keys(member) | ({name} if member.get("type") in ("number", "integer") else set())
    return found | (numeric_keys(entry) if isinstance(entry, dict) else set())


def asks(name, path, folder, flexfem):
    """Exit code and standard error of what is asked of a file in the cheapest way there is, both of a stage."""
    if name == "stage":
        for command in ("check", "summary"):
            code, _, err = flexfem(command, path)
            yield code, err
            if code:
                return
    elif name == "material":
        stage = read("geometry/mobility6.toml") | {"material": {"name": "mine", "file": path.name}}
        (folder / "of-file.toml").write_text(toml_text(stage))
        code, _, err = flexfem("summary", folder / "of-file.toml")
        yield code, err
    elif name in ("study", "fixture", "measured", "necks"):
        command = {
            "study": ("study", "status", path), "fixture": ("experiment", STAGE, path, "--analytic"),
            "measured": ("identify", STAGE, path), "necks": ("stiffness", STAGE, "--necks", path),
        }[name]  # fmt: skip
        code, _, err = flexfem(*command)
        yield code, err
    else:
        reader = {
            "case": LoadedCase, "requirements": load_requirements,
            "stack": lambda path: validate(Catalogue, path),
        }[name]  # fmt: skip
        try:
            reader(path)
            yield 0, ""
        except BadInput as refused:
            yield 2, f"flexfem: {refused}\n"


@pytest.mark.parametrize("name", FORMATS)
def test_no_number_of_any_file_ends_in_a_traceback_or_in_what_a_library_says(name, flexfem, tmp_path):
    fatigue = whole_stage()
    (tmp_path / "fatigue.toml").write_text(toml_text(fatigue))
    seen, path = set(), tmp_path / "own.toml"
    for content in contents_of(name):
        path.write_text(toml_text(content))
        assert list(asks(name, path, tmp_path, flexfem))[-1] == (0, "")
        for place in numbers_in(content):
            kind = tuple(part for part in place if isinstance(part, str))
            if kind in seen and name != "study":  # another member of the same array
                continue
            seen.add(kind)
            for extreme in EXTREMES:
                own = copy.deepcopy(content)
                *tables, last = place
                table = own
                for part in tables:
                    table = table[part]
                table[last] = extreme
                path.write_text(toml_text(own))
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    for code, err in asks(name, path, tmp_path, flexfem):
                        said = (place, extreme, code, err)
                        assert "error in flexfem" not in err and "Traceback" not in err, said
                        assert code in (0, 1, 2), said
                        if code:
                            assert err.startswith("flexfem: ") and err.count("\n") == 1, said
                        if not abs(extreme) <= 1e300 and key_of(place) not in COMPARED:
                            assert code == 2 and key_of(place) in err, said
    unseen = numeric_keys(schema_of(name)) - {kind[-1] for kind in seen}
    assert unseen == set()
