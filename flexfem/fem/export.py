"""Meshes and fields for other programs: .msh through gmsh, .vtu through meshio, .inp for Abaqus and CalculiX."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.deck import write_deck
from flexfem.fem.gmsh_process import run_mesher
from flexfem.fem.mesh import StageMesh
from flexfem.fem.mesher import Export
from flexfem.fem.plane_stress import Plate
from flexfem.files.writing import replacing
from flexfem.refused import BadInput

FORMATS = (".msh", ".vtu", ".inp")


def write_mesh(mesh: StageMesh, plate: Plate, path: Path) -> None:
    """Write a mesh by its file's extension, with the groups `stage`, `ground` and `hub`.

    An Abaqus or CalculiX deck (.inp) also holds the plate, the clamps, the rigid hub and a step for each unit load.

    Raises BadInput for an extension that is not in `FORMATS`.
    """
    check_format(path)
    if path.suffix == ".vtu":
        write_vtu(mesh, path, {})
        return
    if path.suffix == ".inp":
        write_deck(mesh, plate, path)
        return
    groups = {"ground": mesh.edges["ground"], "hub": mesh.edges["hub"]}
    with replacing(path) as temporary:
        run_mesher(Export(str(temporary), mesh.nodes, mesh.triangles, groups), time_limit=600.0)
        if b"$EndElements" not in temporary.read_bytes()[-64:]:  # gmsh does not say when the disk is full
            raise BadInput(f"{path}: cannot be written whole, expected more room on the disk")


def check_format(path: Path) -> None:
    """Raise BadInput when no format is known by the file's extension."""
    if path.suffix not in FORMATS:
        found = f"extension {path.suffix!r}" if path.suffix else "no extension"
        raise BadInput(f"{path}: {found}, expected a file name that ends in one of {', '.join(FORMATS)}")


def write_vtu(mesh: StageMesh, path: Path, fields: dict[str, Array]) -> None:
    """Write the mesh with nodal fields (n, ...) as VTK's unstructured grid; 1 marks the nodes of `ground` and `hub`."""
    import meshio

    data: dict[str, Array] = {}
    for name, field in fields.items():
        data[name] = np.pad(field, [(0, 0), (0, 1)]) if field.shape[1:] == (2,) else field
    for group in ("ground", "hub"):
        data[group] = np.isin(np.arange(len(mesh.nodes)), mesh.edges[group]).astype(float)
    points = np.pad(mesh.nodes, [(0, 0), (0, 1)])
    grid = meshio.Mesh(points, [("triangle6", mesh.triangles)], point_data=data, cell_data={"body": [mesh.bodies]})
    with replacing(path) as temporary:
        meshio.write(temporary, grid, file_format="vtu")
