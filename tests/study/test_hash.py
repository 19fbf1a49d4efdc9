"""Every key of a stage and of a study, found by walking their schemas, is in the hash or stands in
a list here.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import BaseModel

from flexfem.paper.stage import Hinge
from flexfem.paper.stage_file import OF_ACTUATORS, Override
from flexfem.study.loaded import LoadedStudy, load_study, mechanism_of
from flexfem.study.tables import Frequencies, LifeTable

from ..conftest import ROOT
from .conftest import STAGE

Place = tuple[str | int, ...]
OF_HEAT = {
    ("material", "expansion"),
    ("frame", "expansion"),
}  # with a hash of its own, as the drive
NOT_OF_A_STAGE = {
    ("name",),
    ("units",),
    ("material", "name"),
    ("provenance",),
    ("actuator",),
    *OF_HEAT,
}
OF_THE_DRIVE = {("override", 0, name) for name in OF_ACTUATORS}  # of a hinge's override: nothing
NOT_OF_A_FACTOR = {("key",), ("keys",), ("label",)}  # by the column that they make
DRIVEN = ("sd = 1.5\n", "sd = 1.5\n[drive]\nstroke_um = 17.4\nlever_arm_mm = 10\n")
HYPERCUBE = (
    '"monte_carlo"',
    '"latin_hypercube"',
)  # where the number of designs changes the first ones too


def leaves(value: Any, place: Place = ()) -> Iterator[Place]:
    """Places of all values of a model: fields of its tables, and of tables in arrays, and entries
    of arrays.
    """
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from leaves(getattr(value, name), (*place, name))
    elif isinstance(value, tuple) and value and not isinstance(value[0], str):
        for index, item in enumerate(value):
            yield from leaves(item, (*place, index))
    else:
        yield place


def other(value: Any) -> Any:
    """Another value of the same type; text where there was none."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    return f"{value} changed"


def changed(value: Any, place: Place) -> Any:
    """A copy that differs at one place."""
    if not place:
        return other(value)
    head, *rest = place
    if isinstance(head, int):
        return tuple(
            changed(item, tuple(rest)) if index == head else item
            for index, item in enumerate(value)
        )
    values = {name: getattr(value, name) for name in type(value).model_fields}
    values[head] = changed(values[head], tuple(rest))
    if getattr(value, head) is None and isinstance(value, Hinge | Override):
        values[head] = True if head == "prismatic" else 1.0
    # what no file can say counts as well: nothing is validated here
    return BaseModel.model_construct.__func__(
        type(value), value.model_fields_set | {head}, **values
    )  # type: ignore[attr-defined]


def unseen(value: Any, hash_of: Any, places: set[Place]) -> set[Place]:
    """Which places leave the hash as it is."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # values of the wrong type, such as text for a number
        return {place for place in places if hash_of(changed(value, place)) == hash_of(value)}


def test_every_key_of_a_study_changes_its_hash_but_those_that_answers_do_not_depend_on(
    studies: Any,
) -> None:
    loaded: LoadedStudy = studies.load(DRIVEN, HYPERCUBE)
    asked = {"life": LifeTable(amplitude_x_um=3.0), "frequencies": Frequencies(payload_kg=0.1)}
    loaded = replace(loaded, study=loaded.study.model_copy(update=asked))
    apart = {
        "factor",
        "output",
        "constraint",
    }  # what is not empty of the latter two: test_conditions
    places = {place for place in leaves(loaded.study) if place[0] not in apart}
    assert {
        ("mobility",),
        ("links",),
        ("sampling", "designs"),
        ("life", "ratio"),
        ("drive", "stroke_um"),
    } < places
    found = unseen(loaded.study, lambda study: replace(loaded, study=study).hash, places)
    assert found == {
        ("name",),
        ("mechanism",),
        ("figure",),
        ("provenance",),
        ("time_limit",),
        ("check",),
    }
    assert (
        replace(loaded, study=loaded.study.model_copy(update={"check": "drawing"})).hash
        != loaded.hash
    )
    assert replace(loaded, path=loaded.path / "elsewhere", stem="another").hash == loaded.hash


def test_every_key_of_a_factor_and_its_column_changes_the_hash(studies: Any) -> None:
    loaded: LoadedStudy = studies.load()

    def hash_with(index: int, **changes: Any) -> str:
        columns = (
            one._replace(**changes) if place == index else one
            for place, one in enumerate(loaded.columns)
        )
        return replace(loaded, columns=tuple(columns)).hash

    for index, column in enumerate(loaded.columns):
        found = unseen(
            column.factor,
            lambda factor, at=index: hash_with(at, factor=factor),
            {*leaves(column.factor)},
        )
        assert found == NOT_OF_A_FACTOR
        assert loaded.hash not in (
            hash_with(index, name="another"),
            hash_with(index, keys=("thickness_mm",)),
        )
    assert replace(loaded, columns=loaded.columns[::-1]).hash != loaded.hash


def test_every_key_of_the_stage_counts_in_the_hash_of_its_study(studies: Any) -> None:
    loaded: LoadedStudy = studies.load()
    places = set(leaves(loaded.base)) - OF_THE_DRIVE - {("override", 0, "hinge")}
    found = unseen(loaded.base, lambda stage: replace(loaded, base=stage).hash, places)
    assert found == NOT_OF_A_STAGE
    own = Override.model_validate(
        {"chain": 3, "hinge": "base", "neck_mm": 0.53}
    )  # that of its like, but it
    repeated = loaded.base.model_copy(
        update={"override": (*loaded.base.override, own)}
    )  # follows no factor
    assert repeated.hash == loaded.base.hash and replace(loaded, base=repeated).hash != loaded.hash


def test_a_number_of_the_stage_counts_where_a_constraint_refuses_by_it(studies: Any) -> None:
    (studies.folder / "stage.toml").write_text(
        STAGE.replace("[material]", "[material]\nexpansion_um_per_m_k = 23.1")
    )
    limit = "sd = 1.5\n[[constraint]]\nvalue = 'E * material.expansion_um_per_m_k'\nmost = 9\n"
    loaded = studies.load(("sd = 1.5\n", limit))
    other = loaded.base.replace(material={"expansion": 1e-5})
    assert other.hash == loaded.base.hash and replace(loaded, base=other).hash != loaded.hash


def test_the_drive_counts_where_a_study_asks_about_it(studies: Any) -> None:
    driven = studies.load(DRIVEN)
    pair = {
        "name": "base",
        "between": ("frame", "link 1"),
        "hinge": "base",
        "arm": 10.0,
        "side": "left",
        "pair": True,
    }
    first = driven.base.replace(
        actuator=[pair | {"stroke": 0.0174, "stiffness": 5e4, "preload": 40.0}]
    )
    stages = [first, first.replace(actuator=[first.actuator[0].model_copy(update={"arm": 10.5})])]
    stages += [
        first.replace(override={(2, "actuator", "base"): {"preload": force}})
        for force in (41.0, 42.0)
    ]
    asked = driven.study.model_copy(
        update={"drive": driven.study.drive.model_copy(update={"actuators": True})}
    )
    assert len({replace(driven, study=asked, base=stage).hash for stage in stages}) == len(stages)
    assert {replace(driven, base=stage).hash for stage in stages} == {driven.hash}
    renamed = first.replace(actuator=[first.actuator[0].model_copy(update={"name": "other"})])
    assert (
        replace(driven, study=asked, base=renamed).hash
        == replace(driven, study=asked, base=first).hash
    )


def test_the_expressions_of_a_mechanism_count(tmp_path: Any) -> None:
    """Widths that are 10 mm at a gap of 5 mm; some differ at another gap."""
    mechanism = (ROOT / "geometry/parallelogram.toml").read_text()
    factor = 'key = "parameters.gap_mm"\nvalues = [6.0]'
    head = 'name = "s"\nstage = "m.toml"\nmodel = "analytic"\nask = ["stiffness.free.analytic.x"]\n'
    (tmp_path / "s.toml").write_text(f'{head}[sampling]\nmethod = "grid"\n[[factor]]\n{factor}\n')
    hashes = set[str]()
    bases = set[str]()
    for other, width, at_6 in (
        (5, "2 * gap", 12.0),
        (5, "gap + 5", 11.0),
        (5, "gap + x", 11.0),
        (10, "5 + x/2", 10.0),
    ):
        text = mechanism.replace("[parameters]", f"[parameters]\ngap_mm = 5\nx_mm = {other}")
        (tmp_path / "m.toml").write_text(
            text.replace('width_mm = "width"', f'width_mm = "{width}"')
        )
        loaded = load_study(tmp_path / "s.toml")
        assert mechanism_of(loaded, np.array([6.0])).body[1].width == at_6  # type: ignore[union-attr]
        hashes.add(loaded.hash)
        bases.add(loaded.base.hash)
    assert len(bases) == 1 and len(hashes) == 4
