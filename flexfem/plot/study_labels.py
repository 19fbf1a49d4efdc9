"""What columns of a study are called, the axes that show them, and what is written above every figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from flexfem.arrays import Array
from flexfem.files.refusals import path_of
from flexfem.plot.text import SPACE, significant
from flexfem.study.columns import LABELS, STRESSES
from flexfem.study.factors import Column
from flexfem.study.plan import Method
from flexfem.units import unit_of, without_unit

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy
    from flexfem.study.plan import Study

METHODS: dict[Method, str] = {
    "grid": "grid",
    "latin_hypercube": "Latin hypercube",
    "sobol": "Sobol",
    "monte_carlo": "Monte Carlo",
    "saltelli": "Saltelli",
    "table": "a table of designs",
}
WORDS = {"youngs modulus": "Young's modulus", "poissons ratio": "Poisson's ratio"}


class Quantity(NamedTuple):
    """What an axis shows: its name, its unit or nothing, the name with a symbol in it, whether it is logarithmic."""

    name: str
    unit: str = ""
    symbol: str = ""
    log: bool = False

    @property
    def label(self) -> str:
        """Name, with its symbol, and unit; mathematics where there is a symbol."""
        name = self.symbol or self.name
        return f"{name} in {self.unit}" if self.unit else name

    @property
    def after(self) -> str:
        """The unit as it follows a number, with a space that does not break."""
        return SPACE + self.unit.replace(" ", SPACE) if self.unit else ""


class Caption(NamedTuple):
    """What stands above a figure: its title, lines on how the numbers came about, the key paths in doubt."""

    title: str
    lines: Sequence[str]
    assumed: Sequence[str]
    not_stated: Sequence[str] = ()


def output(column: str, study: Study | None = None) -> Quantity:
    """What an output column of a study is called, with the known error of a stress by finite elements."""
    name, symbol = LABELS.get(column, (column, ""))
    if column in STRESSES and study is not None and study.stress_below:
        name = f"{name} ({study.stress_below})"
    return Quantity(name, unit_of(column).name, symbol, column == "life_cycles")


def factor(column: Column) -> Quantity:
    """What a factor is called: by the label the study gives it, else in words by the keys it sets."""
    units = {unit_of(key).name for key in column.keys}
    name = column.factor.label or " = ".join(words(without_unit(key)) for key in column.keys)
    return Quantity(name, units.pop() if len(units) == 1 else "", log=column.factor.scale == "log")


def words(key: str) -> str:
    """A key path, without its unit, in words: `override.2.elbow.neck` is `neck, chain 2 elbow`."""
    *tables, last = path_of(key)
    leaf = str(last) if isinstance(last, str) else f"{str(tables.pop()).removesuffix('s')} {last + 1}"
    leaf = WORDS.get(leaf := leaf.replace("_", " "), leaf)
    match tables:
        case ["override", chain, "actuator", name]:
            return f"{leaf}, chain {chain} actuator {name}"
        case ["actuator", name]:
            return f"{leaf} of actuator {name}"
        case ["override", chain, hinge]:
            return f"{leaf}, chain {chain} {hinge}"
        case ["hinges", hinge]:
            return f"{leaf} of {hinge} hinges"
        case ["platform" | "frame" as body]:
            return f"{leaf} of the {body}"
    return leaf


def caption_of(loaded: LoadedStudy, table: StudyTable, title: str, lines: Sequence[str]) -> Caption:
    """Title, study, model, sampling and how many designs have an answer, then the lines of the figure."""
    study = loaded.study
    method, seed = METHODS[study.sampling.method], study.sampling.seed
    drawn = method if seed is None else f"{method}, seed {seed}"
    if loaded.given is not None:
        drawn = f"table {loaded.given.path.name}"
    about = f"Study: {study.name}. Base stage: {loaded.stage.name}."
    found = (
        f"{model_words(loaded)}. {thousands(loaded.count)} designs ({drawn}): {counted(table.counts, loaded.count)}."
    )
    return Caption(title, [about, found, *lines], loaded.assumed, loaded.not_stated)


def model_words(loaded: LoadedStudy) -> str:
    """What answered, in words."""
    study = loaded.study
    mobility = study.mobility or loaded.stage.mobility
    analytic = f"{study.formula}, mobility {mobility}" + (", elastic links" if study.links else "")
    meshed = f"{study.resolution} triangles across every neck"
    layers = f"{study.layers} layer{'s' * (study.layers > 1)}"
    plane = "" if loaded.stage.model == "plane_stress" else f", {loaded.stage.model.replace('_', ' ')}"
    return {
        "analytic": f"Analytic model: {analytic}{plane}",
        "fe": f"Finite elements: {meshed}{plane}",
        "three_dimensional": f"Finite elements in three dimensions: {meshed}, {layers} in half the thickness",
        "verify": f"Finite elements ({meshed}) against the analytic model ({analytic}){plane}",
    }[study.model]


def counted(counts: Mapping[str, int], wanted: int = 0) -> str:
    """How many designs have which status, and how many of those wanted are still open: `9 871 ok, 129 refused`."""
    found = dict(counts)
    missing = wanted - sum(found.values())
    if missing > 0:
        found["open"] = missing
    return ", ".join(f"{thousands(count)} {status}" for status, count in found.items())


def thousands(count: int) -> str:
    """A count with its thousands apart."""
    return f"{count:,}".replace(",", SPACE)


FEW_DECADES = 2.5  # up to which 2 and 5 have ticks between the powers of ten


def name_axis(axes: Axes, which: Literal["x", "y"], quantity: Quantity, ends: tuple[float, float]) -> None:
    """Scale, label and ticks of an axis that goes from one end to the other."""
    if quantity.log:
        axes.set(**{f"{which}scale": "log"})
    axes.set(**{f"{which}lim": ends})
    axis: Axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_label_text(quantity.label, parse_math=bool(quantity.symbol))
    if quantity.log:
        log_ticks(axis, ends)


def log_ticks(axis: Axis, ends: tuple[float, float]) -> None:
    """Ticks at powers of ten, and at multiples of them where there are few, written as plain numbers."""
    decades = float(np.log10(ends[1] / ends[0]))
    subs = range(1, 10) if decades < 1.0 else (1.0, 2.0, 5.0) if decades < FEW_DECADES else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: significant(value, 1)))
    axis.set_minor_locator(LogLocator(subs=range(2, 10)) if decades < 2 * FEW_DECADES else NullLocator())
    axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))


def ends_of(values: Array, log: bool, room: float = 0.04) -> tuple[float, float]:
    """Where an axis begins and ends that shows finite values with some room on both sides."""
    places = np.log(values) if log else values
    low, high = float(places.min()), float(places.max())
    margin = room * (high - low) or 0.05 * (abs(high) or 1.0)
    ends = (low - margin, high + margin)
    return (float(np.exp(ends[0])), float(np.exp(ends[1]))) if log else ends
