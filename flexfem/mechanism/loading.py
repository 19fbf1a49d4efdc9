"""Load a file of any kind that describes a mechanism."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from flexfem.files.refusals import place_of
from flexfem.files.toml import PathLike, kind_of, read_toml
from flexfem.mechanism.mechanism import Mechanism
from flexfem.refused import BadInput

# module and function that read and check a file, by its kind; imported when one is loaded
READERS = {
    "stage file": ("flexfem.paper.stage", "load_feasible"),
    "mechanism file": ("flexfem.mechanism.mechanism_file", "load_mechanism"),
}
USUAL = "stage file"  # kind of a file whose keys fit several kinds


def load(path: PathLike) -> Mechanism:
    """Read and check a stage file or a mechanism file, whichever its keys show.

    Raises BadInput, one line with file, line, key and expected value.

    Examples
    --------
    >>> import flexfem
    >>> flexfem.load("geometry/mobility6.toml").chain.link_lengths
    (30.0, 32.0, 24.0)
    """
    kind = kind_of(read_toml(path).data, USUAL) or USUAL
    if kind not in READERS:
        raise BadInput(f"{place_of(path)}: this is a {kind}, expected a stage or mechanism file")
    module, reader = READERS[kind]
    read: Callable[[PathLike], Mechanism] = getattr(import_module(module), reader)
    return read(path)
