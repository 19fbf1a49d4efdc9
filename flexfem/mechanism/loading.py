"""Load a file of any kind that describes a mechanism."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple

from flexfem.files.refusals import place_of
from flexfem.files.toml import PathLike, kind_of, read_toml
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.unfinished import Unfinished
from flexfem.refused import BadInput


class Kind(NamedTuple):
    """What reads a kind of file: module in `flexfem` and name, imported when one is read.

    content : the class that validates the content of a file.
    reader : a function of a path that reads and checks a file.
    drawer : a function of a path that reads what can be drawn of a file.
    """

    content: str
    reader: str
    drawer: str


KINDS = {
    "stage file": Kind(
        content="paper.stage:Stage",
        reader="paper.stage:load_feasible",
        drawer="paper.stage:read_unchecked",
    ),
    "mechanism file": Kind(
        content="mechanism.mechanism_file:MechanismFile",
        reader="mechanism.mechanism_file:load_mechanism",
        drawer="mechanism.unfinished:read_drawable",
    ),
}
USUAL = "mechanism file"  # kind of a file whose keys fit several kinds


def load(path: PathLike) -> Mechanism:
    """Read and check a stage file or a mechanism file, whichever its keys show.

    Raises BadInput, one line with file, line, key and expected value.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.load("geometry/mobility6.toml").chain.link_lengths
    (30.0, 32.0, 24.0)
    """
    kind = _kind_of_file(path)
    mechanism: Mechanism = _found(kind.reader)(path)
    return mechanism


def read_drawable(path: PathLike) -> Unfinished:
    """Read what can be drawn of a file, which need not be finished. Raises BadInput."""
    kind = _kind_of_file(path)
    found: Unfinished = _found(kind.drawer)(path)
    return found


def mechanism_of(content: Mapping[str, Any]) -> Mechanism:
    """Return the mechanism of the content of a file. Raises pydantic's ValidationError."""
    kind = KINDS[kind_of(content, USUAL) or USUAL]
    mechanism: Mechanism = _found(kind.content).model_validate(content)
    return mechanism


def _kind_of_file(path: PathLike) -> Kind:
    """Return the kind of a file by its keys. Raises BadInput for one without a mechanism."""
    name = kind_of(read_toml(path).data, USUAL) or USUAL
    if name not in KINDS:
        raise BadInput(f"{place_of(path)}: this is a {name}, expected a mechanism or stage file")
    return KINDS[name]


def _found(name: str) -> Any:
    """Return what a module has by a name, both in a text such as "paper.stage:Stage"."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(f"flexfem.{module}"), attribute)
