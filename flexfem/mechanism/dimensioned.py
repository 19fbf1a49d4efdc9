"""Tables with units, validated at every construction and every copy, and results that are cached with a stage.

`model_validate` takes file keys, which end in their unit; calling the class takes names, in mm, N, MPa and rad.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Annotated, Any, Concatenate, ParamSpec, Self, TypeAlias, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Field,
    PlainSerializer,
    SerializationInfo,
    ValidationError,
    ValidationInfo,
)

from flexfem.files import quantities
from flexfem.files.expressions import Evaluated
from flexfem.files.quantities import COUNT, keywords
from flexfem.files.refusals import merged, one_line, problem_of, sentence
from flexfem.files.toml import Table
from flexfem.refused import BadInput
from flexfem.units import UNITS

INSIDE = "inside units"


def in_unit(name: str) -> tuple[Any, ...]:
    """Return the annotations of a number that files state in a unit of `units.UNITS`."""
    factor = 1 / UNITS[name].factor

    def to_inside(value: float) -> float:
        return factor * value

    def to_file(value: float) -> float:
        """Return the file number that converts to `value`: the shortest exact one, otherwise the nearest."""
        near = [value / factor]
        for _ in range(3):
            near = [math.nextafter(near[0], -math.inf), *near, math.nextafter(near[-1], math.inf)]
        return min(near, key=lambda number: (abs(to_inside(number) - value), len(repr(number))))

    def from_python(value: Any, info: ValidationInfo) -> Any:
        """Convert a number given in Python to the unit of the file, in which limits and expressions are."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
        return (
            to_file(float(value))
            if info.context == INSIDE and is_number and not isinstance(value, Evaluated)
            else value
        )

    def dumped(value: float | None, info: SerializationInfo) -> float | None:
        return to_file(value) if info.by_alias and value is not None else value

    return AfterValidator(to_inside), BeforeValidator(from_python), PlainSerializer(dumped)


Length: TypeAlias = Annotated[float, *quantities.above_zero(quantities.LENGTH)]
Strength: TypeAlias = Annotated[float, *quantities.above_zero(quantities.STRENGTH)]
Density: TypeAlias = Annotated[float, *quantities.above_zero(quantities.DENSITY)]
Modulus: TypeAlias = Annotated[float, *quantities.above_zero(quantities.MODULUS), *in_unit("gpa")]
Poisson: TypeAlias = Annotated[float, Field(ge=0, lt=0.5), keywords(**COUNT)]
LEAST_EXPANSION, LARGEST_EXPANSION = 0.01, 300.0  # um/(m K): glass ceramics and polymers
LEAST_OF_FRAME, LOWEST_OF_FRAME = 1e-3, -50.0  # um/(m K): zero-expansion glass as measured; alloys
_ALUMINIUM = " um/(m K), aluminium 23.6"  # states the unit, which is easily taken for 1/K
Expansion: TypeAlias = Annotated[
    float,
    Field(ge=0, le=LARGEST_EXPANSION),
    *quantities.zero_or(LEAST_EXPANSION, unit=_ALUMINIUM),
    *in_unit("um_per_m_k"),
]
FrameExpansion: TypeAlias = Annotated[
    float,
    Field(ge=LOWEST_OF_FRAME, le=LARGEST_EXPANSION),
    *quantities.zero_or(LEAST_OF_FRAME, signed=True, unit=_ALUMINIUM),
    *in_unit("um_per_m_k"),
]
Angle: TypeAlias = Annotated[float, Field(ge=-360, le=360), *in_unit("deg")]


class Dimensioned(Table):
    """A table with two constructors: `model_validate` takes the content of a file, the class itself Python values.

    A value that files state in another unit (GPa, degrees) is rounded to a value that a file can state, by at most one
    unit in the last place, so that every table can be written and read back bit for bit.

    Raises
    ------
    BadInput
        A name is missing or unknown, or a value is not possible; one line with name, value and expectation.
    """

    def __init__(self, /, **values: Any) -> None:
        given = plain(values)
        try:
            self.__pydantic_validator__.validate_python(
                given, self_instance=self, context=INSIDE, by_alias=False, by_name=True
            )
        except ValidationError as error:
            raise BadInput(f"{type(self).__name__}: {_sentence(type(self), given, error)}") from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # nested tables are validated, not called

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a validated copy with some values replaced by name."""
        return type(self)(**{name: getattr(self, name) for name in self.model_fields_set} | dict(update or {}))


def plain(value: Any) -> Any:
    """Convert numpy arrays and scalars, mappings and sequences to lists, dicts and Python numbers."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


def _sentence(model: type[BaseModel], given: dict[str, Any], error: ValidationError) -> str:
    """Describe the first problem and the number of others."""
    problems = merged([problem_of(details, given) for details in error.errors(include_url=False)])
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return one_line(sentence(problems[0], model, given, by_name=True) + more)


Owner = TypeVar("Owner")  # a stage
Args = ParamSpec("Args")
Value = TypeVar("Value")
KEPT = "kept"  # entry of a stage's `__dict__`: not a field, and not part of its hash, copies or pickles


def once(compute: Callable[Concatenate[Owner, Args], Value]) -> Callable[Concatenate[Owner, Args], Value]:
    """Cache the results of a function of a stage, which is frozen, and of other arguments, with the stage.

    All callers share one result: arrays, alone or in a tuple, become read-only; any other result should be immutable.
    """

    @wraps(compute)
    def cached(stage: Owner, /, *args: Args.args, **kwargs: Args.kwargs) -> Value:
        cache: dict[Any, Any] = stage.__dict__.setdefault(KEPT, {})
        key = (compute, args, tuple(kwargs.items()))
        if key not in cache:
            cache[key] = compute(stage, *args, **kwargs)
            for part in cache[key] if isinstance(cache[key], tuple) else (cache[key],):
                if isinstance(part, np.ndarray):
                    part.setflags(write=False)
        value: Value = cache[key]
        return value

    return cached
