"""`flexfem drift --three-dimensional`: the extruded stage that warms, also by a gradient through its thickness.

Stage and frame have the same temperature at every place. The change is linear in X, Y and Z about the platform's centre
in the mid-plane, where a free body would stay at rest: displacements out of the plane are those against the frame as it
bows there. The material is the metal's own and both faces are free, whatever plane problem a stage's `model` says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.heat import CORNER, edge_maxima, heat_response, largest_within
from flexfem.fem.layers import layers_of
from flexfem.fem.mesh import StageMesh
from flexfem.fem.sectors import Sector, mesh_sectors
from flexfem.fem.solid import sheet_of
from flexfem.fem.solid_fields import solid_neck_stresses, solid_nodal_stress, solid_von_mises
from flexfem.fem.solid_heat import WarmHalf, free_solid, warm_half
from flexfem.mechanism.stage import Stage
from flexfem.verify.corners import pose_bands
from flexfem.verify.drift import expansion_of, frame_expansion_of, sources_of, warnings_of
from flexfem.verify.errors import ROUND_OFF, SAFETY, levels
from flexfem.verify.result import Matrix, OfStage, Record, about
from flexfem.verify.solid import coarser, held_faces

SolidCase: TypeAlias = Literal["uniform", "gradient in x", "gradient in y", "gradient in z"]
CASES: tuple[SolidCase, ...] = get_args(SolidCase)
LEAST_RESOLUTION = 6  # on 4 triangles across a neck bands left out the z of 2 of 4 stages: meshes agreed by chance
PLACES = ((0, 2), (0, 0), (0, 1), (1, 2))  # of each case: mirror half, and its place among the three of `WarmHalf`


class SolidDriftCase(Record):
    """One case, per kelvin or per K/mm; (3,) each, and (3 chains, 3).

    pose : mm, mm, rad, x, y, theta; of a gradient in z mm, rad, rad, z and the rotations about x and y.
    band : the sum of `band_plane`, of the mesh in the plane, and `band_thickness`, of the layers.
    stress : largest von Mises stress at each neck, MPa.
    edges : (3 chains,), the same on the clamped face of each pad but for `heat.CORNER` of its length and of the half
        thickness along its borders, where stress has no bound.
    plane_stress : pose in plane stress on the same mesh of the plane; None of a gradient in z.
    """

    pose: list[float]
    band: list[float]
    band_plane: list[float]
    band_thickness: list[float]
    stress: Matrix
    plane_stress: list[float] | None
    edges: list[float] | None = None


class SolidDrift(OfStage):
    """What `flexfem drift --three-dimensional` answers.

    expansion, frame_expansion : coefficients, 1/K.   lever : l3, mm, which makes rotations comparable.
    sources : where both come from, by key path; None where that is not stated.
    layers : in half the thickness.   heights : mm, their bounds above the mid-plane.
    unknowns : of the whole stage, in the plane and out of it.
    """

    name: str
    expansion: float
    frame_expansion: float
    sources: dict[str, str | None]
    lever: float
    resolution: int
    layers: int
    heights: list[float]
    triangles: int
    unknowns: tuple[int, int]
    cases: dict[SolidCase, SolidDriftCase]


class SolidDriftFields(NamedTuple):
    """The record and both mirror halves, answers per unit of the frame's expansion beyond the metal's."""

    stage: Stage
    halves: tuple[WarmHalf, WarmHalf]
    record: SolidDrift

    @property
    def mesh(self) -> StageMesh:
        """The whole stage in the plane."""
        return self.halves[0].mesh

    @property
    def heights(self) -> Array:
        """Heights (m,), mm, of the nodes, from the mid-plane to the face."""
        return self.halves[0].layers.heights

    def field(self, case: SolidCase) -> tuple[Array, Array]:
        """Displacement (n, m, 3), mm, and von Mises stress (n, m), MPa, per kelvin or per K/mm."""
        kind, at = PLACES[CASES.index(case)]
        half, plate = self.halves[kind], sheet_of(self.stage)
        beyond = (self.record.frame_expansion - self.record.expansion) * half.fields[at]
        stress = solid_nodal_stress(self.mesh, plate, half.layers, beyond, np.arange(len(self.mesh.nodes)))
        free = free_solid(self.mesh.nodes, half.layers)[at]
        return self.record.expansion * free + beyond, solid_von_mises(stress)


class _Solved(NamedTuple):
    """One half on the finest mesh, and the bands (3, 3 cases) of its pose by mesh and by layers."""

    half: WarmHalf
    plane: Array
    thickness: Array


def solid_drift(
    stage: Stage, resolution: int, layers: int, progress: Callable[[str], object] | None = None
) -> SolidDriftFields:
    """What changes of temperature do to a feasible stage in three dimensions, per kelvin and per K/mm.

    Raises BadInput for a stage without a coefficient of expansion, ComputationFailed as `solid.solve_solid`.
    """
    expansion_of(stage)
    metal, frame = float(stage.material.expansion or 0.0), frame_expansion_of(stage)
    meshes = {level: mesh_sectors(stage, level) for level in levels(resolution)}
    found = []
    for name, antisymmetric in (("in the plane", False), ("out of the plane", True)):
        found.append(_solved(stage, meshes, layers, antisymmetric))
        if progress is not None:
            progress(f"{name}: {found[-1].half.unknowns} unknowns")
    flat, through = found[0].half, found[1].half
    sheet = heat_response(flat.mesh, sheet_of(stage), metal, frame).pose
    record = SolidDrift(
        **about(stage) | {"hash": stage.heat_hash} | stage.heat_doubts._asdict(),
        name=stage.name,
        expansion=metal,
        frame_expansion=frame,
        sources=sources_of(stage),
        lever=stage.chain.link_lengths[2],
        resolution=resolution,
        layers=layers,
        heights=flat.layers.heights[::2].tolist(),
        triangles=len(flat.mesh.triangles),
        unknowns=(flat.unknowns, through.unknowns),
        cases={
            name: _case(stage, found[kind], at, frame - metal, None if kind else sheet[:, k].tolist())
            for k, (name, (kind, at)) in enumerate(zip(CASES, PLACES, strict=True))
        },
        warnings=[*warnings_of(stage), *held_faces(stage)],
    )
    return SolidDriftFields(stage, (flat, through), record)


def _case(stage: Stage, of: _Solved, at: int, beyond: float, sheet: list[float] | None) -> SolidDriftCase:
    """One case; `beyond` is the frame's expansion less the metal's, 1/K."""
    plane, thickness = abs(beyond) * of.plane[:, at], abs(beyond) * of.thickness[:, at]
    stress = solid_neck_stresses(stage, sheet_of(stage), of.half, beyond * np.eye(3)[[at]]).highest[0]
    return SolidDriftCase(
        pose=(beyond * of.half.pose[:, at]).tolist(),
        band=(plane + thickness).tolist(),
        band_plane=plane.tolist(),
        band_thickness=thickness.tolist(),
        stress=stress.tolist(),
        plane_stress=sheet,
        edges=_clamped(stage, of.half, beyond * of.half.fields[at]),
    )


def _clamped(stage: Stage, half: WarmHalf, field: Array) -> list[float]:
    """As `SolidDriftCase.edges`, of displacements (n, m, 3) beyond those of free metal."""
    ground, heights = np.unique(half.mesh.edges["ground"]), half.layers.heights
    stress = np.zeros(field.shape[:2])
    stress[ground] = solid_von_mises(solid_nodal_stress(half.mesh, sheet_of(stage), half.layers, field, ground))
    highest = edge_maxima(half.mesh, stress)
    return [float(each) for each in largest_within(heights / heights[-1], highest.T, 0.0, 1 - CORNER)]


def _solved(stage: Stage, meshes: dict[int, tuple[Sector, ...]], layers: int, antisymmetric: bool) -> _Solved:
    """Solve one half, and bound it as `solid.solid_bands`.

    Notes
    -----
    A frame that expands otherwise strains the clamped faces most at their corners, where stress has no bound: poses
    converge by twice its exponent (M. L. Williams, J. Appl. Mech. 19 (1952) 526), far slower than compliances. With the
    order of these, meshes of 3, 4 and 6 triangles across a neck left out 2 of 16 poses of four stages on 9.
    """

    def solved(level: int, number: int) -> WarmHalf:
        return warm_half(meshes[level], sheet_of(stage), layers_of(stage, number, antisymmetric))

    finest, lever = max(meshes), stage.chain.link_lengths[2]
    scale = np.array([1.0, lever, lever] if antisymmetric else [1.0, 1.0, lever])[:, None]
    meshed, layered = coarser(lambda *sizes: scale * solved(*sizes).pose, finest, layers)
    plane = pose_bands(np.array(list(meshes), dtype=float), np.array(meshed), 1.0)
    return _Solved(solved(finest, layers), plane / scale, layer_bands(*layered) / scale)


def layer_bands(few: Array, many: Array) -> Array:
    """Half-widths (3, cases) by the layers of poses (3, cases), all mm, by fewer and by more.

    Notes
    -----
    The largest change of a case's components bounds all of them, times `SAFETY`; what is round-off by both has the
    larger of its values.
    """
    largest = np.maximum(np.abs(few), np.abs(many))
    common = SAFETY * np.max(np.abs(many - few), axis=0)
    return np.asarray(np.where(largest <= ROUND_OFF * np.max(largest, axis=0), largest, common))
