"""Declarations of results: quantities with their units and axes, and arrays with labels.

A number has the unit of its declaration everywhere: as an attribute, by `at` and `band`, in JSON,
tables and study columns. The code computes in N, mm, MPa, rad, tonne and s (internal units); a
result keeps these numbers apart, as `internal`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike

from flexfem.arrays import AnyArray, Array, short_repr
from flexfem.files.refusals import as_key
from flexfem.refused import BadInput, printed
from flexfem.units import BY_DIRECTION, DIRECTIONS, NONE, UNITS, Unit, UnitNames

ANALYTIC = "analytic"  # labels of the axis "model"
ELEMENTS = "finite elements"
SOLID = "three dimensions"
SHEET = "plane stress"  # label of the plane problem that is compared with three dimensions
AXES = {
    "direction": DIRECTIONS,
    "component": DIRECTIONS,
    "chain": ("chain 1", "chain 2", "chain 3"),
    "hinge": ("base", "elbow", "platform"),
}
Progress: TypeAlias = Callable[[str], object]
Scale: TypeAlias = Literal["value", "axis", "all", "pose", "wrench", "matrix"]
Place: TypeAlias = tuple[int, ...]
POWERS_OF_LEVER = {"axis": 0, "pose": 1, "wrench": -1}  # by which the third component is multiplied


class Gate(NamedTuple):
    """Change of a number that `regression` accepts.

    relative : to the scale of the number.   band : relative to the band, for a change of the band.
    absolute : in internal units.
    """

    relative: float
    band: float = 0.05
    absolute: float = 0.0


EXACT = Gate(1e-9)  # closed forms and small dense matrices, on any processor
SOLVED = Gate(1e-8)  # iterative solutions, and differences of numbers
NEW_MESH = Gate(
    1.5e-5
)  # finite elements on a new mesh: gmsh 4.13 to 4.15 make almost the same mesh
COARSE_MESHES = Gate(3e-4)  # finite elements on coarser meshes, and extrapolated values
STRESS = Gate(5e-3)  # largest stress on a new mesh
# Accepted change of a band, relative to the larger of both: meshes without symmetry keep its size.
MAGNITUDE = 0.9


@dataclass(frozen=True)
class Quantity:
    """A quantity of a result: a descriptor that returns the array of an instance in declared units.

    Parameters
    ----------
    meaning : str
        A noun phrase, the heading of a table column.
    unit : str or tuple
        Key of `units.UNITS`, "" for a pure number; a tuple by label of the axis "direction", or
        without it of the last axis; a matrix for the last two axes; or a key of `BY_DIRECTION`.
    over : tuple of str
        Axes of the array.
    gate : Gate
        The change that `regression` accepts.
    scale : str
        Reference size of a change and of round-off: the value; the largest value along the last
        axis or of all; the largest component of a pose or wrench, with rotations times the lever or
        moments divided by it; or the matrix diagonal. Of all poses, rotations are multiplied by the
        lever, too.
    beside : str
        Name of another quantity of the same shape whose size counts, too, such as the other end of
        a range.
    shown : bool
        Whether tables include it; JSON always does.
    note : str
        An explanation that is printed below the tables.
    repeated : bool
        Whether another quantity of the result has the same numbers; `regression` does not compare
        them again.
    compared : bool
        Whether tables state the difference of the first model from the last.
    detail : bool
        Whether a terminal shows it with `--all` only.
    """

    meaning: str
    unit: UnitNames = ""
    over: tuple[str, ...] = ()
    gate: Gate = EXACT
    scale: Scale = "value"
    beside: str = ""
    shown: bool = True
    note: str = ""
    repeated: bool = False
    compared: bool = True
    detail: bool = False
    name: str = field(default="", init=False)

    def __set_name__(
        self,
        owner: type,
        name: str,
    ) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "unit", BY_DIRECTION.get(self.unit, self.unit))

    @overload
    def __get__(
        self,
        instance: None,
        owner: type,
    ) -> Quantity: ...
    @overload
    def __get__(
        self,
        instance: Declared,
        owner: type,
    ) -> Array: ...
    def __get__(
        self,
        instance: Declared | None,
        owner: type,
    ) -> Quantity | Array:
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
        """Whether tables choose a prefix for every number: for lengths and angles by direction."""
        return isinstance(self.unit, tuple) and {"mm", "rad"}.issuperset(np.ravel(self.unit))

    @property
    def unit_axes(self) -> tuple[str, ...]:
        """Axes along which the unit may differ: none, the direction or the last one, or two."""
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

    def unit_at(self, place: Place) -> Unit:
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
    """Subject of a result.

    name, file, hash : of the mechanism.   assumed, not_stated : key paths of doubtful numbers.
    lever : mm; a rotation times the lever is comparable with a translation.
    """

    name: str
    file: str = ""
    hash: str = ""
    assumed: Sequence[str] = ()
    not_stated: Sequence[str] = ()
    lever: float = 1.0


class Number(NamedTuple):
    """One number of a result: path, value, band, unit, and accepted changes of value and band."""

    path: str
    value: float
    band: float
    unit: Unit
    accepted: float
    accepted_band: float


@short_repr
class Fields(NamedTuple):
    """Finite-element fields of a figure.

    In three dimensions they are those at the mid-plane, with the largest stress over z.

    nodes : (n, 2), mm.   triangles : (m, 6).   bodies : (m,).   displacement : (n, 2), mm.
    stress : (n,), von Mises, MPa.
    """

    nodes: AnyArray
    triangles: AnyArray
    bodies: AnyArray
    displacement: AnyArray
    stress: AnyArray


class Arrays(NamedTuple):
    """Values and bands by quantity."""

    values: dict[str, Array]
    bands: dict[str, Array]


class Declared:
    """What a result declares and contains: quantities with labelled axes, bands and a subject.

    See `Result`, which adds documents and tables.
    """

    title: ClassVar[str] = ""
    kind_name: ClassVar[str]  # in documents; by default the class name in snake case
    labels: ClassVar[Mapping[str, Sequence[str]]] = {}
    columns: ClassVar[tuple[str, ...]] = ("direction",)
    # the main result: a quantity at labels of its axes
    main_result: ClassVar[tuple[str, Mapping[str, str]] | None] = None
    figure: ClassVar[str] = ""  # module and function that draw it, see `flexfem.plot.figures_of`
    page: ClassVar[str] = ""  # function under flexfem that makes its page, "" for the usual one
    drawn_from_fields: ClassVar[bool] = False  # whether the figure needs `fields`
    has_mesh_fields: ClassVar[bool] = False  # whether `fields` may be written as VTU
    # module under flexfem that shows stored results with fields: `write_stored`, `stored_section`
    stored_by: ClassVar[str] = ""
    footnotes: ClassVar[tuple[str, ...]] = ()  # sentences below every table
    # key of the file that the main result depends on: its warning is printed first
    main_key: ClassVar[str] = ""
    quantities: ClassVar[dict[str, Quantity]] = {}

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
        self.about = about
        self.settings = dict(settings or {})
        self.fields = fields
        self.warnings = list(dict.fromkeys(warnings))
        self.notes = list(notes)
        used = {axis for name in values for axis in self.quantities[name].over}
        labels = {**AXES, **self.labels, **(axes or {})}
        self.axes = {axis: tuple(labels[axis]) for axis in labels if axis in used}
        self.internal = Arrays(self._checked(values), self._checked(bands or {}))
        self.values = self._declared(self.internal.values)
        self.bands = self._declared(self.internal.bands)

    def _checked(self, given: Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Return read-only arrays in internal units, of the shapes of their axes."""
        found = dict[str, Array]()
        for name, values in given.items():
            array = np.array(values, dtype=float)
            shape = tuple(len(self.axes[axis]) for axis in self.quantities[name].over)
            assert array.shape == shape, (
                f"{self.kind()}.{name}: shape {array.shape}, declared {shape}"
            )
            array.flags.writeable = False
            found[name] = array
        return found

    def _declared(self, internal: Mapping[str, Array]) -> dict[str, Array]:
        """Return read-only arrays in declared units."""
        found = dict[str, Array]()
        for name, values in internal.items():
            array = np.asarray(values * self.quantities[name].factors(values.shape))
            array.flags.writeable = False
            found[name] = array
        return found

    @classmethod
    def kind(cls) -> str:
        """Return the name of the kind of result: `kind_name`, or the class name in snake case."""
        if "kind_name" in vars(cls):
            return cls.kind_name
        return "".join(f"_{c.lower()}" if c.isupper() else c for c in cls.__name__).lstrip("_")

    def at(self, quantity: str, **labels: str) -> Array:
        """Return a quantity at labels of some of its axes, in its unit.

        The other axes keep their order. Raises BadInput for an unknown quantity, axis or label.
        """
        return self.array_of(self.values, quantity, labels)

    def band(self, quantity: str, **labels: str) -> Array:
        """Return the bands of the same part, in the same unit; nan where there are none."""
        return self.array_of(self.bands, quantity, labels)

    def unit(self, quantity: str, **labels: str) -> Any:
        """Return the unit of the numbers that `at` returns, in ASCII; "" for pure numbers.

        Where units differ, it is a list with the unit at each label of an axis, such as that of the
        directions, or of two axes of a matrix. Raises BadInput as `at`.
        """
        self._index(quantity, labels)
        one = self.quantities[quantity]
        place = tuple(self._index_along(axis, labels) for axis in one.unit_axes)
        names = np.vectorize(lambda unit: unit.plain, otypes=[object])(one.units)[place]
        different = {*np.ravel(names)}
        return np.array(names).tolist() if len(different) > 1 else different.pop()

    def array_of(
        self, arrays: Mapping[str, Array], quantity: str, labels: Mapping[str, str]
    ) -> Array:
        """Return a part of one of the arrays of a quantity; nan where there is no such array."""
        place = self._index(quantity, labels)
        if quantity in arrays:
            return np.asarray(arrays[quantity][place])
        return np.full_like(self.values[quantity][place], np.nan)

    def _index(
        self,
        quantity: str,
        labels: Mapping[str, str],
    ) -> tuple[int | slice, ...]:
        """Return the index of a part. Raises BadInput for an unknown quantity, axis or label."""
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
        return tuple(self._index_along(axis, labels) for axis in over)

    def _index_along(
        self,
        axis: str,
        labels: Mapping[str, str],
    ) -> int | slice:
        return self.axes[axis].index(labels[axis]) if axis in labels else slice(None)

    def entries(self) -> Iterator[Number]:
        """Yield all numbers with their paths `quantity.label.label`, in declared units.

        Blanks in labels become underscores in paths.
        """
        for name, values in self.values.items():
            quantity = self.quantities[name]
            sizes = self.internal_sizes(name)
            bands = self.band(name)
            for at, labels in self.indices(quantity.over):
                path = ".".join([name, *labels]).replace(" ", "_")
                unit = quantity.unit_at(at)
                gate = quantity.gate
                accepted = gate.relative * float(sizes[at]) + gate.absolute
                band = float(bands[at])
                yield Number(
                    path,
                    float(values[at]),
                    band,
                    unit,
                    accepted * unit.factor,
                    gate.band * abs(band),
                )

    def indices(self, over: Sequence[str]) -> Iterator[tuple[Place, tuple[str, ...]]]:
        """Yield all indices along axes, with their labels."""
        for each in product(*(enumerate(self.axes[axis]) for axis in over)):
            yield tuple(k for k, _ in each), tuple(label for _, label in each)

    def sizes(self, name: str) -> Array:
        """Return the reference sizes of changes and round-off of a quantity, in its unit."""
        sizes = self.internal_sizes(name)
        return np.asarray(sizes * self.quantities[name].factors(sizes.shape))

    def internal_sizes(self, name: str) -> Array:
        """Return the same in internal units, in which a rotation times the lever is a length."""
        one = self.quantities[name]
        values = _magnitudes(self.internal.values[name])
        if one.beside in self.values:
            values = np.maximum(values, _magnitudes(self.internal.values[one.beside]))
        if one.scale == "value":
            return values
        if one.scale == "matrix":
            diagonal = np.sqrt(np.diagonal(values, axis1=-2, axis2=-1))
            return np.asarray(diagonal[..., :, None] * diagonal[..., None, :])
        if one.scale == "all":
            has_poses = one.prefixed and one.over[-1] == "direction"
            weights = self._weights(values, 1 if has_poses else 0)
            largest: Any = np.max(values * weights, initial=0.0)
        else:
            weights = self._weights(values, POWERS_OF_LEVER[one.scale])
            largest = np.max(values * weights, axis=-1, keepdims=True)
        return np.asarray(largest / weights + 0.0 * values)

    def _weights(
        self,
        values: Array,
        power: int,
    ) -> Array:
        """Return factors of the last axis: a power of the lever for its third label, else 1."""
        weights = np.ones(values.shape[-1:])
        if power:
            weights[2:3] = self.about.lever**power
        return weights


def _magnitudes(values: Array) -> Array:
    """Return absolute values, zero where a value is not finite."""
    return np.abs(np.nan_to_num(values, posinf=0.0, neginf=0.0))
