"""A stored result whose parts do not belong together is refused where it is read, in one line."""

from __future__ import annotations

import json

import pytest

from flexfem.refused import BadInput
from flexfem.verify.result_files import read_result

from .conftest import result


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (["commanded"], [], "commanded: expected commands"),
        (["commanded"], [0.0, 0.0, 0.0], "commanded: expected commands"),
        (["commanded"], [0.1], "curves.one: expected 1 values"),
        (["curves", "two", "theta"], [1.0], "curves.two: expected 3 values"),
        (["curves", "two", "y", 1], float("nan"), "curves.two.y.1: "),
        (["curves", "two", "y", 1], 10**400, "no JSON|curves.two.y.1"),
        (["curves"], {}, "curves: "),
        (["error_percent"], {}, "error_percent: expected each of the curves"),
        (["models"], {}, "models: expected each of the curves"),
        (["uncertainty", "one"], {}, "uncertainty.one: expected x, y, theta"),
        (["models", "one", "neck_stress"], [[], [], []], "models.one.neck_stress: expected stresses"),
        (["name"], "a\x00b", "name: "),
        (["name"], "\u202egnirts", "name: "),
        (["name"], 10_000 * "n", "name: "),
        (["two\nlines" + 1000 * "x"], 1, r"two\\nlines"),
    ],
)
def test_a_result_whose_parts_do_not_belong_together_is_refused(tmp_path, place, value, said):
    path = tmp_path / "fig.json"
    data = json.loads(result({"one": (0.05, 0.01, 0.02), "two": (0.2, 0.1, 0.02)}).model_dump_json())
    path.write_text(json.dumps(data))
    assert read_result(path).name == "A case $y$"
    inner = data
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(BadInput, match=said) as refused:
        read_result(path)
    assert "\n" not in str(refused.value) and len(str(refused.value)) < len(str(path)) + 300
