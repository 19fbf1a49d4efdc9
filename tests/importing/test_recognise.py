"""Bodies and hinges found in the plate of a mechanism are those of the mechanism, whose file says what they are."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import pytest

import flexfem
from flexfem.fem.plate_mesh import plate_contours
from flexfem.importing.found import Drawing, FoundHinge, FoundPlate
from flexfem.importing.recognise import recognise
from flexfem.mechanism.layout import Joint, Layout
from flexfem.mechanism.outlines import area
from flexfem.mechanism.profiles import Profile, profile_of

from ..conftest import ROOT

ROUND_OFF = 1e-6  # mm and rad, of a dimension of an exact drawing
OF_PLATE = 1e-6  # of the area of a plate, by which its parts may differ from it


def drawing_of(layout: Layout) -> Drawing:
    outside, *holes = plate_contours(layout)
    return Drawing(Path("part.dxf"), tuple(outside), tuple(map(tuple, holes)), None, (), 0.0, ())


def profile_found(hinge: FoundHinge) -> Profile:
    values = {key: math.radians(value) if key == "angle" else value for key, value in hinge.dimensions.items()}
    if hinge.table:
        values |= {"table": hinge.table, "smooth": hinge.smooth}
    if hinge.side:
        values["side"] = hinge.side
    return profile_of(hinge.shape, values)


def nearest(joint: Joint, found: FoundPlate) -> FoundHinge:
    return min(found.hinges, key=lambda hinge: abs(hinge.place - joint.place))


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "geometry").glob("*.toml")))
def test_a_shipped_mechanism_is_found_again_in_its_plate(name):
    layout = flexfem.load(ROOT / f"geometry/{name}.toml").layout
    drawing = drawing_of(layout)
    found = recognise(drawing)
    assert (len(found.hinges), len(found.bodies)) == (len(layout.joints), len(layout.bodies))
    for joint in layout.joints:
        hinge = nearest(joint, found)
        profile = profile_found(hinge)
        assert abs(hinge.place - joint.place) < ROUND_OFF
        assert abs(cmath.sin(hinge.heading - joint.heading)) < ROUND_OFF
        assert type(profile) is type(joint.profile)
        values = {key: value for key, value in vars(joint.profile).items() if isinstance(value, float)}
        assert {key: getattr(profile, key) for key in values} == pytest.approx(values, abs=ROUND_OFF)
        assert hinge.deviation < ROUND_OFF
    plate = sum(map(area, (drawing.outside, *drawing.holes)))
    bodies = sum(area(loop) for body in found.bodies for loop in (body.outside, *body.holes))
    hinges = sum(map(area_between, map(profile_found, found.hinges)))
    assert bodies + hinges == pytest.approx(plate, rel=OF_PLATE)


def area_between(profile: Profile) -> float:
    x, weights = profile.quadrature
    return float(weights @ profile.height(x))
