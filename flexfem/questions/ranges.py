"""Range of the output of a mechanism at finite displacements: driven along one direction until a limit.

The beams of `analytic.paths` find the limit and its kind. Plane finite elements with finite rotations are then driven
to this displacement, and give the ratios of the force and of the highest stress to those of linear theory. The linear
numbers are those of the last model, so that the mesh and the thickness enter once. The effect of the thickness on the
ratios is that of beams with the compliance of hinges in three dimensions against beams in plane stress.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from flexfem.analytic.paths import BUCKLING, NO_LIMIT, YIELD, DrivenPlate, PathEnd
from flexfem.arrays import Array
from flexfem.fem.nonlinear import driven, stress_in_hinges
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import levels
from flexfem.questions.plates import Responses, model_of, parts_of, responses, solved, thickness_of
from flexfem.questions.setup import Mesh, ModelAnswer
from flexfem.refused import ComputationFailed
from flexfem.results import STRESS, Quantity
from flexfem.units import DIRECTIONS

UNKNOWN = "unknown"  # kind of an end that finite elements do not reach
SENSES = (1.0, -1.0)
SYMMETRIC = 1e-4  # of a displacement: smaller motions across it come from meshes, and nothing needs to hold them
ALIKE = 1e-3  # relative difference, by the meshes of hinges, of two ends of beams that are one by symmetry
HOLDS = 0.5  # of the band of the linear range: linear theory holds if beams change it by less
OF_THE_THICKNESS = 0.25  # possible error of the effect of the thickness on the ratios to linear theory
OF_THE_MESH = 2e-3  # of the change of the force; 1e-4 measured between meshes of resolutions 3 and 6
OF_THE_PEAK = 0.02  # of the change of the stress, where bending and tension concentrate differently
MOST_CHECKS = 2
CLOSE = 0.06  # of a displacement: a larger step is followed by other finite elements
OF_THE_STEP = 0.1  # of the step from the displacement of finite elements to the limit, by powers

RANGE_LABELS = {"others": ("held", "free"), "sense": ("positive", "negative")}
RANGE = Quantity(
    "range of the output until a limit", "motion", ("others", "sense", "direction"), STRESS, only="mechanism",
    note="at finite displacements, driven along one direction from rest, the other directions held or free",
)  # fmt: skip
RANGE_FORCE = Quantity(
    "force at the end of the range", "wrench", ("others", "sense", "direction"), STRESS, only="mechanism"
)


class RangeEnd(NamedTuple):
    """End of a range with its bands: displacement, mm or rad, and force, N or N mm, along one sense of a direction.

    hinge : number of the hinge with the highest stress.   linear : whether the numbers are those of linear theory.
    """

    displacement: float
    force: float
    displacement_band: float
    force_band: float
    kind: str
    hinge: int
    stress: Array
    linear: bool = False


class _Linear(NamedTuple):
    """Force and highest stress (2,) per displacement of the last model, and their relative bands (2,)."""

    slopes: Array
    bands: Array


class Ranges(NamedTuple):
    """Ends by (others held or free, sense, direction)."""

    ends: dict[tuple[int, int, int], RangeEnd]

    def array(self, name: str) -> Array:
        """Return a number of all ends (2, 2, 3, ...)."""
        found = [np.asarray(getattr(self.ends[at], name), dtype=float) for at in sorted(self.ends)]
        return np.reshape(found, (2, 2, 3, *found[0].shape))


def slopes_of(response: Responses, port: int, held: Sequence[int]) -> Array:
    """Return the force and the highest stress (2,) per displacement of a port, others of the output held or free."""
    ports = [port, *held]
    C = response.compliance
    load = np.zeros(C.shape[0])
    load[ports] = np.linalg.solve(C[np.ix_(ports, ports)], np.eye(len(ports))[0])
    return np.array([load[port], np.max(response.stress(load))])


def ranges(mechanism: Mechanism, mesh: Mesh | None, found: Mapping[str, ModelAnswer]) -> Ranges:
    """Return the ends of the ranges of a mechanism along every direction, in both senses, others held or free.

    found : values at rest of all models, of which the last one is used.
    """
    layout = mechanism.layout
    thickness = thickness_of(mechanism) if mesh is not None else ()
    plane = beams = DrivenPlate(layout, None if mesh is None else parts_of(mechanism).hinges)
    if thickness:
        beams = DrivenPlate(layout, thickness[0].solid.hinges, thickness[0].stress_ratios)
    last = list(found.values())[-1]
    ends, known = dict[tuple[int, int, int], RangeEnd](), list[tuple[tuple[PathEnd, int], RangeEnd]]()
    for axis, sense in product(range(3), range(2)):
        others = [port for port in range(3) if port != axis]
        free = beams_end = None
        for which, held in ((1, []), (0, others)):
            if free is not None and _nothing_to_hold(free, others, layout.lever):
                ends[which, sense, axis] = ends[1, sense, axis]
                continue
            linear = _linear(last, axis, held, layout.yield_strength)
            beams_end = beams.end(axis, held, SENSES[sense] * layout.yield_strength / linear.slopes[1])
            free = beams_end if which == 1 else free
            alike = [made for other, made in known if _alike(other, beams_end, axis)]
            if alike:
                ends[which, sense, axis] = _turned(alike[0], beams_end)
                continue
            try:
                made = _checked(mechanism, mesh, beams_end, linear, (axis, held), plane, beams)
            except ComputationFailed:
                made = _without_numbers(UNKNOWN, beams_end)
            known.append(((beams_end, axis), made))
            ends[which, sense, axis] = made
    return Ranges(ends)


def described(layout: Layout, found: Ranges) -> list[str]:
    """Return sentences that name the limit of every range."""
    by_limit = dict[str, list[str]]()
    for (which, sense, axis), end in sorted(found.ends.items(), reverse=True):
        name = layout.joints[end.hinge].name
        limit = {
            YIELD: f"yield of hinge {name!r}" + ", by linear theory, which holds to its band" * end.linear,
            BUCKLING: f"buckling, with the highest stress in hinge {name!r}, by beams",
            NO_LIMIT: "no limit was found",
            UNKNOWN: f"not known, because finite elements find no equilibrium near the limit of beams at {name!r}",
        }[end.kind]
        by_limit.setdefault(limit, []).append(f"{'+-'[sense]}{DIRECTIONS[axis]} ({('held', 'free')[which]})")
    return [f"range along {', '.join(places)}: {limit}" for limit, places in by_limit.items()]


def yielding_bodies(last: ModelAnswer, strength: float) -> list[str]:
    """Warn of directions along which a body yields before the hinges by linear theory, which no range contains."""
    if "body_rate" not in last.values:
        return []
    before = last.values["yield_range"] < (1 - OF_THE_PEAK) * strength / np.max(last.values["stress"], axis=0)
    named = ", ".join(direction for direction, first in zip(DIRECTIONS, before, strict=True) if first)
    text = f"in {named}, a body yields before the hinges by linear theory, others held: the range is that of hinges"
    return [text] * bool(named)


def _nothing_to_hold(end: PathEnd, others: Sequence[int], lever: float) -> bool:
    """Whether the output moves along its direction by itself until a hinge yields."""
    motions = np.abs(end.at.motions[others]) * [lever if port == 2 else 1.0 for port in others]
    return end.kind == YIELD and bool(np.all(motions < SYMMETRIC * np.abs(end.displacement) * max(lever, 1.0)))


def _linear(last: ModelAnswer, axis: int, held: Sequence[int], strength: float) -> _Linear:
    """Return the linear slopes of the last model."""
    stiffness, at_yield = ("held", "yield_range") if held else ("free", "free_yield_range")
    values, bands = last.values, last.bands
    highest = np.max(values["stress"][..., axis]) if held else strength / values[at_yield][axis]
    relative = [
        float(bands[name][axis] / values[name][axis]) if name in bands else 0.0 for name in (stiffness, at_yield)
    ]
    return _Linear(np.array([values[stiffness][axis], highest]), np.abs(relative))


def _alike(known: tuple[PathEnd, int], end: PathEnd, axis: int) -> bool:
    """Whether two ends are one by symmetry; those of the two translations may be."""
    other, along = known
    if other.kind != end.kind or (along == 2) != (axis == 2):
        return False
    first, second = (np.abs([one.displacement, one.force, *one.linear]) for one in (other, end))
    return bool(np.all(np.abs(first - second) < ALIKE * second))


def _turned(known: RangeEnd, end: PathEnd) -> RangeEnd:
    """Return an end that is the image of a known one."""
    sign = np.sign(end.displacement)
    stress = end.at.stress * known.stress.max() / end.at.stress.max()
    return known._replace(
        displacement=float(sign * abs(known.displacement)),
        force=float(sign * abs(known.force)),
        hinge=int(np.argmax(stress)),
        stress=stress,
    )


def _checked(
    mechanism: Mechanism,
    mesh: Mesh | None,
    end: PathEnd,
    linear: _Linear,
    driven_ports: tuple[int, Sequence[int]],
    plane: DrivenPlate,
    beams: DrivenPlate,
) -> RangeEnd:
    """Return an end of beams, with bands and checked by finite elements if there is a mesh."""
    stress = end.at.stress
    hinge = int(np.argmax(stress))
    if end.kind == NO_LIMIT:
        return _without_numbers(NO_LIMIT, end)
    if mesh is None:
        return RangeEnd(end.displacement, end.force, np.nan, np.nan, end.kind, hinge, stress)
    if end.kind == BUCKLING:
        return _of_buckling(end, linear)
    strength = mechanism.layout.yield_strength
    sign, expected = np.sign(end.displacement), strength / end.linear[1]
    changes = [abs(end.displacement) / expected - 1, end.force / end.displacement / end.linear[0] - 1]
    change = float(np.max(np.abs(changes)))
    if change < HOLDS * linear.bands[1]:
        x = strength / linear.slopes[1]
        force = linear.slopes[0] * x
        width = linear.bands[1] + change
        return RangeEnd(
            sign * x, sign * force, x * width, force * (width + linear.bands[0]), YIELD, hinge, stress, True
        )
    x = end.displacement
    for _ in range(MOST_CHECKS):
        ratios, spread, peaks = _ratios(mechanism, mesh, x, driven_ports, plane, beams)
        force, highest = linear.slopes * ratios * abs(x)
        step = (strength / highest) ** (1 / end.exponents[1])
        if abs(step - 1) < CLOSE:
            break
        x = x * step
    widths = linear.bands + spread + np.array([OF_THE_MESH, OF_THE_PEAK]) * np.minimum(1.0, np.abs(ratios - 1))
    width = widths[1] / abs(end.exponents[1]) + OF_THE_STEP * abs(step - 1)
    x, force = x * step, force * step ** end.exponents[0]
    band = abs(end.exponents[0]) * width + widths[0]
    peaks = peaks * strength / peaks.max()
    return RangeEnd(x, sign * force, abs(x) * width, force * band, YIELD, int(np.argmax(peaks)), peaks)


def _without_numbers(kind: str, end: PathEnd) -> RangeEnd:
    """Return an end whose numbers are not known; the hinge is that with the highest stress by beams."""
    stress = end.at.stress
    nothing = np.full(len(stress), np.nan)
    return RangeEnd(np.nan, np.nan, np.nan, np.nan, kind, int(np.argmax(stress)), nothing)


def _of_buckling(end: PathEnd, linear: _Linear) -> RangeEnd:
    """Return where beams buckle; they lack the compliance of bodies, which is seen in the stiffness at rest."""
    softer = linear.slopes[0] / end.linear[0]
    band = abs(1 - softer) + linear.bands[0]
    x = end.displacement / softer
    return RangeEnd(
        x,
        end.force,
        abs(x) * (band + linear.bands[0]),
        abs(end.force) * band,
        BUCKLING,
        int(np.argmax(end.at.stress)),
        end.at.stress,
    )


def _ratios(
    mechanism: Mechanism,
    mesh: Mesh,
    x: float,
    driven_ports: tuple[int, Sequence[int]],
    plane: DrivenPlate,
    beams: DrivenPlate,
) -> tuple[Array, Array, Array]:
    """Return force and highest stress over those of linear theory (2,), their possible errors, and the stress (h,)."""
    port, held = driven_ports
    level = levels(mesh.resolution)[0]
    model = model_of(mechanism, level)
    at = driven(model, [port, *held], np.array([[x, *np.zeros(len(held))]]))
    peaks = stress_in_hinges(model, at.fields[0])
    slopes = slopes_of(responses(mechanism, solved(mechanism, level)), port, held)
    ratios = np.array([at.load[0, port] / x, peaks.max() / abs(x)]) / slopes
    spread = np.zeros(2)
    if beams is not plane:
        by_beams, found = list[Array](), list[Array]()
        for one in (plane, beams):
            reached = one.reached(port, held, x)
            if reached is None:
                raise ComputationFailed("the beams find no equilibrium at the end of the range")
            stress = one.stress(reached.unknowns)
            found.append(stress)
            by_beams.append(np.array([reached.forces[port] / x, stress.max() / abs(x)]) / one.slopes(port, held, x))
        thick = by_beams[1] / by_beams[0]
        ratios, spread = ratios * thick, OF_THE_THICKNESS * np.abs(thick - 1)
        peaks = peaks * found[1] / found[0]
    return ratios, spread, peaks
