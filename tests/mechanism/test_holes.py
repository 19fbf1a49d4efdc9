"""Holes on a circle: each in its place, with count, centre and angle of the file."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

import flexfem
from flexfem.mechanism.plate import body_polygon

ROUND = 1e-3  # relative; circles are drawn as polygons


def plate(*holes):
    return flexfem.Mechanism(
        name="plate on a leaf",
        thickness=5.0,
        material="al-7075-t6",
        body=[
            {"name": "ground", "outline": [(0, 0), (10, 0), (10, 10), (0, 10)], "fixed": True},
            {
                "name": "plate",
                "outline": [(30, -15), (60, -15), (60, 25), (30, 25)],
                "holes": list(holes),
            },
        ],
        hinge=[
            {
                "name": "leaf",
                "between": ["ground", "plate"],
                "at": (20, 5),
                "direction": 0.0,
                "shape": "leaf",
                "length": 20.0,
                "neck": 0.5,
                "fillet": 0.5,
            }
        ],
        output={"body": "plate", "at": (45, 5)},
    )


def centres(mechanism):
    polygon = body_polygon(mechanism.layout, 1)
    return sorted(
        (round(shapely.Polygon(hole).centroid.x, 6), round(shapely.Polygon(hole).centroid.y, 6))
        for hole in polygon.interiors
    )


def test_five_holes_of_a_bolt_circle_are_at_72_degrees():
    made = plate({"centre": (53, 5), "radius": 2.0, "count": 5, "about": (45, 5)})
    angles = np.deg2rad(72.0 * np.arange(5))
    expected = sorted(zip(45 + 8 * np.cos(angles), 5 + 8 * np.sin(angles), strict=True))
    np.testing.assert_allclose(centres(made), expected, atol=1e-5)
    area = shapely.area(body_polygon(made.layout, 1))
    assert 1200 - area == pytest.approx(5 * np.pi * 4, rel=ROUND)


def test_the_angle_between_holes_may_be_stated():
    made = plate(
        {"centre": (53, 5), "radius": 2.0, "count": 2, "about": (45, 5), "angle": np.deg2rad(40.0)}
    )
    turned = (45 + 8 * np.cos(np.deg2rad(40.0)), 5 + 8 * np.sin(np.deg2rad(40.0)))
    np.testing.assert_allclose(centres(made), sorted([(53.0, 5.0), turned]), atol=1e-5)


def test_a_circle_without_a_number_of_holes_is_refused():
    with pytest.raises(flexfem.BadInput, match="expected count, the number of holes"):
        plate({"centre": (53, 5), "radius": 2.0, "about": (45, 5)})
