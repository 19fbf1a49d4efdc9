"""Large displacements of a mechanism, with finite rotations: beams and plane finite elements.

Its output is driven along one direction, or is under growing dead loads. Driven, the whole curve of
force against displacement is followed, also where it is not stable."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from flexfem import arguments
from flexfem.analytic.finite import displaced
from flexfem.analytic.plates import beam_compliances, respond
from flexfem.arrays import Array
from flexfem.fem.nonlinear import equilibria
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.bands import corner_bands, levels
from flexfem.questions.curve import NUMBERS, Traced, by_beams, element_values, numbers_of
from flexfem.questions.plates import ON_MESHES, PEAK, model_of, solved
from flexfem.questions.setup import Mesh, answer, mesh_of, on_meshes, options
from flexfem.refused import BadInput
from flexfem.results import ELEMENTS, SOLVED, Progress, Quantity, Result
from flexfem.units import DIRECTIONS, UNITS, Direction, in_unit

AMPLITUDE = 0.5  # mm: ten times the workspace that examples/claims.py assumes
RESOLUTION = 4  # with 8, compliances of a stage change by up to 0.09 %
# of the largest eigenvalue of a compliance, where motions of ports depend on each other
ROUND_OFF = 1e-12
UNSTABLE = "an equilibrium is not stable under dead loads"
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the load, or of the displacement
LINEAR = "linear"
BEAMS = "beams"
# relative difference of compliances along x and y, up to which x counts as the softest direction: by
# symmetry they may be equal, and round-off would choose
EQUALLY_SOFT = 1e-6


class Large(Result):
    """Displacement of the output, linear and with finite rotations by both models."""

    kind_name = "mechanism_large"
    title = "large displacements"
    main_result = ("pose", {"load": "100 %"})
    figure = "large.large_figure"
    labels: ClassVar = {"load": tuple(f"{100 * share:g} %" for share in SHARES)}
    footnotes = (
        "linear: the analytic model with rigid bodies and hinges in the plane, or finite elements "
        "of a plate without hinges; beams: the same with hinges as beams at finite rotations; "
        "finite elements: plane, with elastic bodies, at finite rotations",
        "the rotation of the output is that of the rigid motion nearest to the motion of its "
        "contact",
    )
    force = Quantity(
        "load on the output", "wrench", ("load", "direction"), SOLVED, "wrench", detail=True
    )
    driving = Quantity(
        "force that drives the output",
        "wrench",
        ("load", "theory", "direction"),
        ON_MESHES,
        "wrench",
        note="the output is driven along one direction, with the other directions free",
    )
    pose = Quantity(
        "displacement of the output", "motion", ("load", "theory", "direction"), ON_MESHES, "pose"
    )
    stiffness = Quantity(
        "tangent stiffness, other directions free",
        "stiffness",
        ("load", "theory", "direction"),
        ON_MESHES,
    )
    strain = Quantity("largest strain of finite elements", "", ("load",), PEAK, "all", shown=False)
    event_pose = Quantity(
        "displacement of the output at points of the curve",
        "motion",
        ("event", "theory", "direction"),
        ON_MESHES,
        "pose",
        note=(
            "limits of the force and of the displacement along the curve, positions without "
            "force, and buckling of what is not driven"
        ),
    )
    event_force = Quantity(
        "force that drives the output at points of the curve",
        "wrench",
        ("event", "theory", "direction"),
        ON_MESHES,
        "wrench",
    )
    event_pivots = Quantity(
        "negative pivots of the tangent stiffness at points of the curve",
        "",
        ("event", "theory"),
        shown=False,
    )
    curve_pose = Quantity(
        "displacement of the output along the curve",
        "motion",
        ("step", "theory", "direction"),
        ON_MESHES,
        "pose",
        shown=False,
    )
    curve_force = Quantity(
        "force that drives the output along the curve",
        "wrench",
        ("step", "theory", "direction"),
        ON_MESHES,
        "wrench",
        shown=False,
    )
    curve_pivots = Quantity(
        "negative pivots of the tangent stiffness along the curve",
        "",
        ("step", "theory"),
        shown=False,
        note="under the dead load: zero where the equilibrium is stable",
    )


@options()
def large(
    mechanism: Mechanism,
    *,
    amplitude: float | str = AMPLITUDE,
    along: Direction | None = None,
    force: tuple[float, float, float] | None = None,
    models: Literal["both", "analytic"] = "both",
    resolution: int | None = None,
    progress: Progress | None = None,
) -> Large:
    """Motion, force and stiffness at large displacements, and the error of linear theory there.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism, of a mechanism file or of a stage file.
    amplitude : float or str
        Largest displacement of the output, mm, along its softest translation, or an angle with its
        unit, such as "5deg", by which it is turned; against the direction if negative. Of a stage
        the largest displacement along x and y, mm; about theta 0.02 rad for every mm.
    along : {"x", "y", "theta"}, optional
        Direction along which the output is driven, with the other directions free; by default its
        softest translation. Not of a stage file.
    force : tuple of float, optional
        Largest load on the output, N and N mm, instead of the amplitude. Not of a stage file.
    models : {"both", "analytic"}
        "both" adds nonlinear finite elements to the analytic model.
    resolution : int, optional
        Triangles across every neck.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    Large
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        mechanism_large` lists it. Of a stage file a result of kind `large`.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.

    Examples
    --------
    >>> import flexfem
    >>> found = flexfem.large(flexfem.load("geometry/mobility6.toml"), models="analytic")
    >>> round(float(found.at("error", direction="x", at="+100 %", theory="exact")), 3)  # per cent
    0.36
    """
    mesh = mesh_of(mechanism, models, resolution, None, usual=RESOLUTION)
    if force is None:
        return _driven(mechanism, amplitude, along, mesh, progress)
    if along is not None:
        raise BadInput("along and force, expected one of the two")
    load = arguments.forces("force", force, 1)
    return _loaded(mechanism, np.ravel(load), mesh, progress)


def _at_rest(mechanism: Mechanism, mesh: Mesh | None) -> Array:
    """Return the compliance (k, k) at rest by the analytic network, with hinges in the plane as the
    beams are, or by finite elements of a plate without hinges.
    """
    layout = mechanism.layout
    if layout.joints:
        return respond(layout, hinges=beam_compliances(layout)).compliance
    assert mesh is not None
    return solved(mechanism, mesh.resolution).compliance


class _UnderLoads(NamedTuple):
    """Equilibria under s dead loads by one theory.

    pose : (s, 3), of the output.   tangent : (s, k, k), compliance of the ports.
    stable : whether all are.   strain : (s,), of finite elements.
    pose_band, stiffness_band : (s, 3), nan where none are known.
    """

    pose: Array
    tangent: Array
    stable: bool = True
    strain: Array | None = None
    pose_band: Array | None = None
    stiffness_band: Array | None = None


def _loaded(
    mechanism: Mechanism, force: Array, mesh: Mesh | None, progress: Progress | None
) -> Large:
    """Return the displacements under a growing dead load (3,) on the output."""
    layout = mechanism.layout
    C = _at_rest(mechanism, mesh)
    loads = np.zeros((len(SHARES), len(C)))
    loads[:, :3] = np.outer(SHARES, force)
    found = {LINEAR: _UnderLoads(loads @ C[:, :3], np.broadcast_to(C, (len(loads), *C.shape)))}
    if layout.joints:
        beams = displaced(layout, loads)
        stable = bool(np.all(beams.stable))
        found[BEAMS] = _UnderLoads(beams.motions[:, :3], beams.compliance, stable)
    if mesh is not None:
        found[ELEMENTS] = _by_elements(mechanism, loads, mesh, progress)
    values = {
        "force": loads[:, :3],
        "pose": np.stack([one.pose for one in found.values()], axis=1),
        "stiffness": np.stack([_along(one.tangent) for one in found.values()], axis=1),
    }
    bands = dict[str, Array]()
    last = list(found.values())[-1]
    if last.strain is not None:
        values["strain"] = last.strain
        for name, width in (("pose", last.pose_band), ("stiffness", last.stiffness_band)):
            bands[name] = np.full_like(values[name], np.nan)
            bands[name][:, -1] = width
    stable = all(one.stable for one in found.values()) and _is_stable(last.tangent)
    warnings = [] if stable else [UNSTABLE]
    labels = {"theory": tuple(found)}
    return answer(Large, mechanism, {}, mesh, {}, values, labels, bands, warnings=warnings)


def _by_elements(
    mechanism: Mechanism, loads: Array, mesh: Mesh, progress: Progress | None
) -> _UnderLoads:
    """Solve three meshes under loads (s, k) on the ports."""
    steps = levels(mesh.resolution)
    each = on_meshes(steps, lambda level: equilibria(model_of(mechanism, level), loads), progress)
    sizes = np.array(steps, dtype=float)
    poses = np.array([one.pose[:, :3] for one in each])
    stiffness = np.array([_along(one.compliance) for one in each])
    return _UnderLoads(
        poses[-1],
        each[-1].compliance,
        strain=each[-1].strain,
        pose_band=corner_bands(sizes, poses),
        stiffness_band=corner_bands(sizes, stiffness),
    )


def _is_stable(tangent: Array) -> bool:
    """Whether no tangent compliance (s, k, k) has a negative eigenvalue."""
    ends = np.linalg.eigvalsh(tangent)
    return bool(np.all(ends[:, 0] > -ROUND_OFF * ends[:, -1]))


def _along(compliance: Array) -> Array:
    """Return the stiffness (s, 3) along every direction of the output, the others free."""
    return np.asarray(1 / np.diagonal(compliance, axis1=1, axis2=2)[:, :3])


def _driven(
    mechanism: Mechanism,
    amplitude: float | str,
    along: Direction | None,
    mesh: Mesh | None,
    progress: Progress | None,
) -> Large:
    """Return the curve of the force that drives the output along one direction, the others free."""
    C = _at_rest(mechanism, mesh)
    port, size = _commanded(amplitude, along, C)
    motions = size * np.array(SHARES)
    traced = dict[str, Traced]()
    if mechanism.layout.joints:
        traced[BEAMS] = by_beams(mechanism.layout, port, motions)
    if mesh is not None:
        traced[ELEMENTS] = element_values(mechanism, mesh, port, motions, progress)
    curves = _Curves.of(traced)
    curves.add_linear(C, port, motions)
    for number, one in enumerate(traced.values(), start=1):
        curves.add(number, one)
    values = curves.values()
    if ELEMENTS in traced:
        values["strain"] = _strain(traced[ELEMENTS])
    bands = {name: array for name, array in _named(curves.widths).items() if name in values}
    warnings = _warned(traced, port, size)
    labels = curves.labels()
    return answer(Large, mechanism, {}, mesh, {}, values, labels, bands, warnings=warnings)


def _strain(traced: Traced) -> Array:
    """Return the largest strain at the shares of the displacement, nan beyond the end of the curve."""
    strain = np.full(len(SHARES), np.nan)
    strain[: len(traced.shares)] = [point.strain for point in traced.shares]
    return strain


class _Curves(NamedTuple):
    """Numbers along a port by all theories, nan beyond the end of a curve.

    at, widths : values and bands (places, theories, NUMBERS) of `numbers_of` by kind of place:
    share, event and curve.   pivots : (places, theories), negative pivots.
    """

    theories: list[str]
    events: list[str]
    at: dict[str, Array]
    widths: dict[str, Array]
    pivots: dict[str, Array]

    @classmethod
    def of(cls, traced: Mapping[str, Traced]) -> _Curves:
        """Return places for linear theory and for traced curves."""
        theories = [LINEAR, *traced]
        events = list(dict.fromkeys(label for one in traced.values() for label in one.events))
        steps = max(len(one.curve.points) for one in traced.values())
        counts = {"share": len(SHARES), "event": len(events), "curve": steps}
        at = {
            name: np.full((count, len(theories), NUMBERS), np.nan) for name, count in counts.items()
        }
        widths = {name: np.full_like(array, np.nan) for name, array in at.items()}
        pivots = {name: np.full(at[name].shape[:2], np.nan) for name in ("event", "curve")}
        return cls(theories, events, at, widths, pivots)

    def add_linear(
        self,
        compliance: Array,
        port: int,
        motions: Array,
    ) -> None:
        """Add linear theory at motions (s,) of a port."""
        pushed = np.zeros((len(motions), 3))
        pushed[:, port] = motions / compliance[port, port]
        self.at["share"][:, 0, :3] = pushed @ compliance[:3, :3]
        self.at["share"][:, 0, 3:6] = pushed
        self.at["share"][:, 0, 6:] = 1 / np.diag(compliance)[:3]

    def add(
        self,
        theory: int,
        traced: Traced,
    ) -> None:
        """Add a traced curve as a theory by its number."""
        for number, point in enumerate(traced.shares):
            self.at["share"][number, theory] = numbers_of(point)
        self.widths["share"][: len(traced.shares), theory] = traced.share_bands
        for number, point in enumerate(traced.curve.points):
            self.at["curve"][number, theory] = numbers_of(point)
            self.pivots["curve"][number, theory] = point.unstable
        for name, point in traced.events.items():
            number = self.events.index(name)
            self.at["event"][number, theory] = numbers_of(point)
            self.pivots["event"][number, theory] = point.unstable
        for name, band in traced.event_bands.items():
            self.widths["event"][self.events.index(name), theory] = band

    def values(self) -> dict[str, Array]:
        """Return the values by quantity; those of events only if there are some."""
        found = _named(self.at) | {f"{name}_pivots": one for name, one in self.pivots.items()}
        if self.events:
            return found
        return {name: array for name, array in found.items() if not name.startswith("event")}

    def labels(self) -> dict[str, list[str]]:
        """Return the labels of the axes."""
        steps = [str(k) for k in range(len(self.at["curve"]))]
        return {"theory": self.theories, "event": self.events, "step": steps}


def _named(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return arrays of `numbers_of` points by the names of their quantities."""
    pose = slice(0, 3)
    driving = slice(3, 6)
    stiffness = slice(6, 9)
    return {
        "pose": arrays["share"][..., pose],
        "driving": arrays["share"][..., driving],
        "stiffness": arrays["share"][..., stiffness],
        "event_pose": arrays["event"][..., pose],
        "event_force": arrays["event"][..., driving],
        "curve_pose": arrays["curve"][..., pose],
        "curve_force": arrays["curve"][..., driving],
    }


def _warned(
    traced: Mapping[str, Traced],
    port: int,
    size: float,
) -> list[str]:
    """Warn of unstable equilibria, of curves that end early, and of events that one theory alone
    has.
    """
    unit = "rad" if port == 2 else "mm"
    found = list[str]()
    for label, one in traced.items():
        points = one.curve.points
        unstable = [point.motions[port] for point in points if point.unstable]
        if unstable:
            found.append(
                f"{label}: from {unstable[0]:.4g} to {unstable[-1]:.4g} {unit} equilibria are not "
                "stable under the dead load: the mechanism snaps"
            )
        if any(name.startswith("buckling") for name in one.events):
            found.append(f"{label}: beyond buckling the curve is that without it, and not stable")
        if not one.curve.complete:
            reason = "no equilibrium is found beyond it"
            if label == ELEMENTS:
                reason += (
                    f", or the largest strain, {points[-1].strain:.2g} there, exceeds that of the "
                    "material law"
                )
            end = points[-1].motions[port]
            found.append(f"{label}: the curve ends at {end:.4g} of {size:.4g} {unit}: {reason}")
    if len(traced) == 2:
        beams, elements = (set(one.events) for one in traced.values())
        apart = sorted(beams ^ elements)
        if apart:
            found.append(f"beams and finite elements do not both find: {', '.join(apart)}")
    return found


def _commanded(
    amplitude: float | str, along: Direction | None, compliance: Array
) -> tuple[int, float]:
    """Return the port and the displacement, mm or rad, of an amplitude.

    It is an angle, or a length of the softest port. Raises BadInput.
    """
    if isinstance(amplitude, str) and not _is_length(amplitude):
        return 2, _angle(amplitude, along)
    if along == "theta":
        raise BadInput(
            f"amplitude {amplitude!r} along theta, expected an angle with its unit, such as 5deg"
        )
    size = length_of(amplitude) if isinstance(amplitude, str) else amplitude
    magnitude = abs(size) if isinstance(size, int | float) else size
    arguments.between("amplitude", magnitude, 1e-6, 1e4, " mm")
    along_x, along_y = np.diag(compliance)[:2]
    softest = 1 if along_y > (1 + EQUALLY_SOFT) * along_x else 0
    return softest if along is None else DIRECTIONS.index(along), float(size)


def _angle(amplitude: str, along: Direction | None) -> float:
    """Return an angle, rad, with its unit. Raises BadInput along a translation."""
    if along not in (None, "theta"):
        raise BadInput(
            f"amplitude {amplitude!r} along {along}, expected a length with its unit, such as 3mm"
        )
    try:
        angle = in_unit(amplitude, UNITS["rad"])
    except ValueError:
        expected = "expected a length or an angle with its unit, such as 3mm or 5deg"
        raise BadInput(f"amplitude {amplitude!r}, {expected}") from None
    arguments.between("amplitude", abs(angle), 1e-9, 10.0, " rad")
    return angle


def _is_length(text: str) -> bool:
    with suppress(ValueError):
        in_unit(text, UNITS["mm"])
        return True
    return False


def length_of(text: str) -> float:
    """Return a length, mm, with its unit. Raises BadInput."""
    try:
        return in_unit(text, UNITS["mm"])
    except ValueError as error:
        raise BadInput(f"amplitude {error}") from None
