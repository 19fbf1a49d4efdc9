"""How the designs of a study are drawn, and what drives the stage."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field, model_validator

from flexfem.files.refusals import refusal
from flexfem.files.toml import Table
from flexfem.stage.schema import Label

Method: TypeAlias = Literal["grid", "latin_hypercube", "sobol", "monte_carlo", "saltelli", "table"]
MOST = 10**9  # designs; a design and 100 columns are a kilobyte
MOST_HELD = 200_000  # designs of a method that holds the whole sample in memory
HELD: tuple[Method, ...] = ("latin_hypercube",)
EXTENSIBLE: tuple[Method, ...] = ("sobol", "monte_carlo", "saltelli")  # more designs begin with the same ones


class Sampling(Table):
    """How designs are drawn: `designs` of them, or `base` * (factors + 2) for Saltelli's scheme, from a `seed`; or
    taken from a `file`."""

    method: Method
    file: Label | None = None
    designs: int | None = Field(default=None, ge=1, le=MOST)
    base: int | None = Field(default=None, ge=2, le=MOST)
    seed: int | None = Field(default=None, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _keys_of_its_method(self) -> Sampling:
        size = {"saltelli": "base"}.get(self.method, "designs")
        wanted = {"grid": (), "table": ("file",)}.get(self.method, (size, "seed"))
        for name in wanted:
            if name not in self.model_fields_set:
                raise refusal(f'{name} for method = "{self.method}"')
        for name in ("designs", "base", "seed", "file"):
            if name in self.model_fields_set and name not in wanted:
                raise refusal(f'no {name} with method = "{self.method}"', name)
        if self.base is not None and self.base & (self.base - 1):
            raise refusal("a power of two", "base")
        if self.method in HELD and (self.designs or 0) > MOST_HELD:
            raise refusal(f'at most {MOST_HELD} with method = "{self.method}", which holds all in memory', "designs")
        return self


class Drive(Table):
    """The piezo: its stroke, and the lever arm from the base hinge to where it pushes link 1; in units of the file."""

    stroke_um: float = Field(gt=0, le=1e6)
    lever_arm_mm: float = Field(gt=0, le=1e4)

    @property
    def rotation(self) -> float:
        """Largest rotation of a base hinge, rad."""
        return 1e-3 * self.stroke_um / self.lever_arm_mm
