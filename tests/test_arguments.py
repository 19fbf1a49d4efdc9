"""Wrong arguments in Python are refused in one line, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest

import flexfem

ROOT = Path(__file__).parents[1]
FIXTURE = ROOT / "cases" / "fixture.toml"
STUDY = ROOT / "cases" / "study-reach.toml"
NAN = float("nan")
INF = float("inf")
STAGE = flexfem.load(ROOT / "geometry" / "mobility6.toml")
BARE = STAGE.replace(material={"name": "own", "expansion": None})
TIRING = STAGE.replace(material="al-2024-t4")
MOVED = {"amplitude": (0.1, 0, 0)}
BAD = [  # function of the API, arguments, options, what is said
    ("load", [None], {}, "None, expected the path"),
    ("load", [b"a.toml"], {}, "expected the path"),
    ("check", [None], {}, "None, expected a mechanism"),
    ("schema", ["stage"], {"output": 3}, "3, expected the path"),
    ("stiffness", [STAGE], {"force": (NAN, 0, 0)}, "force: expected finite"),
    ("stiffness", [STAGE], {"force": (1, 2)}, r"force of shape \(2,\)"),
    ("stiffness", [STAGE], {"force": "abc"}, "force: expected numbers"),
    ("stiffness", [STAGE], {"force": (2e9, 0, 0)}, r"within ±1e\+09"),
    ("stiffness", [STAGE], {"resolution": 65}, "resolution 65, expected an integer from 4 to 64"),
    (
        "stiffness",
        [STAGE],
        {"analytic": flexfem.Analytic(formula="")},
        "hinge formula '' is not known",
    ),
    (
        "stiffness",
        [STAGE],
        {"force": (1, 0, 0), "displacement": (1, 0, 0)},
        "expected one of the two",
    ),
    (
        "stiffness",
        [STAGE],
        {"displacement": (1e5, 0, 0)},
        "displacement 100000, expected numbers within",
    ),
    (
        "stiffness",
        [STAGE],
        {"models": "analytic", "resolution": 8},
        "resolution 8 with models 'analytic'",
    ),
    ("stiffness", [STAGE], {"models": None}, "models None, expected both or analytic or elements"),
    (
        "drive",
        [STAGE],
        {"pose": (0, 0, 0), "models": "elements"},
        "models 'elements', expected both or analytic",
    ),
    ("drive", [BARE.replace(actuator=[])], {"pose": (0, 0, 0)}, r"no \[\[actuator\]\]"),
    ("drive", [STAGE], {"pose": (NAN, 0, 0)}, "pose: expected finite"),
    ("drive", [STAGE], {"pose": (1e9, 0, 0)}, r"pose 1e\+09, expected numbers within ±100"),
    (
        "reach",
        [STAGE],
        {"analytic": (6, None, False)},
        r"analytic \(6, None, False\), expected a flexfem.Analytic",
    ),
    (
        "large",
        [STAGE],
        {"amplitude": 1e-300},
        "amplitude 1e-300, expected a number from 1e-09 to 1000",
    ),
    *(
        (
            "converge",
            [STAGE],
            {"resolutions": given},
            rf"resolutions \[{', '.join(map(str, given))}\], expected three",
        )
        for given in ([], [10, 13], [4, 5, 8])
    ),
    ("verification", [ROOT / "cases" / "fig5.toml"], {"output": 3}, "3, expected the path"),
    (
        "verification",
        [ROOT / "cases" / "fig5.toml"],
        {"output": FIXTURE},
        "fixture.toml is a file, expected a folder",
    ),
    ("summary", [STAGE], {"resolution": 4.5}, "resolution 4.5"),
    ("gravity", [STAGE], {"angle": 1e3}, "angle 1000.0"),
    ("gravity", [STAGE], {"payload": -1.0}, "payload -1.0"),
    ("gravity", [STAGE], {"models": "analytic", "solid": True}, "solid"),
    ("modes", [STAGE], {"drives": "on"}, "drives 'on', expected disengaged or engaged"),
    ("modes", [STAGE], {"payload": (NAN, 0)}, "payload nan 0, expected two numbers from 0"),
    ("modes", [STAGE], {"payload": (-1, 0)}, "payload -1 0, expected two numbers from 0"),
    ("modes", [STAGE], {"payload": "12"}, "payload '12', expected two numbers"),
    ("modes", [STAGE], {"count": 0}, "count 0, expected an integer from 1 to 100"),
    ("modes", [STAGE], {"damping": NAN}, "damping nan, expected a number above 0, at most 99"),
    ("modes", [STAGE], {"tilting": 3.0}, "tilting without solid"),
    ("modes", [STAGE], {"solid": True, "drives": "engaged"}, "drives 'engaged' with solid"),
    (
        "modes",
        [STAGE],
        {"solid": True, "payload": (1, 20), "tilting": 9.9},
        "tilting 9.9, expected a number from 10",
    ),
    ("modes", [STAGE], {"solid": True, "count": 41}, "count 41, expected an integer from 1 to 40"),
    ("life", [TIRING], {"amplitude": (0, 0, 0)}, "amplitude: expected a motion"),
    ("life", [TIRING], {**MOVED, "ratio": 1.0}, "ratio 1.0, expected"),
    ("life", [TIRING], {**MOVED, "ratio": NAN}, "ratio nan, expected"),
    ("life", [TIRING], {**MOVED, "mean": (0, 0, 0), "ratio": 0.0}, "mean and ratio"),
    ("life", [TIRING], {**MOVED, "cycles": 0}, "cycles 0, expected"),
    (
        "life",
        [TIRING],
        {**MOVED, "notch_sensitivity": 1.2},
        "notch_sensitivity 1.2, expected a number from 0",
    ),
    ("life", [TIRING], {**MOVED, "law": 3.0}, "law 3.0, expected"),
    ("life", [TIRING], {**MOVED, "law": flexfem.Basquin(900.0, 0.1)}, "exponent 0.1"),
    (
        "life",
        [TIRING],
        {**MOVED, "law": flexfem.Basquin(130.5, -0.102)},
        "130.5 MPa, expected 0.5 to 50 of .* 303",
    ),
    ("life", [STAGE], MOVED, r"coefficient_mpa is missing.*steel-4340"),
    ("drift", [STAGE], {"resolution": 3}, "resolution 3, expected an integer from 4"),
    (
        "drift",
        [STAGE],
        {"solid": True, "thickness_resolution": 2},
        "thickness_resolution 2, expected an integer",
    ),
    (
        "modes",
        [STAGE],
        {"thickness_resolution": 3},
        "thickness_resolution 3 without solid, expected solid",
    ),
    (
        "stiffness",
        [STAGE],
        {"layers": 3},
        "layers 3: this option is now solid, with thickness_resolution",
    ),
    ("drift", [BARE], {}, r"material.expansion_um_per_m_k is missing, expected um/\(m K\)"),
    ("drift", [STAGE], {"analytic": flexfem.Analytic(mobility=4)}, "mobility"),
    ("drift", [STAGE], {"analytic": flexfem.Analytic(6, links=True)}, "elastic links"),
    ("drift", [5], {}, "5, expected a mechanism"),
    ("experiment", [STAGE, None], {}, "None, expected the path"),
    ("experiment", [STAGE, FIXTURE], {"measured": 3}, "3, expected the path"),
    ("identify", [STAGE, FIXTURE], {"unknown": "bar"}, "unknown 'bar', expected pole or springs"),
    (
        "identify",
        [STAGE, FIXTURE],
        {"confidence": 0.95},
        "confidence 0.95, expected a number from 50",
    ),
    ("as_built", [STAGE, FIXTURE], {}, "this is a fixture file, expected a necks file"),
    ("mesh", [STAGE, "TARGET"], {"resolution": -1}, "resolution -1, expected an integer from 2"),
    ("mesh", [STAGE, None], {}, "None, expected the path"),
    ("export", [STAGE, "TARGET"], {}, "extension '.vtu', expected a file name"),
    (
        "export",
        [STAGE, Path("a.svg")],
        {"kerf": INF},
        "kerf inf, expected a number from 0.01 to 10 mm",
    ),
    ("view", [FIXTURE], {"output": 3}, "3, expected the path"),
    ("new_stage", ["TARGET"], {}, "expected a file name that ends in .toml"),
    ("schema", [[]], {}, r"format \[\] is not known"),
    ("report", [3, Path("a.html")], {}, "3, expected the path"),
    ("hinge_review", ["x"], {}, "height 'x'"),
    ("run_study", [None], {}, "None, expected the path"),
    ("run_study", [STUDY, 3], {}, "3, expected the path"),
]


@pytest.mark.parametrize(
    ("function", "given", "options", "said"), BAD, ids=[f"{row[0]}-{row[3]}" for row in BAD]
)
def test_a_wrong_argument_is_refused_in_one_line_and_nothing_is_written(
    function, given, options, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    given = [tmp_path / "a.vtu" if one == "TARGET" else one for one in given]
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        getattr(flexfem, function)(*given, **options)
    assert "\n" not in str(refused.value) and list(tmp_path.iterdir()) == []


class Unprintable:
    """An object of which Python can make no text."""

    def __repr__(self):
        raise ValueError("no text")

    def __str__(self):
        raise ValueError("no text")


ODD = Unprintable()
INSIDE = {"name": "own"}
LISTED = []
INSIDE["material"] = INSIDE
LISTED.append(LISTED)
GUIDE = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
HOSTILE = [  # plate, changes, what is said
    (GUIDE, {"provenance": 3}, "parallelogram.toml, changed: provenance = 3, expected a table"),
    (STAGE, {"provenance": ["own"]}, "mobility6.toml, changed: provenance = .*, expected a table"),
    (GUIDE, {"parameters": {3: 1.0}}, "expected names of parameters in quotes"),
    (GUIDE, {"hinge": {3: {"neck": 1.0}}}, "hinge: no 3, expected one of"),
    (GUIDE, {"hinge": {ODD: 1.0}}, "hinge: no "),
    (GUIDE, {"material": INSIDE}, "values nested deeper than 32 levels, or in themselves"),
    (GUIDE, {"body": LISTED}, "values nested deeper than 32 levels, or in themselves"),
    (STAGE, {"neck": {"elbow": INSIDE}}, "values nested deeper than 32 levels, or in themselves"),
    (GUIDE, {"thickness": ODD}, "thickness = <Unprintable .*>, expected a number"),
    (STAGE, {"override": ODD}, "override = <Unprintable .*>, expected an array"),
]


@pytest.mark.parametrize(("plate", "changes", "said"), HOSTILE)
def test_a_hostile_change_is_refused_in_one_line(plate, changes, said):
    with pytest.raises(flexfem.BadInput, match=said) as refused:
        plate.replace(**changes)
    assert str(refused.value).isprintable()


@pytest.mark.parametrize(
    "function", ["load", "check", "stiffness", "run_study", "report", "new_stage"]
)
def test_an_argument_that_cannot_be_printed_is_refused_in_one_line(function):
    with pytest.raises(flexfem.BadInput, match=r"^(\w+: )?<Unprintable instance at \w+>, expected"):
        getattr(flexfem, function)(ODD)
    with pytest.raises(
        flexfem.BadInput, match=r"^resolution <Unprintable instance at \w+>, expected an integer"
    ):
        flexfem.stiffness(STAGE, resolution=ODD)
