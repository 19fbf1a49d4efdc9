"""Many designs at once: the protocol of an analytic model that computes designs as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from flexfem.arrays import AnyArray, Array


class BatchRows(NamedTuple):
    """Results of n designs by a `Batch`.

    reasons : (n,) texts, "" for a design with a result, else one line why it is refused, which
    begins with the key path of the file at fault.
    values : (n, outputs), in the order of `Batch.outputs` and in the units of the columns; nan
    where a design is refused or left.
    left : (n,) bool, designs that the arrays cannot decide, such as one whose closed-form check is
    inconclusive. The study computes them by its questions, one after the other.
    """

    reasons: AnyArray
    values: Array
    left: AnyArray


class Batch(Protocol):
    """The analytic model of a study, evaluated for n designs at once.

    A design is a row of factor values: `values` are (n, columns) in file units, in the order of
    `LoadedStudy.columns`, and column k sets all keys of `columns[k].keys` to its value. n may be 0,
    and a study may have no columns, for its base alone; then `values` are (1, 0).

    `flexfem.study.family.Family.batch` returns a `Batch`, or None where designs are computed one
    after the other. That of a mechanism in general is made by `flexfem.study.arrays.batch`; a kind
    of mechanism with a faster one overrides the property. A batch is made once for each study and
    process, is used for all its parts, and has no state that depends on earlier designs.

    A batch gives the numbers that the questions give for each design, to 1e-9. It never raises
    because of a design: an impossible one is refused by its reason.
    """

    @property
    def outputs(self) -> tuple[str, ...]:
        """The outputs of the study that `rows` computes, some or all of `Study.outputs`.

        An output of `ask` is its path, such as `stiffness.free.analytic.x`. The study computes
        other outputs by its questions, for every design that is not refused; a batch that leaves
        one of them therefore saves little.
        """

    @property
    def most(self) -> int:
        """Most designs of one call, which bounds the memory."""

    @property
    def part(self) -> int:
        """Designs in one part of a study, which takes some seconds if `outputs` are all."""

    def rows(
        self,
        values: Array,
        reasons: AnyArray,
    ) -> BatchRows:
        """Return the results of designs (n, columns); `most` is kept by the caller.

        reasons : (n,), reasons of designs that the study has refused already, "" for the others.
        They are not changed; the designs remain refused, for this reason or another one.

        A value outside the limits of its key is refused (`Key.number.refuses`), and a design that
        violates a closed-form condition of the drawing.
        """

    def rooms(self, values: Array) -> Array:
        """Return the rooms (n, conditions) that designs leave to closed-form conditions.

        A design can be made only where all are positive. Each is smooth in the values, and relative
        to a length of the mechanism, so that a search can use them as constraints. A model without
        such conditions returns (n, 0).
        """

    def sizes(self, columns: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the reference size, (n,) or one number, of outputs that symmetry can make zero.

        A change or a value below `arrays.ROUND_OFF` times this size is round-off. columns : outputs
        (n,) by name, in their units. Outputs that are left out are their own size.
        """
