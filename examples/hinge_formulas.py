"""
Which hinge formula is right?
=============================

The figure shows the rotational compliance of a circular hinge by several formulas, divided by that
of finite elements of one hinge in plane stress. Some formulas are the same beam integral in
different algebra. These agree with one another and have the same error."""

from matplotlib import pyplot

import flexfem
from flexfem.questions.check import hinge_review, known_formulas

review = hinge_review()
figure, ax = pyplot.subplots(figsize=(8, 5), layout="constrained")
flexfem.plot.plot_formulas(ax, review, "rotation")

# %%
# The stiffness in X of the reference stage by each formula. The dimensions of the stage are
# assumed.

stage = flexfem.load("../geometry/mobility6.toml")
for name, known in known_formulas().items():
    stiffness = flexfem.analyse(stage, mobility=6, formula=name).stiffness[0, 0]
    low, high = known.t_over_R
    print(f"{name:24} {stiffness:7.2f} N/mm   valid for t/R from {low:g} to {high:g}")
