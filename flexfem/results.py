"""Results of questions, declared once as `Quantity` attributes of a subclass of `Result`.

Tables, JSON documents with their schema, columns of studies, the reference in the documentation and
the gates of `regression` follow from the declaration. A number has the unit of its declaration
everywhere: as an attribute, by `at` and `band`, in JSON, tables and study columns. Tables may add
an SI prefix to lengths and angles. The code computes in N, mm, MPa, rad, tonne and s (internal
units); a result keeps these numbers apart, as `internal`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from html import escape
from importlib.metadata import PackageNotFoundError, version
from itertools import product
from pathlib import Path
from textwrap import shorten
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import LONGEST, AnyArray, Array, brief, is_largest
from flexfem.files.refusals import as_key, checked_path, place_of
from flexfem.files.toml import PathLike, read_bytes
from flexfem.files.writing import digest, markdown_table, write_atomically
from flexfem.refused import BadInput, printed
from flexfem.units import (
    BY_DIRECTION,
    DIRECTIONS,
    NONE,
    UNITS,
    Unit,
    UnitNames,
    short,
    unit_for,
    unit_of,
    without_unit,
)

PACKAGES = ("flexfem", "numpy", "scipy", "scikit-fem", "gmsh")
FORMAT = 1  # version of the JSON documents
DRAFT = "http://json-schema.org/draft-07/schema#"
LARGEST_FILE = 2**26  # bytes, largest stored result
LONG = 40
MOST_COLUMNS = 8  # characters of a list item that shares a line; columns of a table of records
NEGLIGIBLE = 0.1  # of its band; a smaller value is shown as 0
MOST_DIGITS = 7  # significant digits of a printed number
SMALLEST_PERCENTAGE = 1e-3  # smaller ones, with their bands, are shown as 0
MOST_LISTED = 3  # values in the line with the main result
SPACE = "\N{NO-BREAK SPACE}"
# of the scale of a value: smaller ones, zero on a symmetric mesh, are shown as 0 whatever their
# band
FLOOR = 1e-6
ROUND_OFF = 1e-9  # the same of a band that is not shown
ANALYTIC = "analytic"
ELEMENTS = "finite elements"
SOLID = "three dimensions"  # labels of the axis "model"
SHEET = "plane stress"  # label of the plane problem that is compared with three dimensions
AXES = {
    "direction": DIRECTIONS,
    "component": DIRECTIONS,
    "chain": ("chain 1", "chain 2", "chain 3"),
    "hinge": ("base", "elbow", "platform"),
}
Progress: TypeAlias = Callable[[str], object]
Scale: TypeAlias = Literal["value", "axis", "all", "pose", "wrench", "matrix"]


class Gate(NamedTuple):
    """Change that `regression` accepts: relative to the scale, relative to the band, and absolute
    in internal units.
    """

    relative: float
    band: float = 0.05
    absolute: float = 0.0


EXACT = Gate(1e-9)  # closed forms and small dense matrices, on any processor
SOLVED = Gate(1e-8)  # iterative solutions, and differences of numbers
FRESH = Gate(1.5e-5)  # finite elements on a new mesh: gmsh 4.13 to 4.15 make almost the same mesh
COARSER = Gate(3e-4)  # finite elements on coarser meshes, and extrapolated values
STRESS = Gate(5e-3)  # largest stress on a new mesh
# accepted change of a band relative to the larger of both: meshes without symmetry keep its
# magnitude
MAGNITUDE = 0.9


@dataclass(frozen=True)
class Quantity:
    """A quantity of a result: a descriptor that returns the array of an instance, in the unit of
    the declaration.

    Parameters
    ----------
    meaning : a noun phrase, the heading of a table column.
    unit : key of `units.UNITS`, "" for a pure number; a tuple by label of the axis "direction", or
    without it of the
        last axis; a matrix for the last two axes; or a key of `BY_DIRECTION`.
    over : axes of the array; of a result for both plates, a stage has no point, and a mechanism no
    chain.
    gate : the change that `regression` accepts.
    scale : reference size of a change and of round-off: the value; the largest value along the last
    axis or of all;
        the largest component of a pose or wrench, with rotations times the lever or moments divided
        by it; or the matrix diagonal. Of all poses, rotations are multiplied by the lever, too.
    beside : name of another quantity of the same shape whose size counts, too, such as the other
    end of a range.
    shown : whether tables include it; JSON always does.
    note : an explanation that is printed below the tables.
    only : the plates that have it, by default both; the others have no such key.
    uneven : the gate of a mechanism, by default that of the coarser meshes, without symmetry, of
    the same number.
    repeated : whether another quantity of the result has the same numbers; `regression` does not
    compare them again.
    compared : whether tables state the difference of the first model from the last.
    """

    meaning: str
    unit: UnitNames = ""
    over: tuple[str, ...] = ()
    gate: Gate = EXACT
    scale: Scale = "value"
    beside: str = ""
    shown: bool = True
    note: str = ""
    only: Literal["", "stage", "mechanism"] = ""
    uneven: Gate | None = None
    repeated: bool = False
    compared: bool = True
    name: str = field(default="", init=False)

    def __set_name__(self, owner: type, name: str) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "unit", BY_DIRECTION.get(self.unit, self.unit))

    def of(self, mechanism: bool) -> Quantity:
        """Return the declaration for a mechanism or for a stage, of a result that has both kinds."""
        gate = self.gate
        absent = "chain" if mechanism else "point"
        if mechanism and (self.uneven or gate.relative >= FRESH.relative):
            gate = self.uneven or Gate(
                max(gate.relative, COARSER.relative), MAGNITUDE, gate.absolute
            )
        found = replace(self, over=tuple(axis for axis in self.over if axis != absent), gate=gate)
        object.__setattr__(found, "name", self.name)
        return found

    @overload
    def __get__(self, instance: None, owner: type) -> Quantity: ...
    @overload
    def __get__(self, instance: Result, owner: type) -> Array: ...
    def __get__(self, instance: Result | None, owner: type) -> Quantity | Array:
        if instance is None:
            return self
        try:
            return instance.values[self.name]
        except KeyError:
            raise AttributeError(
                f"{owner.__name__} has no {self.name!r}: {self.meaning} was not computed"
            ) from None

    @property
    def largest(self) -> tuple[str, ...]:
        """Axes over which tables show only the largest value: those of the hinges, and of limits."""
        return tuple(axis for axis in self.over if axis in ("chain", "hinge", "limit"))

    @property
    def prefixed(self) -> bool:
        """Whether tables choose a prefix for every number (um, nm, mrad): for lengths and angles by
        direction.
        """
        return isinstance(self.unit, tuple) and {"mm", "rad"}.issuperset(np.ravel(self.unit))

    @property
    def unit_axes(self) -> tuple[str, ...]:
        """Axes along which the unit may differ: none, that of the direction or the last one, or the
        last two.
        """
        if isinstance(self.unit, str):
            return ()
        if isinstance(self.unit[0], tuple):
            return self.over[-2:]
        return ("direction",) if "direction" in self.over else self.over[-1:]

    @cached_property
    def units(self) -> AnyArray:
        """Units along `unit_axes`, an array of `Unit`."""
        names = np.array(self.unit)
        units = np.empty(names.shape, object)
        for place, name in np.ndenumerate(names):
            units[place] = UNITS[name] if name else NONE
        return units

    def unit_at(self, place: tuple[int, ...]) -> Unit:
        """Return the unit of the value at an index of the array."""
        found: Unit = self.units[tuple(place[self.over.index(axis)] for axis in self.unit_axes)]
        return found

    def factors(self, shape: tuple[int, ...]) -> Array:
        """Return factors (shape) from internal units to the declared units."""
        along = [
            size if axis in self.unit_axes else 1
            for axis, size in zip(self.over, shape, strict=True)
        ]
        factors = np.array([unit.factor for unit in self.units.flat])
        return np.broadcast_to(factors.reshape(along), shape)


class About(NamedTuple):
    """Subject of a result: name of the stage, its file, its hash, key paths of doubtful numbers,
    and the lever l3.
    """

    name: str
    file: str = ""
    hash: str = ""
    assumed: Sequence[str] = ()
    not_stated: Sequence[str] = ()
    lever: float = 1.0  # mm; a rotation times the lever is comparable with a translation


class Number(NamedTuple):
    """One number of a result: path, value, band, their unit, and the accepted changes of value and
    band in it.
    """

    path: str
    value: float
    band: float
    unit: Unit
    accepted: float
    accepted_band: float


class Ends(tuple[float, float]):
    """Both ends of a range, printed as "0.1 to 2"."""

    def __str__(self) -> str:
        return " to ".join(short(end) for end in self)


class TextTable(NamedTuple):
    """A table of texts: head, rows, number of columns at the left that name the rows, and caption."""

    head: list[str]
    rows: list[list[str]]
    names: int
    caption: str = ""


@brief
class Fields(NamedTuple):
    """Finite-element fields of a figure; in three dimensions at the mid-plane, with the largest
    stress over z.
    """

    nodes: AnyArray  # (n, 2), mm
    triangles: AnyArray  # (m, 6)
    bodies: AnyArray  # (m,)
    displacement: AnyArray  # (n, 2), mm
    stress: AnyArray  # (n,), von Mises, MPa


class Arrays(NamedTuple):
    """Values and bands by quantity."""

    values: dict[str, Array]
    bands: dict[str, Array]


class Result:
    """Quantities with labelled axes, their bands, and their subject.

    Each quantity is an attribute. Every number has the unit that its quantity declares and `unit`
    returns: in attributes, `values`, `bands`, `at`, `band`, `entries`, documents, data frames,
    tables and study columns. Tables may add an SI prefix to lengths and angles. Only `internal` is
    in other units.

    A kind of result of stages may have a subclass for mechanisms, which is declared with
    `mechanism=True` and inherits the quantities.

    Parameters
    ----------
    values : arrays by quantity, in internal units; nan where there is no value. Quantities not
    computed are absent.
    bands : half-widths of the numerical uncertainty, same units and shapes; nan where none is
    known.
    axes : labels of the axes that the class does not fix.
    settings : settings of the question, such as models and resolutions.
    warnings, notes : limits of validity, and explanations of the tables.
    fields : finite-element fields for figures; they are not stored.

    Attributes
    ----------
    values : arrays by quantity, in the declared units.
    bands : half-widths of the numerical uncertainty by quantity, in the declared units.
    internal : both in N, mm, MPa, rad, tonne and s, for the code.
    """

    title: ClassVar[str] = ""
    kind_name: ClassVar[str]  # in documents; by default the class name in snake case
    labels: ClassVar[Mapping[str, Sequence[str]]] = {}
    columns: ClassVar[tuple[str, ...]] = ("direction",)
    main: ClassVar[tuple[str, Mapping[str, str]] | None] = (
        None  # the main result: a quantity at labels of its axes
    )
    figure: ClassVar[str] = ""  # module and function under flexfem.plot that draw it
    drawn_from_fields: ClassVar[bool] = False  # whether the figure needs `fields`
    reading: ClassVar[tuple[str, ...]] = ()  # sentences below every table
    main_key: ClassVar[str] = (
        ""  # key of the file that the main result depends on: its warning is printed first
    )
    quantities: ClassVar[dict[str, Quantity]] = {}
    kinds: ClassVar[dict[str, type[Result]]] = {}
    of_mechanism: ClassVar[type[Result]]

    def __init_subclass__(cls, mechanism: bool = False) -> None:
        attributes = {
            name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()
        }
        declared = {
            name: value for name, value in attributes.items() if isinstance(value, Quantity)
        }
        cls.quantities = declared
        cls.of_mechanism = cls
        Result.kinds[cls.kind()] = cls
        if mechanism:
            of_stage: Any = cls.__mro__[1]
            of_stage.of_mechanism = cls
            for kind, other in ((of_stage, "mechanism"), (cls, "stage")):
                kept = {name: one for name, one in kind.quantities.items() if one.only != other}
                kind.quantities = {name: one.of(kind is cls) for name, one in kept.items()}

    def __init__(
        self,
        about: About,
        values: Mapping[str, ArrayLike],
        bands: Mapping[str, ArrayLike] | None = None,
        axes: Mapping[str, Sequence[str]] | None = None,
        settings: Mapping[str, Any] | None = None,
        warnings: Sequence[str] = (),
        notes: Sequence[str] = (),
        fields: Any = None,
    ) -> None:
        self.about, self.settings, self.fields = about, dict(settings or {}), fields
        self.versions = dict(versions())
        self.warnings, self.notes = list(dict.fromkeys(warnings)), list(notes)
        used = {axis for name in values for axis in self.quantities[name].over}
        self.axes = {
            axis: tuple(labels)
            for axis, labels in {**AXES, **self.labels, **(axes or {})}.items()
            if axis in used
        }
        self.internal = Arrays({}, {})
        declared = Arrays({}, {})
        for kept, shown, source in zip(self.internal, declared, (values, bands or {}), strict=True):
            for name, given in source.items():
                quantity = self.quantities[name]
                shape = tuple(len(self.axes[axis]) for axis in quantity.over)
                array = np.array(given, dtype=float)
                assert array.shape == shape, (
                    f"{self.kind()}.{name}: shape {array.shape}, declared {shape}"
                )
                kept[name] = array
                shown[name] = np.asarray(array * quantity.factors(shape))  # of one number, too
                kept[name].flags.writeable = False
                shown[name].flags.writeable = False
        self.values = declared.values
        self.bands = declared.bands

    @classmethod
    def kind(cls) -> str:
        """Return the name of the kind of result: `kind_name`, or the class name in snake case."""
        if "kind_name" in vars(cls):
            return cls.kind_name
        return "".join(f"_{c.lower()}" if c.isupper() else c for c in cls.__name__).lstrip("_")

    # access

    def at(self, quantity: str, **labels: str) -> Array:
        """Return a quantity at labels of some of its axes, in its unit; the other axes keep their
        order.
        """
        return self._part(self.values, quantity, labels)

    def band(self, quantity: str, **labels: str) -> Array:
        """Return the bands of the same part, in the same unit; nan where there are none."""
        return self._part(self.bands, quantity, labels)

    def unit(self, quantity: str, **labels: str) -> Any:
        """Return the unit of the numbers that `at` returns, in ASCII; "" for pure numbers.

        Where units differ, it is a list with the unit at each label of an axis, such as that of the
        directions, or of two axes of a matrix. Raises BadInput as `at`."""
        self._place(quantity, labels)
        one = self.quantities[quantity]
        place = tuple(
            self.axes[axis].index(labels[axis]) if axis in labels else slice(None)
            for axis in one.unit_axes
        )
        names = np.vectorize(lambda unit: unit.plain, otypes=[object])(one.units)[place]
        different = {*np.ravel(names)}
        return np.array(names).tolist() if len(different) > 1 else different.pop()

    def _place(self, quantity: str, labels: Mapping[str, str]) -> tuple[int | slice, ...]:
        """Return the index of a part of a quantity. Raises BadInput for an unknown quantity, axis
        or label.
        """
        if quantity not in self.values:
            raise BadInput(
                f"{self.kind()}.{as_key(quantity)} is not in this result, expected one of: "
                f"{', '.join(self.values)}"
            )
        over = self.quantities[quantity].over
        for axis, label in labels.items():
            if axis not in over or label not in self.axes[axis]:
                known = ", ".join(self.axes.get(axis, over))
                raise BadInput(
                    f"{self.kind()}.{quantity}: {axis} {printed(label)}, expected one of: {known}"
                )
        return tuple(
            self.axes[axis].index(labels[axis]) if axis in labels else slice(None) for axis in over
        )

    def _part(self, arrays: Mapping[str, Array], quantity: str, labels: Mapping[str, str]) -> Array:
        place = self._place(quantity, labels)
        array = (
            arrays[quantity] if quantity in arrays else np.full_like(self.values[quantity], np.nan)
        )
        return np.asarray(array[place])

    def texts(self, quantity: str, **labels: str) -> list[str]:
        """Return cells of a table: the values at labels of some axes, each with band and unit, one
        for each column.
        """
        one = self.quantities[quantity]
        places = [self.axes[axis].index(label) for axis, label in labels.items()]
        return [self._cell(one, at, False, True) for at in self._shown(one, tuple(labels), places)]

    def entries(self) -> Iterator[Number]:
        """Yield all numbers with their paths `quantity.label.label`; blanks in labels become
        underscores.
        """
        for name, values in self.values.items():
            quantity = self.quantities[name]
            sizes = self._sizes(name)
            bands = self.band(name)
            for at, labels in self._places(quantity.over):
                path = ".".join([name, *labels]).replace(" ", "_")
                unit = quantity.unit_at(at)
                accepted = (
                    quantity.gate.relative * float(sizes[at]) + quantity.gate.absolute
                ) * unit.factor
                band = float(bands[at])
                yield Number(
                    path, float(values[at]), band, unit, accepted, quantity.gate.band * abs(band)
                )

    def _places(self, over: Sequence[str]) -> Iterator[tuple[tuple[int, ...], tuple[str, ...]]]:
        for each in product(*(enumerate(self.axes[axis]) for axis in over)):
            yield tuple(k for k, _ in each), tuple(label for _, label in each)

    def sizes(self, name: str) -> Array:
        """Return the reference sizes of changes and round-off of a quantity, in its shape and unit."""
        sizes = self._sizes(name)
        return np.asarray(sizes * self.quantities[name].factors(sizes.shape))

    def _sizes(self, name: str) -> Array:
        """Return the reference sizes in internal units, in which a rotation times the lever is a
        length.
        """
        one = self.quantities[name]
        scale = one.scale
        values = np.abs(np.nan_to_num(self.internal.values[name], posinf=0.0, neginf=0.0))
        if one.beside in self.values:
            other = np.abs(np.nan_to_num(self.internal.values[one.beside], posinf=0.0, neginf=0.0))
            values = np.maximum(values, other)
        if scale == "value":
            return values
        if scale == "all":
            of_poses = one.prefixed and one.over[-1] == "direction"
            lengths = (
                np.where(np.arange(values.shape[-1]) == 2, self.about.lever, 1.0)
                if of_poses
                else 1.0
            )
            return np.asarray(np.max(values * lengths, initial=0.0) / lengths + 0.0 * values)
        if scale == "matrix":
            diagonal = np.sqrt(np.diagonal(values, axis1=-2, axis2=-1))
            return np.asarray(diagonal[..., :, None] * diagonal[..., None, :])
        power = {"axis": 0, "pose": 1, "wrench": -1}[scale]
        weights = (
            np.where(np.arange(values.shape[-1]) == 2, self.about.lever**power, 1.0)
            if power
            else 1.0
        )
        return np.asarray(np.max(values * weights, axis=-1, keepdims=True) / weights + 0.0 * values)

    # documents

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document: numbers in the declared units, null where there is no value."""
        found = {}
        for name, values in self.values.items():
            quantity = self.quantities[name]
            found[name] = {
                "meaning": quantity.meaning,
                "unit": np.array(quantity.unit).tolist(),
                "over": list(quantity.over),
            }
            found[name]["values"] = _nested(values)
            if name in self.bands:
                found[name]["bands"] = _nested(self.bands[name])
        about = {
            key: list(part) if isinstance(part, tuple) else part
            for key, part in self.about._asdict().items()
        }
        return {
            "result": self.kind(),
            "format": FORMAT,
            **about,
            "settings": self.settings,
            "axes": {axis: list(labels) for axis, labels in self.axes.items()},
            "quantities": found,
            "warnings": self.warnings,
            "notes": self.notes,
            "versions": self.versions,
        }

    def write(self, path: Path) -> Path:
        """Store the document as JSON with a digest, so that `read` detects changes; return the
        path.
        """
        return write_sealed(checked_path(path), self.to_dict())

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a stored result of this kind (any kind for `Result`). Raises BadInput for other or
        changed files.
        """
        data = unsealed(path)
        kind = Result.kinds.get(str(data.get("result")))
        if kind is None or not issubclass(kind, cls):
            raise BadInput(
                f"{place_of(path)}: a result of kind {data.get('result')!r}, expected "
                f"{cls.kind()!r}"
            )
        try:
            parts: dict[str, dict[str, Array]] = {"values": {}, "bands": {}}
            for name, part in product(data["quantities"], parts):
                if part in data["quantities"][name]:
                    array = np.array(_numbers(data["quantities"][name][part]), dtype=float)
                    parts[part][name] = array / kind.quantities[name].factors(array.shape)
            about = About(**{key: data[key] for key in About._fields})
            rest = {key: data[key] for key in ("axes", "settings", "warnings", "notes")}
            found = kind(about, parts["values"], parts["bands"], **rest)
            found.versions = data["versions"]
        except (KeyError, TypeError, ValueError, AssertionError):
            raise BadInput(
                f"{place_of(path)}: not in the format of this version of flexfem, store it again"
            ) from None
        return found

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON schema of the document."""
        text = {"type": "string"}
        texts = {"type": "array", "items": text}
        quantities: dict[str, Any] = {}
        for name, one in cls.quantities.items():
            values: dict[str, Any] = {"type": ["number", "null", "string"]}
            for _ in one.over:
                values = {"type": "array", "items": values}
            parts = {
                "meaning": text,
                "unit": {"const": np.array(one.unit).tolist()},
                "over": {"const": list(one.over)},
            }
            quantities[name] = _table_schema(
                one.meaning, parts | {"values": values, "bands": values}, "bands"
            )
        properties = {
            "result": {"const": cls.kind()},
            "format": {"const": FORMAT},
            **dict.fromkeys(("name", "file", "hash", "digest"), text),
            **dict.fromkeys(("assumed", "not_stated", "warnings", "notes"), texts),
            "lever": {"type": "number", "description": "mm"},
            "settings": {"type": "object"},
            "axes": {"type": "object", "additionalProperties": texts},
            "quantities": {
                "type": "object",
                "properties": quantities,
                "additionalProperties": False,
            },
            "versions": {"type": "object", "additionalProperties": text},
        }
        whole = _table_schema(f"flexfem: {cls.title}", properties, "digest")
        return {"$schema": DRAFT, **whole}

    @classmethod
    def reference(cls) -> TextTable:
        """Return the declaration as a table for the documentation."""
        rows = [
            [
                f"{cls.kind()}.{name}",
                one.meaning,
                _units_text(one.unit),
                ", ".join(one.over) or "one number",
            ]
            for name, one in cls.quantities.items()
        ]
        return TextTable(["quantity", "meaning", "unit", "for each"], rows, 1)

    # tables

    def tables(self, plain: bool = True) -> list[TextTable]:
        """Return the tables: one for each quantity with axes as rows and columns; the others share
        tables.

        plain : write units in ASCII, for terminals.
        """
        groups: dict[tuple[tuple[str, ...], str, str], list[Quantity]] = {}
        for name, quantity in self.quantities.items():
            if quantity.shown and name in self.values and not np.all(np.isnan(self.values[name])):
                rows = tuple(
                    a for a in quantity.over if a not in self.columns and a not in quantity.largest
                )
                spread = self._spread(quantity)
                groups.setdefault((rows, spread, name if rows and spread else ""), []).append(
                    quantity
                )
        return [
            self._table(rows, spread, group, plain) for (rows, spread, _), group in groups.items()
        ]

    def _table(
        self, over: tuple[str, ...], spread: str, group: list[Quantity], plain: bool
    ) -> TextTable:
        if not over:  # a row for each quantity
            rows = [
                [one.meaning, *self._rows((), [one], plain, with_unit=True)[0]] for one in group
            ]
            return TextTable(["", *(self.axes[spread] if spread else [""])], rows, 1)
        if over == ("model",) and not spread and len(group) > 3:
            columns = self._rows(over, group, plain, with_unit=True)
            rows = [
                [one.meaning, *(column[1 + k] for column in columns)] for k, one in enumerate(group)
            ]
            return TextTable(["", *(column[0] for column in columns)], rows, 1)
        if not spread:  # a column for each quantity
            head = [*over, *(self._headed(one.meaning, one, 0, plain) for one in group)]
            return TextTable(head, self._rows(over, group, plain), len(over))
        (one,) = group
        by_cell = any(isinstance(each, tuple) for each in one.unit)
        labels = [
            label if by_cell else self._headed(label, one, k, plain)
            for k, label in enumerate(self.axes[spread])
        ]
        caption = f"{one.meaning} ({_units_text(one.unit, plain)})" if by_cell else one.meaning
        head = [*over, *labels]
        rows = self._rows(over, group, plain)
        kept = [
            k for k in range(len(head)) if k < len(over) or any(row[k] for row in rows)
        ]  # not the empty columns
        return TextTable(
            [head[k] for k in kept], [[row[k] for k in kept] for row in rows], len(over), caption
        )

    def _headed(self, text: str, quantity: Quantity, column: int, plain: bool) -> str:
        """Return the heading of a column with its unit, unless the cells contain the unit."""
        spread = self._spread(quantity)
        name = quantity.unit_at(
            tuple(column if axis == spread else 0 for axis in quantity.over)
        ).label(plain)
        return f"{text} ({name})" if name and not self._with_unit(quantity) else text

    def _with_unit(self, quantity: Quantity) -> bool:
        """Return whether cells contain the unit: numbers have their own prefixes, or units differ
        by row.
        """
        by_direction = isinstance(quantity.unit, tuple) and "direction" in quantity.over
        return quantity.prefixed or (
            by_direction and self._spread(quantity) not in ("direction", "component")
        )

    def _rows(
        self, over: tuple[str, ...], group: list[Quantity], plain: bool, with_unit: bool = False
    ) -> list[list[str]]:
        """Return rows of quantities with the same axes; the difference of the models follows the
        last model.
        """
        rows = []
        last = tuple[str, ...]()
        last_model = len(self.axes.get("model", ())) - 1
        for place, labels in self._places(over):
            names = [
                label if labels[: k + 1] != last[: k + 1] else "" for k, label in enumerate(labels)
            ]
            cells = [
                self._cell(one, at, plain, with_unit or self._with_unit(one))
                for one in group
                for at in self._shown(one, over, place)
            ]
            if any(cells):
                rows.append([*names, *cells])
                last = labels
            if over and over[-1] == "model" and place[-1] == last_model > 0:
                differences = [
                    cell for one in group for cell in self._differences(one, over, place)
                ]
                if any(differences):
                    rows.append([*[""] * (len(over) - 1), "difference (%)", *differences])
        return rows

    def _spread(self, quantity: Quantity) -> str:
        """Return the axis of a quantity whose labels are table columns, "" for none."""
        found = [axis for axis in quantity.over if axis in self.columns]
        return found[-1] if found else ""

    def _shown(
        self, quantity: Quantity, over: Sequence[str], place: Sequence[int]
    ) -> list[tuple[int, ...]]:
        """Return the array indices shown in the cells of a row: the first of the largest values of
        each column.
        """
        spread = self._spread(quantity)
        sizes = np.abs(self.internal.values[quantity.name])
        sizes = np.where(np.isnan(sizes), -1.0, sizes)
        found = []
        for k in range(len(self.axes[spread]) if spread else 1):
            known = dict(zip(over, place, strict=True)) | {spread: k}
            ranges = [
                [known[axis]] if axis in known else range(len(self.axes[axis]))
                for axis in quantity.over
            ]
            shown = list(product(*ranges))
            first = np.argmax(is_largest(np.array([sizes[at] for at in shown])))  # of equal ones
            found.append(shown[int(first)])
        return found

    def _cell(self, quantity: Quantity, at: tuple[int, ...], plain: bool, with_unit: bool) -> str:
        value = float(self.internal.values[quantity.name][at])
        band = float(self._part(self.internal.bands, quantity.name, {})[at])
        size = self._sizes(quantity.name)[at]
        if abs(value) <= FLOOR * size:
            value = 0.0
            band = np.nan
        band = band if band > ROUND_OFF * size else np.nan
        unit = quantity.unit_at(at)
        if quantity.prefixed:
            size = max(
                abs(value), float(np.nan_to_num(band))
            )  # of a number within its band, that of the band
            unit = (
                unit_for("theta" if "rad" in unit.name else "x", size)
                if value
                else Unit(unit.factor, "")
            )
        text = number(value * unit.factor, band * unit.factor)
        if unit.name == "%" and abs(value) + np.nan_to_num(band) < SMALLEST_PERCENTAGE:
            text = "0"
        text = (
            f"{text} {unit.label(plain)}".rstrip()
            if with_unit and text and np.isfinite(value)
            else text
        )
        places = dict(zip(quantity.over, at, strict=True))
        where = [self.axes[axis][places[axis]] for axis in reversed(quantity.largest)]
        if not (where and value and text):
            return text
        return (
            f"{text}\n{', '.join(where)}" if plain else f"{text} ({', '.join(where)})"
        )  # terminals are narrow

    def _differences(
        self, quantity: Quantity, over: Sequence[str], place: tuple[int, ...]
    ) -> list[str]:
        """Return the differences of the first model from the last in per cent, for the cells of a
        row of the last.

        There is none from a value that is zero within its band.
        """
        values = self.internal.values[quantity.name]
        sizes = self._sizes(quantity.name)
        last = self._shown(quantity, over, place)
        if "model" not in quantity.over or not quantity.compared:
            return [""] * len(last)
        found = []
        bands = np.nan_to_num(self.internal.bands.get(quantity.name, np.zeros_like(values)))
        for a, b in zip(self._shown(quantity, over, (*place[:-1], 0)), last, strict=True):
            known = np.isfinite(values[a]) and abs(values[b]) > max(FLOOR * sizes[b], bands[b])
            found.append(f"{100 * (values[a] / values[b] - 1):+.2f}" if known else "")
        return found

    def answer(self, plain: bool = True) -> str:
        """Return the main result in one line, "" without one; the last model, or total of shares,
        counts.
        """
        name, labels = self.main or ("", {})
        if name not in self.values:
            return ""
        one = self.quantities[name]
        labels = {
            axis: self.axes[axis][-1] for axis in ("model", "theory", "share") if axis in one.over
        } | dict(labels)
        rest = [axis for axis in one.over if axis not in labels and axis != "commanded"]
        listed = "direction" if "direction" in rest else rest[-1] if rest else ""
        texts: dict[str, list[str]] = {}
        for at, where in self._places(one.over):
            named = dict(zip(one.over, where, strict=True))
            along = named.get("commanded") in (None, named.get("direction"))
            if along and all(named[axis] == label for axis, label in labels.items()):
                before = "" if listed in ("", "mode") else f"{named[listed]} "
                part = ", ".join(named[axis] for axis in rest if axis != listed)
                if text := self._cell(one, at, plain, True).replace("\n", ", "):
                    texts.setdefault(part, []).append(before + text)
        if not texts:
            return ""
        parts = [
            f"{part} " * (len(texts) > 1) + ", ".join(each[:MOST_LISTED])
            for part, each in texts.items()
        ]
        more = f" and {len(parts) - MOST_LISTED} more" if len(parts) > MOST_LISTED else ""
        at_labels = f" ({', '.join(labels.values())})" if labels else ""
        return f"{one.meaning}{at_labels}: {'; '.join(parts[:MOST_LISTED])}{more}"

    def heading(self) -> str:
        """Return the stage and the settings in one line."""
        shown = {
            key: value for key, value in self.settings.items() if not isinstance(value, Mapping)
        }
        texts = [f"{key} {value}" for key, value in shown.items() if value not in (None, "", False)]
        return f"{self.about.name}: {'; '.join([self.title, *texts])}"

    def sentences(self) -> list[str]:
        """Return the explanations below the tables."""
        banded = any(np.any(np.isfinite(band)) for band in self.bands.values())
        source = "from the meshes" + " and the thickness" * (SOLID in self.axes.get("model", ()))
        band = [f"±: half-width of the numerical uncertainty, {source}"] if banded else []
        noted = (one for name, one in self.quantities.items() if one.note and name in self.values)
        notes = [f"{one.meaning}: {one.note}" for one in noted]
        return [*self.reading, *notes, *self.notes, *band]

    def to_markdown(self) -> str:
        """Return all tables in Markdown."""
        lines = []
        for each in self.tables(plain=False):
            align = "l" * each.names + "r" * (len(each.head) - each.names)
            lines += [f"{each.caption}:", ""] if each.caption else []
            lines += [markdown_table(each.head, each.rows, align), ""]
        return "\n".join(
            [f"**{self.heading()}**", "", *lines, *(f"- {text}" for text in self.sentences())]
        )

    def _repr_html_(self) -> str:
        """Return heading, main result, tables, sentences and warnings, for notebooks."""
        tables = "".join(map(html_table, self.tables(plain=False)))
        texts = [*self.sentences(), *(f"Warning: {text}" for text in self.warnings)]
        listed = "".join(f"<li>{escape(text)}</li>" for text in texts)
        about = f"<p><b>{escape(self.heading())}</b><br>{escape(self.answer(plain=False))}</p>"
        return f"{about}{tables}<ul>{listed}</ul>"

    def __repr__(self) -> str:
        found = (
            f"<{type(self).__name__} of {self.about.name!r}: "
            f"{self.answer() or ', '.join(self.values)}"
        )
        return shorten(f"{found}>", LONGEST, placeholder=" ...>")

    def to_frame(self) -> Any:
        """Return all numbers as a pandas DataFrame: path, value, band, unit."""
        import pandas as pd

        rows = [(each.path, each.value, each.band, each.unit.plain) for each in self.entries()]
        return pd.DataFrame(rows, columns=["path", "value", "band", "unit"])

    def to_xarray(self) -> Any:
        """Return all quantities as an xarray Dataset in the declared units, `NAME_band` beside NAME
        with bands.

        Coordinates are the labels of the axes; an axis with the name of a quantity is called
        `AXIS_label`. Attributes of a variable are its meaning and its unit: one, or one for each
        direction, or row by row of a matrix."""
        try:
            import xarray as xr
        except ImportError:
            raise ImportError("to_xarray needs the package xarray: pip install xarray") from None
        dims = {axis: f"{axis}_label" if axis in self.values else axis for axis in self.axes}
        found = {}
        for name in self.values:
            one = self.quantities[name]
            units = [unit.plain or "1" for unit in one.units.flat]
            attributes = {
                "meaning": one.meaning,
                "unit": ", ".join(units if len({*units}) > 1 else units[:1]),
            }
            for key, arrays in ((name, self.values), (f"{name}_band", self.bands)):
                if name in arrays:
                    found[key] = ([dims[axis] for axis in one.over], arrays[name], attributes)
        coordinates = {dims[axis]: list(labels) for axis, labels in self.axes.items()}
        return xr.Dataset(found, coordinates, {"title": self.heading(), "hash": self.about.hash})


def html_table(content: TextTable) -> str:
    """Return a table as an HTML element that needs no style sheet."""
    lines = []
    for tag, row in [("th", content.head), *(("td", row) for row in content.rows)]:
        sides = ["left" if k < content.names else "right" for k in range(len(row))]
        cells = (
            f'<{tag} style="text-align: {s}">{escape(text)}</{tag}>'
            for s, text in zip(sides, row, strict=True)
        )
        lines.append(f"<tr>{''.join(cells)}</tr>")
    caption = f'<caption style="text-align: left">{escape(content.caption)}</caption>'
    return f'<table style="margin-top: 1em">{caption}{"".join(lines)}</table>'


def record_parts(record: Any, plain: bool = True) -> tuple[list[tuple[str, str]], list[TextTable]]:
    """Return the fields of a named tuple as texts by name, and its lists of named tuples as tables.

    Texts contain the units that the field names end in. Keys with equal texts are merged.
    Assumptions are omitted."""
    facts = list[tuple[str, str]]()
    tables = list[TextTable]()
    for name, value in record._asdict().items():
        title = without_unit(name).replace("_", " ")
        if name in ("warnings", "assumed", "not_stated") or value in (None, "", [], {}, False):
            continue
        if hasattr(value, "_fields"):
            inner, more = record_parts(value, plain)
            facts += [
                (f"{title} {inside}" if inside in value._fields else inside, text)
                for inside, text in inner
            ]
            tables += more
        elif isinstance(value, list) and hasattr(value[0], "_fields"):
            tables.append(_records_table(title, value, plain))
        elif name == "provenance":
            facts.append(("sources", "\n" + "\n".join(_sources(value))))
        elif isinstance(value, dict):
            texts = {
                key if isinstance(each, str) else without_unit(key): _text(
                    each, unit_of(key).label(plain)
                )
                for key, each in value.items()
            }
            for text in dict.fromkeys(texts.values()):
                facts.append((", ".join(key for key in texts if texts[key] == text), text))
        elif isinstance(value, list) and any(len(str(each)) > LONG for each in value):
            facts.append((title, "\n" + "\n".join(map(str, value))))
        else:
            facts.append((title, _text(value, unit_of(name).label(plain))))
    return facts, tables


def _sources(provenance: Mapping[str, str]) -> list[str]:
    """Return a line for each kind of source, the text before the first punctuation mark, with its
    keys.
    """
    kinds: dict[str, list[str]] = {}
    for key, source in provenance.items():
        kinds.setdefault(re.split("[:;,]", source, maxsplit=1)[0].strip(), []).append(key)
    return [
        shorten(f"{kind} ({len(keys)}): {', '.join(keys)}", 80, placeholder=" ...")
        for kind, keys in kinds.items()
    ]


def _records_table(title: str, records: Sequence[Any], plain: bool) -> TextTable:
    """Return a table with a row for each named tuple, or a column where it would be wider than a
    terminal.
    """
    units = [unit_of(name).label(plain) for name in records[0]._fields]
    names = [without_unit(name).replace("_", " ") for name in records[0]._fields]
    head = [f"{name} ({unit})" if unit else name for name, unit in zip(names, units, strict=True)]
    rows = [["" if part is None else _text(part) for part in one] for one in records]
    if len(head) > MOST_COLUMNS:
        head, *rows = map(list, zip(head, *rows, strict=True))
        return TextTable(head, rows, len(head), title)
    return TextTable(head, rows, sum(isinstance(part, int | str) for part in records[0][:2]), title)


def _text(value: Any, unit: str = "", digits: int = 8) -> str:
    """Return a value as text; the numbers of a list have six digits at most."""
    if hasattr(value, "_asdict"):
        return _text(value._asdict())
    if isinstance(value, dict):
        texts = (
            f"{without_unit(key).replace('_', ' ')} {_text(each, unit_of(key).plain)}"
            for key, each in value.items()
            if each is not None
        )
        return "; ".join(texts)
    if isinstance(value, list | tuple) and not isinstance(value, Ends):
        between = "; " if value and isinstance(value[0], list | tuple) else ", "
        return f"{between.join(_text(each, digits=6) for each in value)} {unit}".rstrip()
    if isinstance(value, bool):
        return "yes" if value else "no"
    return (
        f"{round(value, 12) + 0.0:.{digits}g} {unit}".rstrip()
        if isinstance(value, float)
        else str(value)
    )


def thousands(count: int) -> str:
    """Return a count with separated thousands."""
    return f"{count:,}".replace(",", SPACE)


def number(value: float, band: float = np.nan) -> str:
    """Return a number with the digits that its band justifies, five significant ones without a
    band; "" for nan.
    """
    if not np.isfinite(value):
        return "" if np.isnan(value) else "unlimited"
    if not band > 0:
        return f"{float(f'{value:.5g}'):.0f}" if 1e5 <= abs(value) < 1e7 else short(value, "z.5g")
    value = 0.0 if abs(value) < NEGLIGIBLE * band < np.inf else value
    places = int(min(1 - np.floor(np.log10(band)), 12)) if np.isfinite(band) else 0
    digits = places + int(np.floor(np.log10(abs(value)))) + 1 if value else 0
    if digits > MOST_DIGITS + 2:  # the band is less than half of the last printed digit
        return short(value, f".{MOST_DIGITS}g")
    if abs(value) >= 1e7 or (places > 6 and abs(value) < 1e-4) or digits > MOST_DIGITS:
        return f"{short(value, f'.{min(max(digits, 1), MOST_DIGITS)}g')} ± {short(band, '.2g')}"
    if places < 0:
        value = round(value, places)
        band = round(band, places)
        places = 0
    return f"{value:.{places}f} ± {band:.{places}f}" if value else f"0 ± {band:.{places}f}"


def write_sealed(path: Path, content: Mapping[str, Any]) -> Path:
    """Store a document as JSON with its digest; return the path. Raises BadInput when it cannot be
    written.
    """
    data = json.loads(json.dumps(content, allow_nan=False))
    text = json.dumps(data | {"digest": digest(data)}, indent=1, allow_nan=False)
    write_atomically(path, lambda file: file.write(f"{text}\n".encode()))
    return path


def unsealed(path: PathLike) -> dict[str, Any]:
    """Return a stored document without its digest. Raises BadInput for other files and changed
    documents.
    """
    try:
        data: dict[str, Any] = json.loads(read_bytes(path, LARGEST_FILE))
        stated = data.pop("digest")
        same = stated == digest(data)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise BadInput(f"{place_of(path)}: expected a result that flexfem stored as JSON") from None
    if not same:
        raise BadInput(f"{place_of(path)}: changed since it was stored, its digest does not match")
    return data


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of the packages that affect numbers."""
    found = dict.fromkeys(PACKAGES, "not installed as a package")
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _nested(values: Array) -> Any:
    """Return an array as nested lists: null for nan, "unlimited" for infinity."""
    found = np.array(values, dtype=object)
    for word, where in (
        (None, np.isnan(values)),
        ("unlimited", values == np.inf),
        ("-unlimited", values == -np.inf),
    ):
        found[where] = word
    return found.tolist()


def _numbers(value: Any) -> Any:
    """Return nested lists of a document with nan for null and infinity for "unlimited"."""
    if isinstance(value, list):
        return [_numbers(each) for each in value]
    return {None: np.nan, "unlimited": np.inf, "-unlimited": -np.inf}.get(value, value)


def _table_schema(description: str, properties: dict[str, Any], optional: str) -> dict[str, Any]:
    """Return the JSON schema of an object with these keys and no others."""
    required = [key for key in properties if key != optional]
    parts = {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }
    return {"description": description, **parts}


def _units_text(unit: UnitNames, plain: bool = False) -> str:
    """Return the distinct units of a quantity, separated by commas."""
    names = np.ravel(unit).tolist()
    return ", ".join(dict.fromkeys(UNITS[name].label(plain) if name else "1" for name in names))
