"""Deliberate errors in the physics and in numbers derived from it, and for each the test that must catch it.

Every row is put into a copy of the project, one at a time, and exactly the named test is run there.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from .conftest import nodes_of, syntax_of

ROOT = Path(__file__).parent.parent
PARTS = ("flexfem", "tests", "geometry", "cases", "pyproject.toml")
NOT_THE_COPY = 77  # exit code when the editable install was imported instead of the copy
FAILED = 1  # pytest's exit code for tests that ran and failed; a node that is not found is another
TIME_LIMIT = 180.0  # s, for one test
GUARD = f"""
import os, sys
from pathlib import Path
import flexfem
if not Path(flexfem.__file__).is_relative_to(os.environ["FLEXFEM_COPY"]):
    print(f"imported from {{flexfem.__file__}}", flush=True)
    os._exit({NOT_THE_COPY})
"""


class Mutation(NamedTuple):
    """An error, the function or constant of the package it is made in, and the name of the test that sees it.

    `old` is an expression or a statement that is there once, however it is laid out, and becomes `new`; `_a` stands for
    any expression.
    """

    error: str
    where: str
    old: str
    new: str
    test: str


MUTATIONS = [
    Mutation(
        "margins of a design printed in the unit of the quantity as per cent",
        "_row",
        "of.margin_percent",
        "of.margin",
        "test_a_record_is_printed_with_each_number_where_its_heading_says",
    ),
    Mutation(
        "a design that model and metal do not agree on ends well",
        "design",
        "0 if found.feasible and found.agreed else 1",
        "0 if found.feasible else 1",
        "test_the_command_ends_with_one_where_no_design_is_found_or_proven",
    ),
    Mutation(
        "a page that gives margins for prices",
        "_asked",
        "Cell(significant(of.price_percent, 3), of.price_percent)",
        "Cell(significant(of.margin_percent, 3), of.margin_percent)",
        "test_requirements_have_their_margins_prices_and_relaxations",
    ),
    Mutation(
        "bands of margins drawn in the unit of the quantity",
        "plot_margins",
        "each.band_percent or 0.0",
        "each.band or 0.0",
        "test_margins_are_in_per_cent_with_bands_marks_and_prices",
    ),
    Mutation(
        "a front drawn of what the model foretold",
        "plot_objectives",
        "(one.values[first], one.values[second])",
        "(one.predicted[first], one.predicted[second])",
        "test_a_front_is_of_finite_elements_and_its_designs_are_drawn_by_their_numbers_to_one_scale",
    ),
    Mutation(
        "bars that lessen a quantity beyond the end of their axis",
        "_reach",
        "abs(row[of.name] or 0.0)",
        "row[of.name] or 0.0",
        "test_sensitivities_are_each_of_the_quantity_in_their_title",
    ),
    Mutation(
        "guards of requirements as large as bands in their own units",
        "mapped",
        "rounds[-1].bands[model.objectives :] / model.scales",
        "rounds[-1].bands[model.objectives :]",
        "test_ends_are_tightened_by_the_largest_band_so_far_over_their_size_and_without_steps_by_the_accuracy",
    ),
    Mutation(
        "ranges and lives of designs with the bands of the platform",
        "OF_STRESS",
        "{*STRESSES, *RANGES, *lasting((True, True, True))}",
        "{*STRESSES}",
        "test_a_band_is_of_the_slowest_of_the_columns_that_a_quantity_uses",
    ),
    Mutation(
        "evaluations of a resumed search left out",
        "found",
        "counts.update(known[1])",
        "known[1]",
        "test_a_search_that_is_kept_is_not_made_again_and_its_evaluations_are_counted_as_if_it_were",
    ),
    Mutation(
        "designs proven on meshes of 8 whatever is asked",
        "of",
        "levels(self.loaded.requirements.resolution)",
        "levels(8)",
        "test_a_design_is_solved_on_three_meshes_up_to_the_resolution_coarse_to_fine",
    ),
    Mutation(
        "necks that scatter by calibrated hinges whatever the formula",
        "_at_nodes",
        "hinge_compliances(many, loaded.study.formula)",
        'hinge_compliances(many, "calibrated")',
        "test_coupling_under_tolerance_is_that_of_stages_made_one_by_one",
    ),
    Mutation(
        "one hash for designs of two seeds",
        "hash",
        '{"name", "stage", "provenance", "accuracy_percent"}',
        '{"name", "stage", "provenance", "accuracy_percent", "seed"}',
        "test_a_hash_is_of_all_that_a_design_depends_on_and_of_nothing_else",
    ),
    Mutation(
        "relaxations by the model as it is, not corrected",
        "alternatives",
        "model.corrections",
        "{}",
        "test_relaxations_are_of_the_corrected_model_and_each_of_its_own_requirement",
    ),
    Mutation(
        "designs of a front from the worst in the first objective",
        "best_of",
        "both[k, 0]",
        "-both[k, 0]",
        "test_designs_of_a_front_are_those_that_no_other_beats_from_the_best_in_the_first_objective",
    ),
    Mutation(
        "stiffness between X and rotation for that between X and Y in errors of a formula",
        "columns",
        "[[0, 3, 4], [3, 1, 5], [4, 5, 2]]",
        "[[0, 4, 3], [4, 1, 5], [3, 5, 2]]",
        "test_errors_along_each_direction_are_of_the_whole_stiffness_of_a_stage_without_symmetry",
    ),
    Mutation(
        "area that a design adds counted from the left of all that is known",
        "gains",
        "np.maximum(edges[:-1], both[:, :1])",
        "edges[:-1]",
        "test_the_area_that_a_design_adds_is_that_of_rectangles",
    ),
    Mutation(
        "designs on a front that break requirements",
        "_best",
        "meet = np.flatnonzero(missed <= 0)",
        "meet = np.arange(len(missed))",
        "test_few_answers_show_where_the_front_within_a_circle_is",
    ),
    Mutation(
        "the next design of a front chosen by the farthest of those before it",
        "apart",
        "np.min(np.linalg.norm(_a, axis=2), axis=1)",
        "np.max(np.linalg.norm(_a, axis=2), axis=1)",
        "test_designs_of_a_front_are_chosen_far_from_each_other",
    ),
    Mutation(
        "margins of a front in units of the requirement called per cent",
        "proven",
        "margins / model.scales",
        "margins",
        "test_any_design_of_the_front_is_a_stage_and_has_its_row",
    ),
    Mutation(
        "stage files of a front numbered otherwise than its figure",
        "write_design",
        "enumerate(found.front, 1)",
        "enumerate(found.front, 0)",
        "test_any_design_of_the_front_is_a_stage_and_has_its_row",
    ),
    Mutation(
        "three objectives searched without what searches them",
        "require_pymoo",
        "len(loaded.requirements.objective) > 2",
        "len(loaded.requirements.objective) > 4",
        "test_without_pymoo_three_objectives_are_refused_in_one_line",
    ),
    Mutation(
        "the largest sought where the smallest is asked",
        "sign",
        "1.0 if self.maximise is None else -1.0",
        "1.0",
        "test_an_objective_goes_the_way_that_is_asked_and_a_miss_is_worse_than_any_value",
    ),
    Mutation(
        "requirements that are missed cost nothing",
        "merit",
        "np.sum(self.violations(found), axis=1)",
        "np.zeros(len(found.reason))",
        "test_an_objective_goes_the_way_that_is_asked_and_a_miss_is_worse_than_any_value",
    ),
    Mutation(
        "requirements tightened by no guard",
        "ends",
        "np.minimum(_a, self.room)",
        "np.zeros(len(of))",
        "test_a_guard_moves_each_end_inward_by_its_part_of_the_size",
    ),
    Mutation(
        "an upper end loosened where it is to be tightened, so that its price is that of less",
        "ends",
        "high + np.minimum(more, 0.0)",
        "high - np.minimum(more, 0.0)",
        "test_one_per_cent_less_thickness_costs_one_per_cent_of_the_stiffness_and_more_likewise",
    ),
    Mutation(
        "an end taken for kept that the band reaches beyond",
        "_kept",
        "q - band >= low",
        "q >= low",
        "test_an_end_is_kept_where_the_band_is_within_it_too",
    ),
    Mutation(
        "the model corrected by its ratio to finite elements upside down",
        "correction_of",
        "Correction(elements / model)",
        "Correction(model / elements)",
        "test_a_number_that_vanishes_is_corrected_by_a_term_and_others_by_a_factor",
    ),
    Mutation(
        "rounding to the farther step",
        "snapped",
        "np.where(_a, before, after)",
        "np.where(_a, after, before)",
        "test_steps_and_lists_are_what_a_shop_can_make",
    ),
    Mutation(
        "any relaxation that is enough for the smallest",
        "wanted",
        "np.maximum(0.0, -self.margins(found)[self.yielding])",
        "np.zeros(len(found.reason))",
        "test_relaxations_are_of_the_corrected_model_and_each_of_its_own_requirement",
    ),
    Mutation(
        "finite elements of one design kept for another of its study",
        "question",
        "digest([self.study.hash, self.design, _a])",
        "digest([self.study.hash, _a])",
        "test_what_is_stored_answers_its_own_question_alone",
    ),
    Mutation(
        "a search kept for another correction of the model",
        "content",
        "sorted((k, list(v)) for k, v in model.corrections.items())",
        "[]",
        "test_what_is_stored_answers_its_own_question_alone",
    ),
    Mutation(
        "sensitivities of one side over the distance of two",
        "sensitivities",
        "around[d:2 * d] - around[:d]",
        "around[d:2 * d] - around[-1]",
        "test_a_thin_neck_at_its_rotational_stiffness_has_the_largest_radius_and_the_closed_form_neck",
    ),
    Mutation(
        "the margin on a page in the unit of the quantity for that in per cent",
        "_asked",
        "significant(of.margin_percent, 3)",
        "significant(of.margin, 3)",
        "test_a_page_of_a_design_has_its_margins_prices_and_sensitivities_and_hostile_names_as_text",
    ),
    Mutation(
        "a coupling under tolerance stated of the stages that the search has seen",
        "seed_of_others",
        "(seed + 1) % 2 ** 63",
        "seed",
        "test_stages_that_finite_elements_solve_are_the_first_that_no_search_sees",
    ),
    Mutation(
        "the band of a coupling under tolerance without what finite elements leave open from stage to stage",
        "half_widths",
        "own * _a + _b",
        "own * _a",
        "test_the_record_states_other_stages_times_the_factor_of_finite_elements_with_a_band_of_both",
    ),
    Mutation(
        "necks between the nodes weighted as if the first and last node were any other",
        "basis_at",
        "weights[[0, -1]] /= 2",
        "weights[[0, -1]] /= 1",
        "test_coupling_under_tolerance_is_that_of_stages_made_one_by_one",
    ),
    Mutation(
        "the interval of a 95 % value as narrow as that of one in two",
        "bounded",
        "np.array([-0.5, 0.5])",
        "np.array([-0.25, 0.25])",
        "test_the_interval_holds_the_true_value_of_95_percent_of_samples_whatever_the_distribution",
    ),
    Mutation(
        "names of files are markup on a page",
        "templates",
        "Environment(loader=_a, autoescape=True, undefined=_b, trim_blocks=True, lstrip_blocks=True)",
        "Environment(loader=_a, autoescape=False, undefined=_b, trim_blocks=True, lstrip_blocks=True)",
        "test_a_hostile_name_of_a_stage_is_text",
    ),
    Mutation(
        "the pointed-at error of a curve in mm beside the name of another unit",
        "_of_curves",
        "significant(error * unit.factor)",
        "significant(error)",
        "test_a_spot_tells_command_error_and_band",
    ),
    Mutation(
        "a page counts the assumed numbers of the stage without those of its drive",
        "doubted",
        "[*found.assumed, *_a]",
        "[*found.assumed]",
        "test_assumed_numbers_are_counted_first_and_listed",
    ),
    Mutation(
        "figures of a page share the ids of their parts",
        "_detach",
        "part.set(key, f'{prefix}-{value}')",
        "part.set(key, value)",
        "test_two_figures_share_no_id_and_refer_to_their_own",
    ),
    Mutation(
        "a spot of a figure upside down",
        "placed_spots",
        "height - middle[1] * scale",
        "middle[1] * scale",
        "test_a_spot_is_where_its_point_is",
    ),
    Mutation(
        "a library broken off by Ctrl-C while it is imported",
        "_imports",
        "frame.f_code.co_filename != IMPORTER",
        "True",
        "test_a_stop_waits_for_the_import_that_is_going_on",
    ),
    Mutation(
        "numbers accepted without a reason",
        "baseline",
        "not isinstance(reason, str) or not reason.strip()",
        "False",
        "test_files_that_cannot_all_be_accepted_are_refused_from_python_too",
    ),
    Mutation(
        "blocks lower than the notch that they hold",
        "hinge_review",
        'arguments.between("height", height, 1.0, HIGHEST)',
        "height",
        "test_a_wrong_argument_is_refused_in_one_line_and_nothing_is_written",
    ),
    Mutation(
        "nan taken for a number in its range",
        "between",
        "not least <= float(value) <= most",
        "float(value) < least or float(value) > most",
        "test_a_wrong_argument_is_refused_in_one_line_and_nothing_is_written",
    ),
    Mutation(
        "shares of pole and stage swapped in print",
        "print_experiment",
        '("displacement read, share of", "stage", "pole", "bar")',
        '("displacement read, share of", "pole", "stage", "bar")',
        "test_table_ii_has_every_number_in_its_column",
    ),
    Mutation(
        "the best known neck for the worst",
        "print_as_built",
        "max(map(max, of.sd))",
        "min(map(min, of.sd))",
        "test_a_stage_as_made_is_printed_with_drawn_deviation_and_scatter",
    ),
    Mutation(
        "scattered necks on rigid links",
        "_scattered",
        "body_compliance(made)[None] if of.links else None",
        "None",
        "test_measured_necks_give_their_own_stiffness",
    ),
    Mutation(
        "lines drawn beyond the readings",
        "plot_push",
        "np.array([0.0, float(np.max(push.displacement))])",
        "np.array([0.0, float(np.max(push.load))])",
        "test_readings_and_lines_are_those_of_the_record",
    ),
    Mutation(
        "cycles counted as reversals",
        "ONE_REVERSAL",
        "0.5",
        "1.0",
        "test_basquin_counts_reversals_two_a_cycle",
    ),
    Mutation(
        "the sign of Basquin's exponent",
        "amplitude_at",
        "reversals ** np.asarray(exponent, dtype=float)",
        "reversals ** -np.asarray(exponent, dtype=float)",
        "test_basquin_counts_reversals_two_a_cycle",
    ),
    Mutation(
        "mean stress ignored",
        "equivalent",
        "np.maximum(mean + amplitude, 0.0)",
        "amplitude",
        "test_mean_stress_by_walker_and_by_smith_watson_and_topper",
    ),
    Mutation(
        "the ratio of displacements upside down",
        "scaled",
        "_a * (1.0 + ratio) / (1.0 - ratio)",
        "_a * (1.0 - ratio) / (1.0 + ratio)",
        "test_a_ratio_is_least_over_greatest_and_shortens_life",
    ),
    Mutation(
        "the concentration at a notch counted twice",
        "surface_stress",
        "_a.bending",
        "_a.bending ** 2",
        "test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation(
        "Walker's exponent inverted",
        "equivalent",
        "highest ** (1.0 - walker) * amplitude**walker",
        "highest ** walker * amplitude ** (1.0 - walker)",
        "test_mean_stress_by_walker_and_by_smith_watson_and_topper",
    ),
    Mutation(
        "a rising S-N curve accepted",
        "_falls",
        "STEEPEST <= exponent <= FLATTEST",
        "STEEPEST <= exponent <= -STEEPEST",
        "test_impossible_fatigue_data_is_refused_in_one_line",
    ),
    Mutation(
        "R over t for t over R in the concentration",
        "stress_raised",
        "designs.neck / designs.radius",
        "designs.radius / designs.neck",
        "test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation(
        "notch sensitivity taken the wrong way",
        "counted",
        "(1.0 + sensitivity * (K - 1.0)) / K",
        "(1.0 + (1.0 - sensitivity) * (K - 1.0)) / K",
        "test_the_stress_at_zero_mean_is_the_neck_stress_of_the_models",
    ),
    Mutation(
        "notch sensitivity forgotten by finite elements",
        "by_elements",
        "np.full(len(mean), part[chain, hinge])",
        "np.ones(len(mean))",
        "test_notch_sensitivity_lets_less_of_the_concentration_count_and_all_of_it_for_yield",
    ),
    Mutation(
        "notch sensitivity in the safety against yield",
        "peak",
        "np.abs(self.mean)",
        "self.counted * np.abs(self.mean)",
        "test_notch_sensitivity_lets_less_of_the_concentration_count_and_all_of_it_for_yield",
    ),
    Mutation(
        "a wanted life in reversals, in studies",
        "lives",
        "amplitude_at(asked.wanted, coefficient, exponent)",
        "amplitude_at(asked.wanted / 2, coefficient, exponent)",
        "test_the_life_fully_reversed_along_one_direction_is_that_of_the_neck_stress",
    ),
    Mutation(
        "Walker's exponent of one material for all designs",
        "lives",
        "walker[:, None]",
        "walker[0]",
        "test_designs_at_once_have_the_lives_of_each_alone",
    ),
    Mutation(
        "safety by the stress that counts for fatigue",
        "lives",
        "yield_strength / np.max(of.peak(), axis=-1)",
        "yield_strength / highest",
        "test_designs_at_once_have_the_lives_of_each_alone",
    ),
    Mutation(
        "what is asked of lives left out of the hash",
        "hash",
        "content[key] is None",
        'key == "life" or content[key] is None',
        "test_what_is_asked_of_lives_is_part_of_what_a_study_is",
    ),
    Mutation(
        "the stress of a model for another direction",
        "model_record",
        "analytic.stress[..., axis]",
        "analytic.stress[..., 0]",
        "test_verify_says_the_highest_neck_stress_by_both_models_and_where",
    ),
    Mutation(
        "stress by the displacement across",
        "per_displacement",
        "self.pose[axis]",
        "self.pose[0]",
        "test_verify_says_the_highest_neck_stress_by_both_models_and_where",
    ),
    Mutation(
        "the wrong neck named beside its stress",
        "of",
        "HINGE_NAMES[position]",
        "HINGE_NAMES[chain]",
        "test_verify_says_the_highest_neck_stress_by_both_models_and_where",
    ),
    Mutation(
        "chain and hinge of a command's stress swapped",
        "_peak",
        "np.array(of)",
        "np.array(of).T",
        "test_rows_are_what_they_say_and_the_metal_bears_the_load",
    ),
    Mutation(
        "the stress of the coarsest mesh",
        "banded_stress",
        "found[-1]",
        "found[0]",
        "test_stiffness_says_the_stress_of_finite_elements_with_a_band_that_holds_a_finer_mesh",
    ),
    Mutation(
        "Lame constants swapped",
        "lame",
        "return _a, _b",
        "return _b, _a",
        "test_roache_manufactured_solution_has_orders_three_and_two",
    ),
    Mutation(
        "the mirror plane free",
        "mirrored",
        "(0, 2 * number) if faces_held else (0,)",
        "(2 * number,) if faces_held else ()",
        "test_half_the_thickness_answers_as_the_whole",
    ),
    Mutation(
        "half of the thickness for the whole",
        "mirrored",
        "layered(_a, _b, 2)",
        "layered(_a, _b, 1)",
        "test_half_the_thickness_answers_as_the_whole",
    ),
    Mutation(
        "layers of even thickness",
        "mirrored",
        "surface * np.sinh(spaced)",
        "thickness / 2 * np.linspace(1.0, 0.0, number + 1)",
        "test_layers_are_thinner_towards_the_face",
    ),
    Mutation(
        "layers thinner towards the mid-plane",
        "mirrored",
        "thickness / 2 - surface * np.sinh(spaced)",
        "surface * np.sinh(spaced[::-1])",
        "test_layers_are_thinner_towards_the_face",
    ),
    Mutation(
        "a third of reactions and energy counted once",
        "sums",
        "[R @ each @ R.T for R in turns]",
        "[R @ each @ R.T for R in turns[:1]]",
        "test_one_third_answers_as_the_whole_ring",
    ),
    Mutation(
        "a third of the stiffness counted for all three",
        "condense_alike",
        "[T.T @ condensed.schur @ T for T in turns]",
        "[turns[0].T @ condensed.schur @ turns[0]] * 3",
        "test_one_third_answers_as_the_whole_ring",
    ),
    Mutation(
        "the share of the layers left out of a case's bands",
        "answer_of_solid",
        "max(each.band, mesh_band(steps, each.values)) + of",
        "max(each.band, mesh_band(steps, each.values))",
        "test_bands_are_of_the_mesh_and_of_the_layers",
    ),
    Mutation(
        "bands of layers without a safety factor",
        "of_layers",
        "SAFETY * eigh(self.many - self.few, self.many, eigvals_only=True)",
        "eigh(self.many - self.few, self.many, eigvals_only=True)",
        "test_an_error_of_the_compliance_moves_a_pose_by_no_more_than_its_bound",
    ),
    Mutation(
        "errors of coarser meshes of a case with one layer, not moved to its layers",
        "answer_of_solid",
        "bounds.planes + (response.compliance - bounds.planes[-1])",
        "bounds.planes",
        "test_bands_are_of_the_mesh_and_of_the_layers",
    ),
    Mutation(
        "a case in three dimensions answered by the plane stage",
        "_answer",
        'case.model == "three_dimensional"',
        'case.model == "solid"',
        "test_a_case_in_three_dimensions_asks_the_extruded_stage",
    ),
    Mutation(
        "stress of the mid-plane for the highest through the thickness",
        "_full",
        "solid_von_mises(stress).max(axis=1)",
        "solid_von_mises(stress)[:, 0]",
        "test_fields_are_of_the_mid_plane_and_of_the_highest_stress",
    ),
    Mutation(
        "bands of the mesh in three dimensions by the observed order alone",
        "bands_of",
        "mesh_band(steps, of.planes[:, k, k], 0.0)",
        "plane[k, k]",
        "test_bands_hold_the_truth_and_are_no_more_than_several_times_the_error",
    ),
    Mutation(
        "the band of the layers left out of the total",
        "total",
        "self.plane + self.thickness",
        "self.plane",
        "test_bands_hold_the_truth_and_are_no_more_than_several_times_the_error",
    ),
    Mutation(
        "the plane stage taken for the one in three dimensions among the alternatives",
        "other_thickness",
        "compliance + response.compliance - plane",
        "compliance + plane - response.compliance",
        "test_three_dimensions_change_the_plane_stage_by_what_is_measured_and_by_what_is_charted",
    ),
    Mutation(
        "plane strain's constants for plane stress in Zettl's bounds",
        "plane",
        "Plate(E, nu, 1.0)",
        "Plate(E / (1 - nu**2), nu / (1 - nu), 1.0)",
        "test_zettl_2005_plane_stress_and_plane_strain_bound_a_hinge_of_any_depth",
    ),
    Mutation(
        "a third left out",
        "condense_alike",
        "[T.T @ condensed.schur @ T for T in turns]",
        "[T.T @ condensed.schur @ T for T in turns[:2]]",
        "test_one_third_answers_as_the_whole_ring",
    ),
    Mutation(
        "the metal stays cold in finite elements",
        "heat_response",
        "frame_expansion - stage_expansion",
        "frame_expansion - 0.0 * stage_expansion",
        "test_a_stage_whose_frame_expands_alike_neither_moves_nor_is_stressed",
    ),
    Mutation(
        "the frame stays cold in finite elements",
        "heat_response",
        "frame_expansion - stage_expansion",
        "0.0 * frame_expansion - stage_expansion",
        "test_a_stage_whose_frame_expands_alike_neither_moves_nor_is_stressed",
    ),
    Mutation(
        "the frame stays cold in the model",
        "misfits",
        "frame_expansion - stage_expansion",
        "0.0 * frame_expansion - stage_expansion",
        "test_drift_is_linear_in_both_coefficients_and_zero_where_they_are_the_same",
    ),
    Mutation(
        "the difference of both drift models the other way round",
        "_rows",
        "100 * (one / other - 1)",
        "100 * (other / one - 1)",
        "test_every_row_has_its_numbers_in_their_units",
    ),
    Mutation(
        "unlike chains drift as alike ones do, in print",
        "_rows",
        "pose_texts(case.unlike, lever)",
        "pose_texts(model.pose, lever)",
        "test_every_row_has_its_numbers_in_their_units",
    ),
    Mutation(
        "the response drawn over radians per second",
        "plot_response",
        "w / (2 * math.pi)",
        "w / math.pi",
        "test_responses_are_drawn_over_hertz_with_magnitudes_per_input",
    ),
    Mutation(
        "a mode named by the direction that it moves least in",
        "said_of_mode",
        "max(shares, key=_a)",
        "min(shares, key=_a)",
        "test_titles_name_the_direction_that_moves_most",
    ),
    Mutation(
        "bars bow towards their warmer side",
        "misfits",
        "[none, y, -x]",
        "[none, -y, x]",
        "test_loops_open_by_the_displacement_of_the_ground_in_a_warm_body",
    ),
    Mutation(
        "a body warms in one direction only",
        "free_displacement",
        "np.stack([x * y, -half], axis=-1)",
        "np.stack([x * y, half], axis=-1)",
        "test_free_fields_are_without_shear_and_grow_with_the_temperature",
    ),
    Mutation(
        "clamped edges stay straight in the model",
        "drift",
        "gaps = gaps + _a",
        "gaps = gaps + 0 * _a",
        "test_both_models_agree_on_unlike_chains",
    ),
    Mutation(
        "a gradient along one axis for the largest",
        "rates_of",
        "(np.hypot(a + d, c - b) + np.hypot(a - d, b + c)) / 2",
        "np.hypot(a, c)",
        "test_designs_at_once_have_the_drift_of_each_alone",
    ),
    Mutation(
        "coefficients of frame and stage swapped in designs",
        "EXPANDING",
        '("material", "frame")',
        '("frame", "material")',
        "test_designs_at_once_have_the_drift_of_each_alone",
    ),
    Mutation(
        "drift of a design on straight clamped edges",
        "elastic_parts",
        "bodies.edges[index] = edge_motions(stage)",
        "pass",
        "test_the_drift_of_a_stage_with_unlike_chains_is_that_of_finite_elements",
    ),
    Mutation(
        "a gradient for the uniform change",
        "rates_of",
        "pose[:, :, 0]",
        "pose[:, :, 1]",
        "test_the_drift_of_a_stage_with_unlike_chains_is_that_of_finite_elements",
    ),
    Mutation(
        "a study on drift known without the expansions",
        "hash",
        "self.stage.heat_hash",
        "self.stage.hash",
        "test_expansion_is_part_of_what_a_study_on_drift_is_and_of_no_other",
    ),
    Mutation(
        "expansions as factors where nothing asks for drift",
        "unasked",
        '{"density": frequencies, "expansion": drift}',
        '{"density": frequencies, "expansion": True}',
        "test_expansion_is_a_factor_with_drift_alone",
    ),
    Mutation(
        "values between zero and the least possible let through",
        "impossible",
        "(np.min(values), np.max(values), _least_positive(values))",
        "(np.min(values), np.max(values))",
        "test_expansions_of_another_unit_between_possible_ones_are_refused",
    ),
    Mutation(
        "a frame of no stated expansion accepted in studies",
        "require_model",
        "require_expansion(stage, frame=True)",
        "require_expansion(stage)",
        "test_a_stage_without_a_coefficient_is_refused_in_one_line",
    ),
    Mutation(
        "microradians per kelvin in milliradians",
        "UNITS",
        'Unit(1e6, "µrad/K")',
        'Unit(1e3, "µrad/K")',
        "test_every_unit_has_its_size",
    ),
    Mutation(
        "clamped edges bow to the wrong side",
        "edge_motions",
        "[0.0, -e, 1j * e]",
        "[0.0, e, -1j * e]",
        "test_both_models_agree_on_unlike_chains",
    ),
    Mutation(
        "a pad that is not held sideways",
        "_fields",
        "0.5j * (y**2 - (2 + nu) * x**2)",
        "0.5j * (y**2 - nu * x**2)",
        "test_an_edge_that_bows_takes_its_pad_along_by_the_mean_of_the_traction_on_it",
    ),
    Mutation(
        "rotations left out of what a gradient does",
        "_ends",
        "pose[:, 2] *= _a",
        "pose[:, 2] *= 0.0 * _a",
        "test_a_gradient_moves_unlike_chains_further_as_finite_elements_say",
    ),
    Mutation(
        "unlike pads strained as like ones are",
        "_warmed",
        "edges[factor][:, k]",
        "edges[1.0][:, k]",
        "test_on_nearly_straight_chains_the_clamped_edges_decide_whether_a_gradient_moves_unlike_ones_further",
    ),
    Mutation(
        "finite elements per 100 K for per kelvin",
        "heat_response",
        "(frame_expansion - stage_expansion) * shape[:, _a]",
        "100 * (frame_expansion - stage_expansion) * shape[:, _a]",
        "test_a_warm_stage_moves_as_reciprocity_says",
    ),
    Mutation(
        "the gradient about a point 1 mm off the platform's centre",
        "free_displacement",
        "points[..., 0]",
        "points[..., 0] - 1.0",
        "test_free_fields_are_without_shear_and_grow_with_the_temperature",
    ),
    Mutation(
        "warm on the wrong side of the figure",
        "plot_drift",
        "(left + x, low + y)",
        "(left - x, low - y)",
        "test_a_gradient_has_an_arrow_to_where_it_is_warmer_and_clamped_edges_move",
    ),
    Mutation(
        "bars that grow by a gradient as their warmer end does",
        "misfits",
        "(x**2 + y**2) / 2",
        "x**2 + y**2",
        "test_loops_open_by_the_displacement_of_the_ground_in_a_warm_body",
    ),
    Mutation(
        "plane strain without 1 + nu",
        "in_plane",
        "own + designs.out_of_plane * (own - frame)",
        "own",
        "test_plane_strain_grows_more_in_the_plane_and_is_held_across",
    ),
    Mutation(
        "plane strain for plane stress",
        "lame",
        "1 - _a ** 2",
        "(1 + _a) * (1 - 2 * _a)",
        "test_timoshenko_goodier_cantilever",
    ),
    Mutation(
        "thickness forgotten",
        "element_matrices",
        "_a.thickness * _b",
        "_b",
        "test_macneal_harder_1985_curved_beam_is_not_the_printed_beam_value",
    ),
    Mutation(
        "rotation costs energy",
        "element_matrices",
        "_a.transpose(0, 1, 4, 3, 2)",
        "_a",
        "test_the_plane_has_three_rigid_body_motions",
    ),
    Mutation(
        "pushes that go with the body further out turn the wrong way",
        "_opening",
        "(-swing, chain.turn)",
        "(swing, chain.turn)",
        "test_exact_equilibrium_and_tangent_are_those_of_the_energy_in_closed_form",
    ),
    Mutation(
        "half of what internal forces add to the stiffness",
        "loaded",
        "inner -= _a",
        "inner -= 0.5 * (_a)",
        "test_exact_equilibrium_and_tangent_are_those_of_the_energy_in_closed_form",
    ),
    Mutation(
        "centre of the ball within the link",
        "pivot",
        "self.point - self.ball * self.direction",
        "self.point + self.ball * self.direction",
        "test_a_pair_turns_against_the_turn_of_its_link_by_hand",
    ),
    Mutation(
        "stiffness of a command without the preloads",
        "_strokes",
        "preloaded.stiffness(joints, drive, pushing.force, load)",
        "preloaded.stiffness(joints, drive, motion.force, load)",
        "test_the_stiffness_is_that_without_stacks_with_them_and_with_their_preloads",
    ),
    Mutation(
        "friction along the push",
        "across",
        "1j * self.direction",
        "self.direction",
        "test_forces_along_link_1_turn_its_hinge_by_half_its_width_by_hand",
    ),
    Mutation(
        "friction of the preloads alone",
        "_strokes",
        "friction.left_open(first.of, rubbing, drive, pushing.force)",
        "friction.left_open(first.of, rubbing, drive, drive.preload)",
        "test_no_friction_within_its_limits_moves_the_platform_further_and_some_does_as_far",
    ),
    Mutation(
        "stacks let go while their contacts rub",
        "left_open",
        "across[:3] - _a",
        "across[:3] - 0.0 * (_a)",
        "test_no_friction_within_its_limits_moves_the_platform_further_and_some_does_as_far",
    ),
    Mutation(
        "points of a turning link read as if it had moved",
        "_openings",
        "H[2, 2] += _a",
        "H[2, 2] += 0.0 * (_a)",
        "test_ten_newtons_in_the_base_hinges_by_both_witnesses",
    ),
    Mutation("shear stress twice as large", "stress_tensor", "mu * _a", "2 * mu * _a", "test_irons_patch_test"),
    Mutation(
        "straight triangles, middle nodes on chords",
        "curved",
        "middles[bent] = _a",
        "middles[bent] = middles[bent]",
        "test_roache_manufactured_solution_has_orders_three_and_two",
    ),
    Mutation(
        "moment arm of the hub with the wrong sign",
        "rigid_motion",
        "[_a, _b, -_c, _b, _a, _d]",
        "[_a, _b, _c, _b, _a, -_d]",
        "test_ground_rests_and_hub_moves_as_a_rigid_body",
    ),
    Mutation(
        "one chain unclamped",
        "joined",
        "not label.startswith(_a)",
        "not label.startswith(_a) and (chain < 2 or label != 'ground')",
        "test_ground_is_the_straight_back_of_three_pads",
    ),
    Mutation(
        "drawn notches turned by 90 degrees",
        "notch_side",
        "cmath.exp(1j * _a.heading)",
        "1j * cmath.exp(1j * _a.heading)",
        "test_narrowest_section_is_the_neck_across_its_axis_at_the_hinge_centre",
    ),
    Mutation(
        "hinge axes turned by 90 degrees in both models",
        "frames",
        "axis + np.where(_a, np.pi, 0.0)",
        "axis + np.pi / 2 + np.where(_a, np.pi, 0.0)",
        "test_default_necks_point_along_link_one_link_one_and_link_two",
    ),
    Mutation(
        "chains counted clockwise",
        "CHAIN_TURN",
        "CHAIN_TURN = _a",
        "CHAIN_TURN = -(_a)",
        "test_chains_are_chain_one_turned_by_120_degrees",
    ),
    Mutation(
        "1 per cent in hinge formula (2), seen by the finite elements",
        "rotation_paros_weisbord",
        "1.5 / _a",
        "1.515 / _a",
        "test_paros_weisbord_1965_notch_as_the_neck_grows_thin",
    ),
    Mutation(
        "1 per cent in hinge formula (2), seen by the beam integral",
        "rotation_paros_weisbord",
        "1.5 / _a",
        "1.515 / _a",
        "test_stated_freedoms_follow_the_beam_integrals",
    ),
    Mutation(
        "wrong dependent joints",
        "choose",
        "_a <= 1",
        "_a >= 1",
        "test_the_papers_independent_joints_are_taken_where_it_names_them",
    ),
    Mutation(
        "a sign in (16)",
        "stiffness",
        "dot(tau_p, _a) + dot(F_u, _b)",
        "dot(tau_p, _a) - dot(F_u, _b)",
        "test_loaded_stiffness_is_the_tangent_of_exact_equilibrium",
    ),
    Mutation(
        "commanded minus finite-element displacement",
        "compare",
        "_a - command",
        "command - _a",
        "test_error_is_finite_element_displacement_minus_commanded",
    ),
    Mutation(
        "a neck bent as if it were half as strong",
        "surface_stress",
        "6.0 * _a",
        "3.0 * _a",
        "test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation(
        "a pulled neck concentrates stress as a bent one",
        "surface_stress",
        "_a.tension",
        "_a.bending",
        "test_bending_and_tension_of_one_neck_are_those_of_finite_elements",
    ),
    Mutation("no safety factor in the mesh band", "SAFETY", "1.25", "1.0", "test_celik_2008_worked_example_of_table_1"),
    Mutation(
        "thick hinges softer instead of stiffer",
        "_split",
        "_a.percent(direction, _a.thick) - _b",
        "_b - _a.percent(direction, _a.thick)",
        "test_hinges_wide_out_of_plane_are_stiffer_by_up_to_nu_squared",
    ),
    Mutation(
        "the band of X for every command",
        "_split",
        "_a[axis].band",
        "_a[0].band",
        "test_the_band_and_the_amplitude_are_those_of_the_commanded_direction",
    ),
    Mutation(
        "share of the wrong error",
        "_axial_share",
        "100 * (without - _a) / without",
        "100 * (without - _a) / _a",
        "test_the_axial_share_is_of_the_error_without_the_axial_freedom",
    ),
    Mutation(
        "gain of compliance for loss of stiffness",
        "_softer",
        "1 - 1 / _a",
        "_a - 1",
        "test_the_loss_of_stiffness_is_of_the_models",
    ),
    Mutation(
        "cross errors of the direction for those of the command",
        "_row",
        "np.max(_a, axis=0)",
        "np.max(_a, axis=1)",
        "test_an_alternative_errs_along_its_commands_and_at_most_so_much_across_each",
    ),
    Mutation(
        "R/t upside down",
        "with_necks",
        "_a.radius / _b",
        "_a.radius * _b",
        "test_stubby_necks_are_a_third_of_their_radius_and_all_of_it",
    ),
    Mutation(
        "a mesh study of X alone",
        "converge",
        "_a[:, k, k]",
        "_a[:, 0, 0]",
        "test_each_direction_has_its_own_values_order_limit_and_band",
    ),
    Mutation(
        "a stage known without its platform's radius",
        "hash",
        "self.model_dump(exclude=_a)",
        "self.model_dump(exclude={**_a, 'platform': {'radius'}})",
        "test_every_key_of_a_stage_changes_its_hash_but_names_and_provenance",
    ),
    Mutation(
        "first-order and total Sobol indices swapped",
        "sobol_indices",
        "first, total = _a, _b",
        "total, first = _a, _b",
        "test_shares_are_by_factor_and_first_order_is_not_total",
    ),
    Mutation(
        "a thousandth in the axial compliance of the hinge chart",
        "compliance",
        "_a.axial * _b.axial",
        "1.001 * _a.axial * _b.axial",
        "test_calibrated_hinges_are_those_of_direct_finite_elements",
    ),
    Mutation(
        "a lever upside down in the error over the workspace",
        "missed",
        "[_a, _b, far]",
        "[_a, _b, 1 / far]",
        "test_the_box_is_searched_at_its_corners_edges_and_faces",
    ),
    Mutation(
        "a contact pushes the wrong way",
        "beyond_hinges",
        "Q[..., stack.chain, :push.body, :, j] += _a",
        "Q[..., stack.chain, :push.body, :, j] -= _a",
        "test_openings_and_poses_are_those_of_the_joints",
    ),
    Mutation(
        "the stacks of a pair swapped",
        "_drive",
        "1.0 - 2.0 * side",
        "2.0 * side - 1.0",
        "test_a_pair_is_commanded_about_the_middle_of_its_strokes",
    ),
    Mutation(
        "an arm in the frame of chain 1",
        "placed",
        "push.wrench @ chain_rotation(self.chain).T",
        "push.wrench",
        "test_the_contacts_of_the_other_chains_are_turned_with_them",
    ),
    Mutation(
        "a stroke for half a stroke",
        "_limits",
        "(-stroke / 2, stroke / 2)",
        "(-stroke, stroke)",
        "test_a_pair_is_commanded_about_the_middle_of_its_strokes",
    ),
    Mutation(
        "limits of the base hinges only",
        "limits_of_strokes",
        "np.eye(drive.lowest.shape[-1])",
        "np.diag(np.arange(drive.lowest.shape[-1]) % 2 == 0) * 1.0",
        "test_the_limits_of_every_stack_count",
    ),
    Mutation(
        "the whole stroke either way in studies",
        "_commands",
        "(-stroke / 2, stroke / 2)",
        "(-stroke, stroke)",
        "test_the_ranges_of_the_reference_stages_in_studies",
    ),
    Mutation(
        "studies of drives that only strokes of base hinges limit",
        "_along_axes",
        "limits_of(of, drive, np.zeros(3))",
        "limits_of(of, drive._replace(highest=drive.highest * [1, 9, 1, 9, 1, 9]), np.zeros(3))",
        "test_the_ranges_of_the_reference_stages_in_studies",
    ),
    Mutation(
        "contacts of studies on the other side of the link",
        "_contact",
        "middle + outward * width / 2",
        "middle - outward * width / 2",
        "test_the_drives_of_many_designs_are_those_of_each",
    ),
    Mutation(
        "contacts of studies that tilt the other way",
        "_contact",
        "-outward * np.exp(1j * tilt)",
        "-outward * np.exp(-1j * tilt)",
        "test_the_drives_of_many_designs_are_those_of_each",
    ),
    Mutation(
        "yield that no second look adds to the programs of studies",
        "_within_yield",
        "broken &= np.isfinite(value[todo])",
        "broken &= False",
        "test_every_design_is_as_one_stage_by_another_solver",
    ),
    Mutation(
        "necks of finite elements that carry what the body beyond does on the other side",
        "neck_wrenches",
        "4 * chain + hinge",
        "4 * chain + hinge + 1",
        "test_necks_of_finite_elements_carry_what_balances_and_what_the_model_says",
    ),
    Mutation(
        "frame and stage exchanged where finite elements of a study warm",
        "ask_elements",
        "(each.item() for each in in_plane(lower(stage)))",
        "(each.item() for each in in_plane(lower(stage))[::-1])",
        "test_finite_elements_drift_as_the_command_says_on_the_same_mesh",
    ),
    Mutation(
        "drives of finite elements that rest at no preload",
        "metal_answers",
        "getattr(drive, name)[None]",
        "0 * getattr(drive, name)[None] if name == 'preload' else getattr(drive, name)[None]",
        "test_finite_elements_drive_a_stage_as_by_another_solver",
    ),
    Mutation(
        "the error of the middle mesh taken for that of the finest",
        "_by_order",
        "n1 / n3 - n1 / n2",
        "n2 / n3 - 1",
        "test_a_band_by_corners_is_the_larger_error_of_two_differences_times_three",
    ),
    Mutation(
        "bands of highest stresses by the order of the platform",
        "stress_bands",
        "STRESS_ORDER",
        "4.0",
        "test_the_band_of_a_highest_stress_holds_it_where_the_finest_two_meshes_happen_to_agree",
    ),
    Mutation(
        "bands of drives in designs by the order of the platform",
        "OF_CORNERS",
        "{*DRIVE_RANGES, *ENGAGED, *DRIFTS, *GRADIENTS}",
        "{*DRIFTS, *GRADIENTS}",
        "test_bands_of_the_drive_are_by_the_corners_of_clamped_edges",
    ),
    Mutation(
        "lives beyond their law that no record of a design warns of",
        "_warnings",
        "doubts_of(loaded, last.values, last.columns)",
        "[]",
        "test_a_record_warns_of_a_life_beyond_the_cycles_of_its_law",
    ),
    Mutation(
        "amplitudes for more cycles than Basquin's law holds to, not doubted",
        "_of_amplitudes",
        "not low <= of.cycles <= high",
        "of.cycles < low",
        "test_an_amplitude_for_a_life_that_the_law_does_not_hold_to_is_said",
    ),
    Mutation(
        "a price of a design that bodies which overlap have stopped short of the optimum",
        "refined",
        "all(search.drawn.values())",
        "True",
        "test_a_price_where_what_can_be_drawn_ends_is_that_of_a_dense_grid",
    ),
    Mutation(
        "a multiplier of the wrong sign taken for an optimum",
        "_leaving",
        "np.where(W < 0, np.abs(multiplier), -multiplier)",
        "np.where(W < 0, np.abs(multiplier), multiplier)",
        "test_many_programs_answer_as_highs_does_one_by_one",
    ),
    Mutation(
        "poses beyond the contacts that strokes open",
        "limits_of_commands",
        "(strokes, contact, blocking, yields)",
        "(strokes, contact._replace(sizes=9 * contact.sizes), blocking, yields)",
        "test_what_is_inside_takes_less_than_all_and_what_is_beyond_more",
    ),
    Mutation(
        "strokes of one hinge only limit the poses",
        "limits_of_commands",
        "limits_of_strokes(drive)",
        "limits_of_strokes(drive._replace(highest=drive.highest * [1, 9, 1, 9, 1, 9]))",
        "test_ranges_of_the_reference_stages",
    ),
    Mutation(
        "necks that preloads of single stacks do not stress",
        "_yield_limits",
        "drive.preload - _a",
        "-_a",
        "test_preloads_of_single_stacks_stress_necks_and_those_of_pairs_do_not",
    ),
    Mutation(
        "a polytope enclosed by its first planes only",
        "_refined",
        "_a > EXACT",
        "_a > 0.1",
        "test_strokes_alone_reach_a_zonotope",
    ),
    Mutation(
        "rest of a loaded drive left out of its poses",
        "poses",
        "found.vertices * size / scale + rest",
        "found.vertices * size / scale",
        "test_an_own_stage_with_unlike_chains_single_stacks_and_a_load",
    ),
    Mutation(
        "the other directions held one to another's rest",
        "_range",
        "-rest[others] / size[others]",
        "rest[others] / size[others]",
        "test_an_own_stage_with_unlike_chains_single_stacks_and_a_load",
    ),
    Mutation(
        "the limits of the far end said of the near one",
        "_extent",
        "(-1.0, 1.0)",
        "(1.0, -1.0)",
        "test_ranges_of_the_reference_stages",
    ),
    Mutation(
        "the circle about the origin instead of rest",
        "_circle",
        "rest[:2] - start",
        "-start",
        "test_an_own_stage_with_unlike_chains_single_stacks_and_a_load",
    ),
    Mutation(
        "rotations of platform hinges imposed instead of elbow hinges",
        "turned_hinges",
        "(0, 1)",
        "(0, 2)",
        "test_rotations_are_those_of_least_energy_and_metal_takes_them_by_least_energy",
    ),
    Mutation(
        "hinges of chains and positions mixed up",
        "hinge_couples",
        "tuple(_couple(stage, chain, position) for position in positions for chain in CHAINS)",
        "tuple(_couple(stage, chain, position) for chain in CHAINS for position in positions)",
        "test_rotations_are_those_of_least_energy_and_metal_takes_them_by_least_energy",
    ),
    Mutation(
        "couples of a hinge in the same sense",
        "_couple",
        "-unit",
        "unit",
        "test_a_rotation_is_read_between_the_two_ends_of_a_notch",
    ),
    Mutation(
        "rotations read at the far ends of the links",
        "_station",
        "half if beyond else length - half",
        "length - half if beyond else half",
        "test_a_rotation_is_read_between_the_two_ends_of_a_notch",
    ),
    Mutation(
        "half the strokes and rotations imposed",
        "poses",
        "self.on(compliance).poses @ self.given",
        "0.5 * (self.on(compliance).poses @ self.given)",
        "test_errors_of_the_reference_stages_with_joints_commanded",
    ),
    Mutation(
        "rotations of mobility three imposed with the wrong sign",
        "_rotations",
        "C[3:, :3] @ inverse(_a)",
        "-C[3:, :3] @ inverse(_a)",
        "test_a_result_says_what_was_imposed",
    ),
    Mutation(
        "displacement without the command",
        "plot_displaced",
        "x + np.array(_a) * command.factor",
        "np.array(_a) * command.factor",
        "test_the_commanded_direction_may_show_displacement_over_command",
    ),
    Mutation(
        "a fixture's pole in parallel with the stage",
        "read_compliance",
        "read(of, seen(of, C)) / of.arm",
        "1 / (of.arm / read(of, seen(of, C) - of.pole - of.bar) + of.arm / np.maximum(read(of, of.pole), 1e-30))",
        "test_what_is_read_is_what_a_network_of_all_springs_says",
    ),
    Mutation(
        "the pole's offset on the other side",
        "wrench",
        "_a[0] * along[1] - _a[1] * along[0]",
        "_a[1] * along[0] - _a[0] * along[1]",
        "test_what_is_read_is_what_a_network_of_all_springs_says",
    ),
    Mutation(
        "a slope of displacement over force",
        "slope_of",
        "float(b[0] / b[1])",
        "float(b[1] / b[0])",
        "test_a_line_without_errors_has_its_slope_and_intercept",
    ),
    Mutation(
        "a normal quantile for Student's",
        "slope_of",
        "stats.t.ppf(_a, dof)",
        "stats.norm.ppf(_a)",
        "test_the_interval_of_five_readings_holds_the_slope_in_95_per_cent_of_seeds",
    ),
    Mutation(
        "readings with twice the stated noise",
        "_sensed",
        "sd * noise",
        "2 * sd * noise",
        "test_readings_scatter_by_the_stated_noise_and_step_by_the_stated_step",
    ),
    Mutation(
        "an identified neck offset of the other sign",
        "_stages",
        "designs.neck[:] += offsets[:, None, None]",
        "designs.neck[:] -= offsets[:, None, None]",
        "test_exact_slopes_give_the_offset_and_the_pole_they_were_made_with",
    ),
    Mutation(
        "a fixture that stiffens what it is in series with",
        "slopes",
        "np.exp(_a) + x[..., 1:] @ self.fixture.T",
        "np.exp(_a) - x[..., 1:] @ self.fixture.T",
        "test_exact_slopes_give_the_offset_and_the_pole_they_were_made_with",
    ),
    Mutation(
        "the scatter of one measured neck for that of nine",
        "_scattered",
        "np.random.default_rng(SEED).normal(size=(DRAWS, 3, 3))",
        "np.random.default_rng(SEED).normal(size=(DRAWS, 1, 1))",
        "test_the_scatter_is_that_of_the_nine_sensitivities",
    ),
    Mutation(
        "stacks of the other chains drawn as if chains turned clockwise",
        "stack_places",
        "1j * (chain - 1) * CHAIN_TURN",
        "1j * (1 - chain) * CHAIN_TURN",
        "test_the_record_says_where_every_stack_pushes",
    ),
    Mutation(
        "strokes drawn in mm",
        "plot_strokes",
        "um.factor * np.array(one.command)",
        "np.array(one.command)",
        "test_every_bar_of_the_strokes_is_the_stored_number_on_the_strokes_that_it_has",
    ),
    Mutation(
        "blocking forces written in the order of another drive",
        "plot_forces",
        "enumerate(blocking.tolist())",
        "enumerate(np.sort(blocking).tolist())",
        "test_every_bar_of_the_forces_is_the_stored_number_with_preload_and_blocking_force",
    ),
    Mutation(
        "the platform drawn turned the other way",
        "_draw_platform",
        "np.exp(1j * theta)",
        "np.exp(-1j * theta)",
        "test_the_platform_is_drawn_at_the_pose_times_the_stated_factor",
    ),
    Mutation(
        "forces drawn along the way to the contact",
        "_draw_forces",
        "ARROW * width * push * _a",
        "ARROW * width * contact * _a",
        "test_an_arrow_starts_at_every_contact_along_its_push_in_proportion_to_its_force",
    ),
    Mutation(
        "the moment of a load off the centre with the wrong sign",
        "off_centre",
        "[-OFFSET, OFFSET, 1.0]",
        "[OFFSET, -OFFSET, 1.0]",
        "test_a_load_off_the_centre_turns_and_a_pose_read_there_moves_with_the_rotation",
    ),
    Mutation(
        "a preload that stiffens where it presses",
        "preload_stiffness",
        "at.K_aa - dot(_a, _b)",
        "at.K_aa + dot(_a, _b)",
        "test_an_axial_force_in_the_base_necks_is_worth_what_the_energy_says",
    ),
    Mutation(
        "the stiffness of a stage on its own metal for the other's",
        "alternatives",
        "error_matrix(analyse(own, mobility).stiffness, metal[other], _a)",
        "error_matrix(analyse(own, mobility).stiffness, metal[own], _a)",
        "test_every_alternative_is_measured_with_its_own_model_on_its_own_stage",
    ),
    Mutation(
        "stages in which a claim fails counted as those in which it holds",
        "share_of",
        "holding / len(known)",
        "1 - holding / len(known)",
        "test_every_value_of_a_stage_counts_and_a_stage_without_values_counts_for_nothing",
    ),
    Mutation(
        "stages without a value in the denominator of a share",
        "share_of",
        "known = values[np.all(np.isfinite(values), axis=-1)]",
        "known = values",
        "test_every_value_of_a_stage_counts_and_a_stage_without_values_counts_for_nothing",
    ),
    Mutation(
        "thresholds of a verdict swapped",
        "ruling",
        "share.low >= MOST",
        "share.low >= 1 - MOST",
        "test_a_verdict_is_by_the_whole_interval",
    ),
    Mutation(
        "stages near a limit counted as holding at the low end of the interval",
        "share_of",
        "(-measure.slack, measure.slack)",
        "(measure.slack, -measure.slack)",
        "test_stages_nearer_to_a_limit_than_the_metal_is_known_widen_the_interval_only",
    ),
    Mutation(
        "an ensemble that ignores its seed",
        "drawn_values",
        "ensemble.seed",
        "2003",
        "test_a_seed_draws_the_same_values_and_another_seed_others",
    ),
    Mutation(
        "pairs that cannot be made kept among those judged",
        "populate",
        "Population(values[kept], _a, _b, _c, _d, _e)",
        "Population(values, _a, _b, _c, _d, _e)",
        "test_factors_go_to_the_stages_they_are_of_and_what_cannot_be_made_is_left_out_and_counted",
    ),
    Mutation(
        "mass counted twice",
        "mass_matrices",
        "areal * _a",
        "2 * areal * _a",
        "test_effective_masses_of_all_modes_and_what_the_ground_holds_are_the_whole_mass",
    ),
    Mutation(
        "density of kg/m^3 a million times too large",
        "DENSITY",
        "1e-12",
        "1e-6",
        "test_the_whole_stage_has_the_mass_of_its_drawn_area_hub_included",
    ),
    Mutation(
        "one third of the platform's mass",
        "mass_matrix",
        "bodies[..., PLATFORM, :].sum(axis=-2)",
        "bodies[..., 0, PLATFORM, :]",
        "test_bodies_that_move_have_the_drawn_mass_less_the_pads_and_the_payload_once",
    ),
    Mutation(
        "hub without mass",
        "carried",
        "inertia_of(_a, _b).matrix + _c",
        "_c",
        "test_a_meshed_stage_with_its_hub_has_the_drawn_mass",
    ),
    Mutation(
        "rad/s called Hz",
        "UNITS",
        "1 / (2 * math.pi)",
        "1.0",
        "test_a_payload_far_heavier_than_the_stage_is_a_mass_on_a_spring_in_hertz",
    ),
    Mutation(
        "moment of inertia of the payload ignored",
        "payload_matrix",
        "payload.inertia",
        "0.0",
        "test_a_payload_far_heavier_than_the_stage_is_a_mass_on_a_spring_in_hertz",
    ),
    Mutation(
        "motion out of the plane held like that in it",
        "antisymmetric",
        "self._replace(held=(), fixed=(0,))",
        "self._replace(held=(0,))",
        "test_frequencies_and_effective_masses_are_those_of_dense_matrices",
    ),
    Mutation(
        "half of the thickness counted once",
        "mirrored",
        "layered(bounds, _a, 2)",
        "layered(bounds, _a, 1)",
        "test_the_mass_is_that_of_the_drawn_stage_and_tilts_with_its_thickness",
    ),
    Mutation(
        "layers that are not graded",
        "mirrored",
        "thickness / 2 - surface * np.sinh(spaced)",
        "thickness / 2 * (1 - spaced / spaced[0])",
        "test_layers_are_thinner_towards_the_face",
    ),
    Mutation(
        "hub that tilts without inertia",
        "carried_out_of_plane",
        "hub.second / 2",
        "0.0",
        "test_out_of_the_plane_hub_and_payload_tilt_about_diameters",
    ),
    Mutation(
        "hub that tilts as if it were flat",
        "carried_out_of_plane",
        "hub.mass * stage.thickness ** 2 / 12",
        "0.0",
        "test_out_of_the_plane_hub_and_payload_tilt_about_diameters",
    ),
    Mutation(
        "hub that tilts the wrong way about x",
        "rigid_fields",
        "-layers.heights",
        "layers.heights",
        "test_frequencies_and_effective_masses_are_those_of_dense_matrices",
    ),
    Mutation(
        "mass of the hub counted in every sector",
        "solid_modes",
        "carried / 3",
        "carried",
        "test_one_sector_turned_vibrates_as_the_whole",
    ),
    Mutation(
        "harmonic that runs against the turn of the hub",
        "_tie",
        "(1.0, 1j)",
        "(1.0, -1j)",
        "test_one_sector_turned_vibrates_as_the_whole",
    ),
    Mutation(
        "band of the layers left out of that of a frequency",
        "_mode",
        "plane + thickness",
        "plane",
        "test_each_mode_has_its_bands_its_shares_and_its_frequency_in_plane_stress",
    ),
    Mutation(
        "modes out of the plane drawn as if odd",
        "through",
        "-1.0 if _a else 1.0",
        "1.0 if _a else -1.0",
        "test_from_face_to_face_a_mode_is_even_or_odd",
    ),
    Mutation(
        "free metal that bows the wrong way",
        "free_solid",
        "r[..., a, None] * r",
        "-r[..., a, None] * r",
        "test_free_metal_has_no_stress_however_its_temperature_changes",
    ),
    Mutation(
        "frame that moves the clamped faces backwards in three dimensions",
        "_imposed",
        "free_solid(mesh.nodes[ground], layers)",
        "-free_solid(mesh.nodes[ground], layers)",
        "test_a_free_strip_bows_by_its_expansion_through_the_thickness_and_along_y",
    ),
    Mutation(
        "compliance of a warm third taken for that of the whole",
        "_of_alike",
        "_under_unit_loads(equations, space, _a) / 3",
        "_under_unit_loads(equations, space, _a)",
        "test_one_third_warms_as_the_whole",
    ),
    Mutation(
        "metal's expansion beyond the frame's in three dimensions",
        "solid_drift",
        "frame - metal",
        "metal - frame",
        "test_a_symmetric_stage_drifts_as_the_plane_says_and_rises_with_a_gradient_through_it",
    ),
    Mutation(
        "free growth left out of the displacement in three dimensions",
        "field",
        "self.record.expansion * free + beyond",
        "beyond",
        "test_the_fields_carry_the_clamped_faces_with_the_frame_and_the_hub_with_metal_and_pose",
    ),
    Mutation(
        "safety factor left out of what layers move a pose by",
        "layer_bands",
        "SAFETY * _a",
        "1.0 * np.max(np.abs(many - few), axis=0)",
        "test_the_band_of_the_layers_is_the_largest_change_of_a_case",
    ),
    Mutation(
        "engaged stacks without stiffness",
        "with_stacks",
        "not np.any(rates)",
        "np.any(rates)",
        "test_stacks_add_their_stiffness",
    ),
    Mutation(
        "first moment of a body turned the other way",
        "_turned",
        "s * x + c * y",
        "c * y - s * x",
        "test_turning_a_chain_turns_its_first_moments",
    ),
    Mutation(
        "another solver's hub a ring",
        "disc",
        "self.hub_radius**2 / 2",
        "self.hub_radius**2",
        "test_the_disc_of_the_other_solver_has_its_own_mass_and_inertia",
    ),
    Mutation(
        "another solver's frequencies in rad/s",
        "printed_frequencies",
        "[float(hertz) for _, hertz in ROW.findall(table)]",
        "[float(hertz) ** 0.5 for hertz, _ in ROW.findall(table)]",
        "test_frequencies_are_read_in_hertz_from_the_first_table",
    ),
    Mutation(
        "the nearest frequency of two solvers compared for the farthest",
        "apart",
        "np.max(_a)",
        "np.min(_a)",
        "test_one_frequency_too_far_off_fails",
    ),
    Mutation(
        "another solver's hub without mass",
        "lowest_of_ngsolve",
        "motions.T @ forces + carried @ q[-3:]",
        "motions.T @ forces",
        "test_ngsolve_agrees",
    ),
    Mutation(
        "the drawn hub weighed twice",
        "drawn_hub",
        "of._replace(mesh=drawn, carried=np.zeros((3, 3)))",
        "of._replace(mesh=drawn)",
        "test_a_drawn_hub_weighs_what_the_disc_does_and_follows_the_pose",
    ),
    Mutation(
        "lengths of a drawing written beside other links",
        "dimensions_of",
        "ends[k + 1]",
        "ends[k]",
        "test_every_dimension_is_on_the_drawing_and_within_it",
    ),
    Mutation(
        "a radius drawn that its file does not give",
        "given",
        "not set(keys) & set(self.missing)",
        "True",
        "test_an_unfinished_stage_is_drawn_as_far_as_it_goes",
    ),
    Mutation(
        "a hub of another solver that turns against ours about y",
        "hub_motions",
        "(z, zero, -x)",
        "(z, zero, x)",
        "test_hub_and_disc_of_the_other_solvers_move_and_weigh_as_ours",
    ),
    Mutation(
        "a disc of another solver without its thickness",
        "tilting_disc",
        "3 * of.hub_radius**2 + of.plate.thickness**2",
        "3 * of.hub_radius**2",
        "test_hub_and_disc_of_the_other_solvers_move_and_weigh_as_ours",
    ),
    Mutation(
        "the band of a frequency by the observed order",
        "frequency_convergence",
        "max(CAUTIOUS / (ratio**order - 1), _a)",
        "CAUTIOUS / (ratio**order - 1)",
        "test_bands_hold_frequencies_whose_order_falls_to_one",
    ),
    Mutation(
        "the band of a frequency by the small safety factor",
        "frequency_convergence",
        "max(_a, SAFETY / (ratio - 1))",
        "SAFETY / (ratio - 1)",
        "test_an_order_that_is_not_the_theoretical_one_widens_the_band",
    ),
    Mutation(
        "round-off called a natural frequency",
        "frequencies",
        "np.arange(FREEDOMS) >= self.rank",
        "np.arange(FREEDOMS) >= FREEDOMS",
        "test_a_freedom_that_hinges_do_not_have_has_no_frequency_of_round_off",
    ),
    Mutation(
        "accuracy of analytic frequencies said of three modes only",
        "natural_modes",
        "count > RIGID_MODES",
        "count <= RIGID_MODES",
        "test_it_is_said_with_the_fourth_mode_and_not_before",
    ),
    Mutation(
        "path of the wire inside the metal",
        "cut_path",
        "_beside(part.outer, half)",
        "_beside(part.outer, -half)",
        "test_the_path_of_the_wire_leaves_every_neck",
    ),
    Mutation(
        "wire beside the contour by its whole kerf",
        "cut_path",
        "half = kerf / 2",
        "half = kerf",
        "test_the_path_of_the_wire_leaves_every_neck",
    ),
    Mutation(
        "arcs of a DXF walked clockwise",
        "_add_segment",
        "segment.turn > 0",
        "segment.turn < 0",
        "test_a_dxf_has_the_metal_as_one_closed_contour",
    ),
    Mutation(
        "drawing in inches",
        "MILLIMETRE",
        "MILLIMETRE = 4",
        "MILLIMETRE = 1",
        "test_a_dxf_is_in_millimetres_on_its_layers_and_without_errors",
    ),
    Mutation(
        "arcs of an SVG bent the other way",
        "_path",
        "int(segment.turn < 0)",
        "int(segment.turn > 0)",
        "test_an_svg_is_in_millimetres_with_true_arcs",
    ),
    Mutation(
        "mounting holes of twice the diameter",
        "part_of",
        "mounting / 2",
        "mounting",
        "test_a_dxf_has_the_pads_with_a_hole_in_the_middle_of_each",
    ),
    Mutation(
        "notes of a drawing silent on assumed numbers",
        "notes_of",
        "('ASSUMED', stage.assumed)",
        "('ASSUMED', ())",
        "test_alike_chains_are_labelled_once_and_assumed_numbers_said",
    ),
    Mutation(
        "centres of the arcs written beside the solid",
        "write_extruded",
        "tag not in of_solid",
        "False",
        "test_a_step_is_one_solid_in_millimetres_with_cylinders",
    ),
    Mutation(
        "solid in other units kept",
        "write_step",
        "abs(found[0] / volume - 1) > SAME",
        "False",
        "test_a_solid_of_another_volume_is_refused",
    ),
    Mutation(
        "a design on a page drawn as its mirror image",
        "_rounded",
        "round(-PARTS * z.imag)",
        "round(PARTS * z.imag)",
        "test_the_drawn_outline_of_a_design_is_that_of_the_stage_with_its_factors",
    ),
    Mutation(
        "designs of a front shown by their places among all",
        "of_front",
        "_counting(source)[found.front.places]",
        "found.front.places",
        "test_a_front_shows_its_designs_though_others_have_no_answer_or_break_a_constraint",
    ),
]


def parsed(code: str) -> ast.AST:
    """An expression or a statement."""
    (node,) = ast.parse(code).body
    return node.value if isinstance(node, ast.Expr) else node


def matches(pattern: Any, node: Any, found: dict[str, ast.AST]) -> bool:
    """Whether source is as a pattern says; what its names `_a` stand for goes into `found`."""
    if isinstance(pattern, ast.Name) and re.fullmatch("_[a-z]", pattern.id) and isinstance(node, ast.expr):
        known = found.setdefault(pattern.id, node)
        return known is node or ast.dump(known) == ast.dump(node)
    if isinstance(pattern, ast.AST):
        names = [name for name in pattern._fields if name not in ("ctx", "type_comment", "kind")]
        same = type(pattern) is type(node)
        return same and all(matches(getattr(pattern, name), getattr(node, name), found) for name in names)
    if isinstance(pattern, list):
        pairs = zip(pattern, node, strict=False)
        return len(pattern) == len(node) and all(matches(one, other, found) for one, other in pairs)
    return type(pattern) is type(node) and bool(pattern == node)


class Replacing(ast.NodeTransformer):
    """Puts nodes in the place of others, by identity or by name."""

    def __init__(self, of: Callable[[ast.AST], ast.AST | None]) -> None:
        self.of = of

    def visit(self, node: ast.AST) -> ast.AST:
        return self.of(node) or self.generic_visit(node)


@cache
def trees() -> dict[Path, ast.Module]:
    return {path: syntax_of(path) for path in sorted((ROOT / "flexfem").rglob("*.py"))}


@cache
def scopes() -> dict[str, list[tuple[Path, ast.AST]]]:
    """Functions, and statements that give a name of a module its value, by name."""
    found = defaultdict[str, list[tuple[Path, ast.AST]]](list)
    for path, tree in trees().items():
        for node in (each for each in nodes_of(path) if isinstance(each, ast.FunctionDef)):
            found[node.name].append((path, node))
        for node in (each for each in tree.body if isinstance(each, ast.Assign)):
            for each in (part for target in node.targets for part in ast.walk(target) if isinstance(part, ast.Name)):
                found[each.id].append((path, node))
    return found


class Place(NamedTuple):
    """Where an error can be made, and what the names of its pattern stand for there."""

    path: Path
    node: ast.AST
    found: dict[str, ast.AST]


def places(mutation: Mutation) -> list[Place]:
    """Where the error could be made; it is made when that is one place."""
    pattern, made = parsed(mutation.old), []
    for path, scope in scopes()[mutation.where]:
        for node in ast.walk(scope):
            found: dict[str, ast.AST] = {}
            if matches(pattern, node, found):
                made.append(Place(path, node, found))
    return made


def error_at(mutation: Mutation, place: Place) -> ast.AST:
    """What is put in the place."""
    made: ast.AST = Replacing(lambda node: place.found.get(getattr(node, "id", ""))).visit(parsed(mutation.new))
    return made


def spoiled(mutation: Mutation, place: Place) -> str:
    """The source with the error in it."""
    memo: dict[int, Any] = {}
    tree, new = deepcopy(trees()[place.path], memo), error_at(mutation, place)
    return ast.unparse(Replacing(lambda node: new if node is memo[id(place.node)] else None).visit(tree))


@cache
def texts() -> dict[str, str]:
    return {path.relative_to(ROOT).as_posix(): path.read_text() for path in (ROOT / "tests").rglob("test_*.py")}


def file_of(test: str) -> str:
    """The file of a test, which is the only one of its name."""
    (found,) = [name for name, text in texts().items() if f"def {test}(" in text]
    return found


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """What the tests need of the project, somewhere else."""
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__", ".*"))
        else:
            shutil.copy(ROOT / part, tmp_path / part)
    (tmp_path / "imported_from_the_copy.py").write_text(GUARD)
    return tmp_path


def run(copy: Path, *tests: str) -> subprocess.CompletedProcess[str]:
    """Run tests of the copy on the package of the copy."""
    named = [f"{file_of(test)}::{test}" for test in tests]
    command = [sys.executable, "-m", "pytest", "-p", "imported_from_the_copy", "-p", "no:cacheprovider", "-x", *named]
    environment = {**os.environ, "PYTHONPATH": str(copy), "FLEXFEM_COPY": str(copy)}
    for name in [name for name in environment if name.startswith("PYTEST_")]:
        del environment[name]
    return subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=TIME_LIMIT * len(tests), check=False
    )


def test_every_error_can_be_made_and_its_test_exists() -> None:
    for mutation in MUTATIONS:
        made = places(mutation)
        assert len(made) == 1, (mutation.error, made)
        assert ast.dump(error_at(mutation, made[0])) != ast.dump(made[0].node)
        assert file_of(mutation.test)


def test_an_error_is_found_however_it_is_laid_out_and_only_where_it_is() -> None:
    """As is a tree of another layout, with other names where any will do."""
    written = parsed("x = [one * two( # why\n  3.0), -y]")
    for pattern, expected in {
        "x = _a": 1, "_a * two(3.0)": 1, "[_a, -_b]": 1, "_a * two(3)": 0, "_a * _a": 0, "[_a, _b, _c]": 0, "_a(3.0)": 1
    }.items():  # fmt: skip
        assert sum(matches(parsed(pattern), node, {}) for node in ast.walk(written)) == expected, pattern
    found: dict[str, ast.AST] = {}
    assert matches(parsed("[_a * _b, _c]"), written.value, found)  # type: ignore[attr-defined]
    assert {name: ast.unparse(node) for name, node in found.items()} == {"_a": "one", "_b": "two(3.0)", "_c": "-y"}


def test_the_pages_count_the_errors() -> None:
    assert len({mutation.error for mutation in MUTATIONS}) == len(MUTATIONS)
    assert f"{len(MUTATIONS)} deliberate errors" in (ROOT / "docs/trust.md").read_text()


@pytest.mark.slow
def test_every_named_test_passes_on_an_unspoiled_copy(copy: Path) -> None:
    done = run(copy, *dict.fromkeys(mutation.test for mutation in MUTATIONS))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.error)
def test_a_deliberate_error_is_caught_by_its_test(mutation: Mutation, copy: Path) -> None:
    (place,) = places(mutation)
    (copy / place.path.relative_to(ROOT)).write_text(spoiled(mutation, place))
    done = run(copy, mutation.test)
    assert done.returncode == FAILED, done.stdout + done.stderr


@pytest.mark.slow
def test_a_run_on_the_installed_package_would_be_noticed(copy: Path) -> None:
    shutil.rmtree(copy / "flexfem")
    done = run(copy, MUTATIONS[0].test)
    assert done.returncode not in (0, FAILED)
