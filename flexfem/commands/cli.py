"""The command line. Exit 0 done, 1 a check or a computation failed, 2 bad input."""

from __future__ import annotations

import math
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from flexfem.commands import streams
from flexfem.commands.study import app as study_app
from flexfem.errors import BadInput, ComputationFailed, SourcesChanged

app = typer.Typer(
    help="Verification and design of planar flexure-hinge stages.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(study_app, name="study")

LARGEST_FORCE = 1e9  # N, N mm; no stage of metal bears a millionth of it

LARGEST_DISPLACEMENT = 1e4  # mm, rad; no stage is larger

Stage = Annotated[Path, typer.Argument(help="Stage file, see geometry/README.md.", metavar="STAGE")]
Cases = Annotated[list[Path], typer.Argument(help="Case files, see cases/README.md.", metavar="CASE...")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Resolution = Annotated[int | None, typer.Option(min=2, max=64, help="Triangles across every neck.")]
Baselines = Annotated[Path | None, typer.Option(help="Folder of baselines; default `baselines` beside each file.")]


def _usable(folder: Path | None) -> Path | None:
    """Refuse an output folder before anything is computed for it."""
    if folder is not None:
        from flexfem.files.writing import check_folder

        check_folder(folder)
    return folder


FOLDER = typer.Option("--output", "-o", callback=_usable, help="Folder for what is written.")
Output = Annotated[Path, FOLDER]
Wanted = Annotated[Path | None, FOLDER]


def _print_version(wanted: bool) -> None:
    if wanted:
        from flexfem import __version__

        print(f"flexfem {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Verification and design of planar flexure-hinge stages."""


@app.command()
def check(stage: Stage, json: Json = False) -> None:
    """Validate a stage file; print dimensions, hinges, mobility and where the numbers come from."""
    from flexfem.commands import console, facts, tables
    from flexfem.stage.feasibility import load_feasible

    console.show(facts.stage_facts(stage, load_feasible(stage)), json, tables.print_stage)


@app.command()
def stiffness(
    stage: Stage,
    mobility: Annotated[int | None, typer.Option(help="3, 6, 12 or 21; default: the file's prismatic hinges.")] = None,
    formula: Annotated[str, typer.Option(help="Hinge formula by name; a wrong one lists them.")] = "paros-weisbord",
    links: Annotated[bool, typer.Option("--links", help="Elastic links, pads and platform; mobility 21.")] = False,
    json: Json = False,
) -> None:
    """Platform stiffness by the analytic model, (16) to (18)."""
    from flexfem.analytic import notch
    from flexfem.analytic.links import linked
    from flexfem.analytic.mobility import freedoms_of
    from flexfem.analytic.model import analyse
    from flexfem.commands import console, facts, tables
    from flexfem.stage.feasibility import load_feasible, naming

    loaded = load_feasible(stage)
    notch.formula(formula)
    freedoms_of(mobility or 3)
    if links and mobility not in (None, 21):
        raise BadInput(
            f"--links --mobility {mobility}, expected 21 or none: elastic links go with all freedoms of the hinges"
        )
    with naming(stage):
        found = linked(loaded, formula) if links else analyse(loaded, mobility, formula)
    console.show(facts.analytic_facts(stage, loaded, found), json, tables.print_analytic)


@app.command()
def mesh(
    stage: Stage,
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write: .msh, .vtu or .inp.")],
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Mesh a stage and write it with the groups stage, ground and hub."""
    from flexfem.commands import console, facts, tables
    from flexfem.fem.export import check_format, write_mesh
    from flexfem.fem.mesh import RESOLUTION, build_mesh
    from flexfem.fem.response import plate_of
    from flexfem.files.writing import check_folder
    from flexfem.stage.feasibility import load_feasible, naming

    loaded = load_feasible(stage)
    check_format(output)
    check_folder(output.parent)
    with naming(stage):
        plate = plate_of(loaded)
    made = build_mesh(loaded, resolution or RESOLUTION)
    write_mesh(made, plate, output)
    console.show(facts.mesh_facts(stage, loaded, made, resolution or RESOLUTION, output), json, tables.print_facts)


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

    from flexfem.commands import console, facts, tables
    from flexfem.fem.export import write_vtu
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.fem.response import load_case
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.verify.protocol import solve_stage

    loaded = load_feasible(stage)
    if force is not None and displacement is not None:
        raise BadInput("--force and --displacement, expected one of the two")
    _within("--force", force, LARGEST_FORCE)
    _within("--displacement", displacement, LARGEST_DISPLACEMENT)
    if vtu is not None and vtu.suffix != ".vtu":
        raise BadInput(f"--vtu {vtu}, expected a file name that ends in .vtu")
    with naming(stage):
        solved = solve_stage(loaded, resolution or RESOLUTION)
    load = np.array(force or (0.0, 0.0, 0.0))
    if displacement is not None:
        load = np.linalg.solve(solved.response.compliance, np.array(displacement))
    case = load_case(loaded, solved.mesh, solved.response, load)
    if vtu is not None:
        write_vtu(solved.mesh, vtu, {"displacement": case.field, "von_mises": case.stress})
    found = facts.solution_facts(stage, loaded, solved, case, resolution or RESOLUTION)
    console.show(found, json, tables.print_solution)


def _finite(option: str, value: float) -> None:
    """Raise BadInput for an amplitude that is no number; its limits do not catch nan."""
    if not math.isfinite(value):
        raise BadInput(f"{option} {value}, expected a number")


def _within(option: str, values: tuple[float, ...] | None, largest: float) -> None:
    """Raise BadInput for numbers that are none, or absurdly large."""
    if values is not None and not all(abs(value) <= largest for value in values):
        raise BadInput(f"{option} {' '.join(map(str, values))}, expected three numbers within ±{largest:g}")


@app.command("summary")
def summarise(
    stage: Stage,
    formula: Annotated[
        str | None, typer.Option(help="Hinge formula by name; default calibrated, where it has a value.")
    ] = None,
    elements: Annotated[bool, typer.Option("--elements", help="Also by finite elements.")] = False,
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """How far a stage may go before a neck yields, the force that takes, its stiffness, and warnings."""
    from flexfem.analytic import notch
    from flexfem.commands import console, tables
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.verify.summary import summary

    loaded = load_feasible(stage)
    notch.formula(formula or "calibrated")
    with naming(stage):
        solved = None
        if elements or resolution is not None:
            from flexfem.fem.mesh import RESOLUTION
            from flexfem.verify.protocol import solve_stage

            solved = solve_stage(loaded, resolution or RESOLUTION)
        found = summary(stage, loaded, formula, solved)
    console.show(found.model_dump(mode="json"), json, tables.print_summary)


@app.command()
def verify(
    cases: Cases,
    output: Output = Path("reports"),
    check: Annotated[
        bool, typer.Option("--check", help="Compare with the baselines; exit 1 if a number moved.")
    ] = False,
    baselines: Baselines = None,
    json: Json = False,
) -> None:
    """Apply the analytic force of (18) to the finite elements and report the errors (Section V, Figs. 5 to 7)."""
    from flexfem.commands import console, facts, tables
    from flexfem.commands.baseline import store
    from flexfem.verify.result import write_result

    loaded = console.load_cases(cases)
    folders = [baselines or store.folder_of(case.path) for case in loaded]
    if check:
        for case, folder in zip(loaded, folders, strict=True):
            store.read_baseline(store.file_of(case.path, folder))
    solve, results, checked = console.solved_once(), [], []
    for case, folder, (result, fields) in zip(loaded, folders, console.run_cases(loaded, solve), strict=True):
        write_result(result, fields, output)
        results.append(result)
        if check:
            made = {"result": result.model_dump(mode="json")}
            checked.append(store.Checked(case.stem, store.check(case.path, folder, solve, made)))
    if check:
        console.show(facts.regression_facts(checked), json, tables.print_regression)
        raise typer.Exit(1 if any(each.findings for each in checked) else 0)
    console.show(facts.result_facts(results), json, lambda _: tables.print_results(results, output))


@app.command()
def converge(
    stage: Stage,
    level: Annotated[
        list[int] | None,
        typer.Option(min=2, max=64, help="Triangles across every neck, coarse to fine; give three or more."),
    ] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Solve a stage on finer and finer meshes: observed order, extrapolated compliance, band."""
    from flexfem.commands import console, tables
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.verify.converge import RESOLUTIONS, checked_resolutions, converge
    from flexfem.verify.result import write_record

    loaded = load_feasible(stage)
    resolutions = checked_resolutions(level or RESOLUTIONS)
    with naming(stage):
        study = converge(stage, loaded, resolutions, console.with_progress(len(resolutions), "refining"))
    if output is not None:
        from flexfem.plot.convergence import convergence_figure
        from flexfem.plot.write import write_beside

        write_beside(write_record(study, output / f"{stage.stem}-convergence.json"), convergence_figure(study))
    console.show(study.model_dump(mode="json"), json, tables.print_convergence)


@app.command("cross-check")
def cross_check_stage(
    stage: Stage,
    solver: Annotated[str, typer.Option(help="ngsolve or calculix.")] = "ngsolve",
    resolution: Resolution = None,
    json: Json = False,
) -> None:
    """Solve the same mesh by another program and compare pose, displacements and neck stresses."""
    from flexfem.commands import console, facts, tables
    from flexfem.fem.mesh import RESOLUTION
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.validate.compare import cross_check

    loaded = load_feasible(stage)
    with naming(stage):
        found = cross_check(loaded, resolution or RESOLUTION, solver)
    console.show(facts.cross_check_facts(stage, loaded, found), json, tables.print_cross_check)
    raise typer.Exit(0 if found.passed else 1)


@app.command()
def benchmark(
    name: Annotated[list[str] | None, typer.Option(help="A benchmark by name, more than once for more; all.")] = None,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Solve published problems with known answers and compare: the verification of the code itself."""
    from flexfem.commands import console, facts, tables
    from flexfem.validate.registry import run_benchmarks, write_benchmarks

    table = run_benchmarks(name, lambda text: print(text, file=sys.stderr))
    if output is not None:
        write_benchmarks(table, output)
        from flexfem.plot.bending import elastica_figure, taylor_figure
        from flexfem.plot.write import write_beside
        from flexfem.validate import elastica, taylor

        if "elastica" in table.seconds:
            write_beside(output / "elastica.png", elastica_figure(elastica.bending()))
        if "tangent" in table.seconds:
            write_beside(output / "tangent.png", taylor_figure(taylor.remainders()))
    console.show(facts.benchmark_facts(table), json, tables.print_benchmarks)
    raise typer.Exit(0 if table.passed else 1)


@app.command()
def budget(
    stage: Stage,
    amplitude_um: Annotated[
        float, typer.Option(min=1e-3, max=1e4, help="Command in X and Y of the large-displacement share.")
    ] = 50.0,
    amplitude_mrad: Annotated[float, typer.Option(min=1e-3, max=1e3, help="And in theta.")] = 1.0,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Split the error of the stage's own analytic model into named shares that add up to it."""
    from flexfem.commands import console, tables
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.verify.budget import budget as split_error
    from flexfem.verify.case import Direction
    from flexfem.verify.result import write_record

    loaded = load_feasible(stage)
    _finite("--amplitude-um", amplitude_um)
    _finite("--amplitude-mrad", amplitude_mrad)
    with naming(stage):
        amplitudes: dict[Direction, float] = dict.fromkeys(("x", "y"), 1e-3 * amplitude_um)
        amplitudes["theta"] = 1e-3 * amplitude_mrad
        found = split_error(stage, loaded, amplitudes, solve=console.with_progress(3, "meshing and solving"))
    if output is not None:
        from flexfem.plot.budget import budget_figure
        from flexfem.plot.write import write_beside

        write_beside(write_record(found, output / f"{stage.stem}-budget.json"), budget_figure(found))
    console.show(found.model_dump(mode="json"), json, tables.print_budget)


@app.command()
def workspace(
    stage: Stage,
    amplitude_um: Annotated[
        float, typer.Option(min=1e-3, max=1e4, help="Largest command in X and Y; in theta 0.02 mrad for every um.")
    ] = 500.0,
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Large displacements: linear, tangent (16) with and without its second-order terms, exact, finite elements."""
    from flexfem.commands import console, tables
    from flexfem.stage.feasibility import load_feasible, naming
    from flexfem.units import unit_of
    from flexfem.verify.result import write_record
    from flexfem.verify.workspace import workspace as travel

    loaded = load_feasible(stage)
    _finite("--amplitude-um", amplitude_um)
    with naming(stage):
        found = travel(stage, loaded, amplitude_um / unit_of("amplitude_um").factor)
    if output is not None:
        from flexfem.plot.workspace import workspace_figure
        from flexfem.plot.write import write_beside

        write_beside(write_record(found, output / f"{stage.stem}-workspace.json"), workspace_figure(found))
    console.show(found.model_dump(mode="json"), json, tables.print_workspace)


@app.command()
def formulas(
    output: Wanted = None,
    json: Json = False,
) -> None:
    """List the hinge formulas with source, freedoms and range; draw them against the finite-element hinge chart."""
    from flexfem.commands import console, facts, tables

    if output is not None:
        from flexfem.plot.hinge_chart import hinge_chart_figure
        from flexfem.plot.thickness import thickness_figure
        from flexfem.plot.write import write_beside

        write_beside(output / "hinge-chart.json", hinge_chart_figure(facts.hinge_review()))
        write_beside(output / "hinge-thickness.json", thickness_figure(facts.thickness_review()))
    console.show(facts.formula_facts(), json, tables.print_formulas)


@app.command()
def claims(
    path: Annotated[Path, typer.Argument(help="Claims file, see cases/README.md.", metavar="CLAIMS")],
    output: Wanted = None,
    json: Json = False,
) -> None:
    """Measure what the paper claims: holds, does not hold, or cannot be decided; and what else could have been."""
    from flexfem.commands import console, tables
    from flexfem.files.writing import write_atomically
    from flexfem.verify.claims import markdown_report, report_claims
    from flexfem.verify.result import write_record

    report = report_claims(path)
    if output is not None:
        write_record(report, output / "claims.json")
        write_atomically(output / "claims.md", lambda file: file.write(markdown_report(report).encode()))
    console.show(report.model_dump(mode="json"), json, tables.print_claims)


@app.command()
def plot(
    results: Annotated[list[Path], typer.Argument(help="Results of flexfem verify.", metavar="RESULT...")],
    output: Output = Path("reports"),
    json: Json = False,
) -> None:
    """Draw figures and the report page from stored results, as PNG and PDF."""
    from flexfem.commands import console, tables
    from flexfem.plot.write import write_figures
    from flexfem.verify.result import read_fields, read_result

    read = [(path, read_result(path)) for path in results]
    written = write_figures([(result, read_fields(path, result)) for path, result in read], output)
    console.show({"written": [str(path) for path in written]}, json, tables.print_written)


@app.command("baseline")
def accept_baselines(
    files: Annotated[list[Path], typer.Argument(help="Stages, cases, claims, studies.", metavar="FILE...")],
    reason: Annotated[str, typer.Option(help="Why the numbers may move; kept in the baseline's history.")],
    baselines: Baselines = None,
    json: Json = False,
) -> None:
    """Accept what flexfem prints of files now as their baselines."""
    from flexfem.commands import console, tables
    from flexfem.commands.baseline import store
    from flexfem.files.writing import check_folder

    if not reason.strip():
        raise BadInput("--reason is empty, expected why the numbers may move")
    places = store.places([(path, baselines or store.folder_of(path)) for path in files])
    for _, folder in places:
        check_folder(folder)
    solve = console.solved_once()
    written = [store.accept(path, folder, reason, solve) for path, folder in console.told(places, "accepting")]
    console.show({"written": [str(path) for path in written]}, json, tables.print_written)


@app.command()
def regression(
    baselines: Annotated[list[Path], typer.Argument(help="Baselines, or folders of them.", metavar="BASELINE...")],
    json: Json = False,
) -> None:
    """Compare what flexfem prints now with baselines: what changed in the input, else every number that moved."""
    from flexfem.commands import console, facts, tables
    from flexfem.commands.baseline import store

    paths, solve = store.listed(baselines), console.solved_once()
    checked = [store.checked(path, solve) for path in console.told(paths, "checking")]
    checked += [store.Checked(str(place), list(store.unaccepted(place))) for place in baselines if place.is_dir()]
    console.show(facts.regression_facts(checked), json, tables.print_regression)
    raise typer.Exit(1 if any(each.findings for each in checked) else 0)


def main() -> None:
    """Run the command line; whatever goes wrong is one line on standard error."""
    streams.open_streams()
    os.environ["PYTHONSAFEPATH"] = "1"  # no Python started from here looks into the current folder
    with streams.stoppable() as signals, streams.plain_streams():
        code = _run()
    if signals:
        code = 128 + signals[0]
    if code:
        sys.exit(code)


def _run() -> int:
    """Exit code of the command."""
    try:
        try:
            app(prog_name="flexfem")
        except SystemExit as stop:
            return int(stop.code or 0)
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()
    except BadInput as refusal:
        return _say(str(refusal), 2)
    except (ComputationFailed, SourcesChanged) as failure:
        return _say(str(failure), 1)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader, such as head, has seen enough
        return _silence(1)
    except OSError as error:
        return _silence(_say(streams.reason_of(error), 1))
    except Exception as error:
        if os.environ.get("FLEXFEM_TRACEBACK"):
            raise
        return _say(streams.reason_of(error), 1)
    return 0


def _silence(code: int) -> int:
    """Let what standard output still holds go nowhere."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _say(text: str, code: int) -> int:
    print(f"flexfem: {text}", file=sys.stderr)
    return code
