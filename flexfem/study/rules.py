"""Which keys of a study file go together, in JSON schema and as the reader of the file checks it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, get_args

import numpy as np

from flexfem.files.json_schema import Rule, both, has, only, says, when, without
from flexfem.files.keypath import key_path
from flexfem.files.refusals import refusal, shown, suggestion
from flexfem.stage.keys import keys, meant
from flexfem.study.columns import NAMED, WAYS, columns_of
from flexfem.study.expression import names_in
from flexfem.study.outputs import FEASIBLE, RESERVED
from flexfem.study.tables import MOST, Method, normal_correlation
from flexfem.verify.case import LINKS

if TYPE_CHECKING:
    from flexfem.study.plan import Study

UNCORRELATED: dict[Method, str] = {
    "saltelli": "Sobol indices split the variance among independent factors",
    "grid": "a grid holds all pairs of values alike",
    "table": "its rows are taken as they are",
}
SINGULAR = 1e-9  # least eigenvalue of a correlation matrix, as of round-off
_APPLIES = {  # keys that not every model takes
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
    for key, models in _APPLIES.items():
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


def check_keys(study: Study) -> None:
    """Refuse keys that do not go together, the first that is found."""
    _keys_of_its_model(study)
    _drive_is_of_its_model(study)
    _factors_fit_the_sampling(study)
    _columns_differ(study)
    _expressions_name_columns(study)
    _correlations_are_possible(study)
    _figures_can_be_drawn(study)


def _keys_of_its_model(study: Study) -> None:
    for name, field in type(study).model_fields.items():
        key = field.alias or name
        if name in study.model_fields_set and study.model not in _APPLIES.get(key, (study.model,)):
            raise refusal(f'no {key} with model = "{study.model}"', key)
    if study.links and study.mobility != 21:
        raise refusal("mobility = 21 with it: elastic links go with all freedoms of the hinges", "links")
    if study.check == "closed_form" and study.model != "analytic":
        raise refusal("drawing: what is meshed is drawn first", "check")


def _drive_is_of_its_model(study: Study) -> None:
    if study.driven and study.model == "three_dimensional":
        raise refusal(
            'no actuators with model = "three_dimensional": a drive is solved in the plane', "drive", "actuators"
        )
    for index, factor in enumerate(study.factor):
        if not study.driven and any(keys()[path].of_drive for path in factor.paths):
            expected = "[drive] actuators = true with a number of an actuator: no other output depends on it"
            raise refusal(expected, "factor", index)


def _factors_fit_the_sampling(study: Study) -> None:
    grid, table = study.sampling.method == "grid", study.sampling.method == "table"
    for index, factor in enumerate(study.factor):
        if table != (factor.kind == "given"):
            raise refusal(f'{"no values" if table else WAYS} with method = "{study.sampling.method}"', "factor", index)
        if grid and factor.distribution is not None:
            raise refusal('values or a range with method = "grid"', "factor", index, "distribution")
        if grid and factor.kind == "range" and factor.points is None:
            raise refusal('points with method = "grid"', "factor", index)
        if not grid and factor.points is not None:
            raise refusal('no points but with method = "grid"', "factor", index, "points")
    if grid and study.count > MOST:
        raise refusal(f"a grid of at most {MOST} designs, not {study.count}", "factor")
    if study.sampling.base is not None and study.count > MOST:
        raise refusal(f"base * (factors + 2) of at most {MOST}, not {study.count}", "sampling", "base")


def _columns_differ(study: Study) -> None:
    names, set_by = {*RESERVED, FEASIBLE, *study.outputs}, dict[str, int]()
    for index, factor in enumerate(study.factor):
        for column in columns_of([factor]):
            if column.name in names:
                raise refusal(f"a column name of its own, not {shown(column.name)} again", "factor", index)
            names.add(column.name)
        for path in factor.paths:
            first = set_by.setdefault(path, index)
            if first != index:
                raise refusal(f"each key set once, and {key_path(('factor', first))} sets {path}", "factor", index)


def _expressions_name_columns(study: Study) -> None:
    names = {column.name for column in columns_of(study.factor)}
    taken = {*RESERVED, FEASIBLE, *study.outputs, *names, *keys()}
    known = {*names, *study.outputs}
    for index, output in enumerate(study.output):
        if output.name in taken:
            raise refusal(f"a name of its own, not {shown(output.name)} again", "output", index, "name")
        _require_known(output.expression, known, "output", index, "expression")
        taken.add(output.name)
        known.add(output.name)
    for index, constraint in enumerate(study.constraint):
        _require_known(constraint.value, known, "constraint", index, "value")
        if study.sampling.method == "saltelli" and study.is_given(constraint.value):
            expected = 'an output in it with method = "saltelli": refused designs would make the factors dependent'
            raise refusal(expected, "constraint", index, "value")


def _correlations_are_possible(study: Study) -> None:
    columns = {column.name: column.factor for column in columns_of(study.factor)}
    pairs = set[frozenset[str]]()
    if study.correlation and study.sampling.method in UNCORRELATED:
        raise refusal(
            f'none with method = "{study.sampling.method}": {UNCORRELATED[study.sampling.method]}', "correlation"
        )
    for index, each in enumerate(study.correlation):
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
    least = float(np.linalg.eigvalsh(normal_correlation(list(columns), study.correlation)).min())
    if least < SINGULAR:
        raise refusal("coefficients that go together: no factors can be correlated like this", "correlation")


def _figures_can_be_drawn(study: Study) -> None:
    factors = [column.name for column in columns_of(study.factor)]
    for index, figure in enumerate(study.figure):
        if figure.kind in ("distribution", "sensitivity") and study.sampling.method == "grid":
            raise refusal(f"a random sample for a {figure.kind}, not a grid", "figure", index, "kind")
        for place, (column, output) in figure.columns.items():
            every = study.every_output
            known = every if output else factors if figure.kind == "map" else (*factors, *every)
            if column not in known:
                what = "an output of this study" if output else "a column of this study"
                raise refusal(f"{what}{suggestion(column, known)}", "figure", index, *place)


def _require_known(expression: str, known: Iterable[str], *at: str | int) -> None:
    names = set(known)
    for name in names_in(expression):
        if name not in names and name not in keys():
            expected = f"columns and keys by name, not {shown(name)}{meant(name, sorted({*names, *keys()}))}"
            raise refusal(expected, *at)
