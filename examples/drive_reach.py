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
flexfem.plot.plot_section(ax, flexfem.reach(stage, resolution=None))

# %%
# A longer arm turns the hinge less for the same stroke:

for arm in (9.0, 10.0, 12.0):
    overrides = {(chain, "actuator", "base"): {"arm": arm} for chain in (1, 2, 3)}
    x = flexfem.reach(stage.replace(override=overrides), resolution=None).ranges["x"]
    print(
        f"arm {arm:4.1f} mm: X to {1e3 * x.held.high:.1f} um, others at zero; {1e3 * x.free.high:.1f} um, others free"
    )
