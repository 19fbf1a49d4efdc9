"""Stiffness of a manufactured mechanism, from its measured neck thicknesses."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from flexfem.analytic.plates import respond
from flexfem.arrays import Array, free_stiffness, inverse
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import plate_response
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate_checks import check_layout
from flexfem.questions import plates, setup
from flexfem.questions.necks import HingePlace, Necks, Widths, read_necks
from flexfem.questions.plates import PART_RESOLUTION, ElasticParts
from flexfem.questions.setup import DEFAULT, ELASTIC, ELASTIC_READ, Analytic, Mesh, ModelAnswer
from flexfem.results import EXACT, SOLID, SOLVED, Progress, Quantity, Result
from flexfem.units import MICROMETRE

DRAWS = 4000
LEAST_DRAWS = 400
SEED = 2003
WORK = 5e8  # draws of a mechanism times the third power of its hinges, at most: a minute
QUANTILES = (0.025, 0.975)
# standard error of these quantiles times the root of the draws: sqrt(p (1 - p)) / normal density
OF_LIMITS = 2.67
IN_MEMORY = 2**21  # numbers of the matrices of networks that are solved together
OTHERS = ("held", "free")  # the other directions of a stiffness along one
ALONG = ("others", "direction")
NO_DEVIATION = "no standard deviation is given: the scatter is not known"
THICKER = (
    "a hinge with a thicker neck is thicker by the same amount over its whole length; for the "
    "scatter, its compliance changes like its beam integrals"
)
Redrawn: TypeAlias = Callable[[Array], Array]
"""Function from changes of the necks (draws, hinges), mm, to the stiffness (draws, 3, 3)."""


class MechanismAsBuilt(Result):
    """Stiffness of a plate with its measured necks, and its scatter due to the measurement
    uncertainty.
    """

    title = "mechanism as built"
    main_result = ("deviation", {"others": "free"})
    labels: ClassVar = {"others": OTHERS}
    columns = ("component",)
    stiffness = Quantity(
        "stiffness as built", "stiffness matrix", ("direction", "component"), EXACT, "matrix"
    )
    drawn = Quantity(
        "stiffness as drawn",
        "stiffness matrix",
        ("direction", "component"),
        EXACT,
        "matrix",
        shown=False,
    )
    along = Quantity("stiffness as built", "stiffness", ALONG)
    deviation = Quantity("deviation from the drawing", "percent", ALONG)
    spread = Quantity("standard deviation", "stiffness", ALONG, SOLVED)
    low = Quantity("95 % of parts from", "stiffness", ALONG, SOLVED)
    high = Quantity("to", "stiffness", ALONG, SOLVED)
    necks = Quantity("neck", "um", ("hinge",), shown=False)
    sd = Quantity("standard deviation of the neck", "um", ("hinge",), shown=False)
    unanswered = Quantity("draws without a solution", shown=False)


@setup.options(not_for="analytic")
def as_built(
    mechanism: Mechanism,
    necks: Path,
    *,
    analytic: Analytic = DEFAULT,
    solid: bool = False,
    thickness_resolution: int | None = None,
    progress: Progress | None = None,
) -> MechanismAsBuilt:
    """Stiffness of a mechanism with its measured necks, and its scatter due to the measurement
    uncertainty.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    necks : path
        CSV file with columns chain, only for a stage, hinge, neck_um and, if known, sd_um; or TOML
        with these in [[neck]]. A stage needs all nine necks; an unlisted hinge of a mechanism has
        the drawn neck.
    analytic : Analytic
        The analytic model. Of a stage file only.
    solid : bool
        The whole plate by finite elements in three dimensions.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MechanismAsBuilt
        Of a stage file `AsBuilt`. Every number has the unit that its quantity declares: `unit`
        returns it, and `flexfem schema mechanism_as_built` or `flexfem schema as_built` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.
    """
    mesh = mesh_in_depth(mechanism, solid, thickness_resolution)
    setup.require_hinges(mechanism, "whose necks are measured", "a mechanism with hinges")
    joints = mechanism.layout.joints
    drawn: dict[HingePlace, float] = {(None, joint.name): joint.profile.neck for joint in joints}
    measured = read_necks(necks, drawn)
    widths = measured.over(drawn)
    made = _with_necks(mechanism, widths.neck)
    drawn_parts = _parts(mechanism, mechanism.layout)
    parts = _parts(mechanism, made)
    joined = Stiffnesses(_stiffness(mechanism.layout, drawn_parts), _stiffness(made, parts))
    in_depth = _in_depth(mechanism, made, mesh, progress)
    built = compared(widths, joined, in_depth, _redrawn(made, parts))
    return setup.result_of(
        MechanismAsBuilt,
        setup.about(mechanism, files={"necks": measured}),
        {},
        mesh,
        {"analytic model": ELASTIC},
        {"necks": widths.neck, "sd": widths.sd, **built.values},
        setup.axes_of(mechanism.layout),
        in_depth.bands,
        notes=[ELASTIC_READ, THICKER, *_unlisted(measured, len(drawn)), *built.notes],
    )


def mesh_in_depth(
    mechanism: Mechanism, solid: bool, thickness_resolution: int | None
) -> Mesh | None:
    """Return the mesh in three dimensions, None without `solid`. Raises BadInput."""
    layers = setup.elements_through(solid, thickness_resolution)
    return None if layers is None else setup.mesh_of(mechanism, "both", None, layers)


def _unlisted(measured: Necks, hinges: int) -> list[str]:
    """Note how many of the hinges are not listed."""
    count = hinges - len(measured.neck)
    if not count:
        return []
    return [
        f"{count} of {hinges} hinges are not listed: they have the drawn neck, without deviation"
    ]


class Stiffnesses(NamedTuple):
    """Stiffness (3, 3) as drawn and as made."""

    drawn: Array
    made: Array


class Built(NamedTuple):
    """Values of a result by quantity, and notes on them."""

    values: dict[str, Any]
    notes: list[str]


def compared(
    widths: Widths,
    joined: Stiffnesses,
    in_depth: ModelAnswer,
    redrawn: Redrawn,
) -> Built:
    """Return the stiffness as drawn and as made, and its scatter.

    joined : of the network of parts.   in_depth : of the whole plate in three dimensions, which the
    scatter follows in proportion; or empty.
    """
    values = {"drawn": joined.drawn, "stiffness": joined.made, **in_depth.values}
    along = stiffness_along(values["stiffness"])
    values["along"] = along
    values["deviation"] = 100 * (along / stiffness_along(values["drawn"]) - 1)
    if not np.any(widths.sd):
        return Built(values, [NO_DEVIATION])
    scatter = _scatter(widths, redrawn, along / stiffness_along(joined.made))
    return Built({**values, **scatter.values}, scatter.notes)


def _scatter(
    widths: Widths,
    redrawn: Redrawn,
    ratio: Array,
) -> Built:
    """Return the scatter of the stiffness by the uncertainty of the necks.

    ratio : (2 others held or free, 3), of the stiffness to that of `redrawn` without change.
    """
    hinges = len(widths.neck)
    count = int(np.clip(WORK / hinges**3, LEAST_DRAWS, DRAWS))
    changes = widths.sd * np.random.default_rng(SEED).normal(size=(count, hinges))
    numbers = 9 * changes.size * hinges  # of all matrices of the network
    blocks = np.array_split(changes, -(-numbers // IN_MEMORY))
    found = np.concatenate([redrawn(block) for block in blocks])
    solved = found[np.all(np.isfinite(found), axis=(1, 2))]
    draws = stiffness_along(solved) * ratio
    low, high = np.quantile(draws, QUANTILES, axis=0)
    left_out = count - len(draws)
    values = {
        "spread": np.std(draws, axis=0, ddof=1),
        "low": low,
        "high": high,
        "unanswered": left_out,
    }
    notes = [
        f"standard deviation of each neck at most {MICROMETRE.factor * np.max(widths.sd):.3g} um; "
        f"{count} draws: the standard error of the standard deviation is "
        f"{100 / np.sqrt(2 * len(draws)):.2g} % of it, that of each limit "
        f"{100 * OF_LIMITS / np.sqrt(len(draws)):.2g} % of it",
    ]
    if left_out:
        notes.append(f"{left_out} draws have no solution and are excluded")
    return Built(values, notes)


def stiffness_along(stiffness: Array) -> Array:
    """Return the stiffness (..., 2 others held or free, 3) along every direction."""
    held = np.diagonal(stiffness, axis1=-2, axis2=-1)
    return np.stack([held, free_stiffness(stiffness)], axis=-2)


def _in_depth(
    mechanism: Mechanism, made: Layout, mesh: Mesh | None, progress: Progress | None
) -> ModelAnswer:
    """Return the stiffness as drawn and as made in three dimensions; nothing without a mesh."""
    if mesh is None:
        return ModelAnswer({})
    mesh_once = cache(mesh_layout)

    def by_mesh(resolution: int, layers: int) -> dict[str, Array]:
        through = plates.layers_of(mechanism, layers)
        found = dict[str, Array]()
        for name, layout in (("drawn", mechanism.layout), ("stiffness", made)):
            response = plate_response(layout, mesh_once(layout, resolution), through)
            found[name] = inverse(response.compliance[:3, :3])
        return found

    return plates.element_values(mesh, by_mesh, progress)[SOLID]


def _parts(mechanism: Mechanism, layout: Layout) -> ElasticParts:
    """Return the elastic parts of a layout, with hinges in three dimensions unless the model of the
    mechanism is plane.
    """
    parts_on = plates.parts_in
    if mechanism.model == "three_dimensional":
        parts_on = plates.parts_in_depth
    return parts_on(layout, mesh_layout(layout, PART_RESOLUTION))


def _stiffness(layout: Layout, parts: ElasticParts) -> Array:
    """Return the stiffness (..., 3, 3) of the output."""
    return inverse(respond(layout, parts.bodies, layout.ports[:3], parts.hinges).compliance)


def _redrawn(made: Layout, parts: ElasticParts) -> Redrawn:
    """Return the function from changes of the necks of a layout to its stiffness."""
    assert parts.hinges is not None
    unchanged = _beam_integrals(made, np.zeros(len(made.joints)))

    def redrawn(added: Array) -> Array:
        change = np.sqrt(_beam_integrals(made, added) / unchanged)
        hinges = change[..., :, None] * parts.hinges * change[..., None, :]
        return _stiffness(made, parts._replace(hinges=hinges))

    return redrawn


def _beam_integrals(layout: Layout, added: Array) -> Array:
    """Return the beam integrals (..., hinges, 3) of hinges thicker by (..., hinges), mm."""
    found = list[Array]()
    for h, joint in enumerate(layout.joints):
        E, nu, *_ = layout.material_of(joint)
        compliance = joint.profile.compliance(E, nu, layout.thickness, added[..., h])
        found.append(np.diagonal(compliance, axis1=-2, axis2=-1))
    return np.stack(found, axis=-2)


def _with_necks(mechanism: Mechanism, necks: Array) -> Layout:
    """Return the layout with necks (hinges,), mm. Raises BadInput if its parts do not fit."""
    layout = mechanism.layout
    joints = list[Joint]()
    for joint, neck in zip(layout.joints, necks.tolist(), strict=True):
        profile = joint.profile.with_neck(neck)
        joints.append(joint._replace(profile=profile, cut=max(joint.cut, profile.least_cut)))
    made = layout._replace(joints=tuple(joints))
    with naming_place(mechanism):
        check_layout(made)
    return made
