"""Range of the output of a mechanism at finite displacements: driven along one direction until a
limit.

The range ends at the first of: yield of a hinge or of a body, buckling, contact of two parts of the
plate, and the stroke of an actuator that the motion opens. The beams of `analytic.paths` find the
limit and its kind. Plane finite elements with finite rotations are then driven to this
displacement, and give the ratios of the force and of the highest stress to those of linear theory.
The linear numbers are those of the last model, so that the mesh and the thickness enter once. The
effect of the thickness on the ratios is that of beams with the compliance of hinges in three
dimensions against beams in plane stress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from flexfem.analytic.paths import (
    BODY_YIELD,
    BUCKLING,
    CONTACT,
    NO_LIMIT,
    STROKE,
    YIELD,
    DrivenPlate,
    PathEnd,
    drive_at_stroke,
)
from flexfem.analytic.plates import hinge_compliances
from flexfem.arrays import Array
from flexfem.fem.body_stress import moving_bodies
from flexfem.fem.nonlinear import Equilibria, driven, gap_of_parts, stress_in_parts
from flexfem.fem.ports import PlateModel
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import levels
from flexfem.questions.plates import (
    PEAK,
    Responses,
    model_of,
    parts_of,
    responses,
    solved,
    thickness_of,
    wide_stress_ratios,
)
from flexfem.questions.setup import Mesh, ModelAnswer
from flexfem.refused import ComputationFailed
from flexfem.results import Quantity
from flexfem.units import DIRECTIONS

UNKNOWN = "unknown"  # kind of an end that finite elements do not reach
SENSES = (1.0, -1.0)
# of a displacement: smaller motions across it come from meshes, and nothing needs to hold them
SYMMETRIC = 1e-4
# relative difference, by the meshes of hinges, of two ends of beams that are one by symmetry
ALIKE = 1e-3
HOLDS = 0.5  # of the band of the linear range: linear theory holds if beams change it by less
# possible error of the effect of the thickness on the ratios to linear theory
OF_THE_THICKNESS = 0.25
# of the change of the force; 1e-4 measured between meshes of resolutions 3 and 6
OF_THE_MESH = 2e-3
OF_THE_PEAK = 0.02  # of the change of the stress, where bending and tension concentrate differently
MOST_CHECKS = 5
UNFINISHED = 0.5  # of a displacement, left after the last check: its end is not known
CLOSE = 0.06  # of a displacement: a larger step is followed by other finite elements
# of a step from the displacement of finite elements to the limit, by powers, that is close
OF_THE_STEP = 0.1
# of the displacement at which parts touch: there finite elements still have a gap
BEFORE_CONTACT = 0.97
LEAST_POWER = 0.5  # of the displacement, of the stress in bodies where the force no longer grows
# least eigenvalue of the stiffness on the way, over that at rest, below which parts nearly buckle: of
# all paths, and of those on which the force falls far below that of linear theory
NEARLY_BUCKLING = 0.3
BOWING = 0.95
# steps of finite elements up to where beams nearly buckle, in a first and a second trial; the multiple
# of this displacement up to which they stay, since elastic bodies shift it; the growth of later ones
STEPS_TO_BUCKLING = (4, 12)
FINE_STEPS = 2.0
LATER_STEPS = 1.5
# of forces of finite elements and beams on one path; on the unstable one they are ten times as large
SAME_PATH = 1.5
LIMITS = (YIELD, BODY_YIELD, BUCKLING, CONTACT, STROKE, NO_LIMIT, UNKNOWN)

RANGE_LABELS = {
    "others": ("held", "free"),
    "sense": ("positive", "negative"),
    "limit": (
        "yield of a hinge",
        "yield of a body",
        "buckling",
        "contact",
        "stroke of the drive",
        "none",
        "unknown",
    ),
}
RANGE = Quantity(
    "range of the output until the first limit",
    "motion",
    ("others", "sense", "direction"),
    PEAK,
    note="at finite displacements, the output driven from rest along one direction",
)
RANGE_FORCE = Quantity(
    "force at the end of the range",
    "wrench",
    ("others", "sense", "direction"),
    PEAK,
)
RANGE_LIMIT = Quantity(
    "limit at which the range ends",
    "",
    ("others", "sense", "limit", "direction"),
    note="1 for the limit that governs, 0 for the others",
)


class RangeEnd(NamedTuple):
    """End of a range with its bands: displacement, mm or rad, and force, N or N mm, along one sense
    of a direction.

    hinge, body : numbers of the hinge and of the moving body with the highest stress.
    linear : whether the numbers are those of linear theory.   parts : what touches or drives.
    bows_at : displacement at which parts nearly buckle on the way, by beams, 0 if none do.
    softened : force at the end over that of linear theory, by beams.
    """

    displacement: float
    force: float
    displacement_band: float
    force_band: float
    kind: str
    hinge: int
    stress: Array
    linear: bool = False
    parts: str = ""
    body: int = 0
    bows_at: float = 0.0
    softened: float = 1.0

    @property
    def governing(self) -> Array:
        """1 for the limit that governs, 0 for the others (limits,)."""
        return np.array([float(kind == self.kind) for kind in LIMITS])


class _Linear(NamedTuple):
    """Force, highest stress of hinges and of bodies (3,) per displacement of the last model, and
    relative bands (3,).

    body : number of the moving body with the highest stress.
    """

    slopes: Array
    bands: Array
    body: int


class Ranges(NamedTuple):
    """Ends by (others held or free, sense, direction)."""

    ends: dict[tuple[int, int, int], RangeEnd]

    def array(self, name: str) -> Array:
        """Return a number of all ends (2, 2, 3, ...)."""
        found = [np.asarray(getattr(self.ends[at], name), dtype=float) for at in sorted(self.ends)]
        return np.reshape(found, (2, 2, 3, *found[0].shape))


def slopes_of(
    layout: Layout,
    response: Responses,
    port: int,
    held: Sequence[int],
) -> Array:
    """Return force, highest stress of hinges and of bodies (3,) per displacement of a port, others
    held or free.

    The stress of parts of another material is multiplied by `Layout.hinge_shares` and
    `body_shares`, as that of beams."""
    load = _unit_displacement(response.compliance, port, held)
    bodies = 0.0
    if response.bodies is not None:
        bodies = float(np.max(response.bodies(load).highest * layout.body_shares, initial=0.0))
    return np.array([load[port], np.max(response.stress(load) * layout.hinge_shares), bodies])


def _unit_displacement(
    compliance: Array,
    port: int,
    held: Sequence[int],
) -> Array:
    """Return the loads (k,) by which a port moves by one, with others held."""
    ports = [port, *held]
    load = np.zeros(len(compliance))
    load[ports] = np.linalg.solve(compliance[np.ix_(ports, ports)], np.eye(len(ports))[0])
    return load


class _Models(NamedTuple):
    """A mechanism, its finest mesh, and its beams.

    plane : beams with hinges in plane stress.   beams : those of the last model.
    """

    mechanism: Mechanism
    mesh: Mesh | None
    plane: DrivenPlate
    beams: DrivenPlate

    @classmethod
    def of(
        cls,
        mechanism: Mechanism,
        mesh: Mesh | None,
    ) -> _Models:
        """Return the beams of a mechanism; with finite elements they have the hinges of these."""
        layout = mechanism.layout
        if mesh is None:
            ratios = partial(wide_stress_ratios, layout)
            beams = DrivenPlate(layout, hinge_compliances(layout), ratios)
            return cls(mechanism, None, beams, beams)
        plane = DrivenPlate(layout, parts_of(mechanism).hinges)
        thickness = thickness_of(mechanism)
        if not thickness:
            return cls(mechanism, mesh, plane, plane)
        best = thickness[0]
        beams = DrivenPlate(layout, best.solid.hinges, best.stress_ratios)
        return cls(mechanism, mesh, plane, beams)


class _ByBeams(NamedTuple):
    """The end of beams that are driven along a port with others held, and linear theory."""

    port: int
    held: Sequence[int]
    end: PathEnd
    linear: _Linear


def ranges(
    mechanism: Mechanism,
    mesh: Mesh | None,
    found: Mapping[str, ModelAnswer],
) -> Ranges:
    """Return the ends of the ranges of a mechanism along every direction, in both senses, others
    held or free.

    found : values at rest of all models, of which the last one is used.
    """
    lever = mechanism.layout.lever
    models = _Models.of(mechanism, mesh)
    last = list(found.values())[-1]
    ends = dict[tuple[int, int, int], RangeEnd]()
    known = list[tuple[_ByBeams, RangeEnd]]()
    for axis, sense in product(range(3), range(2)):
        others = [port for port in range(3) if port != axis]
        free = _by_beams(models, last, axis, [], sense)
        ends[1, sense, axis] = _end(models, free, known)
        if _nothing_to_hold(free.end, others, lever):
            ends[0, sense, axis] = ends[1, sense, axis]
        else:
            held = _by_beams(models, last, axis, others, sense)
            ends[0, sense, axis] = _end(models, held, known)
    return Ranges(ends)


def _by_beams(
    models: _Models, last: ModelAnswer, port: int, held: Sequence[int], sense: int
) -> _ByBeams:
    """Return the end of beams that are driven along a port, with others held."""
    layout = models.mechanism.layout
    linear = _linear(last, port, held, layout)
    force, hinges, bodies = linear.slopes
    scale = SENSES[sense] * layout.yield_strength / hinges
    return _ByBeams(port, held, models.beams.end(port, held, scale, bodies / force), linear)


def _end(
    models: _Models,
    by_beams: _ByBeams,
    known: list[tuple[_ByBeams, RangeEnd]],
) -> RangeEnd:
    """Return an end, the image of a known one by symmetry if there is such; add it to the known."""
    for other, made in known:
        if _alike(other, by_beams):
            return _turned(made, by_beams.end, by_beams.linear)
    try:
        made = _checked(models, by_beams)
    except ComputationFailed:
        made = _without_numbers(UNKNOWN, by_beams.end)
    if _bows(by_beams.end):
        made = made._replace(bows_at=by_beams.end.softest_at, softened=_softened(by_beams.end))
    known.append((by_beams, made))
    return made


def described(layout: Layout, found: Ranges) -> list[str]:
    """Return sentences that name the limit of every range, and tell where parts nearly buckle."""
    by_limit = dict[str, list[str]]()
    by_bowing = dict[str, list[str]]()
    for (which, sense, axis), end in sorted(found.ends.items(), reverse=True):
        name = layout.joints[end.hinge].name
        by_linear = ", by linear theory, which holds to its band" * end.linear
        limit = {
            YIELD: f"yield of hinge {name!r}{by_linear}",
            BODY_YIELD: f"yield of body {_body_name(layout, end.body)!r}{by_linear}",
            CONTACT: f"contact of {end.parts}",
            STROKE: f"stroke of actuator {end.parts}",
            BUCKLING: f"buckling, with the highest stress in hinge {name!r}, by beams",
            NO_LIMIT: "no limit was found",
            UNKNOWN: (
                "not known, because finite elements find no equilibrium near the limit of beams "
                f"at {name!r}"
            ),
        }[end.kind]
        place = f"{'+-'[sense]}{DIRECTIONS[axis]} (others {('held', 'free')[which]})"
        by_limit.setdefault(limit, []).append(place)
        if end.bows_at and np.isfinite(end.displacement):
            bowing = (
                f"at about {abs(end.bows_at / end.displacement):.0%} of the range; the force at its "
                f"end is {end.softened:.0%} of that of linear theory, by beams"
            )
            by_bowing.setdefault(bowing, []).append(place)
    return [
        *(f"range along {', '.join(places)}: {limit}" for limit, places in by_limit.items()),
        *(
            f"parts nearly buckle on the way along {', '.join(places)}, {bowing}"
            for bowing, places in by_bowing.items()
        ),
    ]


def _body_name(layout: Layout, number: int) -> str:
    """Return the name of a moving body."""
    moving = moving_bodies(layout)
    return layout.bodies[moving[number]].name if moving else ""


def _nothing_to_hold(
    end: PathEnd,
    others: Sequence[int],
    lever: float,
) -> bool:
    """Whether the output moves along its direction by itself until a hinge yields."""
    motions = np.abs(end.at.motions[others]) * [lever if port == 2 else 1.0 for port in others]
    return end.kind == YIELD and bool(
        np.all(motions < SYMMETRIC * np.abs(end.displacement) * max(lever, 1.0))
    )


def _linear(
    last: ModelAnswer,
    axis: int,
    held: Sequence[int],
    layout: Layout,
) -> _Linear:
    """Return the linear slopes of the last model."""
    stiffness = "held"
    at_yield = "yield_range"
    rate = "body_rate"
    if not held:
        stiffness = "free"
        at_yield = "free_yield_range"
        rate = "free_body_rate"
    values = last.values
    highest = layout.yield_strength / values[at_yield][axis]
    if held:
        highest = np.max(values["stress"][..., axis] * layout.hinge_shares)
    bands = [_relative(last, name, axis) for name in (stiffness, at_yield)]
    bodies = np.zeros(0)
    if rate in values:
        bodies = values[rate][:, axis] * layout.body_shares
    if not bodies.size:
        return _Linear(
            np.array([values[stiffness][axis], highest, 0.0]), np.array([*bands, 0.0]), 0
        )
    body = int(np.argmax(bodies))
    slopes = np.array([values[stiffness][axis], highest, bodies[body]])
    return _Linear(slopes, np.array([*bands, _relative(last, rate, (body, axis))]), body)


def _relative(
    last: ModelAnswer,
    name: str,
    at: int | tuple[int, int],
) -> float:
    """Return a band of the last model relative to the value; zero without a band."""
    if name not in last.bands:
        return 0.0
    return abs(float(last.bands[name][at] / last.values[name][at]))


def _alike(known: _ByBeams, found: _ByBeams) -> bool:
    """Whether two ends are one by symmetry; those of the two translations may be."""
    if known.end.kind != found.end.kind or (known.port == 2) != (found.port == 2):
        return False
    first, second = (
        np.abs([end.displacement, end.force, *end.linear]) for end in (known.end, found.end)
    )
    return bool(np.all(np.abs(first - second) < ALIKE * second))


def _turned(
    known: RangeEnd,
    end: PathEnd,
    linear: _Linear,
) -> RangeEnd:
    """Return an end that is the image of a known one."""
    sign = np.sign(end.displacement)
    stress = end.at.stress * known.stress.max() / end.at.stress.max()
    return known._replace(
        displacement=float(sign * abs(known.displacement)),
        force=float(sign * abs(known.force)),
        hinge=int(np.argmax(stress)),
        stress=stress,
        parts=end.parts,
        body=linear.body,
    )


def _checked(models: _Models, by_beams: _ByBeams) -> RangeEnd:
    """Return an end of beams, with bands and checked by finite elements if there is a mesh."""
    end = by_beams.end
    linear = by_beams.linear
    stress = end.at.stress
    if end.kind == NO_LIMIT:
        return _without_numbers(NO_LIMIT, end)
    if models.mesh is None:
        hinge = int(np.argmax(stress))
        return RangeEnd(
            end.displacement, end.force, np.nan, np.nan, end.kind, hinge, stress, parts=end.parts
        )
    if end.kind == BUCKLING:
        return _of_buckling(end, linear)
    layout = models.mechanism.layout
    change = _change(end, layout.yield_strength)
    if change < HOLDS * linear.bands[1]:
        opening = _opening(models.mechanism, models.mesh, by_beams.port, by_beams.held)
        return _of_linear_theory(layout, end, linear, opening, change)
    return _followed(models, models.mesh, by_beams)


def _change(end: PathEnd, strength: float) -> float:
    """Return the largest relative change of the force, and of the stress at yield, by beams."""
    changes = [end.force / end.displacement / end.linear[0] - 1]
    if end.kind == YIELD:
        changes.append(abs(end.displacement) * end.linear[1] / strength - 1)
    return float(np.max(np.abs(changes)))


def _followed(
    models: _Models,
    mesh: Mesh,
    by_beams: _ByBeams,
) -> RangeEnd:
    """Return an end of finite elements, which are solved until it is close to their displacement."""
    end = by_beams.end
    layout = models.mechanism.layout
    powers = np.maximum(end.exponents, [-np.inf, LEAST_POWER])
    x = end.displacement * (BEFORE_CONTACT if end.kind == CONTACT else 1.0)
    before: tuple[float, Array] | None = None
    for _ in range(MOST_CHECKS):
        at = _finite(models, mesh, by_beams, x)
        values = by_beams.linear.slopes * at.ratios * abs(x)
        if before is not None:
            powers = _powers(before, (x, values))
        steps = _steps(layout, end, at, values, powers)
        kind = min(steps, key=lambda limit: steps[limit])
        step = steps[kind]
        if abs(step - 1) < CLOSE:
            break
        before = (x, values)
        x = x * step
    if abs(step - 1) > UNFINISHED:
        raise ComputationFailed("finite elements do not come near the end of the range")
    if kind == YIELD:
        at = at._replace(peaks=at.peaks * layout.yield_strength / at.peaks.max())
    return _ended(end, by_beams.linear, at, powers, (x, step, kind))


class _Finite(NamedTuple):
    """Finite elements at a displacement, beside linear theory.

    ratios : force, highest stress of hinges and of bodies (3,) over those of linear theory.
    spread : possible errors.
    peaks, bodies : highest stress of every hinge (h,) and moving body (b,), MPa.   motions : (k,),
    of the ports.
    contact : displacement at which the parts touch that do by beams, over the displacement; nan
    without such parts."""

    ratios: Array
    spread: Array
    peaks: Array
    bodies: Array
    motions: Array
    contact: float


def _powers(before: tuple[float, Array], after: tuple[float, Array]) -> Array:
    """Return force and highest stress of hinges (2,) as powers of the displacement between two of
    finite elements.

    Those of beams do not hold where bodies are soft and a limit point is near.
    """
    x, values = before
    farther, more = after
    found = np.log(more[:2] / values[:2]) / np.log(farther / x)
    return np.asarray(np.maximum(found, [-np.inf, LEAST_POWER]))


def _steps(
    layout: Layout, end: PathEnd, at: _Finite, values: Array, powers: Array
) -> dict[str, float]:
    """Return the displacements of all limits over that of finite elements.

    values : force and highest stress of hinges and of bodies (3,) there.   powers : (2,), of force
    and hinge stress."""
    strength = layout.yield_strength
    steps = {YIELD: float((strength / values[1]) ** (1 / powers[1]))}
    if values[2] > 0:
        steps[BODY_YIELD] = float((strength / values[2]) ** (1 / max(powers[0], LEAST_POWER)))
    if end.kind == CONTACT:
        steps[CONTACT] = at.contact
    opened = _opened(layout, at.motions)
    if opened > 0:
        steps[STROKE] = 1 / opened
    return steps


def _opened(layout: Layout, motions: Array) -> float:
    """Return the largest opening of the actuators over their strokes, 0 without one, from motions
    (k,) of the ports.
    """
    shares = [
        float(motions[port]) / one.stroke
        for port, one in zip(layout.drive_ports, layout.actuators, strict=True)
    ]
    return max([0.0, *shares])


def _opening(
    mechanism: Mechanism,
    mesh: Mesh,
    port: int,
    held: Sequence[int],
) -> Array:
    """Return the motions (k,) of all ports per displacement of one, by linear finite elements on
    the coarsest mesh.
    """
    C = solved(mechanism, levels(mesh.resolution)[0]).compliance
    return np.asarray(C @ _unit_displacement(C, port, held))


def _of_linear_theory(
    layout: Layout, end: PathEnd, linear: _Linear, opening: Array, change: float
) -> RangeEnd:
    """Return an end by linear theory, which holds there but for a relative change.

    opening : (k,), motions of the ports per displacement of the driven one.
    """
    sign = np.sign(end.displacement)
    stress = linear.slopes[1:]
    reached = {
        kind: layout.yield_strength / each
        for kind, each in zip((YIELD, BODY_YIELD), stress, strict=True)
        if each
    }
    widths = {YIELD: linear.bands[1], BODY_YIELD: linear.bands[2]}
    opened = _opened(layout, sign * opening)
    if opened > 0:
        reached[STROKE] = 1 / opened
    if end.kind == CONTACT:
        reached[CONTACT] = abs(end.displacement)
    kind = min(reached, key=lambda limit: reached[limit])
    x = reached[kind]
    force = linear.slopes[0] * x
    width = widths.get(kind, linear.bands[0] + OF_THE_MESH) + change
    peaks = end.at.stress
    if kind == STROKE:
        end = end._replace(parts=drive_at_stroke(layout, sign * x * opening))
    return RangeEnd(
        sign * x,
        sign * force,
        x * width,
        force * (width + linear.bands[0]),
        kind,
        int(np.argmax(peaks)),
        peaks * min(1.0, x / abs(end.displacement)),
        True,
        end.parts,
        linear.body,
    )


def _ended(
    end: PathEnd, linear: _Linear, at: _Finite, powers: Array, reached: tuple[float, float, str]
) -> RangeEnd:
    """Return an end near finite elements.

    reached : displacement of these, that of the limit over it, and the kind of the limit.
    """
    x, step, kind = reached
    errors = np.array([OF_THE_MESH, OF_THE_PEAK, OF_THE_PEAK]) * np.minimum(
        1.0, np.abs(at.ratios - 1)
    )
    widths = linear.bands + at.spread + errors
    relative = {YIELD: widths[1] / powers[1], BODY_YIELD: widths[2] / max(powers[0], LEAST_POWER)}
    left = abs(step - 1)
    width = relative.get(kind, OF_THE_MESH + linear.bands[0]) + left * (
        OF_THE_STEP if left < CLOSE else 1.0
    )
    force = linear.slopes[0] * at.ratios[0] * x * step ** powers[0]
    return RangeEnd(
        x * step,
        force,
        abs(x * step) * width,
        abs(force) * (abs(powers[0]) * width + widths[0]),
        kind,
        int(np.argmax(at.peaks)),
        at.peaks,
        parts=end.parts,
        body=int(np.argmax(at.bodies)) if at.bodies.size else 0,
    )


def _without_numbers(kind: str, end: PathEnd) -> RangeEnd:
    """Return an end whose numbers are not known; the hinge is that with the highest stress by
    beams.
    """
    stress = end.at.stress
    nothing = np.full(len(stress), np.nan)
    return RangeEnd(np.nan, np.nan, np.nan, np.nan, kind, int(np.argmax(stress)), nothing)


def _of_buckling(end: PathEnd, linear: _Linear) -> RangeEnd:
    """Return where beams buckle; they lack the compliance of bodies, which is seen in the stiffness
    at rest.
    """
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


def _finite(
    models: _Models,
    mesh: Mesh,
    by_beams: _ByBeams,
    x: float,
) -> _Finite:
    """Return what finite elements find at a displacement x near an end, in three dimensions by the
    change of beams.
    """
    port, held, end, _ = by_beams
    level = levels(mesh.resolution)[0]
    model = model_of(models.mechanism, level)
    response = responses(models.mechanism, solved(models.mechanism, level))
    slopes = slopes_of(model.layout, response, port, held)
    plane = _ratios(models.plane, by_beams, x)
    at = _on_the_path_of_beams(model, by_beams, x, slopes[0] * plane.ratios[0])
    field = at.fields[-1]
    peaks, bodies = _compared_stress(model, field)
    highest = np.array([peaks.max(), np.max(bodies, initial=0.0)]) / abs(x)
    values = np.array([at.load[-1, port] / x, *highest])
    contact = np.nan
    if end.kind == CONTACT:
        contact = _contact(model, models.beams, by_beams, (x, field))
    ratios = values / np.where(slopes, slopes, 1.0)
    found = _Finite(ratios, np.zeros(3), peaks, bodies, at.pose[-1], contact)
    if models.beams is models.plane:
        return found
    return _thickened(found, plane, _ratios(models.beams, by_beams, x))


def _softened(end: PathEnd) -> float:
    """Return the force at an end over that of linear theory."""
    return float(end.force / (end.displacement * end.linear[0]))


def _bows(end: PathEnd) -> bool:
    """Whether parts nearly buckle on the path to an end, and bow beyond: another path is near."""
    weaker = end.softest < BOWING and _softened(end) < 1 / SAME_PATH
    return end.kind != BUCKLING and (end.softest < NEARLY_BUCKLING or weaker)


def _on_the_path_of_beams(
    model: PlateModel,
    by_beams: _ByBeams,
    x: float,
    expected: float,
) -> Equilibria:
    """Return equilibria of finite elements along the path of beams, up to a displacement x.

    expected : force per displacement there, by the change of beams.

    Past the place where parts nearly buckle, a step too large leads to the path on which they stay
    straight, which is unstable: there finite elements follow in steps.

    Raises ComputationFailed where they are on another path even with the smallest steps.
    """
    port, held, end, _ = by_beams
    for steps in STEPS_TO_BUCKLING if _bows(end) else (0,):
        targets = _targets(end, x, steps)
        motions = np.zeros((len(targets), 1 + len(held)))
        motions[:, 0] = targets
        at = driven(model, [port, *held], motions)
        ratio = at.load[-1, port] / x / expected
        if 1 / SAME_PATH < ratio < SAME_PATH:
            return at
    raise ComputationFailed("finite elements and beams are on different paths of equilibria")


def _targets(
    end: PathEnd,
    x: float,
    steps: int,
) -> list[float]:
    """Return displacements up to x, with a number of steps to where beams nearly buckle."""
    if steps == 0:
        return [x]
    step = end.softest_at / steps
    targets = list[float]()
    at = step
    while abs(at) < abs(x):
        targets.append(at)
        at += step
        if abs(at) > FINE_STEPS * abs(end.softest_at):
            step *= LATER_STEPS
    return [*targets, x]


def _compared_stress(model: PlateModel, field: Array) -> tuple[Array, Array]:
    """Return the highest stress of hinges (h,) and moving bodies (b,), MPa, as of one material."""
    of_hinges, of_bodies = stress_in_parts(model, field)
    return of_hinges * model.layout.hinge_shares, of_bodies * model.layout.body_shares


def _thickened(
    found: _Finite,
    plane: _BeamRatios,
    solid: _BeamRatios,
) -> _Finite:
    """Return finite elements in three dimensions, by the change of beams from plane ones."""
    change = (solid.ratios / plane.ratios)[[0, 1, 0]]  # the stress in bodies follows the force
    return found._replace(
        ratios=found.ratios * change,
        spread=OF_THE_THICKNESS * np.abs(change - 1),
        peaks=found.peaks * solid.stress / plane.stress,
    )


class _BeamRatios(NamedTuple):
    """Force and highest stress (2,) of beams over those of linear theory, and stress (h,), MPa."""

    ratios: Array
    stress: Array


def _ratios(
    beams: DrivenPlate,
    by_beams: _ByBeams,
    x: float,
) -> _BeamRatios:
    """Return the ratios of beams at a displacement. Raises ComputationFailed."""
    port, held, _, _ = by_beams
    reached = beams.reached(port, held, x)
    if reached is None:
        raise ComputationFailed("the beams find no equilibrium at the end of the range")
    stress = beams.stress(reached.unknowns)
    values = np.array([reached.forces[port] / x, stress.max() / abs(x)])
    return _BeamRatios(values / beams.slopes(port, held, x), stress)


def _contact(
    model: PlateModel, beams: DrivenPlate, by_beams: _ByBeams, reached: tuple[float, Array]
) -> float:
    """Return the displacement of contact over that of finite elements; their gap closes as that of
    beams.

    reached : displacement of finite elements, mm or rad, and their field (n, 2), mm.
    """
    x, field = reached
    end = by_beams.end
    parts = len(model.layout.bodies) + len(model.layout.joints)
    if end.touching is None or max(end.touching) >= parts:
        return end.displacement / x  # of a hinge and its own body, which meet in the mesh
    at = beams.reached(by_beams.port, by_beams.held, x)
    gap = gap_of_parts(model, field, end.touching)
    if at is None or gap == 0:
        return BEFORE_CONTACT
    closing = beams.clearance.gap(at.unknowns, end.touching).width
    return 1 + gap / closing * (end.displacement / x - 1)
