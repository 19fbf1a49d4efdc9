"""
Which poses does the drive reach?
=================================

The figure shows the poses in x and y that six pairs of piezo stacks reach together. The limits are
the strokes and blocking forces of the stacks, contacts that only push, and yield of the necks. The
edges are numbered counter-clockwise, as `section` lists them. The script then prints the reach
along x for stacks that push link 1 farther from the base hinge. All numbers of the drive are
assumed."""

from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
figure, ax = pyplot.subplots(figsize=(6.5, 5.5), layout="constrained")
flexfem.plot.plot_section(ax, flexfem.reach(stage, models="analytic"))

# %%
# With a longer arm, the same stroke turns the hinge less:

for arm in (9.0, 10.0, 12.0):
    overrides = {(chain, "actuator", "base"): {"arm": arm} for chain in (1, 2, 3)}
    found = flexfem.reach(stage.replace(override=overrides), models="analytic")
    zero, free = (
        1e3 * found.at("ends", others=others, end="high", direction="x")[0]
        for others in ("zero", "free")
    )
    print(f"arm {arm:4.1f} mm: X to {zero:.1f} um, others at zero; {free:.1f} um, others free")
