"""The mechanism: what every question is about."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self

from flexfem.arrays import Array
from flexfem.files.provenance import Assumptions
from flexfem.files.tables import memoized
from flexfem.mechanism.content import FileContent, naming_place
from flexfem.mechanism.dimensions import (
    Callout,
    Dimensions,
    DrawingFacts,
    Span,
    hinge_callouts,
    placed,
)
from flexfem.mechanism.keys import Key
from flexfem.mechanism.layout import Constants, Layout
from flexfem.mechanism.layouts import Layouts
from flexfem.mechanism.materials import Frame, Material
from flexfem.mechanism.plate_checks import check_layout
from flexfem.refused import BadInput
from flexfem.units import DENSITY


class Mechanism(FileContent):
    """A planar flexure mechanism that is cut from one plate: what every question is about.

    Each kind of file that describes mechanisms is a subclass. It must declare the fields below, the
    properties `hash` and `layout`, and `replace`. Everything else has a form here that suits any
    mechanism, and a kind with a better one overrides it. Nobody asks a mechanism of which kind it
    is: a difference between kinds is a method.

    A mechanism cannot be changed; `replace` returns a changed one. Results that are computed from
    it are kept with it, see `files.tables.once`.

    Notes
    -----
    Called itself, the class makes a mechanism of bodies and hinges, by the keys of a mechanism
    file: `Mechanism(name="guide", thickness=10.0, body=[...], ...)`.
    """

    kind: ClassVar[str]
    """Kind of file, such as "mechanism file"."""

    not_exported: ClassVar[tuple[str, ...]] = ()
    """What the models contain and a part for the workshop does not, a sentence each."""

    solid_resolution: ClassVar[int] = 4
    """Usual triangles across every neck of a plate that is wholly in three dimensions: the plane
    compliance of leaf springs and notches is within 0.05 % of its limit."""

    usual: ClassVar[type[Mechanism]]
    """The kind of which mechanisms are made that do not name one."""

    if TYPE_CHECKING:  # fields of every kind, besides `name`, `material` and `units`
        model: str
        thickness: float
        frame: Frame

    def __new__(cls, *_: Any, **content: Any) -> Self:
        """Make a mechanism of the usual kind, as `pathlib.Path` makes one of its kinds."""
        kind: Any = cls.usual if cls is Mechanism else cls
        made: Self = super().__new__(kind)
        return made

    @property
    def layout(self) -> Layout:
        """The mechanism with all its parts in place, as both models read it.

        Raises BadInput for parts that do not fit together.
        """
        raise NotImplementedError

    def replace(self, **changes: Any) -> Self:
        """Return a changed mechanism, validated and checked.

        Parameters
        ----------
        **changes : by attribute name, in mm, N, MPa and rad.

        Raises
        ------
        BadInput
            A name is not known, a value is not possible, or the mechanism cannot be made.
        """
        raise NotImplementedError

    def without_arrays(self, keys: Iterable[str]) -> str:
        """Return why designs that differ in numbers by key path cannot be arrays, "" if they can.

        Parameters
        ----------
        keys : key paths of the file, such as `parameters.length_mm`.
        """
        return f"a {self.kind} has no layouts of many designs"

    def layouts(
        self,
        given: Mapping[str, Array],
        number: int,
    ) -> Layouts:
        """Return the layouts of n designs, where `without_arrays` does not object to the keys.

        Parameters
        ----------
        given : arrays (n,) of the numbers in which the designs differ, by key path, in file units.
        number : n.
        """
        raise NotImplementedError

    def check(self) -> None:
        """Raise BadInput, with key, value and expectation, for a mechanism that cannot be made."""
        with naming_place(self):
            _check_parts(self)

    @property
    def layout_as_drawn(self) -> Layout:
        """The layout for drawings, also of a mechanism that cannot be made."""
        return self.layout

    @property
    def lever(self) -> float:
        """Lever, mm: a rotation times it is comparable with a translation."""
        return self.layout.lever

    @property
    def drive_hash(self) -> str:
        """SHA-256 of what results of the driven mechanism depend on."""
        return self.hash

    @property
    def heat_hash(self) -> str:
        """SHA-256 of what results of a change of temperature depend on."""
        return self.hash

    @property
    def stated_hash(self) -> str:
        """SHA-256 of the content as it is stated, on which changed designs depend."""
        return self.hash

    @property
    def drive_assumptions(self) -> Assumptions:
        """Numbers behind results of the driven mechanism that are assumed or not stated."""
        return Assumptions(list(self.assumed), list(self.not_stated))

    @property
    def heat_assumptions(self) -> Assumptions:
        """Numbers behind results of a change of temperature that are assumed or not stated."""
        return Assumptions(list(self.assumed), list(self.not_stated))

    @property
    def numbers_by_parameter(self) -> Mapping[str, float]:
        """Values of the parameters of the file by key, in the units of their names."""
        return {}

    @property
    def unused_parameters(self) -> tuple[str, ...]:
        """Keys of the parameters on which no number of the mechanism depends."""
        return ()

    def expected_of(self, key: Key) -> str | None:
        """Return what a study is expected to set instead of a key; None for a key that it may set.

        None is also returned for keys that some mechanism of this kind has and this one does not
        use.
        """
        return None if key.places_in(self) else "a number of the mechanism"

    @classmethod
    def answering(cls, question: str) -> Callable[..., Any] | None:
        """Return the function that answers a question for this kind, if there is one of its own.

        It takes a mechanism of this kind and, by name, those options of the question that apply to
        it."""
        return None

    def spans(self, layout: Layout) -> list[Span]:
        """Return the dimensioned lengths of a drawing of a layout of this mechanism."""
        return []

    def callouts(self, layout: Layout) -> list[Callout]:
        """Return the texts of a workshop drawing of a layout of this mechanism."""
        return hinge_callouts(layout)

    def dimensions(self, layout: Layout) -> Dimensions:
        """Return dimensions and texts of a workshop drawing, placed clear of each other.

        layout : of this mechanism, perhaps with further holes.
        """
        return placed(layout, self.spans(layout), self.callouts(layout))

    @property
    def drawing_facts(self) -> DrawingFacts:
        """What a drawing shows beside the outlines and sizes of the parts."""
        return DrawingFacts()

    def with_mounting_holes(self, diameter: float) -> Layout:
        """Return the layout with mounting holes, mm.

        Raises BadInput where the file states holes.
        """
        raise BadInput(
            f"mounting holes of {diameter:g} mm: expected a stage file; a mechanism states holes "
            "of bodies"
        )

    @property
    def plane_problem(self) -> dict[str, Any]:
        """Thickness and material of the `Layout`."""
        constants = self.constants_of(self.material)._asdict()
        constants.pop("name")
        residual_stress = self.material.residual_stress or 0.0
        return {"thickness": float(self.thickness), **constants, "residual_stress": residual_stress}

    def constants_of(self, material: Material) -> Constants:
        """Return the constants of a material in the plane problem.

        Plane strain is plane stress with `E / (1 - nu^2)` and `nu / (1 - nu)`.
        """
        E = material.youngs_modulus
        nu = material.poissons_ratio
        in_plane_strain = self.model == "plane_strain"
        return Constants(
            youngs_modulus=E / (1 - nu**2) if in_plane_strain else E,
            poissons_ratio=nu / (1 - nu) if in_plane_strain else nu,
            density=DENSITY * material.density,
            yield_strength=material.yield_strength,
            out_of_plane=nu if in_plane_strain else 0.0,
            expansion=material.expansion,
        )


@memoized
def _check_parts(mechanism: Mechanism) -> None:
    check_layout(mechanism.layout)


def of_stage(mechanism: Mechanism) -> dict[str, Any]:
    """Description of a mechanism in every report: file, name, and assumed and unstated numbers."""
    return {
        "file": str(mechanism.origin),
        "name": mechanism.name,
        "assumed": list(mechanism.assumed),
        "not_stated": list(mechanism.not_stated),
    }
