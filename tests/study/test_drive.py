"""The drive in studies: axis ranges and stiffness of every design by another route, factors on
actuators, identity.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from flexfem.arrays import Array
from flexfem.paper.batch import UNMOVED
from flexfem.paper.commanding import commanding, driven_elements
from flexfem.paper.drives import drive_of
from flexfem.paper.model import ModelChoice
from flexfem.paper.reach import pose_set
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput
from flexfem.study.answer import answer, answer_designs
from flexfem.study.columns import DRIVE_RANGES, ENGAGED
from flexfem.study.loaded import LoadedStudy, load_study, mechanism_of, sample

from ..questions.half_spaces import half_spaces
from ..tolerances import DENSE
from .answered import head

GEOMETRY = Path(__file__).parents[2] / "geometry"
SAME = DENSE  # of a range: two vertices of one linear program
YIELD = "material.yield_strength_mpa"
PIEZO = 'stack = "AE0505D16"'

HEAD = (
    head("driven", "stage.toml")
    + '[sampling]\nmethod = "monte_carlo"\ndesigns = 12\nseed = 11\n[drive]\nactuators = true\n'
)
ELEMENTS = HEAD.replace('"analytic"', '"fe"').replace(
    'formula = "calibrated"\nmobility = 21', "resolution = 4"
)
FACTORS = {  # a range each, in units of the file
    "hinges.base.radius_mm": (2.5, 3.8),
    "hinges.elbow.neck_mm": (0.35, 0.7),
    "override.2.platform.neck_mm": (0.35, 0.7),
    "chain.link_lengths_mm[0]": (28.0, 33.0),
    "chain.link_width_mm": (8.6, 9.4),
    "material.youngs_modulus_gpa": (60.0, 120.0),
    YIELD: (10.0, 120.0),
    "actuator.base.arm_mm": (5.0, 20.0),
    "actuator.elbow.arm_mm": (4.0, 18.0),
    "actuator.base.preload_n": (5.0, 80.0),
    "actuator.elbow.stroke_um": (5.0, 30.0),
    "actuator.base.tilt_deg": (-25.0, 25.0),
    "override.2.actuator.base.arm_mm": (5.0, 20.0),
    "override.3.actuator.elbow.preload_n": (5.0, 80.0),
    "override.1.actuator.elbow.ball_radius_mm": (0.5, 4.0),
}
UNLIKE = """
[[override]]
chain = 3
actuator = "base"
side = "right"
tilt_deg = 12.0
[[override]]
chain = 1
hinge = "elbow"
neck_mm = 0.44
"""


def write(
    folder: Path, factors: dict[str, tuple[float, float]], head: str = HEAD, tail: str = ""
) -> LoadedStudy:
    """A study of the reference stage, the stack of its elbow given by numbers, with unlike chains."""
    text = (GEOMETRY / "mobility6.toml").read_text()
    second = text.rindex(PIEZO, 0, text.index("[provenance]"))
    text = (
        text[:second] + "stroke_um = 17.4\nstiffness_n_per_um = 50.0" + text[second + len(PIEZO) :]
    )
    text = "".join(
        line for line in text.splitlines(True) if not line.startswith('"actuator.elbow.stack')
    )
    (folder / "stage.toml").write_text(text.replace("[provenance]", UNLIKE + "\n[provenance]"))
    body = "".join(
        f'\n[[factor]]\nkey = "{key}"\nfrom = {low}\nto = {high}\n'
        for key, (low, high) in factors.items()
    )
    (folder / "study.toml").write_text(head + body + tail)
    return load_study(folder / "study.toml")


def ranges(
    stage: Stage, choice: tuple[int | None, str, bool], resolution: int | None = None
) -> tuple[Array, Array]:
    """Range (3,) along each axis, mm and rad, the lesser of both ways, and stiffness engaged: one
    design, by HiGHS.

    resolution : of finite elements that push and move; what their necks carry is then the model's.
    """
    one = commanding(ModelChoice(stage, *choice))
    of = one.system if resolution is None else driven_elements(stage, resolution).system
    rows, ends = half_spaces(pose_set(one, of, np.zeros(3)).limits)
    norm = 1e-3 * np.linalg.norm(rows, axis=1)
    unit = np.array([1.0, 1.0, 24.0])
    found = np.zeros((2, 3))
    for k, sign in enumerate((1.0, -1.0)):
        for axis in range(3):
            pose = np.column_stack(
                [-sign * np.eye(3)[axis], unit[:, None] * of.poses]
            )  # um a um of the commands
            cost = np.append(-1.0, np.zeros(pose.shape[1] - 1))
            within = (
                np.column_stack([np.zeros(len(rows)), 1e-3 * rows / norm[:, None]]),
                ends / norm,
            )
            program = linprog(cost, *within, pose, np.zeros(3), bounds=(None, None), method="highs")
            found[k, axis] = -1e-3 * program.fun / unit[axis]
    return np.min(found, axis=0), np.diag(np.linalg.inv(of.engaged))


def same_as_one_by_one(
    loaded: LoadedStudy, choice: tuple[int | None, str, bool], count: int
) -> int:
    """Compare every design of a study with the route of one stage; returns how many were answered."""
    values = sample(loaded, 0, count)
    rows = answer_designs(loaded, values)
    place = [loaded.outputs.index(name) for name in (*DRIVE_RANGES, *ENGAGED)]
    scale = [1e3] * 3 + [1] * 3
    answered = 0
    for index in range(count):
        try:
            stage = mechanism_of(loaded, values[index])
            drive_of(stage)
        except BadInput as refusal:
            assert rows.status[index] == "refused", refusal
            continue
        if rows.status[index] == "ok":
            wanted = np.concatenate(ranges(stage, choice)) * scale
            np.testing.assert_allclose(rows.values[index, place], wanted, rtol=SAME)
            answered += 1
    return answered


def test_every_design_is_as_one_stage_by_another_solver(tmp_path):
    assert same_as_one_by_one(write(tmp_path, FACTORS), (21, "calibrated", False), 12) >= 9


def test_preloads_of_single_stacks_stress_necks(tmp_path):
    """Stacks at the elbow without partners: their preloads, too, count against yield."""
    light = dict.fromkeys(
        ("actuator.elbow.preload_n", "override.3.actuator.elbow.preload_n"), (0.5, 4.0)
    )
    loaded = write(tmp_path, FACTORS | light | {YIELD: (100.0, 300.0)}, HEAD)
    text = (tmp_path / "stage.toml").read_text()
    place = text.index("pair = true", text.index('name = "elbow"'))
    (tmp_path / "stage.toml").write_text(
        text[:place] + text[place:].replace("pair = true", "pair = false", 1)
    )
    assert same_as_one_by_one(load_study(loaded.path), (21, "calibrated", False), 6) >= 3


@pytest.mark.slow
def test_designs_with_elastic_links_are_as_one_stage_by_another_solver(tmp_path):
    loaded = write(tmp_path, FACTORS, HEAD.replace("mobility = 21", "mobility = 21\nlinks = true"))
    assert same_as_one_by_one(loaded, (None, "calibrated", True), 5) >= 4


@pytest.mark.parametrize("strength", [12.0, 5.0e3])
def test_finite_elements_drive_a_stage_as_by_another_solver(tmp_path, strength):
    """With necks that yield, by the model's forces in them, and with none: the same ranges and
    stiffness engaged.
    """
    numbers = {"override.2.platform.neck_mm": 0.41, "actuator.base.arm_mm": 8.0, YIELD: strength}
    factors = {key: (value, value + 1e-9) for key, value in numbers.items()}
    loaded = write(tmp_path, factors, ELEMENTS)
    row = dict(zip(loaded.outputs, answer(loaded, 0, 1).values[0], strict=True))
    stage = mechanism_of(loaded, sample(loaded, 0, 1)[0])
    reach, engaged = ranges(stage, (None, "calibrated", True), 4)
    carried = 1e-9 if strength > 1e3 else 3e-4  # of the necks, by either
    np.testing.assert_allclose([row[column] for column in DRIVE_RANGES], 1e3 * reach, rtol=carried)
    np.testing.assert_allclose([row[column] for column in ENGAGED], engaged, rtol=DENSE)
    yields = ranges(
        stage.replace(material={"yield_strength": 5.0e3}), (None, "calibrated", True), 4
    )[0]
    assert np.all(reach < 0.99 * yields) == (strength < 1e3)


def test_finite_elements_refuse_a_drive_whose_preloads_make_a_neck_yield(tmp_path):
    loaded = write(tmp_path, {YIELD: (30.0, 31.0)}, ELEMENTS)
    text = (tmp_path / "stage.toml").read_text()
    (tmp_path / "stage.toml").write_text(text.replace("pair = true", "pair = false"))
    rows = answer(load_study(loaded.path), 0, 1)
    assert rows.status.tolist() == ["refused"] and rows.reason[0] == UNMOVED


# drive range in x, y (um), theta (mrad), and stiffness engaged (N/mm, N/mm, N mm/rad), mobility 21
REFERENCE = {
    "mobility6": (23.59490, 25.73994, 1.0789694, 7173.291, 7173.291, 6111890.8),
    "mobility3": (24.42500, 26.02746, 1.0792574, 7694.393, 7694.393, 6653570.9),
}


@pytest.mark.parametrize("name", REFERENCE)
def test_the_ranges_of_the_reference_stages_in_studies(tmp_path, name):
    head = HEAD.replace("stage.toml", str(GEOMETRY / f"{name}.toml"))
    (tmp_path / "study.toml").write_text(
        head + '\n[[factor]]\nkey = "thickness_mm"\nfrom = 9.99\nto = 10.01\n'
    )
    loaded = load_study(tmp_path / "study.toml")
    found = dict(
        zip(loaded.outputs, answer_designs(loaded, np.array([[10.0]])).values[0], strict=True)
    )
    np.testing.assert_allclose(
        [found[column] for column in (*DRIVE_RANGES, *ENGAGED)], REFERENCE[name], rtol=1e-6
    )


def test_one_stiff_pair_a_chain_reaches_what_its_hinges_turn(tmp_path):
    """Pairs at the base alone, stiff and on rigid contacts: the first base hinge turns by half the
    stroke over the arm.

    The travel of the same stroke, which counts the base hinges alone, is that range.
    """
    text = (GEOMETRY / "mobility3.toml").read_text()
    begin = text.index("[[actuator]]")
    end = text.index("[provenance]")
    pair = text[begin : text.index("[[actuator]]", begin + 1)].replace("ball_radius_mm = 2.0\n", "")
    pair = pair.replace(PIEZO, "stroke_um = 17.4\nblocking_force_n = 900000.0").replace(
        "= 50.0", "= 450000.0"
    )
    stage = text[:begin] + pair + "\n[provenance]" + text[end + len("[provenance]") :]
    kept = "".join(line for line in stage.splitlines(True) if not line.startswith('"actuator'))
    (tmp_path / "stage.toml").write_text(
        kept.replace("yield_strength_mpa = 503.0", "yield_strength_mpa = 5000.0")
    )
    head = HEAD.replace("mobility = 21", "mobility = 3") + "stroke_um = 8.7\nlever_arm_mm = 10.0\n"
    (tmp_path / "study.toml").write_text(
        head + '\n[[factor]]\nkey = "actuator.base.arm_mm"\nfrom = 9.0\nto = 11.0\n'
    )
    loaded = load_study(tmp_path / "study.toml")
    found = dict(
        zip(loaded.outputs, answer_designs(loaded, np.array([[10.0]])).values[0], strict=True)
    )
    for axis in ("x_um", "y_um", "theta_mrad"):
        assert found[f"drive_range_{axis}"] == pytest.approx(
            found[f"travel_{axis}"], rel=2e-3
        )  # stacks give a little
