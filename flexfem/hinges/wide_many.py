"""Ratios of the compliance of wide hinges to that in plane stress, of many designs.

`wide_factors` solves a plate, which takes milliseconds. Here its ratios are interpolated in the
logarithms of the dimensions that vary, and computed one by one outside the range of the fit. In
slender leaves round-off of the plate is up to 2e-6 of a ratio, which no fit follows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.hinges.fitted import SmoothFit
from flexfem.hinges.many import varying
from flexfem.hinges.wide import wide_factors
from flexfem.mechanism.profile import Profile

ACCURACY = 5e-7  # relative, of a fit that is not refined further
COARSEST = 5e-6  # relative, of a fit that is used where a higher degree does not help


class WideHinge(NamedTuple):
    """A wide hinge of n designs: profile, Poisson's ratio and thickness, numbers or arrays."""

    profile: Profile
    poissons_ratio: Any
    thickness: Any

    @property
    def variables(self) -> Array:
        """Logarithms (n, k) of the numbers that vary, in a fixed order; (1, 0) without any."""
        columns = [np.ravel(getattr(self.profile, name)) for name in varying(self.profile)]
        others = (self.poissons_ratio, self.thickness)
        columns += [each for each in others if isinstance(each, np.ndarray)]
        with np.errstate(all="ignore"):
            return np.log(np.column_stack(columns)) if columns else np.zeros((1, 0))

    def factors_at(self, variables: Array) -> Array:
        """Return the ratios (3,) of one design by its variables (k,)."""
        values = iter(np.exp(variables).tolist())
        names = varying(self.profile)
        profile = replace(self.profile, **{name: next(values) for name in names})
        nu, thickness = (
            next(values) if isinstance(each, np.ndarray) else each
            for each in (self.poissons_ratio, self.thickness)
        )
        return np.array(wide_factors(profile, float(nu), float(thickness)))

    def ratios(self, fit: SmoothFit | None) -> Array:
        """Return the ratios (n, 3), axial, transverse, rotational; (3,) where nothing varies."""
        variables = self.variables
        if not variables.shape[1]:
            return self.factors_at(variables[0])
        if fit is None:
            return self._one_by_one(variables)
        inside = fit.inside(variables)
        found = np.empty((len(variables), 3))
        found[inside] = fit(variables[inside])
        found[~inside] = self._one_by_one(variables[~inside])
        return found

    def _one_by_one(self, variables: Array) -> Array:
        """Return the ratios (n, 3) at variables (n, k), each different one once."""
        different, place = np.unique(variables, axis=0, return_inverse=True)
        found = [self.factors_at(each) for each in different]
        return np.array(found).reshape(-1, 3)[np.ravel(place)]
