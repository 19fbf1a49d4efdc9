"""The error budget drawn: every bar is the share of its own direction, and begins where the one before ends."""

from __future__ import annotations

import numpy as np
import pytest

from flexfem.plot.errors import budget_figure

SHARES = {  # along the command, percentage points; the total and its band
    "X": ([0.216, 11.796, 0.526, -0.308, -0.139], 12.091, 0.013),
    "Y": ([-0.411, 8.523, 0.731, 0.092, 0.253], 9.188, 0.127),
    "θ": ([0.137, 9.685, -0.722, 0.051, 0.326], 9.477, 0.245),
}
MINUS = "\N{MINUS SIGN}"


@pytest.fixture(scope="module")
def figure(made):
    return budget_figure(made.budget())


def test_every_bar_is_a_share_along_its_own_command_and_begins_where_the_last_ends(figure):
    for axes, (name, (shares, total, band)) in zip(figure.axes, SHARES.items(), strict=True):
        assert axes.get_title(loc="left").endswith(f") command in {name}")
        bars = [(bar.get_x(), bar.get_width()) for bar in axes.patches]
        ends = np.cumsum(shares)
        np.testing.assert_allclose(bars[:5], np.column_stack([ends - shares, shares]), atol=1e-12)
        np.testing.assert_allclose(bars[5], (0.0, total), atol=1e-12)
        assert [round(bar.get_y() + bar.get_height() / 2, 9) for bar in axes.patches] == [0, 1, 2, 3, 4, 5]
        assert axes.yaxis_inverted()
        (whisker,) = [piece for found in axes.collections for piece in found.get_segments()]
        np.testing.assert_allclose(whisker, [(total - band, 5.0), (total + band, 5.0)], atol=1e-12)
        joints = [line.get_xdata()[0] for line in axes.get_lines() if np.ptp(line.get_ydata()) > 1.5]
        np.testing.assert_allclose(joints, ends, atol=1e-12)
        low, high = axes.get_xlim()
        assert low <= min(0.0, *(ends - shares), *ends) and high > 1.2 * max(*ends, total)


def test_what_is_outside_the_plane_is_said_with_its_sign(figure, made):
    text = " ".join(made.texts(figure))
    assert "by the chart: X −10.53, Y +6.22, θ −8.46 percentage points" in text
    assert "three dimensions: X −10.67 ± 0.12, Y +5.22 ± 0.23, θ −7.46 ± 0.34 percentage points" in text
    assert "mobility 6, paros-weisbord" in text and "a stage $x_1$: error budget" in text and "assumed" not in text
    without = " ".join(made.texts(budget_figure(made.budget(outside=False, assumed=("thickness_mm",)))))
    assert "out of plane, not known" in without and "assumed dimensions" in without
