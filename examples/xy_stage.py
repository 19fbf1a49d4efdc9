"""
A mechanism of your own
=======================

The left plot shows a ready-made mechanism, an XY stage with two piezoelectric actuators. The right
plot shows it by finite elements: the stage is held at 100 µm in x, drawn 60 times larger. The
colours show the von Mises stress. All dimensions are assumed."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib import pyplot
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm

import flexfem

with TemporaryDirectory() as folder:
    file = Path(folder) / "mine.toml"
    flexfem.new_stage(file, kind="xy-stage")
    mechanism = flexfem.load(file)

found = flexfem.stiffness(mechanism, displacement=(0.1, 0, 0), resolution=4)
figure, (left, right) = pyplot.subplots(1, 2, figsize=(14, 7), layout="constrained")
norm = LogNorm(0.01, 100)  # MPa
figure.colorbar(ScalarMappable(norm), ax=right, label="von Mises stress (MPa)", shrink=0.8)
figure.suptitle(
    f"assumed dimensions: {len(mechanism.assumed)} numbers", color="#a00000", fontsize=11
)
figure.draw_without_rendering()  # determines the size of the axes, which the labels need
flexfem.plot.plot_plate(left, mechanism)
flexfem.plot.plot_displacement(right, found.fields, factor=60.0, norm=norm)
left.set_title("flexfem view")
right.set_title("flexfem stiffness --displacement 0.1 0 0")

if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=100)
