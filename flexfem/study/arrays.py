"""The analytic model of any mechanism for many designs at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flexfem.mechanism.mechanism import Mechanism
    from flexfem.study.batch import Batch
    from flexfem.study.factors import Column
    from flexfem.study.plan import Study


def batch(base: Mechanism, study: Study, columns: Sequence[Column]) -> Batch | None:
    """Return the designs of a study as arrays, None where they are computed one after the other."""
    return None
