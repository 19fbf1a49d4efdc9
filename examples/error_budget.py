"""
Where does the error come from?
===============================

The figure splits the error of the analytic model of the paper in x into shares that add up to it,
for necks of 0.2 and 0.5 mm. Formula (2) was made for thin necks; for thick necks it causes most of
the error. Dimensions are assumed."""

from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
necks = (0.2, 0.5)
found = [flexfem.budget(stage.replace(neck=neck), resolution=4, plane=True) for neck in necks]

figure, axes = pyplot.subplots(2, 1, figsize=(9, 6), layout="constrained", sharex=True)
for ax, neck, budget in zip(axes, necks, found, strict=True):
    flexfem.plot.plot_budget(ax, budget, "x")
    ax.set_title(f"all necks {neck} mm", loc="left")

# %%
# The numbers, in percentage points of the command:

for neck, budget in zip(necks, found, strict=True):
    *shares, total = zip(budget.axes["share"], budget.at("share", direction="x"), strict=True)
    print(
        f"necks {neck} mm: {total[1]:.2f} ± "
        f"{budget.band('share', share='total', direction='x'):.2f} in all"
    )
    for name, points in shares:
        print(f"    {points:+7.2f}  {name}")
