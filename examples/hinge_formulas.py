"""
Which hinge formula is right?
=============================

Formulas for the rotation of a circular hinge, over finite elements of one hinge in plane stress. Several of them are
one beam integral in different algebra: they agree with one another and err alike.
"""

from matplotlib import pyplot

import flexfem

review = flexfem.hinge_review()
figure, ax = pyplot.subplots(figsize=(8, 5), layout="constrained")
flexfem.plot.plot_formulas(ax, review, "rotation")

# %%
# What the stage is worth by each of them: the stiffness in X of the reference stage, whose dimensions are assumed.

stage = flexfem.load("../geometry/mobility6.toml")
for name, known in flexfem.known_formulas().items():
    stiffness = flexfem.analyse(stage, mobility=6, formula=name).stiffness[0, 0]
    low, high = known.t_over_R
    print(f"{name:24} {stiffness:7.2f} N/mm   valid for t/R from {low:g} to {high:g}")
