"""Why some claims hold or fail whatever the dimensions."""

COUNTED = "(1) counts bodies and freedoms; no dimension enters"
ACROSS = (
    "three-fold symmetry: a turn by 120 degrees leaves the stage as it is, so every linear map from commands to poses"
    " commutes with it; such a map has no entry between translations and rotation, and is on the plane a scaled turn,"
    " a + b J with J the turn by 90 degrees. The errors between translations and rotation are zero under any linear"
    " protocol. The error between X and Y is b, and zero under (18) because its two factors, compliance and stiffness,"
    " are symmetric matrices, each of which has b = 0; with joints commanded it need not be, unless the stage has a"
    " mirror line"
)
DIAGONAL = (
    "three-fold symmetry: the stiffness commutes with a turn by 120 degrees and is a symmetric matrix, so it is"
    " a 1 for the translations and couples none of them to the rotation"
)
LEAST_ENERGY = (
    "the energy is a positive definite quadratic form, and (29) its minimum on a plane: any other motion to the"
    " same pose adds the energy of the difference"
)
