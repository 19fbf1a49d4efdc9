"""What claims are measured by: values of n stages at once, a sentence on one, and what holds whatever the dimensions.

The same functions measure the two stages of a file of claims, on finite elements, and the pairs of an ensemble.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexfem.analytic.model import hinge_compliances
from flexfem.analytic.paper import freedoms_of, mobility
from flexfem.arrays import Array, inverse
from flexfem.mechanism.designs import Designs
from flexfem.questions.bands import error_matrix
from flexfem.units import LENGTH
from flexfem.verdicts import arguments
from flexfem.verdicts.evidence import Evidence, ModelErrors, along, diagonals, listed, stiffness_of
from flexfem.verdicts.second_order import (
    minimum_energy,
    said_minimum_energy,
    said_second_order,
    said_second_order_of_error,
    second_order,
    second_order_of_error,
)
from flexfem.verdicts.temperature import said_temperature_gradient, temperature_gradient

# How far calibrated hinges and elastic links are from finite elements, percentage points: of 20 pairs of the shipped
# ensemble an error at worst by 0.064 (median 0.004), mobility three less six by 0.003, theta less X by 0.027.
METAL, BETWEEN_STAGES, BETWEEN_COMMANDS = 0.07, 0.004, 0.03
# Of pairs in which a gradient moves unlike chains hardly further: off by 0.0009 at worst of 12 from meshes of 24
# triangles across a neck, which themselves are 0.001 from those of 18.
GRADIENTS = 0.001
SEVERAL = 100  # stages of an ensemble for what takes long
OTHER = ~np.eye(3, dtype=bool)


class Measure(NamedTuple):
    """How claims are measured.

    values : (n, k) of the evidence, nan where a stage has none.   found : a sentence on n = 1 and its values.
    slack : percentage points by which values of an ensemble may be off, its metal being no finite elements.
    most : stages of an ensemble that are measured, the first ones; None for all.
    by_formula : whether the values follow the hinge formula.   dimensional : whether they follow dimensions at all.
    argument : why it holds or fails whatever the dimensions; `symmetric`: of a three-fold symmetric stage.
    """

    values: Callable[[Evidence], Array]
    found: Callable[[Evidence, Array], str]
    slack: float = 0.0
    most: int | None = None
    by_formula: bool = False
    dimensional: bool = True
    argument: str | None = None
    symmetric: bool = False


def _across(of: ModelErrors) -> Array:
    return np.asarray(np.abs(of.percent[..., OTHER]))


def _band(of: ModelErrors) -> str:
    return "" if of.band is None else f", mesh band at most {np.max(np.diag(of.band[0])):.3f} points"


def _mobility(on: Evidence) -> Array:
    values = [float(mobility(freedoms_of(model))) for model in (3, 6, 12)]  # (1)
    return np.tile(values, (len(on.six.percent), 1))


def _said_mobility(_: Evidence, values: Array) -> str:
    return "(1) gives {:.0f}, {:.0f} and {:.0f}".format(*values)


def _said_six_commanded(on: Evidence, _: Array) -> str:
    return f"errors of {listed(along(on.six)[0])} %{_band(on.six)}"


def _said_across(_: Evidence, values: Array) -> str:
    return f"at most {np.max(values):.2g} % across"


def _said_three_along(on: Evidence, _: Array) -> str:
    three, six = listed(along(on.three)[0]), listed(along(on.six)[0])
    return f"errors of {three} % along{_band(on.three)}, against {six} % with mobility six"


def _said_three(on: Evidence, values: Array) -> str:
    return f"{_said_three_along(on, values)}, and at most {np.max(_across(on.three)):.2g} % across"


def _six_better(on: Evidence) -> Array:
    return np.abs(along(on.three)) - np.abs(along(on.six))


def _said_six_better(_: Evidence, values: Array) -> str:
    return f"mobility six errs less by {listed(values)} points of mobility three's error"


def _without_axial(on: Evidence) -> Array:
    """Errors (n, 3) along of the stages of mobility six by the model of mobility three."""
    of = on.six
    K = stiffness_of(of.designs, 3, of.formula)
    return diagonals(error_matrix(K, of.compliance, of.lever))


def _axial_share(on: Evidence) -> Array:
    without = _without_axial(on)
    return 100 * (without - along(on.six)) / without


def _said_axial_share(on: Evidence, values: Array) -> str:
    three = on.three
    all_freedoms = inverse(stiffness_of(three.designs, 21, three.formula))
    freedoms = diagonals(error_matrix(three.stiffness, all_freedoms, three.lever))[0]
    return (
        f"without the axial freedom the model of the mobility-six stage errs {listed(_without_axial(on)[0])} % instead"
        f" of {listed(along(on.six)[0])} %, so it accounts for {listed(values)} % of the error; all freedoms that"
        f" mobility three leaves out are worth {listed(freedoms)} of {listed(along(three)[0])} points on its own"
        " stage"
    )


def _diagonal(on: Evidence) -> Array:
    largest = []
    for side in (on.three, on.six):
        size = np.sqrt(diagonals(side.stiffness))
        ratio = 100 * side.stiffness / (size[:, :, None] * size[:, None, :])
        largest.append(np.max(np.abs(ratio[:, OTHER]), axis=-1))
        largest.append(100 * np.abs(side.stiffness[:, 0, 0] / side.stiffness[:, 1, 1] - 1))
    return np.stack(largest, axis=-1)


def _said_diagonal(_: Evidence, values: Array) -> str:
    said = (
        "off the diagonal {:.2g} % (mobility three) and {:.2g} % (six) at most, X and Y differ by {:.2g} % and {:.2g} %"
    )
    return said.format(values[0], values[2], values[1], values[3])


def _softer(on: Evidence) -> Array:
    return 100 * (1 - 1 / diagonals(on.six.compliance @ on.six.stiffness))


def _said_softer(_: Evidence, values: Array) -> str:
    return (
        f"in the same comparison the metal is more compliant than the model by {listed(values, '.1f')} %,"
        f" {np.mean(values):.1f} % on average; the text also finds the real stage more compliant"
    )


def _second_freedom(designs: Designs, formula: str) -> Array:
    """Axial over rotational compliance (n,), rad^2/mm^2 by N, of the base hinge of chain 1."""
    found = hinge_compliances(designs, formula)
    return np.asarray((found.axial / found.rotation)[:, 0, 0])


def _larger_radius(on: Evidence) -> Array:
    small, large = on.three.designs, on.six.designs
    necks = replace(large, radius=np.broadcast_to(small.radius, large.radius.shape))
    change = _second_freedom(large, on.six.formula) / _second_freedom(necks, on.six.formula)
    return np.asarray(100 * (change - 1)[:, None])


def _said_larger_radius(on: Evidence, values: Array) -> str:
    small, large = on.three.designs, on.six.designs
    thick = replace(large, neck=2 * large.neck)
    larger = _second_freedom(thick, on.six.formula) / _second_freedom(large, on.six.formula)
    return (
        f"R from {small.radius[0, 0, 0]:g} to {large.radius[0, 0, 0]:g} {LENGTH.plain} changes the axial over the"
        f" rotational compliance of the base hinge by {values[0]:+.1f} %; twice the neck makes it"
        f" {larger[0]:.2f} times as large"
    )


def _rotation_more(on: Evidence) -> Array:
    error = np.abs(along(on.six))
    return np.asarray(error[:, 2:] - np.max(error[:, :2], axis=-1, keepdims=True))


def _said_rotation_more(on: Evidence, values: Array) -> str:
    three = np.abs(along(on.three)[0])
    return (
        f"with mobility six theta errs {values[0]:+.3f} points more than X and Y{_band(on.six)}, with mobility three"
        f" {three[2] - max(three[:2]):+.3f}"
    )


MEASURES: dict[str, Measure] = {
    "mobility": Measure(_mobility, _said_mobility, dimensional=False, argument=arguments.COUNTED),
    "six-commanded": Measure(lambda on: np.abs(along(on.six)), _said_six_commanded, slack=METAL, by_formula=True),
    "six-across": Measure(
        lambda on: _across(on.six), _said_across, by_formula=True, argument=arguments.ACROSS, symmetric=True
    ),
    "three-everywhere": Measure(
        lambda on: np.abs(on.three.percent).reshape(-1, 9),
        _said_three,
        slack=METAL,
        by_formula=True,
        argument=arguments.ACROSS,
        symmetric=True,
    ),
    "three-along": Measure(lambda on: np.abs(along(on.three)), _said_three_along, slack=METAL, by_formula=True),
    "three-across": Measure(
        lambda on: _across(on.three), _said_across, by_formula=True, argument=arguments.ACROSS, symmetric=True
    ),
    "six-better": Measure(_six_better, _said_six_better, slack=BETWEEN_STAGES, by_formula=True),
    "axial-share": Measure(_axial_share, _said_axial_share, by_formula=True),
    "rotation-more": Measure(_rotation_more, _said_rotation_more, slack=BETWEEN_COMMANDS, by_formula=True),
    "larger-radius": Measure(_larger_radius, _said_larger_radius, by_formula=True),
    "diagonal": Measure(_diagonal, _said_diagonal, argument=arguments.DIAGONAL, symmetric=True),
    "second-order": Measure(second_order, said_second_order, most=SEVERAL),
    "second-order-error": Measure(second_order_of_error, said_second_order_of_error),
    "minimum-energy": Measure(minimum_energy, said_minimum_energy, argument=arguments.LEAST_ENERGY),
    "temperature-gradient": Measure(temperature_gradient, said_temperature_gradient, slack=GRADIENTS),
    "measured-stiffness": Measure(_softer, _said_softer, slack=METAL, by_formula=True),
}
