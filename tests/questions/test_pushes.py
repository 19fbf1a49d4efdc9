"""What a set-up reads, against a network of its springs solved as one, and against numbers by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.questions.fixture import (
    Bar,
    Fixture,
    ForceSensor,
    Lvdt,
    Pole,
    Pusher,
    Run,
    bar_deflection,
    bar_share,
    force_of,
    pole_compliance,
    pole_share,
    pushes_of,
    read_compliance,
)

C = np.linalg.inv([[37.0, 3.5, 120.0], [3.5, 41.0, -210.0], [120.0, -210.0, 39000.0]])  # of no symmetry
POLE = {"bending_stiffness": 900.0, "torsional_stiffness": 2.1e5, "offset": (1.3, -0.7)}
BAR = {"arm": 26.0, "angle": 0.6, "stiffness": 700.0}


def fixture(**changes):
    given = {
        "name": "generic",
        "pole": Pole(**POLE),
        "bar": Bar(**BAR),
        "actuator": Pusher(name="any", stroke=0.045, stiffness=17e3),
        "lvdt": Lvdt(noise=0.0),
        "sensor": ForceSensor(noise=0.0, stiffness=8e3),
        "run": Run(increments=4, increment=0.01),
    }
    return Fixture(**(given | changes))


def spring(nodes, vector, stiffness):
    """A spring along one combination of coordinates, as a matrix of all."""
    row = np.zeros(8)
    row[nodes] = vector
    return stiffness * np.outer(row, row)


def network(push, p=(1.3, -0.7), a=26.0, angle=0.6, bend=900.0, twist=2.1e5, bar=700.0, drive=17e3, sensor=8e3):
    """The set-up as one matrix: platform (0-2), pole's end (3-5), bar's end along its push (6), the sensor's end (7).

    Returns the force per unit stroke, and what is read: the pole's end in x and y, both ends of the bar.
    """
    n = np.array([-np.sin(angle), np.cos(angle)])
    K = np.zeros((8, 8))
    K[:3, :3] = np.linalg.inv(C)
    K += spring([0, 2, 3], [1.0, -p[1], -1.0], bend)  # a foot at p moves x - p_y theta
    K += spring([1, 2, 4], [1.0, p[0], -1.0], bend)
    K += spring([2, 5], [1.0, -1.0], twist)
    K += spring([3, 4, 5, 6], [*n, a, -1.0], bar)  # between the bar's end and where the pole's end would take it
    pushed = {"x": 3, "y": 4, "theta": 6}[push]
    K += spring([pushed, 7], [1.0, -1.0], drive) + spring([7], [1.0], sensor)
    pressed = np.zeros(8)
    pressed[[pushed, 7]] = drive, -drive  # what a stroke of 1 mm would press on both sides
    u = np.linalg.solve(K, pressed)
    force = drive * (1.0 - (u[pushed] - u[7]))
    return force, u[3], u[4], u[6], float(np.dot([*n, -a], u[3:6]))


def test_what_is_read_is_what_a_network_of_all_springs_says():
    of = pushes_of(fixture())
    read, force = read_compliance(of, C), force_of(of, C, np.array([1.0]))[:, 0]
    for k, push in enumerate(("x", "y", "theta")):
        F, x, y, high, low = network(push)
        moved = (x, y, (high - low) / 52.0)[k]
        load = (F, F, 26.0 * F)[k]
        assert force[k] == pytest.approx(F, rel=1e-9)
        assert read[k] == pytest.approx(moved / load, rel=1e-9), push
    one = read_compliance(pushes_of(fixture(lvdt=Lvdt(noise=0.0, rotation="one end"))), C)
    F, _, _, high, _ = network("theta")
    assert one[2] == pytest.approx(high / 26.0 / (26.0 * F), rel=1e-9) and one[:2] == pytest.approx(read[:2])


@settings(max_examples=40, deadline=None)
@given(
    p=st.tuples(*[st.floats(-5, 5)] * 2),
    a=st.floats(5, 80),
    angle=st.floats(-6, 6),
    springs=st.tuples(*[st.floats(1, 6)] * 5),
)
def test_any_set_up_reads_what_its_springs_say(p, a, angle, springs):
    bend, twist, bar, drive, sensor = 10.0 ** np.array(springs)
    of = pushes_of(
        fixture(
            pole=Pole(bending_stiffness=bend, torsional_stiffness=twist, offset=p),
            bar=Bar(arm=a, angle=angle, stiffness=bar),
            actuator=Pusher(name="any", stroke=0.045, stiffness=drive),
            sensor=ForceSensor(noise=0.0, stiffness=sensor),
        )
    )
    read, force = read_compliance(of, C), force_of(of, C, np.array([1.0]))[:, 0]
    for k, push in enumerate(("x", "y", "theta")):
        F, x, y, high, low = network(push, p, a, of_angle(angle), bend, twist, bar, drive, sensor)
        moved, load = (x, y, (high - low) / (2 * a))[k], (F, F, a * F)[k]
        size = abs(read[k]) + abs(moved / load) + 1e-7
        assert abs(force[k] - F) < 1e-6 * abs(F) and abs(read[k] - moved / load) < 1e-6 * size


def of_angle(angle):
    """An angle as a file would state it, in degrees."""
    return float(np.deg2rad(np.rad2deg(angle)))


def test_a_pole_of_steel_by_hand():
    """206 GPa, 8 by 40 mm: I = 201.06 mm^4, A = 50.27 mm^2, G = 79231 MPa; bending h^3/(3EI), shear 10/9 h/(GA)."""
    found = pole_compliance(Pole(diameter=8.0, height=40.0, youngs_modulus=206e3, poissons_ratio=0.3))
    bending = 64000 / (3 * 206e3 * 201.0619) + 40 / 0.9 / (79230.77 * 50.26548)
    assert found.bending == pytest.approx((bending, bending), rel=1e-6) and found.pushed == pytest.approx(bending)
    assert 1 / found.torsion == pytest.approx(796514.57, rel=1e-6)
    half = pole_compliance(Pole(diameter=8.0, height=40.0, push_height=20.0, youngs_modulus=206e3, poissons_ratio=0.3))
    shear = 20 / 0.9 / (79230.77 * 50.26548)
    assert half.bending[0] == pytest.approx(400 * 100 / (6 * 206e3 * 201.0619) + shear, rel=1e-6)
    assert half.bending[1] == pytest.approx(bending, rel=1e-6)
    assert half.pushed == pytest.approx(8000 / (3 * 206e3 * 201.0619) + shear, rel=1e-6)


def test_a_bar_by_hand():
    """206 GPa, 8 mm wide in the plane, in which it bends, 5 mm thick, 30 mm: EI = 4.3947e7 N mm^2.

    a^3/(3EI) at the push, a^2(3b - a)/(6EI) beyond it.
    """
    bar = Bar(arm=30.0, width=8.0, thickness=5.0, youngs_modulus=206e3)
    EI = 206e3 * 5 * 8**3 / 12
    assert bar_deflection(bar, 30.0, 30.0) == pytest.approx(27000 / (3 * EI), rel=1e-12)
    assert bar_deflection(bar, 30.0, 40.0) == pytest.approx(900 * 90 / (6 * EI), rel=1e-12)
    assert bar_deflection(bar, 30.0, 20.0) == pytest.approx(400 * 70 / (6 * EI), rel=1e-12)
    assert bar_deflection(bar, 30.0, -30.0) == 0.0 == bar_deflection(Bar(arm=30.0), 30.0, 30.0)
    assert bar_deflection(Bar(arm=30.0, stiffness=500.0), 30.0, 30.0) == pytest.approx(1 / 500.0)


def test_what_reads_the_platform_does_not_see_the_pole():
    """And a stiffer sensor or drive changes forces, not slopes."""
    ground = pushes_of(fixture(lvdt=Lvdt(noise=0.0, at="platform")))
    assert not pole_share(ground).any() and not bar_share(ground).any()
    n = np.array([-np.sin(0.6), np.cos(0.6)])
    w = np.array([*n, 1.3 * n[1] + 0.7 * n[0] + 26.0])
    assert read_compliance(ground, C)[0] == pytest.approx(C[0, 0] + 2 * 0.7 * C[0, 2] + 0.49 * C[2, 2], rel=1e-12)
    assert read_compliance(ground, C)[2] == pytest.approx(C[2] @ w / 26.0, rel=1e-12)
    soft, hard = (pushes_of(fixture(sensor=ForceSensor(noise=0.0, stiffness=k))) for k in (50.0, None))
    np.testing.assert_allclose(read_compliance(soft, C), read_compliance(hard, C), rtol=1e-15)
    stroke = np.array([0.04])
    np.testing.assert_allclose(stroke / force_of(soft, C, stroke) - stroke / force_of(hard, C, stroke), 1 / 50.0)


def test_an_offset_tilts_the_moment_to_first_order():
    """A pole 1 mm from the centre towards the push makes the moment 31 for a reading of 30: 1/K is 3.3 % too large."""
    near, far = (
        read_compliance(
            pushes_of(
                fixture(bar=Bar(arm=30.0), pole=Pole(bending_stiffness=1e9, torsional_stiffness=1e12, offset=at))
            ),
            np.diag([0.026, 0.026, 2.4e-5]),
        )
        for at in ((0.0, 0.0), (1.0, 0.0))
    )
    assert far[2] / near[2] == pytest.approx(31 / 30, rel=1e-6)
    assert far[1] - near[1] == pytest.approx(2.4e-5, rel=1e-3) and far[0] == pytest.approx(near[0], rel=1e-9)


def test_one_sensor_takes_translation_for_rotation():
    """By C_xx / a^2: 0.026 / 900 above 2.4e-5, more than the rotation itself."""
    pole = Pole(bending_stiffness=1e9, torsional_stiffness=1e12)
    of = fixture(pole=pole, bar=Bar(arm=30.0), lvdt=Lvdt(noise=0.0, rotation="one end"))
    assert read_compliance(pushes_of(of), np.diag([0.026, 0.026, 2.4e-5]))[2] == pytest.approx(
        2.4e-5 + 0.026 / 900, rel=1e-6
    )
