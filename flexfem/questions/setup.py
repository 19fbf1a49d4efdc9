"""Common parts of questions: arguments and their description, models, meshes, and assembly of
results.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache, wraps
from itertools import chain
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import (
    Any,
    Literal,
    NamedTuple,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from flexfem import arguments
from flexfem.arrays import Array
from flexfem.fem.export import write_vtu
from flexfem.fem.mesh import LAYERS, RESOLUTION, PlaneMesh
from flexfem.files.provenance import Sourced, assumptions
from flexfem.importing.drawings import load
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.plate import has_sharp_corner
from flexfem.refused import BadInput, printed
from flexfem.results import AXES, SOLID, About, Progress, Result

Models: TypeAlias = Literal["both", "analytic", "elements"]
Value = TypeVar("Value")
Step = TypeVar("Step")
Kind = TypeVar("Kind", bound=Result)
Function = TypeVar("Function", bound=Callable[..., Any])

SUBJECTS = ("mechanism", "stage")  # names of the parameter that is what a question is about


def question(function: Function, not_for: str = "") -> Function:
    """Return a function that checks its arguments before it answers a question.

    A mechanism that has an answer of its own, see `Mechanism.answering`, is answered by that, with
    those options that it takes.

    Parameters
    ----------
    not_for : options that this function does not use; only an answer of its own may.

    Raises
    ------
    BadInput
        When it is called: for a mechanism of another kind than the annotation says, for one that
        cannot be made, for an option that does not apply to it, for a word that its `Literal`
        lacks, and for a model that is no `Analytic`.
    """
    signature = inspect.signature(function)
    subject_name = next((name for name in SUBJECTS if name in signature.parameters), "")

    @cache
    def hints() -> dict[str, Any]:
        return get_type_hints(function)  # resolvable only after its module is complete

    @wraps(function)
    def checked(*positional: Any, **named: Any) -> Any:
        if "layers" in named and "solid" in signature.parameters:
            raise BadInput(f"layers {printed(named['layers'])}: this option is now {SOLID_NOW}")
        for name in SUBJECTS:  # either name of the subject is understood
            if name in named and subject_name:
                named[subject_name] = named.pop(name)
        given = signature.bind(*positional, **named).arguments
        answer = function
        if subject_name:
            mechanism = given[subject_name]
            if isinstance(mechanism, str | os.PathLike):
                mechanism = given[subject_name] = load(mechanism)
            require_kind(function.__name__, mechanism, hints()[subject_name])
            answer = mechanism.answering(function.__name__) or function
            _refuse_options(answer, function, given, not_for)
        for name, value in given.items():
            check_word(name, value, hints().get(name))
        if subject_name:
            mechanism.check()
        if answer is not function:
            _, *names = given
            taken = {name: given[name] for name in names if _takes(answer, name)}
            return answer(mechanism, **taken)
        if given.get("plane"):
            given[subject_name] = _in_plane(mechanism, given)
        return function(**given) if subject_name else function(*positional, **named)

    return cast(Function, checked)


def options(not_for: str = "") -> Callable[[Function], Function]:
    """Declare a `question` with options that it does not use; only an own answer may."""
    return lambda function: question(function, not_for)


def require_kind(
    name: str,
    mechanism: Any,
    expected: Any,
) -> None:
    """Raise BadInput for a mechanism of a kind that a question is not about."""
    if isinstance(mechanism, expected):
        return
    if not hasattr(mechanism, "kind"):
        raise BadInput(f"{name}: {printed(mechanism)}, expected a mechanism, as flexfem.load gives")
    raise BadInput(
        f"{mechanism.origin}: {name} is for a {expected.kind}, not for a {mechanism.kind}"
    )


def _refuse_options(
    answer: Callable[..., Any],
    function: Callable[..., Any],
    given: Mapping[str, Any],
    not_for: str,
) -> None:
    """Raise BadInput for an option that is stated, and does not apply to a mechanism.

    answer : the function that answers: an own one of the mechanism, or the question itself.
    """
    mechanism, *names = given
    defaults = inspect.signature(function).parameters
    unused = [name for name in names if not _takes(answer, name)]
    if answer is function:
        unused = not_for.split()
    for name in unused:
        if name not in given or _is(given[name], defaults[name].default):
            continue
        option = f"{name} {printed(given[name])}".removesuffix(" True")
        if name == "analytic":
            option = "mobility, formula or links"
        raise BadInput(f"{option}: not an option for a {given[mechanism].kind}")


def _takes(function: Callable[..., Any], name: str) -> bool:
    """Whether a function has a parameter, or takes any."""
    parameters = inspect.signature(function).parameters
    return name in parameters or any(
        one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters.values()
    )


def _is(value: Any, default: Any) -> bool:
    """Whether an argument has its default value; an array has none."""
    return not isinstance(value, np.ndarray) and bool(value == default)


def kind_of_answer(asked: Callable[..., Any], mechanism: Mechanism) -> type[Result]:
    """Return the kind of result of a question about a mechanism."""
    own = mechanism.answering(asked.__name__)
    return cast(type[Result], get_type_hints(own or asked)["return"])


def check_word(
    name: str,
    value: Any,
    hint: Any,
) -> None:
    """Raise BadInput for a word that the `Literal` of a parameter lacks, and for a model that is
    no `Analytic`.
    """
    if hint is Analytic and not isinstance(value, Analytic):
        raise BadInput(f"{name} {printed(value)}, expected a flexfem.Analytic")
    members = (hint, *get_args(hint))  # of a union, too
    words = [
        word for member in members if get_origin(member) is Literal for word in get_args(member)
    ]
    if not words or (value is None and NoneType in members):
        return
    if not isinstance(value, str) or value not in words:
        raise BadInput(f"{name} {printed(value)}, expected {' or '.join(words)}")


def _in_plane(mechanism: Any, given: Mapping[str, Any]) -> Any:
    """Return a mechanism whose finite elements are plane. Raises BadInput with `solid`."""
    if given.get("solid"):
        raise BadInput("plane with solid, expected one of the two")
    if mechanism.model == "three_dimensional":
        return mechanism.replace(model="plane_stress")
    return mechanism


class Analytic(NamedTuple):
    """The analytic model of a question.

    Without arguments it has calibrated hinges and elastic links, and is corrected for the thickness
    of the hinges unless the stage file states a `model`. With any argument it is the paper's model
    with that change.

    Parameters
    ----------
    mobility : int, optional
        Of a stage file: mobility of the stage with rigid links, 3, 6, 12 or 21.
    formula : str, optional
        Of a stage file: formula of the hinges, see `flexfem formulas`.
    links : bool
        Of a stage file: model pads, links and platform as elastic; with mobility 21 only.
    """

    mobility: int | None = None
    formula: str | None = None
    links: bool = False


DEFAULT = Analytic()
LIFTED = ("z", "tilt x", "tilt y")  # motions of the output out of the plane
MOST_NAMED = 3  # hinges that a warning names
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
    f"{SOLID}: plane finite elements of the whole plate, corrected by three-dimensional ones of "
    "every hinge, and elastic bodies likewise; the analytic model corrects every hinge by a plate "
    "of its height"
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
    if solid:
        if thickness_resolution is None:
            return LAYERS
        return arguments.thickness_resolution(thickness_resolution, 3)
    if thickness_resolution is not None:
        raise BadInput(
            f"thickness_resolution {printed(thickness_resolution)} without solid, expected solid"
        )
    return None


def mesh_of(
    mechanism: Mechanism,
    models: Models,
    resolution: int | None,
    layers: int | None,
    least: int = 4,
    usual: int = RESOLUTION,
    usual_solid: int | None = None,
) -> Mesh | None:
    """Return the requested mesh, by default the usual plane or three-dimensional one; None without
    finite elements.

    Raises BadInput if a mesh is requested without finite elements, if it is too coarse or too fine,
    or for analytic models alone of a plate without hinges."""
    if models == "analytic":
        require_hinges(mechanism, "which the analytic models need", "models 'both' or 'elements'")
        _refuse_mesh(resolution, layers)
        return None
    if resolution is None:
        resolution = usual
        if layers is not None:
            resolution = mechanism.solid_resolution if usual_solid is None else usual_solid
    return Mesh(arguments.resolution(resolution, least), layers or 0)


def _refuse_mesh(resolution: int | None, layers: int | None) -> None:
    """Raise BadInput for a mesh that is requested without finite elements."""
    stated = ""
    if resolution is not None:
        stated = f"resolution {resolution}"
    elif layers is not None:
        stated = "solid"
    if stated:
        raise BadInput(f"{stated} with models 'analytic', expected models with finite elements")


def require_hinges(
    plate: Mechanism,
    clause: str,
    expected: str,
) -> None:
    """Raise BadInput for a plate without hinges: "no [[hinge]]", a relative clause, and what is
    `expected` instead.
    """
    if not plate.layout.joints:
        raise BadInput(f"{plate.origin}: no [[hinge]], {clause}, expected {expected}")


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

    mesh: PlaneMesh
    made: Callable[[], dict[str, Array]]
    heights: Array | None = None

    def write(self, path: Path) -> list[Path]:
        """Write the fields as VTU; return the path."""
        self.write_vtu(path.with_suffix(".vtu"))
        return [path.with_suffix(".vtu")]

    def write_vtu(self, path: Path) -> None:
        """Write the fields to this file."""
        write_vtu(self.mesh, path, self.made(), self.heights)


def meshed(mesh: Mesh | None) -> dict[str, int | None]:
    """Return a mesh as settings of a result."""
    return (
        {}
        if mesh is None
        else {"resolution": mesh.resolution, "thickness resolution": mesh.layers or None}
    )


def about(mechanism: Mechanism, files: Mapping[str, Sourced] = NOTHING) -> About:
    """Return a mechanism, with other files by name, as the subject of a result."""
    doubts = assumptions([("", mechanism), *((f"{name}: ", file) for name, file in files.items())])
    return About(
        mechanism.name,
        str(mechanism.origin),
        mechanism.hash,
        tuple(doubts.assumed),
        tuple(doubts.not_stated),
        mechanism.lever,
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


def result_of(
    kind: type[Kind],
    subject: About,
    models: Mapping[str, ModelAnswer],
    mesh: Mesh | None,
    settings: Mapping[str, Any] = NOTHING,
    values: Mapping[str, Any] = NOTHING,
    axes: Mapping[str, Sequence[str]] = NOTHING,
    bands: Mapping[str, Any] = NOTHING,
    **others: Any,
) -> Kind:
    """Return a result from the values of models, and from values and bands that are of no model.

    others : warnings, notes and fields of the result.
    """
    labels = {"model": tuple(models), **axes}
    stacked, widths = stack_models(kind, models, labels)
    stated = {**settings, **meshed(mesh)}
    return kind(subject, {**stacked, **values}, {**widths, **bands}, labels, stated, **others)


def answer(
    kind: type[Kind],
    mechanism: Mechanism,
    models: Mapping[str, ModelAnswer],
    mesh: Mesh | None,
    settings: Mapping[str, Any] = NOTHING,
    values: Mapping[str, Any] = NOTHING,
    axes: Mapping[str, Sequence[str]] = NOTHING,
    bands: Mapping[str, Any] = NOTHING,
    **others: Any,
) -> Kind:
    """Return the result of a question about a mechanism, as `result_of`.

    It has the axes hinge, body, point and actuator of the mechanism, and the warnings and notes
    that apply to every question."""
    layout = mechanism.layout
    found = [*values, *chain.from_iterable(model.values for model in models.values())]
    warnings = [*others.pop("warnings", ())]
    if mesh is not None and has_peaks(kind, found):
        warnings += sharp_roots(layout)
    if (layout.residual_stress or np.any(layout.preload)) and "preload" not in settings:
        warnings.append(WITHOUT_PRELOAD)
    notes = [*others.pop("notes", ()), *notes_on_models(layout, models, mesh)]
    return result_of(
        kind,
        about(mechanism),
        models,
        mesh,
        settings,
        values,
        {**axes_of(layout), **axes},
        bands,
        warnings=warnings,
        notes=notes,
        **others,
    )


def axes_of(layout: Layout) -> dict[str, list[str]]:
    """Return the labels of the axes of a mechanism: its hinges, moving bodies, points, actuators."""
    return {
        "hinge": [joint.name for joint in layout.joints],
        "body": [body.name for body in layout.bodies if not body.fixed],
        "point": [name for name, _ in layout.points],
        "actuator": [actuator.name for actuator in layout.actuators],
    }


def has_peaks(kind: type[Result], names: Sequence[str]) -> bool:
    """Whether one of these quantities is a highest stress or strain."""
    meanings = [kind.quantities[name].meaning for name in names]
    return any("stress" in meaning or "strain" in meaning for meaning in meanings)


def notes_on_models(
    layout: Layout, models: Mapping[str, ModelAnswer], mesh: Mesh | None
) -> list[str]:
    """Return notes on what the models are of which a result has values."""
    notes = list[str]()
    if ELASTIC in models:
        notes.append(ELASTIC_READ)
    if SOLID in models and mesh is not None and not mesh.layers:
        notes.append(BY_HINGES)
    if not layout.joints:
        notes.append(NO_HINGES)
    return notes


def sharp_roots(layout: Layout) -> list[str]:
    """Warn of hinges with sharp inner corners, where stress and strain of finite elements are
    singular.
    """
    sharp = [joint.name for joint in layout.joints if has_sharp_corner(layout, joint)]
    if not sharp:
        return []
    named = ", ".join(sharp[:MOST_NAMED])
    if len(sharp) > MOST_NAMED:
        named += f" and {len(sharp) - MOST_NAMED} more"
    return [
        f"hinges with sharp inner corners ({named}): stress and strain of finite elements there "
        "grow without limit as the mesh is refined, and the range at yield falls with them; "
        "state fillet_mm, or smooth = true of a table"
    ]
