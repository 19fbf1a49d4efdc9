"""What the output columns of a study mean, by groups of columns, in their order."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from flexfem.study import outputs

MEANINGS: Mapping[tuple[str, ...], str] = MappingProxyType(
    {
        outputs.STIFFNESSES: "stiffness of the platform, `K_ij`: along one direction with the other two held",
        outputs.COUPLINGS: "`K_ij / sqrt(K_ii K_jj)`",
        outputs.STRESSES: "highest von Mises stress at a neck per displacement of the platform in that direction, "
        "the others held; `fe`: up to 1 % low at resolution 4, by the square of it less at a finer one, which "
        "labels, captions and `study status` say; `analytic`: bending and tension with Neuber's stress "
        'concentration, shear left out. Against finite elements: within 1 % with `formula = "calibrated"` and '
        "`links`, 1 to 9 % high with rigid links; 10 to 22 % high with the default formula and `links`, 14 to 34 % "
        "with rigid links, because its hinges are too stiff (`benchmarks/stress.py`). On a base stage with "
        '`model = "corrected"`: within 2 % of three dimensions with `formula = "calibrated"` and `links` '
        "(`benchmarks/solid_stress.py`)",
        outputs.RANGES: "displacement at which the first hinge yields; low by as much as the stress is high",
        outputs.ENVELOPE: "diameter of the circle about the platform centre that holds the stage",
        outputs.TRAVELS: "with `[drive]` `stroke_um`: displacement at which the first base hinge has turned by "
        "stroke over lever arm. No other hinge, contact or force is counted: what a drive really reaches is less, "
        "`drive_range_x_um`",
        outputs.DRIVE_RANGES: "with `[drive]` `actuators`: how far commands drive the platform from rest with the "
        "other two directions at zero, within strokes, contacts (none may be lost), blocking forces and yield, as "
        "`flexfem reach` has it (`held`), without load: the lesser of both ways, so zero where single stacks go "
        "one way only; `fe`: with what necks carry by the finite elements",
        outputs.ENGAGED: "with `[drive]` `actuators`: stiffness with the stacks holding their strokes, the "
        "other two directions held; links "
        "that are rigid make it 50 % too large on the reference stages, elastic ones agree with `fe` within 0.3 %",
        outputs.FREQUENCIES: "with `[frequencies]`: the three lowest natural frequencies in the plane, drives "
        "disengaged; `analytic`: platform and links as rigid bodies (with `links` on elastic links) on the model's "
        "hinges, the default formula's 6 to 7 % high on the reference stages because its hinges are too stiff, "
        "calibrated with `links` within 0.01 %; `fe`: as `flexfem modes` on one mesh. Modes out of the plane, which "
        "can lie lower, are not in it",
        (
            "life_cycles",
            *outputs.LIFE_AMPLITUDES,
            "safety_factor",
        ): "with `[life]`: cycles at the amplitude, the amplitude of each moved direction for the wanted life, and "
        "yield strength over the largest neck stress on the way, as `flexfem life` has them. A life is out by ten "
        "times what the stress is: calibrated hinges with `links`, or `fe`, or it means little. Lives beyond yield, "
        "or beyond the cycles of Basquin's law, are counted as such. Preloads of single stacks are not in them",
        outputs.DRIFTS: "with `[drift]`: pose per kelvin of a uniform change, as `flexfem drift` has it; in X and Y "
        "round-off where chains are alike",
        outputs.GRADIENTS: "with `[drift]`: largest translation, and largest rotation, by a gradient of 1 K/mm of "
        "any direction in the plane about the platform's centre; each has a direction of its own. All five numbers "
        "of drift against finite elements, on the reference stages and one with three other hinges: calibrated "
        "hinges with `links` within 0.2 %, rigid links, which leave out that the frame bows the clamped edges, "
        "within 1.4 % with calibrated hinges and 13 % with the default formula. Stacks, and gradients through the "
        "thickness, are not in them",
        outputs.ERRORS: "`verify`: error along the command",
        outputs.CROSSES: "`verify`: largest error across the command",
        outputs.BANDS: "`verify` with `bands`: mesh band of the error along the command",
    }
)
