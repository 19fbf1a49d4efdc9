"""Names, units and descriptions of the columns of a study in figures and tables."""

from __future__ import annotations

from collections.abc import Mapping

import flexfem
from flexfem.files.refusals import path_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.setup import kind_of_answer
from flexfem.results import Quantity, thousands
from flexfem.study.columns import LABELS, STRESSES
from flexfem.study.factors import Column
from flexfem.study.loaded import LoadedStudy
from flexfem.study.plan import BAND, Study
from flexfem.study.records import AxisText
from flexfem.units import DIRECTIONS, unit_of, without_unit

WORDS = {"youngs modulus": "Young's modulus", "poissons ratio": "Poisson's ratio"}


def axis_of(loaded: LoadedStudy, name: str) -> AxisText:
    """Return name and unit of a column of a study."""
    study = loaded.study
    for column in loaded.columns:
        if column.name == name:
            return factor(column)
    for derived in study.output:
        if derived.name == name:
            return AxisText(derived.label or name, derived.unit or "")
    if name.endswith(BAND) and name.removesuffix(BAND) in study.ask:
        number = asked(name.removesuffix(BAND), loaded.base)
        return number._replace(name=f"± of {number.name}")
    return asked(name, loaded.base) if name in study.ask else output(name, study)


def output(column: str, study: Study | None = None) -> AxisText:
    """Return the name of an output column, with the known error of a stress by finite elements."""
    below = study.stress_below if study is not None and column in STRESSES else ""
    name = LABELS.get(column, column) + (f" ({below})" if below else "")
    return AxisText(name, unit_of(column).name, column == "life_cycles")


def asked(path: str, mechanism: Mechanism) -> AxisText:
    """Return the meaning and unit of a number of a result about a mechanism at a path such as
    `stiffness.free.analytic.x`.
    """
    quantity, labels = _quantity_at(path, mechanism)
    if len(labels) != len(quantity.over):
        return AxisText(path)
    head, *rest = quantity.meaning.split(", ")
    for axis, label in zip(quantity.over, labels, strict=True):
        if axis == "direction":
            head += f" in {'xyθ'[DIRECTIONS.index(label)]}"
        elif axis != "model":
            rest.append(label if label.startswith(axis) else f"{axis} {label}")
    place = tuple(DIRECTIONS.index(label) if label in DIRECTIONS else 0 for label in labels)
    return AxisText(", ".join([head, *rest]), quantity.unit_at(place).name)


def model_of(path: str, mechanism: Mechanism) -> str:
    """Return the label of the model in the path of a number, "" where the path names none."""
    quantity, labels = _quantity_at(path, mechanism)
    if "model" not in quantity.over or len(labels) != len(quantity.over):
        return ""
    return labels[quantity.over.index("model")]


def _quantity_at(path: str, mechanism: Mechanism) -> tuple[Quantity, list[str]]:
    """Return the quantity of a number of a result at a path, and the labels in the path."""
    question, name, *labels = path.replace("_", " ").split(".")
    kind = kind_of_answer(getattr(flexfem, question), mechanism)
    return kind.quantities[name.replace(" ", "_")], labels


def factor(column: Column) -> AxisText:
    """Return the name of a factor: its label in the study, or its keys in words."""
    units = {unit_of(key).name for key in column.keys}
    name = column.factor.label or " = ".join(words(without_unit(key)) for key in column.keys)
    return AxisText(name, units.pop() if len(units) == 1 else "", column.factor.scale == "log")


def words(key: str) -> str:
    """Return a key path without unit in words: `override.2.elbow.neck` is `neck, chain 2 elbow`."""
    *tables, last = path_of(key)
    leaf = last if isinstance(last, str) else f"{str(tables.pop()).removesuffix('s')} {last + 1}"
    leaf = leaf.replace("_", " ")
    leaf = WORDS.get(leaf, leaf)
    match tables:
        case ["override", chain, *part]:
            return f"{leaf}, chain {chain} {' '.join(map(str, part))}"
        case ["actuator", name]:
            return f"{leaf} of actuator {name}"
        case ["hinges", hinge]:
            return f"{leaf} of {hinge} hinges"
        case ["platform" | "frame" as body]:
            return f"{leaf} of the {body}"
    return leaf


def model_words(loaded: LoadedStudy) -> str:
    """Return a description of the model."""
    study = loaded.study
    base = loaded.base
    analytic = loaded.family.analytic_words
    meshed = f"{study.resolution} triangles across every neck"
    layers = f"{study.layers} layer{'s' * (study.layers > 1)}"
    model = {
        "analytic": f"Analytic model: {analytic}",
        "fe": f"Finite elements: {meshed}",
        "three_dimensional": f"Finite elements in three dimensions: {meshed}, {layers} in half the thickness",  # noqa: E501
        "verify": f"Finite elements ({meshed}) against the analytic model ({analytic})",
        "both": f"Analytic model: {analytic}. Finite elements: {meshed}",
    }[study.model]
    return model if base.model == "plane_stress" else f"{model}, {base.model.replace('_', ' ')}"


def sampling_words(loaded: LoadedStudy) -> str:
    """Return a description of the sampling."""
    sampling = loaded.study.sampling
    if loaded.table is not None:
        return f"table {loaded.table.path.name}"
    seeded = f"{sampling.method.replace('_', ' ').title()}, seed {sampling.seed}"
    return sampling.method if sampling.seed is None else seeded


def counted(counts: Mapping[str, int]) -> str:
    """Return the number of designs by status as text: `9 871 ok, 129 refused`."""
    return ", ".join(f"{thousands(count)} {status}" for status, count in counts.items() if count)


def sentence(text: str) -> str:
    """Return a text with a capital and a full stop."""
    return f"{text[0].upper()}{text[1:]}."
