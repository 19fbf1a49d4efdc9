"""Study files: what they mean, and what is refused in one line."""

from __future__ import annotations

import re
from typing import Any

import pytest

from flexfem.refused import BadInput
from flexfem.study.loaded import load_study

RANGE = "from = 0.4\nto = 0.7"
NORMAL = 'distribution = "normal"\nsd = 1.5'
MONTE_CARLO = 'method = "monte_carlo"\ndesigns = 500\nseed = 7'
GRID = (
    (MONTE_CARLO, 'method = "grid"'),
    (RANGE, f"{RANGE}\npoints = 5"),
    (NORMAL, "values = [60.0, 70]"),
)
SALTELLI = (MONTE_CARLO, 'method = "saltelli"\nbase = 64\nseed = 7')
TABLE = (f"{RANGE}\n", ""), (f"{NORMAL}\n", "")
LAST = "sd = 1.5\n"
GPA = "material.youngs_modulus_gpa"
ANALYTIC = 'model = "analytic"\nformula = "calibrated"\nmobility = 21'
SOLID = (ANALYTIC, 'model = "three_dimensional"')
NECKS = "hinges.base.neck_mm"
PARETO = 'kind = "pareto"\nx = "kxx_n_per_mm"\ny = "range_x_um"'


def more(body: str) -> tuple[str, str]:
    return LAST, f"{LAST}{body}\n"


def figure(body: str) -> tuple[str, str]:
    return more(f"[[figure]]\n{body}")


def of_grid(body: str) -> list[tuple[str, str]]:
    return [*GRID, ("values = [60.0, 70]", f"values = [60.0, 70]\n[[figure]]\n{body}")]


def output(expression: str, name: str = "ratio") -> tuple[str, str]:
    return more(f'[[output]]\nname = "{name}"\nexpression = "{expression}"')


def constraint(ends: str, value: str = "kxx_n_per_mm") -> tuple[str, str]:
    return more(f'[[constraint]]\nvalue = "{value}"\n{ends}')


def correlation(one: str, other: str, coefficient: float = 0.5) -> tuple[str, str]:
    return more(f'[[correlation]]\nfactors = ["{one}", "{other}"]\ncoefficient = {coefficient}')


IMPOSSIBLE = "".join(
    f"[[correlation]]\nfactors = {pair}\ncoefficient = {coefficient}\n"
    for pair, coefficient in (
        (["E", "thickness_mm"], 0.9),
        (["E", NECKS], 0.9),
        (["thickness_mm", NECKS], -0.9),
    )
)
HOSTILE: dict[str, tuple[list[tuple[str, str]], list[str]]] = {
    "no name": ([('name = "generic study"\n', "")], ["name is missing"]),
    "unknown key": ([("mobility = 21", "mobilty = 21")], ["mobilty", "did you mean mobility"]),
    "unknown formula": ([('"calibrated"', '"magic"')], ["line 4", "formula", "paros-weisbord"]),
    "formula with fe": (
        [(ANALYTIC, 'model = "fe"\nformula = "calibrated"')],
        ["formula", 'model = "fe"'],
    ),
    "links with verify": (
        [('"analytic"', '"verify"'), ("= 21", "= 21\nlinks = true")],
        ["line 6", "links"],
    ),
    "links without their mobility": (
        [("= 21", "= 6\nlinks = true")],
        ["line 6", "links = true", "mobility = 21"],
    ),
    "bands with analytic": ([("= 21", "= 21\nbands = true")], ["line 6", "bands", "analytic"]),
    "meshed undrawn": (
        [(ANALYTIC, 'model = "fe"\ncheck = "closed_form"')],
        ["line 4", "check", "drawing"],
    ),
    "stage missing": (
        [('"stage.toml"', '"nowhere.toml"')],
        ["line 2", "stage", "nowhere.toml", "no such file"],
    ),
    "stage itself a study": ([('"stage.toml"', '"study.toml"')], ["line 2", "stage"]),
    "method of no kind": ([('"monte_carlo"', '"dice"')], ["sampling.method", "line 8"]),
    "no seed": ([("seed = 7", "")], ["sampling", "seed", "monte_carlo"]),
    "latin hypercube too large": (
        [("monte_carlo", "latin_hypercube"), ("= 500", "= 200001")],
        ["line 9", "designs = 200001", "at most 200000"],
    ),
    "base with monte carlo": ([("seed = 7", "seed = 7\nbase = 64")], ["line 11", "base"]),
    "base no power of two": ([SALTELLI, ("base = 64", "base = 65")], ["base = 65", "power of two"]),
    "base too large": (
        [SALTELLI, ("base = 64", f"base = {2**29}")],
        [f"base = {2**29}", "at most 1000000000"],
    ),
    "designs with grid": ([*GRID, ('"grid"', '"grid"\ndesigns = 1')], ["designs = 1", "grid"]),
    "grid with a distribution": ([*GRID[:2]], ["distribution", "grid"]),
    "grid without points": ([GRID[0], GRID[2]], ["factor[0]", "points"]),
    "grid too large": (
        [
            *GRID,
            ("points = 5", "points = 100000"),
            ("values = [60.0, 70]", "from = 60\nto = 70\npoints = 100000"),
        ],
        ["grid of at most 1000000000", "10000000000"],
    ),
    "points without grid": ([(RANGE, f"{RANGE}\npoints = 5")], ["points = 5", "grid"]),
    "no factor": ([("[[factor]]", "[[factors]]"), ("[[factor]]", "[[factors]]")], ["factors"]),
    "no key": ([('key = "hinges.base.neck_mm"\n', "")], ["factor[0]", "either key or keys"]),
    "key and keys": (
        [(RANGE, f'keys = ["hinges.elbow.neck_mm"]\n{RANGE}')],
        ["factor[0]", "either key or keys"],
    ),
    "key misspelt": (
        [("base.neck_mm", "base.nek_mm")],
        ["line 13", "did you mean hinges.base.neck_mm"],
    ),
    "key an array": (
        [(NECKS, "chain.link_lengths_mm")],
        ["line 13", "mean chain.link_lengths_mm["],
    ),
    "override by place": (
        [(NECKS, "override[0].neck_mm")],
        ["line 13", "mean override.<chain>.<h"],
    ),
    "star that names nothing": ([(NECKS, "hinge.*.neck_mm")], ["line 13", "hinges.*.neck_mm"]),
    "star in keys": (
        [('key = "hinges.base.neck_mm"', 'keys = ["hinges.*.neck_mm"]')],
        ["keys[0]", "no star"],
    ),
    "star with a label": ([(GPA, "hinges.*.radius_mm")], ["label", "star"]),
    "key twice in the study": ([(GPA, NECKS)], ["factor[1]", "factor[0]"]),
    "star over a key": (
        [(NECKS, "hinges.*.neck_mm"), (GPA, "hinges.elbow.neck_mm")],
        ["factor[1]", "elbow.neck_mm"],
    ),
    "label of an output": ([('"E"', '"kxx_n_per_mm"')], ["factor[1]", "kxx_n_per_mm"]),
    "nothing to vary": ([(RANGE, "")], ["factor[0]", "from"]),
    "values and a range": ([(RANGE, f"{RANGE}\nvalues = [0.5]")], ["from", "values"]),
    "values nan": ([(RANGE, "values = [0.5, nan]")], ["line 14", "values[1] = nan", "finite"]),
    "values twice": ([(RANGE, "values = [0.5, 0.5]")], ["line 14", "each value once"]),
    "values impossible": (
        [(RANGE, "values = [0.5, -0.5]")],
        ["line 14", "values[1] = -0.5", "> 0"],
    ),
    "range up to above the limit": ([(NECKS, "material.poissons_ratio")], ["to = 0.7", "< 0.5"]),
    "from above to": ([("to = 0.7", "to = 0.3")], ["line 15", "to = 0.3", "> 0.4"]),
    "log from below zero": (
        [(NECKS, "chain.joint_angles_deg[1]"), (RANGE, 'from = -9.0\nto = 9.0\nscale = "log"')],
        ["from = -9.0", "> 0 on a logarithmic scale"],
    ),
    "bounds crossed": ([(NORMAL, f"{NORMAL}\nlower = 70\nupper = 60")], ["upper = 60", "> 70"]),
    "no mean to be had": ([(GPA, "hinges.base.axis_deg")], ["factor[1]", "mean"]),
    "lever arm missing": ([more("[drive]\nstroke_um = 17.4")], ["lever_arm_mm is missing"]),
    "drive that asks nothing": ([more("[drive]\nactuators = false")], ["drive = {", "or stroke"]),
    "drive of a stage without one": ([more("[drive]\nactuators = true")], ["with [[actuator]]"]),
    "drive of three dimensions": (
        [more("[drive]\nactuators = true"), SOLID],
        ["drive.actuators", "in the plane"],
    ),
    "factor of a drive not asked about": (
        [(GPA, "actuator.base.preload_n")],
        ["factor[1]", "actuators = true"],
    ),
    "factor of no number of an actuator": (
        [(GPA, "actuator.base.preload")],
        ["factor[1].key", "did you mean"],
    ),
    "figure of an unknown column": (
        [figure(PARETO.replace("kxx", "kzz"))],
        ["figure[0].x", "did you mean k"],
    ),
    "figure of a factor as output": (
        [figure('kind = "distribution"\nvalues = ["E"]')],
        ["figure[0].values[0]"],
    ),
    "map of an output over outputs": (
        of_grid("kind = 'map'\nx = 'E'\ny = 'kyy_n_per_mm'\nvalue = 'kxx_n_per_mm'"),
        ["figure[0].y"],
    ),
    "map without a value": (
        [figure('kind = "map"\nx = "E"\ny = "hinges.base.neck_mm"')],
        ["figure[0]", "value"],
    ),
    "sensitivity of a grid": (
        of_grid("kind = 'sensitivity'\nvalues = ['kxx_n_per_mm']"),
        ["figure[0].kind", "random sample", "grid"],
    ),
    "distribution of a grid": (
        of_grid("kind = 'distribution'\nvalues = ['kxx_n_per_mm']"),
        ["figure[0].kind", "grid"],
    ),
    "pareto of one column": (
        [figure(PARETO.replace("range_x_um", "kxx_n_per_mm"))],
        ["figure[0].y"],
    ),
    "pareto with values": (
        [figure(f'{PARETO}\nvalues = ["kxx_n_per_mm"]')],
        ["figure[0].values", "pareto"],
    ),
    "output that runs code": (
        [output("__import__('os').remove('x')")],
        ["output[0].expression", "brackets"],
    ),
    "output of an attribute": (
        [output("kxx_n_per_mm.__class__")],
        ["output[0].expression", "columns and keys"],
    ),
    "output of a power of powers": (
        [output("kxx_n_per_mm * 9**9**9**9j")],
        ["output[0].expression", "numbers"],
    ),
    "output as deep as brackets go": (
        [output("(" * 300 + "kxx_n_per_mm")],
        ["output[0].expression", "brackets"],
    ),
    "output too long": (
        [output("+".join(["kxx_n_per_mm"] * 40))],
        ["output[0].expression", "at most 400"],
    ),
    "output of no column": (
        [output("kzz_n_per_mm / 2")],
        ["output[0].expression", "did you mean k"],
    ),
    "output of itself": ([output("2 * ratio")], ["output[0].expression", "columns and keys"]),
    "output of numbers": ([output("2 * 3")], ["output[0].expression", "not numbers alone"]),
    "output of a key that has no value": (
        [output("hinges.base.axis_deg")],
        ["output[0].expression", "axis_deg"],
    ),
    "output called as an output": (
        [output("kxx_n_per_mm", "kyy_n_per_mm")],
        ["output[0].name", "a unique name"],
    ),
    "constraint without ends": ([constraint("")], ["constraint[0]", "least, most or both"]),
    "constraint crossed": ([constraint("least = 2\nmost = 1")], ["constraint[0].most = 1", ">= 2"]),
    "constraint of factors with saltelli": (
        [constraint("most = 1", "E / 2"), SALTELLI],
        ["constraint[0].value", "saltelli", "dependent"],
    ),
    "correlation of one factor": (
        [correlation("E", "E")],
        ["correlation[0].factors[1]", "a factor other than"],
    ),
    "correlation of no factor": (
        [correlation("E", "F")],
        ["correlation[0].factors[1]", "the column of a factor"],
    ),
    "correlation of a list": (
        [correlation("E", NECKS), (RANGE, "values = [0.5, 0.6]")],
        ["correlation[0].factors", "ties"],
    ),
    "correlation twice": ([correlation("E", NECKS), correlation(NECKS, "E")], ["each pair once"]),
    "correlation with saltelli": (
        [correlation("E", NECKS), SALTELLI],
        ["correlation", "saltelli", "independent"],
    ),
    "correlations that no factors have": (
        [
            more("[[factor]]\nkey = 'thickness_mm'\nfrom = 8\nto = 9"),
            ("[[factor]]\nkey = 'th", f"{IMPOSSIBLE}[[factor]]\nkey = 'th"),
        ],
        ["correlation", "consistent coefficients"],
    ),
    "table without a file": ([(MONTE_CARLO, 'method = "table"'), *TABLE], ["sampling", "file"]),
    "table with values": (
        [(MONTE_CARLO, 'method = "table"\nfile = "stage.toml"'), TABLE[0]],
        ["factor[1]", "no values", "table"],
    ),
    "table of another kind": (
        [(MONTE_CARLO, 'method = "table"\nfile = "stage.toml"'), *TABLE],
        ["sampling.file", "stage.toml", ".csv"],
    ),
    "table that is not there": (
        [(MONTE_CARLO, 'method = "table"\nfile = "no.csv"'), *TABLE],
        ["line 9", "no.csv", "no such file"],
    ),
    "file without a table": (
        [("seed = 7", 'seed = 7\nfile = "a.csv"')],
        ["line 11", "file", "monte_carlo"],
    ),
    "provenance of nothing": (
        [more('[provenance]\n"factor[2]" = "assumed"')],
        ["provenance", "factor[1]"],
    ),
    "layers in the plane": (
        [(ANALYTIC, 'model = "fe"\nthickness_resolution = 3')],
        ["no thickness_resolution with"],
    ),
    "frequencies in three dimensions": (
        [SOLID, more("[frequencies]")],
        ["no frequencies with model"],
    ),
    "expansion without drift": (
        [(NECKS, "material.expansion_um_per_m_k")],
        ["expected a number that affects outputs"],
    ),
    "a key that drift has not": ([more("[drift]\nkelvin = 3.0")], ["drift.kelvin", "unknown key"]),
    "life at no amplitude": ([more("[life]\ncycles = 1e6")], ["amplitude_x_um, amplitude_y_um or"]),
    "life at a ratio of one": (
        [more("[life]\namplitude_x_um = 3.0\nratio = 1.0")],
        ["ratio = 1.0"],
    ),
    "question that needs more than a stage": (
        [("= 21", '= 21\nask = ["drive.x"]')],
        ["ask", "a question of b"],
    ),
    "payload below zero": ([more("[frequencies]\npayload_kg = -1.0")], ["payload_kg = -1.0"]),
}


def test_a_hostile_study_is_refused_in_one_line(studies: Any) -> None:
    for name, (edits, says) in HOSTILE.items():
        path = studies.write(*edits)
        with pytest.raises(BadInput) as refusal:
            load_study(path)
        said = str(refusal.value)
        assert "\n" not in said and len(said) < 1000, (name, said)
        assert re.match(re.escape(str(path)) + r", line \d+: ", said) or "is missing" in said, (
            name,
            said,
        )
        assert all(word in said for word in says), (name, said)


def test_the_generic_study_is_not_hostile(studies: Any) -> None:
    """Else the cases above would be refused for something else."""
    assert studies.load().count == 500
    assert studies.load(*GRID).count == 10
    assert studies.load(SALTELLI).count == 64 * 4
    assert studies.load(figure(PARETO)).study.figure[0].drawn == 4


def test_fifty_outputs_that_each_use_the_two_before_are_a_study_at_once(studies: Any) -> None:
    """As a tree of all their uses there would be 10^10 of them."""
    terms = ["hinges.base.neck_mm", "E", *(f"o{k}" for k in range(50))]
    outputs = [output(f"({terms[k]} + {terms[k + 1]}) / 2", f"o{k}") for k in range(50)]
    study = studies.load(
        more("".join(text.removeprefix(LAST) for _, text in outputs)), constraint("most = 1", "o49")
    )
    assert study.hash and study.study.uses_no_output("o49")


def test_an_infeasible_stage_is_named_with_the_line_of_the_study(studies: Any) -> None:
    stage = studies.folder / "stage.toml"
    stage.write_text(stage.read_text().replace("radius_mm = 3.9", "radius_mm = 4.9"))
    with pytest.raises(
        BadInput, match=r"study\.toml, line 2: stage.*stage\.toml, line \d+: .*notch deeper"
    ):
        studies.load()


def test_the_base_has_one_of_two_keys(studies: Any) -> None:
    by_stage = studies.load()
    by_mechanism = studies.load(("stage =", "mechanism ="))
    assert by_mechanism.hash == by_stage.hash
    with pytest.raises(BadInput, match=r"study\.toml, line 2: mechanism = \"no\.toml\": "):
        studies.load(('stage = "stage.toml"', 'mechanism = "no.toml"'))
    with pytest.raises(BadInput, match=r"line 3: stage is an unknown key"):
        studies.load(("stage =", 'mechanism = "stage.toml"\nstage ='))


def test_a_normal_distribution_is_about_the_stages_own_value(studies: Any) -> None:
    necks = studies.load(
        ("hinges.base.neck_mm", "override.*.*.neck_mm"),
        (RANGE, 'distribution = "normal"\nsd = 0.01'),
    )
    means = {column.name: column.factor.mean for column in necks.columns}
    assert means["override.1.base.neck_mm"] == 0.53
    assert means["override.2.elbow.neck_mm"] == 0.71  # the stage's own override
    assert means["E"] == pytest.approx(68.3, rel=1e-15)  # GPa to MPa and back


def test_outputs_follow_from_model_and_drive(studies: Any) -> None:
    """In the order in which models answer: a name in another place is a column of other numbers."""
    plain = studies.load().outputs
    driven = studies.load(more("[drive]\nstroke_um = 17.4\nlever_arm_mm = 10")).outputs
    verified = studies.load(('"analytic"', '"verify"')).outputs
    bare = studies.load(('"analytic"', '"verify"'), ("= 21", "= 21\nbands = false")).outputs
    assert plain == (
        *("kxx_n_per_mm", "kyy_n_per_mm", "ktt_n_mm_per_rad", "kxy_n_per_mm", "kxt_n", "kyt_n"),
        *("coupling_xy", "coupling_xt", "coupling_yt"),
        *("stress_x_mpa_per_um", "stress_y_mpa_per_um", "stress_theta_mpa_per_mrad"),
        *("range_x_um", "range_y_um", "range_theta_mrad", "envelope_mm"),
    )
    assert driven[16:] == ("travel_x_um", "travel_y_um", "travel_theta_mrad")
    assert verified[:16] == plain and bare == verified[:-3]
    kinds = ("error", "cross", "band")
    axes = ("x", "y", "theta")
    assert verified[16:] == tuple(f"{kind}_{axis}_percent" for kind in kinds for axis in axes)


@pytest.mark.parametrize(
    "key", ["material.density_kg_m3", "material.walker_exponent", "hinges.elbow.neck_mm"]
)
def test_a_factor_that_no_answer_depends_on_is_refused(studies: Any, key: str) -> None:
    stage = studies.folder / "stage.toml"
    others = (
        f'[[override]]\nchain = {chain}\nhinge = "elbow"\nneck_mm = 0.5\n' for chain in (1, 3)
    )
    stage.write_text(stage.read_text().replace("[provenance]", "".join(others) + "[provenance]"))
    with pytest.raises(
        BadInput,
        match=rf"line 12: factor\[0\].key = {re.escape(key)}, expected a number that affects",
    ):
        studies.load(("hinges.base.neck_mm", key))


@pytest.mark.parametrize(
    ("plane", "model"), [("corrected", "fe"), ("plane_strain", "three_dimensional")]
)
def test_a_model_that_the_stage_does_not_take_is_refused_before_anything_runs(
    studies: Any, plane: str, model: str
) -> None:
    stage = studies.folder / "stage.toml"
    stage.write_text(f'model = "{plane}"\n{stage.read_text()}')
    assert studies.load(("= 0.4", "= 0.45")).base.model == plane
    with pytest.raises(
        BadInput, match=f'line 3: model = "{model}" on a stage with model = "{plane}"'
    ):
        studies.load((ANALYTIC, f'model = "{model}"'))
