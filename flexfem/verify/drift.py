"""`flexfem drift`: what one kelvin, and gradients of one kelvin per mm, do to a stage, by both models.

Stage and frame have the same temperature at every place, linear in X and Y, the change at the platform's centre and
gradients about it; through the thickness it is uniform. The frame is not stressed by the stage. A frame of the stage's
own metal leaves the stage at rest under all of this: all answers are proportional to the difference of the two
coefficients. In plane strain the faces are held at the expansion of the frame.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np

from flexfem.analytic.chains import von_mises_along
from flexfem.analytic.heat import drift as analytic_drift
from flexfem.analytic.kinematics import freedoms_of, stage_freedoms
from flexfem.analytic.links import body_compliance
from flexfem.analytic.model import hinge_compliance
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array
from flexfem.fem.heat import HeatResponse, heat_response
from flexfem.fem.mesh import StageMesh
from flexfem.fem.plane_stress import von_mises
from flexfem.fem.response import neck_maxima, out_of_plane_ratio_of, plate_of
from flexfem.fem.sectors import build_mesh
from flexfem.files.provenance import key_paths, provenance_of
from flexfem.refused import BadInput
from flexfem.stage.designs import lower, stage_frames
from flexfem.stage.origin import located
from flexfem.stage.schema import HINGE_NAMES, Stage
from flexfem.verify import warning
from flexfem.verify.driven_models import best_model
from flexfem.verify.errors import CAUTIOUS, ORDER, ROUND_OFF, levels
from flexfem.verify.result import Matrix, OfStage, Record, about

Case: TypeAlias = Literal["uniform", "gradient in x", "gradient in y"]
CASES: tuple[Case, ...] = get_args(Case)
UNLIKE = 10.0  # per cent by which the necks of chain 1 are wider, and narrower, where chains are made unlike
MISSING = "expected um/(m K), the coefficient of linear thermal expansion (aluminium 23.6)"


class Expansion(NamedTuple):
    """In-plane expansion of stage and frame, and stress across the plane, MPa, where nothing strains: per kelvin."""

    stage: float
    frame: float
    across: float


class WarmStage(Record):
    """What one case does, per kelvin or per K/mm; each (3,) or (3 chains, 3).

    pose : mm, mm, rad.   stress : largest von Mises stress at each neck, MPa.
    reaction : of the ground on each pad, about the platform's centre, N, N, N mm.
    """

    pose: list[float]
    stress: Matrix
    reaction: Matrix


class DriftCase(Record):
    """Both models under one change of temperature: per kelvin, per K/mm.

    analytic, elements : see `WarmStage`; elements None without them.   band : (3,), half-widths of the pose by meshes.
    unlike : (3,), pose with the necks of chain 1 wider or narrower by `UNLIKE` per cent, that which moves further in X
        and Y, by the analytic model; None where chains are not alike as they are.
    """

    analytic: WarmStage
    elements: WarmStage | None
    band: list[float] | None
    unlike: list[float] | None


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


def drift(stage: Stage, model: tuple[int | None, str, bool] | None = None, resolution: int | None = None) -> Drift:
    """What changes of temperature do to a stage, per kelvin and per K/mm.

    Parameters
    ----------
    model : mobility, formula, elastic links; None as of `command`.
    resolution : of the finest of three meshes of finite elements; None leaves them out.

    Raises BadInput for a stage without a coefficient of expansion.
    """
    alpha = expansion_of(stage)
    warnings = list(warning.of_numbers(stage))
    mobility, formula, links = model or best_model(stage, warnings)
    metal = None if resolution is None else _elements(stage, alpha, resolution)
    found = analytic(stage, alpha, mobility, formula, links)
    unlike = _unlike(stage, mobility, formula, links)
    cases = {
        name: DriftCase(
            analytic=found[k],
            elements=None if metal is None else metal[k][0],
            band=None if metal is None else metal[k][1].tolist(),
            unlike=None if unlike is None else unlike[k],
        )
        for k, name in enumerate(CASES)
    }
    if stage.frame.expansion is None:
        warnings.append("frame.expansion_um_per_m_k is not stated: the frame is taken to expand as the stage does")
    if stage.actuator:
        warnings.append("the stacks, their preloads and their own expansion are left out")
    freedom = f"mobility {stage.mobility if mobility is None else mobility}"
    return Drift(
        **about(stage) | {"hash": stage.heat_hash} | stage.heat_doubts._asdict(),
        name=stage.name,
        model=f"{formula}, {'elastic links' if links else freedom}",
        expansion=float(stage.material.expansion or 0.0),
        frame_expansion=frame_expansion_of(stage),
        sources=_sources(stage),
        lever=stage.chain.link_lengths[2],
        resolution=resolution,
        cases=cases,
        warnings=warnings,
    )


def frame_expansion_of(stage: Stage) -> float:
    """Coefficient of the frame, 1/K: the stage's where none is stated."""
    own = stage.material.expansion if stage.frame.expansion is None else stage.frame.expansion
    return float(own or 0.0)


def expansion_of(stage: Stage) -> Expansion:
    """What the plane problem of a stage sees of its expansion. Raises BadInput when it is not stated."""
    if stage.material.expansion is None:
        with located(stage):
            raise BadInput(f"material.expansion_um_per_m_k is missing, {MISSING}")
    metal, frame = float(stage.material.expansion), frame_expansion_of(stage)
    if stage.model != "plane_strain":
        return Expansion(metal, frame, 0.0)
    E, nu = stage.material.youngs_modulus, stage.material.poissons_ratio
    return Expansion(metal + nu * (metal - frame), frame, E * (frame - metal))  # held at the frame's strain across


def analytic(stage: Stage, alpha: Expansion, mobility: int | None, formula: str, links: bool) -> list[WarmStage]:
    """The three cases by the pseudo-rigid model. Raises BadInput as `model.analyse`."""
    if links and mobility not in (None, 21):
        raise BadInput(f"links with mobility {mobility}, expected 21 or None: elastic links go with all freedoms")
    design = lower(stage)
    own = mobility is None and not links
    freedoms = stage_freedoms(design.prismatic) if own else freedoms_of(21 if mobility is None else mobility)
    hinges = Compliance(*(np.asarray(part)[None] for part in hinge_compliance(stage, formula)))
    rates = (np.array([alpha.stage]), np.array([alpha.frame]))
    found = analytic_drift(design, hinges, freedoms, *rates, body_compliance(stage)[None] if links else None)
    pose, reaction, stress = (part[0] for part in found)
    along = stress / von_mises_along(design.out_of_plane)[0]
    centres, pull = stage_frames(stage).centres, float(design.out_of_plane[0])
    zz = alpha.across * np.concatenate([np.ones((3, 3, 1)), centres], axis=-1)
    stress = np.max([np.sqrt(s**2 - s * z + z**2) for s in (along, -along) for z in (pull * s + zz,)], axis=0)
    return [
        WarmStage(pose=pose[:, k].tolist(), stress=stress[..., k].tolist(), reaction=reaction[..., k].tolist())
        for k in range(3)
    ]


def _elements(stage: Stage, alpha: Expansion, resolution: int) -> list[tuple[WarmStage, Array]]:
    """The three cases by finite elements, with the bands (3,) of their poses."""
    steps, plate = levels(resolution), plate_of(stage)
    made: list[tuple[StageMesh, HeatResponse]] = []
    for level in steps:
        mesh = build_mesh(stage, level)
        made.append((mesh, heat_response(mesh, plate, alpha.stage, alpha.frame)))
    mesh, finest = made[-1]
    bands = pose_bands(np.array(steps, dtype=float), np.array([r.pose for _, r in made]), stage.chain.link_lengths[2])
    warm = np.concatenate([np.ones((len(mesh.nodes), 1)), mesh.nodes], axis=1)
    found = []
    for k in range(3):
        stress = von_mises(finest.stress[k], out_of_plane_ratio_of(stage), alpha.across * warm[:, k])
        one = WarmStage(
            pose=finest.pose[:, k].tolist(),
            stress=neck_maxima(stage, mesh, stress).tolist(),
            reaction=finest.reactions[k].tolist(),
        )
        found.append((one, bands[:, k]))
    return found


def pose_bands(resolutions: Array, poses: Array, lever: float) -> Array:
    """Half-widths (3, cases) of the mesh uncertainty of poses (levels, 3, cases) on three meshes, coarse to fine.

    Notes
    -----
    Both differences between the meshes are taken to the finest by the theoretical order; the larger, with the safety
    factor of that order, bounds every component, rotations with the lever. One that is round-off on every mesh has the
    largest of its values.
    """
    scale = np.array([1.0, 1.0, lever])[:, None]
    scaled, (n3, n2, n1) = poses * scale, resolutions**ORDER
    errors = (scaled[2] - scaled[1]) / (n1 / n2 - 1), (scaled[1] - scaled[0]) / (n1 / n3 - n1 / n2)
    common = CAUTIOUS * np.max(np.abs(errors), axis=(0, 1))
    largest = np.max(np.abs(scaled), axis=0)
    silent = largest <= ROUND_OFF * np.max(largest, axis=0)
    return np.asarray(np.where(silent, largest, common) / scale)


def _unlike(stage: Stage, mobility: int | None, formula: str, links: bool) -> list[list[float]] | None:
    """Poses (3,) of the three cases with the necks of chain 1 changed, those further off; None where chains differ."""
    if not stage.chains_alike:
        return None
    found = []
    for change in (1 + UNLIKE / 100, 1 - UNLIKE / 100):
        necks = {(1, name): {"neck": change * stage.hinge(1, name).neck} for name in HINGE_NAMES}
        try:
            other = stage.replace(override=necks)
            found.append(analytic(other, expansion_of(other), mobility, formula, links))
        except BadInput:  # a neck as wide as its link, or off the chart
            continue
    if not found:
        return None
    return [max((one[k].pose for one in found), key=lambda pose: float(np.hypot(pose[0], pose[1]))) for k in range(3)]


def _sources(stage: Stage) -> dict[str, str | None]:
    """Where both coefficients come from."""
    keys, stated = ("material.expansion_um_per_m_k", "frame.expansion_um_per_m_k"), key_paths(stage)
    return {key: provenance_of(stage, key) if key in stated else None for key in keys}
