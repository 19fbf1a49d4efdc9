"""A stage or mechanism as it was made: measured necks, their stiffness and its scatter."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexfem
from flexfem.analytic.plates import respond
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions import plates
from flexfem.refused import BadInput

from ..tolerances import DENSE

NECKS = [[481.0, 507.0, 493.0], [512.0, 498.0, 520.0], [476.0, 503.0, 489.0]]
SDS = [[2.0, 1.0, 3.0], [1.5, 2.5, 1.0], [2.0, 3.0, 1.0]]
OWN = flexfem.Analytic(formula="calibrated", links=True)
HINGES = ("base", "elbow", "platform")
MADE = {(c, h): {"neck": NECKS[c - 1][k] / 1e3} for c in (1, 2, 3) for k, h in enumerate(HINGES)}


def lines(necks=NECKS, sds=SDS):
    cells = [(chain, name) for chain in (1, 2, 3) for name in HINGES]
    flat = zip(cells, np.ravel(necks).tolist(), np.ravel(sds).tolist(), strict=True)
    return [f"{chain}, {name}, {neck:g}, {sd:g}" for (chain, name), neck, sd in flat]


def written(path, rows, head="chain, hinge, neck_um, sd_um"):
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def in_toml():
    rows = (line.split(", ") for line in lines())
    row = '[[neck]]\nchain = {}\nhinge = "{}"\nneck_um = {}.0\nsd_um = {}'
    return "\n".join(row.format(*each) for each in rows)


def test_measured_necks_give_their_own_stiffness(stage, tmp_path):
    found = flexfem.as_built(stage, written(tmp_path / "n.csv", lines()[::-1]), analytic=OWN)
    K = flexfem.analyse(stage.replace(override=MADE), links=True, formula="calibrated").stiffness
    np.testing.assert_allclose(found.stiffness, K, rtol=DENSE)
    np.testing.assert_allclose(found.necks, NECKS)
    drawn = flexfem.analyse(stage, links=True, formula="calibrated").stiffness
    held = found.at("deviation", others="held")
    np.testing.assert_allclose(held, 100 * (np.diag(K) / np.diag(drawn) - 1), rtol=DENSE)
    middle = (found.low + found.high)[0] / 2  # with rigid links 0.5 % stiffer
    np.testing.assert_allclose(middle, np.diag(K), rtol=1e-3)
    assert held[0] == pytest.approx(-0.24, abs=0.5) and found.unanswered == 0


def test_the_scatter_is_that_of_the_nine_sensitivities(stage, tmp_path):
    """Monte Carlo against differences, neck by neck, each with its own deviation."""
    found = flexfem.as_built(
        stage, written(tmp_path / "n.csv", lines()), analytic=flexfem.Analytic(3)
    )
    made = stage.replace(override=MADE)
    variance = np.zeros(3)
    K = np.diag(flexfem.analyse(made, 3).stiffness)
    for (hinge, own), sd in zip(MADE.items(), np.ravel(SDS), strict=True):
        other = made.replace(override={hinge: {"neck": own["neck"] + 1e-5}})
        slope = (np.diag(flexfem.analyse(other, 3).stiffness) - K) / 1e-5
        variance += (slope * sd / 1e3) ** 2
    np.testing.assert_allclose(found.at("spread", others="held"), np.sqrt(variance), rtol=0.04)
    np.testing.assert_allclose((found.high - found.low)[0], 2 * 1.96 * np.sqrt(variance), rtol=0.06)
    assert found.settings["analytic model"] == "paros-weisbord, mobility 3, plane stress"


def test_toml_and_csv_say_the_same(stage, tmp_path):
    (tmp_path / "n.toml").write_text(
        f'{in_toml()}\n[provenance]\n"neck" = "measured under a microscope"\n'
    )
    toml = flexfem.as_built(stage, tmp_path / "n.toml")
    table = flexfem.as_built(stage, written(tmp_path / "n.csv", lines()))
    np.testing.assert_array_equal(toml.stiffness, table.stiffness)
    np.testing.assert_array_equal(toml.spread, table.spread)
    assert "necks: neck.1.base.neck_um" in table.about.not_stated
    assert not any("necks" in key for key in toml.about.not_stated)


def test_without_a_deviation_there_is_no_scatter(stage, tmp_path):
    rows = [line.rpartition(",")[0] for line in lines()]
    found = flexfem.as_built(stage, written(tmp_path / "n.csv", rows, "chain,hinge,neck_um"))
    assert not {"spread", "low", "high"} & found.values.keys()


BAD = [
    (lambda rows: rows[:-1], r"nine hinges: platform of chain 3 is missing"),
    (lambda rows: [*rows, rows[4]], r"n\.csv, line 11: .*expected each hinge once"),
    (
        lambda rows: [rows[0].replace("481", "0.481"), *rows[1:]],
        r"line 2: neck\.1\.base\.neck_um = 0\.481, exp",
    ),
    (
        lambda rows: [*rows[:5], rows[5].replace("520", "wide"), *rows[6:]],
        r"line 7: .*expected a number",
    ),
    (lambda rows: [*rows[:5], "4" + rows[5][1:], *rows[6:]], r"line 7: .*chain = 4, expected <= 3"),
    (
        lambda rows: [*rows[:5], rows[5].replace("platform", "toggle"), *rows[6:]],
        r"line 7: .*hinge = .toggle.",
    ),
    (
        lambda rows: [*rows[:5], rows[5].replace("520,", ","), *rows[6:]],
        r"line 7: neck_um is missing",
    ),
    (lambda rows: [*rows[:5], rows[5] + ", 3", *rows[6:]], r"line 7: 5 values, expected 4"),
    (
        lambda rows: [*rows[:5], rows[5].replace(", 1", ", 300"), *rows[6:]],
        r"line 7: .*sd_um = 300.*at most 0\.2",
    ),
    (
        lambda rows: [*rows[:5], rows[5].replace(", 1", ","), *rows[6:]],
        r"line 7: .*sd_um of all necks or of none",
    ),
]


@pytest.mark.parametrize(("spoil", "said"), BAD, ids=[said for _, said in BAD])
def test_what_are_no_nine_necks_is_refused_with_its_line(stage, tmp_path, spoil, said):
    path = written(tmp_path / "n.csv", spoil(lines()))
    with pytest.raises(BadInput, match=said) as refused:
        flexfem.as_built(stage, path)
    assert str(refused.value).startswith(str(path)) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "text", ["", "a,b\n1,2\n", "a" * 140_000, '"chain,hinge,neck_um\n1,base,500\n']
)
def test_what_is_no_table_is_refused(stage, tmp_path, text):
    (tmp_path / "n.csv").write_text(text)
    with pytest.raises(BadInput, match=r"n\.csv.*expected") as refused:
        flexfem.as_built(stage, tmp_path / "n.csv")
    assert re.fullmatch(r"[^\n]+", str(refused.value))


def test_necks_in_toml_are_refused_with_their_line(stage, tmp_path):
    for old, new, said in (
        (
            "neck_um = 520.0",
            "neck_um = 52.0",
            r"line 26: neck\.2\.platform\.neck_um = 52, expected 250 to 1000",
        ),
        ("chain = 3", "chain = 2", r"line 31: .*expected each hinge once"),
    ):
        (tmp_path / "n.toml").write_text(in_toml().replace(old, new))
        with pytest.raises(BadInput, match=said):
            flexfem.as_built(stage, tmp_path / "n.toml")


# mechanisms


LEAVES = ("a", "b", "b 2")
POISSON = 0.3


@pytest.fixture(scope="module")
def guide():
    """Three leaves of 40 mm by 0.5 mm and no fillets below a stage; the third is a copy."""
    leaf = {
        "between": ["ground", "stage"],
        "direction_deg": 90,
        "shape": "leaf",
        "length_mm": 40,
        "neck_mm": 0.5,
    }
    return MechanismFile.model_validate(
        {
            "name": "three leaves",
            "model": "plane_stress",
            "thickness_mm": 10,
            "material": {
                "name": "metal",
                "youngs_modulus_gpa": 70,
                "poissons_ratio": POISSON,
                "density_kg_m3": 2700,
                "yield_strength_mpa": 400,
            },
            "body": [
                {
                    "name": "ground",
                    "fixed": True,
                    "outline_mm": [[-40, -20], [40, -20], [40, 0], [-40, 0]],
                },
                {"name": "stage", "outline_mm": [[-40, 40], [40, 40], [40, 80], [-40, 80]]},
            ],
            "hinge": [
                {"name": "a", "at_mm": [0, 20]} | leaf,
                {"name": "b", "at_mm": [-30, 20]} | leaf,
            ],
            "copy": [{"parts": ["b"], "mirror_mm": [[0, 0], [0, 1]]}],
            "output": {"body": "stage", "at_mm": [0, 60]},
        }
    )


def as_made(guide, path, necks, head="hinge,neck_um", **options):
    rows = [f"{name},{rest}" for name, rest in necks.items()]
    return flexfem.as_built(guide, written(path / "m.csv", rows, head), **options)


def test_leaves_guide_with_the_sum_of_their_cubes_and_carry_with_the_sum_of_their_necks(
    guide, tmp_path
):
    """Slender leaves between stiff bodies: `E b sum t^3 / L^3` along x, `E b sum t / L` along y."""
    found = as_made(guide, tmp_path, dict.fromkeys(LEAVES, 550))
    assert found.deviation[0, :2] == pytest.approx([33.1, 10], abs=0.35)
    assert found.axes["hinge"] == LEAVES and not any("not listed" in note for note in found.notes)
    found = as_made(guide, tmp_path, {"a": 450, "b 2": 620})
    cubes = 0.45**3 + 0.5**3 + 0.62**3
    assert found.deviation[0, :2] == pytest.approx(
        [100 * (cubes / 0.375 - 1), 100 * (1.57 / 1.5 - 1)], abs=0.35
    )
    assert found.stiffness[0, 0] == pytest.approx(
        70e3 * 10 * cubes / 40**3, rel=0.025
    )  # the ends yield
    np.testing.assert_allclose(found.necks, [450, 500, 620])
    assert any(note.startswith("1 of 3 hinges are not listed") for note in found.notes)
    assert "spread" not in found.values


@pytest.mark.slow
def test_leaves_thicker_than_drawn_are_as_much_stiffer_in_three_dimensions(guide, tmp_path):
    """The deviation is that of the cubes, and the stiffness that of wide leaves, which cannot bend
    across; leaves of which each is computed alone have nearly that of the whole plate.
    """
    wide = guide.replace(model="three_dimensional")
    flat = as_made(guide, tmp_path, dict.fromkeys(LEAVES, 550))
    alone, deep = (
        as_made(wide, tmp_path, dict.fromkeys(LEAVES, 550), solid=whole) for whole in (False, True)
    )
    assert alone.stiffness[0, 0] == pytest.approx(deep.stiffness[0, 0], rel=0.01)
    assert deep.deviation[0, :2] == pytest.approx(flat.deviation[0, :2], abs=0.5)
    assert 1.0 < deep.stiffness[0, 0] / flat.stiffness[0, 0] < 1 / (1 - POISSON**2)
    assert np.all(deep.bands["stiffness"].diagonal() < 0.02 * deep.stiffness.diagonal())


def test_leaves_as_drawn_have_the_stiffness_of_every_other_question(guide, tmp_path):
    """That of wide leaves, which cannot bend across, 1 / (1 - 0.3^2) at most."""
    wide = guide.replace(model="three_dimensional")
    found = as_made(wide, tmp_path, {"a": 500})
    parts = plates.thickness_of(wide)[0].solid
    other = respond(wide.layout, parts.bodies, hinges=parts.hinges).compliance
    np.testing.assert_allclose(found.stiffness, np.linalg.inv(other[:3, :3]), rtol=1e-6)
    narrow = as_made(guide, tmp_path, {"a": 500}).stiffness[0, 0]
    assert 1.04 < found.stiffness[0, 0] / narrow < 1 / (1 - POISSON**2)


def test_the_scatter_of_leaves_follows_from_their_cubes(guide, tmp_path):
    """First order: `3 t^2 sd` of each leaf; wide scatter of one leaf: the limits are those of `(t +
    1.96 sd)^3`.
    """
    found = as_made(
        guide, tmp_path, {"a": "450,4", "b": "500,9", "b 2": "620,6"}, "hinge,neck_um,sd_um"
    )
    unit = 70e3 * 10 / 40**3
    expected = unit * np.linalg.norm([3 * 0.45**2 * 4e-3, 3 * 0.5**2 * 9e-3, 3 * 0.62**2 * 6e-3])
    assert found.spread[0, 0] == pytest.approx(expected, rel=0.04)
    np.testing.assert_allclose(found.sd, [4, 9, 6])
    wide = as_made(guide, tmp_path, {"b 2": "500,90"}, "hinge,neck_um,sd_um")
    limits = [unit * (2 * 0.125 + (0.5 + side * 1.96 * 0.09) ** 3) for side in (-1, 1)]
    assert [wide.low[0, 0], wide.high[0, 0]] == pytest.approx(limits, rel=0.04)
    assert "necks: neck[0].sd_um" in wide.about.not_stated


def test_notches_as_built_are_those_of_finite_elements_of_the_whole(tmp_path):
    """The pivot of a lever deforms by shear, which beam integrals alone underestimate."""
    lever = flexfem.load("geometry/lever-amplifier.toml").replace(model="plane_stress")
    found = as_made(lever, tmp_path, {"pivot": 400, "lower guide": 560})
    made = lever.replace(hinge={"pivot": {"neck": 0.4}, "lower guide": {"neck": 0.56}})
    drawn, whole = (
        np.linalg.inv(plates.elements(one, 4).compliance[:3, :3]) for one in (lever, made)
    )
    np.testing.assert_allclose(
        found.deviation[0], 100 * (np.diag(whole) / np.diag(drawn) - 1), atol=0.2
    )
    free = [1 / np.diag(np.linalg.inv(each)) for each in (whole, drawn)]
    np.testing.assert_allclose(found.deviation[1], 100 * (free[0] / free[1] - 1), atol=0.2)


def test_a_thicker_lower_leaf_stiffens_a_lever_along_y_as_it_is_used_by_another_share_than_with_the_others_held(
    tmp_path,
):
    """The table names both; the answer in the first line is that with the others free, as the
    output is moved.
    """
    lever = flexfem.load("geometry/lever-amplifier.toml")
    found = as_made(
        lever, tmp_path, {"pivot": "400,5", "lower guide": "560,5"}, "hinge,neck_um,sd_um"
    )
    held, free = (
        found.at("deviation", others=others, direction="y") for others in ("held", "free")
    )
    assert abs(held - free) > 1.0
    assert found.answer().startswith("deviation from the drawing (free): x ")
    first = found.tables()[1]
    assert first.head[:2] == ["others", "direction"] and [row[0] for row in first.rows] == [
        "held",
        "",
        "",
        "free",
        "",
        "",
    ]
    for_one = found.at("high", others="free", direction="y") - found.at(
        "low", others="free", direction="y"
    )
    assert for_one == pytest.approx(
        2 * 1.96 * found.at("spread", others="free", direction="y"), rel=0.06
    )


BAD_NECKS = {
    "hinge,neck_um\nc,500": r"m\.csv, line 2: neck\[0\]\.hinge = .c., expected the name of a hinge, one of a, b, b 2",
    "hinge,neck_um\na,500\nb 2,1001": r"line 3: neck\[1\]\.neck_um = 1001, expected 250 to 1000",
    "hinge,neck_um\na,500\na,510": r"line 3: .*expected each hinge once",
    "chain,hinge,neck_um\n1,a,500": r"line 1: columns chain, hinge, neck_um, expected hinge, neck_um, \[sd_um\]",
    "hinge,neck_um": r"m\.csv: .*expected at least 1 value",
}


@pytest.mark.parametrize(("text", "said"), BAD_NECKS.items(), ids=BAD_NECKS.values())
def test_what_are_no_necks_of_a_mechanism_is_refused_with_its_line(guide, tmp_path, text, said):
    (tmp_path / "m.csv").write_text(text + "\n")
    with pytest.raises(BadInput, match=said) as refused:
        flexfem.as_built(guide, tmp_path / "m.csv")
    assert "\n" not in str(refused.value)
