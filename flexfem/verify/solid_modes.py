"""Natural frequencies of a stage in three dimensions, in the plane and out of it, with bands by mesh and by layers.

The material is the metal's own and both faces are free, whatever plane problem a stage's `model` says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.layers import Layers, layers_of
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import modes, structure
from flexfem.fem.response import tie_hub
from flexfem.fem.sectors import Sector, mesh_sectors
from flexfem.fem.solid import sheet_of
from flexfem.fem.solid_modes import SolidModes, solid_modes
from flexfem.mechanism.bodies import Payload, carried, carried_out_of_plane
from flexfem.mechanism.stage import Stage
from flexfem.questions import warnings as warning
from flexfem.questions.bands import SAFETY, coarser, levels
from flexfem.questions.warnings import held_faces
from flexfem.units import DENSITY
from flexfem.verify.modes import HERTZ, KILOGRAM, masses, uncertainty
from flexfem.verify.result import OfStage, Record, Uncertainty, about

Kind: TypeAlias = Literal["in plane", "out of plane"]
KINDS: tuple[Kind, Kind] = ("in plane", "out of plane")
RESOLUTION = 4  # triangles across every neck
MOST = 40  # modes: their fields are kept
SAME_SHAPE = 0.7  # least overlap of two shapes that are called one: any turn of a pair of one frequency leaves as much
AT_ITS_PLACE = (
    "payload: its centre of mass at the platform's centre, in the mid-plane; mounted above it, it would couple motion "
    "in the plane and out of it, which is left out"
)


class BaseShares(Record):
    """Effective modal mass, %, for base motion along x, y, z and rotation about z (theta), x and y (tilt).

    Of the whole mass; of rotations, of the whole moment of inertia about that axis.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    z: float = 0.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0


class SolidMode(Record):
    """One natural frequency, Hz, and what its mode is like.

    band : Hz, the sum of `band_plane`, of the mesh in the plane, and `band_thickness`, of the layers.
    mesh : Hz, with one layer on three meshes.   by_layers : Hz, with fewer and with all layers on the coarsest of them.
    plane_stress : Hz, of the same shape in plane stress on the same mesh of the plane; None where it has none.
    """

    kind: Kind
    frequency: float
    band: float
    band_plane: float
    band_thickness: float
    mesh: Uncertainty
    by_layers: tuple[float, float]
    share: BaseShares
    plane_stress: float | None


class SolidNaturalModes(OfStage):
    """What `flexfem modes --three-dimensional` answers.

    layers : in half the thickness.   heights : mm, their bounds above the mid-plane.
    unknowns : of the whole stage, in the plane and out of it.
    mass, inertia : kg, kg mm^2 about the platform centre, of all that is drawn and of the payload, pads and hub too.
    tilting_inertia : kg mm^2, about x and y through the platform's centre, by the finite elements.
    meshed_mass : kg, by the finite elements.   hub_mass : kg, of the hub, a disc of the stage's metal.
    payload_mass, payload_inertia, payload_tilting : kg, kg mm^2 about the normal, kg mm^2 about x and about y.
    first_out_of_plane : the lowest of these, also where it is not among the `modes`.
    """

    name: str
    resolution: int
    layers: int
    heights: list[float]
    triangles: int
    unknowns: tuple[int, int]
    mass: float
    inertia: float
    tilting_inertia: tuple[float, float]
    meshed_mass: float
    hub_mass: float
    payload_mass: float
    payload_inertia: float
    payload_tilting: float
    modes: list[SolidMode]
    first_out_of_plane: SolidMode


class SolidVibration(NamedTuple):
    """Modes in the plane and out of it on the finest mesh, and the record made of them.

    chosen : of every mode of the record, its kind, 0 or 1, and its number among those of it, from 0.
    """

    halves: tuple[SolidModes, SolidModes]
    chosen: list[tuple[int, int]]
    record: SolidNaturalModes

    @property
    def mesh(self) -> StageMesh:
        """The whole stage in the plane."""
        return self.halves[0].mesh

    @property
    def layers(self) -> Layers:
        """Of half the thickness."""
        return self.halves[0].equations.layers

    @property
    def heights(self) -> Array:
        """Heights (2 m - 1,), mm, of the nodes of `through`, from face to face."""
        half = self.layers.heights
        return np.concatenate([-half[:0:-1], half])

    def field(self, number: int) -> Array:
        """Displacements (n, m, 3) of unit modal mass, from the mid-plane to the face, of a mode of the record, from 0.

        Notes
        -----
        Of modes in the plane u and v are even in z and w is odd; out of the plane u and v are odd and w is even.
        """
        kind, at = self.chosen[number]
        return self.halves[kind].field(at)

    def through(self, number: int) -> Array:
        """As `field`, from face to face (n, 2 m - 1, 3)."""
        half = self.field(number)
        sign = np.array([1.0, 1.0, -1.0]) * (-1.0 if self.chosen[number][0] else 1.0)
        return np.concatenate([sign * half[:, :0:-1], half], axis=1)


class HalfFrequencies(NamedTuple):
    """Of one half: modes on the finest mesh; frequencies, Hz, with one layer (3 meshes, k), and by layers (2, k)."""

    modes: SolidModes
    meshed: Array
    layered: Array


def solid_natural_modes(
    stage: Stage,
    count: int,
    payload: Payload,
    resolution: int,
    layers: int,
    progress: Callable[[str], object] | None = None,
) -> SolidVibration:
    """The lowest modes of a feasible stage in three dimensions, of both kinds together; stacks are left out.

    Raises BadInput, ComputationFailed as `solid.solve_solid` and `modes.modes`.
    """
    meshes = {level: mesh_sectors(stage, level) for level in levels(resolution)}
    loads = carried(stage, payload), carried_out_of_plane(stage, payload)
    found = []
    for name, load, antisymmetric in zip(KINDS, loads, (False, True), strict=True):
        found.append(_frequencies(stage, meshes, layers, load, antisymmetric, count))
        if progress is not None:
            progress(f"{name}: {found[-1].modes.unknowns} unknowns")
    every = np.concatenate([half.modes.frequencies for half in found])
    order = [divmod(int(k), count) for k in np.argsort(every, kind="stable")]
    flat = _in_plane_stress(stage, found[0].modes, loads[0], count)
    said = [[_mode(resolution, half, kind, k) for k in range(count)] for kind, half in zip(KINDS, found, strict=True)]
    said[0] = [one.model_copy(update={"plane_stress": value}) for one, value in zip(said[0], flat, strict=True)]
    halves = (found[0].modes, found[1].modes)
    modes_of = [said[kind][k] for kind, k in order[:count]]
    return SolidVibration(halves, order[:count], _record(stage, payload, resolution, halves, modes_of, said[1][0]))


def _frequencies(
    stage: Stage,
    meshes: dict[int, tuple[Sector, ...]],
    layers: int,
    load: Array,
    antisymmetric: bool,
    count: int,
) -> HalfFrequencies:
    """Modes of one half, and frequencies on what bounds them."""
    plate, density = sheet_of(stage), stage.material.density * DENSITY

    def solved(level: int, number: int) -> SolidModes:
        return solid_modes(meshes[level], plate, layers_of(stage, number, antisymmetric), density, load, count)

    finest = max(meshes)
    meshed, layered = coarser(lambda *sizes: solved(*sizes).frequencies * HERTZ, finest, layers)
    return HalfFrequencies(solved(finest, layers), np.array(meshed), np.array(layered))


def _mode(resolution: int, of: HalfFrequencies, kind: Kind, k: int) -> SolidMode:
    """One mode with its bands, as shares of the frequency on the meshes that they are from."""
    mesh, (few, many) = uncertainty(resolution, of.meshed[:, k].tolist()), of.layered[:, k].tolist()
    found = float(of.modes.frequencies[k] * HERTZ)
    plane, thickness = found * mesh.band / mesh.values[-1], found * SAFETY * abs(many - few) / many
    percent = (100 * of.modes.participation[k] ** 2 / np.diag(of.modes.total)).tolist()
    names = ("x", "y", "theta") if kind == KINDS[0] else ("z", "tilt_x", "tilt_y")
    return SolidMode(
        kind=kind,
        frequency=found,
        band=plane + thickness,
        band_plane=plane,
        band_thickness=thickness,
        mesh=mesh,
        by_layers=(few, many),
        share=BaseShares(**dict(zip(names, percent, strict=True))),
        plane_stress=None,
    )


def _in_plane_stress(stage: Stage, of: SolidModes, load: Array, count: int) -> list[float | None]:
    """Frequencies, Hz, in plane stress of the shapes that the mid-plane has, by overlap; on the same mesh."""
    flat = structure(of.mesh, sheet_of(stage), stage.material.density * DENSITY, tie_hub(of.mesh), load)
    solved = modes(flat, count)
    found: list[float | None] = []
    for k in range(count):
        mid = np.concatenate([of.field(k)[flat.tied.free, 0, :2].ravel(), of.shapes[0, -3:, k]])
        inertia = flat.mass @ mid
        overlap = np.abs(solved.shapes.T @ inertia) / np.sqrt(mid @ inertia)
        best = int(np.argmax(overlap))
        found.append(float(solved.frequencies[best] * HERTZ) if overlap[best] > SAME_SHAPE else None)
    return found


def _record(
    stage: Stage,
    payload: Payload,
    resolution: int,
    halves: tuple[SolidModes, SolidModes],
    chosen: list[SolidMode],
    first: SolidMode,
) -> SolidNaturalModes:
    flat, tilting = halves
    layers = flat.equations.layers
    return SolidNaturalModes(
        **about(stage),
        name=stage.name,
        resolution=resolution,
        layers=layers.number,
        heights=layers.heights[::2].tolist(),
        triangles=len(flat.mesh.triangles),
        unknowns=(flat.unknowns, tilting.unknowns),
        **masses(stage, payload, flat.total),
        tilting_inertia=(float(tilting.total[1, 1] * KILOGRAM), float(tilting.total[2, 2] * KILOGRAM)),
        payload_tilting=payload.tilting * KILOGRAM,
        modes=chosen,
        first_out_of_plane=first,
        warnings=[*warning.of_numbers(stage), *held_faces(stage), *([AT_ITS_PLACE] if any(payload) else [])],
    )
