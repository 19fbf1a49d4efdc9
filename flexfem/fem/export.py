"""Export of meshes and fields: .msh and .vtu through meshio, .inp for Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.elements import Plate
from flexfem.fem.mesh import StageMesh, nodes_on
from flexfem.files.writing import replacing, write_atomically
from flexfem.refused import BadInput

PER_LINE = 8  # members of a set; CalculiX reads at most 16 entries per line
FORMATS = (".msh", ".vtu", ".inp")


def write_deck(mesh: StageMesh, plate: Plate, path: Path) -> None:
    """Write the stage as an Abaqus/CalculiX input deck, in N, mm, MPa and rad, with a linear step for each unit load.

    Raises BadInput when the file cannot be written.

    Notes
    -----
    The sets are `stage` (elements), `all`, `ground`, `hub` and `platform` (nodes). Node k of the mesh has the number
    k + 1; two more nodes at the platform centre carry the pose: x and y are the degrees of freedom 1 and 2 of the
    first, theta, in rad, is the degree of freedom 1 of the second, where a moment in N mm acts as a force. Linear
    equations tie the hub to them, `u = X - theta y`, `v = Y + theta x`, because a `*RIGID BODY` describes a large
    rotation, which each program linearises differently.
    """
    text = "\n".join(_deck(mesh, plate))
    write_atomically(path, lambda file: file.write(f"{text}\n".encode()))


def _deck(mesh: StageMesh, plate: Plate) -> Iterator[str]:
    centre, rotation = len(mesh.nodes) + 1, len(mesh.nodes) + 2
    ground, hub = nodes_on(mesh, "ground"), nodes_on(mesh, "hub")
    yield from ("*HEADING", "flexure-hinge stage by flexfem; N, mm, MPa, rad", "*NODE, NSET=all")
    yield from (f"{k}, {_field(x)}, {_field(y)}, 0" for k, (x, y) in enumerate(mesh.nodes, start=1))
    yield from ("*NODE, NSET=platform", f"{centre}, 0, 0, 0", f"{rotation}, 0, 0, 0")
    yield "*ELEMENT, TYPE=CPS6, ELSET=stage"  # corners, then middles of the sides 12, 23, 31, as in the mesh
    yield from (", ".join(map(str, (k, *row))) for k, row in enumerate((mesh.triangles + 1).tolist(), start=1))
    for name, nodes in (("ground", ground), ("hub", hub)):
        yield f"*NSET, NSET={name}"
        numbers = (nodes + 1).tolist()
        for start in range(0, len(numbers), PER_LINE):
            yield ", ".join(map(str, numbers[start : start + PER_LINE])) + ","
    yield from ("*MATERIAL, NAME=sheet", "*ELASTIC", f"{_field(plate.youngs_modulus)}, {_field(plate.poissons_ratio)}")
    yield from ("*SOLID SECTION, ELSET=stage, MATERIAL=sheet", _field(plate.thickness))
    for node, (x, y) in zip((hub + 1).tolist(), mesh.nodes[hub], strict=True):
        yield from ("*EQUATION", "3", f"{node}, 1, 1, {centre}, 1, -1, {rotation}, 1, {_field(y)}")
        yield from ("*EQUATION", "3", f"{node}, 2, 1, {centre}, 2, -1, {rotation}, 1, {_field(-x)}")
    yield from ("*BOUNDARY", "ground, 1, 2")
    for fx, fy, moment in np.eye(3):
        yield from ("*STEP", "*STATIC", "*CLOAD, OP=NEW")
        yield from (f"{centre}, 1, {_field(fx)}", f"{centre}, 2, {_field(fy)}", f"{rotation}, 1, {_field(moment)}")
        yield from ("*NODE PRINT, NSET=all", "U", "*NODE PRINT, NSET=platform", "U")
        yield from ("*NODE PRINT, NSET=ground, TOTALS=YES", "RF", "*EL FILE", "S", "*END STEP")


def _field(value: float) -> str:
    """Format a number for CalculiX, which reads at most 20 characters of a field."""
    return f"{value:.12g}"


def write_mesh(mesh: StageMesh, plate: Plate, path: Path) -> None:
    """Write a mesh in the format of the file's extension, with the groups `stage`, `ground` and `hub`.

    An Abaqus or CalculiX deck (.inp) also holds the plate, the clamps, the rigid hub and a step for each unit load.

    Raises BadInput for an extension that is not in `FORMATS`.
    """
    import meshio

    check_format(path)
    if path.suffix == ".vtu":
        write_vtu(mesh, path, {})
        return
    if path.suffix == ".inp":
        write_deck(mesh, plate, path)
        return
    cells = [("triangle6", mesh.triangles), ("line3", mesh.edges["ground"]), ("line3", mesh.edges["hub"])]
    tags = [np.full(len(nodes), tag) for tag, (_, nodes) in enumerate(cells, start=1)]
    groups = {"stage": np.array([1, 2]), "ground": np.array([2, 1]), "hub": np.array([3, 1])}  # tag and dimension
    physical = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    grid = meshio.Mesh(np.pad(mesh.nodes, [(0, 0), (0, 1)]), cells, cell_data=physical, field_data=groups)
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="gmsh22")


def check_format(path: Path) -> None:
    """Raise BadInput when the extension of a file names no format."""
    if path.suffix not in FORMATS:
        extension = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise BadInput(f"{path}: {extension}, expected a file name that ends in one of {', '.join(FORMATS)}")


def write_vtu(mesh: StageMesh, path: Path, fields: dict[str, Array], heights: Array | None = None) -> None:
    """Write the mesh with nodal fields (n, ...) as a VTK unstructured grid; 1 marks the nodes of `ground` and `hub`.

    heights : (m,), mm, node heights of layers of 18-node wedges, ends and middles; fields are then (n, m, ...).
    """
    import meshio

    z = np.zeros(1) if heights is None else heights
    m, cells, bodies, kind = len(z), mesh.triangles, mesh.bodies, "triangle6"
    if heights is not None:
        corners, middles, kind = m * mesh.triangles[:, :3], m * mesh.triangles[:, 3:], "wedge18"
        order = ((corners, 0), (corners, 2), (middles, 0), (middles, 2), (corners, 1), (middles, 1))
        layers = [np.hstack([nodes + k + level for nodes, level in order]) for k in range(0, m - 1, 2)]
        cells, bodies = np.concatenate(layers), np.tile(mesh.bodies, len(layers))
    data = {}
    for name, field in fields.items():
        values = field.reshape(len(mesh.nodes) * m, *field.shape[1 if heights is None else 2 :])
        data[name] = np.pad(values, [(0, 0), (0, 1)]) if values.shape[1:] == (2,) else values
    for group in ("ground", "hub"):
        data[group] = np.repeat(np.isin(np.arange(len(mesh.nodes)), mesh.edges[group]).astype(float), m)
    points = np.column_stack([np.repeat(mesh.nodes, m, axis=0), np.tile(z, len(mesh.nodes))])
    grid = meshio.Mesh(points, [(kind, cells)], data, {"body": [bodies]})
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="vtu")
