"""
Which frame for an aluminium stage?
===================================

A temperature gradient of 1 K/mm across the stage moves the platform. The displacement is
proportional to the difference of the expansions of the stage and of its frame. The left plot shows
the stage on a steel frame, with exaggerated displacements. The right plot shows the displacement
over the expansion of the frame. Dimensions and coefficients are assumed."""

from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
flexfem.plot.plot_drift(left, flexfem.drift(stage, resolution=4), "gradient in x")

frames = {"invar": 1.3e-6, "titanium": 8.6e-6, "steel": 12e-6, "brass": 19e-6, "aluminium": 23.6e-6}
moved = {}
for name, expansion in frames.items():
    of = stage.replace(frame={"expansion": expansion})
    moved[name] = 1e3 * float(
        flexfem.drift(of, models="analytic").at("pose", case="gradient in x", direction="x")[0]
    )
right.plot([1e6 * each for each in frames.values()], list(moved.values()), "o-", color="0.2")
for name, expansion in frames.items():
    right.annotate(
        name, (1e6 * expansion, moved[name]), xytext=(-6, 6), textcoords="offset points", ha="right"
    )
right.set(xlabel="expansion of the frame (µm/(m K))", ylabel="x per gradient along x (µm per K/mm)")
right.set(xlim=(-3, 26), ylim=(-48, 5))
right.grid(color="0.9")
