"""A stage file that is not finished: what it says, and what it does not say yet."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from flexfem.files.provenance import Doubts
from flexfem.files.toml import Path, validate_partly
from flexfem.sources import read_data
from flexfem.stage.content import Origin
from flexfem.stage.feasibility import check_feasible
from flexfem.stage.material_files import with_material_of_file
from flexfem.stage.schema import Stage

DRAWN = ("chain.", "hinges.", "platform.")  # tables of what a drawing shows
METAL = {  # nothing that is drawn shows it
    "name": "unnamed",
    "youngs_modulus_gpa": 70.0,
    "poissons_ratio": 0.3,
    "density_kg_m3": 2700.0,
    "yield_strength_mpa": 300.0,
}


class PartialStage(NamedTuple):
    """A stage, and the keys that its file does not give: their values in the stage mean nothing."""

    stage: Stage
    missing: list[str]

    @property
    def whole(self) -> bool:
        """Whether all is there that a drawing shows."""
        return not any(key.startswith(DRAWN) for key in self.missing)

    @property
    def doubts(self) -> Doubts:
        """What of the numbers that are given is assumed, and what has no stated source."""
        assumed, not_stated = (
            [key for key in keys if key not in self.missing] for keys in (self.stage.assumed, self.stage.not_stated)
        )
        return Doubts(assumed, not_stated)

    def given(self, *keys: str) -> bool:
        """Whether the file gives all of some keys."""
        return not set(keys) & set(self.missing)


def load_partly(path: Path) -> PartialStage:
    """Read a stage file in which keys may be missing.

    Raises BadInput as `load_stage` for what is wrong in it, and as `check_feasible` where nothing is missing.
    """
    spare = dict(_by_path(tomllib.loads(read_data("new-stage.toml")), ""))
    spare |= {f"material.{key}": value for key, value in METAL.items()} | {"name": "unnamed"}
    stage, missing = validate_partly(Stage, path, spare, partial(with_material_of_file, path))
    stage.__dict__["origin"] = Origin(os.fspath(path))
    found = PartialStage(stage, missing)
    if found.whole:
        check_feasible(stage)
    return found


def _by_path(table: Mapping[str, Any], above: str) -> Iterator[tuple[str, Any]]:
    """Values of nested tables by key path."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _by_path(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value
