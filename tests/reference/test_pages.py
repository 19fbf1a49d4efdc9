"""Reference pages: what is generated says what the models say."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

from flexfem.files.refusals import Problem, needed
from flexfem.hinges.formulas import formulas
from flexfem.mechanism.actuators import catalogue
from flexfem.mechanism.materials import materials
from flexfem.reference.formats import FORMATS
from flexfem.reference.keys import tables_of
from flexfem.reference.pages import PAGES, page
from flexfem.refused import BadInput
from flexfem.study.columns import ASKED, MEANINGS, outputs_of

ROOT = Path(__file__).parents[2]
EVERY = outputs_of(*ASKED)


def cells(text, key):
    """The row of a key, less its ends."""
    (line,) = [line for line in text.splitlines() if line.startswith(f"| `{key}`")]
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def test_a_page_says_unit_limits_default_example_and_meaning():
    case, actuator, stage = page("case"), page("actuator"), page("stage")
    assert cells(case, "points")[0] == r"`points` \*" and cells(case, "points")[2:] == [
        "", "integer, from 3 up to 10001", "", "`21`",
    ]  # fmt: skip
    assert cells(case, "resolution")[3:5] == ["integer, from 4 up to 64", "`8`"]
    assert cells(actuator, "tilt_deg")[2:4] == ["°", "number, from -80 up to 80"]
    assert cells(actuator, "preload_n")[2:] == ["N", "number, 0, or from 1e-6 up to 1e6", "`0.0`", "`50.0`"]
    assert cells(stage, "expansion_um_per_m_k")[2:4] == ["µm/(m K)", "number, 0, or from 0.001 up to 300"]
    assert "`[hinges.base]`, `[hinges.elbow]`, `[hinges.platform]`" in stage and "[[actuator]]" not in stage
    assert (
        len(re.findall(r"^\| `neck_mm`", stage, re.MULTILINE)) == 1
    )  # of overrides what hinges have is not said again


def test_every_table_of_every_format_is_on_a_page():
    text = "".join(map(page, PAGES))
    for name in FORMATS:
        for table in tables_of(name):
            assert not table.rows or not table.name or f"`{table.header}`" in text, (name, table.header)
    for name in (*materials(), *catalogue(), *formulas()):
        assert name in text
    assert "0.29 (assumed)" in page("material")
    with pytest.raises(BadInput, match="page 'stages' is not known, expected one of: stage, material"):
        page("stages")


@pytest.mark.parametrize(
    ("name", "besides"),
    [
        ("stage", {"name", "chain", "between"}),
        ("case", {"label", "stage"}),
        ("study", {"key", "method", "factors", "coefficient", "expression", "value", "kind", "name"}),
        ("requirements", {"neck_um", "quantity", "name", "expression"}),
        ("fixture", {"name"}),
    ],
)
def test_keys_are_marked_that_a_file_must_give(name, besides):
    """Of the material the name alone; of arrays what their members must give, though a file need have none."""
    must = {key.rpartition(".")[2] for key in needed(Problem("missing", (), ""), FORMATS[name].model)}
    if name == "stage":
        must -= {"youngs_modulus_gpa", "poissons_ratio", "density_kg_m3", "yield_strength_mpa"}
    marked = {row.key for table in tables_of(name) for row in table.rows if row.needed}
    assert must - {"curve", "factor", "free", "objective", "claim", "pole"} <= marked <= must | besides


def test_every_output_of_a_study_has_a_meaning():
    assert tuple(column for group in MEANINGS for column in group) == EVERY


def test_the_page_of_stages_names_the_registered_materials():
    listed = (ROOT / "geometry/README.md").read_text().partition("Materials known by name**")[2].partition("\n\n")[0]
    assert set(re.findall(r"`([a-z]+-[\w-]+)`", listed)) == set(materials())


def test_the_page_of_commands_has_every_command_with_its_options(tmp_path):
    spec = importlib.util.spec_from_file_location("generate_reference", ROOT / "docs/_ext/generate_reference.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    made.write(tmp_path)
    text = (tmp_path / "commands.md").read_text()
    assert "```text\nflexfem check STAGE [OPTIONS]\n```" in text and "### `flexfem study clean`" in text
    assert "| `--shard` | Only the I-th of N shares, for job arrays. | `1/1` |" in text
    assert {path.name for path in tmp_path.glob("*.md")} == {f"{name}.md" for name in (*PAGES, "schemas", "commands")}
    assert len(list(tmp_path.glob("*.schema.json"))) == len(FORMATS)


def test_the_command_says_keys_to_people_and_schemas_to_machines(flexfem, tmp_path):
    code, out, err = flexfem("schema", "fixture")
    assert (code, err) == (0, "") and "  noise_n * N: number, 0, or from 1e-9 up to 1000\n" in out and "[pole]" in out
    code, out, err = flexfem("schema", "stage", "--json")
    assert (code, err) == (0, "") and '"exclusiveMaximum": 0.5' in out
    assert flexfem("schema")[1].startswith("stage: One TOML file a stage.")
    code, out, _ = flexfem("schema", "case", "-o", tmp_path / "new")
    assert code == 0 and out == f"{tmp_path}/new/flexfem-case.schema.json\n"
    code, out, err = flexfem("schema", "cases", "-o", tmp_path / "other")
    assert (code, out) == (2, "") and "format 'cases' is not known, expected one of: stage, case, study" in err
    code, out, err = flexfem("schema", 10_000 * "x")
    assert (code, out) == (2, "") and "xxx... is not known, expected one of: stage" in err and len(err) < 250
    assert not (tmp_path / "other").exists()
