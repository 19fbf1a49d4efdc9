"""Rules between the tables of a study file, in JSON schema and as the reader of the file checks them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import get_args

import numpy as np

from flexfem.files.json_schema import Rule, both, has, only, says, when, without
from flexfem.files.keypath import key_path
from flexfem.files.refusals import refusal, shown, suggestion
from flexfem.mechanism.keys import keys
from flexfem.questions.case import LINKS
from flexfem.study.columns import NAMED, WAYS, Factor, columns_of
from flexfem.study.outputs import FEASIBLE, RESERVED
from flexfem.study.tables import Correlation, Figure, Method, normal_correlation

UNCORRELATED: dict[Method, str] = {
    "saltelli": "Sobol indices split the variance among independent factors",
    "grid": "a grid holds all pairs of values alike",
    "table": "its rows are taken as they are",
}
SINGULAR = 1e-9  # least eigenvalue of a correlation matrix, as of round-off
APPLIES = {  # keys that not every model takes
    "formula": ("analytic", "verify"),
    "mobility": ("analytic", "verify"),
    "links": ("analytic",),
    "resolution": ("fe", "verify", "three_dimensional"),
    "layers": ("three_dimensional",),
    "time_limit_s": ("fe", "verify", "three_dimensional"),
    "bands": ("verify",),
    "frequencies": ("analytic", "fe", "verify"),  # in the plane
    "life": ("analytic", "fe", "verify"),
    "drift": ("analytic", "fe", "verify"),
}
_GIVEN = {"not": only(*NAMED)}  # of a factor that says its values


def rules() -> Iterator[Rule]:
    """Between keys of a study, in JSON schema."""
    every: set[str] = {"analytic", "fe", "verify", "three_dimensional"}
    for key, models in APPLIES.items():
        yield when(says("model", *sorted(every - {*models})), without(key))
    yield LINKS
    yield when(says("check", "closed_form"), says("model", "analytic"))
    driven = {"properties": {"drive": says("actuators", True)}, "required": ["drive"]}
    yield when(driven, says("model", *sorted(every - {"three_dimensional"})))
    of_grid = both(without("distribution"), when(has("from"), has("points")), _GIVEN)
    others = {"grid": of_grid, "table": only(*NAMED)}
    for method in get_args(Method):
        of_factor = others.get(method, both(without("points"), _GIVEN))
        correlated = without("correlation") if method in UNCORRELATED else {}
        sampled = {"properties": {"sampling": says("method", method)}, "required": ["sampling"]}
        yield when(sampled, both({"properties": {"factor": {"items": of_factor}}}, correlated))


def require_sampled(factors: Sequence[Factor], method: Method) -> None:
    """Refuse factors whose values are not such as the method draws."""
    grid, table = method == "grid", method == "table"
    for index, factor in enumerate(factors):
        if table != (factor.kind == "given"):
            raise refusal(f'{"no values" if table else WAYS} with method = "{method}"', "factor", index)
        if grid and factor.distribution is not None:
            raise refusal('values or a range with method = "grid"', "factor", index, "distribution")
        if grid and factor.kind == "range" and factor.points is None:
            raise refusal('points with method = "grid"', "factor", index)
        if not grid and factor.points is not None:
            raise refusal('no points but with method = "grid"', "factor", index, "points")


def require_unlike(factors: Sequence[Factor], outputs: Iterable[str]) -> None:
    """Refuse two columns of one name, and a key that two factors set."""
    names, set_by = {*RESERVED, FEASIBLE, *outputs}, dict[str, int]()
    for index, factor in enumerate(factors):
        for column in columns_of([factor]):
            if column.name in names or (column.name in keys() and column.name not in column.keys):
                raise refusal(f"a column name of its own, not {shown(column.name)} again", "factor", index)
            names.add(column.name)
        for path in factor.paths:
            first = set_by.setdefault(path, index)
            if first != index:
                raise refusal(f"each key set once, and {key_path(('factor', first))} sets {path}", "factor", index)


def require_correlated(correlations: tuple[Correlation, ...], factors: Sequence[Factor], method: Method) -> None:
    """Refuse correlations of what is no factor that is drawn, and those that no factors can have."""
    columns = {column.name: column.factor for column in columns_of(factors)}
    pairs = set[frozenset[str]]()
    if correlations and method in UNCORRELATED:
        raise refusal(f'none with method = "{method}": {UNCORRELATED[method]}', "correlation")
    for index, each in enumerate(correlations):
        for place, name in enumerate(each.factors):
            if name not in columns:
                raise refusal(
                    f"a factor by its column{suggestion(name, columns)}", "correlation", index, "factors", place
                )
            if columns[name].kind == "values":
                raise refusal(
                    "a range or distribution: ranks of a list have ties", "correlation", index, "factors", place
                )
        if frozenset(each.factors) in pairs:
            raise refusal("each pair once", "correlation", index, "factors")
        pairs.add(frozenset(each.factors))
    least = float(np.linalg.eigvalsh(normal_correlation(list(columns), correlations)).min())
    if least < SINGULAR:
        raise refusal("coefficients that go together: no factors can be correlated like this", "correlation")


def require_shown(figures: Sequence[Figure], factors: Sequence[Factor], outputs: Sequence[str], method: Method) -> None:
    """Refuse figures of columns that there are not, and those that a method does not give; outputs : with derived."""
    columns = [column.name for column in columns_of(factors)]
    for index, figure in enumerate(figures):
        if figure.kind in ("distribution", "sensitivity") and method == "grid":
            raise refusal(f"a random sample for a {figure.kind}, not a grid", "figure", index, "kind")
        for place, (column, output) in figure.columns.items():
            known = outputs if output else columns if figure.kind == "map" else (*columns, *outputs)
            if column not in known:
                what = "an output of this study" if output else "a column of this study"
                raise refusal(f"{what}{suggestion(column, known)}", "figure", index, *place)
