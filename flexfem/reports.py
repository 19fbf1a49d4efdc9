"""What the commands answer, asked from Python: every function gives the record that its command prints.

A command prints its record as a table or, with `--json`, field by field; `flexfem.plot` draws it. What a function needs
is loaded when it is called.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from numpy.typing import ArrayLike

from flexfem import arguments
from flexfem.analytic.model import DEFAULT_FORMULA
from flexfem.files.refusals import checked_path
from flexfem.refused import BadInput, ComputationFailed
from flexfem.stage.feasibility import check_feasible

if TYPE_CHECKING:
    from pathlib import Path

    from flexfem.analytic.fatigue import Basquin, BasquinFit
    from flexfem.arrays import Array
    from flexfem.stage.schema import Stage
    from flexfem.validate.compare import CrossCheck
    from flexfem.validate.registry import BenchmarkTable
    from flexfem.verdicts.records import ClaimsReport
    from flexfem.verify.answers import LoadReport, MeshReport, StageReport, StiffnessReport
    from flexfem.verify.as_built import AsBuilt
    from flexfem.verify.budget import Budget
    from flexfem.verify.case import Direction
    from flexfem.verify.command import Command
    from flexfem.verify.converge import MeshStudy
    from flexfem.verify.drift import Drift
    from flexfem.verify.dynamic_model import DynamicModel
    from flexfem.verify.experiment import Experiment
    from flexfem.verify.fixture import Fixture, Measurement
    from flexfem.verify.identified import Identification, Unknown
    from flexfem.verify.life import Life
    from flexfem.verify.modes import Drives, NaturalModes, Vibration
    from flexfem.verify.protocol import Solved
    from flexfem.verify.reach import Reach
    from flexfem.verify.result import Fields, Result
    from flexfem.verify.solid import SolidReport
    from flexfem.verify.summary import Summary
    from flexfem.verify.workspace import Workspace

RESOLUTION = 8  # quadratic triangles across every neck: the default of `flexfem.solve`
LARGEST_FORCE = 1e9  # N, N mm; no stage of metal bears a millionth of it
LARGEST_DISPLACEMENT = 1e4  # mm, rad; no stage is larger
LARGEST_POSE = 1e2  # of a driven stage, mm, rad; no piezo drive goes a thousandth of it
LARGEST_LOAD = 1e6  # on a driven stage, N, N mm
LARGEST_PAYLOAD = (1e4, 1e10)  # kg, kg mm^2; no stage of necks carries a hundredth of it
MOST_MODES = 100
LARGEST_LIFE = 1e12  # cycles; a thousand years at 30 Hz
LARGEST_AMPLITUDE = 1e3  # mm, rad; whether the stage bears it is found out
Progress = Callable[[str], object]
PathLike = str | os.PathLike[str]


class Verification(NamedTuple):
    """What a case came to: the result that is stored, and the fields of its curves at full command, by label."""

    result: Result
    fields: dict[str, Fields]


def check(stage: Stage) -> StageReport:
    """What is read of a stage: hinges, mobility, where its numbers come from, warnings. Raises BadInput.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.check(flexfem.load("geometry/mobility6.toml"))
    >>> found.mobility, found.chains_alike, found.hinges[0].radius_mm, len(found.assumed)
    (6, True, 4.0, 17)
    """
    from flexfem.verify.answers import report_stage

    check_feasible(stage)
    return report_stage(stage)


def stiffness(
    stage: Stage, mobility: int | None = None, formula: str = DEFAULT_FORMULA, links: bool = False
) -> StiffnessReport:
    """Stiffness and compliance of the platform by the analytic model, with warnings; arguments as of `analyse`.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.stiffness(flexfem.load("geometry/mobility6.toml"), mobility=21, formula="koster")
    >>> found.formula_in_range, found.stiffness.shape
    (True, (3, 3))
    """
    from flexfem.analytic import formulas
    from flexfem.analytic.kinematics import freedoms_of
    from flexfem.analytic.model import analyse
    from flexfem.verify.answers import report_stiffness

    check_feasible(stage)
    formulas.formula(formula)
    freedoms_of(mobility or 3)
    if links and mobility not in (None, 21):
        raise BadInput(f"links with mobility {mobility}, expected 21 or none: elastic links go with all freedoms")
    return report_stiffness(stage, analyse(stage, mobility, formula, links))


def summary(stage: Stage, formula: str | None = None, elements: bool = False, resolution: int = RESOLUTION) -> Summary:
    """How far a stage may go in each direction before a neck yields, and the force that takes.

    Parameters
    ----------
    formula : of the hinges; None takes the calibrated one where it has a value.
    elements : also by finite elements, with so many triangles across every neck (`resolution`).

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse` and `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.summary(flexfem.load("geometry/mobility6.toml"))
    >>> round(found.analytic.limits["x"].range_at_yield, 3), found.analytic.limits["x"].hinge
    (0.659, 'elbow')
    """
    from flexfem.analytic import formulas
    from flexfem.analytic.model import CALIBRATED
    from flexfem.verify import summary as verify

    check_feasible(stage)
    formulas.formula(CALIBRATED if formula is None else formula)
    finest = arguments.resolution(resolution)
    return verify.summary(stage, formula, _solver(None)(stage, finest) if elements else None)


def mesh(stage: Stage, path: PathLike, resolution: int = RESOLUTION) -> MeshReport:
    """Mesh a stage and write it with the groups stage, ground and hub.

    Parameters
    ----------
    path : ends in .msh, .vtu or .inp.   resolution : quadratic triangles across every neck.

    Raises
    ------
    BadInput
        The stage cannot be made or is not plane, or the file cannot be written.
    ComputationFailed
        The mesh does not pass its checks.
    """
    from flexfem.fem.export import check_format, write_mesh
    from flexfem.fem.response import plate_of
    from flexfem.fem.sectors import build_mesh
    from flexfem.files.writing import check_folder
    from flexfem.verify.answers import report_mesh

    target, resolution = checked_path(path), arguments.resolution(resolution)
    check_feasible(stage)
    check_format(target)
    check_folder(target.parent)
    plate, made = plate_of(stage), build_mesh(stage, resolution)
    write_mesh(made, plate, target)
    return report_mesh(stage, made, resolution, str(target))


def under_load(
    stage: Stage,
    force: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    resolution: int = RESOLUTION,
    vtu: PathLike | None = None,
) -> LoadReport:
    """Finite elements at rest, and under a force (3,) or held at a displacement (3,) of the platform.

    Parameters
    ----------
    force : N, N, N mm.   displacement : instead, mm, mm, rad.   Neither : no load.
    vtu : file for displacement (n, 2) and von Mises stress (n,) of all nodes.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; both force and displacement are given, or the file is not called .vtu.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.under_load(flexfem.load("geometry/mobility6.toml"), force=[1.5, 0, 0], resolution=3)
    >>> found.reaction.round(6) + 0.0
    array([-1.5,  0. ,  0. ])
    """
    import numpy as np

    from flexfem.api import solve
    from flexfem.fem.export import write_vtu
    from flexfem.fem.response import load_case
    from flexfem.verify.answers import report_load

    target, load, held = _load_and_file(force, displacement, vtu)
    model = solve(stage, resolution)
    if held is not None:
        load = np.asarray(np.linalg.solve(model.compliance, held), dtype=np.float64)
    solved = model.solved
    case = load_case(stage, solved.mesh, solved.response, load)
    if target is not None:
        write_vtu(solved.mesh, target, {"displacement": case.field, "von_mises": case.stress})
    return report_load(stage, solved, case, resolution)


def under_load_solid(
    stage: Stage,
    force: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    resolution: int | None = None,
    layers: int | None = None,
    vtu: PathLike | None = None,
) -> SolidReport:
    """Finite elements in three dimensions at rest, and under a force (3,) or held at a displacement (3,).

    Parameters
    ----------
    force, displacement, vtu : as of `under_load`; the file holds half of the thickness, stresses too (n, m, 3, 3).
    resolution : quadratic triangles across every neck, from 4.   layers : in half the thickness, from 3.

    Raises
    ------
    BadInput, ComputationFailed
        As `under_load`, for a stage of any model.
    """
    import numpy as np

    from flexfem.fem.export import write_solid_vtu
    from flexfem.fem.solid import sheet_of
    from flexfem.fem.solid_fields import solid_nodal_stress, solid_von_mises
    from flexfem.verify import solid as verify

    target, load, held = _load_and_file(force, displacement, vtu)
    finest = arguments.resolution(verify.RESOLUTION if resolution is None else resolution, 4)
    count = arguments.layers(verify.LAYERS if layers is None else layers, 3)
    check_feasible(stage)
    response = verify.solve_solid(stage, finest, count)
    if held is not None:
        load = np.asarray(np.linalg.solve(response.compliance, held), dtype=np.float64)
    found = verify.report_solid(stage, response, load, finest)
    if target is not None:
        mesh, field = response.mesh, np.tensordot(load, response.fields, axes=1)
        every = np.arange(len(mesh.nodes))
        stress = solid_nodal_stress(mesh, sheet_of(stage), response.layers, field, every)
        told = {
            "displacement": field,
            "von_mises": solid_von_mises(stress),
            "stress": stress.reshape(*field.shape[:2], 9),
        }
        write_solid_vtu(mesh, response.layers.heights, target, told)
    return found


def _load_and_file(
    force: ArrayLike | None, displacement: ArrayLike | None, vtu: PathLike | None
) -> tuple[Path | None, Array, Array | None]:
    """The file to write, the load (3,), and the displacement (3,) to hold. Raises BadInput."""
    import numpy as np

    if force is not None and displacement is not None:
        raise BadInput("force and displacement, expected one of the two")
    target = None if vtu is None else checked_path(vtu)
    if target is not None and target.suffix != ".vtu":
        raise BadInput(f"{vtu}: expected a file name that ends in .vtu")
    load = np.zeros(3) if force is None else arguments.vectors("force", force, 1, LARGEST_FORCE)
    held = None if displacement is None else arguments.vectors("displacement", displacement, 1, LARGEST_DISPLACEMENT)
    return target, load, held


def command(
    stage: Stage,
    pose: ArrayLike,
    load: ArrayLike = (0.0, 0.0, 0.0),
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Command:
    """Strokes and forces of the stacks of a driven stage for a pose, and where its metal goes with them.

    Parameters
    ----------
    pose, load : (3,), of the platform and on it: mm, mm, rad and N, N, N mm.
    mobility, formula, links : of the model that computes the strokes, see `analyse`; without any, calibrated hinges
        and elastic links.
    resolution : of the finite elements; None leaves them out.

    Raises
    ------
    BadInput
        The stage has no actuators, cannot be made, or mobility and formula do not suit it.
    ComputationFailed
        Its commands do not move the platform in three directions, or as `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.command(flexfem.load("geometry/mobility6.toml"), [2e-3, 1e-3, 0], resolution=None)
    >>> [round(1e3 * stroke, 2) for stroke in found.criteria["least energy"].command]  # um, six pairs
    [0.33, 0.29, -0.75, 0.7, 0.42, -1.0]
    """
    from flexfem.analytic import formulas
    from flexfem.verify import command as verify

    check_feasible(stage)
    name = DEFAULT_FORMULA if formula is None else formula
    formulas.formula(name)
    at = arguments.vectors("pose", pose, 1, LARGEST_POSE)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    finest = None if resolution is None else arguments.resolution(resolution)
    asked = formula is not None or mobility is not None or links
    model = (mobility, name, links) if asked else None
    return verify.command(stage, at, loaded, model, finest)


def reach(
    stage: Stage,
    load: ArrayLike = (0.0, 0.0, 0.0),
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Reach:
    """The poses that a drive reaches within its limits: strokes, contacts that only push, blocking forces, yield.

    Parameters
    ----------
    load : (3,), on the platform, N, N, N mm.   mobility, formula, links, resolution : as of `command`.

    Raises
    ------
    BadInput
        As `command`.
    ComputationFailed
        The limits allow no pose at all, or as `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.reach(flexfem.load("geometry/mobility6.toml"), resolution=None)
    >>> x = found.ranges["x"]
    >>> round(1e3 * x.held.high, 1), round(1e3 * x.free.high, 1), len(found.faces)  # um
    (24.0, 28.7, 30)
    """
    from flexfem.analytic import formulas
    from flexfem.verify import reach as verify

    check_feasible(stage)
    formulas.formula(DEFAULT_FORMULA if formula is None else formula)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    finest = None if resolution is None else arguments.resolution(resolution)
    asked = formula is not None or mobility is not None or links
    return verify.reach(stage, loaded, (mobility, formula or DEFAULT_FORMULA, links) if asked else None, finest)


def drift(
    stage: Stage,
    mobility: int | None = None,
    formula: str | None = None,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Drift:
    """What one kelvin, and gradients of 1 K/mm along X and Y about the platform's centre, do to a stage on its frame.

    Parameters
    ----------
    mobility, formula, links : of the analytic model, as of `command`.
    resolution : of the finest of three meshes of finite elements, from 4; None leaves them out.

    Raises
    ------
    BadInput
        The stage says no `material.expansion_um_per_m_k`, cannot be made, or mobility and formula do not suit it.
    ComputationFailed
        As `flexfem.solve`.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.drift(flexfem.load("geometry/mobility6.toml"), resolution=None).cases
    >>> round(1e6 * found["uniform"].analytic.pose[2], 2)  # urad/K; none in x and y, by symmetry
    5.52
    >>> [round(1e3 * value, 2) for value in found["gradient in x"].analytic.pose[:2]]  # um per K/mm
    [-22.36, 3.0]
    """
    from flexfem.analytic import formulas
    from flexfem.verify import drift as verify

    check_feasible(stage)
    formulas.formula(DEFAULT_FORMULA if formula is None else formula)
    finest = None if resolution is None else arguments.resolution(resolution, 4)
    asked = formula is not None or mobility is not None or links
    return verify.drift(stage, (mobility, formula or DEFAULT_FORMULA, links) if asked else None, finest)


def modes(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
) -> NaturalModes:
    """Natural frequencies and modes in the plane, by finite elements with bands and by the analytic models.

    Parameters
    ----------
    count : how many, from the lowest.
    payload : mass, kg, and moment of inertia about the platform centre, kg mm^2, of what the platform carries there.
    drives : "engaged" adds the stiffness of the stacks, which hold their strokes; their mass is left out.
    resolution : of the finest of three meshes.   progress : called with a line after each mesh.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; drives are engaged that the stage does not have.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.modes(flexfem.load("geometry/mobility6.toml"), count=3, resolution=4)
    >>> [round(one.frequency) for one in found.modes]  # Hz
    [131, 131, 194]
    """
    return vibration(stage, count, payload, drives, resolution, progress).record


def vibration(
    stage: Stage,
    count: int = 6,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
) -> Vibration:
    """As `modes`, with the shapes of the modes and the structure that has them."""
    from flexfem.verify import modes as verify

    check_feasible(stage)
    wanted = arguments.integer("count", count, MOST_MODES)
    if drives not in verify.DRIVES:
        raise BadInput(f"drives {drives!r}, expected {' or '.join(verify.DRIVES)}")
    given = arguments.pair("payload", payload, LARGEST_PAYLOAD, "mass (kg) and moment of inertia (kg mm^2)")
    carried = verify.payload_of(*given)
    return verify.natural_modes(stage, wanted, carried, drives, arguments.resolution(resolution, 4), progress)


def dynamic_model(
    stage: Stage,
    count: int = 12,
    payload: tuple[float, float] = (0.0, 0.0),
    drives: Drives = "disengaged",
    damping: float = 1.0,
    resolution: int = RESOLUTION,
) -> DynamicModel:
    """How the platform answers loads and, of engaged drives, strokes: frequency response, state space, Craig-Bampton.

    Parameters
    ----------
    count : of modes kept; what the others do at rest is added.   damping : of every mode, % of critical; assumed.
    payload, drives, resolution : as of `modes`.

    Raises
    ------
    BadInput, ComputationFailed
        As `modes`.
    """
    found = vibration(stage, count, payload, drives, resolution)
    return reduced(stage, found, damping)


def reduced(stage: Stage, found: Vibration, damping: float = 1.0) -> DynamicModel:
    """As `dynamic_model`, of modes that are known."""
    from flexfem.stage.drives import drive_of
    from flexfem.verify import dynamic_model as verify

    ratio = arguments.positive("damping", damping, 99.0) / 100
    drive = drive_of(stage) if found.record.drives == "engaged" else None
    return verify.dynamic_model(found.structure, found.modes, ratio, drive)


def experiment(
    stage: Stage,
    fixture: PathLike | Fixture,
    measured: PathLike | None = None,
    mobility: int | None = None,
    formula: str = DEFAULT_FORMULA,
    links: bool = False,
    resolution: int | None = RESOLUTION,
) -> Experiment:
    """Simulate the stiffness experiment of Section VI: pushes, readings, slopes with intervals, and Table II.

    Parameters
    ----------
    fixture : file of the set-up, see cases/README.md, or what is read from one.
    measured : file of measured slopes to compare; by default those of the fixture, where it has some.
    mobility, formula, links : of the model in the table, see `analyse`.
    resolution : of the finite elements that stand for the metal; None takes calibrated hinges and elastic links.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse` and `flexfem.solve`; a file cannot be used.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.experiment(flexfem.load("geometry/mobility6.toml"), "cases/fixture.toml", resolution=None)
    >>> round(found.alone["theta"].ratio, 2), round(found.alone["x"].ratio, 1)  # K_theta, K_xx: 31 % and 2.6 % softer
    (2.23, 37.5)
    """
    from flexfem.analytic import formulas
    from flexfem.verify import experiment as verify
    from flexfem.verify.fixture import Fixture, read_fixture, read_measured

    check_feasible(stage)
    formulas.formula(formula)
    finest = None if resolution is None else arguments.resolution(resolution)
    of = fixture if isinstance(fixture, Fixture) else read_fixture(checked_path(fixture))
    slopes = None if measured is None else read_measured(checked_path(measured))
    solved = None if finest is None else _solver(None)(stage, finest)
    return verify.experiment(stage, of, slopes, (mobility, formula, links), solved)


def identify(
    stage: Stage, measured: PathLike | Fixture | Measurement, unknown: Unknown | None = None, confidence: float = 95.0
) -> Identification:
    """Fit a common offset of the nine necks and a soft fixture to measured slopes, with intervals.

    Parameters
    ----------
    measured : file of measured slopes with standard deviations, with the set-up or without; or what is read from one.
    unknown : of the fixture: "pole", how much softer than described its pole is, or "springs", one in translation and
        one in rotation instead; None takes the pole where one is described.
    confidence : of the intervals, per cent, from 50 to 99.9.

    Raises
    ------
    BadInput
        The file cannot be used, or gives no slopes or standard deviations.
    """
    from flexfem.verify import identify as verify
    from flexfem.verify.fixture import Fixture, Measurement, read_measured

    check_feasible(stage)
    if unknown not in (None, "pole", "springs"):
        raise BadInput(f"unknown {unknown!r}, expected pole or springs")
    if not arguments.positive("confidence", confidence, 99.9) >= 50:
        raise BadInput(f"confidence {confidence!r}, expected a number from 50 to 99.9")
    given = measured if isinstance(measured, Fixture | Measurement) else read_measured(checked_path(measured))
    return verify.identify(stage, given, unknown, confidence)


def as_built(
    stage: Stage,
    necks: PathLike,
    mobility: int | None = None,
    formula: str = DEFAULT_FORMULA,
    links: bool = False,
) -> AsBuilt:
    """The stiffness of a stage with its nine measured necks, and its scatter by that of the measurement.

    Parameters
    ----------
    necks : CSV file with columns chain, hinge, neck_um and, if known, sd_um; or TOML with these in [[neck]].
    mobility, formula, links : of the model, see `analyse`.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.analyse`; the file cannot be used, or the stage not made with these necks.
    """
    from flexfem.analytic import formulas
    from flexfem.verify import as_built as verify

    check_feasible(stage)
    formulas.formula(formula)
    return verify.as_built(stage, verify.read_necks(checked_path(necks), stage), mobility, formula, links)


def life(
    stage: Stage,
    amplitude: ArrayLike,
    mean: ArrayLike | None = None,
    ratio: float = -1.0,
    cycles: float = 1e6,
    law: Basquin | BasquinFit | None = None,
    resolution: int | None = RESOLUTION,
    progress: Progress | None = None,
) -> Life:
    """Cycles to failure of the necks at an amplitude of the platform, and the amplitude for a wanted life.

    Parameters
    ----------
    amplitude : (3,), of the pose about its mean, mm, mm, rad; the platform is held in all directions.
    mean : (3,), of the pose; by default that of `ratio`, with which it grows for the wanted life.
    ratio : least displacement over the greatest, from -1 to 0.99; -1 is fully reversed.
    cycles : the wanted life.
    law : of Basquin, or a fit of it; None takes the material's own.
    resolution : of the finest of three meshes; None leaves finite elements out.   progress : called after each mesh.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the material has no fatigue constants.

    Examples
    --------
    >>> import flexfem
    >>> stage = flexfem.load("geometry/mobility6.toml").replace(material="al-2024-t4")
    >>> found = flexfem.life(stage, [0.1, 0, 0], resolution=None)
    >>> neck = found.analytic.necks[found.analytic.first]
    >>> round(neck.equivalent, 1), neck.hinge, f"{neck.cycles:.3g}"
    (77.7, 'elbow', '1.35e+10')
    """
    from flexfem.analytic.fatigue import checked_law, law_of
    from flexfem.stage.materials import materials
    from flexfem.verify import life as verify

    check_feasible(stage)
    moved = arguments.vectors("amplitude", amplitude, 1, LARGEST_POSE)
    if not moved.any():
        raise BadInput("amplitude: expected a motion, not zero in all directions")
    about = None if mean is None else arguments.vectors("mean", mean, 1, LARGEST_POSE)
    if not isinstance(ratio, int | float) or not -1 <= ratio <= 0.99:
        raise BadInput(f"ratio {ratio!r}, expected a number from -1 to 0.99: least over greatest displacement")
    if about is not None and ratio != -1:
        raise BadInput("mean and ratio, expected one of the two")
    wanted = arguments.positive("cycles", cycles, LARGEST_LIFE)
    finest = None if resolution is None else arguments.resolution(resolution, 4)
    taken = law_of(stage.material) if law is None else checked_law(law)
    if taken is None:
        known = ", ".join(name for name, each in materials().items() if law_of(each))
        raise BadInput(
            f"{verify.KEY} is missing: expected fatigue constants, as {known} have them, or a fit of S-N points"
        )
    source = verify.source_in(stage) if law is None else "given in Python or fitted to S-N points"
    asked = verify.Asked(verify.scaled(moved, about, float(ratio)), taken, source, wanted)
    return verify.life(stage, asked, finest, _solver(progress))


def budget(
    stage: Stage,
    amplitudes: Mapping[Direction, float] | None = None,
    resolution: int = RESOLUTION,
    progress: Progress | None = None,
    three_dimensional: bool = True,
) -> Budget:
    """Split the error of the stage's own analytic model into named shares that add up to it.

    Parameters
    ----------
    amplitudes : commands by direction at which the share of large displacements is taken, mm, mm, rad; by default
        0.05, 0.05 and 0.001.
    resolution : of the finest of three meshes.   progress : called with a line after each mesh.
    three_dimensional : measure what three dimensions change, too.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; a hinge is not on the hinge chart.
    """
    from flexfem.verify import budget as verify
    from flexfem.verify import solid

    check_feasible(stage)
    at = arguments.by_name("amplitudes", amplitudes, verify.AMPLITUDES, LARGEST_AMPLITUDE)
    found = verify.budget(stage, at, arguments.resolution(resolution, 4), _solver(progress))
    return solid.measured(stage, found) if three_dimensional else found


def workspace(
    stage: Stage,
    amplitude: float = 0.5,
    resolution: int = 4,
    progress: Progress | None = None,
    load: ArrayLike = (0.0, 0.0, 0.0),
) -> Workspace:
    """What large displacements do, and the poses that a drive reaches.

    Parameters
    ----------
    amplitude : mm, of displacements in X and Y; in theta 0.02 rad for every mm.
    resolution : of the finite elements.   progress : called with a line after the mesh is solved.
    load : (3,), on the platform of a driven stage, N, N, N mm, see `reach`.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; a pose is out of reach.
    """
    from flexfem.verify import workspace as verify

    check_feasible(stage)
    largest = arguments.positive("amplitude", amplitude, LARGEST_AMPLITUDE)
    loaded = arguments.vectors("load", load, 1, LARGEST_LOAD)
    if loaded.any() and not stage.actuator:
        raise BadInput("load: expected none, it is for the poses of a drive and the stage has no [[actuator]]")
    found = verify.workspace(stage, largest, arguments.resolution(resolution), _solver(progress))
    if not stage.actuator:
        return found.model_copy(update={"no_reach": "no [[actuator]]: which poses a drive reaches is not known"})
    try:
        return found.model_copy(update={"reach": reach(stage, loaded, resolution=resolution)})
    except ComputationFailed as failure:
        return found.model_copy(update={"no_reach": str(failure)})


def converge(stage: Stage, resolutions: Sequence[int] | None = None, progress: Progress | None = None) -> MeshStudy:
    """Platform compliance on finer and finer meshes: observed order, extrapolated value, band.

    Parameters
    ----------
    resolutions : triangles across every neck, coarse to fine, three or more.   progress : called after each mesh.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the resolutions are too few or too near.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.converge(flexfem.load("geometry/mobility6.toml"), [2, 3, 4])
    >>> found.uncertainty["x"].resolutions
    [2, 3, 4]
    """
    from flexfem.verify import converge as verify

    check_feasible(stage)
    levels = arguments.resolutions(verify.RESOLUTIONS if resolutions is None else resolutions)
    return verify.converge(stage, verify.checked_resolutions(levels), _solver(progress))


def verification(path: PathLike) -> Verification:
    """Run a case file: the force of (18) applied to the finite elements, and the errors (Section V, Figs. 5 to 7).

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the file cannot be used.
    """
    from flexfem.verify.case import LoadedCase
    from flexfem.verify.protocol import run_case

    return Verification(*run_case(LoadedCase(checked_path(path)), _solver(None)))


def claims(path: PathLike, progress: Callable[[int, int], object] | None = None) -> ClaimsReport:
    """Measure what a file of claims says, with verdicts and alternatives.

    Parameters
    ----------
    progress : is told how many of how many pairs of an ensemble are seen to.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the file cannot be used, or no pair of its ensemble can be made.
    """
    from flexfem.verdicts.verdict import report_claims

    return report_claims(checked_path(path), watch=progress or (lambda done, of: None))


def cross_check(
    stage: Stage, solver: str = "ngsolve", resolution: int | None = None, three_dimensional: bool = False
) -> CrossCheck:
    """Solve the same mesh by another program, ngsolve or calculix, and compare.

    Parameters
    ----------
    resolution : triangles across every neck; by default 8, or 2 in three dimensions, with two layers.

    Raises
    ------
    BadInput, ComputationFailed
        As `flexfem.solve`; the solver is not known or not installed.
    """
    from flexfem.validate import compare

    check_feasible(stage)
    if three_dimensional:
        coarse = compare.SOLID_RESOLUTION if resolution is None else resolution
        return compare.cross_check_solid(stage, arguments.resolution(coarse), solver)
    return compare.cross_check(stage, arguments.resolution(RESOLUTION if resolution is None else resolution), solver)


def benchmark(names: Sequence[str] | None = None, progress: Progress | None = None) -> BenchmarkTable:
    """Solve published problems with known answers, all or those named. Raises BadInput, ComputationFailed.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.benchmark(["patch-test"]).passed
    True
    """
    from flexfem.validate.registry import run_benchmarks

    return run_benchmarks(names, progress)


def _solver(progress: Progress | None) -> Callable[[Stage, int], Solved]:
    """Finite elements that are kept with their stage, so that several questions solve a mesh once."""
    from flexfem.api import solved

    def solve(stage: Stage, resolution: int) -> Solved:
        found = solved(stage, resolution)
        if progress is not None:
            progress(f"{found.response.unknowns} unknowns")
        return found

    return solve
