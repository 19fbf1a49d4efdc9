"""
How fast may the platform be driven?
====================================

The figure shows the response of the platform to a force in x over the frequency, without and with a
payload of 50 g. The damping, 1 % of critical, and the dimensions are assumed."""

import numpy as np
from matplotlib import pyplot

import flexfem
from flexfem.paper.modes import dynamic_model

stage = flexfem.load("../geometry/mobility6.toml")
models = {
    payload: dynamic_model(stage, count=6, payload=payload, resolution=4)
    for payload in ((0.0, 0.0), (0.05, 10.0))
}
figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.2), layout="constrained", sharey=True)
for ax, (payload, model) in zip(axes, models.items(), strict=True):
    flexfem.plot.plot_response(ax, model, "x")
    ax.set_title(f"payload {1e3 * payload[0]:g} g", loc="left")

# %%
# The lowest eigenfrequencies by finite elements:

for payload, model in models.items():
    lowest = model.frequencies[:3] / (2 * np.pi)
    print(f"payload {1e3 * payload[0]:g} g:", ", ".join(f"{one:.1f} Hz" for one in lowest))
