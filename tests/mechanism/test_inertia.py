"""Mass and inertia of what is drawn: closed forms, polygons, and the sum over the stage."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexfem.mechanism.layout import Payload
from flexfem.mechanism.outlines import Segment, area, area_moments, polygon_points, polyline
from flexfem.paper.bodies import body_moments, carried_out_of_plane, draw_sector, drawn_inertia

from ..conftest import UNLIKE, with_changes


def test_moments_of_a_half_disc_aside():
    """About the origin: area, first moments by the centroid 4 r / 3 pi, polar moment by Steiner
    twice.
    """
    r = 3.0
    at = 5 - 2j
    quarter = at + r * 1j
    loop = [Segment(at + r, quarter, at), Segment(quarter, at - r, at), *polyline(at - r, at + r)]
    A = math.pi * r**2 / 2
    centroid = at + 1j * 4 * r / (3 * math.pi)
    polar = math.pi * r**4 / 4 - A * (4 * r / (3 * math.pi)) ** 2 + A * abs(centroid) ** 2
    np.testing.assert_allclose(area_moments(loop)[:3], [A, A * centroid, polar], rtol=1e-13)


def test_bodies_have_the_area_and_polar_moment_of_their_polygons():
    stage = with_changes({"override": UNLIKE})
    for chain in (1, 2, 3):
        for k, face in enumerate(draw_sector(stage, chain).values()):
            found = body_moments(stage)[chain - 1, k]
            assert found[0] == pytest.approx(area(face.loop), rel=1e-13)
            x, y = polygon_points(face.loop, math.pi / 2000).T
            cross = x * np.roll(y, -1) - np.roll(x, -1) * y
            xx = np.roll(x, -1)
            yy = np.roll(y, -1)
            polar = np.sum(cross * (x**2 + x * xx + xx**2 + y**2 + y * yy + yy**2)) / 12
            assert found[2].real == pytest.approx(polar, rel=1e-6)


def test_the_whole_stage_has_the_mass_of_its_drawn_area_hub_included():
    """9.7 mm thick, 2739 kg/m^3; the hub is metal."""
    stage = with_changes({"override": UNLIKE})
    drawn = sum(
        area(face.loop) for chain in (1, 2, 3) for face in draw_sector(stage, chain).values()
    )
    kilograms = (drawn + math.pi * 7.7**2) * 9.7 * 2739e-9
    assert drawn_inertia(stage)[0, 0] * 1e3 == pytest.approx(kilograms, rel=1e-12)
    assert 0.05 < kilograms < 0.15


def test_out_of_the_plane_hub_and_payload_tilt_about_diameters():
    """A disc of radius 7.7 mm, 9.7 mm thick, 2739 kg/m^3: m (r^2 / 4 + b^2 / 12)."""
    hub = 4.9487e-6  # tonne
    tilting = hub * (7.7**2 / 4 + 9.7**2 / 12) + 0.05
    found = carried_out_of_plane(with_changes(), Payload(3e-4, 0.07, 0.05))
    np.testing.assert_allclose(found, np.diag([hub + 3e-4, tilting, tilting]), rtol=1e-5)
    hub_alone = carried_out_of_plane(with_changes(), Payload())
    np.testing.assert_allclose(np.diag(hub_alone)[1:], 1.1216e-4, rtol=1e-4)
