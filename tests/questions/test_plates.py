"""Mechanisms in three dimensions: leaf springs between plane stress and plane strain, and what the
bands cover.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexfem
from flexfem.mechanism.mechanism_file import MechanismFile
from flexfem.questions import plates
from flexfem.questions.large import Large
from flexfem.questions.life import Life
from flexfem.questions.setup import Mesh, answer
from flexfem.refused import BadInput, ComputationFailed

from ..conftest import ROOT

LEAF = {
    "between": ["ground", "stage"],
    "direction_deg": 90,
    "shape": "leaf",
    "length_mm": 17,
    "neck_mm": 0.4,
}
GUIDE = {
    "name": "guide",
    "thickness_mm": 10,
    "material": {
        "name": "aluminium",
        "youngs_modulus_gpa": 72,
        "poissons_ratio": 0.33,
        "density_kg_m3": 2810,
        "yield_strength_mpa": 500,
    },
    "body": [
        {"name": "ground", "fixed": True, "outline_mm": [[-20, -8], [20, -8], [20, 0], [-20, 0]]},
        {"name": "stage", "outline_mm": [[-20, 17], [20, 17], [20, 29], [-20, 29]]},
    ],
    "hinge": [
        {"name": name, "at_mm": [x, 8.5], "fillet_mm": 0.5, **LEAF}
        for name, x in (("a", -15), ("b", 15))
    ],
    "output": {"body": "stage", "at_mm": [0, 23]},
}


@pytest.mark.slow
def test_wide_leaves_lie_between_plane_stress_and_plane_strain_and_bands_cover_finer_meshes():
    """A wide clamped leaf cannot bend across its width: plane strain is the limit of its stiffness,
    1 / (1 - nu^2).
    """
    guide = MechanismFile.model_validate(GUIDE)
    found = flexfem.stiffness(guide, models="elements", solid=True)
    plane, solid = found.values["free"]
    assert 1.06 < solid[0] / plane[0] < 1 / (1 - 0.33**2)
    band = found.bands["free"][1]
    finer = 1 / np.diag(plates.solved(guide, 6, 5).compliance)[:3]
    assert np.all(np.abs(solid - finer) < band)
    assert np.all(band < 0.005 * solid)
    found = flexfem.budget(guide)
    shares = dict(zip(found.axes["share"], found.values["share"][:, 0], strict=True))
    total = shares.pop("total in three dimensions")
    analytic = flexfem.stiffness(guide, models="analytic", no_limits=True).values["free"][0, 0]
    assert total == pytest.approx(100 * (analytic / solid[0] - 1), abs=0.3)
    assert total == pytest.approx(sum(shares.values()), rel=1e-9)
    assert abs(shares["thickness"]) < 0.5  # of the 8 % that plane stress leaves out


def test_one_quadratic_triangle_across_the_middle_of_a_leaf_is_enough():
    guide = MechanismFile.model_validate(GUIDE)
    coarse, fine = (np.diag(plates.elements(guide, level).compliance)[:3] for level in (4, 10))
    np.testing.assert_allclose(coarse, fine, rtol=4e-4)


@pytest.mark.slow
def test_bands_of_the_stiffness_with_the_other_directions_free_contain_that_of_a_much_finer_mesh():
    mechanism = flexfem.load(ROOT / "geometry" / "parallelogram.toml")
    usual, fine = (flexfem.stiffness(mechanism, models="elements", resolution=n) for n in (4, 10))
    assert np.all(np.abs(fine.values["free"] - usual.values["free"]) <= usual.bands["free"])


def test_a_quarter_ring_without_hinges_has_the_compliance_of_a_curved_beam():
    """R^3 / EI times 3 pi / 4 - 2 along the first end and pi / 4 across it, for a force at the
    other end.
    """
    arc = {
        "name": "arc",
        "path_mm": [[40, 0], [40, 40, 39.999], [0, 40]],
        "width_mm": 1,
        "clamped_edges": [1],
    }
    output = {"body": "arc", "at_mm": [0, 40], "contact_mm": 0.6}
    ring = MechanismFile.model_validate({**GUIDE, "body": [arc], "hinge": [], "output": output})
    found = flexfem.stiffness(ring, models="elements", resolution=4, force=(1, 0, 0))
    bending = 40**3 / (72_000 * 10 / 12)
    expected = 1 / (bending * np.array([3 * np.pi / 4 - 2, np.pi / 4]))
    np.testing.assert_allclose(found.values["free"][0, :2], expected, rtol=2e-3)


def test_bodies_more_compliant_than_hinges_are_named():
    """A stage as thin as its leaves."""
    bodies = [
        GUIDE["body"][0],
        {"name": "stage", "path_mm": [[-17, 17.5], [17, 17.5]], "width_mm": 1},
    ]
    found = flexfem.stiffness(
        MechanismFile.model_validate(GUIDE | {"body": bodies, "model": "plane_stress"})
    )
    assert "in y, theta, bodies are more compliant than hinges" in [
        text.partition(":")[0] for text in found.warnings
    ]


def test_a_hinge_with_too_many_triangles_is_refused_before_it_is_meshed():
    """With eight triangles across the necks by `check`, with more by the question."""
    plane = GUIDE | {"model": "plane_stress"}
    thin, thinnest = ([one | {"neck_mm": neck} for one in GUIDE["hinge"]] for neck in (0.01, 1e-5))
    with pytest.raises(
        ComputationFailed, match=r"^a needs about .* triangles, expected at most 1e\+06"
    ):
        flexfem.stiffness(
            MechanismFile.model_validate(plane | {"hinge": thin}), models="elements", resolution=64
        )
    with pytest.raises(
        BadInput, match=r"finite elements need about .* for a, 1e-05 mm wide, expected"
    ):
        flexfem.check(MechanismFile.model_validate(GUIDE | {"hinge": thinnest}))


@pytest.mark.slow
@pytest.mark.parametrize("question", ["stiffness", "drift"])
def test_bands_of_hinge_stresses_contain_those_of_a_much_finer_mesh(question):
    """Small fillets, where coarse meshes agreed by chance, and ends on rigid ground, where the
    stress is singular.
    """
    other = {"fillet_mm": 0.3, "neck_mm": 0.9, "length_mm": 15}
    hinges = [one | other | {"at_mm": [one["at_mm"][0], 7.5]} for one in GUIDE["hinge"]]
    bodies = [
        GUIDE["body"][0],
        {"name": "stage", "outline_mm": [[-20, 15], [20, 15], [20, 29], [-20, 29]]},
    ]
    expansions = {
        "material": GUIDE["material"] | {"expansion_um_per_m_k": 23},
        "frame": {"expansion_um_per_m_k": 11},
    }
    plane = {
        "body": bodies,
        "hinge": hinges,
        "model": "plane_stress",
    }  # the bands of the meshes alone
    guide = MechanismFile.model_validate(GUIDE | plane | expansions)
    usual, fine = (
        getattr(flexfem, question)(guide, models="elements", resolution=n) for n in (8, 24)
    )
    change = np.abs(fine.values["stress"] - usual.values["stress"])
    assert np.all(change <= usual.bands["stress"])
    assert np.all(
        usual.bands["stress"] <= 0.5 * np.max(usual.values["stress"])
    )  # 0.42: the band says something


@pytest.mark.slow
def test_a_mass_on_a_bar_vibrates_out_of_the_plane_with_the_stiffness_of_a_timoshenko_cantilever():
    """A bar 2 mm wide and 4 mm thick, 40 mm long, and 1 kg at 3 mm from its end; the lowest mode is
    in the plane.
    """
    bar = GUIDE | {
        "thickness_mm": 4,
        "payload": {"mass_g": 1000},
        "output": {"body": "stage", "at_mm": [0, 43]},
    }
    bar["body"] = [
        GUIDE["body"][0],
        {"name": "stage", "outline_mm": [[-5, 40], [5, 40], [5, 46], [-5, 46]]},
    ]
    bar["hinge"] = [
        {"name": "bar", "at_mm": [0, 20], "fillet_mm": 0} | LEAF | {"length_mm": 40, "neck_mm": 2}
    ]
    found = flexfem.modes(MechanismFile.model_validate(bar), count=2, solid=True)
    assert found.axes["mode"] == ("1 in the plane", "2 out of the plane")
    E = 72000
    G = 72000 / 2.66
    compliance = (43**3 - 3**3) / (3 * E * 2 * 4**3 / 12) + 1.2 * 40 / (G * 8)
    expected = np.sqrt(1 / (compliance * 1.0e-3)) / (2 * np.pi)
    assert found.values["frequency"][1, -1] == pytest.approx(expected, rel=0.015)
    assert np.isnan(found.values["frequency"][1, 0])
    turn = (
        23 * ((43**2 - 3**2) / 2) / ((43**3 - 3**3) / 3)
    )  # of the end, times 23 mm to the hinge, per deflection
    assert found.values["tilt"][1, 1] == pytest.approx(100 * turn**2 / (1 + turn**2), abs=1)


def test_a_summary_has_the_key_numbers_of_a_guide_and_of_an_amplifier():
    """Leaves: `24 E I / L^3`, and its frequency with the stage and 13/35 of the leaves; lever: five
    times the input.
    """
    leaf = LEAF | {"length_mm": 40}
    bodies = [
        GUIDE["body"][0],
        {"name": "stage", "outline_mm": [[-20, 40], [20, 40], [20, 52], [-20, 52]]},
    ]
    hinges = [{"name": name, "at_mm": [x, 20], **leaf} for name, x in (("a", -15), ("b", 15))]
    content = GUIDE | {
        "body": bodies,
        "hinge": hinges,
        "output": {"body": "stage", "at_mm": [0, 46]},
    }
    found = flexfem.summary(MechanismFile.model_validate(content), models="analytic", plane=True)
    stiffness = 2 * 72e3 * 10 * 0.4**3 / 40**3
    mass = 2.81e-9 * 10 * (40 * 12 + 2 * 40 * 0.4 * 13 / 35)
    assert found.at("free", direction="x")[0] == pytest.approx(stiffness, rel=2e-3)
    assert found.frequency[0] == pytest.approx(np.sqrt(stiffness / mass) / (2 * np.pi), rel=2e-3)
    bending = 3 * 72e3 * 0.4 / 40**2  # E t 6 / 2 / L^2: stress at the root per displacement
    assert found.at("yield_range", direction="x")[0] == pytest.approx(500 / bending, rel=0.01)
    assert not {"amplification", "held_low", "free_low"} & found.values.keys()
    for x, expected in ((0.9 * 500 / bending, 0), (1.1 * 500 / bending, 1)):  # mm, others held
        loaded = flexfem.stiffness(
            MechanismFile.model_validate(content), displacement=(x, 0, 0), models="analytic"
        )
        assert sum("beyond the yield strength" in text for text in loaded.warnings) == expected
    lever = flexfem.summary(flexfem.load("geometry/lever-amplifier.toml"), models="analytic")
    amplification = lever.at("amplification", direction="y")[0]
    inside = lever.input_stiffness[0]
    assert amplification == pytest.approx(5, rel=0.03)
    reached = (
        0.0174 * amplification / (1 + inside / 53.735632)
    )  # the rest of the stroke is lost in the stack
    assert lever.at("free_high", direction="y") == pytest.approx(reached, rel=1e-6)
    assert lever.at("free_low", direction="y") == 0
    assert any(table.caption.startswith("output motion per") for table in lever.tables())


def test_a_summary_explains_the_range_of_a_drive_only_where_there_is_one():
    guide = flexfem.load(ROOT / "geometry/parallelogram.toml")
    for mechanism, count in ((guide, 1), (guide.replace(actuator=[]), 0)):
        found = flexfem.summary(mechanism, models="analytic")
        assert sum(text.startswith("range of the drive (") for text in found.sentences()) == count


def test_a_bar_sags_in_its_plane_and_out_of_it_as_a_timoshenko_cantilever():
    """By integration: mean sag q L^4 / (20 E I) + q L^2 / (3 k G A) and mean slope 2 q L^3 / (15 E
    I) for a weight q.

    The payload acts on the whole bar, so that one of twice its mass of 1.08 g triples q.
    """
    material = {
        "name": "x",
        "youngs_modulus": 70e3,
        "poissons_ratio": 0.3,
        "density": 2700.0,
        "yield_strength": 300.0,
    }
    bar = MechanismFile(
        name="bar",
        thickness=2.0,
        material=material,
        output={"body": "bar", "at": [40, 0]},
        payload={"mass": 2.16e-6},
        body=[{"name": "bar", "path": [[0, 0], [80, 0]], "width": 2.5, "clamped_edges": [1]}],
    )
    found = flexfem.gravity(bar, models="elements", solid=True)
    for pose in found.pose[:, 0]:
        assert pose == pytest.approx([0.0, -4.4696e-3, -148.74e-6], rel=6e-3, abs=1e-8)
    assert found.at("sag", model="three dimensions") == pytest.approx(
        [-6.9796e-3, 0.0, 232.40e-6], rel=6e-3, abs=1e-7
    )
    assert found.band("sag", model="three dimensions")[0] < 3e-5
    with pytest.raises(flexfem.BadInput, match="which the analytic models need"):
        flexfem.gravity(bar, models="analytic")


@pytest.mark.slow
def test_modes_of_a_stage_with_four_equal_chains_move_it_along_x_then_y_or_not_at_all():
    """Symmetry makes the translations equal, and in modes 4 and 5 opposite chains move against each
    other.
    """
    found = flexfem.modes(
        flexfem.load("geometry/four-chains.toml"), models="elements", resolution=4
    )
    assert found.frequency[1, 0] == pytest.approx(found.frequency[0, 0], rel=1e-5)
    assert found.share[:3] == pytest.approx(100 * np.eye(3), abs=1e-6)
    assert np.isnan(found.share[3]).all() and found.share[5].sum() == pytest.approx(100)


def test_check_names_the_shape_that_the_file_states():
    """A leaf with root fillets and a filleted hinge have one profile; the file names the second one
    otherwise.
    """
    hinges = [{**GUIDE["hinge"][0], "shape": "filleted"}, GUIDE["hinge"][1]]
    found = flexfem.check(MechanismFile.model_validate({**GUIDE, "hinge": hinges}))
    assert [hinge.shape for hinge in found.hinges] == ["filleted", "leaf"]


def test_check_names_clamped_edges_by_the_numbers_of_the_file_also_of_copies():
    """Edge 4 of an outline of four corners goes from the last one to the first; a mirror image
    keeps the numbers.
    """
    outline = [[-20, -8], [20, -8], [20, 0], [-20, 0]]
    bodies = [
        {"name": "foot", "outline_mm": outline, "clamped_edges": [4]},
        {
            "name": "head",
            "outline_mm": [[x, y + 45] for x, y in outline[:3]] + [[-20, 45, 2]],
            "clamped_edges": [2, 1],
        },
        GUIDE["body"][1],
    ]
    hinge = GUIDE["hinge"][0] | {"between": ["foot", "stage"]}
    copied = [{"parts": ["foot", "a"], "mirror_mm": [[0, 23], [1, 23]]}]
    content = GUIDE | {"body": bodies[::2], "hinge": [hinge], "copy": copied}
    held = [body.held for body in flexfem.check(MechanismFile.model_validate(content)).bodies]
    assert held == ["clamped at edge 4", "", "clamped at edge 4"]
    two = {
        "body": bodies[1:],
        "hinge": [{**GUIDE["hinge"][0], "at_mm": [0, 33], "between": ["stage", "head"]}],
    }
    two["hinge"][0] |= {"length_mm": 8}
    held = [body.held for body in flexfem.check(MechanismFile.model_validate(GUIDE | two)).bodies]
    assert held == ["clamped at edges 1, 2", ""]


@pytest.mark.parametrize(("kind", "name", "shape"), [(Large, "strain", 4), (Life, "peak", (1, 2))])
def test_a_largest_strain_or_stress_at_sharp_roots_is_printed_with_the_warning_that_it_is_singular(
    kind, name, shape
):
    sharp = MechanismFile.model_validate(
        GUIDE | {"hinge": [one | {"fillet_mm": 0} for one in GUIDE["hinge"]]}
    )
    values = {name: np.ones(shape)}
    for plate, mesh, warned in (
        (sharp, Mesh(4, 0), 1),
        (sharp, None, 0),
        (MechanismFile.model_validate(GUIDE), Mesh(4, 0), 0),
    ):
        found = answer(kind, plate, {}, mesh, {}, values, {"model": ["any"]})
        assert (
            sum("hinges with sharp inner corners (a, b)" in text for text in found.warnings)
            == warned
        )


@pytest.mark.slow
def test_plane_is_plane_stress_but_not_where_the_file_says_plane_strain():
    guide = MechanismFile.model_validate(GUIDE)
    strain = guide.replace(model="plane_strain")
    options = {"models": "elements", "resolution": 4}
    sheet, held = (flexfem.stiffness(one, plane=True, **options) for one in (guide, strain))
    thick = flexfem.stiffness(guide, **options)
    assert sheet.axes["model"] == held.axes["model"] == ("finite elements",)
    assert thick.axes["model"] == ("three dimensions",)
    soft, between, hard = (
        float(found.at("free", direction="x")[0]) for found in (sheet, thick, held)
    )
    assert soft < between < hard
    with pytest.raises(BadInput, match=r"^plane with solid, expected one of the two$"):
        flexfem.stiffness(guide, plane=True, solid=True)


def test_the_drift_of_a_thick_mechanism_has_a_band_for_its_thickness():
    """Three variants of the thickness and the poses themselves; the stage on leaves of unlike
    expansion moves in y.
    """
    expansions = {
        "material": GUIDE["material"] | {"expansion_um_per_m_k": 23},
        "frame": {"expansion_um_per_m_k": 11},
    }
    guide = MechanismFile.model_validate(GUIDE | expansions)
    thick, sheet = (
        flexfem.drift(guide, models="elements", resolution=4, plane=plane)
        for plane in (False, True)
    )
    assert thick.axes["model"] == ("three dimensions",)
    place = {"case": "uniform", "direction": "y", "point": "output"}
    value, plane = (float(found.at("pose", **place)[0]) for found in (thick, sheet))
    assert value == pytest.approx(plane, rel=2e-2) and value != plane
    assert float(thick.band("pose", **place)[0]) > float(sheet.band("pose", **place)[0])
