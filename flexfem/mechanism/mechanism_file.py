"""The mechanism file: a mechanism of bodies and hinges, read from its file and changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import Any, Self

from pydantic import BaseModel

from flexfem.arrays import Array
from flexfem.files.expressions import Evaluated, names_in
from flexfem.files.quantities import STATED
from flexfem.files.refusals import key_path, nearest
from flexfem.files.tables import memoized
from flexfem.files.toml import PathLike
from flexfem.mechanism.assembly import layout_of
from flexfem.mechanism.content import naming_place, read_content
from flexfem.mechanism.designs import layouts_of, unsupported
from flexfem.mechanism.keys import PARAMETERS, Key
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.layouts import Layouts
from flexfem.mechanism.mechanism import Mechanism as Mechanism
from flexfem.mechanism.parts import MechanismTables
from flexfem.mechanism.scans import with_scanned_tables
from flexfem.refused import BadInput
from flexfem.units import without_unit


class MechanismFile(MechanismTables):
    """A planar flexure mechanism that is cut from one plate; lengths in mm.

    Parts are given as dicts by the keys of the file, without their units: `body=[{"name": "ground",
    "path": [(0, 0), (9, 0)], "width": 5.0, "fixed": True}]`. Numbers are in mm, N, rad and tonne,
    expressions in the unit of the file. `provenance` is by key path of the file.
    """

    def replace(self, **changes: Any) -> Self:
        """Return a changed mechanism, validated.

        Expressions are computed again from the parameters.

        Parameters
        ----------
        **changes
            By attribute name, in mm, N, MPa and rad: `thickness=12.0`, `material="ti-6al-4v"`,
            `parameters={"length_mm": 60.0}` in the unit of the name, and
            `hinge={"left": {"neck": 0.4}}` for named parts. A sequence replaces all parts.

        Raises
        ------
        BadInput
            A name is not known, a value is not possible, or the mechanism cannot be made. A new
            parameter must be used by an expression.
        """
        changed = self._replaced(changes)
        for key in changed.parameters:
            if key not in self.parameters and key in changed.unused_parameters:
                near = nearest(key, self.parameters) or "; there are none"
                raise BadInput(
                    f"{key_path(('parameters', key))} is an unknown parameter{near}",
                    str(changed.origin),
                )
        changed.check()
        return changed

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content, expressions evaluated.

        Its name, parameters and provenance are excluded.
        """
        return self._digest({"parameters"}, exclude_none=True)

    @property
    def stated_hash(self) -> str:
        """SHA-256 of the physical content with parameters and texts of expressions, on which its
        designs depend.
        """
        return self._digest(set(), exclude_none=True, context=STATED)

    @property
    def numbers_by_parameter(self) -> Mapping[str, float]:
        """Values of the parameters by key, in the units of their names."""
        return self.parameters

    def expected_of(self, key: Key) -> str | None:
        """Return what a study is expected to set instead of a key; None for a key of this file."""
        if key.places_in(self):
            return None
        known = ", ".join(key_path((*PARAMETERS, name)) for name in self.parameters)
        return f"a parameter of the mechanism ({known or 'it has none'})"

    @property
    def unused_parameters(self) -> tuple[str, ...]:
        """Keys of the parameters on which no number of the mechanism depends."""
        keys = {without_unit(key): key for key in self.parameters}
        texts = [text for name, value in self if name != "parameters" for text in _texts(value)]
        used = set[str]()
        while texts:
            found = {keys[name] for name in names_in(texts.pop())} - used
            used |= found
            texts += [text for key in found for text in _texts(self.parameters[key])]
        return tuple(key for key in self.parameters if key not in used)

    @property
    @memoized
    def layout(self) -> Layout:
        """The mechanism with parameters, copies and outlines resolved, as both models read it.

        Raises BadInput, naming file, line and key, for parts that do not fit together.
        """
        with naming_place(self):
            return layout_of(self)

    def without_arrays(self, keys: Iterable[str]) -> str:
        """As of any mechanism; few mechanism files have what arrays do not."""
        return unsupported(self, keys)

    def layouts(
        self,
        given: Mapping[str, Array],
        number: int,
    ) -> Layouts:
        """As of any mechanism."""
        return layouts_of(self, given, number)


Mechanism.usual = MechanismFile


def _texts(value: Any) -> Iterator[str]:
    """Yield the texts of all expressions in a value of a table."""
    if isinstance(value, Evaluated):
        yield value.text
    elif isinstance(value, BaseModel):
        yield from (text for _, inner in value for text in _texts(inner))
    elif isinstance(value, tuple):
        yield from (text for inner in value for text in _texts(inner))


def read_mechanism(path: PathLike) -> MechanismFile:
    """Read a mechanism file whose bodies and hinges need not fit together.

    Raises BadInput as `load_mechanism`.
    """
    mechanism = read_content(MechanismFile, path, partial(with_scanned_tables, path))
    _ = mechanism.layout
    return mechanism


def load_mechanism(path: PathLike) -> MechanismFile:
    """Read a mechanism file. Raises BadInput, naming file, line, key, value and expectation, for
    invalid content.
    """
    mechanism = read_mechanism(path)
    mechanism.check()
    return mechanism
