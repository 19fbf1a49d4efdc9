"""JSON schemas against what reads the files: two independent validators, shipped files, bad values,
random changes.
"""

from __future__ import annotations

import copy
import json
import random
import subprocess
import sysconfig
import tomllib
from functools import cache
from pathlib import Path

import jsonschema
import pytest
from pydantic import ValidationError

from flexfem.files.quantities import UNIT
from flexfem.files.writing import toml_text
from flexfem.paper.stage import load_stage
from flexfem.refused import BadInput
from flexfem.schemas.command import FILE, schema
from flexfem.schemas.formats import FORMATS, results
from flexfem.schemas.keys import example_of, tables_of
from flexfem.schemas.of_files import schema_of
from flexfem.units import UNITS

from ..conftest import ROOT

TAPLO = Path(sysconfig.get_path("scripts")) / "taplo"
SHIPPED = {
    "stage": [
        *sorted((ROOT / "geometry").glob("mobility*.toml")),
        ROOT / "flexfem/data/new-stage.toml",
    ],
    "mechanism": sorted((ROOT / "flexfem/data").glob("mechanism-*.toml")),
    "case": [
        *sorted((ROOT / "cases").glob("[fj][io][gi]*.toml")),
        ROOT / "flexfem/data/new-case.toml",
    ],
    "study": [
        *sorted((ROOT / "cases").glob("study-*.toml")),
        *sorted((ROOT / "tests/baselines/studies").glob("*.toml")),
        ROOT / "flexfem/data/new-study.toml",
    ],
    "requirements": sorted((ROOT / "cases").glob("design-*.toml")),
    "fixture": [ROOT / "cases/fixture.toml"],
    "material": [ROOT / "flexfem/data/materials.toml"],
}
NECK = {"neck_um": 507.0, "sd_um": 3.0}
MADE = {
    "measured": {"name": "day 1", "measured": {"kxx_n_per_mm": 1480.0, "kxx_sd_n_per_mm": 11.0}},
    "necks": {
        "neck": [
            {"chain": c, "hinge": h, **NECK}
            for c in (1, 2, 3)
            for h in ("base", "elbow", "platform")
        ]
    },
}


@cache
def validator(name):
    return jsonschema.Draft7Validator(schema_of(name))


@cache
def shipped(name):
    return tomllib.loads(SHIPPED[name][0].read_text()) if name in SHIPPED else MADE[name]


def accepts(name, content):
    """Whether flexfem reads the content, what other files hold left aside."""
    model = FORMATS[name].table
    named = FORMATS[name].tables
    try:
        for each in content.values() if named else [content]:
            model.model_validate(each)
    except ValidationError:
        return False
    return True


def checked_by_taplo(folder, schema, *paths):
    found = subprocess.run(
        [TAPLO, "check", "--schema", f"file://{schema}", *paths], capture_output=True, cwd=folder
    )
    return found.returncode == 0


@pytest.mark.parametrize("name", FORMATS)
def test_shipped_files_are_accepted_by_both_validators(name, tmp_path):
    jsonschema.Draft7Validator.check_schema(schema_of(name))
    (written,) = schema(name, output=tmp_path)
    assert written.name == FILE.format(name) and json.loads(written.read_text()) == schema_of(name)
    paths = SHIPPED.get(name, [tmp_path / "made.toml"])
    (tmp_path / "made.toml").write_text(toml_text(shipped(name)))
    for path in paths:
        assert [
            error.message for error in validator(name).iter_errors(tomllib.loads(path.read_text()))
        ] == [], path
    assert checked_by_taplo(tmp_path, written, *paths)


@pytest.mark.parametrize("name", results())
def test_results_have_schemas(name):
    jsonschema.Draft7Validator.check_schema(schema(name))
    assert schema(name)["properties"]["result"] == {"const": name} and f"{name}." in str(
        schema(name)
    )


def changed(name, *changes):
    """The first shipped file with values replaced at paths of keys; None takes the key away."""
    content = copy.deepcopy(shipped(name))
    for path, value in changes:
        *tables, key = path
        table = content
        for each in tables:
            table = table[each] if isinstance(each, int) else table.setdefault(each, {})
        if value is None:
            del table[key]
        else:
            table[key] = value
    content.pop("provenance", None)
    return content


RANGE = {"key": "thickness_mm", "from": 8.0, "to": 12.0}
SOBOL = (("sampling",), {"method": "sobol", "designs": 16, "seed": 3})
LINKED = {"label": "elastic", "stage": "stage.toml", "links": True, "mobility": 21}
BAD_VALUES = {
    "length in metres": ("stage", (("thickness_mm",), 1e-9)),
    "negative neck": ("stage", (("hinges", "elbow", "neck_mm"), -0.5)),
    "expansion per kelvin": ("stage", (("frame",), {"expansion_um_per_m_k": 12e-6})),
    "misspelt factor": ("study", (("factor",), [RANGE | {"key": "thicknes_mm"}]), SOBOL),
    "tolerance without a scatter": ("requirements", (("tolerance",), {"checked": 32})),
    "pole without a height": ("fixture", (("pole", "height_mm"), None)),
    "material without a source": ("material", (("al-6061-t6", "source"), None)),
}
CONTRADICTIONS = {
    "nonlinear links": ("case", (("analysis",), "nonlinear"), (("curve", 0), LINKED)),
    "resolution of the thickness in the plane": ("case", (("thickness_resolution",), 4)),
    "saltelli with designs": (
        "study",
        (("sampling",), {"method": "saltelli", "designs": 64, "seed": 1}),
    ),
    "arm without a stroke": ("study", (("drive",), {"lever_arm_mm": 9.0})),
    "step of a list": (
        "requirements",
        (("free",), [{"key": "thickness_mm", "values": [8.0, 9.0], "step": 0.5}]),
    ),
    "requirement without an end": ("requirements", (("require",), [{"quantity": "envelope_mm"}])),
}


@pytest.mark.parametrize("what", BAD_VALUES | CONTRADICTIONS)
def test_bad_values_are_refused_by_schema_and_by_flexfem_and_contradictions_by_flexfem(what):
    name, *changes = (BAD_VALUES | CONTRADICTIONS)[what]
    content = changed(name, *changes)
    assert not accepts(name, content) and (
        what in CONTRADICTIONS or not validator(name).is_valid(content)
    )


def numbers_of(schema, key=""):
    """Every number of a schema by its key."""
    if schema.get("type") in ("number", "integer", ["number", "string"]):
        yield key, schema
    for name, inner in schema.get("properties", {}).items():
        yield from numbers_of(inner, name)
    for name in ("items", "additionalProperties"):
        if isinstance(schema.get(name), dict):
            yield from numbers_of(schema[name], key)


def leaves_of(schema):
    """Every key that is no table of keys, by its name."""
    for name, inner in schema.get("properties", {}).items():
        member = inner.get("items", inner)
        if "properties" not in member:
            yield name, inner
        yield from leaves_of(member)
    if isinstance(schema.get("additionalProperties"), dict):
        yield from leaves_of(schema["additionalProperties"])


@pytest.mark.parametrize("name", FORMATS)
def test_every_key_is_described_has_an_example_and_every_number_a_known_unit(name):
    known = {str(unit) for unit in UNITS.values()} | {"1", "of the key"}
    for key, number in numbers_of(schema_of(name)):
        assert number[UNIT] in known, key
        ending = [str(unit) for suffix, unit in UNITS.items() if key.endswith(f"_{suffix}")]
        assert number[UNIT] in ending if ending else number[UNIT] in ("1", "of the key"), key
    found = list(leaves_of(schema_of(name)))
    assert len(found) >= 4 or name == "measured"
    for key, leaf in found:
        assert len(leaf["description"]) >= 5, key
        assert not leaf["description"].endswith("."), key
        assert list(jsonschema.Draft7Validator(leaf).iter_errors(example_of(leaf))) == [], key
    for table in tables_of(name):
        assert table.about, table.header


VALUES = [
    0,
    1,
    3,
    21,
    -1.0,
    0.0,
    0.4,
    2.5,
    60.0,
    1e-7,
    1e5,
    True,
    False,
    "",
    "x",
    "theta",
    "fe",
    "three_dimensional",
    "analytic",
    "verify",
    "nonlinear",
    "joints",
    "base",
    "link 1",
    "platform",
    "al-6061-t6",
    "calibrated",
    "normal",
    "uniform",
    "log",
    "table",
    "monte_carlo",
    "hinges.*.neck_mm",
    "override.2.elbow.neck_mm",
    "actuator.base.arm_mm",
    "override.*.actuator.base.point_mm[0]",
    "chain.link_lengths_mm[1]",
    "kxx_n_per_mm",
    [],
    [1.0, 2.0],
    [3.0, 5.0, 9.0],
    {},
]


def places_of(content):
    """Every table and array in the content, itself among them."""
    yield content
    for each in content.values() if isinstance(content, dict) else content:
        if isinstance(each, dict | list):
            yield from places_of(each)


def varied(name, keys, draw):
    """The shipped content with some keys gone, some of other tables or formats, and some values of
    others.
    """
    content = copy.deepcopy(shipped(name))
    content.pop("provenance", None)
    for _ in range(draw.randint(1, 2)):
        place = draw.choice(list(places_of(content)))
        if isinstance(place, dict) and draw.random() < 0.5:
            key, leaf = draw.choice(keys)
            place[key] = (
                example_of(leaf) if draw.random() < 0.6 else copy.deepcopy(draw.choice(VALUES))
            )
        elif place:
            key = draw.choice(list(place) if isinstance(place, dict) else range(len(place)))
            if draw.random() < 0.4:
                del place[key]
            else:
                place[key] = copy.deepcopy(draw.choice(VALUES))
    return content


@pytest.mark.parametrize("name", FORMATS)
def test_whatever_flexfem_accepts_the_schema_accepts(name, count=100):
    draw = random.Random(f"schema of {name}")
    taken = 0
    refused = 0
    keys = list(leaves_of(schema_of(name)))
    for _ in range(count):
        content = varied(name, keys, draw)
        if accepts(name, content):
            taken += 1
            assert [error.message for error in validator(name).iter_errors(content)] == [], content
        else:
            refused += not validator(name).is_valid(content)
    assert taken >= 0.04 * count and refused >= 0.3 * count


def test_a_material_of_a_file_takes_no_number(tmp_path):
    own = {"name": "mine", "file": "metals.toml", "density_kg_m3": 2700.0}
    (tmp_path / "stage.toml").write_text(toml_text(changed("stage", (("material",), own))))
    with pytest.raises(BadInput, match="and no other key but name"):
        load_stage(tmp_path / "stage.toml")


@pytest.mark.parametrize("what", ["negative neck", "pole without a height"])
def test_taplo_refuses_what_the_schema_refuses(what, tmp_path):
    name, *changes = BAD_VALUES[what]
    (path,) = schema(name, output=tmp_path)
    for content, sound in ((changed(name, *changes), False), (changed(name), True)):
        (tmp_path / "file.toml").write_text(toml_text(content))
        assert checked_by_taplo(tmp_path, path, tmp_path / "file.toml") is sound
