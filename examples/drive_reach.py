"""
What does the drive reach?
==========================

Poses in X and Y that six pairs of stacks reach together, within their strokes, contacts that only push, blocking
forces and yield; and how far along X when the stacks push link 1 farther from the base hinge. All numbers of the drive
are assumed. The figure numbers the edges counter-clockwise, as `section` lists them.
"""

from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
figure, ax = pyplot.subplots(figsize=(6.5, 5.5), layout="constrained")
flexfem.plot.plot_section(ax, flexfem.reach(stage, models="analytic"))

# %%
# A longer arm turns the hinge less for the same stroke:

for arm in (9.0, 10.0, 12.0):
    overrides = {(chain, "actuator", "base"): {"arm": arm} for chain in (1, 2, 3)}
    found = flexfem.reach(stage.replace(override=overrides), models="analytic")
    zero, free = (1e3 * found.at("ends", others=others, end="high", direction="x")[0] for others in ("zero", "free"))
    print(f"arm {arm:4.1f} mm: X to {zero:.1f} um, others at zero; {free:.1f} um, others free")
