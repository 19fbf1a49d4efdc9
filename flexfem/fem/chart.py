"""The hinge chart and the thickness chart: one circular hinge between elastic blocks, at grids of Chebyshev points.

`python -m flexfem.fem.chart [FOLDER]` makes the files that `hinges.chart` reads, without a folder in the package.

A quarter, x, y > 0, is enough: pulling is even about both axes, bending and shearing are odd about y = 0, and shearing
about x = 0 too. It is a mapped grid, whose columns run from the neck along the arc, up the wall of the slot (where the
block is higher than the notch) and along the block, so that meshes of all refinements extrapolate smoothly.

At their far ends the blocks carry the stresses of a long beam. What they take up as beams, from the ends of the notch
on, is subtracted; the rest does not depend on their length. Poisson's ratio then acts on shear alone,
`E b dy/F_y = (its value at nu = 0) + 2 (6/5) nu 2R/H`: under given tractions stress does not depend on nu (Michell),
its energy is `int [(sxx + syy)^2 - 2 (1 + nu) (sxx syy - sxy^2)] / 2E`, and `sxx syy - sxy^2`, the Hessian determinant
of the Airy function, is a divergence, so its integral is that of the straight beam of height H. See A. V. Cherkaev,
K. A. Lurie, G. W. Milton, Proc. R. Soc. Lond. A 438 (1992) 519 (recalled).

In three dimensions the section times a line is solved, and the position p between plane stress and plane strain,
C = C_ps (1 - nu^2 p), is that of the energies in three dimensions and in plane stress on the same section, whose mesh
errors cancel. The blocks need no correction: a straight bar has the compliance of Young's modulus, whatever b. p lies
in 0..1: plane stress is statically admissible, plane strain kinematically. b -> infinity leads to less than p = 1, as
the hinge may contract as a whole. With e_zz linear over the section, its area A and second moment I about x (our
algebra),

    C_ps(hinge) nu^2 (1 - p) = nu^2/E [ L^2/A - (L - 2R)/H ]   axial,   nu^2/E [ L^2/I - 12 (L - 2R)/H^3 ]   rotation.
"""

from __future__ import annotations

import datetime
import importlib.metadata
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
from numpy.typing import NDArray

from flexfem.arrays import Array
from flexfem.fem.elements import SOLID_QUADRATURE, Layers, Plate, mirrored, nodal_stress, von_mises, widening
from flexfem.fem.mesh import StageMesh, mapped, nodes_on
from flexfem.fem.structure import NONE, Structure, edge_force, structure
from flexfem.files.writing import write_atomically
from flexfem.hinges.chart import FREEDOMS, SHEAR_CORRECTION

PROGRAMS = ("flexfem", "scikit-fem", "numpy", "scipy")
RATIOS = (0.02, 1.2)  # t/R, of all charts
STRESSES = ("bending", "tension")
LEVELS = (4, 6, 8)  # refinements, coarse to fine
LENGTH = 2.0  # of a block, per height: what reaches its end has faded to e^-8.4; and at least b, to even out over b
ORDER = 4  # of the compliance in the size of quadratic triangles
ROWS, EDGE = 2, 5  # rows of the base grid, and its columns along the edge of a block
LEAST_ARC = 8  # columns of the base grid along an arc
FLUSH = 1e-6  # relative; a wall shorter than this is no wall
THICK_LEVELS = (2, 3, 4)  # refinements, coarse to fine
LEAST_THICK_ARC = 3  # columns of the base grid along an arc
THICK_EDGE = 2  # its columns along a block two heights long
LAYERS = 0.5  # its layers for every e-fold of their thickness
SURFACE = 2.0  # thickness of the outermost layers, per t: below the free surface the stress changes over about t


class SingleHinge(NamedTuple):
    """A hinge of radius and modulus one: t/R, H/h of blocks over the notch, b/t (unless plane), Poisson's ratio.

    length : of a block, per height H; 0 for that of the charts, long against height and thickness.
    """

    ratio: float
    height: float = 1.0
    width: float = 0.0
    poissons_ratio: float = 0.0
    length: float = 0.0

    @property
    def wall(self) -> float:
        """Height of the slot's wall above the arc, in radii."""
        above = (self.height - 1) * (2 + self.ratio) / 2
        return above if above > FLUSH else 0.0

    @property
    def block(self) -> tuple[float, float]:
        """Height and length of a block, in radii."""
        high = 2 + self.ratio + 2 * self.wall
        return high, self.length * high or max(LENGTH * high, self.width * self.ratio)


class Extrapolation(NamedTuple):
    """Values (k,) at vanishing element size, half-widths of their uncertainty, and unknowns on the finest mesh."""

    values: Array
    bands: Array
    unknowns: int


def _mesh(hinge: SingleHinge, columns: tuple[int, int, int], rows: int, along: Callable[[Array], Array]) -> StageMesh:
    """Mesh a quarter: `left` is half the neck, `bottom` the axis, `right` the block's end, `top` free.

    columns : along the arc, the wall, the block.   along : shares of these of the block to places on it.

    Notes
    -----
    Columns stand on the axis and lean more and more towards the arc's far end, where they keep 45 degrees with it.
    Along the arc they widen as the stress does, angle = sqrt(t/R) sinh(w). The meshes of all refinements cut the
    columns of one base grid evenly, and every corner of the outline is a corner of it.
    """
    tau, wall, (high, length) = hinge.ratio, hinge.wall, hinge.block
    spread, total = float(np.sqrt(tau)), sum(columns)
    end, first = float(np.arcsinh(np.pi / 2 / spread)), np.cumsum([0, *columns])

    def place(u: Array, v: Array) -> Array:
        on_arc, on_wall, on_edge = (
            np.clip((u * total - start) / max(number, 1), 0.0, 1.0)
            for start, number in zip(first, columns, strict=False)
        )
        angle, beyond = spread * np.sinh(end * on_arc), along(on_edge)
        y = tau / 2 + 1 - np.cos(angle)
        foot = np.sin(angle) + y * np.tan(angle / 2) + wall * on_wall + beyond * (1 - high / 2 / length)
        x, y = np.sin(angle) + beyond, y + wall * on_wall
        return np.stack([foot + (x - foot) * v, y * v], axis=-1)

    return mapped(total, rows, place)


def hinge_mesh(hinge: SingleHinge, refinement: int) -> StageMesh:
    """Mesh the quarter of a hinge, as `_mesh`: long columns are enough in a slender neck, whose stress is a beam's."""
    tau = hinge.ratio
    arc = max(LEAST_ARC, int(np.ceil(2 * np.arcsinh(np.pi / 2 / np.sqrt(tau)) / tau**0.25)))
    columns = arc * refinement, int(np.ceil(3 * hinge.wall / (2 + tau))) * refinement, EDGE * refinement
    return _mesh(hinge, columns, refinement * ROWS, lambda share: hinge.block[1] * share)


def section_mesh(hinge: SingleHinge, refinement: int) -> StageMesh:
    """Mesh the quarter of the section, as `_mesh`; along the block columns widen with the distance from the notch.

    The block's triangles are straight, so that a beam's displacement is exact there.
    """
    tau, (high, length) = hinge.ratio, hinge.block
    arc = max(LEAST_THICK_ARC, int(np.ceil(float(np.arcsinh(np.pi / 2 / np.sqrt(tau))) / tau**0.25)))
    rows = int(np.ceil(1.4 * tau**0.25))  # one is enough in a slender neck, whose stress is a beam's
    edge = int(np.ceil(THICK_EDGE * np.arcsinh(2 * length / high) / np.arcsinh(4)))
    columns = arc * refinement, 0, edge * refinement
    mesh = _mesh(hinge, columns, refinement * rows, lambda share: widening(share, high / 2, length))
    in_block = mesh.nodes.sum(axis=1) >= 1 + high / 2 - 1e-9 * length  # beyond the column at the end of the arc
    block = mesh.triangles[in_block[mesh.triangles[:, :3]].all(axis=1)]
    nodes = mesh.nodes.copy()
    nodes[block[:, 3:]] = (nodes[block[:, :3]] + nodes[block[:, [1, 2, 0]]]) / 2
    return mesh._replace(nodes=nodes)


def layers(hinge: SingleHinge, refinement: int) -> Layers:
    """Layers of half the thickness, in radii, thinner towards the free surface."""
    thickness, surface = hinge.width * hinge.ratio, SURFACE * hinge.ratio
    return mirrored(thickness, refinement * int(np.ceil(LAYERS * np.arcsinh(thickness / 2 / surface))), surface)


def _loads(mesh: StageMesh, block: tuple[float, float]) -> Array:
    """Forces (3, n, 2) on the block's end by the stresses of a unit moment, pull and sideways force at the neck."""
    high, length = block

    def bent(points: Array) -> Array:
        return 12 * points[..., 1] / high**3

    stresses = (
        lambda at, _: np.stack([bent(at), 0 * at[..., 0]], axis=-1),
        lambda at, _: np.broadcast_to([1 / high, 0.0], at.shape),
        lambda at, _: np.stack([(1 + length) * bent(at), 1.5 / high * (1 - (2 * at[..., 1] / high) ** 2)], axis=-1),
    )
    return np.array([edge_force(mesh, Plate(1.0, 0.0, 1.0), mesh.edges["right"], stress) for stress in stresses])


def _held(mesh: StageMesh) -> NDArray[np.bool_]:
    """What symmetry holds under these loads (3, n, 2) on neck and axis, and a node against the motion left."""
    neck, axis, end = (nodes_on(mesh, label) for label in ("left", "bottom", "right"))
    held = np.zeros((3, *mesh.nodes.shape), dtype=bool)
    held[:2, neck, 0] = held[2, neck, 1] = True
    held[[[0], [2]], axis, 0] = held[1, axis, 1] = True
    held[0, neck[0], 1] = held[2, end[0], 1] = True
    return held


def _responses(of: Structure, loads: Array, held: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Displacements (k, n, ...) of a quarter under loads, zero where held, and the work (k,) of these on the hinge.

    The work is taken as `2 f'u - u'K u`, where round-off in u counts twice over only in the second order, and K u from
    strains: high blocks beside a slender neck turn far as rigid bodies, by which round-off in K would be multiplied.
    """
    lower = of.lower()
    fields = np.array([of.settled(lower, *each) for each in zip(loads, held, strict=True)])
    return fields, 4 * np.sum((2 * loads - of.forces(fields)) * fields, axis=tuple(range(1, loads.ndim)))


def compliance(hinge: SingleHinge, refinement: int = 0, mesh: StageMesh | None = None) -> Array:
    """Compliances (3,) of a hinge on one mesh: E b R^2 theta/M, E b dx/F_x, E b dy/F_y, in the order of `FREEDOMS`."""
    mesh = mesh or hinge_mesh(hinge, refinement)
    of = structure(mesh, Plate(1.0, hinge.poissons_ratio, 1.0), held=NONE)
    return _responses(of, _loads(mesh, hinge.block), _held(mesh))[1] - block_compliance(hinge)


def block_compliance(hinge: SingleHinge) -> Array:
    """Compliances (3,) of the two blocks as beams from the ends of the notch, x = R, to their own, about the centre."""
    high, length = hinge.block
    bending = 8 * ((1 + length) ** 3 - 1) / high**3  # 2 int x^2 dx/(E I)
    shear = SHEAR_CORRECTION * 2 * (1 + hinge.poissons_ratio) * 2 * length / high
    return np.array([24 * length / high**3, 2 * length / high, bending + shear])


def sample(hinge: SingleHinge, levels: Sequence[int] = LEVELS) -> Extrapolation:
    """Compliances of a hinge as of `compliance`, over three or more refinements, coarse to fine; relative bands."""
    found = np.array([compliance(hinge, refinement) for refinement in levels])
    limits = richardson(levels, found)
    unknowns = 2 * len(hinge_mesh(hinge, levels[-1]).nodes)
    return Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]) / limits[-1], unknowns)


def richardson(levels: Sequence[int], values: Array) -> Array:
    """Limits (k - 1, ...) of values (k, ...) from each pair of neighbouring refinements, with the order `ORDER`."""
    n = np.asarray(levels, dtype=float)
    growth = ((n[1:] / n[:-1]) ** ORDER).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[1:] + (values[1:] - values[:-1]) / (growth - 1))


def thick_response(hinge: SingleHinge, refinement: int) -> tuple[Array, Array, Array, int]:
    """Plane-stress compliances (2,) less the blocks', what three dimensions add to them (2,), stress factors (2,).

    By a moment and a pull. The factors are the highest von Mises stress over that in plane stress; in a wide neck it
    lies near the free faces, about t away. Last the number of unknowns.
    """
    mesh, line = section_mesh(hinge, refinement), layers(hinge, refinement)
    plate, near = Plate(1.0, hinge.poissons_ratio, 1.0), np.flatnonzero(np.hypot(*mesh.nodes.T) <= 1.0)
    flat, held = _loads(mesh, hinge.block)[:2], _held(mesh)[:2]
    through = np.pad(flat[:, :, None] * (line.values @ line.weights)[:, None], [*[(0, 0)] * 3, (0, 1)])
    fixed = np.pad(np.repeat(held[:, :, None], len(line.heights), axis=2), [*[(0, 0)] * 3, (0, 1)])
    fixed[0, nodes_on(mesh, "bottom"), :, 2] = True
    fixed[0, nodes_on(mesh, "left")[0], 1:, 1] = False  # the motion along y that bending leaves is held at one point
    plane, thin = _responses(structure(mesh, plate, None, SOLID_QUADRATURE, NONE), flat, held)
    solid, thick = _responses(structure(mesh, plate, line, SOLID_QUADRATURE, NONE), through, fixed)
    flat_stress = von_mises(nodal_stress(mesh, plate, plane, near)).max(axis=1)
    stress = von_mises(nodal_stress(mesh, plate, solid, near, line)).max(axis=(1, 2))
    excess = thick / line.weights.sum() - thin
    return thin - block_compliance(hinge)[:2], excess, stress / flat_stress, solid[0].size


def thick_sample(hinge: SingleHinge, levels: Sequence[int] = THICK_LEVELS) -> tuple[Extrapolation, Extrapolation]:
    """Positions of a hinge between plane stress, 0, and plane strain, 1, and stress factors; meshes coarse to fine.

    The bands are what the finest of the three or more meshes moves the values by: that of a position, which is
    extrapolated, is far more than what is left after it.
    """
    plane, excess, stress, unknowns = zip(*(thick_response(hinge, refinement) for refinement in levels), strict=True)
    limits = richardson(levels, -np.array(excess) / np.array(plane) / hinge.poissons_ratio**2)
    position = Extrapolation(limits[-1], np.abs(limits[-1] - limits[-2]), unknowns[-1])
    return position, Extrapolation(stress[-1], np.abs(stress[-1] - stress[-2]), unknowns[-1])


class Chart(NamedTuple):
    """Where a chart is sampled, by name of its file.

    ends : smallest and largest of every axis by name.   scales : on which the points of each are Chebyshev's, and back.
    shape : samples along each.   digits : kept of places and of values.
    """

    name: str
    meshes: str
    ends: dict[str, tuple[float, float]]
    scales: tuple[tuple[np.ufunc, np.ufunc], ...]
    shape: tuple[int, ...]
    digits: tuple[int, int]
    levels: tuple[int, ...]
    compute: Callable[..., tuple[Extrapolation, ...]]

    @property
    def path(self) -> Path:
        """Where the package keeps it."""
        return Path(str(files("flexfem") / "data" / f"{self.name}.json"))

    def points(self) -> list[Array]:
        """Sampled places along every axis, ascending."""
        found = []
        for ends, (measure, back), number in zip(self.ends.values(), self.scales, self.shape, strict=True):
            low, high = measure(ends)
            x = -np.cos((2 * np.arange(number) + 1) * np.pi / (2 * number))
            found.append(np.sort(back(low + (high - low) * (x + 1) / 2)))
        return found


def _plane(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    return (sample(SingleHinge(*point), levels),)


def _thick(point: tuple[float, ...], levels: tuple[int, ...]) -> tuple[Extrapolation, ...]:
    ratio, width, nu = point
    return thick_sample(SingleHinge(ratio, 1.0, width, nu), levels)


ROOT = (np.sqrt, np.square)
LOW = Chart(
    "hinge_chart", f"mapped grids of curved quadratic triangles (no gmsh){{}}; blocks {LENGTH:g} H long",
    {"t/R": RATIOS, "H/h": (1.0, 3.0)}, (ROOT, (np.log, np.exp)), (10, 8), (8, 8), LEVELS, _plane,
)  # fmt: skip
HIGH = LOW._replace(
    name="hinge_chart_high", ends={"t/R": RATIOS, "H/h": (3.0, 60.0)}, scales=(ROOT, (np.reciprocal, np.reciprocal)),
    shape=(10, 5),
)  # fmt: skip
THICK = Chart(
    "thickness_chart", "curved quadratic triangles times quadratic segments (no gmsh){}",
    {"t/R": RATIOS, "b/t": (0.5, 50.0), "nu": (0.1, 0.45)}, (ROOT, (np.log, np.exp), (np.positive, np.positive)),
    (7, 11, 3), (10, 5), THICK_LEVELS, _thick,
)  # fmt: skip


def kept(values: Any, digits: int) -> Any:
    """Nested lists of numbers rounded to so many significant digits."""
    if np.ndim(values):
        return [kept(value, digits) for value in values]
    return float(f"{values:.{digits - 1}e}")


def make(chart: Chart, path: Path, workers: int = 2, date: str | None = None) -> None:
    """Compute a chart and write it as JSON, one line a key and one a row of a table.

    date : ISO date to state, today's when None. Raises BadInput when the file cannot be written.
    """
    places = [tuple(map(float, point)) for point in product(*chart.points())]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        samples = list(pool.map(partial(chart.compute, levels=chart.levels), places))
    document = _document(chart, samples, date or datetime.date.today().isoformat())
    entries = (f" {json.dumps(key)}: {json.dumps(value)}".replace("], [", "],\n  [") for key, value in document.items())
    text = "{\n" + ",\n".join(entries) + "\n}\n"
    write_atomically(path, lambda file: file.write(text.encode()))


def _document(chart: Chart, samples: list[tuple[Extrapolation, ...]], date: str) -> dict[str, Any]:
    """The packaged file, whose explanations stay, with what was computed."""
    points, (place_digits, digits), of = chart.points(), chart.digits, [each[0] for each in samples]
    values, bands = (
        np.array([getattr(each, name) for each in of]).reshape(*chart.shape, -1) for name in ("values", "bands")
    )
    names = FREEDOMS[: values.shape[-1]]
    solved = (
        f", refinements {list(chart.levels)}, at most {max(each.unknowns for each in of)} unknowns, Richardson "
        "extrapolation with order 4"
    )
    worth = bands * points[2][:, None] ** 2 if "nu" in chart.ends else bands  # of the compliance
    made: dict[str, Any] = {
        "regenerate": "python -m flexfem.fem.chart",
        "date": date,
        "versions": {program: importlib.metadata.version(program) for program in PROGRAMS},
        "meshes": chart.meshes.format(solved),
        "largest_band": {name: kept(np.max(worth[..., k]), 2) for k, name in enumerate(names)},
        "range": {axis: list(ends) for axis, ends in chart.ends.items()},
        **{axis: kept(at, place_digits) for axis, at in zip(chart.ends, points, strict=True)},
        **{name: kept(values[..., k], digits) for k, name in enumerate(names)},
        "bands": {name: kept(bands[..., k], 2) for k, name in enumerate(names)},
    }
    if "nu" in chart.ends:
        stress = np.array([each[1].values for each in samples]).reshape(*chart.shape, -1)
        moved = np.max([each[1].bands / each[1].values for each in samples], axis=0)
        made["stress"] = {name: kept(stress[..., k], digits) for k, name in enumerate(STRESSES)}
        made["largest_band_of_stress"] = {name: kept(moved[k], 2) for k, name in enumerate(STRESSES)}
    packaged: dict[str, Any] = json.loads(chart.path.read_text())
    return packaged | made


def main() -> None:
    """Make all charts in the folder of the command line or else in the package."""
    for chart in (LOW, HIGH, THICK):
        path = Path(sys.argv[1]) / chart.path.name if len(sys.argv) > 1 else chart.path
        make(chart, path)
        print(path)


if __name__ == "__main__":
    main()
