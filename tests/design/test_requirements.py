"""What a requirements file may say, what its hash is of, and which designs a shop can make."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.design.model import DesignSpace
from flexfem.refused import BadInput

from .conftest import HEAD, LINK, NECK, RADIUS, RANGE, STIFFEST, best, require, tolerance

OUTPUT = '[[output]]\nname = "o"\nexpression = "thickness_mm ** 2"\n'
ELBOW = '[[free]]\nkey = "hinges.elbow.neck_mm"\nfrom = 0.3\nto = 0.7\n'
EACH_ELBOW = ELBOW.replace("hinges.elbow", "override.*.elbow")
DENSITY = '[[free]]\nkey = "material.density_kg_m3"\nfrom = 2000.0\nto = 3000.0\n'


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ((NECK, require("kxx_n_per_mm", 50, 40), RANGE), "at_most = 40.0, expected >= 50"),
        ((NECK, require("kxx_n_per_mm", 60, 60), RANGE), "at_most = 60.0, expected >= 60.12"),
        ((NECK, require("kxx_per_mm", 50), RANGE), "did you mean kxx_n_per_mm"),
        ((NECK, RANGE, NECK.replace('"neck"', '"other"')), "free[0] sets hinges.elbow.neck_mm"),
        (
            (NECK, best("maximise", "thickness_mm")),
            'maximise = "thickness_mm", expected a quantity that free',
        ),
        (
            (NECK, RANGE, OUTPUT.replace('"o"', '"o p"')),
            'name = "o p", expected at most 60 of A-Z, a-z, 0-9 and _,',
        ),
        (
            (NECK, best("minimise", "2 * o"), OUTPUT),
            'minimise = "2 * o", expected a quantity that free dim',
        ),
        (
            (NECK, best("minimise", "actuator.base.arm_mm")),
            "expected a quantity that free dimensions change",
        ),
        (
            (NECK, best("maximise", "range_x_um + hinges.base.axis_deg")),
            "stage does not state hinges.base.axis_deg",
        ),
        (
            (NECK, RANGE, OUTPUT.replace("thickness_mm", "hinges.base.axis_deg")),
            "output[0].expression: the stage does",
        ),
        ((NECK + "step = 0.5\n", RANGE), "free[0].step = 0.5, expected at most 0.4"),
        ((NECK.replace("elbow.neck_mm", "elbow.neck"), RANGE), "did you mean hinges.elbow.neck_mm"),
        ((NECK, best("maximise", "coupling_95")), "coupling_95"),
        ((NECK, RANGE, STIFFEST, best("maximise", "kyy_n_per_mm")), "objective"),
        (
            (NECK, require("kxx_n_per_mm", 1e308), RANGE),
            "require[0].at_least = 1e+308, expected <= 1e+30",
        ),
        (
            (NECK, require("kxx_n_per_mm", None, -1e-300), RANGE),
            "at_most = -1e-300, expected zero, or a size of 1e-30",
        ),
        ((NECK.replace('"neck"', '"mass_kg"'), RANGE), 'a unique name, not "mass_kg" again'),
        (
            (NECK, '[[objective]]\nmaximise = "kxx_n_per_mm"\nminimise = "kyy_n_per_mm"\n'),
            "maximise or minimise",
        ),
        (
            (NECK, best("maximise", "life_cycles"), "[life]\namplitude_x_um = 100.0\n"),
            "life, on the base stage",
        ),
        (
            (DENSITY, RANGE),
            "free[0].key = material.density_kg_m3, expected a number that affects outputs",
        ),
        ((NECK, tolerance(stages=71), RANGE), "tolerance.stages = 71, expected >= 72"),
        ((NECK, tolerance(checked=7), RANGE), "tolerance.checked = 7, expected 0, or at least 8"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line_with_file_and_key(load, pieces, message):
    with pytest.raises(BadInput, match=r"wanted\.toml") as refusal:
        load(*pieces)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_dimension_that_answers_follow_in_part_is_free(load):
    assert load(ELBOW, EACH_ELBOW.replace("*", "2"), RANGE).columns
    assert load(NECK, EACH_ELBOW, RANGE).columns  # the platform's necks follow
    assert load(DENSITY, best("minimise", "mass_kg")).columns
    assert load(DENSITY, best("minimise", "2 * material.density_kg_m3")).columns
    assert load(NECK, best("minimise", "override.2.elbow.neck_mm")).columns  # follows the free one


def test_model_and_questions_reach_the_study(load):
    head = HEAD + 'formula = "lobontiu"\nmobility = 6\n'
    pieces = (
        "[drive]\nstroke_um = 12.0\nlever_arm_mm = 9.0\n",
        "[frequencies]\npayload_kg = 0.3\n",
        "[drift]\n",
    )
    study = load(NECK, *pieces, best("minimise", "drift_theta_urad_per_k"), head=head).study
    assert (study.formula, study.mobility, study.links, study.model) == (
        "lobontiu",
        6,
        False,
        "analytic",
    )
    assert (study.drive.stroke_um, study.drive.lever_arm_mm, study.frequencies.payload_kg) == (
        12.0,
        9.0,
        0.3,
    )
    assert study.drift is not None


def test_a_search_begins_at_the_base_stage_or_at_the_end_next_to_it(load):
    """Its necks are 0.5 mm, its link 1 is 30 mm, its radii are 1.5 mm."""
    free = (
        NECK.replace("0.3", "0.2"),
        LINK.replace("26.0", "32.0"),
        RADIUS.replace("4.0", "1.4").replace("1.5", "1.0"),
    )
    assert load(*free, RANGE).base_values.tolist() == [0.5, 32.0, 1.4]


def test_steps_and_lists_are_what_can_be_made_and_a_logarithmic_range_is_even_in_ratios(load):
    listed = '[[free]]\nkey = "chain.link_lengths_mm[1]"\nvalues = [40.0, 30.0, 32.0]\n'
    space = DesignSpace(load(NECK + "step = 0.005\n", RADIUS, listed, RANGE).columns)
    values = np.array([[0.3024, 2.22, 32.0], [0.6976, 1.5, 40.0]])
    assert space.snapped(space.from_unit(space.to_unit(values))) == pytest.approx(
        np.array([[0.3, 2.22, 32.0], [0.7, 1.5, 40.0]])
    )
    assert space.neighbours(np.array([0.3, 2.0, 40.0])) == pytest.approx(
        np.array([[0.3, 2.0, 32.0], [0.3, 2.0, 40.0], [0.305, 2.0, 32.0], [0.305, 2.0, 40.0]])
    )
    space = DesignSpace(load(LINK + "step = 3.0\n", RANGE).columns)
    assert space.from_unit(np.array([[1.0]])).item() == 38.0
    assert space.snapped(np.array([[40.0], [27.4], [27.6]])).ravel().tolist() == [38.0, 26.0, 29.0]
    space = DesignSpace(load(RADIUS.replace("to = 4.0", 'to = 6.0\nscale = "log"'), RANGE).columns)
    assert space.from_unit(np.array([[0.0], [0.5], [1.0]])).ravel() == pytest.approx(
        [1.5, 3.0, 6.0]
    )
    assert space.to_unit(np.array([[1.5], [3.0], [6.0]])).ravel() == pytest.approx([0.0, 0.5, 1.0])


def test_of_many_stepped_dimensions_any_two_are_moved_at_once(load):
    """Of seven, each at an inner step: 7 pairs of moves of one, and 4 of each of 21 pairs, and the
    design itself.
    """
    keys = [
        f"hinges.{name}.{kind}_mm"
        for name in ("base", "elbow", "platform")
        for kind in ("neck", "radius")
    ]
    free = [f'[[free]]\nkey = "{key}"\nfrom = 0.5\nto = 0.7\nstep = 0.1\n' for key in keys]
    space = DesignSpace(load(*free, LINK + "step = 1.0\n", RANGE).columns)
    around = space.neighbours(np.array([*[0.6] * 6, 30.0]))
    moved = np.count_nonzero(~np.isclose(around, [*[0.6] * 6, 30.0]), axis=1)
    assert np.bincount(moved).tolist() == [1, 14, 84]
