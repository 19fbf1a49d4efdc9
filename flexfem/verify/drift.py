"""`flexfem drift`: what one kelvin, and gradients of one kelvin per mm, do to a stage, by both models.

Stage and frame have the same temperature at every place, linear in X and Y, the change at the platform's centre and
gradients about it; through the thickness it is uniform. The frame is not stressed by the stage. A frame of the stage's
own metal leaves the stage at rest under all of this: all answers are proportional to the difference of the two
coefficients. In plane strain the faces are held at the expansion of the frame.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance, edge_motions
from flexfem.analytic.model import ModelChoice, choose, hinge_compliance
from flexfem.analytic.paper import freedoms_of, stage_freedoms
from flexfem.analytic.responses import WarmBodies, in_plane, require_expansion
from flexfem.analytic.responses import drift as analytic_drift
from flexfem.arrays import Array, Index
from flexfem.fem.heat import HeatResponse, edge_maxima, heat_response
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import von_mises
from flexfem.fem.response import neck_maxima, out_of_plane_ratio_of, plate_of
from flexfem.fem.sectors import build_mesh
from flexfem.hinges.formulas import Compliance
from flexfem.hinges.strength import von_mises_along
from flexfem.mechanism.designs import lower, stage_frames
from flexfem.mechanism.stage import CHAINS, HINGE_NAMES, Stage
from flexfem.mechanism.stage_file import located
from flexfem.refused import BadInput
from flexfem.verify import warning
from flexfem.verify.corners import corner_bands, pose_bands
from flexfem.verify.errors import levels
from flexfem.verify.result import Fields, Matrix, OfStage, Record, about

Case: TypeAlias = Literal["uniform", "gradient in x", "gradient in y"]
CASES: tuple[Case, ...] = get_args(Case)
UNLIKE = 10.0  # per cent by which necks of some chains are wider, or narrower, where chains are made unlike
_MORE, _LESS = 1 + UNLIKE / 100, 1 - UNLIKE / 100
UNLIKE_CHAINS = {  # factors on the necks of each chain; stated before anything was measured with them
    "wider in one chain": (_MORE, 1.0, 1.0),
    "narrower in one": (_LESS, 1.0, 1.0),
    "wider in one and narrower in another": (_MORE, _LESS, 1.0),
}


class Expansion(NamedTuple):
    """In-plane expansion of stage and frame, and stress across the plane, MPa, where nothing strains: per kelvin."""

    stage: float
    frame: float
    across: float


class WarmStage(Record):
    """What one case does, per kelvin or per K/mm; each (3,) or (3 chains, 3).

    pose : mm, mm, rad.   stress : largest von Mises stress at each neck, MPa.
    edges : (3 chains,), the same along the clamped edge of each pad but for `CORNER` of its length at both corners,
        where stress has no bound; None by the analytic model, which does not have it.
    reaction : of the ground on each pad, about the platform's centre, N, N, N mm.
    """

    pose: list[float]
    stress: Matrix
    reaction: Matrix
    edges: list[float] | None = None


class DriftCase(Record):
    """Both models under one change of temperature: per kelvin, per K/mm.

    analytic, elements : see `WarmStage`; elements None without them.   band : (3,), half-widths of the pose by meshes.
    edge_band : the same of the largest of the elements' `edges`, MPa.
    unlike : (3,), pose with necks of some chains wider or narrower, that of `UNLIKE_CHAINS` which moves furthest in X
        and Y, by the analytic model; None where chains are not alike as they are.
    """

    analytic: WarmStage
    elements: WarmStage | None
    band: list[float] | None
    unlike: list[float] | None
    edge_band: float | None = None


class Drift(OfStage):
    """What `flexfem drift` answers.

    expansion, frame_expansion : coefficients, 1/K.   lever : l3, mm, which makes rotations comparable.
    sources : where both come from, by key path; None where that is not stated.
    """

    name: str
    model: str
    expansion: float
    frame_expansion: float
    sources: dict[str, str | None]
    lever: float
    resolution: int | None
    cases: dict[Case, DriftCase]


class DriftFields(NamedTuple):
    """The record, and by case the fields of the finest mesh per kelvin or per K/mm; none without finite elements.

    ground : (k, 3), edges of the mesh that the frame carries.   hub_radius : mm, of the disc that grows freely.
    """

    record: Drift
    fields: dict[Case, Fields]
    ground: Index
    hub_radius: float


def drift(
    stage: Stage, model: tuple[int | None, str, bool] | None = None, resolution: int | None = None
) -> DriftFields:
    """What changes of temperature do to a stage, per kelvin and per K/mm.

    Parameters
    ----------
    model : mobility, formula, elastic links; None as of `command`.
    resolution : of the finest of three meshes of finite elements; None leaves them out.

    Raises BadInput for a stage without a coefficient of expansion.
    """
    alpha = expansion_of(stage)
    warnings = warnings_of(stage)
    chosen = choose(stage, model, warnings)
    metal = None if resolution is None else _elements(stage, alpha, resolution)
    found, unlike = analytic(chosen, alpha), _unlike(chosen)
    cases = {
        name: DriftCase(
            analytic=found[k],
            elements=None if metal is None else metal[k].found,
            band=None if metal is None else metal[k].band.tolist(),
            unlike=None if unlike is None else unlike[k],
            edge_band=None if metal is None else metal[k].edge_band,
        )
        for k, name in enumerate(CASES)
    }
    record = Drift(
        **about(stage) | {"hash": stage.heat_hash} | stage.heat_doubts._asdict(),
        name=stage.name,
        model=chosen.name,
        expansion=float(stage.material.expansion or 0.0),
        frame_expansion=frame_expansion_of(stage),
        sources=sources_of(stage),
        lever=stage.chain.link_lengths[2],
        resolution=resolution,
        cases=cases,
        warnings=warnings,
    )
    fields = {} if metal is None else {name: metal[k].fields for k, name in enumerate(CASES)}
    ground = np.empty((0, 3), dtype=np.int64) if metal is None else metal[0].ground
    return DriftFields(record, fields, ground, stage.platform.hub_radius)


def warnings_of(stage: Stage) -> list[str]:
    """What is assumed, and left out."""
    warnings = list(warning.of_numbers(stage))
    if stage.frame.expansion is None:
        warnings.append("frame.expansion_um_per_m_k is not stated: the frame is taken to expand as the stage does")
    return warnings + warning.of_stacks(stage)


def frame_expansion_of(stage: Stage) -> float:
    """Coefficient of the frame, 1/K: the stage's where none is stated."""
    own = stage.material.expansion if stage.frame.expansion is None else stage.frame.expansion
    return float(own or 0.0)


def expansion_of(stage: Stage) -> Expansion:
    """What the plane problem of a stage sees of its expansion. Raises BadInput when it is not stated."""
    with located(stage):
        require_expansion(stage)
    (plane,), (frame,) = in_plane(lower(stage))
    free = frame - float(stage.material.expansion or 0.0)
    across = stage.material.youngs_modulus * free if stage.model == "plane_strain" else 0.0  # held at the frame's
    return Expansion(float(plane), float(frame), across)


def analytic(chosen: ModelChoice, alpha: Expansion) -> list[WarmStage]:
    """The three cases by the pseudo-rigid model. Raises BadInput as `model.analyse`."""
    stage, mobility, formula, links = chosen
    if links and mobility not in (None, 21):
        raise BadInput(f"links with mobility {mobility}, expected 21 or None: elastic links go with all freedoms")
    design = lower(stage)
    own = mobility is None and not links
    freedoms = stage_freedoms(design.prismatic) if own else freedoms_of(21 if mobility is None else mobility)
    hinges = Compliance(*(np.asarray(part)[None] for part in hinge_compliance(stage, formula)))
    rates = (np.array([alpha.stage]), np.array([alpha.frame]))
    bodies = WarmBodies(body_compliance(stage)[None], edge_motions(stage)[None]) if links else None
    found = analytic_drift(design, hinges, freedoms, *rates, bodies)
    pose, reaction, stress = (part[0] for part in found)
    along = stress / von_mises_along(design.out_of_plane)[0]
    centres, pull = stage_frames(stage).centres, float(design.out_of_plane[0])
    zz = alpha.across * np.concatenate([np.ones((3, 3, 1)), centres], axis=-1)
    stress = np.max([np.sqrt(s**2 - s * z + z**2) for s in (along, -along) for z in (pull * s + zz,)], axis=0)
    return [
        WarmStage(pose=pose[:, k].tolist(), stress=stress[..., k].tolist(), reaction=reaction[..., k].tolist())
        for k in range(3)
    ]


class _Warm(NamedTuple):
    """One case by finite elements: its answer, the band (3,) of the pose and that of stress at clamped edges, fields
    and clamped edges (k, 3)."""

    found: WarmStage
    band: Array
    edge_band: float
    fields: Fields
    ground: Index


def _elements(stage: Stage, alpha: Expansion, resolution: int) -> list[_Warm]:
    """The three cases by finite elements on three meshes."""
    steps, plate = levels(resolution), plate_of(stage)
    made: list[tuple[StageMesh, HeatResponse]] = []
    for level in steps:
        mesh = build_mesh(stage, level)
        made.append((mesh, heat_response(mesh, plate, alpha.stage, alpha.frame)))
    mesh, finest = made[-1]
    bands = pose_bands(np.array(steps, dtype=float), np.array([r.pose for _, r in made]), stage.chain.link_lengths[2])
    found = []
    for k in range(3):
        stresses = [_warm_stress(stage, alpha, *each, k) for each in made]
        edges, stress = [edge_maxima(of[0], each) for of, each in zip(made, stresses, strict=True)], stresses[-1]
        edge_band = corner_bands(np.array(steps, dtype=float), np.array([np.max(each) for each in edges]))
        one = WarmStage(
            pose=finest.pose[:, k].tolist(),
            stress=neck_maxima(stage, mesh, stress).tolist(),
            reaction=finest.reactions[k].tolist(),
            edges=edges[-1].tolist(),
        )
        drawn = (mesh.nodes, mesh.triangles, mesh.bodies, finest.fields[k], stress)
        fields = Fields(**dict(zip(Fields.model_fields, drawn, strict=True)))
        found.append(_Warm(one, bands[:, k], float(edge_band), fields, mesh.edges["ground"]))
    return found


def _warm_stress(stage: Stage, alpha: Expansion, mesh: StageMesh, response: HeatResponse, case: int) -> Array:
    """Von Mises stress (n,) at the nodes by one case, MPa."""
    warm = np.concatenate([np.ones((len(mesh.nodes), 1)), mesh.nodes], axis=1)[:, case]
    return von_mises(response.stress[case], out_of_plane_ratio_of(stage), alpha.across * warm)


def _unlike(chosen: ModelChoice) -> list[list[float]] | None:
    """Poses (3,) of the three cases with chains made unlike, those furthest off; None where chains differ."""
    stage = chosen.stage
    if not stage.chains_alike:
        return None
    found = []
    for factors in UNLIKE_CHAINS.values():
        necks = {
            (chain, name): {"neck": factor * stage.hinge(chain, name).neck}
            for chain, factor in zip(CHAINS, factors, strict=True)
            for name in HINGE_NAMES
        }
        try:
            other = stage.replace(override=necks)
            found.append(analytic(chosen._replace(stage=other), expansion_of(other)))
        except BadInput:  # a neck as wide as its link, or off the chart
            continue
    if not found:
        return None
    return [max((one[k].pose for one in found), key=lambda pose: float(np.hypot(pose[0], pose[1]))) for k in range(3)]


def sources_of(stage: Stage) -> dict[str, str | None]:
    """Where both coefficients come from."""
    sources = stage.sources
    return {key: sources.get(key) for key in ("material.expansion_um_per_m_k", "frame.expansion_um_per_m_k")}
