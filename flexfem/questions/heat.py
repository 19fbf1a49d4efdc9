"""Effect of a change of temperature on a mechanism: pose and stress per kelvin and per K/mm.

Mechanism and frame have the same temperature field, linear in x and y. The mechanism does not
strain the frame. In plane strain the faces are held at the expansion of the frame: the plate
expands in the plane by `a + nu (a - a_frame)`, and carries `E (a_frame - a)` out of the plane
besides the stress of plane strain, both per kelvin. In three dimensions the faces are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flexfem.analytic.plates import thermal_response as warmed_network
from flexfem.arrays import Array
from flexfem.fem.ports import thermal_response, warm_stress
from flexfem.fem.response import HEAT_CASES, free_displacement
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.expansion import (
    KEY,
    coefficients,
    expansion_in_depth,
    expansion_of,
    require_expansion,
)
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions import plates, setup
from flexfem.questions.bands import pose_bands
from flexfem.questions.plates import (
    ON_MESHES,
    PEAK,
    ROUND_OFF,
    ElasticParts,
    Thickened,
    Values,
)
from flexfem.questions.setup import DEFAULT, Analytic, MeshFields, Models
from flexfem.results import Progress, Quantity, Result

CASES = ("uniform", "gradient in x", "gradient in y")
FRAME = f"frame.{KEY}"
FRAME_ASSUMED = (
    f"{FRAME} is not stated: the frame is assumed to expand like the plate, so a uniform change "
    f"causes no stress; state {KEY} under [frame], for example 12 for steel"
)
PROPORTIONAL = "all numbers are proportional to the difference of the two coefficients of expansion"


class MechanismDrift(Result):
    """Displacement and stress of a plate per change of temperature."""

    title = "change of temperature"
    main_key = FRAME
    main_result = ("pose", {"case": "uniform"})
    figure = "displaced.drift_figure"
    has_mesh_fields = True
    drawn_from_fields = True
    labels: ClassVar = {"case": CASES}
    footnotes: ClassVar[tuple[str, ...]] = (
        "uniform: per K; gradients: per K/mm about the origin, the same in the plate and in the "
        "ground",
    )
    pose = Quantity(
        "displacement per K or K/mm",
        "motion",
        ("case", "point", "model", "direction"),
        ON_MESHES._replace(absolute=1e-8),
        "pose",
    )
    stress = Quantity(
        "highest hinge stress per K or K/mm", "mpa", ("case", "model", "hinge"), PEAK, "all"
    )


@setup.options(not_for="analytic")
def drift(
    mechanism: Mechanism,
    *,
    models: Models = "both",
    analytic: Analytic = DEFAULT,
    resolution: int | None = None,
    solid: bool = False,
    thickness_resolution: int | None = None,
    plane: bool = False,
    progress: Progress | None = None,
) -> MechanismDrift:
    """Displacement and stress of a mechanism per kelvin, and per kelvin per mm along x and y.

    In plane strain the faces are held at the expansion of the frame. In plane stress and in three
    dimensions they are free.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    resolution : int, optional
        Triangles across every neck on the finest of three meshes, from 4, of a stage file in three
        dimensions from 6.
    solid : bool
        The whole plate by finite elements in three dimensions; of a stage file also a gradient in
        z.
    models : {"both", "analytic", "elements"}
        The models to compute.
    analytic : Analytic
        The analytic model. Of a stage file only.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    plane : bool
        Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    MechanismDrift
        Of a stage file `Drift`. Every number has the unit that its quantity declares: `unit`
        returns it, and `flexfem schema mechanism_drift` or `flexfem schema drift` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drift(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> turned = found.at("pose", case="uniform", direction="theta")
    >>> round(1e6 * float(turned[0]), 2)  # urad per kelvin
    5.5
    """
    layers = setup.elements_through(solid, thickness_resolution)
    mesh = plates.mesh_of(mechanism, models, resolution, layers)
    with naming_place(mechanism):
        require_expansion(mechanism)

    @cache
    def by_mesh(resolution: int, layers: int) -> Warm:
        return _by_mesh(mechanism, resolution, layers)

    def element_values(
        resolution: int,
        layers: int,
        thick: Thickened | None = None,
    ) -> Values:
        found = by_mesh(resolution, layers)
        if thick is not None:
            found = _thickened(mechanism, found, thick)
        return _without_round_off(mechanism, found)

    def by_network(elastic: bool) -> Values:
        return _without_round_off(mechanism, _by_network(mechanism, elastic))

    def bands(
        sizes: Array,
        each: list[Values],
        ends: Sequence[Values],
    ) -> dict[str, Any]:
        found = plates.value_bands(sizes, each, ends)
        return found | {"pose": _pose_bands(mechanism, sizes, each, ends)}

    found = plates.by_models(mechanism, mesh, models, by_network, element_values, progress, bands)
    return setup.answer(
        MechanismDrift,
        mechanism,
        found,
        mesh,
        warnings=warnings_of_frame(mechanism),
        fields=_fields(mechanism, mesh),
    )


def _fields(mechanism: Mechanism, mesh: setup.Mesh | None) -> MeshFields | None:
    """Return the displacements per K or K/mm by plane finite elements; None without them."""
    if mesh is None:
        return None

    def made() -> dict[str, Array]:
        expansion = expansion_of(mechanism)
        model = plates.factorised(mechanism, mesh.resolution)
        response = thermal_response(model, expansion.plate, expansion.frame, expansion.of_parts)
        by_case = np.tensordot(HEAT_CASES, free_displacement(model.mesh.nodes), axes=1)
        return dict(zip(CASES, response.fields + expansion.plate * by_case, strict=True))

    return MeshFields(plates.meshed(mechanism, mesh.resolution), made)


def warnings_of_frame(mechanism: Mechanism) -> list[str]:
    """Warn of a frame whose expansion is not stated."""
    return [FRAME_ASSUMED] if mechanism.frame.expansion is None else []


class Warm(NamedTuple):
    """Response to the cases, per kelvin or per K/mm.

    motions : (k, 3), of the ports.   stress : (3, h), highest of hinges, MPa.
    """

    motions: Array
    stress: Array


def _by_network(mechanism: Mechanism, elastic: bool) -> Warm:
    """Return the response of the network of bodies and hinges."""
    layout = mechanism.layout
    expansion = expansion_of(mechanism)
    parts = plates.joined_parts(mechanism, elastic)
    motions, wrenches = warmed_network(
        layout, expansion.plate, expansion.frame, *parts, expansion.of_parts
    )
    places = np.array([joint.place for joint in layout.joints])
    temperatures = np.vstack([np.ones(len(places)), places.real, places.imag])
    across = expansion.across * temperatures
    stress = plates.stress_by(mechanism, np.moveaxis(wrenches, -1, 0), elastic, across)
    return Warm(motions, stress)


def _by_mesh(
    mechanism: Mechanism,
    resolution: int,
    layers: int,
) -> Warm:
    """Return the response of finite elements, in the plane or with layers."""
    expansion = expansion_in_depth(mechanism) if layers else expansion_of(mechanism)
    model = plates.factorised(mechanism, resolution, layers)
    response = thermal_response(model, expansion.plate, expansion.frame, expansion.of_parts)
    unlike = expansion.unlike_hinges(len(mechanism.layout.bodies))
    return Warm(response.motions, warm_stress(response, expansion.across, unlike))


def _thickened(
    mechanism: Mechanism,
    plane: Warm,
    thick: Thickened,
) -> Warm:
    """Return the response of plane finite elements with the change by the thickness of hinges."""
    layout = mechanism.layout
    expansion = expansion_in_depth(mechanism)

    def network(parts: ElasticParts) -> tuple[Array, Array]:
        return warmed_network(layout, expansion.plate, expansion.frame, *parts, expansion.of_parts)

    def motions(parts: ElasticParts) -> Array:
        return network(parts)[0]

    wrenches = network(thick.solid)[1]
    ratios = thick.stress_ratios(np.moveaxis(wrenches, -1, 0))
    return Warm(plane.motions + thick.change(motions), plane.stress * ratios)


def _without_round_off(mechanism: Mechanism, warm: Warm) -> Values:
    """Return poses (cases, points, 3) and stresses (cases, hinges) without values far below those
    of held plates.
    """
    layout = mechanism.layout
    lever = layout.lever
    of_materials = [material.expansion or 0.0 for material in layout.materials]
    largest = max(*coefficients(mechanism), *of_materials)
    strains = largest * np.array([1.0, lever, lever])[:, None]  # free expansion by case
    pose = warm.motions[: 3 * len(layout.points)].T.reshape(3, -1, 3)
    smallest_pose = ROUND_OFF * strains[:, None] * [lever, lever, 1.0]
    smallest_stress = ROUND_OFF * mechanism.material.youngs_modulus * strains
    return {
        "pose": np.where(np.abs(pose) < smallest_pose, 0.0, pose),
        "stress": np.where(warm.stress < smallest_stress, 0.0, warm.stress),
    }


def _pose_bands(
    mechanism: Mechanism, sizes: Array, each: list[Values], ends: Sequence[Values]
) -> Array:
    """Return the bands of poses (cases, points, 3) by their values on three meshes."""
    shape = each[-1]["pose"].shape
    on_meshes = np.array([one["pose"].reshape(-1, 3).T for one in each])
    at_ends = np.array([one["pose"].reshape(-1, 3).T for one in ends])
    levers = np.array([1.0, 1.0, mechanism.lever])
    return pose_bands(sizes, on_meshes, levers, at_ends).T.reshape(shape)
