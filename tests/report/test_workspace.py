"""The figure of large displacements: every series where it belongs, each against its own linear answer."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.report.style import rendered
from flexfem.report.workspace import workspace_figure
from flexfem.verify.travel import Box, Elements, Point, Travel, Workspace

NAMES = ("without", "tangent", "exact")
SHARE = {"without": 0.61, "tangent": 0.97, "exact": 1.0}


def travel(axis: int, far: float, size: float, aside: float) -> Travel:
    commanded, held = far * np.linspace(-1, 1, 41), far * np.linspace(-1, 1, 9)
    way = np.full(3, aside)
    way[axis] = size

    def position(at, share=1.0):
        return (share * (at / far)[:, None] * way).tolist()

    ends = far * np.array([-1.0, -0.1, 0.1, 1.0])
    return Travel(
        commanded=commanded.tolist(),
        load=np.outer(commanded, [3.0, 4.0, 5.0]).tolist(),
        stiffness={name: (2 * share * size * commanded / far).tolist() for name, share in SHARE.items()},
        position={name: position(commanded, share) for name, share in SHARE.items()},
        elements=Elements(
            commanded=held.tolist(),
            load=np.outer(held, [3.0, 4.0, 5.0]).tolist(),
            stiffness=(1.9 * size * held / far).tolist(),
            position=position(held, 0.9),
            strain=np.abs(held).tolist(),
            loaded=np.outer(1.1 * ends, np.eye(3)[axis]).tolist(),
            loaded_position=position(ends, 1.2),
        ),
        points=[
            Point(
                commanded=end,
                stiffness={name: 2 * share * size * end / far for name, share in SHARE.items()},
                position={name: share * size * end / far for name, share in SHARE.items()},
                across=dict.fromkeys(NAMES, aside),
            )
            for end in ends.tolist()
        ],
    )


def found(**changes) -> Workspace:
    given = {
        "stage": "a stage $x_1$",
        "file": "one.toml",
        "hash": "1234",
        "plane": "plane_stress",
        "mobility": 6,
        "formula": "paros-weisbord",
        "assumed": [],
        "not_stated": [],
        "warnings": [],
        "amplitude": {"x": 0.3, "y": 0.3, "theta": 0.006},
        "resolution": 4,
        "unknowns": 1234,
        "travel": {
            "x": travel(0, 0.3, 0.7, 0.31),
            "y": travel(1, 0.3, -0.4, 0.22),
            "theta": travel(2, 0.006, 0.2, 0.0),
        },
        "small": Box(position=0.123, terms=0.045),
        "box": Box(position=1.237, terms=0.678),
        "versions": {},
    }
    return Workspace(**(given | changes))


def shown(axes, label):
    """Points of the lines of a label."""
    return [np.column_stack(line.get_data()) for line in axes.get_lines() if line.get_label().startswith(label)]


def test_each_direction_shows_stiffness_and_errors_along_and_across() -> None:
    made = found()
    panels = workspace_figure(made).axes
    assert len(panels) == 9
    for row, (direction, factor) in enumerate((("x", 1e3), ("y", 1e3), ("theta", 1e3))):
        way, (stiff, along, across) = made.travel[direction], panels[3 * row : 3 * row + 3]
        x, held = factor * np.array(way.commanded), factor * np.array(way.elements.commanded)
        label = "(16) without"
        np.testing.assert_allclose(shown(stiff, label)[0], np.column_stack([x, way.stiffness["without"]]))
        exact = np.array(way.position["exact"])
        np.testing.assert_allclose(shown(along, "exact")[0][:, 1], exact[:, row])
        others = [k for k in range(3) if k != row]
        for line, other in zip(shown(across, "exact"), others, strict=True):
            np.testing.assert_allclose(line[:, 1], exact[:, other])
        for axes, values in ((stiff, way.elements.stiffness), (along, np.array(way.elements.position)[:, row])):
            np.testing.assert_allclose(shown(axes, "finite elements held")[0], np.column_stack([held, values]))
        loaded = shown(along, "finite elements under the load")[0]
        np.testing.assert_allclose(loaded[:, 1], np.array(way.elements.loaded_position)[:, row])


def test_the_figure_says_what_the_terms_are_worth() -> None:
    texts = [text.get_text() for axes in workspace_figure(found()).axes[:3] for text in axes.texts]
    worth = 2 * (SHARE["tangent"] - SHARE["without"]) * 0.7
    assert any(f"\N{MINUS SIGN}{worth:.2f}, +{worth:.2f}" in text for text in texts)
    figure = " ".join(text.get_text().replace("\n", " ") for text in workspace_figure(found()).texts)
    assert "within ±30 µm and ±0.6 mrad" in figure and "0.12 %" in figure and "1.24 %" in figure


def test_a_panel_with_nothing_but_round_off_says_so() -> None:
    panels = workspace_figure(found()).axes
    said = [any("round-off only" in text.get_text() for text in axes.texts) for axes in panels]
    assert said == [False] * 8 + [True]


@pytest.mark.parametrize(("assumed", "noted"), [([], False), (["thickness_mm"], True)])
def test_assumed_dimensions_are_marked(assumed, noted) -> None:
    texts = [text.get_text() for text in workspace_figure(found(assumed=assumed)).texts]
    assert any("assumed" in text for text in texts) == noted


def test_the_same_record_gives_the_same_bytes() -> None:
    assert rendered(workspace_figure(found()), "png") == rendered(workspace_figure(found()), "png")
