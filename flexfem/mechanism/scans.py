"""Measured edges of hinges: a table of points on both edges becomes the profile of a hinge."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from flexfem.arrays import Array
from flexfem.files.refusals import place_of, shown
from flexfem.files.toml import PathLike, bad_key, read_csv
from flexfem.refused import BadInput

ROWS = 129  # of the table, which are denser at the neck
CROWDED = 1.5  # power with which the distance of rows from the neck grows
# of the points on an edge, at most: splines through points that nearly coincide are not computed
# well
MEANS = 300
FEWEST = 8  # points on an edge
EDGES = ("left", "right")


def with_scanned_tables(path: PathLike, data: dict[str, Any]) -> dict[str, Any]:
    """Return the content of the mechanism file at `path` with the tables of hinges that it takes
    from other files.

    Raises BadInput as `scanned_rows`, and for a hinge that has a table as well.
    """
    hinges = data.get("hinge")
    if not isinstance(hinges, list):
        return data
    found = list[Any]()
    for index, hinge in enumerate(hinges):
        if not isinstance(hinge, dict) or "table_csv" not in hinge:
            found.append(hinge)
            continue
        at = ("hinge", index, "table_csv")
        file = hinge["table_csv"]
        if not isinstance(file, str) or "table_mm" in hinge:
            raise bad_key(
                path,
                at,
                f"hinge[{index}].table_csv = {shown(file)}, expected a file name, and no table_mm",
            )
        rows = scanned_rows(Path(path).parent / file)
        stated = {key: value for key, value in hinge.items() if key != "table_csv"}
        found.append({"shape": "profile", "smooth": True} | stated | {"table_mm": rows})
    return data | {"hinge": found}


def scanned_rows(path: PathLike) -> list[list[float]]:
    """Return rows of position, left and right edge, mm, of a file with points on both edges.

    Its columns are edge (left or right, seen from the first body to the second), x_mm along the
    axis and y_mm across it, to the left. Smoothing splines by generalised cross-validation (G.
    Wahba, Spline Models for Observational Data, SIAM, 1990) follow the points of each edge, so that
    the scatter of a scan does not become a rough edge.

    Raises BadInput for other columns or numbers, too few points, or edges that meet.
    """
    points = _points_of_edges(path)
    left, right = (_curve(np.array(sorted(points[edge]))) for edge in EDGES)
    low = max(left.x[0], right.x[0])
    high = min(left.x[-1], right.x[-1])
    if not low < high:
        raise BadInput(
            f"{place_of(path)}: the edges lie beside each other, expected the same range of x_mm"
        )
    fine = np.linspace(low, high, 20 * ROWS)
    neck = float(fine[np.argmin(left(fine) - right(fine))])
    x = _rows_around(neck, float(low), float(high))
    edges = (left(x), -right(x))
    thin = np.flatnonzero(edges[0] + edges[1] <= 0)
    if len(thin):
        raise BadInput(
            f"{place_of(path)}: the edges meet at x_mm = {x[thin[0]]:.4g}, expected left above "
            "right"
        )
    return [[round(float(each), 7) for each in row] for row in np.column_stack([x, *edges])]


def _points_of_edges(path: PathLike) -> dict[str, list[tuple[float, float]]]:
    """Return the points x, y of both edges.

    Raises BadInput for other columns, or too few points.
    """
    points: dict[str, list[tuple[float, float]]] = {edge: [] for edge in EDGES}
    for line, row in read_csv(path, ("edge", "x_mm", "y_mm")).items():
        try:
            points[row["edge"]].append((float(row["x_mm"]), float(row["y_mm"])))
        except (KeyError, ValueError):
            given = ", ".join(row.values())
            expected = "expected left or right, and two numbers"
            raise BadInput(f"{place_of(path, line)}: {given}, {expected}") from None
    for edge in EDGES:
        positions = {x for x, _ in points[edge]}
        if len(positions) < FEWEST or not np.all(np.isfinite(points[edge])):
            expected = f"expected at least {FEWEST} points with finite numbers"
            raise BadInput(f"{place_of(path)}: the {edge} edge, {expected}")
    return points


def _curve(points: Array) -> Any:
    """Return a smoothing spline through means of points (n, 2) that lie close together.

    `x` are their positions.
    """
    # takes a fifth of a second to import, for scans alone
    from scipy.interpolate import make_smoothing_spline

    first = points[0, 0]
    last = points[-1, 0]
    count = min(MEANS, len(points))
    bins = np.minimum((count * (points[:, 0] - first) / (last - first)).astype(int), count - 1)
    kept = np.bincount(bins) > 0
    counts = np.bincount(bins)[kept].astype(float)
    x, y = (np.bincount(bins, weights=column)[kept] / counts for column in points.T)
    curve = make_smoothing_spline(x, y, w=counts)
    curve.x = x
    return curve


def _rows_around(
    neck: float,
    low: float,
    high: float,
) -> Array:
    """Return positions (n,) from `low` to `high`, denser at the neck."""
    share = np.linspace(0, 1, ROWS // 2 + 1) ** CROWDED
    left = neck - share[::-1] * (neck - low)
    right = neck + share * (high - neck)
    return np.unique(np.concatenate([left, right]))
