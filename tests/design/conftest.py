"""Requirements files about the reference stage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from flexfem.design.requirements import LoadedRequirements, load_requirements

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "geometry/mobility6.toml"
HEAD = f'name = "a test"\nstage = "{REFERENCE}"\nseed = 7\n'
NECK = '[[free]]\nlabel = "neck"\nkeys = ["hinges.elbow.neck_mm", "hinges.platform.neck_mm"]\nfrom = 0.3\nto = 0.7\n'
RADIUS = '[[free]]\nlabel = "radius"\nkeys = ["hinges.elbow.radius_mm", "hinges.platform.radius_mm"]\nfrom = 1.5\nto = 4.0\n'
LINK = '[[free]]\nlabel = "l1"\nkey = "chain.link_lengths_mm[0]"\nfrom = 26.0\nto = 40.0\n'


def require(quantity: str, least: float | None = None, most: float | None = None) -> str:
    """A requirement as the file has it."""
    ends = {"at_least": least, "at_most": most}
    lines = [f"{key} = {float(end)!r}" for key, end in ends.items() if end is not None]
    return "\n".join(["[[require]]", f'quantity = "{quantity}"', *lines, ""])


def best(way: str, quantity: str) -> str:
    """An objective as the file has it."""
    return f'[[objective]]\n{way} = "{quantity}"\n'


def tolerance(sd: float = 5.0, stages: int = 72, checked: int = 0) -> str:
    """The table as the file has it."""
    return f"[tolerance]\nneck_um = {sd}\nstages = {stages}\nchecked = {checked}\n"


RANGE = best("maximise", "range_x_um")
STIFFEST = best("maximise", "kxx_n_per_mm")
STEPPED = NECK + "step = 0.005\n", RADIUS + "step = 0.25\n"
WANTED = require("kxx_n_per_mm", 60.0), require("envelope_mm", None, 200)


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., LoadedRequirements]:
    """What reads requirements of pieces of text."""

    def loaded(*pieces: str, head: str = HEAD) -> LoadedRequirements:
        path = tmp_path / "wanted.toml"
        path.write_text("\n".join([head, *pieces]))
        return load_requirements(path)

    return loaded
