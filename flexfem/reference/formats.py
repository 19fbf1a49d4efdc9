"""The formats of files by name: which model reads them, and what they are for."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from pydantic import BaseModel

from flexfem.design.requirements import Requirements
from flexfem.files.refusals import SHOWN, one_line
from flexfem.mechanism.actuators import Catalogue
from flexfem.mechanism.materials import Entry
from flexfem.mechanism.stage import Stage
from flexfem.questions.as_built import Necks
from flexfem.questions.fixture import Fixture, Measurement
from flexfem.refused import BadInput
from flexfem.study.plan import Study
from flexfem.verify.case import Case


class Format(NamedTuple):
    """A format: the model of a file, or of every table of it; its title, and what it is for.

    named : what tables are named after, where their names are the user's.   entry : what such a table is.
    """

    model: type[BaseModel]
    title: str
    about: str
    named: str | None = None
    entry: str = ""


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "stage": Format(
            Stage,
            "Stage file",
            "One TOML file a stage. `flexfem new` writes one to start from; `flexfem check` reads one, refuses with "
            "file, line, key and value what cannot be made, and prints what it means.",
        ),
        "case": Format(
            Case,
            "Case file",
            "One TOML file a comparison: a platform displacement is commanded, (18) says which force should produce "
            "it, that force is applied to the finite-element stage, and the difference is the error. `flexfem "
            "verify` answers.",
        ),
        "study": Format(
            Study,
            "Study file",
            "One TOML file a study: many designs of one base stage, and which model answers them. `flexfem study run` "
            "runs it.",
        ),
        "requirements": Format(
            Requirements,
            "Requirements file",
            "One TOML file a design: a base stage, what of it is free, what is required of it and what is to be best. "
            "`flexfem design` finds the stage.",
        ),
        "fixture": Format(
            Fixture,
            "Fixture file",
            "One TOML file a set-up of the stiffness experiment, for `flexfem experiment`. Out-of-plane tilt of the "
            "stage, contacts, friction, hysteresis and drift are not in it.",
        ),
        "measured": Format(
            Measurement,
            "Measured slopes",
            "Measured slopes alone, without the set-up, for `flexfem identify` and `flexfem experiment --measured`; "
            "the table `[measured]` is that of a set-up.",
        ),
        "material": Format(
            Entry,
            "Materials file",
            "Materials of your own, a table each, beside a stage file that names one: `name` and `file` in "
            "`[material]`.",
            named="material",
            entry="The numbers of one material",
        ),
        "stack": Format(
            Catalogue,
            "Stack catalogue",
            "The piezo stacks that stage files name; `flexfem/data/stacks.toml` is shipped.",
        ),
        "necks": Format(
            Necks,
            "Measured necks",
            "The nine necks of a stage as measured, for `flexfem stiffness --necks`; a CSV file with these columns "
            "does, too.",
        ),
    }
)


def format_of(name: str) -> Format:
    """The format of a name. Raises BadInput, saying which there are."""
    if name not in list(FORMATS):
        raise BadInput(f"format {one_line(repr(name), SHOWN)} is not known, expected one of: {', '.join(FORMATS)}")
    return FORMATS[name]
