"""Pictures of the cards on docs/index.md, drawn at every build from ready-made mechanisms, and for
the paper from its stage: some 35 s.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

FOLDER = Path(__file__).parents[1] / "reference"  # not kept by git
TURN = 0.07  # rad, amplitude of the pivot whose life is drawn
RANGE_LABEL = "displacement at first yield (mm)"
STIFFNESS_LABEL = "stiffness (N/mm)"
LEAST_STIFFNESS = 3.0  # N/mm, of the card on requirements


def pictures(folder: Path) -> dict[str, Callable[[Any], Any]]:
    """Functions that draw on axes, by the name of a card."""
    import numpy as np

    import flexfem
    from flexfem import plot
    from flexfem.plot.displaced import SHARE
    from flexfem.plot.fields import draw_field
    from flexfem.plot.plate import draw_plate

    def mechanism(kind: str) -> Any:
        path = folder / f"{kind}.toml"
        if not path.exists():
            flexfem.new_stage(path, kind=kind)
        return flexfem.load(path)

    def plate(ax: Any, kind: str) -> None:
        draw_plate(ax, mechanism(kind))
        ax.autoscale()
        ax.set_aspect("equal")
        ax.set_axis_off()

    def stressed(ax: Any) -> None:
        held = {"displacement": (0.1, 0.1, 0.0), "models": "elements", "resolution": 4}
        plot.plot_displacement(
            ax, flexfem.stiffness(mechanism("xy-stage"), **held).fields, factor=60.0
        )

    def moved(ax: Any, found: Any, name: str) -> None:
        """Draw a field by name, exaggerated and coloured by the displacement."""
        mesh = found.fields.mesh
        field = found.fields.made()[name]
        sizes = np.linalg.norm(field, axis=1)
        far = 0.07 * np.ptp(mesh.nodes, axis=0).max() / sizes.max()
        places = mesh.nodes + far * field
        draw_field(ax, mesh.nodes, mesh.triangles, places, sizes / sizes.max(), SHARE)
        ax.set_aspect("equal")
        ax.autoscale()

    def driven(ax: Any) -> None:
        found = flexfem.drive(mechanism("bridge-amplifier"), resolution=4)
        moved(ax, found, found.axes["actuator"][0])

    def vibrating(ax: Any) -> None:
        found = flexfem.modes(mechanism("double-parallelogram"), count=1, resolution=4)
        moved(ax, found, "mode 1")

    def heated(ax: Any) -> None:
        found = flexfem.drift(mechanism("parallelogram"), resolution=4)
        moved(ax, found, "gradient in x")

    def living(ax: Any) -> None:
        turned = {"amplitude": (0.0, 0.0, TURN), "models": "analytic"}
        plot.plot_life(ax, flexfem.life(mechanism("pivot"), **turned))
        ax.set(xlabel="cycles to failure", ylabel="stress amplitude (MPa)")

    def guides(ax: Any, look: str, sizes: Any) -> None:
        """Draw stiffness and displacement at first yield of parallelograms by neck and length."""
        base = mechanism("parallelogram")
        answers = list[Any]()
        for neck, length in sizes:
            changed = base.replace(parameters={"neck_mm": neck, "length_mm": length})
            answers.append(flexfem.stiffness(changed, models="analytic", no_limits=True))
        ax.plot(
            [float(each.at("free_yield_range", direction="x").item()) for each in answers],
            [float(each.at("free", direction="x").item()) for each in answers],
            look,
        )
        ax.set(xlabel=RANGE_LABEL, ylabel=STIFFNESS_LABEL)

    def varied(ax: Any) -> None:
        rng = np.random.default_rng(3)
        guides(ax, ".", rng.uniform([0.3, 35.0], [0.8, 65.0], (100, 2)))

    def required(ax: Any) -> None:
        guides(ax, "-", [(neck, 50.0) for neck in np.linspace(0.4, 0.8, 10)])
        ax.axhspan(0.0, LEAST_STIFFNESS, color="0.85")
        ax.text(0.04, 0.06, "not stiff enough", transform=ax.transAxes)

    def converging(ax: Any) -> None:
        found = flexfem.converge(mechanism("lever-amplifier"), resolutions=[2, 3, 4, 6])
        plot.plot_convergence(ax, found)

    def drawn(ax: Any) -> None:
        plot.plot_plate(ax, mechanism("four-chains"), labels=False)
        ax.set_axis_off()

    def verified(ax: Any) -> None:
        flexfem.new_stage(folder / "stage.toml", case=True)
        (result,) = flexfem.verification(folder / "stage-case.toml", output=None)
        plot.plot_errors(ax, result, "x")

    return {
        "drawing": lambda ax: plate(ax, "lever-amplifier"),
        "mechanism": lambda ax: plate(ax, "bridge-amplifier"),
        "ready-made": lambda ax: plate(ax, "pivot"),
        "stiffness": stressed,
        "reach": driven,
        "modes": vibrating,
        "heat": heated,
        "life": living,
        "studies": varied,
        "design": required,
        "parts": drawn,
        "accuracy": converging,
        "paper": verified,
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
