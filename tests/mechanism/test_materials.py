"""Materials known by name: shipped with their sources, or the user's own."""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import flexfem
from flexfem import sources
from flexfem.mechanism import materials

REFERENCE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"
NUMBERS = {
    "youngs_modulus": 141.3e3,
    "poissons_ratio": 0.29,
    "yield_strength": 276.0,
    "density": 8050.0,
}
NUMBERS_OF_FILES = "youngs_modulus_gpa|poissons_ratio|density_kg_m3|yield_strength_mpa"


@pytest.fixture(autouse=True)
def own_of_this_test_alone():
    flexfem.materials()  # what is shipped is read once
    with patch.dict(materials.REGISTERED):
        yield


@pytest.fixture
def named(tmp_path):
    """The reference stage, written with the lines given in place of what it says of its material."""

    def write(*lines):
        text = re.sub(
            rf'^"?(material\.)?({NUMBERS_OF_FILES}|expansion_um_per_m_k"? = [2"]|name = "alu|material\.name").*\n',
            "",
            REFERENCE.read_text(),
            flags=re.M,
        )
        path = tmp_path / "stage.toml"
        path.write_text(text.replace("[material]\n", "\n".join(["[material]", *lines, ""])))
        return path

    return write


def test_shipped_materials_have_the_numbers_that_their_sources_state():
    """Literally, and in the units of the source, which states every one of the four: ksi, g/cm^3,
    psi.
    """
    assert "data/materials.toml" in sources.manifest()  # part of the versions of a study
    known = flexfem.materials()
    assert {
        name: (m.youngs_modulus, m.poissons_ratio, m.density, m.yield_strength)
        for name, m in known.items()
    } == {
        "al-7075-t6": (71700.0, 0.33, 2810.0, 503.0),
        "al-6061-t6": (68900.0, 0.33, 2700.0, 276.0),
        "al-2024-t4": (73000.0, 0.33, 2780.0, 303.0),
        "ti-6al-4v": (113800.0, 0.342, 4430.0, 880.0),
        "ti-6al-4v-sta": (113800.0, 0.342, 4430.0, 1185.0),
        "steel-4340": (205000.0, 0.29, 7850.0, 1103.0),
        "steel-301-full-hard": (193000.0, 0.29, 7880.0, 965.0),
        "steel-304": (193000.0, 0.29, 8000.0, 215.0),
        "invar-36": (141000.0, 0.29, 8050.0, 207.0),
    }


def test_fatigue_constants_are_those_of_dowlings_tables_and_no_others():
    """N. E. Dowling, Mechanical Behavior of Materials, 4th ed., Table 9.1; 7075-T6: Table 14.1."""
    known = {
        name: m
        for name, m in flexfem.materials().items()
        if m.fatigue_strength_coefficient is not None
    }
    assert {
        name: (m.fatigue_strength_coefficient, m.fatigue_strength_exponent)
        for name, m in known.items()
    } == {
        "al-7075-t6": (1466.0, -0.143),
        "al-2024-t4": (900.0, -0.102),
        "ti-6al-4v-sta": (2030.0, -0.104),
        "steel-4340": (1758.0, -0.0977),
    }


FATIGUE = ["fatigue_strength_coefficient_mpa = 1200", "fatigue_strength_exponent = -0.12"]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            [FATIGUE[0], "fatigue_strength_exponent = 0.12"],
            "fatigue_strength_exponent = 0.12, expected -0.5 to -0.01",
        ),
        (
            [FATIGUE[0], "fatigue_strength_exponent = 0.0"],
            "fatigue_strength_exponent = 0.0, expected -0.5 to -0.01",
        ),
        ([FATIGUE[0]], "coefficient_mpa = 1200, expected fatigue_strength_exponent as well"),
        ([FATIGUE[1]], "exponent = -0.12, expected fatigue_strength_coefficient_mpa as well"),
        (
            ["walker_exponent = 0.6"],
            "walker_exponent = 0.6, expected fatigue_strength_coefficient_mpa as well",
        ),
        ([*FATIGUE, "walker_exponent = 1.2"], "material.walker_exponent = 1.2, expected <= 1"),
        (
            [*FATIGUE, "fatigue_range_cycles = [1e6, 1e3]"],
            "expected the lower number of cycles first",
        ),
        (
            [*FATIGUE, "fatigue_range_cycles = [0.0, 1e3]"],
            "fatigue_range_cycles[0] = 0.0, expected > 0",
        ),
        (
            ["fatigue_strength_coefficient_mpa = 1.2", FATIGUE[1]],
            "coefficient_mpa = 1.2, expected 0.5 to 50 of",
        ),
        (
            ["fatigue_strength_coefficient_mpa = 3e4", FATIGUE[1]],
            "expected 0.5 to 50 of yield_strength_mpa: other",
        ),
        (["density_kg_m3 = -2810"], "density_kg_m3 = -2810, expected > 0"),
    ],
)
def test_impossible_fatigue_data_is_refused_in_one_line(named, lines, said):
    plain = [
        "name = 'own'",
        "youngs_modulus_gpa = 71.7",
        "poissons_ratio = 0.33",
        "yield_strength_mpa = 503",
    ]
    plain += [] if "density" in lines[0] else ["density_kg_m3 = 2810"]
    with pytest.raises(flexfem.BadInput, match=re.escape(said)) as refused:
        flexfem.load(named(*plain, *lines))
    assert re.match(r".*stage\.toml, line \d+: material\.", str(refused.value)) and "\n" not in str(
        refused.value
    )


OWN = """
["house alloy"]
youngs_modulus_gpa = 70.3
poissons_ratio = 0.31
density_kg_m3 = 2750
yield_strength_mpa = 410
fatigue_strength_coefficient_mpa = 1200
fatigue_strength_exponent = -0.12
source = "works certificate 7"
sources = { poissons_ratio = "assumed: as of others" }
"""


def test_a_material_of_a_file_beside_the_stage_has_its_numbers_and_sources(named, tmp_path):
    """By number as if the stage said so itself: same hash; written out it no longer needs the file."""
    (tmp_path / "own.toml").write_text(OWN)
    stage = flexfem.load(named('name = "house alloy"', 'file = "own.toml"'))
    assert (stage.material.youngs_modulus, stage.material.fatigue_strength_exponent) == (
        70300.0,
        -0.12,
    )
    assert stage.provenance["material"] == "works certificate 7 (house alloy), own.toml"
    assert (
        "material.poissons_ratio" in stage.assumed and "material.density_kg_m3" not in stage.assumed
    )
    stage.save(tmp_path / "alone.toml")
    alone = flexfem.load(tmp_path / "alone.toml")
    assert (
        alone.hash == stage.hash
        and "file" not in (tmp_path / "alone.toml").read_text().partition("[chain]")[0]
    )
    assert stage.replace(material={"fatigue_strength_exponent": -0.13}).hash != stage.hash


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("density_kg_m3 = 2750", "density_kg_m3 = -2750", "own.toml, line 5: "),
        ("density_kg_m3 = 2750\n", "", "density_kg_m3 is missing"),
        ('source = "works certificate 7"\n', "", "source is missing"),
        ("-0.12", "0.12", "fatigue_strength_exponent = 0.12, expected -0.5 to -0.01"),
        ("house alloy", "other alloy", 'material.name = "house alloy", expected one of'),
        ('["house', '["al-6061-t6"]\n["house', "al-6061-t6"),
    ],
)
def test_a_bad_file_of_materials_is_refused_with_its_line(named, tmp_path, old, new, said):
    assert old in OWN
    (tmp_path / "own.toml").write_text(OWN.replace(old, new))
    with pytest.raises(flexfem.BadInput, match=re.escape(said)) as refused:
        flexfem.load(named('name = "house alloy"', 'file = "own.toml"'))
    assert re.search(r"\.toml, line \d+: ", str(refused.value)) and "\n" not in str(refused.value)


def test_a_name_alone_is_the_material_with_its_numbers_and_its_source(named, capsys):
    """Same hash as with the numbers written out, which baselines and stored parts of studies go by."""
    stage = flexfem.load(named('name = "al-7075-t6"'))
    reference = flexfem.load(REFERENCE)
    assert stage.hash == reference.hash and stage.material.name == "al-7075-t6"
    assert stage.not_stated == () and "material.youngs_modulus_gpa" not in stage.assumed
    sources = [text for key, text in stage.sources.items() if key.startswith("material")]
    assert len(sources) >= 4 and all(
        ("ASM data sheet" in text or "Dowling" in text) and "(al-7075-t6)" in text
        for text in sources
    )
    same = flexfem.load(
        named('name = "al-7075-t6"', "density_kg_m3 = 2810", "youngs_modulus_gpa = 71.7")
    )
    assert same == stage
    material = flexfem.load(named('name = "ti-6al-4v"')).material
    assert (material.youngs_modulus, material.poissons_ratio) == (113.8e3, 0.342)
    assumed = flexfem.register_material("a guess", **NUMBERS, source="assumed: no data sheet")
    path = named('name = "a guess"')
    assert (
        flexfem.load(path).material == assumed
        and "material.density_kg_m3" in flexfem.load(path).assumed
    )
    path.write_text(path.read_text() + '"material.density_kg_m3" = "weighed"\n')
    assert "material.density_kg_m3" not in flexfem.load(path).assumed, (
        "the file's own source goes first"
    )


REFUSED = {
    "unknown": (
        ['name = "al-7075-t5"'],
        8,
        'material.name = "al-7075-t5", expected a registered material (al-7075',
    ),
    "contradiction": (
        ['name = "ti-6al-4v"', "density_kg_m3 = 4431.0"],
        9,
        "4431.0, expected 4430 of the",
    ),
    "modulus": (
        ['name = "ti-6al-4v"', "youngs_modulus_gpa = 113"],
        9,
        "113, expected 113.8 of the registered",
    ),
    "misspelt": (
        ['name = "ti-6al-4v"', "density = 4430.0"],
        9,
        "unknown key, did you mean density_kg_m3?",
    ),
    "free, in part": (
        ['name = "free"', "poissons_ratio = 0.3"],
        7,
        "youngs_modulus_gpa, material.density_kg_m3 and",
    ),
    "no name": (
        ["poissons_ratio = 0.3"],
        7,
        "material.name, material.youngs_modulus_gpa, material.density_kg_m3 and",
    ),
    "no text": (["name = 3"], 8, "material.name = 3, expected text in quotes"),
}


def test_a_stage_that_contradicts_a_name_or_leaves_it_open_is_refused_with_file_line_and_key(named):
    for what, (lines, line, said) in REFUSED.items():
        path = named(*lines)
        with pytest.raises(flexfem.BadInput) as refused:
            flexfem.load(path)
        assert str(refused.value).startswith(f"{path}, line {line}: ") and said in str(
            refused.value
        ), (what, refused)
        assert "\n" not in str(refused.value)


def test_a_material_of_ones_own_is_registered_in_one_line_and_makes_the_stage(named):
    own = flexfem.register_material("invar, lot 7", **NUMBERS, source="certificate 12")
    assert flexfem.register_material("invar, lot 7", **NUMBERS, source="certificate 12") == own, (
        "again the same"
    )
    assert flexfem.materials()["invar, lot 7"] == own == flexfem.Material(name="invar, lot 7")
    stage = flexfem.load(named('name = "invar, lot 7"'))
    reference = flexfem.load(REFERENCE)
    assert (
        stage.material.youngs_modulus == 141.3e3
        and stage.provenance["material"] == "certificate 12 (invar, lot 7)"
    )
    np.testing.assert_allclose(
        flexfem.analyse(stage, 6).stiffness.diagonal(),
        flexfem.analyse(reference, 6).stiffness.diagonal() * 141.3 / 71.7,
        rtol=1e-12,
    )
    before = stage.hash
    materials.REGISTERED["invar, lot 7"] = materials.Entry(
        **NUMBERS | {"density": 8051.0}, name="x", source="other"
    )
    assert flexfem.load(named('name = "invar, lot 7"')).hash != before, (
        "another number under the name, another stage"
    )


BAD = [
    (
        {"name": "ti-6al-4v"},
        "material 'ti-6al-4v': youngs_modulus = 141300.0, expected youngs_modulus_gpa 113.8 of",
    ),
    (
        {"name": "twice", "source": "another"},
        "material 'twice' is known already, expected another name",
    ),
    (
        {"youngs_modulus": -3.0},
        "material 'own': youngs_modulus = -3.0, expected youngs_modulus_gpa > 0",
    ),
    ({"poissons_ratio": 0.5}, "material 'own': poissons_ratio = 0.5, expected < 0.5"),
    ({"density": float("nan")}, "material 'own': density = nan, expected"),
    ({"yield_strength": "503"}, "material 'own': yield_strength = \"503\", expected a number"),
    ({"name": ""}, "material '': name = \"\", expected one line"),
    ({"source": " "}, "material 'own': source = \" \", expected one line of text"),
]


def test_what_is_no_material_is_refused_and_nothing_registered():
    flexfem.register_material("twice", **NUMBERS, source="one")
    before = dict(flexfem.materials())
    for wrong, said in BAD:
        with pytest.raises(flexfem.BadInput) as refused:
            flexfem.register_material(**({"name": "own", **NUMBERS, "source": "a test"} | wrong))
        assert str(refused.value).startswith(said) and dict(flexfem.materials()) == before


def test_a_changed_number_takes_the_name_away_and_another_name_brings_its_numbers(tmp_path):
    """What is saved can always be read: no copy says a registered name over other numbers."""
    stage = flexfem.load(REFERENCE).replace(material="ti-6al-4v")
    assert stage.material == flexfem.materials()["ti-6al-4v"]
    assert [key for key in stage.provenance if key.startswith("material")] == ["material"]
    assert stage.replace(thickness=11.0).material.name == "ti-6al-4v"
    softer = stage.replace(material={"youngs_modulus": 110e3})
    assert softer.material.name == "ti-6al-4v, changed" and softer.material.yield_strength == 880.0
    assert softer.provenance["material.youngs_modulus_gpa"] == "replaced in Python"
    for each in (stage, softer):
        each.save(tmp_path / "saved.toml")
        assert flexfem.load(tmp_path / "saved.toml") == each
    assert (
        softer.replace(material={"name": "al-6061-t6"}).material
        == flexfem.materials()["al-6061-t6"]
    )
    with pytest.raises(
        flexfem.BadInput, match=r'name = "ti-6al-4x", expected a registered material \(ti-6al-4v,'
    ):
        stage.replace(material="ti-6al-4x")
    with pytest.raises(
        flexfem.BadInput, match=r"material\.density = 3.0, expected 4430 of the registered"
    ):
        stage.replace(material={"name": "ti-6al-4v", "density": 3.0})
