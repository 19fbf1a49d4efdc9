"""Every number of every kind of file at sizes that no quantity has: one line that refuses it, or an
answer.
"""

from __future__ import annotations

import copy
import math
import warnings

import pytest

from flexfem.design.requirements import load_requirements
from flexfem.files.toml import validate
from flexfem.files.writing import toml_text
from flexfem.mechanism.materials import read_materials
from flexfem.mechanism.mechanism_file import load_mechanism
from flexfem.paper.case import LoadedCase
from flexfem.paper.fixture import Fixture, Measurement
from flexfem.refused import BadInput
from flexfem.schemas.formats import FORMATS
from flexfem.study.loaded import load_study

from .test_schemas import ROOT, shipped

STAGE = str(ROOT / "geometry/mobility6.toml")
EXTREMES = (1e308, 1e-300, math.nan, math.inf, -1.0)
COMPARED = {"least", "most", "equals", "at_least", "at_most"}  # with what is found
COMMANDS = {"stage": ("summary", "--models", "analytic"), "necks": ("as-built", STAGE)}
READERS = {
    "mechanism": load_mechanism,
    "case": LoadedCase,
    "study": load_study,
    "requirements": load_requirements,
    "fixture": lambda path: validate(Fixture, path),
    "measured": lambda path: validate(Measurement, path),
    "material": read_materials,
}


def content_of(name):
    content = copy.deepcopy(shipped(name))
    content.pop("provenance", None)
    for table in (content, *content.get("curve", [])):
        for key in ("stage", "mechanism"):
            if isinstance(table.get(key), str):
                table[key] = str((ROOT / "cases" / table[key]).resolve())
    return content


def numbers_in(content, path=()):
    """Paths of the numbers of a content."""
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        if isinstance(value, dict | list):
            yield from numbers_in(value, (*path, key))
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield (*path, key)


def read(name, path, flexfem):
    """Exit code and standard error of the cheapest use of a file."""
    if name in COMMANDS:
        code, _, err = flexfem(*COMMANDS[name], path)
        return code, err
    try:
        READERS[name](path)
    except BadInput as refused:
        return 2, f"flexfem: {refused}\n"
    return 0, ""


@pytest.mark.parametrize("name", FORMATS)
def test_no_number_of_any_file_ends_in_a_traceback_or_in_what_a_library_says(
    name, flexfem, tmp_path
):
    content = content_of(name)
    path = tmp_path / "own.toml"
    seen = set()
    path.write_text(toml_text(content))
    assert read(name, path, flexfem) == (0, "")
    for place in numbers_in(content):
        kind = tuple(part for part in place if isinstance(part, str))
        if kind in seen:  # another member of the same array
            continue
        seen.add(kind)
        for extreme in EXTREMES:
            own = copy.deepcopy(content)
            table = own
            for part in place[:-1]:
                table = table[part]
            table[place[-1]] = extreme
            path.write_text(toml_text(own))
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                code, err = read(name, path, flexfem)
            assert code in (0, 1, 2) and "error in flexfem" not in err and "Traceback" not in err, (
                place,
                extreme,
                err,
            )
            assert not code or (err.startswith("flexfem: ") and err.count("\n") == 1), (
                place,
                extreme,
                err,
            )
            if not abs(extreme) <= 1e300 and kind[-1] not in COMPARED:
                assert code == 2 and kind[-1] in err, (place, extreme, err)
