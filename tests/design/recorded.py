"""A record of a design of which every number is another, so that none can be shown for another."""

from __future__ import annotations

import tomllib
from typing import Any

from flexfem.design.result import (
    Designed,
    FrontDesign,
    Goal,
    Requirement,
    Round,
    Scattered,
    SoleRelaxation,
    Step,
)
from flexfem.paper.stage import Stage
from flexfem.units import unit_of

from .conftest import REFERENCE

REACH = "range_x_um"
MASS = "mass_kg"
STIFFNESS = "kxx_n_per_mm"
ENVELOPE = "envelope_mm"
COUPLING = "coupling_95"
STAGE = REFERENCE.read_text()
OTHER = STAGE.replace("[30.0, 32.0, 24.0]", "[36.0, 32.0, 24.0]")


def requirement(name: str, label: str, **said: Any) -> Requirement:
    """A requirement that is met, is not active and rests on the model alone, but for what is
    `said`.
    """
    about = {"band": None, "band_percent": None, "active": False}
    about |= {
        "verdict": "met",
        "checked_by": "analytic model alone",
        "at_least": None,
        "at_most": None,
    }
    return Requirement(name=name, label=label, unit=unit_of(name).name, **(about | said))


REQUIREMENTS = [
    requirement(
        STIFFNESS,
        "stiffness",
        value=61.5,
        band=0.25,
        uncorrected=66.0,
        checked_by="finite elements",
        at_least=60.0,
        at_most=80.0,
        size=80.0,
        margin=1.5,
        margin_percent=1.875,
        band_percent=0.3125,
        active=True,
    ),
    requirement(
        ENVELOPE,
        "diameter",
        value=153.0,
        uncorrected=152.0,
        at_most=150.0,
        size=150.0,
        margin=-3.0,
        margin_percent=-2.0,
        verdict="missed",
        active=True,
    ),
    requirement(
        COUPLING,
        "coupling",
        value=0.0131,
        band=0.0009,
        sampling=0.0007,
        uncorrected=0.0142,
        at_most=0.0135,
        size=0.0135,
        margin=0.0004,
        margin_percent=2.963,
        band_percent=6.667,
        verdict="within the band",
    ),
]
GOALS = [
    Goal(
        name=REACH,
        label="reach",
        unit="µm",
        value=412.0,
        band=1.25,
        uncorrected=433.0,
        checked_by="finite elements",
        better="larger",
    ),
    Goal(
        name=MASS,
        label="mass",
        unit="kg",
        value=0.0893,
        band=None,
        uncorrected=0.0871,
        checked_by="exact",
        better="smaller",
    ),
]
FOLLOWED = (REACH, MASS, STIFFNESS, ENVELOPE, COUPLING)
FRONT = [
    FrontDesign(
        design={"neck": 0.43, "l1": 36.0},
        values=[405.0, 0.081],
        predicted=[407.0, 0.082],
        met=True,
        margins_percent=[3.1, -4.2, 5.3],
        stage=OTHER,
    ),
    FrontDesign(
        design={"neck": 0.52, "l1": 30.0},
        values=[466.0, 0.093],
        predicted=[469.0, 0.094],
        met=False,
        margins_percent=[6.4, -7.5, 8.6],
        stage=STAGE,
    ),
]


def recorded(**changes: Any) -> Designed:
    """The record of a design that misses a requirement, with a front of two, but for `changes`."""
    said: dict[str, Any] = {
        "name": "Recorded",
        "file": "wanted.toml",
        "base": "base.toml",
        "seed": 2003,
        "stage": STAGE,
        "accuracy_percent": 0.3,
        "design": {"neck": 0.505, "l1": 31.5},
        "relaxed": {"neck": 0.5042, "l1": 31.62},
        "feasible": False,
        "agreed": True,
        "objectives": GOALS,
        "requirements": REQUIREMENTS,
        "alternatives": [
            SoleRelaxation(requirement="stiffness", relax_to=57.4, percent=4.33),
            SoleRelaxation(requirement="diameter", relax_to=None, percent=None),
        ],
        "at_ends": ["l1"],
        "sensitivities": {
            "neck": dict(zip(FOLLOWED, (-1.31, 0.12, -2.43, 0.54, None), strict=True)),
            "l1": dict(zip(FOLLOWED, (0.65, 0.76, 1.87, 0.98, 1.09), strict=True)),
        },
        "rounds": [
            Round(design={"neck": 0.5, "l1": 31.0}, gap_percent=7.53, evaluations=41_000),
            Round(design={"neck": 0.505, "l1": 31.5}, gap_percent=0.066, evaluations=12_345),
        ],
        "front": FRONT,
        "scattered": Scattered(share=0.824, stages=2000, notes=["coupling_95 of many"]),
        "history": [
            Step(evaluations=1000, objective=None, missed=0.21),
            Step(evaluations=3000, objective=390.0, missed=0.0),
            Step(evaluations=7000, objective=410.0, missed=0.0),
        ],
        "evaluations": {"analytic": 53_345, "drawn": 17, "finite elements": 12},
        "assumed": ["stage: a key"],
        "not_stated": [],
        "warnings": ["life extrapolated"],
        "versions": {},
    }
    said |= changes
    return Designed(**({"hash": Stage.model_validate(tomllib.loads(said["stage"])).hash} | said))
