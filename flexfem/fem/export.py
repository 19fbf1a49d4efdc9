"""Export of meshes and fields: .msh and .vtu through meshio, .inp for Abaqus and CalculiX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from flexfem.arrays import Array, Index
from flexfem.fem.elements import Plate
from flexfem.fem.mesh import PlaneMesh, nodes_on
from flexfem.fem.ports import forces_on_ports, held_nodes, plate_of_layout
from flexfem.files.writing import replacing, write_atomically
from flexfem.mechanism.layout import Layout
from flexfem.refused import BadInput

PER_LINE = 8  # members of a set; CalculiX reads at most 16 entries per line
LONGEST_GROUP = 120  # bytes of the name of a group; readers of .msh stop at 128 or at 256
GROUPS = ("ground", "hub", "clamped")
FORMATS = (".msh", ".vtu", ".inp")


def _deck(mesh: PlaneMesh, plate: Plate) -> Iterator[str]:
    """Yield the Abaqus/CalculiX input deck of a plate with a hub, in N, mm, MPa and rad.

    It has a linear step for each unit load. The sets are `stage` (elements), `all`, `ground`, `hub`
    and `platform` (nodes). Node k of the mesh has the number k + 1; two more nodes at the platform
    centre carry the pose: x and y are the degrees of freedom 1 and 2 of the first, theta, in rad,
    is the degree of freedom 1 of the second, where a moment in N mm acts as a force. Linear
    equations tie the hub to them, `u = X - theta y`, `v = Y + theta x`, because a `*RIGID BODY`
    describes a large rotation, which each program linearises differently.
    """
    centre = len(mesh.nodes) + 1
    rotation = len(mesh.nodes) + 2
    sets = {"ground": nodes_on(mesh, "ground"), "hub": nodes_on(mesh, "hub")}
    ties = list[str]()
    for node, (x, y) in zip((sets["hub"] + 1).tolist(), mesh.nodes[sets["hub"]], strict=True):
        ties += ["*EQUATION", "3", f"{node}, 1, 1, {centre}, 1, -1, {rotation}, 1, {_field(y)}"]
        ties += ["*EQUATION", "3", f"{node}, 2, 1, {centre}, 2, -1, {rotation}, 1, {_field(-x)}"]
    pose = ["*NODE, NSET=platform", f"{centre}, 0, 0, 0", f"{rotation}, 0, 0, 0"]
    loads = list[list[str]]()
    for fx, fy, moment in np.eye(3):
        force = [f"{centre}, 1, {_field(fx)}", f"{centre}, 2, {_field(fy)}"]
        loads.append([*force, f"{rotation}, 1, {_field(moment)}"])
    return _lines(mesh, plate, "stage", sets, loads, pose, ties)


def _plate_deck(mesh: PlaneMesh, layout: Layout) -> Iterator[str]:
    """Yield the deck of a mechanism: a step for each unit load on its ports, as nodal forces."""
    loads = (_nodal_forces(force) for force in forces_on_ports(layout, mesh))
    for k, port in enumerate(layout.ports, start=1):
        yield f"** step {k}: unit load on {port.label}"
    plate = plate_of_layout(layout, mesh=mesh)
    yield from _lines(mesh, plate, "plate", {"ground": held_nodes(layout, mesh)}, loads)


def _nodal_forces(force: Array) -> list[str]:
    """Return the lines of nodal forces (n, 2), N, those that are not zero."""
    lines = list[str]()
    for node, axis in np.argwhere(force):
        lines.append(f"{node + 1}, {axis + 1}, {_field(force[node, axis])}")
    return lines


def _numbers(values: Sequence[int]) -> Iterator[str]:
    """Yield the lines of the members of a set."""
    for start in range(0, len(values), PER_LINE):
        yield ", ".join(map(str, values[start : start + PER_LINE])) + ","


def _lines(
    mesh: PlaneMesh,
    plate: Plate,
    name: str,
    sets: Mapping[str, Index],
    loads: Iterable[Sequence[str]],
    pose: Sequence[str] = (),
    ties: Sequence[str] = (),
) -> Iterator[str]:
    """Yield the lines of a deck.

    `pose` defines the nodes `platform`, which `ties` connect to the mesh.
    """
    yield from ("*HEADING", f"flexure-hinge {name} by flexfem; N, mm, MPa, rad", "*NODE, NSET=all")
    for k, (x, y) in enumerate(mesh.nodes, start=1):
        yield f"{k}, {_field(x)}, {_field(y)}, 0"
    yield from pose
    # corners, then middles of the sides 12, 23, 31, as in the mesh
    yield f"*ELEMENT, TYPE=CPS6, ELSET={name}"
    for k, nodes in enumerate((mesh.triangles + 1).tolist(), start=1):
        yield ", ".join(map(str, (k, *nodes)))
    for group, members in sets.items():
        yield f"*NSET, NSET={group}"
        yield from _numbers((members + 1).tolist())
    yield from _materials(plate, name)
    yield from ties
    yield from ("*BOUNDARY", "ground, 1, 2")
    for load in loads:
        yield from ("*STEP", "*STATIC", "*CLOAD, OP=NEW", *load, "*NODE PRINT, NSET=all", "U")
        if pose:
            yield from ("*NODE PRINT, NSET=platform", "U")
        yield from ("*NODE PRINT, NSET=ground, TOTALS=YES", "RF", "*EL FILE", "S", "*END STEP")


def _materials(plate: Plate, name: str) -> Iterator[str]:
    """Yield the materials of a plate; of parts with different ones, with element sets by number."""
    constants = np.reshape([plate.youngs_modulus, plate.poissons_ratio], (2, -1))
    values, number = np.unique(constants, axis=1, return_inverse=True)
    for k, (E, nu) in enumerate(values.T):
        material = "sheet"
        group = name
        if plate.mixed:
            material = f"sheet{k + 1}"
            group = f"{name}{k + 1}"
            yield f"*ELSET, ELSET={group}"
            yield from _numbers((np.flatnonzero(np.ravel(number) == k) + 1).tolist())
        yield from (f"*MATERIAL, NAME={material}", "*ELASTIC", f"{_field(E)}, {_field(nu)}")
        yield from (f"*SOLID SECTION, ELSET={group}, MATERIAL={material}", _field(plate.thickness))


def _field(value: float) -> str:
    """Format a number for CalculiX, which reads at most 20 characters of a field."""
    return f"{value:.12g}"


def write_mesh(
    mesh: PlaneMesh,
    plate: Plate,
    path: Path,
) -> None:
    """Write a mesh in the format of the file's extension, with groups `stage`, `ground` and `hub`.

    An Abaqus or CalculiX deck (.inp) also holds the plate, the clamps, the rigid hub and a step for
    each unit load.

    Raises BadInput for an extension that is not in `FORMATS`.
    """
    check_format(path)
    cells = {"stage": ("triangle6", mesh.triangles)}
    cells |= {name: ("line3", mesh.edges[name]) for name in ("ground", "hub")}
    _write(mesh, path, _deck(mesh, plate), cells)


def write_plate_mesh(
    mesh: PlaneMesh,
    layout: Layout,
    path: Path,
) -> None:
    """Write the mesh of a mechanism in the format of the file's extension.

    Its groups are bodies, hinges and clamped edges. An Abaqus or CalculiX deck (.inp) has the nodes
    of the ground, the plate, and a step for each unit load on a port.
    """
    names = [f"body {body.name}" for body in layout.bodies]
    names += [f"hinge {joint.name}" for joint in layout.joints]
    cells = dict[str, tuple[str, Index]]()
    for k, name in enumerate(_group_names(names)):
        cells[name] = ("triangle6", mesh.triangles[mesh.bodies == k])
    if "clamped" in mesh.edges:
        cells["clamped"] = ("line3", mesh.edges["clamped"])
    _write(mesh, path, _plate_deck(mesh, layout), cells)


def _group_names(names: Sequence[str]) -> list[str]:
    """Return different short names, without quotes and backslashes, for a quoted string of .msh."""
    found = list[str]()
    for name in names:
        plain = name.translate({ord('"'): "'", ord("\\"): "/"})
        short = plain.encode()[:LONGEST_GROUP].decode(errors="ignore")
        count = 1
        unique = short
        while unique in found:
            count += 1
            unique = f"{short} {count}"
        found.append(unique)
    return found


def _write(
    mesh: PlaneMesh, path: Path, deck: Iterator[str], cells: Mapping[str, tuple[str, Index]]
) -> None:
    """Write the lines of `deck` as .inp, the mesh as .vtu, or its `cells` by group as .msh."""
    if path.suffix == ".inp":
        text = "\n".join(deck)
        write_atomically(path, lambda file: file.write(f"{text}\n".encode()))
    elif path.suffix == ".vtu":
        write_vtu(mesh, path, {})
    else:
        _write_msh(mesh, path, cells)


def _write_msh(
    mesh: PlaneMesh,
    path: Path,
    cells: Mapping[str, tuple[str, Index]],
) -> None:
    """Write the cells of a mesh by group, each of one kind, as .msh."""
    import meshio

    axes = {"triangle6": 2, "line3": 1}
    tags = list[Index]()
    groups = dict[str, Index]()
    for tag, (name, (kind, nodes)) in enumerate(cells.items(), start=1):
        tags.append(np.full(len(nodes), tag))
        groups[name] = np.array([tag, axes[kind]])
    physical = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    points = np.pad(mesh.nodes, [(0, 0), (0, 1)])
    grid = meshio.Mesh(points, list(cells.values()), cell_data=physical, field_data=groups)
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="gmsh22")


def check_format(path: Path) -> None:
    """Raise BadInput when the extension of a file names no format."""
    if path.suffix not in FORMATS:
        extension = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise BadInput(
            f"{path}: {extension}, expected a file name that ends in one of {', '.join(FORMATS)}"
        )


def write_vtu(
    mesh: PlaneMesh, path: Path, fields: dict[str, Array], heights: Array | None = None
) -> None:
    """Write a mesh with nodal fields (n, ...) as a VTK grid; 1 marks the nodes of `GROUPS`.

    heights : (m,), mm, node heights of layers of 18-node wedges, ends and middles; fields are then
        (n, m, ...).
    """
    import meshio

    count = len(mesh.nodes)
    if heights is None:
        z = np.zeros(1)
        kind = "triangle6"
        cells = mesh.triangles
    else:
        z = heights
        kind = "wedge18"
        cells = _wedges(mesh.triangles, len(z))
    bodies = np.tile(mesh.bodies, len(cells) // len(mesh.triangles))
    data = dict[str, Array]()
    for name, field in fields.items():
        values = field.reshape(count * len(z), *field.shape[1 if heights is None else 2 :])
        if values.shape[1:] == (2,):
            values = np.pad(values, [(0, 0), (0, 1)])  # vectors of VTK have three components
        data[name] = values
    for group in GROUPS:
        if group in mesh.edges:
            marked = np.isin(np.arange(count), mesh.edges[group])
            data[group] = np.repeat(marked.astype(float), len(z))
    points = np.column_stack([np.repeat(mesh.nodes, len(z), axis=0), np.tile(z, count)])
    grid = meshio.Mesh(points, [(kind, cells)], data, {"body": [bodies]})
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="vtu")


def _wedges(triangles: Index, heights: int) -> Index:
    """Return the nodes (e, 18) of wedges, layer by layer, of triangles at a number of heights."""
    corners = heights * triangles[:, :3]
    middles = heights * triangles[:, 3:]
    order = ((corners, 0), (corners, 2), (middles, 0), (middles, 2), (corners, 1), (middles, 1))
    layers = [
        np.hstack([nodes + first + level for nodes, level in order])
        for first in range(0, heights - 1, 2)
    ]
    return np.concatenate(layers)
