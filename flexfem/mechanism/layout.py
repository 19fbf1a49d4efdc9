"""A plate mechanism as models use it: bodies, hinges, ports and loads with all parameters and
copies resolved.

Points are complex, mm; angles rad; forces N. The analytic network and the finite elements both read
a `Layout`, and nothing else of a mechanism. Both compute the response to unit loads on its ports.
"""

from __future__ import annotations

import cmath
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np

from flexfem.arrays import AnyArray, Array
from flexfem.mechanism.outlines import Segment
from flexfem.mechanism.profile import Profile

# fields with a leading axis of designs
NUMBERS = ("stiffness", "preload", "blocking_force", "lowest", "highest")
PointOrPoints = TypeVar("PointOrPoints", complex, AnyArray)


class Move(NamedTuple):
    """A rotation with a shift, `factor z + shift`, or with a mirror image, `factor conj(z) +
    shift`.
    """

    factor: complex = 1.0
    shift: complex = 0.0
    mirrored: bool = False

    def __call__(self, z: PointOrPoints) -> PointOrPoints:
        return self.factor * (z.conjugate() if self.mirrored else z) + self.shift

    def after(self, first: Move) -> Move:
        """Return the move that is `first` and then this one."""
        factor = first.factor.conjugate() if self.mirrored else first.factor
        return Move(self.factor * factor, self(first.shift), self.mirrored != first.mirrored)

    def heading(self, angle: float) -> float:
        """Return the moved direction, rad."""
        return cmath.phase(self.factor * cmath.exp(-1j * angle if self.mirrored else 1j * angle))

    @property
    def of_twists(self) -> Array:
        """Matrix (3, 3) from twists x, y, rotation at the global origin to moved ones there."""
        a = self.factor
        b = self.shift
        side = -1.0 if self.mirrored else 1.0
        return np.array(
            [
                [a.real, -side * a.imag, side * b.imag],
                [a.imag, side * a.real, -side * b.real],
                [0, 0, side],
            ]
        )


UNMOVED = Move()


class Constants(NamedTuple):
    """Constants of a material as the plane problem has them.

    youngs_modulus : MPa, and poissons_ratio, of the plane problem.   density : tonne/mm^3.
    yield_strength : MPa.
    out_of_plane : as of `Layout`.   expansion : 1/K, of the material itself; None where it is not
    stated.
    name : of the material, for drawings; empty for that of the plate.
    """

    youngs_modulus: float
    poissons_ratio: float
    density: float
    yield_strength: float
    out_of_plane: float = 0.0
    expansion: float | None = None
    name: str = ""


class Body(NamedTuple):
    """A body of the plate before hinges are cut into it.

    outline : closed counter-clockwise loop.   holes : closed clockwise loops inside it.
    fixed : whether the body is rigid ground.   clamped : segments of the outline that are clamped,
    of an elastic body.
    width : of a bar along a path, mm; None for a body with an outline.
    key : key path of the body in the file, for refusals.   material : its own, None for that of the
    plate.
    """

    name: str
    outline: tuple[Segment, ...]
    holes: tuple[tuple[Segment, ...], ...] = ()
    fixed: bool = False
    clamped: tuple[int, ...] = ()
    width: float | None = None
    key: str = ""
    material: Constants | None = None


class Joint(NamedTuple):
    """A hinge between two bodies, its centre and the direction of its axis from the first to the
    second body, rad.

    Within the length of the profile the hinge replaces the material of both bodies over the height
    `cut`, mm, zero where the bodies end at the hinge.   material : its own, None for that of the
    plate.
    """

    name: str
    bodies: tuple[int, int]
    place: complex
    heading: float
    profile: Profile
    cut: float
    key: str = ""
    material: Constants | None = None

    @property
    def sided(self) -> tuple[Profile, complex]:
        """Profile that is the same for mirror images of the hinge, and the direction to its left.

        The direction is 0 if the profile is symmetric.
        """
        if self.profile.symmetric:
            return self.profile, 0j
        same = max(self.profile, self.profile.mirrored, key=hash)
        left = 1j * cmath.exp(1j * self.heading)
        return same, left if same == self.profile else -left


class Patch(NamedTuple):
    """A point of a body where a load acts and where its motion is read.

    The load is distributed over the part of the body within `radius` mm of the point, or over the
    whole body for None, in proportion to the area, with the resultant force and moment about the
    point. The motion is the displacement and rotation conjugate to this load, which is a mean over
    the same part of the body.

    body : index, or -1 for the ground outside the plate, which does not move.
    """

    body: int
    point: complex
    radius: float | None = None


class Port(NamedTuple):
    """A scalar load and the displacement conjugate to it.

    label : such as `output x`.   rotation : whether the displacement is an angle, rad per N mm,
    instead of mm per N.
    parts : contacts with the force x, y and the moment (3,) on each for a unit load.
    """

    label: str
    rotation: bool
    parts: tuple[tuple[Patch, tuple[float, float, float]], ...]


class LinearActuator(NamedTuple):
    """An actuator between two contacts: a force of the actuator pushes both apart along their line.

    contacts : on the carrying body or ground, and on the driven body.   direction : unit vector of
    the force on the driven body.   stiffness : N/mm.   stroke : free stroke, mm.   blocking_force :
    N.   mass : tonne, half at each one.
    preload : N, force at rest.
    """

    name: str
    contacts: tuple[Patch, Patch]
    direction: complex
    stiffness: float
    stroke: float
    blocking_force: float
    mass: float = 0.0
    key: str = ""
    preload: float = 0.0


class PayloadMass(NamedTuple):
    """A rigid payload: mass, tonne, and moment of inertia about the normal through the point, tonne
    mm^2.
    """

    contact: Patch
    mass: float
    inertia: float


class Payload(NamedTuple):
    """Payload of the platform, with its centre of mass at the platform centre and in the mid-plane.

    mass : tonne.   inertia, tilting : tonne mm^2, about the normal of the stage and about every
    axis in its mid-plane.
    """

    mass: float = 0.0
    inertia: float = 0.0
    tilting: float = 0.0

    @property
    def matrix(self) -> Array:
        """Mass matrix (3, 3), tonne, tonne mm^2, at the platform centre."""
        return np.diag([self.mass, self.mass, self.inertia])


class ActuatorSet(NamedTuple):
    """The stacks (n) of a stage, or the actuators of a mechanism, and the commands (m) that drive
    them.

    For many designs, the numbers have a leading axis of designs; the stacks and their names are
    common to all designs.

    stacks : of a stage, each a `contacts.Stack`, chain by chain, actuator by actuator.   names :
    (m,), of the commands.
    stiffness : (..., n), N/mm, of stack and contact in series.   preload, blocking_force : (...,
    n), N.
    differential : (n, m), stroke of each stack relative to rest per command: 1, and -1 for the
    partner of a pair.
    lowest, highest : (..., m), mm, limits of the commands by stroke; a pair rests at half its
    stroke.
    friction : (n,), coefficient at each contact, nan where it is not stated; empty for a mechanism.
    """

    stacks: tuple[Any, ...]
    names: tuple[str, ...]
    stiffness: Array
    preload: Array
    blocking_force: Array
    differential: Array
    lowest: Array
    highest: Array
    friction: Array = np.zeros(0)

    def at(self, which: AnyArray | int | None) -> ActuatorSet:
        """Select the numbers of one design or of designs (k,).

        None adds a leading axis of length one.
        """
        return self._replace(**{name: getattr(self, name)[which] for name in NUMBERS})

    @property
    def rubbing(self) -> tuple[int, ...]:
        """Indices of the stacks whose contacts have a stated friction coefficient."""
        return tuple(np.flatnonzero(~np.isnan(self.friction)).tolist())


class Layout(NamedTuple):
    """A mechanism with all parameters and copies resolved.

    thickness : mm.   elastic : Young's modulus, MPa, and Poisson's ratio of the plane problem.
    density : tonne/mm^3.
    points : named contacts to read, the output first.
    out_of_plane : ratio of the stress out of the plane to the sum of those in it: Poisson's ratio
    in plane strain.
    residual_stress : MPa, in all directions of the plane, before the plate is released from what
    holds its bodies.
    wide : whether hinges are in three dimensions, between plane stress and plane strain.
    expansion : of the material, 1/K, None where it is not stated.
    Material constants are those of parts without a material of their own, see `materials`.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    thickness: float
    youngs_modulus: float
    poissons_ratio: float
    density: float
    yield_strength: float
    points: tuple[tuple[str, Patch], ...]
    actuators: tuple[LinearActuator, ...] = ()
    payloads: tuple[PayloadMass, ...] = ()
    out_of_plane: float = 0.0
    residual_stress: float = 0.0
    expansion: float | None = None
    wide: bool = False

    @property
    def mixed(self) -> bool:
        """Whether a part has a material of its own."""
        return any(part.material is not None for part in self.parts)

    @property
    def parts(self) -> list[Body | Joint]:
        """All bodies, then all hinges."""
        return [*self.bodies, *self.joints]

    def material_of(self, part: Body | Joint) -> Constants:
        """Return the constants of the material of a body or hinge."""
        if part.material is not None:
            return part.material
        return Constants(
            self.youngs_modulus,
            self.poissons_ratio,
            self.density,
            self.yield_strength,
            self.out_of_plane,
            self.expansion,
        )

    @property
    def materials(self) -> tuple[Constants, ...]:
        """Constants of all bodies, then of all hinges."""
        return tuple(self.material_of(part) for part in self.parts)

    @property
    def hinge_strengths(self) -> Array:
        """Yield strengths (h,), MPa, of all hinges."""
        return np.array([self.material_of(joint).yield_strength for joint in self.joints])

    @property
    def hinge_shares(self) -> Array:
        """Yield strength of the plate over those (h,) of the hinges: stress times this yields at
        that of the plate.
        """
        return self.yield_strength / self.hinge_strengths

    @property
    def body_shares(self) -> Array:
        """The same (b,) of the bodies that are not fixed."""
        return self.yield_strength / self.body_strengths

    @property
    def body_strengths(self) -> Array:
        """Yield strengths (b,), MPa, of the bodies that are not fixed."""
        return np.array(
            [self.material_of(body).yield_strength for body in self.bodies if not body.fixed]
        )

    @property
    def ports(self) -> tuple[Port, ...]:
        """Ports: x, y and theta of every point, the output first, then the opening of every
        actuator.
        """
        units = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("theta", (0.0, 0.0, 1.0)))
        found = [
            Port(f"{name} {direction}", direction == "theta", ((contact, unit),))
            for name, contact in self.points
            for direction, unit in units
        ]
        for actuator in self.actuators:
            force = actuator.direction
            near, far = actuator.contacts
            parts = ((near, (-force.real, -force.imag, 0.0)), (far, (force.real, force.imag, 0.0)))
            found.append(Port(actuator.name, False, parts))
        return tuple(found)

    @property
    def drive_ports(self) -> list[int]:
        """Indices of the ports of the actuators."""
        return [3 * len(self.points) + k for k in range(len(self.actuators))]

    @property
    def preload(self) -> Array:
        """Load (k,) on the ports by the preloads of the actuators, N."""
        on_drives = [actuator.preload for actuator in self.actuators]
        return np.array([0.0] * (3 * len(self.points)) + on_drives)

    @property
    def lever(self) -> float:
        """Distance, mm, from the output to the farthest hinge of its body.

        A rotation times it is a displacement.
        """
        output = self.points[0][1]
        arms = [
            abs(joint.place - output.point) for joint in self.joints if output.body in joint.bodies
        ]
        return max(arms, default=0.0) or 1.0

    @property
    def drive(self) -> ActuatorSet:
        """Numbers of the actuators, whose commands are their strokes."""
        ratings = [
            (one.stiffness, 0.0, one.blocking_force, 0.0, one.stroke) for one in self.actuators
        ]
        stiffness, preload, blocking_force, lowest, highest = np.reshape(ratings, (-1, 5)).T
        names = tuple(actuator.name for actuator in self.actuators)
        return ActuatorSet(
            (), names, stiffness, preload, blocking_force, np.eye(len(names)), lowest, highest
        )


class End(NamedTuple):
    """The section where a hinge ends on a body, at -length / 2 of its axis on the first body,
    length / 2 on the second.

    The section moves as a rigid body.   hinge : index in `Layout.joints`.   far : whether on the
    second body.
    """

    hinge: int
    far: bool


Interface: TypeAlias = End | Patch


class ElasticBody(NamedTuple):
    """Compliance (3 c, 3 c) of a body at its c interfaces, interface by interface.

    Displacement x, y and rotation of every interface as a twist at the global origin, mm and rad,
    per wrench on the body at the global origin, N and N mm. The motion is relative to the ground
    for a body with clamped edges, else to the mean rigid motion of the body, that of `Patch(body,
    ..., None)`, with the load balanced by the conjugate load.
    """

    body: int
    interfaces: tuple[Interface, ...]
    compliance: Array


def loaded_contacts(layout: Layout, load: Array) -> dict[Patch, Array]:
    """Return the wrenches (3,) at the points of the contacts of moving bodies by a load (k,) on the
    ports.
    """
    found = dict[Patch, Array]()
    for value, port in zip(load, layout.ports, strict=True):
        for patch, wrench in port.parts:
            if value and patch.body >= 0 and not layout.bodies[patch.body].fixed:
                found[patch] = found.get(patch, np.zeros(3)) + value * np.array(wrench)
    return found


def interfaces(layout: Layout, body: int) -> tuple[Interface, ...]:
    """Interfaces of a body: the ends of its hinges, then the patches where the ports load it, in
    their order.

    Without patches on the whole of a body that is not clamped: its compliance there is zero.
    """
    ends = [
        End(k, side == 1)
        for k, joint in enumerate(layout.joints)
        for side in (0, 1)
        if joint.bodies[side] == body
    ]
    patches = [patch for port in layout.ports for patch, _ in port.parts if patch.body == body]
    elastic = [
        patch for patch in patches if patch.radius is not None or layout.bodies[body].clamped
    ]
    return (*ends, *dict.fromkeys(elastic))
