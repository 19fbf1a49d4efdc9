"""Template files, drawings and meshes of stages and mechanisms, and the list of hinge formulas."""

from __future__ import annotations

import json
import shlex
from functools import partial
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem import arguments
from flexfem.arrays import brief
from flexfem.files.refusals import checked_path, nearest, place_of, shown
from flexfem.files.toml import kind_of, read_toml, require_plain_stem
from flexfem.files.writing import check_file, check_folder, write_atomically
from flexfem.importing.departure import drawn_polygon
from flexfem.importing.drawings import NO_READING, Reading, imported, is_drawing, require_no_reading
from flexfem.mechanism.content import located
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism, of_stage
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.plate import clashes
from flexfem.mechanism.unfinished import read_drawable
from flexfem.paper.bodies import stage_layout
from flexfem.paper.stage import Stage, load_stage
from flexfem.refused import BadInput
from flexfem.sources import PACKAGE, read_data

if TYPE_CHECKING:
    from flexfem.plot.plate import Recognised

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
    """Drawing of a stage or mechanism file: files written, whether a window was opened, and what is
    missing in it.
    """

    file: str
    name: str
    written: list[str]
    window: bool
    missing: list[str]
    assumed: list[str]
    not_stated: list[str]


def new_stage(
    file: Path, *, kind: str | None = None, case: bool = False, study: bool = False
) -> NewFiles:
    """Write a commented template of a stage or mechanism file.

    Parameters
    ----------
    file : path
        File to write, .toml; must not exist yet.
    kind : str, optional
        Kind of mechanism: parallelogram, double-parallelogram, pivot, lever-amplifier,
        bridge-amplifier, rhombic-amplifier, xy-stage or four-chains. By default the stage with
        three chains and nine hinges.
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
    if path.suffix != ".toml":
        raise BadInput(
            f"{place_of(path)}: expected a file name that ends in .toml, such as stage.toml"
        )
    require_plain_stem(path)
    if kind is not None and kind not in MECHANISMS:
        raise BadInput(
            f"--kind = {shown(kind)}, expected a kind of mechanism{nearest(kind, MECHANISMS)}"
        )
    if kind is not None and (case or study):
        raise BadInput(
            "--kind: cases and studies are those of the stage with nine hinges, expected no "
            "--case or --study"
        )
    template, shown_by = ("new-stage", "summary") if kind is None else (f"mechanism-{kind}", "view")
    made: dict[Path, tuple[str, tuple[str, ...]]] = {
        path: (template, ("check", shown_by, "stiffness"))
    }
    if case:
        made[path.with_stem(f"{path.stem}-case")] = "new-case", ("verify",)
    if study:
        made[path.with_stem(f"{path.stem}-study")] = "new-study", ("study run",)
    for new in made:
        check_file(new)
        if new.exists() or new.is_symlink():
            raise BadInput(
                f"{place_of(new)}: exists, expected the name of a new file; nothing is written"
            )
    for new, (template, _) in made.items():
        text = read_data(f"{template}.toml").replace(
            '"stage.toml"', json.dumps(path.name, ensure_ascii=False)
        )
        write_atomically(new, methodcaller("write", text.encode()))
    whose = "flexfem's reference stage" if kind is None else "an example"
    return NewFiles(
        [*map(str, made)],
        [
            f"flexfem {name} {shlex.quote(str(new))}"
            for new, (_, commands) in made.items()
            for name in commands
        ],
        [f"all numbers are those of {whose}: they are assumed, replace them with your own"],
    )


def view(file: Path, *, output: Path | None = None, reading: Reading = NO_READING) -> View:
    """Draw a mechanism, or a stage with its dimensions, in a window if possible.

    Of an unfinished mechanism file it draws what there is, and names what is missing. Of a drawing
    it shows the bodies and hinges that were recognised over the drawing, and in red thin parts that
    are no hinges.

    Parameters
    ----------
    file : path
        Stage or mechanism file, or a drawing.
    output : path, optional
        Folder of the picture, or its file, .png, .pdf or .svg; default: a window if there is a
        display, otherwise the current folder.
    reading : Reading
        Of a drawing: its thickness, material, ground, output and so on.

    Raises
    ------
    BadInput
        The file cannot be read, has no body that can be drawn, or is an invalid stage file; the
        folder is not writable; or the parts of the stage or mechanism do not fit together. In the
        last case it is drawn, with the parts at fault in red, before the error is raised.
    """
    from flexfem.plot.drawing import mark_clashes, show_window
    from flexfem.plot.plate import drawing_figure, plot_plate
    from flexfem.plot.write import PICTURES, write_beside, write_picture

    source = checked_path(file)
    target = None if output is None else checked_path(output)
    picture = (
        target if target is not None and target.suffix in PICTURES and not target.is_dir() else None
    )
    if picture is not None:
        check_file(picture, source)
    plate, layout, missing, recognised = _drawable(source, reading)
    refused = None
    clashing = list[Any]()
    try:
        if plate.origin.path is not None:  # of an unfinished file only parts are read
            check_feasible(plate)
    except BadInput as refusal:
        if refusal.reason not in missing:
            layout = stage_layout(plate, refuse=False) if isinstance(plate, Stage) else plate.layout
            refused = refusal
            clashing = clashes(layout, refusal)
    page = partial(drawing_figure, plate, layout, missing=missing, recognised=recognised)
    plot = partial(plot_plate, plate=plate, layout=layout, recognised=recognised)
    mark = partial(mark_clashes, refusal=refused, clashes=clashing)
    window = target is None and show_window(lambda ax: mark(plot(ax)), plate.name)
    written = list[Path]()
    if picture is not None:
        mark((figure := page()).axes[0])
        written = [write_picture(picture, figure)]
    elif not window:
        place = (target or Path()) / f"{source.stem}-drawing.json"
        check_folder(place.parent)
        mark((figure := page()).axes[0])
        written = write_beside(place, figure)
    if refused is not None:
        raise BadInput(f"{refused}{f'; drawn in {written[0]}' if written else ''}")
    about = of_stage(plate)
    if missing:
        about |= {"file": str(source)}
    return View(**about, written=list(map(str, written)), window=window, missing=missing)


class _Drawable(NamedTuple):
    """What can be drawn of a file: the plate, its layout, what is missing, and what was recognised
    in a drawing.
    """

    plate: Mechanism
    layout: Layout | None
    missing: list[str]
    recognised: Recognised | None


def _drawable(source: Path, reading: Reading) -> _Drawable:
    from flexfem.plot.plate import Recognised

    if is_drawing(source):
        plate = imported(source, reading)
        return _Drawable(
            plate.mechanism,
            None,
            [],
            Recognised(
                drawn_polygon(plate.found.drawing),
                plate.slender,
                frozenset(hinge.name for hinge in plate.mechanism.hinge),
            ),
        )
    require_no_reading(source, reading)
    if kind_of(read_toml(source).data) == MechanismFile.kind:
        return _Drawable(*read_drawable(source), None)
    return _Drawable(load_stage(source), None, [], None)


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


def mesh(stage: Mechanism, output: Path, *, resolution: int | None = None) -> MeshReport:
    """Mesh a stage or a mechanism and write it with groups: stage, ground and hub, or bodies,
    hinges and clamped edges.

    Parameters
    ----------
    output : path
        File to write: .msh, .vtu or .inp.
    resolution : int, optional
        Triangles across every neck, from 2.

    Raises
    ------
    BadInput
        The stage or mechanism cannot be made or is not plane, or the file cannot be written.
    """
    from flexfem.fem.export import check_format, write_mesh, write_plate_mesh
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.fem.plate_mesh import mesh_layout
    from flexfem.paper.stage_mesh import build_mesh, plate_of
    from flexfem.questions import warnings as warning

    target = checked_path(output)
    finest = arguments.resolution(RESOLUTION if resolution is None else resolution)
    check_format(target)
    check_file(target)
    if isinstance(stage, MechanismFile):
        with located(stage):
            made = mesh_layout(stage.layout, finest)
        write_plate_mesh(made, stage.layout, target)
    else:
        check_feasible(stage)
        plate = plate_of(stage)
        made = build_mesh(stage, finest)
        write_mesh(made, plate, target)
    return MeshReport(
        **of_stage(stage),
        written=str(target),
        resolution=finest,
        nodes=len(made.nodes),
        triangles=len(made.triangles),
        warnings=warning.of_numbers(stage),
    )


@brief
class HingeFormulas(NamedTuple):
    """Sources, freedoms and ranges of all formulas by name, of closed forms by hinge shape, and the
    figures written.
    """

    formulas: dict[str, Any]
    shapes: dict[str, Any]
    written: list[str]


def hinge_formulas(*, output: Path | None = None) -> HingeFormulas:
    """List the hinge formulas with source, freedoms and range; compare them with finite elements in
    figures.

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
