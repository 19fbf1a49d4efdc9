"""Beam quadrature of every hinge shape against plane finite elements of one hinge between two
elastic blocks.

    python benchmarks/hinge_shapes.py [resolution]

Each line gives the finite elements over the beam, as a difference in per cent: rotation, axial and
transverse compliance of the mean motion of one block relative to that of the other, and the highest
stress under a moment, an axial and a transverse force at the centre. Blocks are as high as the
profile at its ends, at least eight necks, and as long as they are high. Loads are spread over the
blocks. The stress at a sharp root, of a leaf without fillet, has no limit as the mesh is refined;
the beam gives the nominal one."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.fem.ports import hinge_stress, plate_response
from flexfem.mechanism.layout import Body, Joint, Layout, Patch
from flexfem.mechanism.outlines import polyline
from flexfem.mechanism.profile import Profile
from flexfem.mechanism.profiles import profile_of

E = 7e4
NU = 0.3
THICKNESS = 10.0  # MPa, 1, mm
KNEES = [(-4, 3.0), (-3, 1.5), (-2, 0.8), (0, 0.5), (3, 0.6), (6, 0.9), (8, 2.5)]
CASES: list[tuple[str, dict[str, Any]]] = [
    *(("circular", {"radius": 5.0, "neck": neck}) for neck in (0.1, 0.5, 1.0, 2.5)),
    *(("elliptical", {"length": 12.0, "depth": 3.0, "neck": neck}) for neck in (0.1, 0.5, 1.0)),
    ("elliptical", {"length": 4.0, "depth": 4.0, "neck": 0.5}),
    *(("parabolic", {"length": 12.0, "depth": 3.0, "neck": neck}) for neck in (0.1, 0.5, 1.0)),
    *(
        ("v", {"angle": np.deg2rad(a), "root_radius": 0.5, "depth": 4.0, "neck": 0.5})
        for a in (30, 60, 90)
    ),
    *(("leaf", {"length": length, "neck": 0.5}) for length in (2.5, 5.0, 10.0, 25.0)),
    *(
        ("filleted", {"length": 10.0, "neck": 0.5, "fillet": fillet})
        for fillet in (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
    ),
    *(("circular", {"radius": 5.0, "neck": neck, "side": "left"}) for neck in (0.1, 0.5, 1.0, 2.5)),
    ("elliptical", {"length": 12.0, "depth": 3.0, "neck": 0.5, "side": "left"}),
    ("parabolic", {"length": 12.0, "depth": 3.0, "neck": 0.5, "side": "left"}),
    ("v", {"angle": np.deg2rad(60), "root_radius": 0.5, "depth": 4.0, "neck": 0.5, "side": "left"}),
    *(
        ("filleted", {"length": 10.0, "neck": 0.5, "fillet": fillet, "side": "left"})
        for fillet in (0.1, 0.5, 1.0, 2.0)
    ),
    (
        "profile",
        {
            "table": [(x, 0.5 + 0.02 * x**2 + 0.002 * x**4) for x in np.linspace(-6, 6, 25)],
            "smooth": True,
        },
    ),
    *(("profile", {"table": KNEES, "smooth": smooth}) for smooth in (True, False)),
]


def layout_of(profile: Profile) -> Layout:
    """Return a hinge on the x axis between two blocks, the first one clamped at its far edge."""
    near = profile.length / 2
    height = max(profile.end_height, 8 * profile.neck)
    if profile.side:
        height = profile.end_height  # the straight edge is flush with the blocks
    middle = 1j * float(profile.middle(np.array(near)))
    low = middle - 0.5j * height
    high = middle + 0.5j * height
    far = near + height
    right = polyline(near + low, far + low, far + high, near + high, near + low)
    left = polyline(-far + low, -near + low, -near + high, -far + high, -far + low)
    bodies = (
        Body("near", tuple(left), clamped=(3,), width=height),
        Body("far", tuple(right), width=height),
    )
    joint = Joint("hinge", (0, 1), 0j, 0.0, profile, max(height, profile.least_cut))
    points = ("far", Patch(1, 0j)), ("near", Patch(0, 0j))
    return Layout(bodies, (joint,), THICKNESS, E, NU, 2.7e-9, 500.0, points)


def compared(profile: Profile, resolution: int) -> tuple[Array, Array, int]:
    """Return compliance (3, 3) and highest stress (3,) over those of the beam, and the number of
    triangles.
    """
    layout = layout_of(profile)
    mesh = mesh_layout(layout, resolution)
    response = plate_response(layout, mesh)
    relative = np.hstack([np.eye(3), -np.eye(3)])
    beam = profile.compliance(E, NU, THICKNESS)
    compliance = relative @ response.compliance @ relative.T
    stress = hinge_stress(response, relative)[:, 0] / profile.stress(np.eye(3), THICKNESS)
    return np.diag(compliance) / np.diag(beam), stress, len(mesh.triangles)


def main() -> None:
    resolution = int(sys.argv[1]) if sys.argv[1:] else 8
    heads = ("rotation", "axial", "transv.", "moment", "axial", "transv.")
    print(
        f"{'':58}{'compliance':>27}{'stress':>27}\n"
        f"{'':58}{''.join(f'{head:>9}' for head in heads)}  triangles"
    )
    for shape, dimensions in CASES:
        profile = profile_of(shape, dimensions)
        sizes = (
            {"length": profile.length, "neck": profile.neck} if shape == "profile" else dimensions
        )
        shape = f"smooth {shape}" if dimensions.get("smooth") else shape
        stated = [
            f"{key} {value if isinstance(value, str) else f'{value:.3g}'}"
            for key, value in sizes.items()
        ]
        name = f"{shape} {', '.join(stated)}"
        compliance, stress, triangles = compared(profile, resolution)
        order = [2, 0, 1]
        numbers = "".join(f"{100 * (v - 1):9.1f}" for v in (*compliance[order], *stress[order]))
        print(f"{name:58}{numbers}  {triangles}")


if __name__ == "__main__":
    main()
