"""From nothing to a part: new files to start from, and files for the workshop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from flexfem import arguments
from flexfem.files.refusals import checked_path
from flexfem.mechanism.feasibility import check_feasible
from flexfem.refused import BadInput
from flexfem.reports.given import PathLike

if TYPE_CHECKING:
    from flexfem.cad.export import PartReport
    from flexfem.files.templates import NewFiles
    from flexfem.mechanism.stage import Stage

SMALLEST = 0.01  # mm, of kerf and holes; less is a unit mistake: wires are 0.02 mm and more
LARGEST_KERF = 10.0  # mm; a wire cuts a thirtieth of it
LARGEST_HOLE = 1e3  # mm


def export(stage: Stage, path: PathLike, kerf: float | None = None, mounting: float | None = None) -> PartReport:
    """Write a stage for the workshop: a drawing, or a solid from z = 0 to the thickness, in mm.

    Parameters
    ----------
    path : ends in .dxf, .svg or .step.
    kerf : mm, wire and spark gap together: a drawing then has the path of the wire's middle, too.
    mounting : mm, diameter of a hole in the middle of every pad.

    Raises
    ------
    BadInput
        The stage cannot be made, kerf or holes do not fit it, or the file cannot be written.
    ComputationFailed
        A solid that was read back is not the part; it is not kept.
    """
    from flexfem.cad.export import export_part

    target = checked_path(path)
    kerf = None if kerf is None else arguments.between("kerf", kerf, SMALLEST, LARGEST_KERF, " mm")
    mounting = (
        None if mounting is None else arguments.between("mounting holes", mounting, SMALLEST, LARGEST_HOLE, " mm")
    )
    check_feasible(stage)
    return export_part(stage, target, kerf, mounting)


def new_stage(path: PathLike, case: bool = False, study: bool = False) -> NewFiles:
    """Write a commented stage file to start from, and beside it, as wanted, a case and a study of it.

    Parameters
    ----------
    path : ends in .toml.   case, study : also write `path` with -case or -study before the extension.

    Raises BadInput when a file is there already or cannot be written; then nothing is written.
    """
    from flexfem.files.templates import write_new

    return write_new(checked_path(path), case, study)


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema, draft 7, of a kind of file: whatever flexfem accepts, it accepts.

    Parameters
    ----------
    name : "stage", "case", "study", "requirements", "claims", "fixture", "measured", "material", "stack" or "necks".

    Hinge formulas, materials and stacks are those that are known now, the user's own included. Raises BadInput when
    there is no such kind.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.schema_of("stage")["properties"]["thickness_mm"]["x-unit"]
    'mm'
    """
    from flexfem.reference import schemas

    return schemas.schema_of(name)


class View(NamedTuple):
    """What was drawn of a stage file: keys that it does not give, files written, whether a window was opened."""

    file: str
    name: str
    missing: list[str]
    written: list[str]
    window: bool
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


def view(path: PathLike, folder: PathLike | None = None) -> View:
    """Draw a stage file with its dimensions; one in which keys are missing, as far as it goes.

    Parameters
    ----------
    folder : where the picture goes; None opens a window where there is a display, and else takes the current folder.

    Raises BadInput for a file that says something wrong or nothing to draw, and for a folder that takes no file.
    """
    from pathlib import Path

    from flexfem.files.writing import check_folder
    from flexfem.mechanism.stage import load_partly
    from flexfem.plot import dimensions
    from flexfem.plot.write import write_beside

    source = checked_path(path)
    target = None if folder is None else checked_path(folder)
    stage, missing = found = load_partly(source)
    if not (found.whole or found.given(*dimensions.SKELETON) or found.given("platform.radius_mm")):
        raise BadInput(f"{source}: nothing to draw, expected chain.link_lengths_mm and chain.joint_angles_deg to begin")
    window, written = target is None and dimensions.has_display(), list[Path]()
    if window:
        dimensions.show_window(stage, missing)
    else:
        place = (target or Path()) / f"{source.stem}-drawing.json"
        check_folder(place.parent)
        written = write_beside(place, dimensions.drawing_figure(stage, missing))
    said = [f"{', '.join(missing)}: missing, and what needs it is not drawn"] if missing else []
    return View(str(source), stage.name, missing, [str(each) for each in written], window, said, *found.doubts)
