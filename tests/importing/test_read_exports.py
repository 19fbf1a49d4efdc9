"""Exported plates, read back: the same loops, to a millionth of the plate."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

import flexfem
from flexfem.cad.part import export
from flexfem.fem.plate_mesh import plate_contours
from flexfem.importing.read import read_drawing
from flexfem.mechanism.outlines import area, polygon_points

PLATES = sorted((Path(__file__).parents[2] / "geometry").glob("*.toml"))
ROUND_OFF = 1e-9  # relative, of the area
APART = 1e-6  # area that only one of two plates has, per area of the plate
FINE = (
    np.pi / 1024
)  # rad of arc per corner of the polygons: their own difference from the arcs is below the above


def polygon(outside, holes):
    return shapely.Polygon(
        polygon_points(outside, FINE), [polygon_points(hole, FINE) for hole in holes]
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", PLATES, ids=lambda path: path.stem)
def test_export_and_reading_give_the_same_plate(path, tmp_path):
    plate = flexfem.load(path)
    contours = plate_contours(plate.layout)
    drawn = polygon(contours[0], contours[1:])
    for suffix in (".dxf", ".svg", ".step"):
        export(plate, tmp_path / f"part{suffix}")
        drawing = read_drawing(tmp_path / f"part{suffix}")
        size = sum(map(area, (drawing.outside, *drawing.holes)))
        assert math.isclose(size, sum(map(area, contours)), rel_tol=ROUND_OFF)
        read = polygon(drawing.outside, drawing.holes)
        assert read.symmetric_difference(drawn).area < APART * drawn.area
        assert len(drawing.holes) == len(contours) - 1
        assert len(drawing.outside) <= len(contours[0])
        assert (drawing.thickness == plate.thickness) == (suffix == ".step")
        assert bool([mark for mark in drawing.marks if mark.layer == "GROUND"]) == (
            suffix != ".step"
        )
