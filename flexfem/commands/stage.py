"""Commands on one stage: check, summary, stiffness, solve, mesh; and the hinge formulas."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import console, tables
from flexfem.commands.options import Json, Resolution, Stage, Wanted, check_within
from flexfem.refused import BadInput

app = typer.Typer()
LARGEST_FORCE = 1e9  # N, N mm; no stage of metal bears a millionth of it
LARGEST_DISPLACEMENT = 1e4  # mm, rad; no stage is larger


@app.command()
def check(stage: Stage, json: Json = False) -> None:
    """Validate a stage file; print dimensions, hinges, mobility and where the numbers come from."""
    from flexfem.commands import answers
    from flexfem.stage.schema import load_feasible

    console.show(answers.of_stage(load_feasible(stage)), json, tables.print_stage)


@app.command()
def summary(
    stage: Stage,
    formula: Annotated[
        str | None, typer.Option(help="Hinge formula by name; default calibrated, where it has a value.")
    ] = None,
    elements: Annotated[bool, typer.Option("--elements", help="Also by finite elements.")] = False,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """How far a stage may go before a neck yields, the force that takes, its stiffness, and warnings."""
    from flexfem.analytic import formulas
    from flexfem.stage.schema import load_feasible
    from flexfem.verify import summary as verify

    loaded = load_feasible(stage)
    formulas.formula(formula or "calibrated")
    solved = None
    if elements or resolution is not None:
        from flexfem.fem.mesh import RESOLUTION
        from flexfem.verify.protocol import solve_stage

        solved = solve_stage(loaded, resolution or RESOLUTION)
    found = verify.summary(loaded, formula, solved)
    console.show(found, json, tables.print_summary)


@app.command()
def stiffness(
    stage: Stage,
    mobility: Annotated[int | None, typer.Option(help="3, 6, 12 or 21; default: the file's prismatic hinges.")] = None,
    formula: Annotated[str, typer.Option(help="Hinge formula by name; a wrong one lists them.")] = "paros-weisbord",
    links: Annotated[bool, typer.Option("--links", help="Elastic links, pads and platform; mobility 21.")] = False,
    json: Json = False,
) -> None:
    """Platform stiffness by the analytic model, (16) to (18)."""
    from flexfem.analytic import formulas
    from flexfem.analytic.kinematics import freedoms_of
    from flexfem.analytic.model import analyse
    from flexfem.commands import answers
    from flexfem.stage.schema import load_feasible

    loaded = load_feasible(stage)
    formulas.formula(formula)
    freedoms_of(mobility or 3)
    if links and mobility not in (None, 21):
        raise BadInput(
            f"--links --mobility {mobility}, expected 21 or none: elastic links go with all freedoms of the hinges"
        )
    found = analyse(loaded, mobility, formula, links)
    console.show(answers.of_model(loaded, found), json, tables.print_analytic)


@app.command()
def mesh(
    stage: Stage,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write: .msh, .vtu or .inp.")],
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Mesh a stage and write it with the groups stage, ground and hub."""
    from flexfem.commands import answers
    from flexfem.fem.export import check_format, write_mesh
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.fem.response import plate_of
    from flexfem.fem.sectors import build_mesh
    from flexfem.files.writing import check_folder
    from flexfem.stage.schema import load_feasible

    loaded = load_feasible(stage)
    check_format(output)
    check_folder(output.parent)
    plate = plate_of(loaded)
    made = build_mesh(loaded, resolution or RESOLUTION)
    write_mesh(made, plate, output)
    console.show(answers.of_mesh(loaded, made, resolution or RESOLUTION, output), json, tables.print_plain)


@app.command()
def solve(
    stage: Stage,
    force: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="FX FY M", help="Load at the platform centre: N, N, N mm."),
    ] = None,
    displacement: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="X Y THETA", help="Instead: displacement of the platform to hold: mm, mm, rad."),
    ] = None,
    vtu: Annotated[Path | None, typer.Option(help="Write displacement and stress under the load to this file.")] = None,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Platform compliance by finite elements in the plane, and what a force or a displacement of the platform does."""
    import numpy as np

    from flexfem.commands import answers
    from flexfem.fem.export import write_vtu
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.fem.response import load_case
    from flexfem.stage.schema import load_feasible
    from flexfem.verify.protocol import solve_stage

    loaded = load_feasible(stage)
    if force is not None and displacement is not None:
        raise BadInput("--force and --displacement, expected one of the two")
    check_within("--force", force, LARGEST_FORCE)
    check_within("--displacement", displacement, LARGEST_DISPLACEMENT)
    if vtu is not None and vtu.suffix != ".vtu":
        raise BadInput(f"--vtu {vtu}, expected a file name that ends in .vtu")
    solved = solve_stage(loaded, resolution or RESOLUTION)
    load = np.array(force or (0.0, 0.0, 0.0))
    if displacement is not None:
        load = np.linalg.solve(solved.response.compliance, np.array(displacement))
    case = load_case(loaded, solved.mesh, solved.response, load)
    if vtu is not None:
        write_vtu(solved.mesh, vtu, {"displacement": case.field, "von_mises": case.stress})
    found = answers.of_solution(loaded, solved, case, resolution or RESOLUTION)
    console.show(found, json, tables.print_solution)


@app.command()
def formulas(output: Wanted = None, json: Json = False) -> None:
    """List the hinge formulas with source, freedoms and range; draw them against the finite-element hinge chart."""
    from flexfem.verify import hinges

    if output is not None:
        from flexfem.plot.hinge_chart import hinge_chart_figure, thickness_figure
        from flexfem.plot.write import write_beside

        write_beside(output / "hinge-chart.json", hinge_chart_figure(hinges.hinge_review()))
        write_beside(output / "hinge-thickness.json", thickness_figure(hinges.thickness_review()))
    console.show(hinges.known_formulas(), json, tables.print_formulas)
