"""Studies of a reference stage by the analytic model, all designs answered at once: what pages and
figures show.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexfem.study.answer import answer
from flexfem.study.collect import StudyTable
from flexfem.study.judge import judge
from flexfem.study.loaded import LoadedStudy, load_study, sample

STAGE = Path(__file__).parents[2] / "geometry" / "mobility6.toml"


def head(name: str, stage: object = STAGE) -> str:
    """How a study file of that name begins."""
    return f'name = "{name}"\nstage = "{stage}"\nmodel = "analytic"\nformula = "calibrated"\nmobility = 21\n'


def study(folder: Path, text: str, *edits: tuple[str, str]) -> LoadedStudy:
    """A study file with pieces replaced, each of which must be there."""
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "tried.toml"
    path.write_text(text)
    return load_study(path)


def answered(loaded: LoadedStudy, **changed: np.ndarray) -> StudyTable:
    """The table of a study, some columns replaced."""
    rows = answer(loaded, 0, loaded.count)
    values = sample(loaded, 0, loaded.count)
    columns = {column.name: values[:, k] for k, column in enumerate(loaded.columns)}
    columns |= {name: rows.values[:, k] for k, name in enumerate(loaded.outputs)}
    columns |= judge(loaded, columns, rows.status == "ok").derived
    return StudyTable(np.arange(loaded.count), rows.status, rows.reason, columns | changed)
