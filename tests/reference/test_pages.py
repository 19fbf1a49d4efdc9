"""Reference pages: what is generated says what the models say."""

from __future__ import annotations

import importlib.util
import re
from functools import cache

import pytest

from flexfem.hinges.formulas import formulas
from flexfem.mechanism.actuators import catalogue
from flexfem.mechanism.materials import materials
from flexfem.schemas.formats import FORMATS, results
from flexfem.schemas.keys import tables_of
from flexfem.study.columns import MEANINGS, OPTIONAL, outputs_of

from ..conftest import ROOT


@cache
def generator():
    spec = importlib.util.spec_from_file_location(
        "generate_reference", ROOT / "docs/_ext/generate_reference.py"
    )
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


@cache
def pages():
    return generator().pages()


def cells(page, key):
    """The row of a key, less its ends."""
    (line,) = [line for line in pages()[page].splitlines() if line.startswith(f"| `{key}`")]
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


@pytest.mark.parametrize(
    ("page", "key", "unit", "value"),
    [
        ("case", "points", "", "integer, from 3 up to 10001"),
        ("actuator", "tilt_deg", "°", "number, from -80 up to 80"),
        ("actuator", "preload_n", "N", "number, 0, or from 1e-6 up to 1e6"),
        ("stage", "expansion_um_per_m_k", "µm/(m K)", "number, 0, or from 0.001 up to 300"),
    ],
)
def test_a_page_says_unit_and_limits(page, key, unit, value):
    assert cells(page, key)[2:4] == [unit, value]


def test_every_table_quantity_and_name_is_on_a_page():
    text = "".join(pages().values())
    for name in FORMATS:
        for table in tables_of(name):
            assert not table.rows or not table.name or f"`{table.header}`" in text, (
                name,
                table.header,
            )
    for name, one in results().items():
        assert all(f"| {name}.{quantity} |" in text for quantity in one.quantities)
    for name in (*materials(), *catalogue(), *formulas()):
        assert name in text
    assert "0.29 (assumed)" in pages()["material"]
    assert tuple(column for group in MEANINGS for column in group) == outputs_of(*OPTIONAL)


def test_the_page_of_commands_has_every_command_with_its_options(tmp_path):
    generator().write(tmp_path)
    text = (tmp_path / "commands.md").read_text()
    assert (
        "```text\nflexfem check FILE [OPTIONS]\n```" in text and "### `flexfem study clean`" in text
    )
    assert "| `--shard` |" in text and "| `--solid` |" in text
    assert len(list(tmp_path.glob("*.schema.json"))) == len(FORMATS)


def test_the_command_says_keys_to_people_and_schemas_to_machines(flexfem, tmp_path):
    code, out, err = flexfem("schema", "fixture")
    assert (
        (code, err) == (0, "")
        and "  noise_n * N: number, 0, or from 1e-9 up to 1000\n" in out
        and "[pole]" in out
    )
    code, out, err = flexfem("schema", "stage", "--json")
    assert (code, err) == (0, "") and '"exclusiveMaximum": 0.5' in out
    code, out, _ = flexfem("schema", "case", "-o", tmp_path / "new")
    assert code == 0 and out == f"{tmp_path}/new/flexfem-case.schema.json\n"
    for unknown in ("cases", 10_000 * "x"):
        code, out, err = flexfem("schema", unknown, "-o", tmp_path / "other")
        assert (
            (code, out) == (2, "")
            and "is not known, expected one of: stage, case" in err
            and len(err) < 350
        )
    assert not (tmp_path / "other").exists()
