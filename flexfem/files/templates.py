"""New files to start from: a commented stage, and a case and a study of it."""

from __future__ import annotations

import json
import shlex
from operator import methodcaller
from pathlib import Path
from typing import NamedTuple

from flexfem.files.refusals import place_of
from flexfem.files.toml import require_plain_stem
from flexfem.files.writing import check_file, write_atomically
from flexfem.refused import BadInput
from flexfem.sources import read_data

SUFFIX = ".toml"
STAGE = '"stage.toml"'  # what the stage is called in the templates


class NewFiles(NamedTuple):
    """Files written, the stage first, commands to go on with, and what the user must know of the numbers."""

    written: list[str]
    commands: list[str]
    warnings: list[str]


def write_new(path: Path, case: bool, study: bool) -> NewFiles:
    """Write a stage file to `path`, and beside it, as wanted, a case and a study named after it.

    Raises BadInput when one of them is there already, or cannot be written; then none is.
    """
    if path.suffix != SUFFIX:
        raise BadInput(f"{place_of(path)}: expected a file name that ends in {SUFFIX}, such as stage.toml")
    require_plain_stem(path)
    kinds = {"stage": True, "case": case, "study": study}
    paths = {kind: path if kind == "stage" else path.with_stem(f"{path.stem}-{kind}") for kind in kinds if kinds[kind]}
    for each in paths.values():
        check_file(each)
        if each.exists() or each.is_symlink():
            raise BadInput(f"{place_of(each)}: exists, expected the name of a new file; nothing is written")
    for kind, each in paths.items():
        text = read_data(f"new-{kind}{SUFFIX}").replace(STAGE, json.dumps(path.name, ensure_ascii=False))
        write_atomically(each, methodcaller("write", text.encode()))
    asked = {"stage": ["check", "summary", "solve"], "case": ["verify"], "study": ["study run"]}
    commands = [f"flexfem {ask} {shlex.quote(str(each))}" for kind, each in paths.items() for ask in asked[kind]]
    return NewFiles(
        [str(each) for each in paths.values()],
        commands,
        ["all numbers are those of flexfem's reference stage: they are assumed, replace them by yours"],
    )
