"""Pictures of the cards on docs/index.md, drawn at every build from ready-made stages and
mechanisms: some 20 s.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

FOLDER = Path(__file__).parents[1] / "reference"  # not kept by git


def pictures(folder: Path) -> dict[str, Callable[[Any], Any]]:
    """Functions that draw on axes, by the name of a card."""
    import numpy as np

    import flexfem
    from flexfem import plot
    from flexfem.plot.plate import draw_plate

    def mechanism(kind: str) -> Any:
        flexfem.new_stage(folder / f"{kind}.toml", kind=kind)
        return flexfem.load(folder / f"{kind}.toml")

    def plate(ax: Any, kind: str) -> None:
        draw_plate(ax, mechanism(kind))
        ax.autoscale()
        ax.set_aspect("equal")
        ax.set_axis_off()

    def displaced(ax: Any) -> None:
        held = {"displacement": (0.1, 0.1, 0.0), "models": "elements", "resolution": 4}
        plot.plot_displacement(
            ax, flexfem.stiffness(mechanism("xy-stage"), **held).fields, factor=60.0
        )

    def reached(ax: Any) -> None:
        plot.plot_section(ax, flexfem.reach(stage, models="analytic"))
        for text in list(ax.texts):
            text.remove()

    def life(ax: Any) -> None:
        metal = stage.replace(material="ti-6al-4v-sta")
        plot.plot_life(ax, flexfem.life(metal, amplitude=(0.5, 0.0, 0.0), models="analytic"))
        ax.set(xlabel="cycles to failure", ylabel="stress amplitude (MPa)")

    def stages(ax: Any, look: str, designs: Any) -> None:
        models = [flexfem.analyse(stage.replace(neck={"elbow": a, "base": b})) for a, b in designs]
        ax.plot(
            [1e3 * each.range_at_yield[0] for each in models],
            [each.stiffness[0, 0] for each in models],
            look,
        )
        ax.set(xlabel="range at yield (µm)", ylabel="stiffness (N/mm)")

    def required(ax: Any) -> None:
        stages(ax, "-", [(neck, neck) for neck in np.linspace(0.35, 0.8, 10)])
        ax.axhspan(*ax.get_ylim()[:1], 60.0, color="0.85")
        ax.text(0.04, 0.06, "not stiff enough", transform=ax.transAxes)

    flexfem.new_stage(folder / "stage.toml", case=True)
    stage = flexfem.load(folder / "stage.toml")
    return {
        "drawing": lambda ax: plate(ax, "lever-amplifier"),
        "mechanism": lambda ax: plate(ax, "bridge-amplifier"),
        "ready-made": lambda ax: plate(ax, "pivot"),
        "stiffness": displaced,
        "reach": reached,
        "modes": lambda ax: plot.plot_mode(ax, flexfem.modes(stage, count=1, resolution=4), 1),
        "heat": lambda ax: plot.plot_drift(ax, flexfem.drift(stage, resolution=4), "gradient in x"),
        "life": life,
        "studies": lambda ax: stages(ax, ".", np.random.default_rng(3).uniform(0.3, 1.0, (100, 2))),
        "design": required,
        "parts": lambda ax: (plot.plot_plate(ax, stage, labels=False), ax.set_axis_off()),
        "accuracy": lambda ax: plot.plot_convergence(
            ax, flexfem.converge(stage, resolutions=[2, 3, 4, 6])
        ),
        "paper": lambda ax: plot.plot_errors(
            ax, flexfem.verification(folder / "stage-case.toml", output=None)[0], "x"
        ),
    }


def write() -> None:
    """Draw all pictures, without titles and legends."""
    from matplotlib import pyplot

    FOLDER.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder:
        for name, draw in pictures(Path(folder)).items():
            figure, ax = pyplot.subplots(figsize=(3.6, 2.7), layout="constrained")
            draw(ax)
            ax.set_title("")
            for legend in filter(None, [ax.get_legend()]):
                legend.remove()
            figure.savefig(FOLDER / f"card-{name}.png", dpi=150)
            pyplot.close(figure)


def setup(app: Any) -> dict[str, bool]:
    """For Sphinx."""
    app.connect("builder-inited", lambda _: write())
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write()
