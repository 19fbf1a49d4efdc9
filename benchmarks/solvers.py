"""The same mesh, three unit loads, whole processes: flexfem beside the solvers installed, as ratios
of one run.

    python benchmarks/solvers.py [--resolution 5 15] [--repeats 3] [--only flexfem ngsolve]

A resolution of 5 makes about 27,000 unknowns, 15 about 210,000, 34 about a million. Times are wall
seconds of a process that imports, loads the mesh, assembles, factors and solves; memory is the peak
of that process. Medians of the repeats; the solvers take turns, so that a slow minute of the
machine meets all of them."""

from __future__ import annotations

import argparse
import importlib.util
import os
import pickle
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
STAGE = ROOT / "geometry/mobility6.toml"
PLATE = (71700.0, 0.33, 10.0)  # the material and thickness of that stage


def flexfem(sectors: Any, plate: Any) -> Any:
    """Three alike chains: one sector is solved."""
    from flexfem.fem.response import unit_response

    return unit_response(sectors, plate).compliance


def flexfem_unlike(sectors: Any, plate: Any) -> Any:
    """As for chains that differ: the welded stage is solved, here of the same triangles."""
    from flexfem.fem.response import unit_response

    return unit_response(sectors * 3, plate).compliance


def flexfem_superlu(mesh: Any, plate: Any) -> Any:
    from flexfem.fem import factor, response, structure

    structure.factorise = lambda lower, *_: factor.superlu(lower)
    return response.platform_response(mesh, plate).compliance


def scikit_fem(mesh: Any, plate: Any) -> Any:
    """scikit-fem as its examples use it: its own vector form and scipy's SuperLU with default
    ordering.
    """
    import numpy as np
    from scipy.sparse.linalg import splu
    from skfem import Basis, BilinearForm, ElementTriP2, ElementVector, MeshTri2
    from skfem.helpers import ddot, eye, sym_grad, trace

    from flexfem.fem.structure import structure

    lame, mu = plate.lame(2)

    @BilinearForm
    def form(u: Any, v: Any, _: Any) -> Any:
        strain = sym_grad(u)
        return plate.thickness * ddot(lame * eye(trace(strain), 2) + 2 * mu * strain, sym_grad(v))

    theirs = MeshTri2(
        np.ascontiguousarray(mesh.nodes.T), np.ascontiguousarray(mesh.triangles[:, :3].T)
    )
    basis = Basis(theirs, ElementVector(ElementTriP2()), intorder=2)
    stiffness = form.assemble(basis)
    of = structure(mesh, plate)
    rigid = of.rigid_unknowns(of.hub)
    corners = int(mesh.triangles[:, :3].max()) + 1
    where = np.concatenate([basis.nodal_dofs.T, basis.facet_dofs.T])
    assert len(where) == len(mesh.nodes) and corners == basis.nodal_dofs.shape[1]
    import scipy.sparse as sp

    free = where[of.free].ravel()
    hub = where[of.hub].ravel()
    coupling = stiffness[hub][:, free]
    whole = sp.block_array(
        [
            [stiffness[free][:, free], coupling.T @ rigid],
            [rigid.T @ coupling, rigid.T @ stiffness[hub][:, hub] @ rigid],
        ]
    ).tocsc()
    loads = np.zeros((whole.shape[0], 3))
    loads[-3:] = np.eye(3)
    return splu(whole).solve(loads)[-3:]


def ngsolve(mesh: Any, plate: Any) -> Any:
    """Without the conversion of our mesh, which is Python: its own files are read natively."""
    import time

    import ngsolve as ng
    import numpy as np

    from tests.validation.ngsolve import curved_mesh, solved

    with ng.TaskManager():
        started = time.perf_counter()
        curved = curved_mesh(ng, mesh)
        not_counted.append(time.perf_counter() - started)
        return np.linalg.inv(solved(ng, curved, mesh, plate, None, 0).stiffness)


def calculix(mesh: Any, plate: Any) -> Any:
    from tests.validation.calculix import solve

    return solve(mesh, plate, uncoupled=True)[0]


not_counted: list[float] = []  # seconds of this process that are not the solver's
SOLVERS: dict[str, Callable[[Any, Any], Any]] = {
    "flexfem": flexfem,
    "flexfem-unlike": flexfem_unlike,
    "flexfem-superlu": flexfem_superlu,
    "scikit-fem": scikit_fem,
    "ngsolve": ngsolve,
    "calculix": calculix,
}
NEEDS = {"flexfem": "cvxopt", "ngsolve": "ngsolve"}
OF_SECTORS = ("flexfem", "flexfem-unlike")


def installed() -> list[str]:
    found = [name for name in SOLVERS if importlib.util.find_spec(NEEDS.get(name, "flexfem"))]
    return [name for name in found if name != "calculix" or shutil.which("ccx")]


def child(name: str, path: Path) -> None:
    from flexfem.fem.elements import Plate

    sectors, whole = pickle.loads(path.read_bytes())
    mesh = sectors if name in OF_SECTORS else whole
    compliance = SOLVERS[name](mesh, Plate(*PLATE))
    print(f"{compliance[0, 0]:.12e} {sum(not_counted):.3f}")


def measure(name: str, path: Path) -> tuple[float, float, float]:
    """Wall seconds, peak MB and compliance xx of one process."""
    import time

    started = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, __file__, "--child", name, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{name} failed")
    compliance, excluded = (float(word) for word in said.split())
    return time.perf_counter() - started - excluded, usage.ru_maxrss / 1e3, compliance


def table(resolution: int, repeats: int, names: list[str], folder: Path) -> None:
    from flexfem.fem.elements import Plate
    from flexfem.fem.mesh import welded
    from flexfem.fem.structure import structure
    from flexfem.paper.stage import load_feasible
    from flexfem.paper.stage_mesh import mesh_sectors

    path = folder / f"{resolution}.pickle"
    sectors = mesh_sectors(load_feasible(STAGE), resolution, time_limit=600.0)
    mesh, _ = welded(sectors)
    path.write_bytes(pickle.dumps((sectors, mesh)))
    print(
        f"\n{structure(mesh, Plate(*PLATE)).size} unknowns, {len(mesh.triangles)} triangles, "
        f"{os.cpu_count()} cores"
    )
    runs: dict[str, list[tuple[float, float, float]]] = {name: [] for name in names}
    for _ in range(repeats):
        for name in names:
            runs[name].append(measure(name, path))
    print(f"{'solver':18} {'seconds':>8} {'peak MB':>8} {'flexfem / it':>13} {'compliance xx':>20}")
    for name in names:
        seconds = statistics.median(run[0] for run in runs[name])
        ratios = [
            ours[0] / theirs[0] for ours, theirs in zip(runs[names[0]], runs[name], strict=True)
        ]
        memory = max(run[1] for run in runs[name])
        print(
            f"{name:18} {seconds:8.2f} {memory:8.0f} {statistics.median(ratios):13.2f} "
            f"{runs[name][0][2]:20.10e}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--resolution", type=int, nargs="+", default=[5, 15])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", nargs="+", choices=SOLVERS)
    parser.add_argument("--child", nargs=2, metavar=("SOLVER", "MESH"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments.child[0], Path(arguments.child[1]))
        return
    names = arguments.only or installed()
    with tempfile.TemporaryDirectory() as folder:
        for resolution in arguments.resolution:
            table(resolution, arguments.repeats, names, Path(folder))


if __name__ == "__main__":
    main()
