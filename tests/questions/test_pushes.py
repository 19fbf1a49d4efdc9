"""What a set-up reads, against a network of its springs solved as one, and against numbers by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexfem.paper.fixture import (
    Bar,
    Fixture,
    ForceSensor,
    Lvdt,
    Pole,
    Pusher,
    Run,
    pushes_of,
)

from ..tolerances import DENSE

C = np.linalg.inv(
    [[37.0, 3.5, 120.0], [3.5, 41.0, -210.0], [120.0, -210.0, 39000.0]]
)  # of no symmetry
POLE = {
    "diameter": 3.0,
    "height": 31.0,
    "youngs_modulus": 206e3,
    "poissons_ratio": 0.29,
    "offset": (1.3, -0.7),
}
BAR = {"arm": 26.0, "angle": 0.6, "width": 2.0, "thickness": 3.0, "youngs_modulus": 71e3}


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


def read(of, compliance=C):
    """One over the slopes without noise."""
    return sum(pushes_of(of).shares(compliance))


def spring(nodes, vector, stiffness):
    """A spring along one combination of coordinates, as a matrix of all."""
    row = np.zeros(8)
    row[nodes] = vector
    return stiffness * np.outer(row, row)


def network(push, of):
    """The set-up as one matrix: platform (0-2), pole's end (3-5), bar's end along its push (6), the
    sensor's end (7).

    Returns the force per unit stroke, and what is read: the pole's end in x and y, both ends of the
    bar."""
    pole = of.pole.compliance
    bar = 1 / of.bar.compliance
    bend = 1 / pole.end
    twist = 1 / pole.torsion
    p = of.pole.offset
    a = of.bar.arm
    angle = of.bar.angle
    drive = of.actuator.stiffness
    sensor = of.sensor.stiffness
    n = np.array([-np.sin(angle), np.cos(angle)])
    K = np.zeros((8, 8))
    K[:3, :3] = np.linalg.inv(C)
    K += spring([0, 2, 3], [1.0, -p[1], -1.0], bend)  # a foot at p moves x - p_y theta
    K += spring([1, 2, 4], [1.0, p[0], -1.0], bend)
    K += spring([2, 5], [1.0, -1.0], twist)
    K += spring(
        [3, 4, 5, 6], [*n, a, -1.0], bar
    )  # between the bar's end and where the pole's end would take it
    pushed = {"x": 3, "y": 4, "theta": 6}[push]
    K += spring([pushed, 7], [1.0, -1.0], drive) + spring([7], [1.0], sensor)
    pressed = np.zeros(8)
    pressed[[pushed, 7]] = drive, -drive  # what a stroke of 1 mm would press on both sides
    u = np.linalg.solve(K, pressed)
    force = drive * (1.0 - (u[pushed] - u[7]))
    return force, u[3], u[4], u[6], float(np.dot([*n, -a], u[3:6]))


@settings(max_examples=40, deadline=None)
@given(
    p=st.tuples(*[st.floats(-5, 5)] * 2),
    a=st.floats(5, 80),
    angle=st.floats(-6, 6),
    sizes=st.tuples(*[st.floats(0, 1)] * 5),
)
def test_any_set_up_reads_what_a_network_of_all_its_springs_says(p, a, angle, sizes):
    diameter, width, modulus, drive, sensor = 10.0 ** np.array(sizes)
    of = fixture(
        pole=Pole(**POLE | {"diameter": diameter, "offset": p}),
        bar=Bar(
            **BAR | {"arm": a, "angle": angle, "width": width, "youngs_modulus": 71e3 * modulus}
        ),
        actuator=Pusher(name="any", stroke=0.045, stiffness=1e3 * drive),
        sensor=ForceSensor(noise=0.0, stiffness=1e3 * sensor),
    )
    found = read(of)
    force = pushes_of(of).force(C, np.array([1.0]))[:, 0]
    for k, push in enumerate(("x", "y", "theta")):
        F, x, y, high, low = network(push, of)
        moved = (x, y, (high - low) / (2 * a))[k]
        load = (F, F, a * F)[k]
        size = abs(found[k]) + abs(moved / load) + 1e-7
        assert abs(force[k] - F) < 1e-6 * abs(F) and abs(found[k] - moved / load) < 1e-6 * size


def test_a_pole_and_a_bar_of_steel_by_hand():
    """206 GPa, 8 by 40 mm: I = 201.06 mm^4, A = 50.27 mm^2, G = 79231 MPa; bending h^3/(3EI), shear
    10/9 h/(GA).
    """
    found = Pole(diameter=8.0, height=40.0, youngs_modulus=206e3, poissons_ratio=0.3).compliance
    bending = 64000 / (3 * 206e3 * 201.0619) + 40 / 0.9 / (79230.77 * 50.26548)
    assert (found.read, found.end, found.pushed) == pytest.approx(
        (bending, bending, bending), rel=1e-6
    )
    assert 1 / found.torsion == pytest.approx(796514.57, rel=1e-6)
    half = Pole(
        diameter=8.0, height=40.0, push_height=20.0, youngs_modulus=206e3, poissons_ratio=0.3
    ).compliance
    shear = 20 / 0.9 / (79230.77 * 50.26548)
    assert half.read == pytest.approx(400 * 100 / (6 * 206e3 * 201.0619) + shear, rel=1e-6)
    assert half.end == pytest.approx(bending, rel=1e-6)
    assert half.pushed == pytest.approx(8000 / (3 * 206e3 * 201.0619) + shear, rel=1e-6)
    bar = Bar(
        arm=30.0, width=8.0, thickness=5.0, youngs_modulus=206e3
    )  # 8 mm in the plane, in which it bends
    assert bar.compliance == pytest.approx(27000 / (3 * 206e3 * 5 * 8**3 / 12), rel=1e-12)


def test_what_reads_the_platform_does_not_see_the_pole():
    """And a stiffer sensor or drive changes forces, not slopes."""
    ground = fixture(lvdt=Lvdt(noise=0.0, at="platform"))
    assert not any(part.any() for part in pushes_of(ground).shares(C)[1:])
    n = np.array([-np.sin(0.6), np.cos(0.6)])
    w = np.array([*n, 1.3 * n[1] + 0.7 * n[0] + 26.0])
    assert read(ground)[0] == pytest.approx(C[0, 0] + 2 * 0.7 * C[0, 2] + 0.49 * C[2, 2], rel=DENSE)
    assert read(ground)[2] == pytest.approx(C[2] @ w / 26.0, rel=DENSE)
    soft, hard = (fixture(sensor=ForceSensor(noise=0.0, stiffness=k)) for k in (50.0, None))
    np.testing.assert_allclose(read(soft), read(hard), rtol=DENSE)
    stroke = np.array([0.04])
    more, less = (stroke / pushes_of(each).force(C, stroke) for each in (soft, hard))
    np.testing.assert_allclose(more - less, 1 / 50.0)
