"""Template files, drawings and meshes of mechanisms, and the list of hinge formulas."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from functools import partial
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem import arguments
from flexfem.arrays import short_repr
from flexfem.files.refusals import checked_path, nearest, place_of, shown
from flexfem.files.toml import require_plain_stem
from flexfem.files.writing import check_file, check_folder, write_atomically
from flexfem.importing.departure import drawn_polygon
from flexfem.importing.drawings import NO_READING, Reading, imported, is_drawing, require_no_reading
from flexfem.mechanism.content import naming_place
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.loading import read_drawable
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.mechanism.plate import clashes
from flexfem.mechanism.unfinished import Unfinished
from flexfem.refused import BadInput
from flexfem.results.records import record_parts
from flexfem.sources import PACKAGE, read_data

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flexfem.plot.plate import Recognised
    from flexfem.results import TextTable

UM = 1e-3  # mm
MPA_PER_GPA = 1e3
MECHANISMS = tuple(
    file.stem.removeprefix("mechanism-")
    for file in sorted((PACKAGE / "data").glob("mechanism-*.toml"))
)


class NewFiles(NamedTuple):
    """Files written, the stage first, suggested next commands, and warnings on the numbers."""

    written: list[str]
    commands: list[str]
    warnings: list[str]


class View(NamedTuple):
    """Drawing of a file: files written, whether a window was opened, and what is missing in it."""

    file: str
    name: str
    written: list[str]
    window: bool
    missing: list[str]
    assumed: list[str]
    not_stated: list[str]


class _Template(NamedTuple):
    """A file of `data` that is written, and the commands that can be run with it."""

    name: str
    commands: tuple[str, ...]


def new_stage(
    file: Path, *, kind: str | None = None, case: bool = False, study: bool = False
) -> NewFiles:
    """Write a commented file of one of eight mechanisms, or of the paper's stage.

    Parameters
    ----------
    file : path
        File to write, .toml; must not exist yet.
    kind : str, optional
        Kind of mechanism: parallelogram, double-parallelogram, pivot, lever-amplifier,
        bridge-amplifier, rhombic-amplifier, xy-stage or four-chains. By default the stage of the
        paper, with three chains and nine hinges.
    case : bool
        Also write a case of this stage, FILE-case.toml, for verify.
    study : bool
        Also write a study of this stage, FILE-study.toml, for study run.

    Raises
    ------
    BadInput
        A file exists already or cannot be written; then nothing is written.
    """
    path = checked_path(file)
    templates = _templates(path, kind, case, study)
    for new in templates:
        check_file(new)
        if new.exists() or new.is_symlink():
            raise BadInput(
                f"{place_of(new)}: exists, expected the name of a new file; nothing is written"
            )
    name = json.dumps(path.name, ensure_ascii=False)
    commands = list[str]()
    for new, template in templates.items():
        text = read_data(f"{template.name}.toml").replace('"stage.toml"', name)
        write_atomically(new, methodcaller("write", text.encode()))
        commands += [f"flexfem {each} {shlex.quote(str(new))}" for each in template.commands]
    whose = "flexfem's reference stage" if kind is None else "an example"
    warning = f"all numbers are those of {whose}: they are assumed, replace them with your own"
    return NewFiles([*map(str, templates)], commands, [warning])


def _templates(
    path: Path,
    kind: str | None,
    case: bool,
    study: bool,
) -> dict[Path, _Template]:
    """Return the templates by the files to write. Raises BadInput for options that do not fit."""
    if path.suffix != ".toml":
        raise BadInput(
            f"{place_of(path)}: expected a file name that ends in .toml, such as stage.toml"
        )
    require_plain_stem(path)
    if kind is not None:
        if kind not in MECHANISMS:
            raise BadInput(
                f"--kind = {shown(kind)}, expected a kind of mechanism{nearest(kind, MECHANISMS)}"
            )
        if case or study:
            raise BadInput(
                "--kind: cases and studies are those of the stage with nine hinges, expected no "
                "--case or --study"
            )
        return {path: _Template(f"mechanism-{kind}", ("check", "view", "live", "stiffness"))}
    templates = {path: _Template("new-stage", ("check", "summary", "stiffness"))}
    if case:
        templates[path.with_stem(f"{path.stem}-case")] = _Template("new-case", ("verify",))
    if study:
        templates[path.with_stem(f"{path.stem}-study")] = _Template("new-study", ("study run",))
    return templates


def view(
    file: Path,
    *,
    output: Path | None = None,
    reading: Reading = NO_READING,
) -> View:
    """Draw a mechanism, of a stage with its dimensions, in a window if possible.

    Of an unfinished mechanism file it draws what there is, and names what is missing. Of a drawing
    it shows the bodies and hinges that were recognised over the drawing, and in red thin parts that
    are no hinges.

    Parameters
    ----------
    file : path
        Mechanism or stage file, or a drawing.
    output : path, optional
        Folder of the picture, or its file, .png, .pdf or .svg; default: a window if there is a
        display, otherwise the current folder.
    reading : Reading
        Of a drawing: its thickness, material, ground, output and so on.

    Raises
    ------
    BadInput
        The file cannot be read, has no body that can be drawn, or is an invalid stage file; the
        folder is not writable; or the parts of the mechanism do not fit together. In the
        last case it is drawn, with the parts at fault in red, before the error is raised.
    """
    from flexfem.plot.drawing import show_window

    source = checked_path(file)
    target = None if output is None else checked_path(output)
    picture = target if target is not None and _is_picture(target) else None
    if picture is not None:
        check_file(picture, source)
    drawable = _drawable(source, reading)
    refusal = _refusal(drawable)
    if refusal is not None:
        layout = drawable.file.mechanism.layout_as_drawn
        drawable = drawable._replace(file=drawable.file._replace(layout=layout))
    mechanism = drawable.file.mechanism
    missing = drawable.file.missing
    draw = partial(_draw, drawable=drawable, refusal=refusal)
    window = target is None and show_window(draw, mechanism.name)
    written = list[Path]()
    if not window:
        folder = target or Path()
        written = _write(drawable, refusal, picture, folder / f"{source.stem}-drawing.json")
    if refusal is not None:
        where = f"; drawn in {written[0]}" if written else ""
        raise BadInput(f"{refusal}{where}")
    about = of_stage(mechanism)
    if missing:
        about |= {"file": str(source)}
    return View(**about, written=list(map(str, written)), window=window, missing=list(missing))


class _Drawable(NamedTuple):
    """What can be drawn of a file, and what was recognised if it is a drawing."""

    file: Unfinished
    recognised: Recognised | None


def _is_picture(path: Path) -> bool:
    from flexfem.plot.write import PICTURES

    return path.suffix in PICTURES and not path.is_dir()


def _drawable(source: Path, reading: Reading) -> _Drawable:
    """Read what can be drawn of a file. Raises BadInput."""
    from flexfem.plot.plate import Recognised

    if not is_drawing(source):
        require_no_reading(source, reading)
        return _Drawable(read_drawable(source), None)
    report = imported(source, reading)
    hinges = frozenset(hinge.name for hinge in report.mechanism.hinge)
    recognised = Recognised(drawn_polygon(report.found.drawing), report.slender, hinges)
    return _Drawable(Unfinished(report.mechanism, None, []), recognised)


def _refusal(drawable: _Drawable) -> BadInput | None:
    """Return why a mechanism cannot be made, unless that is known to be missing."""
    mechanism = drawable.file.mechanism
    if mechanism.origin.path is None:  # of an unfinished file only parts are read
        return None
    try:
        check_feasible(mechanism)
    except BadInput as refusal:
        if refusal.reason not in drawable.file.missing:
            return refusal
    return None


def _draw(
    ax: Axes,
    drawable: _Drawable,
    refusal: BadInput | None,
) -> None:
    """Draw a mechanism on axes, with the parts at fault in red."""
    from flexfem.plot.plate import plot_plate

    mechanism, layout, _ = drawable.file
    plot_plate(ax, mechanism, layout=layout, recognised=drawable.recognised)
    _mark(ax, drawable, refusal)


def _mark(
    ax: Axes,
    drawable: _Drawable,
    refusal: BadInput | None,
) -> None:
    from flexfem.plot.drawing import mark_clashes

    layout = drawable.file.layout
    at_fault: Sequence[Any] = []
    if refusal is not None and layout is not None:
        at_fault = clashes(layout, refusal)
    mark_clashes(ax, refusal, at_fault)


def _write(
    drawable: _Drawable, refusal: BadInput | None, picture: Path | None, beside: Path
) -> list[Path]:
    """Write a drawing as a picture, or else as PNG and PDF beside a path; return the files."""
    from flexfem.plot.plate import drawing_figure
    from flexfem.plot.write import write_beside, write_picture

    if picture is None:
        check_folder(beside.parent)
    mechanism, layout, missing = drawable.file
    figure: Figure = drawing_figure(
        mechanism, layout, missing=missing, recognised=drawable.recognised
    )
    _mark(figure.axes[0], drawable, refusal)
    if picture is None:
        return write_beside(beside, figure)
    return [write_picture(picture, figure)]


class MeshReport(NamedTuple):
    """A mesh and the file it was written to."""

    file: str
    name: str
    written: str
    resolution: int
    nodes: int
    triangles: int
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def mesh(
    mechanism: Mechanism,
    output: Path,
    *,
    resolution: int | None = None,
) -> MeshReport:
    """Mesh a mechanism and write the mesh with named groups.

    The groups are bodies, hinges and clamped edges; of a stage: stage, ground and hub.

    Parameters
    ----------
    output : path
        File to write: .msh, .vtu or .inp.
    resolution : int, optional
        Triangles across every neck, from 2.

    Raises
    ------
    BadInput
        The mechanism cannot be made or is not plane, or the file cannot be written.
    """
    from flexfem.fem.export import check_format
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.questions import warnings as warning

    target = checked_path(output)
    finest = arguments.resolution(RESOLUTION if resolution is None else resolution)
    check_format(target)
    check_file(target)
    write = mechanism.answering("write_mesh_of") or write_mesh_of
    made = write(mechanism, target, finest)
    return MeshReport(
        **of_stage(mechanism),
        written=str(target),
        resolution=finest,
        nodes=len(made.nodes),
        triangles=len(made.triangles),
        warnings=warning.of_numbers(mechanism),
    )


def write_mesh_of(
    mechanism: Mechanism,
    target: Path,
    resolution: int,
) -> Any:
    """Write a mesh with the groups bodies, hinges and clamped edges; return it."""
    from flexfem.fem.export import write_plate_mesh
    from flexfem.fem.plate_mesh import mesh_layout

    with naming_place(mechanism):
        made = mesh_layout(mechanism.layout, resolution)
    write_plate_mesh(made, mechanism.layout, target)
    return made


@short_repr
class HingeFormulas(NamedTuple):
    """Hinge formulas by name with source, freedoms and range, closed forms by hinge shape, and
    files.

    written : the figures.
    """

    formulas: dict[str, Any]
    shapes: dict[str, Any]
    written: list[str]


def hinge_formulas(*, output: Path | None = None) -> HingeFormulas:
    """List the hinge formulas with source, freedoms and range; compare them in figures.

    The figures compare the formulas with finite elements.

    Parameters
    ----------
    output : path, optional
        Folder of the figures.
    """
    from flexfem.questions.check import hinge_review, known_formulas, known_shapes, thickness_review

    written = list[Path]()
    if output is not None:
        from flexfem.plot.hinge import hinge_chart_figure, thickness_figure
        from flexfem.plot.write import write_each

        check_folder(output)
        figures = {
            output / "hinge-chart.json": lambda: hinge_chart_figure(hinge_review()),
            output / "hinge-thickness.json": lambda: thickness_figure(thickness_review()),
        }
        written = write_each(figures)
    return HingeFormulas(known_formulas(), known_shapes(), [str(path) for path in written])


class StackEntry(NamedTuple):
    """A stack of the catalogue at its highest voltage, with its overall length and its mass."""

    name: str
    stroke_um: float
    tolerance_um: float
    stiffness_n_per_um: float
    blocking_force_n: float
    voltage_v: float
    length_mm: float
    mass: str


class MaterialEntry(NamedTuple):
    """A registered material: elastic constants, strength, and constants of fatigue if any."""

    name: str
    youngs_modulus_gpa: float
    density_kg_m3: float
    yield_strength_mpa: float
    fatigue_strength_coefficient_mpa: float | None
    fatigue_strength_exponent: float | None


class ShapeEntry(NamedTuple):
    """A shape of hinges and the keys of its dimensions in a mechanism file."""

    shape: str
    keys: str
    optional_keys: str


@short_repr
class Catalogue(NamedTuple):
    """Stacks, materials and shapes of hinges that files may name.

    sources : of stacks and materials, by name.
    """

    stacks: list[StackEntry]
    materials: list[MaterialEntry]
    hinge_shapes: list[ShapeEntry]
    sources: dict[str, str]

    def heading(self) -> str:
        """Return what the tables are."""
        return "stacks, materials and hinge shapes that a mechanism file may name"

    def tables(self) -> list[TextTable]:
        """Return the tables of stacks, materials and shapes."""
        return record_parts(self._replace(sources={}))[1]

    def sentences(self) -> list[str]:
        """Return the sources; stacks and materials with the same one share a line."""
        facts, _ = record_parts(self._replace(stacks=[], materials=[], hinge_shapes=[]))
        return ["sources:", *(f"{names}: {source}" for names, source in facts)]


def catalogue() -> Catalogue:
    """List the stacks, the materials and the shapes of hinges that files may name.

    Stacks have their stroke, stiffness and blocking force at the highest voltage. No source states
    their mass, and no answer uses it or their length. `life` needs a material with fatigue
    constants.
    """
    from flexfem.mechanism.actuators import catalogue as stacks_by_name
    from flexfem.mechanism.materials import REGISTERED, materials

    stacks = stacks_by_name()
    known = materials()
    sources = {name: stack.source for name, stack in stacks.items()}
    for name in known:
        entry = REGISTERED[name]
        sources[name] = "; ".join(dict.fromkeys([entry.source, *entry.sources.values()]))
    return Catalogue(
        [_stack_entry(stack) for stack in stacks.values()],
        [_material_entry(material) for material in known.values()],
        _shape_entries(),
        sources,
    )


def _stack_entry(stack: Any) -> StackEntry:
    return StackEntry(
        stack.name,
        float(f"{stack.stroke / UM:.6g}"),
        float(f"{stack.tolerance / UM:.6g}"),
        float(f"{UM * stack.blocking_force / stack.stroke:.4g}"),
        stack.blocking_force,
        stack.voltage,
        stack.length,
        "not stated",
    )


def _material_entry(material: Any) -> MaterialEntry:
    return MaterialEntry(
        material.name,
        float(f"{material.youngs_modulus / MPA_PER_GPA:.6g}"),
        material.density,
        material.yield_strength,
        material.fatigue_strength_coefficient,
        material.fatigue_strength_exponent,
    )


def _shape_entries() -> list[ShapeEntry]:
    """Return the keys of every shape of hinges, with their units, as in a mechanism file."""
    from dataclasses import MISSING, fields

    from flexfem.mechanism.parts import PlateHinge
    from flexfem.mechanism.profile_shape import FILE_KEYS
    from flexfem.mechanism.profiles import SHAPES

    entries = list[ShapeEntry]()
    for shape, profile in SHAPES.items():
        needed = list[str]()
        optional = list[str]()
        for each in fields(profile):
            name = FILE_KEYS.get(each.name, each.name)
            if each.init and name in PlateHinge.model_fields:
                key = PlateHinge.model_fields[name].alias or name
                (needed if each.default is MISSING else optional).append(key)
        entries.append(ShapeEntry(shape, ", ".join(needed), ", ".join(optional)))
    return entries
