"""What claims are measured on: n stages with the errors of a model against their metal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import at_rest, hinge_compliances
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.designs import Designs
from flexfem.mechanism.stage import Stage
from flexfem.questions.bands import error_matrix
from flexfem.verify.case import DIRECTIONS


class Metal(NamedTuple):
    """n stages and the compliances of their metal: (n, 3, 3) of the whole, (n, 9, 9) of pads, links and platform."""

    stages: tuple[Stage, ...]
    designs: Designs
    bodies: Array
    compliance: Array

    def of_rows(self, rows: AnyArray) -> Metal:
        """Only some of the stages, by their places or by a mask (n,)."""
        stages = tuple(self.stages[place] for place in np.arange(len(self.stages))[rows])
        return Metal(stages, self.designs.chosen(rows), self.bodies[rows], self.compliance[rows])


class ModelErrors(NamedTuple):
    """n stages with the mobility the paper models them with.

    stiffness : (n, 3, 3), of the model.   percent : (n, 3, 3), error of the metal under the force of (18), column j for
        command j.   band : (n, 3, 3), of the mesh; None where there is none.
    """

    metal: Metal
    mobility: int
    formula: str
    stiffness: Array
    percent: Array
    band: Array | None = None

    def of_rows(self, rows: AnyArray) -> ModelErrors:
        """Only some of the stages, by their places or by a mask (n,)."""
        return self._replace(metal=self.metal.of_rows(rows), stiffness=self.stiffness[rows], percent=self.percent[rows])

    @property
    def designs(self) -> Designs:
        """Of the metal."""
        return self.metal.designs

    @property
    def compliance(self) -> Array:
        """Of the metal (n, 3, 3)."""
        return self.metal.compliance

    @property
    def lever(self) -> Array:
        """l3 (n,), mm."""
        return np.asarray(self.designs.link_lengths[:, 2])


class Evidence(NamedTuple):
    """All that claims are measured on; amplitude (3,) of the workspace in mm, mm, rad."""

    three: ModelErrors
    six: ModelErrors
    amplitude: Array

    def first(self, count: int | None) -> Evidence:
        """That of the first stages; None for all."""
        if count is None or count >= len(self.six.percent):
            return self
        return self._replace(three=self.three.of_rows(np.arange(count)), six=self.six.of_rows(np.arange(count)))

    @property
    def alike(self) -> bool:
        """Whether all stages are three-fold symmetric."""
        return self.three.designs.alike and self.six.designs.alike


def modelled(metal: Metal, mobility: int, formula: str) -> ModelErrors:
    """The errors of a model on n stages."""
    K = stiffness_of(metal.designs, mobility, formula)
    percent = error_matrix(K, metal.compliance, metal.designs.link_lengths[:, 2])
    return ModelErrors(metal, mobility, formula, K, percent)


def stiffness_of(designs: Designs, mobility: int, formula: str) -> Array:
    """Stiffness (n, 3, 3) of n stages at rest by a model with rigid links."""
    return at_rest(designs, hinge_compliances(designs, formula), freedoms_of(mobility)).stiffness


def along(of: ModelErrors) -> Array:
    """Errors (n, 3) in the commanded directions, per cent."""
    return diagonals(of.percent)


def diagonals(matrices: Array) -> Array:
    """Diagonals (n, k) of n matrices."""
    return np.asarray(np.diagonal(matrices, axis1=-2, axis2=-1))


def listed(values: Array, form: str = ".3f") -> str:
    """Values (3,) by direction, in words."""
    return ", ".join(f"{axis} {value:{form}}" for axis, value in zip(DIRECTIONS, values, strict=True))
