"""Plates as they are found in a drawing, made from mechanisms: exact, without a drawing."""

from __future__ import annotations

import math
from pathlib import Path

from flexfem.fem.plate_mesh import plate_contours, regions_of
from flexfem.importing.found import Drawing, FoundBody, FoundHinge, FoundPlate
from flexfem.mechanism import profiles
from flexfem.mechanism.outlines import area
from flexfem.meshing.process import run_mesher
from flexfem.meshing.requests import PlateContours

TIME = 60.0  # s, for gmsh


def found_hinge(joint):
    """A hinge of a layout as it is found: shape and dimensions by the keys of a file, angles in
    degrees.
    """
    profile = joint.profile
    table = ()
    match profile:
        case profiles.Circular():
            shape = "circular"
            sizes = {"radius": profile.radius, "neck": profile.neck}
        case profiles.Leaf():
            shape = "leaf"
            sizes = {"length": profile.span, "neck": profile.neck, "fillet": profile.fillet}
        case profiles.Elliptical() | profiles.Parabolic():
            shape = type(profile).__name__.lower()
            sizes = {"length": profile.span, "depth": profile.depth, "neck": profile.neck}
        case profiles.Vee():
            shape = "v"
            sizes = {"angle": math.degrees(profile.angle), "root_radius": profile.root}
            sizes |= {"depth": profile.depth, "neck": profile.neck}
        case _:
            shape = "profile"
            sizes = {}
            table = profile.table
    return FoundHinge(joint.bodies, joint.place, joint.heading, shape, sizes, table, 0.0)


def found_plate(layout, path="part.dxf", marks=()):
    """The bodies and hinges of a layout, and its contours as the drawing."""
    bodies = list[FoundBody]()
    for region in regions_of(layout)[: len(layout.bodies)]:
        outside, *holes = sorted(
            run_mesher(PlateContours([region]), TIME), key=lambda loop: -abs(area(loop))
        )
        bodies.append(FoundBody(tuple(outside), tuple(map(tuple, holes))))
    outside, *holes = sorted(plate_contours(layout), key=lambda loop: -abs(area(loop)))
    drawing = Drawing(
        Path(path), tuple(outside), tuple(map(tuple, holes)), None, tuple(marks), 0.0, ()
    )
    return FoundPlate(drawing, tuple(bodies), tuple(map(found_hinge, layout.joints)), ())
