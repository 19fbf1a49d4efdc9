"""Meshes of random variants of mechanism files, at all resolutions that the commands use.

Every parameter of a file, or every dimension of a file without parameters, changes at random. A
variant that passes `check` and cannot be meshed is a fault. With `--mechanisms`, perforated plates
and those of `random_mechanisms.py` are meshed, too. Without files, those of `geometry/` are
changed.

    python benchmarks/random_meshes.py geometry/*.toml --variants 300 --seed 1 --mechanisms 80
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from random_mechanisms import guide, legs, ring

import flexfem
from flexfem.fem.plate_mesh import mesh_layout
from flexfem.paper.stage_mesh import mesh_sectors

SHIPPED = Path(__file__).parents[1] / "geometry"
RESOLUTIONS = (
    2,
    3,
    4,
    6,
    8,
)  # of all bands at the usual resolutions, of `large`, single parts and stored meshes
CHANGED = (
    *10 * [1.0],
    *10 * [0.5],
    *20 * [0.2],
)  # share of numbers that change, in attempts to pass the check
OF_HINGE = ("neck", "radius", "fillet", "depth", "root_radius", "cut", "direction")
Plate = flexfem.Stage | flexfem.Mechanism
Random = np.random.Generator


class Change(NamedTuple):
    """Random factors within 1 +- `spread` for a `share` of all numbers."""

    rng: Random
    spread: float
    share: float

    def of(self, value: Any) -> Any:
        """A number, or nested numbers, with a factor each; anything else as it is."""
        if isinstance(value, list | tuple):
            return [self.of(each) for each in value]
        if (
            isinstance(value, float | int)
            and not isinstance(value, bool)
            and self.rng.random() < self.share
        ):
            return float(value) * self.rng.uniform(1 - self.spread, 1 + self.spread)
        return value


def variant(plate: Plate, change: Change) -> Plate:
    """The plate with other parameters, chain and hinges, or dimensions of bodies, holes and hinges."""
    if isinstance(plate, flexfem.Stage):
        tables = plate.model_dump(exclude_none=True)
        chain = {name: change.of(tables["chain"][name]) for name in ("link_lengths", "link_width")}
        hinges = {
            name: {key: change.of(hinge[key]) for key in ("radius", "neck")}
            for name, hinge in tables["hinges"].items()
        }
        radius = change.of(tables["platform"]["radius"])
        return plate.replace(chain=chain, hinges=hinges, platform={"radius": radius})
    if plate.parameters:
        return plate.replace(
            parameters={name: change.of(value) for name, value in plate.parameters.items()}
        )
    changes: dict[str, Any] = {"body": {}, "hinge": {}}
    for body in plate.body:
        stated = body.model_dump(exclude_unset=True, exclude_none=True)
        if "holes" in stated:
            stated["holes"] = [
                {key: change.of(of) for key, of in hole.items()} for hole in stated["holes"]
            ]
        if not plate.hinge and "outline" in stated:
            stated["outline"] = change.of(stated["outline"])
        kept = ("holes", "width") if plate.hinge else ("holes", "width", "outline")
        changes["body"][body.name] = {key: change.of(stated[key]) for key in kept if key in stated}
    for hinge in plate.hinge:
        stated = hinge.model_dump(exclude_unset=True, exclude_none=True)
        changes["hinge"][hinge.name] = {
            key: change.of(stated[key]) for key in OF_HINGE if stated.get(key)
        }
        if "table" in stated:
            changes["hinge"][hinge.name]["table"] = [[x, change.of(h)] for x, h in stated["table"]]
    return plate.replace(**{key: value for key, value in changes.items() if value})


def variants(
    rng: Random, paths: list[Path], count: int, spread: float
) -> Iterator[tuple[str, Plate]]:
    """The files as they are, then variants of them in turn that pass the check."""
    plates = dict[Path, Plate]()
    for path in paths:
        try:
            plates[path] = flexfem.load(path)
        except flexfem.BadInput as refusal:
            print(f"refused: {refusal}", flush=True)
            continue
        yield path.stem, plates[path]
    made = 0
    while plates and made < count:
        for path, plate in list(plates.items()):
            for share in CHANGED:
                try:
                    changed = variant(plate, Change(rng, spread, share))
                except flexfem.BadInput:
                    continue
                made += 1
                yield f"{path.stem} {made}", changed
                break
            else:
                print(f"{path.stem}: no variant passes the check", flush=True)
                del plates[path]


def perforated(rng: Random, name: str) -> flexfem.Mechanism:
    """A stage on two leaves, with a row of holes at small distances from each other and from an
    edge, and a slit.
    """
    radii = rng.uniform(0.5, 2.5, 5)
    gaps = 10 ** rng.uniform(-3, 0, 5)
    x = -22 + np.cumsum(2 * radii + gaps)
    holes: list[dict[str, Any]] = [
        {"centre": (float(at), 60 - radius - 10 ** rng.uniform(-3, 0)), "radius": radius}
        for at, radius in zip(x - radii, radii, strict=True)
    ]
    slit = 10 ** rng.uniform(-3, 0)
    corners = [(15, 52), (20, 52), (20, 52 + slit), (15, 52 + slit * rng.uniform(1, 2))]
    holes.append({"outline": corners})
    ground = [(-25, -10), (25, -10), (25, 0), (-25, 0)]
    thin = 10 ** rng.uniform(-2, 0)
    ground[3:] = [(0, 0, 0.4 * thin), (0, -10 + thin), (-15, -10 + thin), (-15, 0), (-25, 0)]
    held: dict[str, Any] = {"fixed": True} if rng.random() < 0.5 else {"clamped_edges": [1]}
    leaf = {
        "at": (-20, 25),
        "direction": np.pi / 2,
        "shape": "leaf",
        "length": 50,
        "neck": rng.uniform(0.2, 1),
    }
    return flexfem.Mechanism(
        name=name,
        thickness=10,
        material={"name": "al-7075-t6"},
        body=[
            {"name": "ground", **held, "outline": ground},
            {
                "name": "stage",
                "outline": [(-25, 50), (25, 50), (25, 60), (-25, 60)],
                "holes": holes,
            },
        ],
        hinge=[
            {"name": "leaf", "between": ("ground", "stage"), "fillet": rng.uniform(0.05, 1), **leaf}
        ],
        copies=[{"parts": ["leaf"], "mirror": [(0, 0), (0, 1)]}],
        output={"body": "stage", "at": (0, 55)},
    )


def drawn(rng: Random, count: int) -> Iterator[tuple[str, Plate]]:
    """Perforated plates and mechanisms of `random_mechanisms.py`, as far as they pass the check."""
    for number in range(count):
        family = (ring, legs, guide, perforated)[int(rng.integers(4))]
        try:
            mechanism = family(rng, f"{family.__name__} {number + 1}")
            flexfem.check(mechanism)
        except flexfem.BadInput:
            continue
        yield mechanism.name, mechanism


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", type=Path, nargs="*", default=sorted(SHIPPED.glob("*.toml")))
    parser.add_argument("--variants", type=int, default=60)
    parser.add_argument("--mechanisms", type=int, default=0)
    parser.add_argument(
        "--spread", type=float, default=0.15, help="largest relative change of a number"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--failed", type=Path, help="folder for the files that cannot be meshed")
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    plates = 0
    failed = list[str]()
    slowest = (0.0, "")
    found = [
        *variants(rng, given.files, given.variants, given.spread),
        *drawn(rng, given.mechanisms),
    ]
    for name, plate in found:
        plates += 1
        for resolution in RESOLUTIONS:
            start = time.perf_counter()
            try:
                if isinstance(plate, flexfem.Stage):
                    mesh_sectors(plate, resolution)
                else:
                    mesh_layout(plate.layout, resolution)
            except Exception as error:
                failed.append(f"{name} at resolution {resolution}: {error}")
                print(failed[-1], flush=True)
                if given.failed is not None:
                    plate.save(given.failed / f"{name.replace(' ', '-')}-{resolution}.toml")
            slowest = max(
                slowest, (time.perf_counter() - start, f"{name} at resolution {resolution}")
            )
    print(
        f"{plates} plates pass the check, {len(failed)} of {plates * len(RESOLUTIONS)} meshes "
        "failed"
    )
    print("slowest: {:.1f} s, {}".format(*slowest))
    if failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
