"""A stored answer is read as it was stored, by any command: what was edited, or is of another run,
is refused.
"""

from __future__ import annotations

import json
import random
import shutil

import numpy as np
import pytest

from flexfem.design.result import read_design
from flexfem.paper.verification import Verification
from flexfem.plot.errors import mechanism_figure
from flexfem.questions.errors import MechanismErrors
from flexfem.refused import BadInput
from flexfem.results import write_sealed

from ..design.recorded import recorded
from .conftest import fields, guide_errors, result

ERRORS = {"one": (0.05, 0.01, 0.02), "two": (0.2, 0.1, 0.02)}
READ = {"verification": Verification.read, "design": read_design}


def written(folder, **moved):
    """A stored verification."""
    found = result(ERRORS)
    found.fields = {label: fields() for label in ERRORS} | moved
    return found.write(folder / "fig.json")


@pytest.fixture
def stored(tmp_path):
    """A file of every kind of answer that is read again."""
    return {
        "verification": written(tmp_path),
        "design": write_sealed(tmp_path / "design.json", recorded().model_dump(mode="json")),
    }


def leaves(data, place=()):
    """The place of every number, text, truth and nothing."""
    if not isinstance(data, dict | list):
        return [place]
    pairs = data.items() if isinstance(data, dict) else enumerate(data)
    return [leaf for key, inner in pairs for leaf in leaves(inner, (*place, key))]


def edited(value):
    """Another value of the same kind, as near as can be."""
    if isinstance(value, bool) or value is None:
        return not value
    return (
        f"{value}."
        if isinstance(value, str)
        else float(np.nextafter(value, np.inf))
        if value % 1
        else value + 1
    )


@pytest.mark.usefixtures("unrendered")
@pytest.mark.parametrize("kind", READ)
def test_an_answer_of_which_anything_was_edited_is_refused(kind, stored, flexfem, tmp_path):
    """Two hundred places of each, by the reader of all commands; one by the commands themselves."""
    path = stored[kind]
    page = tmp_path / "page.html"
    assert flexfem("report", path, "-o", page)[0] == 0
    page.unlink()
    text = path.read_text()
    places = leaves(json.loads(text))
    for place in random.Random(3).sample(places, min(len(places), 200)):
        data = inner = json.loads(text)
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = edited(inner[place[-1]])
        path.write_text(json.dumps(data))
        with pytest.raises(BadInput, match="changed since it was stored"):
            READ[kind](path)
    for command in (["report", path, "-o", page], ["plot", path, "-o", tmp_path / "none"]):
        code, out, err = flexfem(*command)
        assert (code, out, err.count("\n")) == (
            2,
            "",
            1,
        ) and f"{path.name}: changed since it was stored" in err
    assert not page.exists() and not (tmp_path / "none").exists()
    path.write_text(
        json.dumps({key: value for key, value in json.loads(text).items() if key != "digest"})
    )
    with pytest.raises(BadInput):
        READ[kind](path)
    path.write_text(
        json.dumps(json.loads(text), indent=3, sort_keys=True)
    )  # the same in another order
    assert READ[kind](path).name


def test_plot_draws_what_verify_stored_of_a_mechanism(flexfem, tmp_path):
    found = guide_errors()
    found.write(tmp_path / "guide.json")
    code, _, err = flexfem("plot", tmp_path / "guide.json", "-o", tmp_path / "drawn")
    assert (code, err) == (0, "") and {each.name for each in (tmp_path / "drawn").iterdir()} == {
        "guide.png",
        "guide.pdf",
    }
    for row, ax in enumerate(mechanism_figure(found).axes):
        bars = [
            [bar.get_width() for bar in bars] for bars in ax.containers if hasattr(bars, "patches")
        ]
        np.testing.assert_allclose(bars, np.arange(18.0).reshape(2, 3, 3)[:, row] - 4.5)


def test_a_direction_that_a_mechanism_holds_has_no_panel():
    found = guide_errors()
    percent = found.internal.values["percent"].copy()
    percent[:, [0, 2]] = np.nan
    held = MechanismErrors(
        found.about, found.internal.values | {"percent": percent}, found.internal.bands, found.axes
    )
    (ax,) = mechanism_figure(held).axes
    assert ax.get_title(loc="left").endswith("command in y") or "command in y" in ax.get_title()


def test_fields_of_another_run_or_edited_are_refused(stored, tmp_path, flexfem):
    path = stored["verification"]
    beside = path.with_suffix(".npz")
    answer = Verification.read(path)
    assert {*answer.read_fields(path)} == {"one", "two"}
    (tmp_path / "other").mkdir()
    moved = fields()._replace(stress=fields().stress + 1.0)
    other = written(tmp_path / "other", two=moved).with_suffix(".npz")
    with np.load(beside) as arrays:
        held = dict(arrays)
    held["1.displacement"] = np.nextafter(held["1.displacement"], 1.0)
    for spoil in (lambda: shutil.copy(other, beside), lambda: np.savez(beside, **held)):
        spoil()
        code, out, err = flexfem("plot", path, "-o", tmp_path / "none")
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert (
            "fig.npz: not the fields that were stored with" in err
            and not (tmp_path / "none").exists()
        )
