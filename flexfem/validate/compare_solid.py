"""Our answer in three dimensions and another solver's, on the same wedges: compliance and natural frequencies."""

from __future__ import annotations

import time

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.layers import layers_of
from flexfem.fem.sectors import Sector, mesh_sectors, welded
from flexfem.fem.solid import DEGREE, sheet_of
from flexfem.fem.solid_modes import solid_modes
from flexfem.fem.solid_response import solid_response
from flexfem.mechanism.bodies import Payload, carried, carried_out_of_plane
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.units import DENSITY
from flexfem.validate import frequencies, prisms, solids
from flexfem.validate.calculix import DIGITS
from flexfem.validate.compare import SOLVERS, CrossCheck, about, pose_difference
from flexfem.validate.records import Check
from flexfem.validate.solids import SolidAnswer

HALVES = ("in plane", "out of plane")
RESOLUTION, LAYERS = 2, 2  # the algebra does not care, and other solvers take a minute for more
NGSOLVE = 1e-8
FULL = 12  # degree of our quadrature; frequencies of one layer on the tests' stage: 4 leaves 4e-7, 8 5e-8, 12 1e-10


def cross_check_solid(stage: Stage, resolution: int = RESOLUTION, solver: str = "ngsolve") -> CrossCheck:
    """As `compare.cross_check`, in three dimensions: by NGSolve's quadratic prisms or CalculiX's wedges of 15 nodes.

    Notes
    -----
    NGSolve's prisms are our wedges; CalculiX's are the part of ours that `solids.ours_by_fifteen` takes. Natural
    frequencies are those of both halves, motion in the plane and antisymmetric motion out of it.
    """
    if solver not in list(SOLVERS):
        raise BadInput(f"solver {solver!r}, expected one of {', '.join(SOLVERS)}")
    SOLVERS[solver][0]()
    check_feasible(stage)
    sectors, plate, layers = mesh_sectors(stage, resolution), sheet_of(stage), layers_of(stage, LAYERS)
    mesh, started = welded(sectors)[0], time.perf_counter()
    shipped = solid_response(sectors, plate, layers)
    seconds, lever = time.perf_counter() - started, stage.chain.link_lengths[2]
    hertz, of = solid_frequencies(stage, sectors), frequencies.vibrating(stage, mesh)._replace(plate=plate)
    started = time.perf_counter()
    if solver == "ngsolve":
        theirs, allowed = prisms.solve(of, layers), NGSOLVE
        their_seconds, what = time.perf_counter() - started, "ours by default quadrature"
        ours = SolidAnswer(
            solid_response(sectors, plate, layers, FULL).compliance, solid_frequencies(stage, sectors, FULL)
        )
    else:
        theirs, allowed = solids.by_calculix(of, layers), DIGITS
        their_seconds, what = time.perf_counter() - started, "ours by wedges of 18 nodes"
        ours = solids.ours_by_fifteen(of, layers)
    return CrossCheck(
        **about(stage, solver),
        version=theirs.version,
        triangles=len(mesh.triangles),
        unknowns=shipped.unknowns,
        compliance=ours.compliance,
        their_compliance=theirs.compliance,
        kinds=tuple(kind for kind in HALVES for _ in range(frequencies.COUNT)),
        frequencies=ours.frequencies,
        their_frequencies=theirs.frequencies,
        checks=(
            Check("pose", pose_difference(ours.compliance, theirs.compliance, lever), allowed),
            Check(f"pose, {what}", pose_difference(theirs.compliance, shipped.compliance, lever), None),
            Check("natural frequencies", frequencies.apart(ours.frequencies, theirs.frequencies), allowed),
            Check(f"natural frequencies, {what}", frequencies.apart(theirs.frequencies, hertz), None),
        ),
        seconds=seconds,
        their_seconds=their_seconds,
    )


def solid_frequencies(stage: Stage, sectors: tuple[Sector, ...], degree: int = DEGREE) -> Array:
    """Our frequencies (12,), Hz, the lowest six in the plane and then six out of it, without payload."""
    layers, plate, density = layers_of(stage, LAYERS), sheet_of(stage), stage.material.density * DENSITY
    halves = (layers, carried(stage, Payload())), (layers.antisymmetric, carried_out_of_plane(stage, Payload()))
    count = frequencies.COUNT
    found = [solid_modes(sectors, plate, half, density, load, count, degree).frequencies for half, load in halves]
    return np.concatenate(found) * frequencies.HERTZ
