"""Keys of files that choose the analytic model: formula of the hinges, mobility, elastic links."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator

from flexfem.files.refusals import refusal
from flexfem.files.tables import Keywords
from flexfem.hinges.formulas import formula, formulas
from flexfem.refused import BadInput

DEFAULT_FORMULA = "paros-weisbord"
CALIBRATED = "calibrated"


def known_formula(name: str) -> str:
    """Validate a formula name of a file; a refusal lists the registered names."""
    try:
        formula(name)
    except BadInput as error:
        raise refusal(str(error).partition("expected ")[2] or str(error)) from None
    return name


Mobility: TypeAlias = Literal[3, 6, 12, 21]
FormulaName: TypeAlias = Annotated[
    str, AfterValidator(known_formula), Keywords(lambda: {"enum": list(formulas())})
]
OF_MODEL = "Mobility of the analytic model; by default the stage's own"
FORMULA = "Hinge formula of the analytic model"
ELASTIC = "With `mobility = 21`: pads, links and platform of the analytic model are also elastic"
