"""
What does a tolerance of the necks cost?
========================================

Nine necks, each off by its own amount: by how much does the stiffness scatter, and what couples that symmetry keeps
apart? 400 stages by the analytic model, whose necks are drawn from a normal distribution of 5 µm; dimensions and
scatter are assumed.
"""

import numpy as np
from matplotlib import pyplot

import flexfem

stage = flexfem.load("../geometry/mobility6.toml")
scatter = 0.005  # mm, standard deviation
rng = np.random.default_rng(7)
hinges = [(chain, hinge) for chain in (1, 2, 3) for hinge in ("base", "elbow", "platform")]


def drawn():
    """The stiffness (3, 3) of one stage as it may be cut."""
    necks = 0.5 + scatter * rng.standard_normal(9)
    cut = stage.replace(override={at: {"neck": neck} for at, neck in zip(hinges, necks, strict=True)})
    return flexfem.analyse(cut, formula="calibrated", mobility=21).stiffness


K = np.array([drawn() for _ in range(400)])
nominal = flexfem.analyse(stage, formula="calibrated", mobility=21).stiffness
deviation = 100 * (K[:, 0, 0] / nominal[0, 0] - 1)
coupling = 100 * K[:, 0, 1] / np.sqrt(K[:, 0, 0] * K[:, 1, 1])

figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
left.hist(deviation, bins=30, color="0.6", edgecolor="0.2")
left.set(xlabel="deviation of K_xx (%)", ylabel="stages")
right.hist(coupling, bins=30, color="0.6", edgecolor="0.2")
right.set(xlabel="coupling of X and Y, K_xy / √(K_xx K_yy) (%)", ylabel="stages")

# %%
# 95 % of the stages lie within:

for name, values in (("K_xx", deviation), ("coupling of X and Y", coupling)):
    low, high = np.percentile(values, [2.5, 97.5])
    print(f"{name}: {low:+.2f} to {high:+.2f} %")
