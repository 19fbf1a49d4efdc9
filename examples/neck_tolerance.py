"""
How does a tolerance of the necks change the stiffness?
=======================================================

Each of the nine necks deviates by its own amount from the drawn width. The figure shows the scatter
of the stiffness, and the coupling of x and y, which is zero on a symmetric stage. The analytic
model computes 400 stages. Their necks are drawn from a normal distribution with a standard
deviation of 5 µm. Dimensions and scatter are assumed."""

import numpy as np
from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
scatter = 0.005  # mm, standard deviation
rng = np.random.default_rng(7)
hinges = [(chain, hinge) for chain in (1, 2, 3) for hinge in ("base", "elbow", "platform")]


def drawn():
    """Return the stiffness (3, 3) of one stage with random deviations of its necks."""
    necks = 0.5 + scatter * rng.standard_normal(9)
    cut = stage.replace(
        override={at: {"neck": neck} for at, neck in zip(hinges, necks, strict=True)}
    )
    return flexfem.analyse(cut, formula="calibrated", mobility=21).stiffness


K = np.array([drawn() for _ in range(400)])
nominal = flexfem.analyse(stage, formula="calibrated", mobility=21).stiffness
deviation = 100 * (K[:, 0, 0] / nominal[0, 0] - 1)
coupling = 100 * K[:, 0, 1] / np.sqrt(K[:, 0, 0] * K[:, 1, 1])

figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
left.hist(deviation, bins=30, color="0.6", edgecolor="0.2")
left.set(xlabel="deviation of K_xx (%)", ylabel="stages")
right.hist(coupling, bins=30, color="0.6", edgecolor="0.2")
right.set(xlabel="coupling of x and y, K_xy / √(K_xx K_yy) (%)", ylabel="stages")

# %%
# 95 % of the stages lie within:

for name, values in (("K_xx", deviation), ("coupling of x and y", coupling)):
    low, high = np.percentile(values, [2.5, 97.5])
    print(f"{name}: {low:+.2f} to {high:+.2f} %")
