"""Tables of files: validated at every construction and every copy, frozen, with results that are
cached with them.

`model_validate` takes file keys, which end in their unit; calling the class takes names, in mm, N,
MPa and rad.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import (
    Annotated,
    Any,
    Concatenate,
    NamedTuple,
    NoReturn,
    ParamSpec,
    Self,
    TypeAlias,
    TypeVar,
)

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, model_validator

from flexfem.files.quantities import INSIDE, STATED
from flexfem.files.refusals import one_line, problems_of, refusal, sentence
from flexfem.files.toml import MAX_DEPTH
from flexfem.refused import BadInput

LABEL_LENGTH = 500  # characters; a full citation fits, a pasted page does not
# entry of a table's `__dict__`: not a field, and not part of its hash, copies or pickles
KEPT = "kept"
Owner = TypeVar("Owner")  # a table
Args = ParamSpec("Args")
Value = TypeVar("Value")


class Unchangeable(dict[str, Any]):
    """A dictionary that cannot be changed.

    A mapping proxy could be neither pickled nor dumped by pydantic.
    """

    def _refuse(self, *args: Any, **kwargs: Any) -> NoReturn:
        raise TypeError(
            "a file's content cannot be changed in place, expected `replace`, which returns a "
            "changed copy"
        )

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how pickles and deep copies make an equal one."""
        return type(self), (dict(self),)


UNCHANGEABLE = AfterValidator(Unchangeable)  # of a mapping in a table


class Table(BaseModel):
    """A table with two constructors: `model_validate` takes the content of a file, the class itself
    Python values.

    Immutable and strict: unknown keys, text for numbers, nan and infinity are refused. Arrays
    become tuples. A value that files state in another unit (GPa, degrees) is rounded to a value
    that a file can state, by at most one unit in the last place, so that every table can be written
    and read back bit for bit. The text below an attribute describes its key in the schema of the
    file.

    Raises
    ------
    BadInput
        A name is missing or unknown, or a value is not possible; one line with name, value and
        expectation.
    """

    model_config = ConfigDict(
        strict=True,
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
    )

    def __init__(self, /, **values: Any) -> None:
        given = plain(values)
        try:
            self.__pydantic_validator__.validate_python(
                given, self_instance=self, context=INSIDE, by_alias=False, by_name=True
            )
        except ValidationError as error:
            problem, *others = problems_of(error, given)
            more = f" (and {len(others)} more)" if others else ""
            text = one_line(sentence(problem, type(self), given, by_name=True) + more)
            raise BadInput(f"{type(self).__name__}: {text}") from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # nested tables are validated, not called

    @model_validator(mode="before")
    @classmethod
    def _arrays_are_tuples(cls, data: Any) -> Any:
        return (
            {key: _frozen(value) for key, value in data.items()} if isinstance(data, dict) else data
        )

    def model_copy(
        self,
        *,
        update: Mapping[str, Any] | None = None,
        deep: bool = False,
    ) -> Self:
        """Return a validated copy with some values replaced by name."""
        return type(self)(
            **{name: getattr(self, name) for name in self.model_fields_set} | dict(update or {})
        )

    def __deepcopy__(self, memo: dict[int, Any] | None = None) -> Self:
        """Return the table itself, since nothing in it can be changed."""
        return self

    def __getstate__(self) -> dict[Any, Any]:
        """Return the content for a pickle, without cached results."""
        state = super().__getstate__()
        return state | {
            "__dict__": {key: value for key, value in state["__dict__"].items() if key != KEPT}
        }

    def __eq__(self, other: object) -> bool:
        """Compare the content; cached results are ignored."""
        same = isinstance(other, type(self))
        return same and all(
            getattr(self, name) == getattr(other, name) for name in type(self).model_fields
        )


def one_form(table: Table, *forms: tuple[str, ...]) -> None:
    """Refuse a table whose stated attributes of these forms are not exactly those of one form."""
    keys = {name: field.alias or name for name, field in type(table).model_fields.items()}
    stated = [
        name
        for name in keys
        if any(name in form for form in forms) and getattr(table, name) is not None
    ]
    if set(stated) not in map(set, forms):
        nearest = max(forms, key=lambda form: len({*form} & {*stated}))
        expected = ", or ".join(" with ".join(keys[name] for name in form) for form in forms)
        raise refusal(
            f"one of {expected}", *[keys[name] for name in stated if name not in nearest][:1]
        )


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def plain(
    value: Any,
    tables: bool = False,
    depth: int = 0,
) -> Any:
    """Convert numpy arrays and scalars, mappings, sequences and, with `tables`, tables to Python
    numbers in lists.

    Raises BadInput for values nested deeper than in any file, such as a dictionary that contains
    itself.
    """
    if depth > MAX_DEPTH:
        raise BadInput(
            f"values nested deeper than {MAX_DEPTH} levels, or in themselves, expected the tables "
            "of a file"
        )
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist(), depth=depth + 1)
    if tables and isinstance(value, BaseModel):
        return value.model_dump(exclude_unset=True, context=STATED)
    if isinstance(value, Mapping):
        return {key: plain(item, tables, depth + 1) for key, item in value.items()}
    return (
        [plain(item, tables, depth + 1) for item in value]
        if isinstance(value, list | tuple)
        else value
    )


class Keywords(NamedTuple):
    """Annotation of a type: additional keywords of its JSON schema, computed when the schema is
    made.
    """

    found: Callable[[], dict[str, Any]]

    def __get_pydantic_json_schema__(
        self, core: Any, handler: Callable[[Any], dict[str, Any]]
    ) -> dict[str, Any]:
        return handler(core) | self.found()


def _label(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value) > LABEL_LENGTH:
        raise refusal(f"one line of 1 to {LABEL_LENGTH} printable characters")
    return value


Label: TypeAlias = Annotated[
    str,
    AfterValidator(_label),
    Keywords(
        lambda: {
            "minLength": 1,
            "maxLength": LABEL_LENGTH,
            "pattern": r"^[^\x00-\x1f]*\S[^\x00-\x1f]*$",
        }
    ),
]


def memoized(
    compute: Callable[Concatenate[Owner, Args], Value],
) -> Callable[Concatenate[Owner, Args], Value]:
    """Keep the results of a function of a table with the table, which cannot change.

    A result is found again by the function and its other arguments. All callers share it: arrays,
    alone or in a tuple, become read-only; any other result should be immutable.
    """

    @wraps(compute)
    def kept(table: Owner, /, *args: Args.args, **kwargs: Args.kwargs) -> Value:
        results: dict[Any, Any] = table.__dict__.setdefault(KEPT, {})
        call = (compute, args, tuple(kwargs.items()))
        if call not in results:
            results[call] = _read_only(compute(table, *args, **kwargs))
        value: Value = results[call]
        return value

    return kept


def _read_only(result: Any) -> Any:
    """Return a result after its arrays have become read-only."""
    for part in result if isinstance(result, tuple) else (result,):
        if isinstance(part, np.ndarray):
            part.setflags(write=False)
    return result
