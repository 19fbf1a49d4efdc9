"""Common parts of questions: arguments and their description, models, meshes, and assembly of
results.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from itertools import chain
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import (
    Any,
    Concatenate,
    Literal,
    NamedTuple,
    ParamSpec,
    Protocol,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import LAYERS, RESOLUTION, SOLID_RESOLUTION, Sector, StageMesh
from flexfem.fem.response import Response, unit_response
from flexfem.files.provenance import Sourced, assumptions
from flexfem.files.tables import once
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.mechanism.plate import has_sharp_corner
from flexfem.paper.model import ModelChoice, choose
from flexfem.paper.stage import Stage
from flexfem.paper.stage_mesh import mesh_sectors, plate_of
from flexfem.refused import BadInput, printed
from flexfem.results import AXES, SOLID, About, Progress, Result

Models: TypeAlias = Literal["both", "analytic", "elements"]
Value = TypeVar("Value")
Step = TypeVar("Step")
Kind = TypeVar("Kind", bound=Result)
Function = TypeVar("Function", bound=Callable[..., Any])
Options = ParamSpec("Options")
OfStage = TypeVar("OfStage", covariant=True)
OfMechanism = TypeVar("OfMechanism", covariant=True)

SUBJECTS = ("mechanism", "stage")  # names of the parameter that is what a question is about
SHARED = {
    "stage : Stage": "The stage.",
    "mechanism : Stage": "The stage.",
    'models : {"both", "analytic", "elements"}': "The models to compute.",
    "analytic : Analytic": "The analytic model.",
    "resolution : int, optional": "Triangles across every neck on the finest of three meshes, from 4.",
    "solid : bool": "The whole plate by finite elements in three dimensions.",
    "thickness_resolution : int, optional": "With `solid`, layers of elements in half of the thickness, from 3.",
    "plane : bool": (
        "Plane finite elements of a mechanism, in plane stress, instead of three-dimensional ones."
    ),
    "progress : callable, optional": "Called with a line of text after each completed part.",
}
CONVENTION = """
    Every number has the unit that its quantity declares, as an attribute, by `at` and `band`, in JSON, tables and study
    columns (tables may add an SI prefix to lengths and angles): `unit` returns it, `flexfem schema {}` lists it."""
RAISES = """Raises
------
BadInput
    The stage cannot be made, the analytic model does not suit it, or an argument or a file is not valid.
ComputationFailed
    The stage is at a singular configuration, or a mesh or a solution does not pass its checks."""


def question(function: Function, not_for: str = "", only_for: str = "") -> Function:
    """Complete the docstring of a function at `{shared}` with common parameters, returns and
    raises.

    The returned function raises BadInput for a stage that cannot be made, for a word that its
    `Literal` lacks, for a model that is no `Analytic`, for a mechanism that its annotation does not
    name, and for options `not_for` mechanisms or `only_for` them."""
    text = inspect.cleandoc(function.__doc__ or "")
    signature = inspect.signature(function)
    subject_name = next((name for name in SUBJECTS if name in signature.parameters), "")
    annotation = str(function.__annotations__.get(subject_name))
    of_mechanism = " or Mechanism" * (annotation == "Mechanism")
    shared = list[str]()
    for head, description in SHARED.items():
        name = head.split()[0]
        if name in signature.parameters and f"\n{name} :" not in text:
            shared += [head + of_mechanism * (name in SUBJECTS), f"    {description}"]
    kinds = str(function.__annotations__["return"]).split(" | ")
    returns = ", or ".join(kinds) + " of a mechanism" * (len(kinds) > 1)
    kind = function.__globals__.get(kinds[0].removeprefix("list[").removesuffix("]"))
    if isinstance(kind, type) and issubclass(kind, Result):
        returns += CONVENTION.format("KIND" if kind is Result else kind.kind())
    added = "\n".join([*shared, "", "Returns", "-------", returns, "", RAISES])
    text = text.replace("{shared}", added.replace("The stage", f"The stage{of_mechanism.lower()}"))
    for key in not_for.split():
        text = re.sub(rf"(?m)^({key} : .*(?:\n    .*)*)", r"\1 Not for a mechanism.", text)
    function.__doc__ = text

    @cache
    def hints_of() -> dict[str, Any]:
        return get_type_hints(function)  # resolvable only after its module is complete

    @wraps(function)
    def checked(*positional: Any, **named: Any) -> Any:
        if "layers" in named and "solid" in signature.parameters:
            raise BadInput(f"layers {printed(named['layers'])}: this option is now {SOLID_NOW}")
        hints = hints_of()
        bound = signature.bind(*positional, **named).arguments
        subject = bound.get(subject_name)
        own = subject.answering(function.__name__) if isinstance(subject, Mechanism) else None
        options = only_for
        known = "a mechanism"
        other = "the nine-hinge stage"
        if own is not None:
            accepted = inspect.signature(own).parameters
            options = " ".join(name for name in bound if name not in accepted)
            known = "a mechanism file"
            other = f"a {type(subject).kind}"
        if isinstance(subject, MechanismFile):
            options, known, other = not_for, other, known
            if not of_mechanism:
                raise BadInput(
                    f"{subject.origin}: {function.__name__} is for {known}, not for {other}"
                )
        for name, value in bound.items():
            if name in options.split() and value != signature.parameters[name].default:
                option = f"{name} {printed(value)}".removesuffix(" True")
                if name == "analytic":
                    option = "mobility, formula or links"
                raise BadInput(f"{option}: an option for {known}, not for {other}")
            parts = (hints.get(name), *get_args(hints.get(name)))  # members of a union, too
            words = [
                word for part in parts if get_origin(part) is Literal for word in get_args(part)
            ]
            is_known = isinstance(value, str) and value in words
            if words and not is_known and not (value is None and NoneType in parts):
                raise BadInput(f"{name} {printed(value)}, expected {' or '.join(words)}")
            if hints.get(name) is Analytic and not isinstance(value, Analytic):
                raise BadInput(f"{name} {printed(value)}, expected a flexfem.Analytic")
        if subject_name in bound and not isinstance(subject, MechanismFile):
            check_feasible(bound[subject_name])
        if own is not None:
            own_options = {name: bound[name] for name in list(bound)[1:] if name in accepted}
            return own(subject, **own_options)
        if isinstance(subject, MechanismFile) and bound.get("plane"):
            if bound.get("solid"):
                raise BadInput("plane with solid, expected one of the two")
            if subject.model == "three_dimensional":
                bound[subject_name] = subject.replace(model="plane_stress")
            return function(**bound)
        return function(*positional, **named)

    return cast(Function, checked)


def options(not_for: str = "", only_for: str = "") -> Callable[[Function], Function]:
    """Declare a `question` with options that are `not_for` a mechanism, or `only_for` one."""
    return lambda function: question(function, not_for, only_for)


class OfBoth(Protocol[Options, OfStage, OfMechanism]):
    """A question about stages and mechanisms, whose results are of different kinds."""

    @overload
    def __call__(self, stage: Stage, *args: Options.args, **kwargs: Options.kwargs) -> OfStage: ...
    @overload
    def __call__(
        self, stage: Mechanism, *args: Options.args, **kwargs: Options.kwargs
    ) -> OfMechanism: ...


def for_mechanisms(
    of_stage: type[OfStage], of_mechanism: type[OfMechanism], not_for: str = "", only_for: str = ""
) -> Callable[
    [Callable[Concatenate[Mechanism, Options], Any]], OfBoth[Options, OfStage, OfMechanism]
]:
    """Declare the kinds of result of `options` about stages and mechanisms, where they are
    different quantities.
    """
    return lambda function: cast(Any, question(function, not_for, only_for))


class Analytic(NamedTuple):
    """The analytic model of a question.

    Without arguments it has calibrated hinges and elastic links, and is corrected for the thickness
    of the hinges unless the stage file states a `model`. With any argument it is the paper's model
    with that change.

    Parameters
    ----------
    mobility : int, optional
        Mobility of the stage with rigid links: 3, 6, 12 or 21.
    formula : str, optional
        Formula of the hinges, see `flexfem formulas`.
    links : bool
        Model pads, links and platform as elastic; with mobility 21 only.
    """

    mobility: int | None = None
    formula: str | None = None
    links: bool = False

    def chosen(self, stage: Stage, warnings: list[str], models: Models = "both") -> ModelChoice:
        """Return the model of a stage; append warnings of charts that do not cover it, unless
        models is "elements".

        Raises BadInput for a model that does not suit the stage.
        """
        return choose(stage, *self, [] if models == "elements" else warnings)


DEFAULT = Analytic()
LIFTED = ("z", "tilt x", "tilt y")  # motions of the output out of the plane
PLATE_SOLID_RESOLUTION = (
    4  # of mechanisms: the plane compliance of leaf springs and notches is within 0.05 %
)
NOTHING: Mapping[str, Any] = MappingProxyType({})
# label of the network of parts, each with the compliance by finite elements of it alone
ELASTIC = "elastic bodies"
ELASTIC_READ = (
    f"{ELASTIC}: bodies and hinges by finite elements of each part, joined at rigid sections"
)
SOLID_NOW = "solid, with thickness_resolution for the number of elements in half of the thickness"
NO_HINGES = (
    "the plate has no hinges: the analytic models do not apply, and all numbers are those of "
    "finite elements"
)
WITHOUT_PRELOAD = (
    "these numbers are those without the residual stress and the preloads of actuators that the "
    "file states: `modes`, and the stiffness and amplification of `stiffness`, contain them"
)
BY_HINGES = (
    f"{SOLID}: plane finite elements of the plate, and three-dimensional ones of every hinge, "
    "also in the elastic bodies; the analytic model has hinges in three dimensions by plates of "
    "their height"
)


class Mesh(NamedTuple):
    """The finest mesh: triangles across every neck, and layers in half the thickness, 0 for a plane
    mesh.
    """

    resolution: int
    layers: int


def elements_through(solid: bool, thickness_resolution: int | None) -> int | None:
    """Return the layers of elements in half of the thickness of a plate that is wholly in three
    dimensions, else None.

    Raises BadInput for a number without `solid`, or out of range.
    """
    if not solid:
        if thickness_resolution is not None:
            raise BadInput(
                f"thickness_resolution {printed(thickness_resolution)} without solid, expected "
                "solid"
            )
        return None
    return (
        LAYERS
        if thickness_resolution is None
        else arguments.thickness_resolution(thickness_resolution, 3)
    )


def mesh_of(
    plate: Mechanism,
    models: Models,
    resolution: int | None,
    layers: int | None,
    least: int = 4,
    usual: int = RESOLUTION,
    usual_solid: int = SOLID_RESOLUTION,
) -> Mesh | None:
    """Return the requested mesh, by default the usual plane or three-dimensional one; None without
    finite elements.

    Raises BadInput if a mesh is requested without finite elements, if it is too coarse or too fine,
    or for analytic models alone of a plate without hinges."""
    if models == "analytic":
        require_hinges(plate, "which the analytic models need", "models 'both' or 'elements'")
        for stated in ([] if resolution is None else [f"resolution {resolution}"]) + ["solid"] * (
            layers is not None
        ):
            raise BadInput(f"{stated} with models 'analytic', expected models with finite elements")
        return None
    if layers is not None:
        usual = PLATE_SOLID_RESOLUTION if isinstance(plate, MechanismFile) else usual_solid
    return Mesh(
        arguments.resolution(usual if resolution is None else resolution, least), layers or 0
    )


def require_hinges(plate: Mechanism, clause: str, expected: str) -> None:
    """Raise BadInput for a plate without hinges: "no [[hinge]]", a relative clause, and what is
    `expected` instead.
    """
    if not plate.layout.joints:
        raise BadInput(f"{plate.origin}: no [[hinge]], {clause}, expected {expected}")


def lever_of(plate: Mechanism) -> float:
    """Return the lever, mm: a rotation times it is comparable with a translation."""
    return plate.layout.lever if isinstance(plate, MechanismFile) else plate.chain.link_lengths[2]


@once
def sectors_of(stage: Stage, resolution: int) -> tuple[Sector, ...]:
    """Return the meshed sectors of a feasible stage."""
    return mesh_sectors(stage, resolution)


@once
def solved(stage: Stage, resolution: int) -> Response:
    """Solve a feasible stage with plane finite elements. Raises BadInput for a model that is not
    plane.
    """
    return unit_response(sectors_of(stage, resolution), plate_of(stage))


def on_meshes(
    steps: Sequence[Step], solve: Callable[[Step], Value], progress: Progress | None = None
) -> list[Value]:
    """Return the solutions for all resolutions, coarse to fine, or for other steps."""
    solutions = []
    for step in steps:
        solutions.append(solve(step))
        if progress is not None:
            progress(f"{len(solutions)} of {len(steps)} meshes")
    return solutions


class MeshFields(NamedTuple):
    """Fields on a mesh, in three dimensions at `heights`, mm, of half the thickness; computed when
    they are written.
    """

    mesh: StageMesh
    made: Callable[[], dict[str, Array]]
    heights: Array | None = None

    def write(self, path: Path) -> list[Path]:
        """Write the fields as VTU; return the path."""
        write_vtu(self.mesh, path.with_suffix(".vtu"), self.made(), self.heights)
        return [path.with_suffix(".vtu")]


def meshed(mesh: Mesh | None) -> dict[str, int | None]:
    """Return a mesh as settings of a result."""
    return (
        {}
        if mesh is None
        else {"resolution": mesh.resolution, "thickness resolution": mesh.layers or None}
    )


def about(
    plate: Mechanism,
    heat: bool = False,
    drive: bool = False,
    files: Mapping[str, Sourced] = NOTHING,
) -> About:
    """Return the subject of a result: a plate, `heat` coefficients or `drive` of a stage, and other
    files by name.
    """
    doubts = assumptions([("", plate), *((f"{name}: ", file) for name, file in files.items())])
    digest = plate.hash
    if isinstance(plate, Stage) and (heat or drive):
        doubts = plate.heat_assumptions if heat else plate.drive_assumptions
        digest = plate.heat_hash if heat else plate.drive_hash
    return About(
        plate.name,
        str(plate.origin),
        digest,
        tuple(doubts.assumed),
        tuple(doubts.not_stated),
        lever_of(plate),
    )


class ModelAnswer(NamedTuple):
    """Values and bands of one model by quantity."""

    values: dict[str, Any]
    bands: Mapping[str, Any] = MappingProxyType({})


def stack_models(
    kind: type[Result],
    models: Mapping[str, ModelAnswer],
    axes: Mapping[str, Sequence[str]],
    along: str = "model",
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Stack the values and bands of models, or curves, along an axis; nan where one has no value."""
    stacked: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    labels = {**AXES, **kind.labels, **axes}
    for which, arrays in enumerate(stacked):
        parts = [model[which] for model in models.values()]
        for name in dict.fromkeys(chain(*parts)):
            over = kind.quantities[name].over
            array = np.full(
                [len(parts), *(len(labels[axis]) for axis in over if axis != along)], np.nan
            )
            for k, part in enumerate(parts):
                if name in part:
                    place: tuple[Any, ...] = (k, *map(slice, np.shape(part[name])))
                    array[place] = part[name]
            arrays[name] = np.moveaxis(array, 0, over.index(along))
    return stacked


def kind_of(kind: type[Kind], subject: Mechanism | About) -> type[Kind]:
    """Return a kind of result, or its form for mechanisms."""
    return cast(type[Kind], kind.of_mechanism) if isinstance(subject, MechanismFile) else kind


def answer(
    kind: type[Kind],
    subject: Mechanism | About,
    models: Mapping[str, ModelAnswer],
    mesh: Mesh | None,
    settings: Mapping[str, Any] = NOTHING,
    values: Mapping[str, Any] = NOTHING,
    axes: Mapping[str, Sequence[str]] = NOTHING,
    bands: Mapping[str, Any] = NOTHING,
    **others: Any,
) -> Kind:
    """Return the result of a question from the values of its models, and from values and bands of
    all models.

    That of a mechanism is of the kind `of_mechanism`. It has the axes hinge, point and actuator,
    and the warnings and notes that apply to every question."""
    kind = kind_of(kind, subject)
    labels = {"model": tuple(models), **axes}
    if isinstance(subject, MechanismFile):
        layout = subject.layout
        labels = {
            "hinge": [joint.name for joint in layout.joints],
            "body": [body.name for body in layout.bodies if not body.fixed],
            "point": [name for name, _ in layout.points],
            "actuator": [actuator.name for actuator in layout.actuators],
            **labels,
        }
        found = [*values, *chain.from_iterable(model.values for model in models.values())]
        peaks = any(
            word in kind.quantities[name].meaning for name in found for word in ("stress", "strain")
        )
        warned = sharp_roots(layout) if peaks and mesh is not None else []
        if (layout.residual_stress or np.any(layout.preload)) and "preload" not in settings:
            warned.append(WITHOUT_PRELOAD)
        others["warnings"] = [*others.get("warnings", ()), *warned]
        by_hinges = SOLID in models and mesh is not None and not mesh.layers
        read = [ELASTIC_READ] * (ELASTIC in models) + [BY_HINGES] * by_hinges
        read += [] if layout.joints else [NO_HINGES]
        others["notes"] = [*others.get("notes", ()), *read]
    stacked, widths = stack_models(kind, models, labels)
    subject = subject if isinstance(subject, About) else about(subject)
    settings = {**settings, **meshed(mesh)}
    return kind(subject, {**stacked, **values}, {**widths, **bands}, labels, settings, **others)


def sharp_roots(layout: Layout) -> list[str]:
    """Warn of hinges with sharp inner corners, where stress and strain by finite elements are
    singular.
    """
    sharp = [joint.name for joint in layout.joints if has_sharp_corner(layout, joint)]
    named = ", ".join(sharp[:3]) + f" and {len(sharp) - 3} more" * (len(sharp) > 3)
    return [
        f"hinges with sharp inner corners ({named}): stress and strain of finite elements there "
        "grow without limit as the mesh is refined, and the range at yield falls with them; "
        "state fillet_mm, or smooth = true of a table"
    ] * bool(sharp)
