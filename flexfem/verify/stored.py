"""What is stored of one curve: both models behind it, and the fields at full command."""

from __future__ import annotations

import numpy as np

from flexfem.analytic.model import AnalyticResult
from flexfem.files.provenance import Doubts
from flexfem.mechanism.designs import stage_frames
from flexfem.mechanism.stage import HINGE_NAMES, Stage
from flexfem.questions.case import Curve, LoadedCase
from flexfem.units import DIRECTIONS
from flexfem.verify.imposed import CurveAnswer
from flexfem.verify.result import CurveModels, Fields, HingeDrawing, NeckPeak, Triple


def model_record(loaded: LoadedCase, curve: Curve, analytic: AnalyticResult, of: CurveAnswer) -> CurveModels:
    """Both models behind a curve."""
    stage, strokes = loaded.stages[curve.label], loaded.case.drive == "strokes"
    axis = DIRECTIONS.index(loaded.case.direction)
    doubts = stage.drive_doubts if strokes else Doubts(list(stage.assumed), list(stage.not_stated))
    return CurveModels(
        stage=stage.name,
        file=curve.stage,
        hash=stage.drive_hash if strokes else stage.hash,
        plane=stage.model,
        mobility=analytic.mobility,
        formula=analytic.formula,
        formula_in_range=bool(np.all(analytic.in_range)),
        links=curve.links,
        **doubts._asdict(),
        stiffness=analytic.stiffness.tolist(),
        compliance=of.compliance.tolist(),
        force=of.found.force.tolist(),
        joints=list(of.joints),
        imposed=of.imposed.tolist(),
        neck_stress=of.full.neck_stress.tolist(),
        model_peak=None if of.joints else NeckPeak.of(analytic.stress[..., axis]),
        element_peak=NeckPeak.of(of.full.per_displacement(axis)),
        peak_band=of.peak_band,
        lever=stage.chain.link_lengths[2],
        link_width=stage.chain.link_width,
        platform_radius=stage.platform.radius,
        hub_radius=stage.platform.hub_radius,
        hinges=_hinges(stage, analytic),
        resolution=loaded.case.resolution,
        layers=of.layers,
        band_layers=Triple.of(of.of_layers) if of.layers else None,
        triangles=len(of.mesh.triangles),
        unknowns=of.unknowns,
    )


def _hinges(stage: Stage, analytic: AnalyticResult) -> list[HingeDrawing]:
    placed = stage_frames(stage)
    return [
        HingeDrawing(
            chain=chain + 1,
            hinge=name,
            centre=(float(placed.centres[chain, position, 0]), float(placed.centres[chain, position, 1])),
            axis=float(placed.axes[chain, position]),
            radius=stage.hinge(chain + 1, name).radius,
            neck=stage.hinge(chain + 1, name).neck,
            freedoms=list(analytic.freedoms[chain][position]),
        )
        for chain in range(3)
        for position, name in enumerate(HINGE_NAMES)
    ]


def fields_record(of: CurveAnswer) -> Fields:
    """The finite-element fields of a curve at full command."""
    mesh, full = of.mesh, of.full
    return Fields(
        nodes=mesh.nodes, triangles=mesh.triangles, bodies=mesh.bodies, displacement=full.field, stress=full.stress
    )
