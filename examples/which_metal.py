"""
Which metal has the longest range?
==================================

The figure shows the range at yield and the stiffness of the same stage in each of the registered
metals. A metal with a high strength for its modulus has a long range. The analytic model has
calibrated hinges and elastic links. Dimensions are assumed."""

from matplotlib import pyplot

import flexfem
from flexfem.mechanism.materials import materials

stage = flexfem.load("../geometry/mobility6.toml")
found = {}
for name in materials():
    model = flexfem.analyse(stage.replace(material=name), formula="calibrated", links=True)
    found[name] = (1e3 * model.range_at_yield[0], model.stiffness[0, 0])

figure, ax = pyplot.subplots(figsize=(8, 4.8), layout="constrained")
ax.scatter(*zip(*found.values(), strict=True), color="0.2", zorder=3)
for index, (name, at) in enumerate(found.items()):
    ax.annotate(
        name, at, xytext=(7, -8 if index % 2 else 3), textcoords="offset points", fontsize=9
    )
ax.set(
    xlabel="range at yield in x (µm)",
    ylabel="stiffness in x (N/mm)",
    xlim=(0, 1.35 * max(x for x, _ in found.values())),
)
ax.grid(color="0.9")

# %%
# The life for a motion to 320 µm and back, for the metals whose fatigue constants are known:

for name, metal in materials().items():
    if metal.fatigue_strength_coefficient:
        life = flexfem.life(
            stage.replace(material=name), amplitude=(0.16, 0, 0), ratio=0.0, models="analytic"
        )
        hinge = life.axes["hinge"][life.cycles.argmin() % 3]
        print(
            f"{name:16} {life.life[0]:.2g} cycles, the {hinge} hinge first",
            *life.warnings,
            sep="\n    ",
        )
