"""What `flexfem modes` prints, and what it draws of the response: every number of the record, at its place and unit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from flexfem.commands.modes import print_modes
from flexfem.plot.modes import plot_response, title_of
from flexfem.verify.dynamic_model import Channels, CraigBampton, DynamicModel
from flexfem.verify.modes import Mode, NaturalModes
from flexfem.verify.result import Triple, Uncertainty, about

from ..conftest import with_changes


@pytest.fixture(scope="module")
def record():
    """Two modes with no number twice."""
    mesh = Uncertainty(
        resolutions=[4, 6, 8], values=[141.0, 140.0, 139.5], verdict="converging", order=4.0, observed=4.1,
        extrapolated=139.4, band=0.31,
    )  # fmt: skip
    one = Mode(
        frequency=123.456789, band=0.312, mesh=mesh, share=Triple(x=61.23, y=7.45, theta=0.89),
        analytic={"first": 131.5, "second": 122.25},
    )  # fmt: skip
    other = one.model_copy(
        update={"frequency": 2345.678, "band": 4.56, "analytic": {"first": None, "second": 2222.5}}
        | {"share": Triple(x=0.01, y=0.02, theta=33.44)}
    )
    return NaturalModes(
        **about(with_changes()), name="any", drives="engaged", resolution=8, triangles=1000, unknowns=4000,
        mass=0.7123, inertia=311.4, meshed_mass=0.6, hub_mass=0.0567, payload_mass=0.25, payload_inertia=41.5,
        modes=[one, other], warnings=[],
    )  # fmt: skip


def test_every_cell_is_a_number_of_its_mode(record, capsys):
    print_modes(record)
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == (
        "any: drives engaged, payload 0.25 kg, 41.5 kg mm^2; mass 0.7123 kg, of it the hub 0.0567, moment of inertia "
        "311.4 kg mm^2"
    )
    assert lines[1:4] == [
        "mode frequency (Hz) band x mass (%) y mass (%) theta mass (%) first (Hz) second (Hz)",
        "1 123.457 0.31 61.23 7.45 0.89 131.5 122.25",
        "2 2345.68 4.6 0.01 0.02 33.44 - 2222.5",
    ]


def test_titles_name_the_direction_that_moves_most(record):
    assert title_of(record, 1) == "mode 1: 123.46 ± 0.3 Hz; moves 61 % in x"
    assert title_of(record, 2) == "mode 2: 2345.7 ± 5 Hz; moves 33 % in theta"


@pytest.fixture(scope="module")
def model():
    """One mass of 0.4 kg in each direction at 100 Hz, 5 % damped; a stroke is 30 N/mm of X."""
    k, own = 4e-4 * (200 * math.pi) ** 2, 200 * math.pi
    drive = np.hstack([np.eye(3), [[30.0], [0.0], [0.0]]]) / math.sqrt(4e-4)
    none = np.zeros((4, 4))
    assert k == pytest.approx(157.91, rel=1e-4)
    return DynamicModel(
        np.full(3, own), drive, np.eye(3) / math.sqrt(4e-4), np.zeros((3, 4)), 0.05,
        Channels(("load x", "load y", "load theta", "stroke one"), ("N", "N", "N mm", "mm")),
        Channels(("pose x", "pose y", "pose theta"), ("mm", "mm", "rad")), CraigBampton(none, none, none),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("direction", "kind", "highest", "unit"),
    [("x", "load", 10 / 157.91, "mm/N"), ("theta", "load", 10 / 157.91, "rad/(N mm)"),
     ("x", "stroke", 300 / 157.91, "mm/mm")],
)  # fmt: skip
def test_responses_are_drawn_over_hertz_with_magnitudes_per_input(model, direction, kind, highest, unit):
    """Ten times the static displacement F / k, at 100 Hz, 90 degrees late."""
    size, angle = (plot_response(Figure().subplots(), model, direction, kind, part) for part in ("magnitude", "phase"))
    ((line,), (late,)) = (ax.get_lines() for ax in (size, angle))
    peak = int(np.argmax(line.get_ydata()))
    assert line.get_xdata()[peak] == pytest.approx(100.0, rel=5e-3)
    assert line.get_ydata()[peak] == pytest.approx(highest, rel=5e-3)
    assert np.interp(100.0, late.get_xdata(), late.get_ydata()) == pytest.approx(-90.0, abs=1.0)
    assert size.get_xlabel() == angle.get_xlabel() == "frequency (Hz)"
    assert size.get_ylabel() == f"magnitude ({unit})" and angle.get_ylabel() == "phase (°)"
