"""Common parts of questions: arguments and their description, models, meshes, and assembly of results."""

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
from flexfem.analytic.model import ModelChoice, choose
from flexfem.arrays import Array
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import RESOLUTION, SOLID_RESOLUTION, Sector, StageMesh, mesh_sectors
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import plate_of
from flexfem.files.provenance import Sourced, assumptions
from flexfem.files.tables import once
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.results import AXES, About, Progress, Result

Models: TypeAlias = Literal["both", "analytic", "elements"]
Value = TypeVar("Value")
Step = TypeVar("Step")
Kind = TypeVar("Kind", bound=Result)
Function = TypeVar("Function", bound=Callable[..., Any])
Options = ParamSpec("Options")
Fewer = ParamSpec("Fewer")
OfStage = TypeVar("OfStage", covariant=True)
OfMechanism = TypeVar("OfMechanism", covariant=True)

SHARED = {
    "stage : Stage": "The stage.",
    'models : {"both", "analytic", "elements"}': "The models to compute.",
    "analytic : Analytic": "The analytic model.",
    "resolution : int, optional": "Triangles across every neck on the finest of three meshes, from 4.",
    "layers : int, optional": "Three-dimensional model with this number of layers in half the thickness, from 3.",
    "progress : callable, optional": "Called with a line of text after each completed part.",
}
RAISES = """
BadInput
    The stage cannot be made, the analytic model does not suit it, or an argument or a file is not valid.
ComputationFailed
    The stage is at a singular configuration, or a mesh or a solution does not pass its checks."""


def question(function: Function) -> Function:
    """Complete the docstring of a function at `{shared}` with common parameters, returns and raises.

    The returned function raises BadInput for a word that its `Literal` lacks and for a model that is no `Analytic`.
    """
    text, signature = inspect.cleandoc(function.__doc__ or ""), inspect.signature(function)
    shared = list[str]()
    for head, description in SHARED.items():
        name = head.split()[0]
        if name in signature.parameters and f"\n{name} :" not in text:
            shared += [head, f"    {description}"]
    returns = ["", "Returns", "-------", str(function.__annotations__["return"]), "", "Raises", f"------{RAISES}"]
    function.__doc__ = text.replace("{shared}", "\n".join([*shared, *returns]))

    @cache
    def hints_of() -> dict[str, Any]:
        return get_type_hints(function)  # resolvable only after its module is complete

    @wraps(function)
    def checked(*positional: Any, **named: Any) -> Any:
        hints, bound = hints_of(), signature.bind(*positional, **named).arguments
        if isinstance(subject := bound.get("stage"), Mechanism):
            raise BadInput(f"{subject.origin}: {function.__name__} is for the nine-hinge stage, not for a mechanism")
        for name, value in bound.items():
            parts = (hints.get(name), *get_args(hints.get(name)))  # members of a union, too
            words = [word for part in parts if get_origin(part) is Literal for word in get_args(part)]
            is_known = isinstance(value, str) and value in words
            if words and not is_known and not (value is None and NoneType in parts):
                raise BadInput(f"{name} {value!r}, expected {' or '.join(words)}")
            if hints.get(name) is Analytic and not isinstance(value, Analytic):
                raise BadInput(f"{name} {value!r}, expected a flexfem.Analytic")
        return function(*positional, **named)

    return cast(Function, checked)


class OfBoth(Protocol[Options, OfStage, OfMechanism]):
    """A question about stages and mechanisms; a mechanism has the same options or fewer."""

    @overload
    def __call__(self, stage: Stage, *args: Options.args, **kwargs: Options.kwargs) -> OfStage: ...
    @overload
    def __call__(self, stage: Mechanism, *args: Options.args, **kwargs: Options.kwargs) -> OfMechanism: ...


def for_mechanisms(
    answer: Callable[Concatenate[Mechanism, Fewer], OfMechanism],
) -> Callable[[Callable[Concatenate[Stage, Options], OfStage]], OfBoth[Options, OfStage, OfMechanism]]:
    """Let a question about stages also take a mechanism, with an answer that has the same options or fewer.

    The function raises BadInput for a mechanism with an option that the answer lacks; its docstring says so.
    """

    def decorate(function: Callable[Concatenate[Stage, Options], OfStage]) -> OfBoth[Options, OfStage, OfMechanism]:
        signature, known = inspect.signature(function), inspect.signature(answer).parameters
        text = (function.__doc__ or "").replace("stage : Stage\n", "stage : Stage or Mechanism\n")
        one, other = (str(each.__annotations__["return"]) for each in (function, answer))
        text = text.replace(f"-------\n{one}\n", f"-------\n{one}, or {other} of a mechanism\n")
        for key in signature.parameters.keys() - known.keys() - {"stage"}:
            text = re.sub(rf"(?m)^({key} : .*(?:\n    .*)*)", r"\1 Not for a mechanism.", text)
        function.__doc__ = text

        of_mechanism: Callable[..., OfMechanism] = answer

        @wraps(function)
        def either(*positional: Any, **named: Any) -> Any:
            bound = signature.bind(*positional, **named).arguments
            if not isinstance(bound["stage"], Mechanism):
                return function(*positional, **named)
            given = {key: value for key, value in bound.items() if value != signature.parameters[key].default}
            mechanism = given.pop("stage")
            for key in given.keys() - known.keys():
                option = "mobility, formula or links" if key == "analytic" else f"{key} {given[key]!r}"
                raise BadInput(f"{option}: an option for the nine-hinge stage, not for a mechanism")
            return of_mechanism(mechanism, **given)

        stage, *others = signature.parameters.values()
        shown = signature.replace(
            parameters=[stage.replace(annotation="Stage | Mechanism"), *others], return_annotation=f"{one} | {other}"
        )
        either.__signature__ = shown  # type: ignore[attr-defined]  # of help and of the documentation
        return cast(OfBoth[Options, OfStage, OfMechanism], either)

    return decorate


class Analytic(NamedTuple):
    """The analytic model of a question.

    Without arguments it has calibrated hinges and elastic links, and is corrected for the thickness of the hinges
    unless the stage file states a `model`. With any argument it is the paper's model with that change.

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
        """Return the model of a stage; append warnings of charts that do not cover it, unless models is "elements".

        Raises BadInput for a model that does not suit the stage.
        """
        return choose(stage, *self, [] if models == "elements" else warnings)


DEFAULT = Analytic()
NO_FILES: Mapping[str, Sourced] = MappingProxyType({})


class Mesh(NamedTuple):
    """The finest mesh: triangles across every neck, and layers in half the thickness, 0 for a plane mesh."""

    resolution: int
    layers: int


def mesh_of(
    models: Models,
    resolution: int | None,
    layers: int | None,
    least: int = 4,
    least_solid: int = 4,
    usual: int = RESOLUTION,
    usual_solid: int = SOLID_RESOLUTION,
) -> Mesh | None:
    """Return the requested mesh, by default the usual plane or three-dimensional one; None without finite elements.

    Raises BadInput if a mesh is requested without finite elements, or if it is too coarse or too fine.
    """
    if models == "analytic":
        for name, value in (("resolution", resolution), ("layers", layers)):
            if value is not None:
                raise BadInput(f"{name} {value} with models 'analytic', expected models with finite elements")
        return None
    if layers is not None:
        usual, least, layers = usual_solid, least_solid, arguments.layers(layers, 3)
    return Mesh(arguments.resolution(usual if resolution is None else resolution, least), layers or 0)


@once
def sectors_of(stage: Stage, resolution: int) -> tuple[Sector, ...]:
    """Return the meshed sectors of a feasible stage."""
    return mesh_sectors(stage, resolution)


@once
def solved(stage: Stage, resolution: int) -> Response:
    """Solve a feasible stage with plane finite elements. Raises BadInput for a model that is not plane."""
    return unit_response(sectors_of(stage, resolution), plate_of(stage))


def on_meshes(steps: Sequence[Step], solve: Callable[[Step], Value], progress: Progress | None = None) -> list[Value]:
    """Return the solutions for all resolutions, coarse to fine, or for other steps."""
    solutions = []
    for step in steps:
        solutions.append(solve(step))
        if progress is not None:
            progress(f"{len(solutions)} of {len(steps)} meshes")
    return solutions


class MeshFields(NamedTuple):
    """Fields on a mesh, in three dimensions at `heights`, mm, of half the thickness; computed when they are written."""

    mesh: StageMesh
    made: Callable[[], dict[str, Array]]
    heights: Array | None = None

    def write(self, path: Path) -> list[Path]:
        """Write the fields as VTU; return the path."""
        write_vtu(self.mesh, path.with_suffix(".vtu"), self.made(), self.heights)
        return [path.with_suffix(".vtu")]


def meshed(mesh: Mesh | None) -> dict[str, int | None]:
    """Return a mesh as settings of a result."""
    return {} if mesh is None else {"resolution": mesh.resolution, "layers": mesh.layers or None}


def about(
    plate: Stage | Mechanism, heat: bool = False, drive: bool = False, files: Mapping[str, Sourced] = NO_FILES
) -> About:
    """Return the subject of a result: a plate, `heat` coefficients or `drive` of a stage, and other files by name."""
    doubts = assumptions([("", plate), *((f"{name}: ", file) for name, file in files.items())])
    digest, lever = plate.hash, plate.layout.lever if isinstance(plate, Mechanism) else plate.chain.link_lengths[2]
    if isinstance(plate, Stage) and (heat or drive):
        doubts = plate.heat_assumptions if heat else plate.drive_assumptions
        digest = plate.heat_hash if heat else plate.drive_hash
    return About(plate.name, str(plate.origin), digest, tuple(doubts.assumed), tuple(doubts.not_stated), lever)


class ModelAnswer(NamedTuple):
    """Values and bands of one model by quantity."""

    values: dict[str, Any]
    bands: Mapping[str, Any] = MappingProxyType({})


def stack_models(
    kind: type[Result], models: Mapping[str, ModelAnswer], axes: Mapping[str, Sequence[str]], along: str = "model"
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Stack the values and bands of models, or curves, along an axis; nan where one has no value."""
    stacked: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    labels = {**AXES, **kind.labels, **axes}
    for arrays, parts in zip(stacked, zip(*models.values(), strict=True), strict=True):
        for name in dict.fromkeys(chain(*parts)):
            over = kind.quantities[name].over
            array = np.full([len(parts), *(len(labels[axis]) for axis in over if axis != along)], np.nan)
            for k, part in enumerate(parts):
                if name in part:
                    place: tuple[Any, ...] = (k, *map(slice, np.shape(part[name])))
                    array[place] = part[name]
            arrays[name] = np.moveaxis(array, 0, over.index(along))
    return stacked


def answer(
    kind: type[Kind],
    subject: Stage | About,
    models: Mapping[str, ModelAnswer],
    mesh: Mesh | None,
    settings: Mapping[str, Any],
    values: Mapping[str, Any] | None = None,
    axes: Mapping[str, Sequence[str]] | None = None,
    **others: Any,
) -> Kind:
    """Return the result of a question from the values of its models and from values without a model axis."""
    labels = {"model": tuple(models), **(axes or {})}
    stacked, bands = stack_models(kind, models, labels)
    subject = about(subject) if isinstance(subject, Stage) else subject
    return kind(subject, stacked | dict(values or {}), bands, labels, dict(settings) | meshed(mesh), **others)
