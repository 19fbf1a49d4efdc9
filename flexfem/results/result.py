"""The result of a question: what it declares, its documents and its tables."""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten
from typing import Any, ClassVar, Self

from flexfem.arrays import LONGEST
from flexfem.files.refusals import checked_path, place_of
from flexfem.lazy import named
from flexfem.refused import BadInput
from flexfem.results.declare import Declared, Quantity
from flexfem.results.frames import long_frame, wide_frame
from flexfem.results.render import (
    Tables,
    TextTable,
    csv_of,
    declaration_table,
    heading,
    html,
    left_out,
    markdown,
    sentences,
)
from flexfem.results.store import (
    document,
    schema_of_kind,
    stored_about,
    stored_arrays,
    unsealed,
    versions,
    write_sealed,
)


class Result(Declared):
    """Quantities with labelled axes, their bands, and their subject.

    Each quantity is an attribute. Every number has the unit that its quantity declares and `unit`
    returns: in attributes, `values`, `bands`, `at`, `band`, `entries`, documents, data frames,
    tables and study columns. Tables may add an SI prefix to lengths and angles. Only `internal` is
    in other units.

    Parameters
    ----------
    about : About
        The subject.
    values : mapping of str to array
        Arrays by quantity, in internal units; nan where there is no value. Quantities not computed
        are absent.
    bands : mapping of str to array, optional
        Half-widths of the numerical uncertainty, same units and shapes; nan where none is known.
    axes : mapping of str to sequence of str, optional
        Labels of the axes that the class does not fix.
    settings : mapping, optional
        Settings of the question, such as models and resolutions.
    warnings, notes : sequence of str
        Limits of validity, and explanations of the tables.
    fields : optional
        Finite-element fields for figures; they are not stored.

    Attributes
    ----------
    values : dict of str to array
        Arrays by quantity, in the declared units.
    bands : dict of str to array
        Half-widths of the numerical uncertainty by quantity, in the declared units.
    internal : Arrays
        Both in N, mm, MPa, rad, tonne and s, for the code.
    """

    kinds: ClassVar[dict[str, type[Result]]] = {}

    def __init_subclass__(cls) -> None:
        attributes = dict[str, Any]()
        for base in reversed(cls.__mro__):
            attributes |= vars(base)
        cls.quantities = {
            name: value for name, value in attributes.items() if isinstance(value, Quantity)
        }
        Result.kinds[cls.kind()] = cls

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.versions = dict(versions())

    def __repr__(self) -> str:
        main = self.answer() or ", ".join(self.values)
        text = f"<{type(self).__name__} of {self.about.name!r}: {main}>"
        return shorten(text, LONGEST, placeholder=" ...>")

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON document: numbers in the declared units, null where there is no value."""
        return {**document(self), "versions": self.versions}

    def write(self, path: Path) -> Path:
        """Store the document as JSON with a digest, so that `read` detects changes.

        Returns the path.
        """
        return write_sealed(checked_path(path), self.to_dict())

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a stored result of this kind, any kind for `Result`.

        Raises BadInput for other or changed files.
        """
        data = unsealed(path)
        kind = Result.kinds.get(str(data.get("result")))
        if kind is None or not issubclass(kind, cls):
            raise BadInput(
                f"{place_of(path)}: a result of kind {data.get('result')!r}, expected "
                f"{cls.kind()!r}"
            )
        try:
            arrays = stored_arrays(kind, data)
            rest = {key: data[key] for key in ("axes", "settings", "warnings", "notes")}
            found = kind(stored_about(data), *arrays, **rest)
            found.versions = data["versions"]
        except (KeyError, TypeError, ValueError, AttributeError, AssertionError):
            raise BadInput(
                f"{place_of(path)}: not in the format of this version of flexfem, store it again"
            ) from None
        return found

    @classmethod
    def schema(cls) -> dict[str, Any]:
        """Return the JSON schema of the document."""
        return schema_of_kind(cls)

    @classmethod
    def reference(cls) -> TextTable:
        """Return the declaration as a table for the documentation."""
        return declaration_table(cls)

    def tables(
        self,
        plain: bool = True,
        brief: bool = False,
    ) -> list[TextTable]:
        """Return the tables: one for each quantity with axes as rows and columns; others share one.

        plain : write units in ASCII, for terminals.
        brief : leave out details, and state the units of lengths and angles in headings.
        """
        return Tables(self, plain, brief).tables()

    def texts(self, quantity: str, **labels: str) -> list[str]:
        """Return cells of a table: values at labels of some axes, each with band and unit."""
        return self.visible_texts(quantity, 0.0, **labels)

    def visible_texts(
        self,
        quantity: str,
        least_band: float,
        **labels: str,
    ) -> list[str]:
        """Return cells as `texts`, without bands below `least_band` relative to their values."""
        one = self.quantities[quantity]
        places = [self.axes[axis].index(label) for axis, label in labels.items()]
        shown = Tables(self, plain=False, least_band=least_band)
        return [shown.cell(one, at, True) for at in shown.shown(one, tuple(labels), places)]

    def answer(self, plain: bool = True) -> str:
        """Return the main result in one line, "" without one; the last model, or total of shares."""
        return Tables(self, plain).answer()

    def heading(self) -> str:
        """Return the subject and the settings in one line."""
        return heading(self)

    def sentences(self, brief: bool = False) -> list[str]:
        """Return the explanations below the tables, with `short_repr` without those of details."""
        return sentences(self, brief)

    def left_out(self) -> list[str]:
        """Return the meanings of the quantities that brief tables leave out."""
        return left_out(self)

    def to_markdown(self) -> str:
        """Return all tables in Markdown."""
        return markdown(self)

    def _repr_html_(self) -> str:
        """Return the tables and the figure for a notebook, which alone loads what draws it."""
        drawn = named("plot.inline.inline_figure")(self) if self.figure else ""
        return f"{html(self)}{drawn}"

    def to_frame(
        self,
        *quantities: str,
        long: bool = False,
    ) -> Any:
        """Return numbers as a pandas DataFrame, with a row for each model, case or mode.

        A column is a quantity at labels of its other axes, with its unit in its name, such as
        `free x (N/mm)`; the column `free x band (N/mm)` has the band.

        Parameters
        ----------
        *quantities : str
            Names of quantities; by default all.
        long : bool
            Return a row for each number instead: path, value, band, unit.

        Raises
        ------
        BadInput
            A quantity is not in this result.
        """
        return long_frame(self) if long else wide_frame(self, quantities)

    def to_csv(self) -> str:
        """Return all numbers as CSV: a row for each, with its labels in a column for each axis.

        The columns are quantity, the axes, value, band and unit; numbers that are nan have no row.
        """
        return csv_of(self)

    def to_xarray(self) -> Any:
        """Return all quantities as an xarray Dataset in the declared units.

        `NAME_band` is beside NAME where there are bands. Coordinates are the labels of the axes; an
        axis with the name of a quantity is called `AXIS_label`. Attributes of a variable are its
        meaning and its unit: one, or one for each direction, or row by row of a matrix.
        """
        try:
            import xarray as xr
        except ImportError:
            raise ImportError("to_xarray needs the package xarray: pip install xarray") from None
        dims = {axis: f"{axis}_label" if axis in self.values else axis for axis in self.axes}
        found = dict[str, Any]()
        for name in self.values:
            one = self.quantities[name]
            units = [unit.plain or "1" for unit in one.units.flat]
            shown = units if len({*units}) > 1 else units[:1]
            attributes = {"meaning": one.meaning, "unit": ", ".join(shown)}
            along = [dims[axis] for axis in one.over]
            found[name] = (along, self.values[name], attributes)
            if name in self.bands:
                found[f"{name}_band"] = (along, self.bands[name], attributes)
        coordinates = {dims[axis]: list(labels) for axis, labels in self.axes.items()}
        return xr.Dataset(found, coordinates, {"title": self.heading(), "hash": self.about.hash})
