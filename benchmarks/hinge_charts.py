"""The hinge chart and the thickness chart: one circular hinge between elastic blocks, at grids of
Chebyshev points.

    python benchmarks/hinge_charts.py [FOLDER]

writes the files that `flexfem.hinges.chart` reads, by default into the package.

By symmetry one quarter, x, y > 0, is meshed: tension is even about both axes, bending is odd about
y = 0, and shear is odd about both. The mesh is a mapped grid, whose columns run from the neck along
the arc, up the wall of the slot (where the block is higher than the notch) and along the block, so
that results converge smoothly under refinement.

The far ends of the blocks carry the stresses of a long beam. The beam compliance of the blocks
outside the notch is subtracted; the rest does not depend on their length. Poisson's ratio then
affects the shear compliance alone, `E b dy/F_y = (its value at nu = 0) + 2 (6/5) nu 2R/H`: under
given tractions stress does not depend on nu (Michell), its energy is `int [(sxx + syy)^2 - 2 (1 +
nu) (sxx syy - sxy^2)] / 2E`, and `sxx syy - sxy^2`, the Hessian determinant of the Airy function,
is a divergence, so its integral is that of the straight beam of height H. See A. V. Cherkaev, K. A.
Lurie, G. W. Milton, Proc. R. Soc. Lond. A 438 (1992) 519 (recalled).

In three dimensions the extruded section is solved. The position p between plane stress and plane
strain, C = C_ps (1 - nu^2 p), follows from the energies in three dimensions and in plane stress on
the same section, so that mesh errors cancel. The blocks need no correction: a straight bar has the
compliance of Young's modulus for every b. p lies in 0..1: plane stress is statically admissible,
plane strain kinematically admissible. For b -> infinity p stays below 1, as the hinge may contract
as a whole. With e_zz linear over the section, of area A and second moment I about x (our algebra),

    C_ps(hinge) nu^2 (1 - p) = nu^2/E [ L^2/A - (L - 2R)/H ]   axial,   nu^2/E [ L^2/I - 12 (L -
    2R)/H^3 ]   rotation.
"""

from __future__ import annotations

import datetime
import json
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.fem.elements import (
    SOLID_QUADRATURE,
    Layers,
    Plate,
    mirrored,
    nodal_stress,
    segment_functions,
    von_mises,
    widening,
)
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import PlaneMesh, mapped, nodes_on
from flexfem.fem.structure import NONE, Structure, structure
from flexfem.hinges.chart import FREEDOMS, SHEAR_CORRECTION
from flexfem.results import versions

RATIOS = (0.02, 1.2)  # t/R, of all charts
STRESSES = ("bending", "tension")
LEVELS = (4, 6, 8)  # refinements, coarse to fine
# of a block, per height: end effects decay to e^-8.4; at least b, for stress uniform over the
# thickness
LENGTH = 2.0
ORDER = 4  # of convergence of the compliance with quadratic triangles
ROWS = 2
EDGE = 5  # rows of the base grid, and its columns along the edge of a block
LEAST_ARC = 8  # columns of the base grid along an arc
FLUSH = 1e-6  # relative height of a wall below which it is ignored
THICK_LEVELS = (2, 3, 4)  # refinements, coarse to fine
LEAST_THICK_ARC = 3  # columns of the base grid along an arc
THICK_EDGE = 2  # columns of the base grid along a block two heights long
LAYERS = 0.5  # layers of the base grid for every e-fold of their thickness
# distance from the free surface, per t, within which layers are thin: there stress varies over
# about t
SURFACE = 2.0


class SingleHinge(NamedTuple):
    """A hinge of unit radius and modulus: t/R, H/h of block and notch heights, b/t (0 if plane),
    Poisson's ratio.

    length : of a block, per height H; 0 for the length in the charts, long against height and
    thickness."""

    ratio: float
    height: float = 1.0
    width: float = 0.0
    poissons_ratio: float = 0.0
    length: float = 0.0

    @property
    def wall(self) -> float:
        """Height of the slot's wall above the arc, in radii."""
        wall = (self.height - 1) * (2 + self.ratio) / 2
        return wall if wall > FLUSH else 0.0

    @property
    def block(self) -> tuple[float, float]:
        """Height and length of a block, in radii."""
        height = 2 + self.ratio + 2 * self.wall
        return height, self.length * height or max(LENGTH * height, self.width * self.ratio)


class Extrapolation(NamedTuple):
    """Values (k,) at vanishing element size, and half-widths of their uncertainty."""

    values: Array
    bands: Array


def _mesh(
    hinge: SingleHinge, columns: tuple[int, int, int], rows: int, along: Callable[[Array], Array]
) -> PlaneMesh:
    """Mesh a quarter: edge `left` is half the neck, `bottom` the axis, `right` the end of the
    block, `top` free.

    columns : along the arc, the wall, the block.   along : maps 0..1 along the block to distances
    in radii.

    Notes
    -----
    Columns are normal to the axis at the neck and lean increasingly towards the far end of the arc,
    where they meet the axis at 45 degrees. Along the arc they widen as the stress decays, angle =
    sqrt(t/R) sinh(w). Refined meshes subdivide the columns of one base grid evenly; every corner of
    the outline is a corner of the base grid."""
    tau = hinge.ratio
    wall = hinge.wall
    height, length = hinge.block
    spread = float(np.sqrt(tau))
    total = sum(columns)
    end = float(np.arcsinh(np.pi / 2 / spread))
    first = np.cumsum([0, *columns])

    def place(u: Array, v: Array) -> Array:
        on_arc, on_wall, on_edge = (
            np.clip((u * total - start) / max(number, 1), 0.0, 1.0)
            for start, number in zip(first, columns, strict=False)
        )
        angle = spread * np.sinh(end * on_arc)
        offset = along(on_edge)
        y = tau / 2 + 1 - np.cos(angle)
        foot = (
            np.sin(angle)
            + y * np.tan(angle / 2)
            + wall * on_wall
            + offset * (1 - height / 2 / length)
        )
        x = np.sin(angle) + offset
        y = y + wall * on_wall
        return np.stack([foot + (x - foot) * v, y * v], axis=-1)

    return mapped(total, rows, place)


def hinge_mesh(hinge: SingleHinge, refinement: int) -> PlaneMesh:
    """Mesh the quarter of a hinge with `_mesh`; a slender neck needs few columns, as its stress is
    that of a beam.
    """
    tau = hinge.ratio
    arc = max(LEAST_ARC, int(np.ceil(2 * np.arcsinh(np.pi / 2 / np.sqrt(tau)) / tau**0.25)))
    columns = (
        arc * refinement,
        int(np.ceil(3 * hinge.wall / (2 + tau))) * refinement,
        EDGE * refinement,
    )
    return _mesh(hinge, columns, refinement * ROWS, lambda s: hinge.block[1] * s)


def section_mesh(hinge: SingleHinge, refinement: int) -> PlaneMesh:
    """Mesh the quarter of the section with `_mesh`; along the block columns widen with the distance
    from the notch.

    Triangles of the block have straight sides, so that they represent the displacement of a beam
    exactly."""
    tau = hinge.ratio
    height, length = hinge.block
    arc = max(
        LEAST_THICK_ARC, int(np.ceil(float(np.arcsinh(np.pi / 2 / np.sqrt(tau))) / tau**0.25))
    )
    rows = int(
        np.ceil(1.4 * tau**0.25)
    )  # one suffices in a slender neck, whose stress is that of a beam
    edge = int(np.ceil(THICK_EDGE * np.arcsinh(2 * length / height) / np.arcsinh(4)))
    columns = arc * refinement, 0, edge * refinement
    mesh = _mesh(hinge, columns, refinement * rows, lambda s: widening(s, height / 2, length))
    in_block = (
        mesh.nodes.sum(axis=1) >= 1 + height / 2 - 1e-9 * length
    )  # right of the column at the end of the arc
    block = mesh.triangles[in_block[mesh.triangles[:, :3]].all(axis=1)]
    nodes = mesh.nodes.copy()
    nodes[block[:, 3:]] = (nodes[block[:, :3]] + nodes[block[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)


def layers(hinge: SingleHinge, refinement: int) -> Layers:
    """Return the layers of half the thickness, in radii, thinner towards the free surface."""
    thickness = hinge.width * hinge.ratio
    surface = SURFACE * hinge.ratio
    return mirrored(
        thickness, refinement * int(np.ceil(LAYERS * np.arcsinh(thickness / 2 / surface))), surface
    )


def _loads(mesh: PlaneMesh, block: tuple[float, float]) -> Array:
    """Return nodal forces (3, n, 2) on the end of the block for a unit moment, axial and shear
    force at the neck.
    """
    height, length = block
    edges = mesh.edges["right"]
    forces = np.zeros((3, *mesh.nodes.shape))
    s, w = np.polynomial.legendre.leggauss(3)
    N = segment_functions(s)[0][[0, 2, 1]]  # ends, then middle
    y = mesh.nodes[edges, 1] @ N
    bending = 12 * y / height**3
    even = np.full_like(y, 1 / height)
    parabola = 1.5 / height * (1 - (2 * y / height) ** 2)
    stresses = np.array([[bending, 0 * y], [even, 0 * y], [(1 + length) * bending, parabola]])
    lengths = np.abs(np.diff(mesh.nodes[edges[:, :2], 1])) / 2
    for force, nodal in zip(
        forces, np.einsum("cdkq,kq,iq->ckid", stresses, lengths * w, N), strict=True
    ):
        np.add.at(force, edges, nodal)
    return forces


def _held_freedoms(mesh: PlaneMesh) -> NDArray[np.bool_]:
    """Return which freedoms (3, n, 2) symmetry holds under these loads, and one that prevents rigid
    motion.
    """
    neck, axis, end = (nodes_on(mesh, label) for label in ("left", "bottom", "right"))
    held = np.zeros((3, *mesh.nodes.shape), dtype=bool)
    held[:2, neck, 0] = held[2, neck, 1] = True
    held[[[0], [2]], axis, 0] = held[1, axis, 1] = True
    held[0, neck[0], 1] = held[2, end[0], 1] = True
    return held


def supported(
    whole: Structure, lower: sp.csr_array, force: Array, held: NDArray[np.bool_]
) -> Array:
    """Displacements (n, ...), zero where `held`, of a structure without clamps under forces (n,
    ...), N.

    lower : lower triangle of its stiffness. Raises ComputationFailed when a part is not held.
    """
    free = np.flatnonzero(whole.loads(held[None].astype(float))[:, 0] == 0)
    solve = factorise(lower[free][:, free])
    motion = np.zeros((whole.size, 1))
    for _ in range(2):  # the second removes the round-off of the factorisation
        motion[free] += solve(whole.loads(force[None] - whole.forces(whole.fields(motion)))[free])
    return whole.fields(motion)[0]


def _responses(quarter: Structure, loads: Array, held: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Displacements (k, n, ...) of a quarter under loads, zero where held, and the work (k,) of the
    loads on the hinge.

    The work is computed as `2 f'u - u'K u`, whose error is of second order in that of u, with K u
    from strains: high blocks beside a slender neck rotate far as rigid bodies, which would amplify
    the round-off in K."""
    lower = quarter.lower()
    fields = np.array([supported(quarter, lower, *case) for case in zip(loads, held, strict=True)])
    return fields, 4 * np.sum(
        (2 * loads - quarter.forces(fields)) * fields, axis=tuple(range(1, loads.ndim))
    )


def compliance(hinge: SingleHinge, refinement: int = 0, mesh: PlaneMesh | None = None) -> Array:
    """Compliances (3,) of a hinge on one mesh: E b R^2 theta/M, E b dx/F_x, E b dy/F_y, in the
    order of `FREEDOMS`.
    """
    mesh = mesh or hinge_mesh(hinge, refinement)
    quarter = structure(mesh, Plate(1.0, hinge.poissons_ratio, 1.0), held=NONE)
    return _responses(quarter, _loads(mesh, hinge.block), _held_freedoms(mesh))[
        1
    ] - block_compliance(hinge)


def block_compliance(hinge: SingleHinge) -> Array:
    """Compliances (3,) of the two blocks as beams outside the notch, |x| > R, for loads at the
    centre of the neck.
    """
    height, length = hinge.block
    bending = 8 * ((1 + length) ** 3 - 1) / height**3  # 2 int x^2 dx/(E I)
    shear = SHEAR_CORRECTION * 2 * (1 + hinge.poissons_ratio) * 2 * length / height
    return np.array([24 * length / height**3, 2 * length / height, bending + shear])


def sample(hinge: SingleHinge, levels: Sequence[int] = LEVELS) -> Extrapolation:
    """Extrapolate `compliance` from three or more refinements, coarse to fine; the bands are
    relative.
    """
    limits = richardson(levels, np.array([compliance(hinge, refinement) for refinement in levels]))
    return Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]) / limits[-1])


def richardson(levels: Sequence[int], values: Array) -> Array:
    """Richardson limits (k - 1, ...) of values (k, ...) from pairs of successive refinements, of
    order `ORDER`.
    """
    n = np.asarray(levels, dtype=float)
    growth = ((n[1:] / n[:-1]) ** ORDER).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[1:] + (values[1:] - values[:-1]) / (growth - 1))


def thick_response(hinge: SingleHinge, refinement: int) -> tuple[Array, Array, Array]:
    """Plane-stress compliances (2,) without blocks, their change in three dimensions (2,), stress
    factors (2,).

    The loads are a moment and an axial force. A stress factor is the highest von Mises stress over
    that in plane stress; in a wide neck the highest stress lies about t from the free faces."""
    mesh = section_mesh(hinge, refinement)
    line = layers(hinge, refinement)
    plate = Plate(1.0, hinge.poissons_ratio, 1.0)
    near = np.flatnonzero(np.hypot(*mesh.nodes.T) <= 1.0)
    flat = _loads(mesh, hinge.block)[:2]
    held = _held_freedoms(mesh)[:2]
    through = np.pad(
        flat[:, :, None] * (line.values @ line.weights)[:, None], [*[(0, 0)] * 3, (0, 1)]
    )
    fixed = np.pad(np.repeat(held[:, :, None], len(line.heights), axis=2), [*[(0, 0)] * 3, (0, 1)])
    fixed[0, nodes_on(mesh, "bottom"), :, 2] = True
    fixed[0, nodes_on(mesh, "left")[0], 1:, 1] = False  # bending needs only one point held along y
    plane, thin = _responses(structure(mesh, plate, None, SOLID_QUADRATURE, NONE), flat, held)
    solid, thick = _responses(structure(mesh, plate, line, SOLID_QUADRATURE, NONE), through, fixed)
    flat_stress = von_mises(nodal_stress(mesh, plate, plane, near)).max(axis=1)
    stress = von_mises(nodal_stress(mesh, plate, solid, near, line)).max(axis=(1, 2))
    excess = thick / line.weights.sum() - thin
    return thin - block_compliance(hinge)[:2], excess, stress / flat_stress


def thick_sample(
    hinge: SingleHinge, levels: Sequence[int] = THICK_LEVELS
) -> tuple[Extrapolation, Extrapolation]:
    """Positions of a hinge between plane stress, 0, and plane strain, 1, and stress factors; meshes
    coarse to fine.

    The bands are the changes of the values with the finest of the three or more meshes; for a
    position, which is extrapolated, the change far exceeds the remaining error."""
    plane, excess, stress = zip(
        *(thick_response(hinge, refinement) for refinement in levels), strict=True
    )
    limits = richardson(levels, -np.array(excess) / np.array(plane) / hinge.poissons_ratio**2)
    position = Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]))
    return position, Extrapolation(stress[-1], np.abs(stress[-1] - stress[-2]))


class Chart(NamedTuple):
    """Definition of a chart; `name` is that of its file.

    ends : smallest and largest value of every axis.   scales : functions to and from the Chebyshev
    coordinate per axis.
    shape : number of samples per axis.   digits : significant digits of the coordinates and of the
    values."""

    name: str
    ends: dict[str, tuple[float, float]]
    scales: tuple[tuple[np.ufunc, np.ufunc], ...]
    shape: tuple[int, ...]
    digits: tuple[int, int]
    levels: tuple[int, ...]
    compute: Callable[..., tuple[Extrapolation, ...]]

    @property
    def path(self) -> Path:
        """Path of the file in the package."""
        return Path(str(files("flexfem") / "data" / f"{self.name}.json"))

    def points(self) -> list[Array]:
        """Sample coordinates along every axis, ascending."""
        coordinates = []
        for ends, (scale, inverse), number in zip(
            self.ends.values(), self.scales, self.shape, strict=True
        ):
            low, high = scale(ends)
            x = -np.cos((2 * np.arange(number) + 1) * np.pi / (2 * number))
            coordinates.append(np.sort(inverse(low + (high - low) * (x + 1) / 2)))
        return coordinates


def _plane(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    return (sample(SingleHinge(*point), levels),)


def _thick(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    ratio, width, nu = point
    return thick_sample(SingleHinge(ratio, 1.0, width, nu), levels)


ROOT = (np.sqrt, np.square)
LOW = Chart(
    "hinge_chart",
    {"t/R": RATIOS, "H/h": (1.0, 3.0)},
    (ROOT, (np.log, np.exp)),
    (10, 8),
    (8, 8),
    LEVELS,
    _plane,
)
HIGH = LOW._replace(
    name="hinge_chart_high",
    ends={"t/R": RATIOS, "H/h": (3.0, 60.0)},
    scales=(ROOT, (np.reciprocal, np.reciprocal)),
    shape=(10, 5),
)
THICK = Chart(
    "thickness_chart",
    {"t/R": RATIOS, "b/t": (0.5, 50.0), "nu": (0.1, 0.45)},
    (ROOT, (np.log, np.exp), (np.positive, np.positive)),
    (7, 11, 3),
    (10, 5),
    THICK_LEVELS,
    _thick,
)


def rounded(values: Any, digits: int) -> Any:
    """Round nested lists of numbers to significant digits."""
    if np.ndim(values):
        return [rounded(value, digits) for value in values]
    return float(f"{values:.{digits - 1}e}")


def make(chart: Chart, path: Path, workers: int = 2) -> None:
    """Compute a chart and write it as JSON, one line per key and per row of a table."""
    points = [tuple(map(float, point)) for point in product(*chart.points())]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        document = _document(
            chart, list(pool.map(partial(chart.compute, levels=chart.levels), points))
        )
    entries = (
        f" {json.dumps(key)}: {json.dumps(value)}".replace("], [", "],\n  [")
        for key, value in document.items()
    )
    path.write_text("{\n" + ",\n".join(entries) + "\n}\n")


def _document(chart: Chart, samples: list[tuple[Extrapolation, ...]]) -> dict[str, Any]:
    """Return the packaged document with its computed entries replaced; its explanations stay."""
    points = chart.points()
    coordinate_digits, digits = chart.digits
    extrapolations = [first for first, *_ in samples]
    values, bands = (
        np.array([e[k] for e in extrapolations]).reshape(*chart.shape, -1) for k in range(2)
    )
    names = FREEDOMS[: values.shape[-1]]
    of_compliance = points[2][:, None] ** 2 if "nu" in chart.ends else 1.0
    computed: dict[str, Any] = {
        "regenerate": "python benchmarks/hinge_charts.py",
        "date": datetime.date.today().isoformat(),
        "versions": versions(),
        "largest_band": {
            name: rounded(np.max((bands * of_compliance)[..., k]), 2)
            for k, name in enumerate(names)
        },
        "range": {axis: list(ends) for axis, ends in chart.ends.items()},
        **{
            axis: rounded(at, coordinate_digits)
            for axis, at in zip(chart.ends, points, strict=True)
        },
        **{name: rounded(values[..., k], digits) for k, name in enumerate(names)},
        "bands": {name: rounded(bands[..., k], 2) for k, name in enumerate(names)},
    }
    if "nu" in chart.ends:
        stress = np.array([factors.values for _, factors in samples]).reshape(*chart.shape, -1)
        stress_bands = np.max([factors.bands / factors.values for _, factors in samples], axis=0)
        computed["stress"] = {
            name: rounded(stress[..., k], digits) for k, name in enumerate(STRESSES)
        }
        computed["largest_band_of_stress"] = {
            name: rounded(stress_bands[k], 2) for k, name in enumerate(STRESSES)
        }
    packaged: dict[str, Any] = json.loads(chart.path.read_text())
    return packaged | computed


def main() -> None:
    """Make all charts, in the folder given on the command line or in the package."""
    for chart in (LOW, HIGH, THICK):
        path = Path(sys.argv[1]) / chart.path.name if len(sys.argv) > 1 else chart.path
        make(chart, path)
        print(path)


if __name__ == "__main__":
    main()
