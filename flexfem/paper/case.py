"""Case files: the commanded platform displacement, its range, and the stages and models of the
curves.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from flexfem.arguments import FINEST, MOST_LAYERS
from flexfem.arrays import Array
from flexfem.fem.mesh import LAYERS, RESOLUTION, SOLID_RESOLUTION
from flexfem.files.provenance import Sourced
from flexfem.files.quantities import CommandMrad, CommandUm
from flexfem.files.refusals import refusal, shown
from flexfem.files.tables import Label, Table
from flexfem.files.toml import bad_key, validate
from flexfem.hinges.choice import (
    DEFAULT_FORMULA,
    ELASTIC,
    FORMULA,
    OF_MODEL,
    FormulaName,
    Mobility,
)
from flexfem.paper.stage import Stage, load_feasible
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, Direction

Analysis: TypeAlias = Literal["linear", "nonlinear"]
Drive: TypeAlias = Literal["force", "joints", "strokes"]
Elements: TypeAlias = Literal["fe", "three_dimensional"]


class Curve(Table):
    """One curve: a stage file (relative to the case file) and the analytic model whose force is
    applied to it.
    """

    label: Label = Field(
        description="Label in the legend, different for each curve",
        examples=["closed hinge formula"],
    )
    stage: Label = Field(
        description="Stage file, relative to the case file", examples=["stage.toml"]
    )
    mobility: Mobility | None = Field(
        default=None,
        description=OF_MODEL,
        examples=[6],
    )
    formula: FormulaName = Field(default=DEFAULT_FORMULA, description=FORMULA)
    links: bool = Field(default=False, description=f"{ELASTIC}; in linear cases only")

    @model_validator(mode="after")
    def _links_go_with_all_freedoms(self) -> Curve:
        if self.links and self.mobility != 21:
            raise refusal(
                "mobility = 21 with it: elastic links need all freedoms of the hinges", "links"
            )
        return self


class Case(Sourced):
    """A comparison as in Figs. 5 to 7; numbers in file units."""

    kind: ClassVar[str] = "case file"

    name: Label = Field(description="Title of the figure", examples=["Error for a command in x"])
    direction: Direction = Field(
        description="Direction of the commanded displacement of the platform", examples=["x"]
    )
    amplitude_um: CommandUm | None = Field(default=None, examples=[50.0])
    """Commands in x or y range from minus to plus this value"""
    amplitude_mrad: CommandMrad | None = Field(default=None, examples=[1.0])
    """Commands in theta range from minus to plus this value"""
    points: int = Field(
        ge=3,
        le=10_001,
        description="Number of commands",
        examples=[21],
    )
    analysis: Analysis = "linear"
    """`nonlinear`: exact equilibrium of the pseudo-rigid stage and geometrically nonlinear finite
    elements; the mesh bands are those of the linear problem """
    drive: Drive = "force"
    """Input of the finite elements: `force`, the force of (18) on the platform; `joints`, the
    rotations that the model computes for the pose by (29) and (30), imposed on the base hinges with
    mobility three, else on base and elbow hinges; `strokes`, the least-energy strokes of the
    stage's `[[actuator]]`. The last two require a linear analysis """
    model: Elements = "fe"
    """The finite elements: `fe`, the stage's own plane model; `three_dimensional`, the extruded
    stage with free faces, linear and with the force on the platform only. The analytic model uses
    the `model` of the stage file in both cases; it may be `corrected` here """
    resolution: int = Field(
        default=RESOLUTION,  # at least 4, for two coarser levels
        ge=4,
        le=FINEST,
        description=(
            f"Triangles across every neck, by default {SOLID_RESOLUTION} in three dimensions; two "
            "coarser meshes give the error bars"
        ),
    )
    layers: int = Field(
        default=LAYERS,
        ge=3,
        le=MOST_LAYERS,
        alias="thickness_resolution",
    )
    """Layers in half the thickness, with `three_dimensional`; the bands need two smaller numbers of
    layers
    """
    curve: tuple[Curve, ...] = Field(min_length=1, max_length=20)
    """A curve of the figure: a stage, and the analytic model that computes its command"""

    @model_validator(mode="before")
    @classmethod
    def _usual_mesh(cls, given: Any) -> Any:
        solid = isinstance(given, dict) and given.get("model") == "three_dimensional"
        return {"resolution": SOLID_RESOLUTION} | given if solid else given

    @model_validator(mode="after")
    def _keys_go_together(self) -> Case:
        given = [unit for unit in ("um", "mrad") if getattr(self, f"amplitude_{unit}") is not None]
        required = "mrad" if self.direction == "theta" else "um"
        if given != [required]:
            raise refusal(
                f"amplitude_{required} and no other amplitude for direction {self.direction}",
                "direction",
            )
        self._check_curves()
        self._check_model()
        return self

    def _check_curves(self) -> None:
        """Refuse equal labels, and elastic links in a nonlinear case."""
        labels = list[str]()
        for index, curve in enumerate(self.curve):
            label = curve.label.replace(" ", "_")  # as in the paths of numbers
            if label in labels:
                raise refusal("a label that no other curve has", "curve", index, "label")
            labels.append(label)
            if curve.links and self.analysis == "nonlinear":
                where = ("curve", index, "links")
                raise refusal('no links with analysis = "nonlinear", which has rigid links', *where)

    def _check_model(self) -> None:
        """Refuse keys that the finite elements of the case do not have."""
        solid = self.model == "three_dimensional"
        nonlinear = self.analysis == "nonlinear"
        if not solid and "layers" in self.model_fields_set:
            raise refusal('no thickness_resolution with model = "fe"', "thickness_resolution")
        if solid and nonlinear:
            raise refusal(
                '"linear" with model = "three_dimensional", whose displacements are small',
                "analysis",
            )
        if self.drive != "force" and (solid or nonlinear):
            reason = 'model = "three_dimensional"' if solid else 'analysis = "nonlinear"'
            raise refusal(f'"force" with {reason}, which loads the platform only', "drive")

    @property
    def axis(self) -> int:
        """Index of the direction: 0, 1 or 2."""
        return DIRECTIONS.index(self.direction)

    @property
    def commands(self) -> Array:
        """Commanded poses (points, 3), mm or rad."""
        return np.asarray(self.commanded[:, None] * np.eye(3)[self.axis])

    @property
    def commanded(self) -> Array:
        """Commanded displacements (points,), mm or rad."""
        largest = (self.amplitude_um if self.amplitude_mrad is None else self.amplitude_mrad) or 0.0
        return np.linspace(-largest, largest, self.points) * 1e-3

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of the numbers that need a source: those of the commands, no settings of the
        computation.
        """
        return (*super().numbers, "points")


class LoadedCase:
    """A case with its feasible stages; `stem` names its results."""

    def __init__(
        self, path: str | os.PathLike[str], load: Callable[[Path], Stage] | None = None
    ) -> None:
        """Read the case, and its stages by `load`. Raises BadInput naming the file that cannot be
        used.
        """
        self.path = Path(path)
        self.stem = self.path.stem
        self.case = validate(Case, path)
        self.stages: dict[str, Stage] = {}
        load = load or cache(load_feasible)  # a stage shared by several curves is solved once
        for index, curve in enumerate(self.case.curve):
            try:
                stage = load(self.stage_path(curve))
            except BadInput as error:
                text = f"curve[{index}].stage = {shown(curve.stage)}: {error}"
                raise bad_key(path, ("curve", index, "stage"), text) from None
            if self.case.drive == "strokes" and not stage.actuator:
                expected = f'"force" or "joints": {self.stage_path(curve)} has no [[actuator]]'
                raise bad_key(path, ("drive",), f'drive = "strokes", expected {expected}')
            self.stages[curve.label] = stage

    def stage_path(self, curve: Curve) -> Path:
        """Return the path of the stage file of a curve."""
        return Path(os.path.normpath(self.path.parent / curve.stage))
