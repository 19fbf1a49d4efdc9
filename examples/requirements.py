"""
Which neck and which link give a required stiffness?
====================================================

The script finds the longest range at yield in x with a stiffness of at least 60 N/mm. Two
dimensions of the reference stage are free. The analytic model finds the design; finite elements
correct and verify it. Dimensions are assumed."""

from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib import pyplot

import flexfem

WANTED = f"""
name = "Longest range in x at 60 N/mm"
stage = "{Path("../geometry/mobility6.toml").resolve().as_posix()}"
seed = 2003

[[free]]
label = "neck of elbow and platform"
keys = ["hinges.elbow.neck_mm", "hinges.platform.neck_mm"]
from = 0.3
to = 0.8
step = 0.01

[[free]]
label = "link 1"
key = "chain.link_lengths_mm[0]"
from = 26.0
to = 40.0
step = 0.5

[[require]]
label = "stiffness in x"
quantity = "kxx_n_per_mm"
at_least = 60.0

[[objective]]
label = "range at yield in x"
maximise = "range_x_um"
"""

with TemporaryDirectory() as folder:
    path = Path(folder) / "wanted.toml"
    path.write_text(WANTED)
    found = flexfem.run_design(path)

for name, value in found.design.items():
    print(f"{name}: {value:g} mm")
for each in (*found.objectives, *found.requirements):
    print(f"{each.label}: {each.value:.4g} ± {each.band:.2g} {each.unit} by {each.checked_by}")

# %%
# The figure shows the effect of a one per cent change of each dimension on both. The stage is
# printed as a file:

figure, axes = pyplot.subplots(1, 2, figsize=(9, 2.6), layout="constrained", sharey=True)
for ax, each in zip(axes, (*found.objectives, *found.requirements), strict=True):
    flexfem.plot.plot_sensitivity(ax, found, each.name)
    ax.set_title(each.label)

print(found.stage.partition("[provenance]")[0])
