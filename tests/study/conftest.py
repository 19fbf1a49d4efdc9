"""Study files about a generic stage, with any piece of them replaced."""

from __future__ import annotations

from pathlib import Path

import pytest

from flexfem.arrays import Array
from flexfem.files.writing import toml_text
from flexfem.study.columns import Rows
from flexfem.study.loaded import LoadedStudy, load_study

from ..conftest import GENERIC

STAGE = toml_text(
    GENERIC
    | {
        "override": [{"chain": 2, "hinge": "elbow", "neck_mm": 0.71}],
        "provenance": {"thickness_mm": "assumed: a test"},
    }
)

STUDY = """name = "generic study"
stage = "stage.toml"
model = "analytic"
formula = "calibrated"
mobility = 21

[sampling]
method = "monte_carlo"
designs = 500
seed = 7

[[factor]]
key = "hinges.base.neck_mm"
from = 0.4
to = 0.7

[[factor]]
label = "E"
key = "material.youngs_modulus_gpa"
distribution = "normal"
sd = 1.5
"""


class Studies:
    """A folder with the generic stage, in which studies are written."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "stage.toml").write_text(STAGE)

    def write(self, *edits: tuple[str, str], text: str = STUDY) -> Path:
        """The study file with pieces replaced, each of which must be there."""
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        path = self.folder / "study.toml"
        path.write_text(text)
        return path

    def load(self, *edits: tuple[str, str], text: str = STUDY) -> LoadedStudy:
        return load_study(self.write(*edits, text=text))

    def of(
        self, sampling: str, *factors: str, head: str = 'model = "analytic"', tail: str = ""
    ) -> LoadedStudy:
        """A study of factors, each a table's body, and a sampling."""
        body = "".join(f"\n[[factor]]\n{factor}\n" for factor in factors)
        opening = f'name = "generic study"\nstage = "stage.toml"\n{head}\n'
        return self.load(text=f"{opening}[sampling]\n{sampling}\n{body}\n{tail}")


def random(
    studies: Studies, head: str, count: int, tail: str, factors: tuple[str, ...]
) -> LoadedStudy:
    """A study of a few random designs."""
    return studies.of(
        f'method = "monte_carlo"\ndesigns = {count}\nseed = 5', *factors, head=head, tail=tail
    )


def columns(loaded: LoadedStudy, rows: Rows) -> dict[str, Array]:
    """Answers by the names of their columns."""
    return dict(zip(loaded.outputs, rows.values.T, strict=True))


@pytest.fixture
def studies(tmp_path: Path) -> Studies:
    return Studies(tmp_path)
