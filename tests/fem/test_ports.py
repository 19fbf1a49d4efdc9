"""Any plate with ports: strips on mapped meshes against beams, and readings of fields that do not
use the loads.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator
from scipy.optimize import brentq

from flexfem.fem import ports
from flexfem.fem.elements import layered
from flexfem.fem.mesh import mapped
from flexfem.fem.plate_bodies import body_compliances, hinge_compliances
from flexfem.fem.ports import contact_forces, hinge_stress, plate_model, plate_response
from flexfem.mechanism.layout import Body, Joint, Layout, LinearActuator, Move, Patch, PayloadMass
from flexfem.mechanism.outlines import Segment, polyline
from flexfem.mechanism.profiles import Leaf
from flexfem.refused import ComputationFailed

from ..tolerances import SOLVED

E = 70_000.0
B = 4.0
H = 5.0
DENSITY = 2.7e-9  # MPa, mm, mm, tonne/mm^3
CLAMP = 10.0
ROOT = 50.0
TIP = 70.0  # mm: ends of the fixed body, the hinge and the strip
INERTIA = B * H**3 / 12
OUTPUT = Patch(1, 60.0 + 0j)


def strip(columns=56, rows=4, hinge=CLAMP):
    """A strip in three parts: a fixed body 0, a hinge that starts at `hinge`, and a body 1."""
    mesh = mapped(columns, rows, lambda u, v: np.stack([TIP * u, H * (v - 0.5)], axis=-1))
    x = mesh.nodes[mesh.triangles[:, :3], 0].mean(axis=1)
    return mesh._replace(bodies=np.where(x < CLAMP, 0, np.where((x > hinge) & (x < ROOT), 2, 1)))


def layout(points=(("output", OUTPUT),), nu=0.0, thickness=B, **others):
    bodies = Body("ground", (), fixed=True), Body("stage", ())
    hinge = Joint("leaf", (0, 1), 30 + 0j, 0.0, Leaf(H, ROOT - CLAMP), H)
    return Layout(bodies, (hinge,), thickness, E, nu, DENSITY, 500.0, points, **others)


def beam_compliance(length):
    """Tip of a cantilever at its end: Timoshenko with kappa = 6/5 and nu = 0."""
    bending = length**3 / (3 * E * INERTIA) + 1.2 * 2 * length / (E * B * H)
    cross = length**2 / (2 * E * INERTIA)
    return np.array(
        [[length / (E * B * H), 0, 0], [0, bending, cross], [0, cross, length / (E * INERTIA)]]
    )


def test_patch_loads_have_their_resultant_and_the_mean_over_the_disc_as_motion():
    mesh = strip()
    radius = 1.7
    point = 61.3 + 0.4j
    forces = contact_forces(layout(), mesh, Patch(1, point, radius))
    x, y = mesh.nodes.T
    moments = forces[..., 1] @ (x - 61.3) - forces[..., 0] @ (y - 0.4)
    np.testing.assert_allclose(
        np.column_stack([forces.sum(axis=1), moments]), np.eye(3), atol=1e-12
    )
    field = np.stack([(y - 0.4) ** 2, 0.5 * x], axis=-1)  # half of the slope is strain
    motion = np.sum(forces * field, axis=(1, 2))
    np.testing.assert_allclose(motion, [radius**2 / 4, 30.65, 0.25], rtol=0.03)
    with pytest.raises(ComputationFailed, match="no part of body 1"):
        contact_forces(layout(), mesh, Patch(1, 61.3 + 9j, radius))


def test_cantilever_answers_as_a_timoshenko_beam_and_carries_its_stress():
    """Loads on the whole stage, 20 mm long, and near the end, where the contact sinks in."""
    tip = "tip", Patch(1, 69 + 0j, 1.0)
    response = plate_response(layout((("output", OUTPUT), tip)), strip())
    C = response.compliance
    assert C[0, 0] == pytest.approx(
        40 / (E * B * H) + 20 / (3 * E * B * H), rel=1e-6
    )  # int N^2, falling linearly
    bending = 20**3 / 20 + (50**3 - 10**3) / 3
    shear = 20 / 3 + 40  # M = d^2 / 40 at d from the end, then d - 10
    assert C[1, 1] == pytest.approx(bending / (E * INERTIA) + 2.4 * shear / (E * B * H), rel=5e-4)
    np.testing.assert_allclose(C[4, 4:], beam_compliance(59.0)[1, 1:], rtol=1e-3)
    np.testing.assert_allclose(
        response.reactions[3:], [[-1, 0, 0], [0, -1, -69], [0, 0, -1]], atol=SOLVED * 69
    )
    loads = np.zeros((2, 6))
    modulus = B * H**2 / 6
    loads[0, [0, 5]] = (3.0, 7.0)
    loads[1, 1] = 2.0
    stress = hinge_stress(response, loads)[:, 0]
    assert stress[0] == pytest.approx(3 / (B * H) + 7 / modulus, rel=1e-6)
    assert stress[1] == pytest.approx(2 * 50 / modulus, rel=0.02)


def test_motion_of_contacts_is_read_from_the_field_and_the_compliance_is_symmetric():
    """An actuator bears on the lever and on the ground; a rigid motion is fitted to samples of the
    field in a disc.
    """
    near = Patch(0, 5 + 0j, 2.0)
    far = Patch(1, 62 + 0.5j, 1.5)
    direction = complex(0.6, 0.8)
    actuator = LinearActuator("drive", (near, far), direction, 100.0, 0.01, 1.0)
    response = plate_response(layout(actuators=(actuator,), nu=0.3), strip(140, 10))
    raw = response.motions
    size = np.sqrt(np.diag(response.motions))
    assert np.max(np.abs(raw - raw.T) / np.outer(size, size)) < SOLVED
    r, angle = np.meshgrid(1.5 * np.sqrt((np.arange(40) + 0.5) / 40), np.arange(80) * np.pi / 40)
    z = (far.point + r * np.exp(1j * angle)).ravel()
    for case, field in enumerate(response.fields):
        u = LinearNDInterpolator(response.mesh.nodes, field)(z.real, z.imag)
        opening = u.mean(axis=0) @ [direction.real, direction.imag]
        assert opening == pytest.approx(raw[3, case], abs=2e-4 * size[3] * size[case])


def test_free_body_bends_as_a_beam_between_its_hinges():
    mesh = mapped(40, 6, lambda u, v: np.stack([20 + 30 * u, H * (v - 0.5)], axis=-1))
    edges = {"end 0 far": mesh.edges["left"], "end 1 near": mesh.edges["right"]}
    mesh = mesh._replace(bodies=mesh.bodies + 1, edges=edges)
    of = layout((("whole", Patch(1, 7 + 3j, 100.0)), ("spot", Patch(1, 40 + 1j, 1.0))))
    before, after = (of.joints[0]._replace(place=complex(x)) for x in (0, 70))
    (body,) = body_compliances(of._replace(joints=(before, after._replace(bodies=(1, 0)))), mesh)
    C = body.compliance
    assert C.shape == (12, 12)
    assert np.linalg.eigvalsh(C).min() > -SOLVED * np.linalg.norm(C)
    np.testing.assert_allclose(
        C[6:9], 0.0, atol=SOLVED * np.abs(C).max()
    )  # on the whole body it is its mean motion
    apart = np.hstack([-np.eye(3), np.eye(3)])
    to_end = np.array(
        [[1.0, 0, 0], [0, 1, 50], [0, 0, 1]]
    )  # twist at the end of the bar from that at the origin
    between = to_end @ apart @ C[:6, :6] @ apart.T @ to_end.T
    np.testing.assert_allclose(between, beam_compliance(30.0), rtol=2e-3, atol=1e-12)
    clamped = of._replace(
        bodies=(of.bodies[0], of.bodies[1]._replace(clamped=(0,))), joints=(after,)
    )
    held = mesh._replace(
        edges={"clamped": mesh.edges["end 0 far"], "end 0 far": mesh.edges["end 1 near"]}
    )
    (body,) = body_compliances(clamped, held)
    np.testing.assert_allclose(
        to_end @ body.compliance[:3, :3] @ to_end.T, beam_compliance(30.0), rtol=2e-3, atol=1e-12
    )


def test_turned_and_mirrored_copies_of_a_body_are_solved_once():
    """As each of them solved alone on the image of one mesh. Two legs have a load, and one has its
    ends in reverse.
    """
    moves = (
        Move(),
        Move(np.exp(0.7j), 3 - 8j),
        Move(np.exp(-2.4j), 1 + 2j),
        Move(np.exp(1.1j), -4 + 5j, mirrored=True),
    )
    leg = mapped(30, 6, lambda u, v: np.stack([20 + 30 * u, H * (v - 0.5) + 3 * u * v], axis=-1))
    outline = polyline(20 - 2.5j, 50 - 2.5j, 50 + 5.5j, 20 + 2.5j, 20 - 2.5j)
    bodies = [Body("ground", (), fixed=True)]
    joints = []
    points = []
    nodes = []
    triangles = []
    edges = {}
    for k, move in enumerate(moves):
        bodies.append(
            Body("leg", tuple(Segment(move(edge.start), move(edge.end)) for edge in outline))
        )
        for side, x, ends in (("left", 10, (0, k + 1)), ("right", 60, (k + 1, 0)))[
            :: -1 if k == 3 else 1
        ]:
            edges[f"end {len(joints)} {'far' if ends[1] else 'near'}"] = leg.edges[side] + k * len(
                leg.nodes
            )
            joints.append(
                Joint("leaf", ends, move(complex(x)), move.heading(0.0), Leaf(H, 20.0), H)
            )
        points += [("spot", Patch(k + 1, move(44 + 2j), 1.0))] * (k < 2)
        z = move(leg.nodes @ [1, 1j])
        nodes.append(np.column_stack([z.real, z.imag]))
        triangles.append(
            leg.triangles[:, [0, 2, 1, 5, 4, 3] if move.mirrored else range(6)] + k * len(leg.nodes)
        )
    of = layout()._replace(bodies=tuple(bodies), joints=tuple(joints), points=tuple(points))
    numbers = np.repeat(np.arange(1, 5), len(leg.triangles))
    mesh = leg._replace(
        nodes=np.concatenate(nodes),
        triangles=np.concatenate(triangles),
        bodies=numbers,
        edges=edges,
    )
    once = body_compliances(
        of, mesh._replace(bodies=np.where(numbers == 1, 1, 0))
    )  # without meshes of the copies
    assert [len(one.interfaces) for one in once] == [3, 3, 2, 2]
    for k, found in enumerate(once, 1):
        single = tuple(body._replace(fixed=number != k) for number, body in enumerate(bodies))
        (alone,) = body_compliances(of._replace(bodies=single), mesh)
        assert (found.body, found.interfaces) == (alone.body, alone.interfaces)
        np.testing.assert_allclose(
            found.compliance, alone.compliance, atol=SOLVED * np.abs(alone.compliance).max()
        )
    wider = outline[0]._replace(start=outline[0].start * (1 + 1e-9))
    unequal = (bodies[0], bodies[1]._replace(outline=(wider, *outline[1:])), *bodies[2:])
    apart = body_compliances(of._replace(bodies=unequal), mesh)[1].compliance
    assert 0 < np.abs(apart - once[1].compliance).max() < 1e-6 * np.abs(apart).max()


def test_hinge_alone_is_a_beam_in_its_own_axes():
    """A straight one between rigid sections with nu = 0, turned: `L / E A`, `L^3 / 12 E I` with
    shear, `L / E I`.
    """
    mesh = mapped(60, 6, lambda u, v: np.stack([40 * (u - 0.5), H * (v - 0.5)], axis=-1))
    turn = np.exp(0.7j)
    z = 3 - 8j + mesh.nodes @ [1, 1j] * turn
    edges = {"end 0 near": mesh.edges["left"], "end 0 far": mesh.edges["right"]}
    mesh = mesh._replace(
        nodes=np.column_stack([z.real, z.imag]), bodies=mesh.bodies + 2, edges=edges
    )
    of = layout()
    turned = of._replace(joints=(of.joints[0]._replace(place=3 - 8j, heading=0.7),))
    bending = 40 / (E * INERTIA)
    expected = np.diag([40 / (E * B * H), bending * 40**2 / 12 + 2.4 * 40 / (E * B * H), bending])
    np.testing.assert_allclose(hinge_compliances(turned, mesh), [expected], rtol=2e-3, atol=1e-12)


@pytest.mark.parametrize(("payload", "spring"), [(0.0, 0.0), (3e-6, 0.0), (1e-6, 2.0)])
def test_cantilever_vibrates_as_a_beam_with_a_mass_and_a_spring_at_its_end(payload, spring):
    mesh = strip(70, 2)
    end = Patch(1, 70 - 0.5 + 0j, 0.5)
    slender = mesh._replace(nodes=mesh.nodes * [1.0, 0.2])
    length = TIP - CLAMP
    actuator = LinearActuator("spring", (Patch(0, 5 + 0j, 1.0), end), 1j, spring, 0.01, 1.0, 2e-6)
    of = layout((("tip", end),), actuators=(actuator,), payloads=(PayloadMass(end, payload, 0.0),))
    second = INERTIA * 0.2**3
    beam = DENSITY * B * H * 0.2 * length
    mass = (payload + 1e-6) / beam
    rate = spring * length**3 / (E * second)

    def free(k):
        return (
            1
            + np.cos(k) * np.cosh(k)
            + (rate / k**3 - mass * k) * (np.sin(k) * np.cosh(k) - np.cos(k) * np.sinh(k))
        )

    root = brentq(free, 0.3, 3.5)
    expected = root**2 * np.sqrt(E * second / (beam * length**3))
    found = ports.plate_modes(plate_model(of, slender), 2, engaged=spring > 0)
    assert found.frequencies[0] == pytest.approx(expected, rel=0.02)


def test_weight_and_heat():
    outside = LinearActuator("drive", (Patch(-1, 60 + 40j), OUTPUT), -1j, 100.0, 0.01, 1.0)
    model = plate_model(
        layout(actuators=(outside,), payloads=(PayloadMass(OUTPUT, 2e-5, 0.0),)), strip()
    )
    weight = model.weight_response(model.mass, np.array([[0.0, -9810.0]]))
    (clamped,) = model.pads
    rigid = model.structure.rigid_fields()
    on_clamped = model.mass.forces(-9810.0 * rigid[1:2])[0, clamped]
    held = weight.reactions - np.tensordot(on_clamped, rigid[:, clamped], axes=((0, 1), (1, 2)))
    own = 9810 * DENSITY * B * H * (TIP - CLAMP)
    moment = own * (CLAMP + TIP) / 2 + 9810 * 2e-5 * 60
    np.testing.assert_allclose(held, [[0, own + 9810 * 2e-5, moment]], rtol=SOLVED, atol=1e-9)
    heat = ports.thermal_response(model, 23e-6, 11e-6)
    together = replace(weight, nodal=np.concatenate([weight.nodal, heat.nodal]))
    both = hinge_stress(together, np.array([[1.0, 0, 0, 0], [0, 5, 0, 0], [1, 5, 0, 0]]))
    assert abs(both[1, 0] - both[0, 0]) <= both[2, 0] <= both[:2].sum()
    assert both[0] == pytest.approx(hinge_stress(weight, np.eye(1))[0])
    assert both[1] == pytest.approx(hinge_stress(heat, 5 * np.eye(3))[0])
    assert heat.motions[0, 0] == pytest.approx(23e-6 * 50 + 11e-6 * CLAMP, rel=SOLVED)
    alike = ports.thermal_response(model, 23e-6, 23e-6)
    assert hinge_stress(alike, np.eye(3)).max() < SOLVED * hinge_stress(heat, np.eye(3)).max()
    np.testing.assert_allclose(
        alike.motions[:, 0], [23e-6 * 60, 0, 0, 23e-6 * 40], rtol=SOLVED, atol=1e-12
    )


def test_thin_strip_in_three_dimensions_is_in_plane_stress():
    of = layout(nu=0.3, thickness=0.2)
    mesh = strip(56, 4, 20.0)
    plane, solid = (
        plate_response(of, mesh, layers)
        for layers in (None, layered(np.array([0.0, 0.1]), (0,), 2))
    )
    size = np.sqrt(np.diag(plane.compliance))
    np.testing.assert_allclose(
        solid.compliance / np.outer(size, size), plane.compliance / np.outer(size, size), atol=2e-3
    )
    loads = np.eye(3)
    np.testing.assert_allclose(hinge_stress(solid, loads), hinge_stress(plane, loads), rtol=0.01)
