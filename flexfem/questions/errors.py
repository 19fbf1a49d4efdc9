"""Errors of the analytic networks of a mechanism, against finite elements.

They are those of motions by single forces, and of motions by actuators."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import compress
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import (
    HELD,
    amplification_bands,
    amplification_errors,
    free_errors,
    held,
)
from flexfem.questions.plates import (
    BY_ELEMENTS,
    ON_MESHES,
    Responses,
    Values,
    amplification,
    mesh_of,
    network,
    of_models,
)
from flexfem.questions.setup import ELASTIC, Mesh, ModelAnswer, answer, require_hinges
from flexfem.results import ANALYTIC, COARSE_MESHES, Progress, Quantity, Result
from flexfem.units import DIRECTIONS

POINTS = ON_MESHES._replace(absolute=100 * COARSE_MESHES.relative)  # percentage points of a command
ALONG_READ = (
    "along the command this is the error of the stiffness of the model with the other directions "
    "free: the same number in `stiffness`, `summary`, `verify`, `budget` and the report"
)
AMPLIFICATION_READ = (
    "motion of the free output per opening of one actuator, of the model relative to finite "
    "elements, along the motion of these"
)


class MechanismErrors(Result):
    """Errors of the analytic networks of a mechanism."""

    title = "errors of the analytic models"
    main_result = ("percent", {})
    figure = "errors.mechanism_figure"
    labels: ClassVar = {"commanded": DIRECTIONS}
    footnotes = (
        "positioning error: motion of finite elements minus that of the model, by the force or "
        "moment that moves the model as commanded, with the other directions free; rotations are "
        "multiplied by the lever",
        ALONG_READ,
    )
    percent = Quantity(
        "positioning error, % of the commanded motion",
        "percents",
        ("model", "commanded", "direction"),
        POINTS,
    )
    driven = Quantity(
        "error of the amplification",
        "percent",
        ("model", "actuator"),
        POINTS,
        note=AMPLIFICATION_READ,
    )
    free = Quantity(
        "stiffness, other directions free",
        "stiffness",
        ("model", "direction"),
        ON_MESHES,
        shown=False,
    )
    lever = Quantity("lever of the output: distance to its farthest hinge", "mm")


def held_notes(compliance: Array, lever: float) -> list[str]:
    """Return a note on the directions in which the output of a compliance (3, 3) is held."""
    names = ", ".join(compress(DIRECTIONS, held(compliance, lever)))
    if not names:
        return []
    return [
        f"no error in {names}: there the mechanism is more than {HELD:g} times as stiff as in its "
        "softest direction (rotations times the lever), and a share of a commanded motion says "
        "nothing about its use"
    ]


class Compared(NamedTuple):
    """Finite elements with which analytic models are compared.

    label : of the plane, or of three dimensions.
    compliance : (k, k), of the ports.   motions : (a, 3), of the output per opening.   bands : of
    both.
    """

    label: str
    compliance: Array
    motions: Array
    bands: Mapping[str, Array]

    def percent_band(
        self,
        model: Array,
        lever: float,
    ) -> Array:
        """Return the bands (3, 3) of `free_errors` of a model with a compliance (3, 3)."""
        return free_errors(model, model + self.bands["compliance"][:3, :3], lever)

    def driven_band(
        self,
        model: Array,
        layout: Layout,
    ) -> Array:
        """Return the bands (a,) of `amplification_errors` of a model with a compliance (k, k)."""
        motions = amplification(layout, model)
        return amplification_bands(motions, self.motions, self.bands["amplification"], layout.lever)


def compared(
    mechanism: Mechanism,
    mesh: Mesh,
    progress: Progress | None = None,
) -> Compared:
    """Solve the finite elements with which analytic models are compared in every question."""

    def values(response: Responses) -> Values:
        return {
            "compliance": response.compliance,
            "amplification": amplification(mechanism.layout, response.compliance),
        }

    by_label = of_models(mechanism, mesh, "elements", values, progress)
    label, (found, bands) = list(by_label.items())[-1]
    return Compared(label, found["compliance"], found["amplification"], bands)


def errors_of(mechanism: Mechanism, layers: int | None = None) -> MechanismErrors:
    """Return the errors of both analytic networks of a mechanism, in its dimensions.

    layers : of elements in half of the thickness, for the whole plate in three dimensions.

    Raises BadInput for a mechanism without hinges.
    """
    require_hinges(
        mechanism,
        "which the analytic models need that are compared with finite elements",
        BY_ELEMENTS,
    )
    mesh = mesh_of(mechanism, "both", None, layers)
    assert mesh is not None
    finest = compared(mechanism, mesh)
    models = {
        label: _of_network(mechanism, network(mechanism, label == ELASTIC).compliance, finest)
        for label in (ANALYTIC, ELASTIC)
    }
    lever = mechanism.layout.lever
    return answer(
        MechanismErrors,
        mechanism,
        models,
        mesh,
        {"compared with": finest.label},
        {"lever": lever},
        notes=held_notes(finest.compliance[:3, :3], lever),
    )


def _of_network(
    mechanism: Mechanism,
    model: Array,
    finest: Compared,
) -> ModelAnswer:
    """Return the errors of a network with the compliance (k, k) of the ports."""
    layout = mechanism.layout
    lever = layout.lever
    output = model[:3, :3]
    elements = finest.compliance[:3, :3]
    errors = free_errors(output, elements, lever).T
    errors[held(elements, lever)] = np.nan
    values: dict[str, Any] = {"percent": errors, "free": 1 / np.diag(model)[:3]}
    bands = {"percent": finest.percent_band(output, lever).T}
    if layout.actuators:
        motions = amplification(layout, model)
        values["driven"] = amplification_errors(motions, finest.motions, lever)
        bands["driven"] = finest.driven_band(model, layout)
    return ModelAnswer(values, bands)
