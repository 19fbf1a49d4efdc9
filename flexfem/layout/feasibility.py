"""What cannot exist is refused here, before any meshing: closed forms first, then polygons."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import combinations

import numpy as np
import shapely

from flexfem.design import HINGE_NAMES, Stage, key_of, load_stage
from flexfem.errors import BadInput
from flexfem.layout.bodies import draw_sector, turn
from flexfem.layout.frames import stage_frames
from flexfem.layout.outline import polygon_points
from flexfem.refusals import place_of
from flexfem.tomlfile import Path, read_toml
from flexfem.tomllines import KeyPath

TOUCHING = 1e-6  # mm^2; round-off of polygons that share an edge


def load_feasible(path: Path) -> Stage:
    """Read a stage file and refuse what cannot be made. Raises BadInput, naming the file."""
    stage = load_stage(path)
    with naming(path):
        check_feasible(stage)
    return stage


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Put file and line in front of refusals that begin with a key path of the file."""
    try:
        yield
    except BadInput as refusal:
        raise BadInput(f"{place_of(path, read_toml(path).lines.line(_key_path(str(refusal))))}: {refusal}") from None


def check_feasible(stage: Stage) -> None:
    """Refuse a stage that cannot be made. Raises BadInput with key, value and what was expected."""
    _check_notches(stage)
    _check_platform(stage)
    _check_distances(stage)
    _check_bodies(stage)


def _key_path(refusal: str) -> KeyPath:
    """Key path that a refusal begins with: `override[0].neck_mm = ...` is ("override", 0, "neck_mm")."""
    dotted = re.match(r"[\w.\[\]]*", refusal)
    parts = re.findall(r"\w+", dotted[0]) if dotted else []
    return tuple(int(part) if part.isdigit() else part for part in parts)


def _check_platform(stage: Stage) -> None:
    disc, hub = stage.platform.radius, stage.platform.hub_radius
    if hub >= disc:
        raise BadInput(
            f"platform.hub_radius_mm = {hub:g}, hub larger than the platform, expected < platform.radius_mm = {disc:g}"
        )
    centres = stage_frames(stage).centres
    for chain, position in np.ndindex(3, 3):
        hinge = stage.hinge(chain + 1, HINGE_NAMES[position])
        reach = disc + hinge.radius + hinge.neck / 2
        distance = float(np.hypot(*centres[chain, position]))
        if distance <= reach:
            raise BadInput(
                f"platform.radius_mm = {disc:g}, the platform swallows the {HINGE_NAMES[position]} hinge of chain "
                f"{chain + 1}, expected < {distance - hinge.radius - hinge.neck / 2:g} "
                "(distance of the hinge from the platform centre less its notch)"
            )


def _check_notches(stage: Stage) -> None:
    for chain, name in ((chain, name) for chain in (1, 2, 3) for name in HINGE_NAMES):
        hinge, width = stage.hinge(chain, name), stage.chain.link_width
        if hinge.neck >= width:
            raise BadInput(
                f"{key_of(stage, chain, name, 'neck_mm')} = {hinge.neck:g}, neck as wide as the link, "
                f"expected < chain.link_width_mm = {width:g}"
            )
        deepest = (width - hinge.neck) / 2
        if hinge.radius > deepest * (1 + 1e-12):
            raise BadInput(
                f"{key_of(stage, chain, name, 'radius_mm')} = {hinge.radius:g}, notch deeper than the link, "
                f"expected <= (link_width - neck)/2 = {deepest:g}"
            )


def _check_distances(stage: Stage) -> None:
    centres = stage_frames(stage).centres
    places = [(chain, position) for chain in range(3) for position in range(3)]
    for one, other in combinations(places, 2):
        radii = [stage.hinge(chain + 1, HINGE_NAMES[position]).radius for chain, position in (one, other)]
        distance = float(np.hypot(*(centres[one] - centres[other])))
        if distance <= sum(radii):
            names = [f"{HINGE_NAMES[position]} hinge of chain {chain + 1}" for chain, position in (one, other)]
            raise BadInput(
                f"chain.link_lengths_mm = {list(stage.chain.link_lengths)}, hinges closer than their radii: {names[0]} "
                f"and {names[1]} are {distance:.4g} mm apart, expected > {sum(radii):g}"
            )


def _check_bodies(stage: Stage) -> None:
    """No body crosses itself, and bodies meet only at their necks and at the cuts between the thirds."""
    bodies = {}
    for chain in (1, 2, 3):
        for body, face in draw_sector(stage, chain).items():
            bodies[f"{body} of chain {chain}"] = shapely.Polygon(polygon_points(turn(face.loop, chain)))
    size = (
        f"at chain.link_lengths_mm = {list(stage.chain.link_lengths)}, chain.link_width_mm = "
        f"{stage.chain.link_width:g}, platform.radius_mm = {stage.platform.radius:g}"
    )
    for name, outline in bodies.items():
        if not outline.is_valid:
            raise BadInput(f"chain: {name} overlaps itself {size}, expected an outline that does not cross itself")
    for (one, first), (other, second) in combinations(bodies.items(), 2):
        if first.intersects(second) and first.intersection(second).area > TOUCHING:
            raise BadInput(f"chain: {one} and {other} overlap {size}, expected bodies that meet only at their hinges")
