"""The deck says what the mesh is, in fields that CalculiX can read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexfem.fem.export import write_deck
from flexfem.refused import BadInput

FIELD = 20  # characters that CalculiX reads of a field
WRITTEN = 1e-11  # of coordinates up to 70 mm: twelve digits


@pytest.fixture(scope="module")
def blocks(six, tmp_path_factory) -> list[tuple[str, np.ndarray]]:
    """Keyword lines of the deck, each with the numbers that follow it."""
    path = tmp_path_factory.mktemp("deck") / "stage.inp"
    write_deck(six.mesh, six.plate, path, np.array([[2.5, -1.5, 40.0], [0.0, 0.0, 1.0]]), thickness=0.37)
    found: list[tuple[str, list[float]]] = []
    for line in path.read_text().splitlines():
        fields = [field.strip() for field in line.split(",")]
        assert all(len(field) <= FIELD for field in fields) or line.startswith("*") or "flexfem" in line
        if line.startswith("*"):
            found.append((line, []))
        elif fields[0] in ("ground", "hub"):
            found[-1][1].extend(map(float, fields[1:]))
        elif fields[0].lstrip("-")[:1].isdigit():
            found[-1][1].extend(float(field) for field in fields if field)
    return [(title, np.array(numbers)) for title, numbers in found]


def only(blocks: list[tuple[str, np.ndarray]], start: str) -> np.ndarray:
    (numbers,) = [numbers for title, numbers in blocks if title.startswith(start)]
    return numbers


def test_nodes_and_triangles_are_those_of_the_mesh(six, blocks) -> None:
    nodes = only(blocks, "*NODE, NSET=all").reshape(-1, 4)
    np.testing.assert_array_equal(nodes[:, 0], np.arange(1, len(six.mesh.nodes) + 1))
    np.testing.assert_allclose(nodes[:, 1:3], six.mesh.nodes, rtol=WRITTEN, atol=WRITTEN)
    triangles = only(blocks, "*ELEMENT, TYPE=CPS6").reshape(-1, 7)
    np.testing.assert_array_equal(triangles[:, 1:] - 1, six.mesh.triangles)


def test_sets_hold_the_nodes_of_the_clamped_and_the_rigid_edges(six, blocks) -> None:
    for name in ("ground", "hub"):
        np.testing.assert_array_equal(only(blocks, f"*NSET, NSET={name}") - 1, np.unique(six.mesh.edges[name]))
    np.testing.assert_array_equal(only(blocks, "*BOUNDARY"), [1, 2])


def test_every_node_of_the_hub_follows_the_pose(six, blocks) -> None:
    """The equations are solved for a pose and must give its small rigid motion."""
    pose = {(len(six.mesh.nodes) + 1, 1): 0.7, (len(six.mesh.nodes) + 1, 2): -0.4, (len(six.mesh.nodes) + 2, 1): 0.03}
    hub = np.unique(six.mesh.edges["hub"])
    found = np.full((len(six.mesh.nodes), 2), np.nan)
    for title, numbers in blocks:
        if title == "*EQUATION":
            assert numbers[0] == 3
            (node, direction, one), *others = numbers[1:].reshape(3, 3)
            found[int(node) - 1, int(direction) - 1] = -sum(c * pose[int(n), int(d)] for n, d, c in others) / one
    x, y = six.mesh.nodes[hub].T
    np.testing.assert_allclose(found[hub], np.stack([0.7 - 0.03 * y, -0.4 + 0.03 * x], axis=-1), rtol=WRITTEN)
    assert np.isnan(np.delete(found, hub, axis=0)).all()


def test_each_load_is_a_step(six, blocks) -> None:
    centre, rotation = len(six.mesh.nodes) + 1, len(six.mesh.nodes) + 2
    loads = [numbers.reshape(-1, 3) for title, numbers in blocks if title == "*CLOAD, OP=NEW"]
    for found, (fx, fy, moment) in zip(loads, [(2.5, -1.5, 40.0), (0.0, 0.0, 1.0)], strict=True):
        np.testing.assert_array_equal(found, [[centre, 1, fx], [centre, 2, fy], [rotation, 1, moment]])


def test_material_and_thickness(six, blocks) -> None:
    np.testing.assert_allclose(only(blocks, "*ELASTIC"), six.plate[:2], rtol=WRITTEN)
    assert only(blocks, "*SOLID SECTION") == [0.37]


def test_a_folder_that_takes_no_file_is_one_line(six, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="cannot be written"):
        write_deck(six.mesh, six.plate, tmp_path / "file" / "stage.inp")


def test_an_uncoupled_sheet_keeps_the_plane_and_loses_what_leaves_it(six, tmp_path: Path) -> None:
    """E1 = E2 = E3, nu12, nu13 = nu23 = 0, G12 = G13 = G23 = E / (2 (1 + nu)); the isotropic sheet says E and nu."""
    plate = six.plate._replace(youngs_modulus=68.0e3, poissons_ratio=0.36)
    for uncoupled, expected in ((True, [68e3] * 3 + [0.36, 0, 0] + [25e3] * 3), (False, [68e3, 0.36])):
        write_deck(six.mesh, plate, tmp_path / "stage.inp", uncoupled=uncoupled)
        lines = (tmp_path / "stage.inp").read_text().splitlines()
        start = next(k for k, line in enumerate(lines) if line.startswith("*ELASTIC")) + 1
        end = next(k for k in range(start, len(lines)) if lines[k].startswith("*"))
        found = [float(field) for line in lines[start:end] for field in line.split(",")]
        assert found == pytest.approx(expected, rel=1e-11)
