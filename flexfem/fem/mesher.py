"""gmsh in processes of its own, which can hang or crash without taking flexfem along; the only module that imports it.

A process meshes one list of requests (`Job`, `Extruded`) after the other, since starting it takes longer than
most meshes: `main` reads them pickled from standard input and writes what was made to standard output.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import pickle
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from subprocess import PIPE, Popen
from tempfile import TemporaryFile
from threading import Thread
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.mechanism.outlines import Face, Segment
from flexfem.refused import ComputationFailed, SourcesChanged
from flexfem.sources import CHANGED, child_command, manifest

SAME_POINT = 1e-7  # mm; faces compute their common points each on its own
TRIANGLE, EDGE = 2, 1  # gmsh's numbers of the linear ones
STRAIGHT = complex(np.nan)  # for a centre
LOOK = 0.25  # s between two looks at a process
STEP = 1.0  # s; a longer gap between two looks is taken for a stop of whoever looks: of the machine, or of the job
MOST_KEPT = 10_000_000  # bytes of meshes; the process of a larger answer ends, so that its memory is free again
OPTIONS = {
    "General.NumThreads": 1,  # more make the order of the nodes vary from run to run
    "General.Verbosity": 2,
    "General.Terminal": 0,  # in a worker that shares its terminal
    "Mesh.Algorithm": 6,  # Frontal-Delaunay
    "Mesh.LcIntegrationPrecision": 1e-2,
    "Mesh.Smoothing": 0,  # half the time, and the compliance is no better for it
    "Mesh.MeshSizeExtendFromBoundary": 0,  # the cones hold inside as well: a tenth fewer triangles, better shaped
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeFromPoints": 0,
}
LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libgomp.so.1": "libgomp1",
}


class DrawnCurve(NamedTuple):
    """A drawn curve: its label, and for an arc the centre."""

    label: str
    centre: complex | None


class Cone(NamedTuple):
    """Triangle size, mm: `least` within `radius` of a point, `most` from `reach` further on, linear between."""

    centre: complex
    radius: float
    least: float
    most: float
    reach: float


class Job(NamedTuple):
    """Faces that share curves, and how finely to mesh them.

    divisions : for the labels named, the number of equal edges along each segment.
    cones : the least of them is the size of a triangle.
    """

    faces: list[Face]
    divisions: dict[str, int]
    cones: tuple[Cone, ...]


class Extruded(NamedTuple):
    """A solid to write as .step, from z = 0 up to its thickness, mm.

    outer : closed counter-clockwise loop.   holes : centre (complex) and radius of each.
    """

    path: str
    outer: list[Segment]
    holes: list[tuple[complex, float]]
    thickness: float


Request: TypeAlias = Job | Extruded
Made: TypeAlias = dict[str, AnyArray]


def require_gmsh() -> None:
    """Exit with one line that names the Debian packages of gmsh's system libraries that are missing."""
    try:
        import gmsh  # noqa: F401
    except OSError as error:
        missing = [package for library, package in LIBRARIES.items() if not _loads(library)]
        cure = f"on Debian: apt-get install {' '.join(missing)}" if missing else "a system library is missing"
        sys.exit(f"gmsh cannot be loaded ({error}); {cure}")


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


@contextmanager
def gmsh_session() -> Iterator[Any]:
    """Yield gmsh, initialised the same whoever runs it, and close it in the end."""
    require_gmsh()
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        yield gmsh
    finally:
        gmsh.finalize()


def _draw_loops(kernel: Any, faces: list[Face]) -> tuple[dict[int, DrawnCurve], list[int]]:
    """Draw every point and curve once; returns the curves by tag and the closed loop of each face.

    An arc of a bend too slight to draw is left out; a curve that a face meets backwards has a negative tag in its loop.
    """
    ends = np.array([(segment.start, segment.end) for face in faces for segment in face.loop])
    first = np.argmax(np.abs(ends.ravel()[:, None] - ends.ravel()) < SAME_POINT, axis=1)  # of all ends at its place
    points, between, curves = dict[int, int](), dict[tuple[int, int], int](), dict[int, DrawnCurve]()
    places, loops = iter(first.reshape(ends.shape).tolist()), []

    def point(place: int) -> int:
        if place not in points:
            points[place] = kernel.addPoint(ends.flat[place].real, ends.flat[place].imag, 0.0)
        return points[place]

    for face in faces:
        tags = []
        for segment, label in zip(face.loop, face.labels, strict=True):
            start, end = map(point, next(places))
            if (end, start) in between:
                tags.append(-between[end, start])
            elif start != end:
                if segment.centre is None:
                    tag = int(kernel.addLine(start, end))
                else:
                    middle = kernel.addPoint(segment.centre.real, segment.centre.imag, 0.0)
                    tag = int(kernel.addCircleArc(start, middle, end))
                between[start, end], curves[tag] = tag, DrawnCurve(label, segment.centre)
                tags.append(tag)
        loops.append(int(kernel.addCurveLoop(tags)))
    return curves, loops


def _set_sizes(field: Any, cones: tuple[Cone, ...]) -> None:
    """The least of the cones is the size of a triangle."""
    tags = []
    for cone in cones:
        tags.append(field.add("Ball"))
        values = (cone.centre.real, cone.centre.imag, *cone[1:])
        for name, value in zip(("XCenter", "YCenter", "Radius", "VIn", "VOut", "Thickness"), values, strict=True):
            field.setNumber(tags[-1], name, value)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)


def mesh_faces(job: Job) -> Made:
    """Mesh faces with triangles, conforming along the curves they share.

    Returns
    -------
    nodes (n, 2) in mm; triangles (m, 3), faces (m,) index of each triangle's face; edges (k, 2) of the curves that are
    labelled or bent, edge_labels (k,) text, edge_centres (k,) complex, nan unless on an arc. The middles of the sides
    are added by `mesh.curved`, faster than by gmsh.
    """
    with gmsh_session() as gmsh:
        kernel, mesh = gmsh.model.geo, gmsh.model.mesh
        curves, loops = _draw_loops(kernel, job.faces)
        surfaces = [kernel.addPlaneSurface([loop]) for loop in loops]
        kernel.synchronize()
        for tag, curve in curves.items():
            if curve.label in job.divisions:
                mesh.setTransfiniteCurve(tag, job.divisions[curve.label] + 1)
        _set_sizes(mesh.field, job.cones)
        mesh.generate(2)
        labelled = {tag: curve for tag, curve in curves.items() if curve != DrawnCurve("free", None)}
        tags, xyz, _ = mesh.getNodes()
        place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        place[tags] = np.arange(len(tags))
        triangles = [place[mesh.getElementsByType(TRIANGLE, face)[1].reshape(-1, 3)] for face in surfaces]
        edges = [place[mesh.getElementsByType(EDGE, tag)[1].reshape(-1, 2)] for tag in labelled]
    used, renumbered = np.unique(np.concatenate(triangles), return_inverse=True)  # centres of arcs are no nodes
    back = np.full(len(tags), -1)
    back[used] = np.arange(len(used))
    per_curve = [len(e) for e in edges]
    return {
        "nodes": xyz.reshape(-1, 3)[used, :2],
        "triangles": renumbered.reshape(-1, 3),
        "faces": np.repeat(np.arange(len(surfaces)), [len(t) for t in triangles]),
        "edges": back[np.concatenate(edges)],
        "edge_labels": np.repeat([curve.label for curve in labelled.values()], per_curve),
        "edge_centres": np.repeat([STRAIGHT if c.centre is None else c.centre for c in labelled.values()], per_curve),
    }


def write_extruded(task: Extruded) -> Made:
    """Write a solid as a STEP file, its arcs as cylinders, in mm, and read it back.

    Returns
    -------
    volumes (n,), mm^3, of the n solids in the file, exact mass properties; box (2, 3), mm, lowest and highest corner;
    cylinders (), how many faces are cylinders.
    """
    with gmsh_session() as gmsh:
        kernel = gmsh.model.occ
        _, loops = _draw_loops(kernel, [Face(task.outer, ["free"] * len(task.outer))])
        for centre, radius in task.holes:
            loops.append(kernel.addCurveLoop([kernel.addCircle(centre.real, centre.imag, 0.0, radius)]))
        kernel.extrude([(2, kernel.addPlaneSurface(loops))], 0.0, 0.0, task.thickness)
        kernel.synchronize()
        of_solid = {tag for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(3), False, False, True)}
        kernel.remove([(0, tag) for _, tag in kernel.getEntities(0) if tag not in of_solid])  # centres of the arcs
        kernel.synchronize()
        gmsh.write(task.path)
        gmsh.clear()
        solids = [tag for dim, tag in kernel.importShapes(task.path) if dim == 3]
        kernel.synchronize()
        faces = [gmsh.model.getType(*face) for face in gmsh.model.getEntities(2)]
        return {
            "volumes": np.array([kernel.getMass(3, tag) for tag in solids]),
            "box": np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)),
            "cylinders": np.array(faces.count("Cylinder")),
        }


def main() -> None:
    """Serve one list of requests after the other until standard input ends, or one fails."""
    serve: dict[type, Any] = {Job: mesh_faces, Extruded: write_extruded}
    made = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no part of the mesh
    with suppress(EOFError):
        while True:
            requests = pickle.load(sys.stdin.buffer)
            try:
                answers = [serve[type(request)](request) for request in requests]
            except Exception as error:  # gmsh raises bare Exception; the parent turns this into one line
                sys.exit(f"gmsh: {' '.join(str(error).split())}")
            pickle.dump(answers, made)
            made.flush()


class Limit:
    """Seconds that are `left` for work of several pieces; of a gap between two looks `STEP` at most counts."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def start(self) -> None:
        """Begin to work."""
        self._seen = time.monotonic()

    def look(self) -> None:
        """Take off what has gone since the look before."""
        before, self._seen = self._seen, time.monotonic()
        self.left -= min(self._seen - before, STEP)


class MeshTimeout(ComputationFailed):
    """gmsh was stopped because it took too long."""


def run_mesher(request: Request, time_limit: float | Limit) -> Made:
    """Mesh, or write a solid; as `run_jobs`."""
    return run_jobs([request], time_limit)[0]


def run_jobs(requests: Sequence[Request], time_limit: float | Limit) -> list[Made]:
    """What some requests make, one after the other in one process.

    Raises ComputationFailed when it fails, MeshTimeout when it is still busy after `time_limit` s, SourcesChanged when
    its sources are not those that this process began with.
    """
    while _waiting and not _waiting[-1].alive:
        _waiting.pop().end()
    process = _waiting.pop() if _waiting else _Process()
    try:
        made = process.answer(list(requests), time_limit if isinstance(time_limit, Limit) else Limit(time_limit))
    except BaseException:  # Ctrl-C too: what it still answers would be taken for the answer to the next question
        process.end()
        raise
    if sum(array.nbytes for each in made for array in each.values()) > MOST_KEPT:
        process.end()
    else:
        _waiting.append(process)
    return made


class _Process:
    """A running `main`."""

    def __init__(self) -> None:
        self._said = TemporaryFile()  # noqa: SIM115  open as long as the process
        self._child = Popen(child_command("flexfem.fem.mesher"), stdin=PIPE, stdout=PIPE, stderr=self._said)
        self._request = pickle.dumps(dict(manifest()))

    @property
    def alive(self) -> bool:
        return self._child.poll() is None

    def answer(self, requests: list[Request], limit: Limit) -> list[Made]:
        """As `run_jobs`; no stop of flexfem counts for the limit."""
        self._request += pickle.dumps(requests)
        found: list[list[Made]] = []
        asking, allowed = Thread(target=self._ask, args=(found,), daemon=True), limit.left
        asking.start()
        limit.start()
        while asking.is_alive():
            asking.join(min(LOOK, max(limit.left, 0.0)))
            limit.look()
            if asking.is_alive() and limit.left <= 0:
                raise MeshTimeout(f"gmsh was stopped: not done within {allowed:g} s")
        if not found:
            raise self._failure()
        return found[0]

    def _ask(self, found: list[list[Made]]) -> None:
        """Ask and wait, in a thread; leaves nothing when the process ends before it has answered."""
        assert self._child.stdin and self._child.stdout
        with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
            self._child.stdin.write(self._request)
            self._child.stdin.flush()
            self._request = b""
            found.append(pickle.load(self._child.stdout))

    def _failure(self) -> ComputationFailed | SourcesChanged:
        """Why the process ended: the last line that it said."""
        code = self._child.wait()
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"gmsh ended with exit code {code}"
        return (SourcesChanged if code == CHANGED else ComputationFailed)(reason)

    def end(self) -> None:
        self._child.kill()
        with self._child, self._said:
            pass


_waiting: list[_Process] = []


@atexit.register
def end_processes() -> None:
    """End the processes that wait for jobs."""
    while _waiting:
        _waiting.pop().end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_waiting.clear)  # they are the parent's
