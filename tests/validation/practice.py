"""Mechanisms from practice with published or independent values: whole files, from the drawing to
the printed number.

The files are in the folder `mechanisms`. Each states the source of its dimensions. Independent
values come from finite elements of second order in plane stress that share no code with flexfem, or
from closed forms."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import flexfem
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions.stiffness import Stiffness
from flexfem.results import Result

from .problem import Finding, problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = Path(__file__).parent / "mechanisms"
PLANE = "finite elements"  # label of the plane ones among the models of a result
SOLID = "three dimensions"
NORMAL_TO_ARM = (0.342, 0.9397)  # unit vector, normal to the end face of the arm of both legs
OWN = "an independent mesh of second-order triangles in plane stress"


@cache
def mechanism(name: str, plane: bool = False) -> Mechanism:
    """The mechanism of a file, in plane stress if `plane`."""
    loaded = flexfem.load(FILES / f"{name}.toml")
    assert isinstance(loaded, MechanismFile)
    return loaded.replace(model="plane_stress") if plane else loaded


def drawing(name: str) -> Figure:
    """A picture of the mechanism of a file."""
    from flexfem.plot.plate import plot_plate

    axes = plot_plate(None, mechanism(name), labels=False)
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure


def stated(found: Result, quantity: str, **labels: str) -> tuple[float, float]:
    """A number of a result and its band, in the unit of the quantity."""
    return float(found.at(quantity, **labels)), float(found.band(quantity, **labels))


def unknowns(found: Stiffness) -> int:
    """Displacements of the nodes of the finest mesh."""
    assert found.fields is not None
    return int(found.fields.mesh.nodes.size)


@problem(
    "A load cell of 10 kg",
    "stiffness and stress of one elastic body without hinges",
    "dimensions: public repository load-cell-scad, src/load_cell_variants.scad, entry TAL220; "
    "targets: " + OWN,
    slow=True,
    mechanism="load-cell",
)
def load_cell() -> list[Finding]:
    """A bar with two overlapping holes, clamped on one side, loaded on the other with 98.1 N."""
    plane = flexfem.stiffness(mechanism("load-cell", plane=True), force=(0.0, 98.1, 0.0))
    solid = flexfem.stiffness(mechanism("load-cell"))
    size = unknowns(plane)
    stiffness, stiffness_band = stated(plane, "free", model=PLANE, direction="y")
    stress, stress_band = stated(plane, "body_stress", body="cell", model=PLANE)
    note = "the part itself, in three dimensions, is stiffer: {:.4g} ± {:.1g} N/mm".format(
        *stated(solid, "free", model=SOLID, direction="y")
    )
    return [
        Finding(
            "stiffness in plane stress, y (N/mm)",
            75.87,
            stiffness,
            0.05,
            0.005,
            size,
            note,
            stiffness_band,
        ),
        Finding("highest stress at 98.1 N (MPa)", 840.0, stress, 25.0, 10.0, size, "", stress_band),
    ]


def leg(name: str, independent: float, published: float) -> list[Finding]:
    """The displacement of the end face of a leg, 5 N normal to it, beside an independent mesh and
    the published one.
    """
    found = flexfem.stiffness(
        mechanism(name, plane=True), force=tuple(5.0 * part for part in (*NORMAL_TO_ARM, 0.0))
    )
    pose = found.at("pose", model=PLANE, point="output")
    displacement = float(np.hypot(pose[0], pose[1]))
    size = unknowns(found)
    direction = "the direction of the force is read from a figure"
    coarse = "the published value is the largest of a coarse mesh of elements in three dimensions"
    return [
        Finding(
            "displacement of the tip (mm)",
            independent,
            displacement,
            allowed=0.006 * independent,
            uncertainty=0.004 * independent,
            unknowns=size,
            note=direction,
        ),
        Finding(
            "the same, published (mm)",
            published,
            displacement,
            allowed=0.1 * published,
            uncertainty=0.05 * published,
            unknowns=size,
            note=coarse,
        ),
    ]


@problem(
    "A printed leg of a scale, concept 1",
    "displacement of an elastic body of polygons",
    "public repository BEng-Compliant-Mechanism-Scale, CAD/concept_1_v2.step and report, pp. "
    "18-20; " + OWN,
    mechanism="leg-1",
)
def leg_concept_1() -> list[Finding]:
    """An arm of ABS, its bottom face fixed, 5 N normal to its end face."""
    return leg("leg-1", 0.701, 0.67249)


@problem(
    "A printed leg of a scale, concept 3",
    "displacement of a slender elastic body of polygons",
    "public repository BEng-Compliant-Mechanism-Scale, CAD/concept_3_v2.step and report, pp. "
    "18-20; " + OWN,
    mechanism="leg-3",
)
def leg_concept_3() -> list[Finding]:
    """A longer arm of ABS, its bottom face fixed, 5 N normal to its end face."""
    return leg("leg-3", 9.53, 9.4314)


@problem(
    "A resonator of a thin film",
    "first natural frequency of a plate on four beams",
    "dimensions: COMSOL application library, Residual Stress in a Thin Film Resonator; targets: "
    "its closed form with massless beams, and " + OWN,
    slow=True,
    mechanism="resonator",
)
def resonator() -> list[Finding]:
    """The lateral resonance without and with a residual stress of 50 MPa."""
    plane = mechanism("resonator", plane=True)
    found = flexfem.modes(plane)
    first, band = stated(found, "frequency", model=PLANE, mode="1")
    size = int(found.fields.mesh.nodes.size) if found.fields is not None else 1
    stressed = flexfem.modes(plane.replace(material={"residual_stress": 50.0}))
    higher, higher_band = stated(stressed, "frequency", model=PLANE, mode="1")
    massless = "beams with their mass lower the frequency of the closed form by about 1.5 %"
    shape = "the closed form has massless beams with the shape of bending, which tension changes"
    return [
        Finding("first natural frequency (Hz)", 14757.0, first, 15.0, 1.0, size, "", band),
        Finding("the same, closed form (Hz)", 14989.0, first, 300.0, 225.0, size, massless, band),
        Finding(
            "with residual stress, closed form (Hz)",
            33_080.0,
            higher,
            1500.0,
            1000.0,
            size,
            shape,
            higher_band,
        ),
    ]


@problem(
    "A tendon finger",
    "leaves between links of another, stiff material, turned together",
    "dimensions: public repository Compliant-Mechanisms-Study, Finger_Sim_FreeCAD.py; target: "
    "its closed form, one spring a joint with E I / L, exact for rigid links under a moment",
    mechanism="tpu-finger",
)
def tendon_finger() -> list[Finding]:
    """The rotation of the last link under a moment of 10 N mm."""
    finger = mechanism("tpu-finger", plane=True)
    found = flexfem.stiffness(finger, models="analytic", force=(0.0, 0.0, 10.0))
    turned = float(found.at("pose", model="analytic", point="output", direction="theta"))
    return [Finding("rotation of the tip (rad)", 0.8144, turned, 0.002, 0.0005, 3)]


@problem(
    "A scanned neck",
    "a hinge whose two edges differ and are shifted",
    "dimensions: public repository FlexureWidth, Data/Batch 1/flexure1.dat; target: Paros and "
    "Weisbord, 2 E b t^2.5 / (9 pi sqrt(R)), with the mean curvature of both circles, in plane "
    "strain",
    slow=True,
    mechanism="scanned-neck",
)
def scanned_neck() -> list[Finding]:
    """The rotational stiffness of a neck of 15 um."""
    found = flexfem.stiffness(mechanism("scanned-neck"), force=(0.0, 0.0, 1e-3))
    stiffness, band = stated(found, "free", model=PLANE, direction="theta")
    return [
        Finding(
            "stiffness, theta (N mm/rad)", 1.493, stiffness, 0.015, 0.01, unknowns(found), "", band
        )
    ]


@problem(
    "A curved strip",
    "a curved elastic bar without hinges, at rest and at a finite displacement",
    "dimensions: public repository Flexure_Optimization, fem.py and main.py; targets: " + OWN,
    slow=True,
    mechanism="curved-strip",
)
def curved_strip() -> list[Finding]:
    """A strip clamped at both feet and loaded at its middle, by 30 N at a finite displacement."""
    load = (0.0, -30.0, 0.0)
    strip = mechanism("curved-strip", plane=True)
    rest = flexfem.stiffness(strip, force=load)
    stiffness, band = stated(rest, "free", model=PLANE, direction="y")
    spline = "the independent mesh follows the spline, the file its points"
    bent = float(
        flexfem.large(strip, force=load).at("pose", theory=PLANE, load="100 %", direction="y")
    )
    return [
        Finding(
            "stiffness, y (N/mm)", 9.542, stiffness, 0.02, 0.0005, unknowns(rest), spline, band
        ),
        Finding("displacement at -30 N (mm)", -4.381, bent, 0.02, 0.0005, unknowns(rest)),
    ]


@problem(
    "One level of a linearised stage",
    "stiffness of short leaves between legs, and the drop of the stage at a finite displacement",
    "dimensions: public repository openflexure_linearised_xy_stage, "
    "openscad/linearised_stage.scad; targets: closed forms 4 E I / (l lever^2) and lever (1 - "
    "cos 0.12) with rigid legs",
    mechanism="openflexure-level",
)
def openflexure_level() -> list[Finding]:
    """Two legs with four leaves, at rest and driven by 3.6 mm."""
    level = mechanism("openflexure-level", plane=True)
    stiffness = float(
        flexfem.stiffness(level, models="analytic").at("free", model="analytic", direction="x")
    )
    moved = flexfem.large(level, amplitude=3.6, models="analytic").at(
        "pose", theory="beams", load="100 %"
    )
    note = "the leaves also shear, which the closed form leaves out"
    return [
        Finding("stiffness, x (N/mm)", 1.198, stiffness, 0.006, 0.0005, 3, note),
        Finding("drop at 3.6 mm (mm)", -0.216, float(moved[1]), 0.002, 0.0005, 3),
    ]


@problem(
    "A bistable shuttle",
    "the whole curve of force against displacement, past its limits",
    "dimensions: public repository compliant_mechanisms, bistable.scad; targets: "
    + OWN
    + ", driven by displacement",
    slow=True,
    mechanism="bistable",
)
def bistable_shuttle() -> list[Finding]:
    """A shuttle between four inclined limbs, pushed from one stable position to the other."""
    found = flexfem.large(mechanism("bistable", plane=True), amplitude=-12.0, resolution=4)
    limit = {"event": "limit of the force 1", "theory": PLANE, "direction": "y"}
    rest = {"event": "stable position without force 1", "theory": PLANE, "direction": "y"}
    force, band = stated(found, "event_force", **limit)
    position = float(found.at("event_pose", **rest))
    return [
        Finding("force at which it snaps (N)", -48.7, force, 0.7, 0.05, 3, "", band),
        Finding("second stable position (mm)", -8.9, position, 0.06, 0.05, 3),
    ]


@problem(
    "A strip with a hole",
    "stress of a body at a stated point",
    "dimensions: CalculiX-Examples, Linear/StressConc1; target: " + OWN,
    slow=True,
    mechanism="strip-with-hole",
)
def strip_with_hole() -> list[Finding]:
    """The stress at the edge of the hole, of a bending moment whose nominal stress is 1 MPa."""
    found = flexfem.stiffness(mechanism("strip-with-hole", plane=True), force=(0.0, 0.0, 600.0))
    stress, band = stated(found, "point_stress", point="edge of the hole", model=PLANE)
    return [
        Finding(
            "von Mises stress at the hole (MPa)",
            1.09,
            stress,
            0.02,
            0.005,
            unknowns(found),
            "",
            band,
        )
    ]


@problem(
    "A column that buckles",
    "the lowest buckling load of a clamped and free beam",
    "dimensions: issue 74 of CalculiX; target: Euler, pi^2 E I / (2 L)^2",
    mechanism="column",
)
def column() -> list[Finding]:
    """The load on the free end of a bar of 100 x 100 x 3000 mm at which it buckles in the plane."""
    found = flexfem.stiffness(mechanism("column"), models="analytic")
    load = -float(found.at("buckling_load", others="free", sense="negative", direction="x"))
    note = "the analytic model has the shear of the bar, Euler has not"
    return [Finding("buckling load (N)", 479_756.0, load, 500.0, 1.0, 3, note)]


@problem(
    "A torsional accelerometer",
    "a natural frequency out of the plane",
    "public repository LMGT_MEMS_component_library, uniaxial_accelerometer/accelZa_02.vhd "
    "(ANSYS); dimensions: public repository APDL_scripts, accelerometer/a_00_layout.mac",
    slow=True,
    mechanism="accelerometer",
)
def accelerometer() -> list[Finding]:
    """The tilt of a plate about two torsion bars."""
    found = flexfem.modes(mechanism("accelerometer"))
    first, band = stated(found, "first_out_of_plane")
    size = int(found.fields.mesh.nodes.size) if found.fields is not None else 1
    note = "polysilicon is orthotropic; here it is isotropic with the shear modulus of the source"
    return [Finding("first natural frequency (Hz)", 1205.3, first, 36.0, 12.0, size, note, band)]


@problem(
    "A notch of three rows",
    "the beam integral of straight edges",
    "exact: integral of 12 / (E b h^3) over a height that falls linearly from 6 to 1 mm and "
    "rises again",
    mechanism="vee",
)
def vee() -> list[Finding]:
    """The rotational stiffness of a V given by a table."""
    found = flexfem.stiffness(mechanism("vee", plane=True), models="analytic")
    stiffness = float(found.at("free", model="analytic", direction="theta"))
    return [Finding("stiffness, theta (N mm/rad)", 61_457.142857, stiffness, 1e-3, 0.0, 3)]


@problem(
    "Drift of a stage in plane strain",
    "thermal expansion with a frame of another material in plane strain",
    "closed form: expansion of the plate relative to its frame, times 1 + nu",
    mechanism="strain-drift",
)
def strain_drift() -> list[Finding]:
    """Displacement per kelvin of a stage at a distance from its ground."""
    found = flexfem.drift(mechanism("strain-drift"), models="analytic")
    pose = 1e6 * float(found.at("pose", case="uniform", model="analytic", direction="y").ravel()[0])
    return [Finding("displacement, y (nm/K)", 776.45, pose, 0.01, 0.005, 3)]
