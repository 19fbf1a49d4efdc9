"""What the finite elements of a case are and what they were given, in words: a force, rotations, or strokes."""

from __future__ import annotations

from flexfem.questions.case import Drive, Elements

OF_STAGE: dict[Elements, str] = {"fe": "", "three_dimensional": ", in three dimensions"}
BANDS: dict[Elements, str] = {"fe": "mesh band", "three_dimensional": "band of mesh and layers"}
SHOWN_OF_SOLID = "Displacement of the mid-plane; stress: the highest through the thickness."
EXTRUDED = (
    "In three dimensions the stage is extruded: wedges of 18 nodes in layers, both faces free. Bands are then of the "
    "mesh in the plane and of the layers, whose share is the change from fewer to more of them times 1.25."
)
COMMANDED: dict[Drive, str] = {"force": "", "joints": ", joints imposed", "strokes": ", strokes commanded"}
BRIEF: dict[Drive, str] = {
    "force": "force by (18)",
    "joints": "joints imposed by (29)",
    "strokes": "strokes commanded by (29)",
}
METHOD: dict[Drive, str] = {
    "force": (
        "The force that the analytic model predicts for a platform displacement by (18){exact} is applied to the "
        "finite-element stage."
    ),
    "joints": (
        "Where joints are imposed, the hinges of the finite-element stage are given the rotations that the model "
        "computes for the displacement by (29) and (30), those of the base with mobility three, else of base and "
        "elbow, and no force is on the platform. A hinge turns by the mean rotation of the sections directly beyond "
        "its notch less that of those directly before."
    ),
    "strokes": (
        "Where strokes are commanded, the stacks of the finite-element stage are given the strokes that the model "
        "computes for the displacement by least energy, and no force is on the platform."
    ),
}
