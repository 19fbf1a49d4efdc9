"""Plausible stages, drawn with numbers of both stages between stated ends, and their metal."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexfem.analytic.elastic_bodies import body_compliance
from flexfem.analytic.model import CALIBRATED, at_rest, hinge_compliances, in_range, unanswered
from flexfem.analytic.paper import freedoms_of
from flexfem.arrays import AnyArray, Array, inverse
from flexfem.files.toml import bad_key
from flexfem.mechanism.designs import Designs, lower
from flexfem.mechanism.feasibility import check_feasible
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.study.columns import Column
from flexfem.study.designs import designs_of, stage_of
from flexfem.study.sampling import INSIDE, at_quantile, monte_carlo
from flexfem.verdicts.claims import SIDES, LoadedClaims, Side
from flexfem.verdicts.evidence import Metal

Watch = Callable[[int, int], object]  # is told how many of how many stages are seen to


class Population(NamedTuple):
    """The stages of an ensemble that can be judged.

    values : (n, columns), file units.
    three, six : the stages of each pair; their metal by calibrated hinges and elastic pads, links and platforms.
    drawn : pairs.   infeasible : of these, one of the two cannot be made.   off_chart : has a hinge off the chart.
    """

    values: Array
    three: Metal
    six: Metal
    drawn: int
    infeasible: int
    off_chart: int

    def of_rows(self, rows: AnyArray) -> Population:
        """Only some of the judged pairs, by a mask (n,)."""
        return self._replace(values=self.values[rows], three=self.three.of_rows(rows), six=self.six.of_rows(rows))


class OneSide(NamedTuple):
    """One of the two stages and the columns that set numbers of it."""

    stage: Stage
    columns: tuple[Column, ...]


def drawn_values(loaded: LoadedClaims) -> Array:
    """Values (designs, columns) of an ensemble, file units: independent draws."""
    ensemble = loaded.claims.ensemble
    assert ensemble is not None
    u = np.clip(monte_carlo(ensemble.seed, len(loaded.columns), 0, ensemble.designs), INSIDE, 1.0 - INSIDE)
    return np.stack([at_quantile(each.column.factor, q) for each, q in zip(loaded.columns, u.T, strict=True)], axis=-1)


def populate(loaded: LoadedClaims, watch: Watch = lambda done, of: None) -> Population:
    """Draw an ensemble, and the metal of every pair that can be made.

    Raises BadInput where there is none.
    """
    values, sides = drawn_values(loaded), {side: side_of(loaded, side) for side in SIDES}
    kept, pairs, off_chart = list[int](), list[list[Stage]](), 0
    for index, row in enumerate(values):
        watch(index, len(values))
        try:
            pair = [stage_of(varied, row[places]) for varied, places in sides.values()]
            for stage in pair:
                check_feasible(stage)
            if not all(_on_chart(stage) for stage in pair):
                off_chart += 1
                continue
            for stage in pair:
                body_compliance(stage)  # refuses bodies that cannot be drawn
        except BadInput:
            continue
        kept.append(index)
        pairs.append(pair)
    if not kept:
        raise bad_key(
            loaded.path,
            ("ensemble",),
            f"ensemble.designs = {len(values)}: none of these pairs of stages can be "
            "made and judged, expected ranges that some can be made in",
        )
    three, six = (
        metal_of(tuple(pair[k] for pair in pairs), designs_of(varied, values[kept][:, places]))
        for k, (varied, places) in enumerate(sides.values())
    )
    return Population(values[kept], three, six, len(values), len(values) - len(kept) - off_chart, off_chart)


def metal_of(stages: tuple[Stage, ...], designs: Designs) -> Metal:
    """The metal of n stages, also given as designs."""
    bodies = np.array([body_compliance(stage) for stage in stages])
    hinges = hinge_compliances(designs, CALIBRATED)
    return Metal(stages, designs, bodies, inverse(at_rest(designs, hinges, freedoms_of(21), bodies).stiffness))


def metal_of_stage(stage: Stage) -> Metal | None:
    """The metal of one stage, n = 1, as in an ensemble; None where it is off the chart."""
    return metal_of((stage,), lower(stage)) if _on_chart(stage) else None


def answered(designs: Designs, formula: str) -> AnyArray:
    """Which designs (n,) a formula is meant for and has positive compliances for."""
    with np.errstate(all="ignore"):
        none = [each.where for each in unanswered(designs, formula, hinge_compliances(designs, formula))]
        return np.asarray(np.all(in_range(designs, formula), axis=(1, 2)) & ~np.any(none, axis=0))


def _on_chart(stage: Stage) -> bool:
    return bool(answered(lower(stage), CALIBRATED)[0])


def side_of(loaded: LoadedClaims, side: Side) -> tuple[OneSide, list[int]]:
    """One of the two stages with its columns, and the places of these among all."""
    places = [place for place, each in enumerate(loaded.columns) if side in each.sides]
    stage = loaded.three if side == "three" else loaded.six
    return OneSide(stage, tuple(loaded.columns[place].column for place in places)), places
