"""What columns of a study are called, the axes that show them, and what is written above every figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from flexfem.arrays import Array
from flexfem.files.keypath import path_of
from flexfem.plot.text import SPACE, significant
from flexfem.study.columns import Column
from flexfem.study.outputs import STRESSES
from flexfem.study.tables import Method
from flexfem.units import unit_of, without_unit

if TYPE_CHECKING:
    from flexfem.study.collect import StudyTable
    from flexfem.study.loaded import LoadedStudy
    from flexfem.study.plan import Study

OUTPUTS: dict[str, tuple[str, str]] = {  # name, symbol for an axis
    "kxx_n_per_mm": ("stiffness XX", r"stiffness $K_{xx}$"),
    "kyy_n_per_mm": ("stiffness YY", r"stiffness $K_{yy}$"),
    "ktt_n_mm_per_rad": ("stiffness θθ", r"stiffness $K_{\theta\theta}$"),
    "kxy_n_per_mm": ("stiffness XY", r"stiffness $K_{xy}$"),
    "kxt_n": ("stiffness Xθ", r"stiffness $K_{x\theta}$"),
    "kyt_n": ("stiffness Yθ", r"stiffness $K_{y\theta}$"),
    "coupling_xy": ("coupling XY", r"coupling $K_{xy}/\sqrt{K_{xx}K_{yy}}$"),
    "coupling_xt": ("coupling Xθ", r"coupling $K_{x\theta}/\sqrt{K_{xx}K_{\theta\theta}}$"),
    "coupling_yt": ("coupling Yθ", r"coupling $K_{y\theta}/\sqrt{K_{yy}K_{\theta\theta}}$"),
    "stress_x_mpa_per_um": ("peak neck stress per X", ""),
    "stress_y_mpa_per_um": ("peak neck stress per Y", ""),
    "stress_theta_mpa_per_mrad": ("peak neck stress per θ", ""),
    "range_x_um": ("range in X at yield", ""),
    "range_y_um": ("range in Y at yield", ""),
    "range_theta_mrad": ("range in θ at yield", ""),
    "envelope_mm": ("diameter of the envelope", ""),
    "travel_x_um": ("travel in X, base hinges", ""),
    "travel_y_um": ("travel in Y, base hinges", ""),
    "travel_theta_mrad": ("travel in θ, base hinges", ""),
    "drive_range_x_um": ("range of the drive in X", ""),
    "drive_range_y_um": ("range of the drive in Y", ""),
    "drive_range_theta_mrad": ("range of the drive in θ", ""),
    "engaged_kxx_n_per_mm": ("engaged stiffness XX", ""),
    "engaged_kyy_n_per_mm": ("engaged stiffness YY", ""),
    "engaged_ktt_n_mm_per_rad": ("engaged stiffness θθ", ""),
    "frequency_1_hz": ("natural frequency 1", ""),
    "frequency_2_hz": ("natural frequency 2", ""),
    "frequency_3_hz": ("natural frequency 3", ""),
    "drift_x_um_per_k": ("drift in X per kelvin", ""),
    "drift_y_um_per_k": ("drift in Y per kelvin", ""),
    "drift_theta_urad_per_k": ("drift in θ per kelvin", ""),
    "drift_gradient_um_per_k_per_mm": ("largest drift by a gradient", ""),
    "drift_gradient_theta_urad_per_k_per_mm": ("largest drift in θ by a gradient", ""),
    "life_cycles": ("cycles at the amplitude", ""),
    "life_amplitude_x_um": ("amplitude in X for the wanted life", ""),
    "life_amplitude_y_um": ("amplitude in Y for the wanted life", ""),
    "life_amplitude_theta_mrad": ("amplitude in θ for the wanted life", ""),
    "safety_factor": ("yield strength over neck stress", ""),
    "error_x_percent": ("error along X", ""),
    "error_y_percent": ("error along Y", ""),
    "error_theta_percent": ("error along θ", ""),
    "cross_x_percent": ("largest cross error under X", ""),
    "cross_y_percent": ("largest cross error under Y", ""),
    "cross_theta_percent": ("largest cross error under θ", ""),
    "band_x_percent": ("mesh band of the error along X", ""),
    "band_y_percent": ("mesh band of the error along Y", ""),
    "band_theta_percent": ("mesh band of the error along θ", ""),
}
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
    name, symbol = OUTPUTS[column]
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
