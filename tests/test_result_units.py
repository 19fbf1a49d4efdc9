"""A number of a result has one unit wherever it is read: attribute, `at`, JSON, data frame, table,
study column.
"""

from __future__ import annotations

import importlib
import json
import math
import pkgutil
import re

import numpy as np
import pytest

import flexfem as api
from flexfem import paper, questions
from flexfem.baselines import _compared, _moved, _stored
from flexfem.mechanism.layout import Payload
from flexfem.paper.model import CALIBRATED, analyse
from flexfem.paper.responses import dynamics
from flexfem.questions.plates import network
from flexfem.results import AXES, About, Number, Result
from flexfem.schemas.formats import results
from flexfem.study.answer import answer
from flexfem.study.loaded import load_study
from flexfem.units import Unit

from .conftest import ROOT, UNLIKE, with_changes
from .tolerances import DENSE, SUMS

MOST = 60  # numbers of a quantity that are compared, at random places
PRINTED = 1e-4  # a table shows five significant digits of a number without a band
KINDS = results()
SIZES = {  # numbers of N, mm, MPa, rad, tonne and s are multiplied by these
    "Hz": 0.5 / math.pi,
    "um": 1e3,
    "mrad": 1e3,
    "um^2 mrad": 1e9,
    "kg": 1e3,
    "kg mm^2": 1e3,
    "MPa/um": 1e-3,
    "MPa/mrad": 1e-3,
    "N/um": 1e-3,
}
UNCHANGED = {
    "",
    "%",
    "mm",
    "rad",
    "N",
    "N mm",
    "MPa",
    "N/mm",
    "N mm/rad",
    "mm/N",
    "rad/(N mm)",
    "1/N",
    "mm/rad",
    "rad/mm",
}
PREFIXES = {
    "m": {"nm": 1e-6, "um": 1e-3, "mm": 1.0, "m": 1e3},
    "rad": {"nrad": 1e-9, "urad": 1e-6, "mrad": 1e-3},
}


def made(kind: type[Result]) -> tuple[Result, dict[str, np.ndarray], dict[str, np.ndarray]]:
    """A result of a kind with unlike numbers, and these numbers and bands in units of the code."""
    random = np.random.default_rng(11)
    over = {axis for quantity in kind.quantities.values() for axis in quantity.over}
    axes = {
        axis: tuple(f"{axis} {k}" for k in "abc")
        for axis in over
        if axis not in {**AXES, **kind.labels}
    }
    sizes = {axis: len(labels) for axis, labels in {**AXES, **kind.labels, **axes}.items()}
    shapes = {
        name: [sizes[axis] for axis in quantity.over] for name, quantity in kind.quantities.items()
    }
    values, bands = (
        {name: random.uniform(0.2, 0.9, shape) for name, shape in shapes.items()} for _ in range(2)
    )
    return kind(About("any"), values, bands, axes), values, bands


def size_of(unit: str) -> float:
    assert unit in SIZES or unit in UNCHANGED, unit
    return SIZES.get(unit, 1.0)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_every_place_has_the_number_in_the_unit_that_is_stated(kind, tmp_path):
    found, values, bands = made(kind)
    random = np.random.default_rng(5)
    document = {
        name: [np.array(one[part]) for part in ("values", "bands")]
        for name, one in found.to_dict()["quantities"].items()
    }
    again = type(found).read(found.write(tmp_path / "stored.json"))
    paths = {each.path: each for each in found.entries()}
    frame = {row.path: row for row in found.to_frame(long=True).itertuples()}
    for name, quantity in kind.quantities.items():
        places = (
            random.permutation(list(np.ndindex(values[name].shape)))[:MOST]
            if quantity.over
            else [()]
        )
        for place in map(tuple, places):
            labels = [found.axes[axis][k] for axis, k in zip(quantity.over, place, strict=True)]
            at = dict(zip(quantity.over, labels, strict=True))
            unit = found.unit(name, **at)
            value = values[name][place] * size_of(unit)
            band = bands[name][place] * size_of(unit)
            path = ".".join([name, *labels]).replace(" ", "_")
            stored, width = (each[place] for each in document[name])
            for number in (
                getattr(found, name)[place],
                found.values[name][place],
                found.at(name, **at),
                stored,
                paths[path].value,
                frame[path].value,
                getattr(again, name)[place],
            ):
                assert number == pytest.approx(value, rel=SUMS), (name, at, unit)
            for number in (
                found.bands[name][place],
                found.band(name, **at),
                width,
                paths[path].band,
                frame[path].band,
                again.band(name, **at),
            ):
                assert number == pytest.approx(band, rel=SUMS), (name, at, unit)
            assert frame[path].unit == paths[path].unit.plain == unit


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_a_table_prints_the_number_of_the_attribute_in_its_unit_or_with_a_prefix(kind):
    found, values, _ = made(kind)
    alone = kind(
        found.about, values, axes=found.axes
    )  # without bands, which would leave fewer digits
    for name, quantity in kind.quantities.items():
        along = [
            axis
            for axis in quantity.over
            if axis not in kind.columns and axis not in quantity.largest
        ]
        at = {axis: found.axes[axis][0] for axis in along}
        one, *_ = alone.texts(name, **at)
        shown = np.ravel(alone.at(name, **at))
        text = (
            re.sub(r" \([a-z].*$", "", one) if quantity.largest else one
        )  # without the place of the largest
        text = text.replace("µ", "u").replace("²", "^2").replace("³", "^3")
        number, _, unit = text.partition(" ")
        declared = np.ravel(alone.unit(name, **at))[0]
        size = 1.0
        if quantity.largest == ("limit",) and not declared:
            assert text in found.axes["limit"]  # which limit governs; the number is always 1
            continue
        if quantity.prefixed:
            size = PREFIXES["rad" if declared.endswith("rad") else "m"][unit]
        else:
            assert unit == declared
        assert np.min(np.abs(float(number) * size / shown - 1)) < PRINTED, (name, text)


def test_units_are_those_that_an_engineer_expects():
    expected = {
        "natural_modes.frequency": "Hz",
        "natural_modes.mass": "kg",
        "drive.stroke": "um",
        "drive.rotation": "mrad",
        "stiffness.stress": ["MPa/um", "MPa/um", "MPa/mrad"],
        "stiffness.held": ["N/mm", "N/mm", "N mm/rad"],
        "stiffness.compliance": [["mm/N", "mm/N", "1/N"]] * 2 + [["1/N", "1/N", "rad/(N mm)"]],
        "stiffness.energy": "N mm",
        "stiffness.yield_range": ["mm", "mm", "rad"],
        "as_built.necks": "um",
        "mechanism_stiffness.input_stiffness": "N/um",
        "mechanism_stiffness.amplification": ["", "", "rad/mm"],
        "reach.volume": "um^2 mrad",
        "identification.offset": "um",
        "large.stiffness": "%",
        "drive.change": "%",
        "gravity.sag": ["mm", "rad", "rad"],
        "life.peak": "MPa",
    }
    units = {path: made(KINDS[path.split(".")[0]])[0].unit(path.split(".")[1]) for path in expected}
    assert units == expected
    (stiffness, *_) = made(KINDS["stiffness"])
    assert stiffness.unit("stress", direction="theta") == "MPa/mrad"
    assert stiffness.unit("stiffness", component="theta") == ["N", "N", "N mm/rad"]
    assert stiffness.unit("stiffness", component="x", direction="theta") == "N"
    with pytest.raises(api.BadInput, match="direction 'z', expected one of: x, y, theta"):
        stiffness.unit("stress", direction="z")


# the numbers themselves, by routes that do not pass through a result


@pytest.fixture(scope="module")
def stage():
    return with_changes({"override": UNLIKE})


@pytest.fixture(scope="module")
def amplifier():
    return api.load(ROOT / "geometry/bridge-amplifier.toml")


def test_stress_is_that_of_a_micrometre_and_of_a_milliradian(stage):
    found = api.stiffness(stage, models="analytic", analytic=api.Analytic(21, CALIBRATED, True))
    model = api.analyse(stage, 21, CALIBRATED, True)
    expected = model.neck_stress(np.diag([1e-3, 1e-3, 1e-3]))  # MPa, at 1 um, 1 um and 1 mrad
    np.testing.assert_allclose(found.stress[0], np.moveaxis(expected, 0, -1), rtol=DENSE)


def test_a_frequency_is_in_hertz_and_a_mass_in_kilograms(stage):
    found = api.modes(stage, models="analytic", count=3)
    natural = dynamics(stage, analyse(stage, 21, CALIBRATED, True), Payload()).frequencies[
        :3
    ]  # rad/s
    elastic = found.at("frequency", model="calibrated, elastic links, plane stress")
    np.testing.assert_allclose(elastic, natural / (2 * math.pi), rtol=DENSE)
    assert found.unit("frequency") == "Hz" and 0.05 < found.mass < 0.2  # kg


def test_stiffness_of_an_input_is_in_newtons_per_micrometre(amplifier):
    found = api.stiffness(amplifier, models="analytic", force=(3.0, -1.0, 20.0))
    opening = network(amplifier).compliance[-1, -1]  # mm/N
    assert found.input_stiffness[0, 0] == pytest.approx(1e-3 / opening, rel=DENSE)
    assert found.energy[0] == pytest.approx(np.dot(found.force[0], found.pose[0, 0]) / 2, rel=DENSE)


PATHS = (
    "stiffness.stress.analytic.{hinge}.y",
    "stiffness.input_stiffness.{drive}.analytic",
    "stiffness.held.analytic.y",
    "stiffness.free.analytic.y",
    "stiffness.yield_range.analytic.theta",
    "modes.frequency.2.analytic",
    "drift.pose.uniform.output.analytic.y",
    "drive.motion.{drive}.output.analytic.y",
    "summary.frequency.analytic",
)


def test_a_study_column_has_the_number_of_the_attribute_and_of_the_command(
    amplifier, tmp_path, flexfem
):
    (tmp_path / "m.toml").write_bytes((ROOT / "geometry/bridge-amplifier.toml").read_bytes())
    names = {"hinge": amplifier.layout.joints[0].name, "drive": amplifier.layout.actuators[0].name}
    asked = [path.format(**names).replace(" ", "_") for path in PATHS]
    lines = [
        'name = "s"',
        'stage = "m.toml"',
        'model = "analytic"',
        f"ask = {json.dumps(asked)}",
        "[sampling]",
    ]
    lines += ['method = "grid"', "[[factor]]", 'key = "parameters.neck_mm"', "values = [0.47]"]
    (tmp_path / "s.toml").write_text("\n".join(lines))
    columns = dict(
        zip(asked, answer(load_study(tmp_path / "s.toml"), 0, 1).values[0], strict=False)
    )
    results = {}
    printed = {}
    thick = amplifier.replace(parameters={"neck_mm": 0.47})
    thick.save(tmp_path / "thick.toml")
    for path in asked:
        question, quantity, *labels = path.split(".")
        if question not in results:
            results[question] = getattr(api, question)(thick, models="analytic")
            code, out, _ = flexfem(
                question, tmp_path / "thick.toml", "--models", "analytic", "--json"
            )
            assert code == 0
            printed[question] = json.loads(out)
        found = results[question]
        said = printed[question]
        known = [
            [label.replace(" ", "_") for label in found.axes[axis]]
            for axis in found.quantities[quantity].over
        ]
        place = tuple(each.index(label) for each, label in zip(known, labels, strict=True))
        value = getattr(found, quantity)[place]
        assert columns[path] == pytest.approx(value, rel=DENSE), path
        assert np.array(said["quantities"][quantity]["values"])[place] == pytest.approx(
            value, rel=DENSE
        ), path


# held and free


def test_the_document_of_stiffness_has_the_full_matrices_and_names_held_and_free(stage, amplifier):
    of_both = (amplifier, "mechanism_stiffness", "analytic"), (stage, "stiffness", "elements")
    for plate, question, models in of_both:
        found = api.stiffness(plate, models=models, resolution=None if models == "analytic" else 4)
        kept = found.to_dict()["quantities"]
        assert (
            kept["held"]["meaning"] == "stiffness, other directions held"
            and found.kind() == question
        )
        assert kept["free"]["meaning"] == "stiffness, other directions free"
        K, C = (np.array(kept[name]["values"]) for name in ("stiffness", "compliance"))
        assert K.shape == C.shape == (len(found.axes["model"]), 3, 3)
        np.testing.assert_allclose(K @ C, np.broadcast_to(np.eye(3), K.shape), atol=DENSE)
        np.testing.assert_array_equal(kept["held"]["values"], np.diagonal(K, axis1=1, axis2=2))
        np.testing.assert_allclose(
            kept["free"]["values"], 1 / np.diagonal(C, axis1=1, axis2=2), rtol=DENSE
        )
        assert np.all(found.held >= found.free * (1 - DENSE)) and np.any(
            found.held > 1.01 * found.free
        )
    width = found.band("held")[0]
    np.testing.assert_allclose(width, np.diagonal(found.band("stiffness")[0]), rtol=DENSE)
    assert np.all(width > 0)
    table = found.to_markdown()
    assert "other directions held: K_ii" in table and "other directions free: 1 / C_ii" in table


# what is said, and what is kept


def test_every_question_says_the_convention_and_names_its_result():
    said = set()
    rooms = [
        (room, each.name)
        for room in (questions, paper)
        for each in pkgutil.iter_modules(room.__path__)
    ]
    for room, module in rooms:
        of = importlib.import_module(f"{room.__name__}.{module}")
        for name, function in vars(of).items():
            returned = str(getattr(function, "__annotations__", {}).get("return", "")).split(" | ")[
                0
            ]
            kind = getattr(of, returned.removeprefix("list[").removesuffix("]") or "none", None)
            if (
                hasattr(function, "__wrapped__")
                and isinstance(kind, type)
                and issubclass(kind, Result)
            ):
                text = " ".join((function.__doc__ or "").split())
                assert "Every number has the unit that its quantity declares" in text, name
                listed = "KIND" if kind is Result else kind.kind()
                assert f"`flexfem schema {listed}`" in text, name
                said.add(name)
    public = {
        "stiffness",
        "summary",
        "drive",
        "reach",
        "large",
        "modes",
        "drift",
        "gravity",
        "life",
        "experiment",
        "identify",
        "as_built",
        "budget",
        "converge",
        "verification",
    }
    assert public <= said


def test_regression_compares_a_number_once_and_in_the_units_of_the_code(amplifier):
    numbers = _compared(api.stiffness(amplifier, models="analytic"))
    assert "free.analytic.x" in numbers and "stiffness.analytic.x.x" in numbers
    assert not [path for path in numbers if path.startswith("held.")]
    hertz = Number("frequency.1", 100.0, 0.5, Unit(0.5 / math.pi, "Hz"), 1e-3, 0.1)
    assert _stored(hertz) == pytest.approx([200 * math.pi, math.pi], rel=SUMS)
    (line,) = _moved(
        "m", {"modes": {"frequency.1": [628.0, 3.1]}}, {"modes": {"frequency.1": hertz}}
    )
    assert re.search(r"was 99\.94\d*, is 100 Hz, moved \+0\.05\d*, accepted 0\.001$", line)
