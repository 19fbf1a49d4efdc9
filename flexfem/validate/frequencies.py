"""Natural frequencies of the stage by NGSolve and by CalculiX, on our mesh, with the mass of the hub.

NGSolve's unknowns are displacements x with ground and hub clamped, and the pose q of the hub: `u = x + Psi q`, Psi
being the static answers to unit motions of the hub. Those are orthogonal to x in energy, so the stiffness is block
diagonal, of NGSolve's factor and the stiffness of the platform, and nothing of our own elimination is used. Its
assembled mass and the mass and moment of inertia of a disc go into ARPACK, and the frequencies are quotients of its
energies.

In CalculiX the hub is drawn: triangles from the rim to the centre, all of whose nodes follow the pose, of the sheet's
own density. On the rim's few curved edges that leaves the stage's mass to 6e-7 on the default mesh, to 8e-5 on the
coarsest; ours is solved on the same triangles. Point masses on the nodes of the pose make CalculiX 2.20 stop with an
error. The sheet is the uncoupled one of `calculix`, whose thickness does not answer to the motion; its displacement in
the plane is uniform through the thickness, so that it cannot bend out of the plane. CalculiX integrates the mass, too,
with three points in the plane.
"""

from __future__ import annotations

import math
import re
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from flexfem.arrays import Array
from flexfem.fem.export import write_frequency_deck
from flexfem.fem.mesh import StageMesh
from flexfem.fem.modes import DEGREE, modes, structure
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import plate_of, tie_hub
from flexfem.mechanism.bodies import Payload, carried
from flexfem.mechanism.stage import Stage
from flexfem.refused import ComputationFailed
from flexfem.units import DENSITY, UNITS
from flexfem.validate import calculix, ngsolve
from flexfem.validate.records import Check

COUNT = 6
NGSOLVE = 1e-8  # measured with two triangles across a neck: 2e-11
FULL = 8  # degree of our quadrature; measured with two triangles across a neck: 4 leaves 7e-7 of the pose, 8 2e-12
HERTZ = UNITS["hz"].factor
ROW = re.compile(r"^\s+\d+\s+(\S+)\s+\S+\s+(\S+)\s+\S+\s*$", re.MULTILINE)  # number, eigenvalue, rad/s, Hz, imaginary
TIME_LIMIT = 600.0  # s


class Vibrating(NamedTuple):
    """A sheet with a rigid hub.

    density : tonne/mm^3.   hub_radius : mm, of which NGSolve's mass is made.
    carried : (3, 3), tonne, tonne mm^2, mass matrix of the hub in our equations; zero of a hub that the mesh holds.
    """

    mesh: StageMesh
    plate: Plate
    density: float
    hub_radius: float
    carried: Array

    @property
    def disc(self) -> Array:
        """Mass matrix (3, 3), tonne, tonne mm^2, of the hub as a disc of the sheet."""
        mass = self.density * self.plate.thickness * math.pi * self.hub_radius**2
        return mass * np.diag([1.0, 1.0, self.hub_radius**2 / 2])


class ComparedFrequencies(NamedTuple):
    """The lowest natural frequencies (6,), Hz: ours with their quadrature and hub, and theirs.

    default : (6,), Hz, ours as `flexfem modes` has them.   seconds : of the other solver.
    """

    ours: Array
    theirs: Array
    default: Array
    seconds: float


def ours(of: Vibrating, *degrees: int) -> Array:
    """Our frequencies (6,), Hz, by the quadratures of `modes.structure`, or by those of two degrees."""
    named = {"degrees": degrees} if degrees else {}
    found = structure(of.mesh, of.plate, of.density, tie_hub(of.mesh), of.carried, **named)  # type: ignore[arg-type]
    return modes(found, COUNT).frequencies * HERTZ


def drawn_hub(of: Vibrating) -> Vibrating:
    """The same with the hub's disc as triangles around the origin, whose nodes follow the pose."""
    mesh, n = of.mesh, len(of.mesh.nodes)
    a, b, middle = mesh.edges["hub"].T
    x, y = mesh.nodes.T
    turned = x[a] * y[b] < y[a] * x[b]
    a, b = np.where(turned, b, a), np.where(turned, a, b)
    corners = np.unique([a, b])
    spoke = np.full(n, -1)
    spoke[corners] = n + 1 + np.arange(len(corners))
    disc = np.stack([np.full(len(a), n), a, b, spoke[a], middle, spoke[b]], axis=-1)
    drawn = mesh._replace(
        nodes=np.concatenate([mesh.nodes, np.zeros((1, 2)), mesh.nodes[corners] / 2]),
        triangles=np.concatenate([mesh.triangles, disc]),
        bodies=np.concatenate([mesh.bodies, np.zeros(len(disc), dtype=mesh.bodies.dtype)]),
        edges=mesh.edges | {"hub": np.concatenate([mesh.edges["hub"], disc[:, [0, 1, 3]]])},
    )
    return of._replace(mesh=drawn, carried=np.zeros((3, 3)))


def by_ngsolve(of: Vibrating) -> Array:
    """NGSolve's frequencies (6,), Hz.

    Raises BadInput when NGSolve is not installed, ComputationFailed when its triangles are not ours.
    """
    ng, orders = ngsolve.import_ngsolve(), ngsolve.MORE_ORDERS
    with ng.TaskManager():
        curved = ngsolve.curved_mesh(ng, of.mesh)
        of_hub = ngsolve.rigid_motions(ng, curved, of.mesh, of.plate, orders)
        mass = _mass(ng, of_hub.space, of, orders)

        def energy(mode: Any) -> float:
            return ngsolve.energy_of(ng, mode, mode, of.plate, orders)

        return lowest_of_ngsolve(ng, of_hub, mass, of.disc, energy)


def lowest_of_ngsolve(
    ng: Any, of_hub: ngsolve.RigidMotions, mass: Any, carried: Array, energy: Callable[[Any], float]
) -> Array:
    """Frequencies (6,), Hz, of NGSolve's mass and of what the pose carries (3, 3); energy is twice that of a mode."""
    free = np.flatnonzero(np.array(of_hub.space.FreeDofs()))
    motions = np.stack([motion.vec.FV().NumPy() for motion in of_hub.motions], axis=-1)

    def spread(q: Array) -> Array:
        found = motions @ q[-3:]
        found[free] += q[:-3]
        return np.asarray(found)

    def inertia(q: Array) -> Array:
        forces = _times(mass, spread(q))
        return np.concatenate([forces[free], motions.T @ forces + carried @ q[-3:]])

    def flexibility(q: Array) -> Array:
        inner = np.zeros(len(motions))
        inner[free] = q[:-3]
        pose = np.linalg.solve(of_hub.stiffness, q[-3:])
        return np.concatenate([_times(of_hub.inverse, inner)[free], pose])

    size = len(free) + 3
    M, inverse = (
        LinearOperator((size, size), lambda b, f=f: f(b.ravel()), dtype=float) for f in (inertia, flexibility)
    )
    shapes = eigsh(M, COUNT, M=M, sigma=0.0, OPinv=inverse, v0=np.cos(np.arange(size)))[1]
    squares = []
    for q in shapes.T:
        mode = ng.GridFunction(of_hub.space)
        mode.vec.FV().NumPy()[:] = spread(q)
        squares.append(energy(mode) / (q @ inertia(q)))
    return np.asarray(np.sqrt(np.sort(squares)) / (2 * math.pi))


def _mass(ng: Any, space: Any, of: Vibrating, orders: int) -> Any:
    u, v = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += of.density * of.plate.thickness * ng.InnerProduct(u, v) * ng.dx(bonus_intorder=orders)
    form.Assemble()
    return form.mat


def _times(matrix: Any, vector: Array) -> Array:
    """One of NGSolve's matrices, or inverses, times a vector."""
    given, found = matrix.CreateRowVector(), matrix.CreateColVector()
    given.FV().NumPy()[:] = vector
    found.data = matrix * given
    return np.array(found.FV().NumPy())


def by_calculix(of: Vibrating) -> Array:
    """CalculiX's frequencies (6,), Hz, as printed, of a hub that is drawn.

    Raises BadInput when CalculiX is not installed, ComputationFailed when it fails or is not done in time.
    """
    program = calculix.find_program()
    with tempfile.TemporaryDirectory(prefix="flexfem-") as name:
        folder = Path(name)
        write_frequency_deck(of.mesh, of.plate, folder / "stage.inp", of.density, COUNT)
        said = calculix.run([program, "-i", "stage"], folder, TIME_LIMIT)
        printed = calculix.read(folder / "stage.dat")
    found = printed_frequencies(printed)
    if len(found) != COUNT:
        raise ComputationFailed(f"CalculiX gave no frequencies: {calculix.reason(said)}")
    return found


def printed_frequencies(printed: str) -> Array:
    """Frequencies (k,), Hz, of the first table of eigenvalues in the text of a .dat file.

    Raises ComputationFailed for what are not numbers.
    """
    table = printed.partition("E I G E N V A L U E")[2].partition("P A R T I C I P A T I O N")[0]
    try:
        return np.array([float(hertz) for _, hertz in ROW.findall(table)])
    except ValueError as error:
        raise ComputationFailed(f"CalculiX wrote results that are not numbers: {error}") from None


def against_ngsolve(of: Vibrating) -> ComparedFrequencies:
    """Ours and NGSolve's, both integrated finely."""
    started = time.perf_counter()
    theirs = by_ngsolve(of)
    seconds = time.perf_counter() - started
    return ComparedFrequencies(ours(of, FULL, DEGREE), theirs, ours(of), seconds)


def against_calculix(of: Vibrating) -> ComparedFrequencies:
    """Ours and CalculiX's, both with a hub that is drawn and with its integration."""
    drawn, started = drawn_hub(of), time.perf_counter()
    theirs = by_calculix(drawn)
    seconds = time.perf_counter() - started
    return ComparedFrequencies(ours(drawn, calculix.INTEGRATION, calculix.INTEGRATION), theirs, ours(of), seconds)


AGAINST: dict[str, tuple[Callable[[Vibrating], ComparedFrequencies], float]] = {
    "ngsolve": (against_ngsolve, NGSOLVE),
    "calculix": (against_calculix, calculix.DIGITS),
}


def vibrating(stage: Stage, mesh: StageMesh) -> Vibrating:
    """A stage on its mesh, without payload and without stacks."""
    density, radius = stage.material.density * DENSITY, stage.platform.hub_radius
    return Vibrating(mesh, plate_of(stage), density, radius, carried(stage, Payload()))


def compared(stage: Stage, mesh: StageMesh, solver: str) -> tuple[ComparedFrequencies, tuple[Check, ...]]:
    """The lowest natural frequencies here and by a solver of `AGAINST`, and how far apart they are."""
    against, allowed = AGAINST[solver]
    found = against(vibrating(stage, mesh))
    return found, (
        Check("natural frequencies", apart(found.ours, found.theirs), allowed),
        Check("natural frequencies, ours by default", apart(found.theirs, found.default), None),
    )


def apart(ours: Array, theirs: Array) -> float:
    """The largest relative difference of frequencies (k,)."""
    return float(np.max(np.abs(theirs / ours - 1)))
