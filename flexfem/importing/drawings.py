"""Drawings as input: a mechanism from a DXF, STEP or SVG file, and what was recognised in it."""

from __future__ import annotations

import os
import shlex
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from flexfem import arguments
from flexfem.files.provenance import Assumptions
from flexfem.files.refusals import checked_path, nearest, place_of, shown
from flexfem.files.toml import DRAWINGS, PathLike, require_plain_stem
from flexfem.files.writing import check_file, write_atomically
from flexfem.importing.departure import Departure, departure, drawn_polygon, fine_polygon
from flexfem.importing.found import FoundPlate
from flexfem.importing.roles import Roles, Wishes, actuator_of, body_shape, point_of, roles_of
from flexfem.importing.units import LARGEST_THICKNESS
from flexfem.importing.write import Heading, WrittenMechanism, in_order, written
from flexfem.mechanism.content import Origin
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import UNMOVED, Move
from flexfem.mechanism.loading import load as load_file
from flexfem.mechanism.materials import materials
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.outlines import area
from flexfem.refused import BadInput

OFF = 1e-3  # mm, of an edge of the written file from the drawing
OFF_AREA = 1e-6  # the same of the area, per area of the plate
OFF_MEAN = 1e-4  # mm, mean distance along the edge: curves that arcs stand for are off by as much
STATED = "stated with the import"


class Reading(NamedTuple):
    """How a drawing becomes a mechanism.

    Parameters
    ----------
    thickness : float, optional
        Of a drawing: thickness of the plate, mm; a STEP file states it.
    material : str, optional
        Of a drawing: name of a registered material, such as al-7075-t6.
    units : str, optional
        Of a drawing: unit of its lengths, mm, cm, m, in or ft, instead of that in the file.
    part : str, optional
        Of a drawing with several plates: number of the plate, 1 for the largest.
    kerf : float
        Of a drawing of the path of a wire or beam: width of its cut, mm.
    tolerance : float, optional
        Of a drawing: gap, mm, up to which open ends are joined.
    ground : list of str, optional
        Of a drawing: point X,Y of a body that is fixed, or on an edge that is clamped, mm; may be
        repeated. By default what a layer such as GROUND marks, else the body around all others,
        with the most round holes, or the largest.
    output_at : str, optional
        Of a drawing: point X,Y of the output, mm; or a point of its body and the point at which its
        pose is read, X,Y:X,Y. By default the centre of the body with the most hinges between it and
        the ground.
    clamp_holes : bool
        Of a drawing: bodies with round holes, for screws, are fixed.
    actuator : list of str, optional
        Of a drawing: an actuator between two points, X,Y:X,Y, perhaps with a stack,
        X,Y:X,Y,AE0505D16; may be repeated.
    """

    thickness: float | None = None
    material: str | None = None
    units: str | None = None
    part: str | None = None
    kerf: float = 0.0
    tolerance: float | None = None
    ground: list[str] | None = None
    output_at: str | None = None
    clamp_holes: bool = False
    actuator: list[str] | None = None

    @property
    def options(self) -> list[str]:
        """Words of a command with these settings."""
        words = list[str]()
        for name, value in self._asdict().items():
            flag = f"--{name.replace('_', '-')}"
            for each in value if isinstance(value, list) else [value]:
                if each is True:
                    words.append(flag)
                elif each:
                    words += [flag, str(each)]
        return words

    @property
    def wishes(self) -> Wishes:
        """Stated parts. Raises BadInput for a text that is no point."""
        output, pose = _output_and_pose(self.output_at)
        return Wishes(
            tuple(point_of("ground", text) for text in self.ground or ()),
            output,
            pose,
            self.clamp_holes,
            tuple(actuator_of("actuator", text) for text in self.actuator or ()),
        )


def _output_and_pose(stated: Any) -> tuple[complex | None, complex | None]:
    """Return a point of the output and that at which its pose is read. Raises BadInput."""
    if stated is None:
        return None, None
    if not isinstance(stated, str):
        output = point_of("output", stated)
        return output, output
    body, colon, pose = stated.partition(":")
    output = point_of("output", body)
    return output, point_of("output", pose) if colon else output


NO_READING = Reading()


class ImportedBody(NamedTuple):
    """A body that was found in a drawing; `held`: fixed, or clamped at edges."""

    body: str
    held: str
    hinges: int
    holes: int


class ImportedHinge(NamedTuple):
    """A hinge that was found in a drawing.

    other : dimensions other than length and neck.   off_um : of its fitted edge.
    """

    hinge: str
    between: str
    shape: str
    length_mm: float
    neck_mm: float
    other: str
    off_um: float


class ImportReport(NamedTuple):
    """What was recognised in a drawing, and how far the mechanism file is off it.

    ground, output : of which body, and why.
    edge_off_um, edge_off_at_mm : largest distance of an edge, and its place.
    area_off : area of which only the drawing or only the file consists, per area of the plate.
    """

    file: str
    name: str
    written: str
    thickness_mm: float
    material: str
    bodies: list[ImportedBody]
    hinges: list[ImportedHinge]
    ground: str
    output: str
    edge_off_um: float
    edge_off_at_mm: tuple[float, float]
    area_off: float
    notes: list[str]
    commands: list[str]
    warnings: list[str]
    assumed: list[str]
    not_stated: list[str]


class ImportedPlate(NamedTuple):
    """A drawing with all that was made from it."""

    found: FoundPlate
    roles: Roles
    written: WrittenMechanism
    mechanism: MechanismFile
    off: Departure

    @property
    def warnings(self) -> list[str]:
        """Where the written file is off the drawing, and what of it is thin and not explained."""
        texts = list[str]()
        contours = (self.found.drawing.outside, *self.found.drawing.holes)
        plate = sum(map(area, contours))
        length = sum(segment.length for loop in contours for segment in loop)
        if self.off.largest > OFF or self.off.area > OFF_AREA + OFF_MEAN * length / plate:
            at = f"({self.off.place.real:.6g}, {self.off.place.imag:.6g}) mm"
            texts.append(
                f"the mechanism is off the drawing by up to {1e3 * self.off.largest:.3g} um at "
                f"{at}; {self.off.area:.2g} of the area differs"
            )
        if self.slender:
            place = self.slender[0].representative_point()
            texts.append(
                f"{len(self.slender)} thin parts are no hinges, such as that at ({place.x:.4g}, "
                f"{place.y:.4g}) mm: finite elements compute them as drawn, and the analytic "
                "model takes them as rigid"
            )
        return texts

    @property
    def slender(self) -> list[Any]:
        """Polygons of thin parts that are no hinges, without those of the rigid ground."""
        ground = [body_shape(self.found.bodies[k]) for k in self.roles.fixed]
        dots = [polygon.representative_point() for polygon in self.found.slender]
        inside = [any(body.contains(dot) for body in ground) for dot in dots]
        return [
            polygon for polygon, fixed in zip(self.found.slender, inside, strict=True) if not fixed
        ]

    @property
    def summary(self) -> str:
        """What was recognised, in one line."""
        found = self.found
        return (
            f"{found.drawing.path}: {len(found.bodies)} bodies, {len(found.hinges)} hinges; "
            f"ground: {self.ground}; output: {self.output} ({self.roles.sources['output']})"
        )

    @property
    def ground(self) -> str:
        """Bodies that are fixed or clamped, and why."""
        roles = self.roles
        names = [self.written.names.bodies[k] for k in (*roles.fixed, *roles.clamped)]
        return f"{', '.join(names)} ({roles.sources['ground']})"

    @property
    def output(self) -> str:
        """Body and point of the output."""
        at = self.roles.at
        return f"{self.written.names.bodies[self.roles.output]} at {at.real:.6g}, {at.imag:.6g} mm"


def is_drawing(path: PathLike) -> bool:
    """Return whether a file is a drawing by its name."""
    return Path(path).suffix.lower() in DRAWINGS


def load(path: PathLike, reading: Reading = NO_READING) -> Mechanism:
    """Read and check a stage file or a mechanism file, whichever its keys show, or a drawing.

    Parameters
    ----------
    path : path
        File: .toml, or a drawing: .dxf, .step, .stp or .svg.
    reading : Reading
        Of a drawing: its thickness, material, ground, output and so on.

    Raises
    ------
    BadInput
        One line with file, line, key and expected value; for a drawing, what of it cannot be read.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.load("geometry/mobility6.toml").chain.link_lengths
    (30.0, 32.0, 24.0)
    """
    source = checked_path(path)
    if is_drawing(source):
        return imported(source, reading).mechanism
    require_no_reading(source, reading)
    return load_file(source)


def require_no_reading(source: Path, reading: Reading) -> None:
    """Raise BadInput for options of drawings with another file."""
    for name, value in reading._asdict().items():
        if value:
            option = name.replace("_", "-")
            raise BadInput(
                f"{place_of(source)}: {option} is for a drawing, expected no such option with "
                "this file"
            )


def import_drawing(
    drawing: Path, output: Path | None = None, *, reading: Reading = NO_READING
) -> ImportReport:
    """Recognise bodies and hinges in a drawing, and write them as a mechanism file.

    Parameters
    ----------
    drawing : path
        File: .dxf, .step, .stp or .svg.
    output : path, optional
        Mechanism file to write, .toml. Without it, only the report is made.
    reading : Reading
        Thickness, material, ground, output and so on.

    Raises
    ------
    BadInput
        The drawing cannot be read, thickness or material are not known, or the file cannot be
        written.
    """
    source = checked_path(drawing)
    if not is_drawing(source):
        raise BadInput(f"{place_of(source)}: expected a drawing: {', '.join(DRAWINGS)}")
    target = None if output is None else checked_path(output)
    if target is not None:
        if target.suffix != ".toml":
            raise BadInput(
                f"{place_of(target)}: expected a file name that ends in .toml, such as mine.toml"
            )
        require_plain_stem(target)
        check_file(target, source)
    plate = imported(source, reading, None if target is None else target.stem)
    if target is not None:
        text = plate.written.text.encode()
        write_atomically(target, lambda file: file.write(text))
    return report_of(plate, target)


def imported(
    source: Path,
    reading: Reading,
    name: str | None = None,
    wishes: Wishes | None = None,
    move: Move = UNMOVED,
) -> ImportedPlate:
    """Read a drawing, recognise its parts, and make the mechanism.

    wishes : stated parts, by default those of the reading; in the axes of the moved drawing.
    move : of the drawing, before its parts are recognised.

    Raises BadInput as `import_drawing`.
    """
    from flexfem.importing.read import read_drawing
    from flexfem.importing.recognise import recognise

    heading_of(source, reading, None, name)  # refuses before anything is computed
    wishes = reading.wishes.moved(move) if wishes is None else wishes
    options: dict[str, Any] = {"units": reading.units, "part": reading.part, "kerf": reading.kerf}
    if reading.tolerance is not None:
        options["tolerance"] = reading.tolerance
    drawing = read_drawing(source, thickness=reading.thickness, **options)
    found = recognise(drawing if move == UNMOVED else drawing.moved(move))
    return assembled(found, wishes, heading_of(source, reading, drawing.thickness, name))


def heading_of(
    source: Path,
    reading: Reading,
    drawn: float | None,
    name: str | None,
) -> Heading:
    """Return what the file states about the whole plate.

    drawn : thickness that the drawing states, mm.

    Raises BadInput for a thickness or material that is neither stated nor possible.
    """
    place = place_of(source)
    if reading.thickness is None and drawn is None and source.suffix.lower() in (".dxf", ".svg"):
        raise BadInput(
            f"{place}: a drawing without a thickness, expected --thickness, such as --thickness "
            "10mm"
        )
    if reading.material is None:
        raise BadInput(
            f"{place}: a drawing without a material, expected --material, such as --material "
            "al-7075-t6"
        )
    if reading.material not in materials():
        near = nearest(str(reading.material), materials())
        raise BadInput(f"material {shown(reading.material)}, expected a registered material{near}")
    thickness = drawn if reading.thickness is None else reading.thickness
    source_of = STATED if reading.thickness is not None else f"read from {source.name}"
    if thickness is not None:
        thickness = arguments.between("thickness", float(thickness), 1e-4, LARGEST_THICKNESS, " mm")
    return Heading(
        name or source.stem, thickness or 0.0, reading.material, {"thickness_mm": source_of}
    )


def assembled(
    found: FoundPlate,
    wishes: Wishes,
    heading: Heading,
) -> ImportedPlate:
    """Return the mechanism of a found plate, and how far it is off the drawing.

    Raises BadInput as `import_drawing`.
    """
    path = found.drawing.path
    roles = roles_of(found, wishes)
    made = written(found, roles, heading)
    mechanism = MechanismFile.model_validate(tomllib.loads(made.text))
    mechanism.__dict__["origin"] = Origin(os.fspath(path))
    check_feasible(mechanism)
    off = departure(drawn_polygon(found.drawing), fine_polygon(mechanism.layout))
    return ImportedPlate(found, roles, made, mechanism, off)


def report_of(plate: ImportedPlate, target: Path | None) -> ImportReport:
    """Return what was recognised; target : written file, None without one."""
    mechanism = plate.mechanism
    off = plate.off
    doubts = Assumptions(list(mechanism.assumed), list(mechanism.not_stated))
    commands = list[str]()
    if target is not None:
        path = shlex.quote(str(target))
        commands = [f"flexfem view {path}", f"flexfem summary {path}"]
    return ImportReport(
        file=str(plate.found.drawing.path),
        name=mechanism.name,
        written="" if target is None else str(target),
        thickness_mm=_shown(float(mechanism.thickness)),
        material=mechanism.material.name,
        bodies=sorted(_imported_bodies(plate), key=lambda each: in_order(each.body)),
        hinges=sorted(_imported_hinges(plate), key=lambda each: in_order(each.hinge)),
        ground=plate.ground,
        output=f"{plate.output} ({plate.roles.sources['output']})",
        edge_off_um=float(f"{1e3 * off.largest:.2g}"),
        edge_off_at_mm=(_shown(off.place.real), _shown(off.place.imag)),
        area_off=float(f"{off.area:.2g}"),
        notes=list(plate.found.drawing.notes),
        commands=commands,
        warnings=plate.warnings,
        assumed=doubts.assumed,
        not_stated=doubts.not_stated,
    )


def _imported_bodies(plate: ImportedPlate) -> list[ImportedBody]:
    """Return the bodies as the report names them."""
    found = plate.found
    rows = list[ImportedBody]()
    for k, body in enumerate(found.bodies):
        held = ""
        if k in plate.roles.fixed:
            held = "fixed"
        elif k in plate.roles.clamped:
            held = "clamped"
        hinges = sum(k in hinge.bodies for hinge in found.hinges)
        rows.append(ImportedBody(plate.written.names.bodies[k], held, hinges, len(body.holes)))
    return rows


def _imported_hinges(plate: ImportedPlate) -> list[ImportedHinge]:
    """Return the hinges as the report names them."""
    names = plate.written.names
    rows = list[ImportedHinge]()
    for k, (hinge, joint) in enumerate(zip(plate.found.hinges, plate.written.joints, strict=True)):
        other = [
            f"{key} {value:.6g}"
            for key, value in hinge.dimensions.items()
            if key not in ("length", "neck")
        ]
        rows.append(
            ImportedHinge(
                hinge=names.hinges[k],
                between=" - ".join(names.bodies[body] for body in joint.bodies),
                shape=hinge.shape,
                length_mm=_shown(joint.profile.length),
                neck_mm=_shown(joint.profile.neck),
                other=", ".join(other),
                off_um=round(1e3 * hinge.deviation, 3),
            )
        )
    return rows


def _shown(value: float) -> float:
    return float(f"{value:.7g}")
