"""Comparison of analytic models with finite elements, for files of several kinds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from flexfem.files.refusals import checked_path
from flexfem.files.toml import kind_of, read_toml
from flexfem.files.writing import check_folder, check_name
from flexfem.importing.drawings import NO_READING, Reading, imported, is_drawing
from flexfem.lazy import named
from flexfem.mechanism.mechanism import Mechanism
from flexfem.mechanism.mechanism_file import MechanismFile, load_mechanism
from flexfem.questions.errors import errors_of
from flexfem.questions.setup import elements_through, question
from flexfem.refused import BadInput
from flexfem.results import Progress, Result

# what reads a file that is no mechanism file, imported when one is read
CASE = "paper.verification.load_comparison"


class Verifiable(Protocol):
    """What a file loads as, which states its own errors."""

    def errors(self, layers: int | None) -> Result:
        """Return the errors of the analytic models; layers : as of `errors_of`."""
        ...


class VerifiableMechanism(NamedTuple):
    """The comparison of the models of a mechanism."""

    mechanism: Mechanism

    def errors(self, layers: int | None) -> Result:
        """Return the errors of the analytic networks."""
        return errors_of(self.mechanism, layers)


@question
def verification(
    *cases: Path,
    output: Path | None = Path("reports"),
    solid: bool = False,
    thickness_resolution: int | None = None,
    reading: Reading = NO_READING,
    progress: Progress | None = None,
) -> list[Result]:
    """Compute the positioning error of the analytic model of cases or mechanisms by finite
    elements.

    Parameters
    ----------
    *cases : Path
        Case files, see flexfem schema case, or mechanism files or drawings: their errors for
        commands in x, y and theta.
    output : Path, optional
        Folder for the results; `flexfem plot` draws those of cases. In Python, None stores none.
    solid : bool
        Compare mechanisms with finite elements of the whole plate in three dimensions; a case
        states this itself.
    reading : Reading
        Of drawings: thickness, material, ground, output and so on.
    thickness_resolution : int, optional
        With `solid`, layers of elements in half of the thickness, from 3.
    progress : callable, optional
        Called with a line of text after each completed part.

    Returns
    -------
    list[Result]
        Every number has the unit that its quantity declares: `unit` returns it, and `flexfem schema
        KIND` lists it.

    Raises
    ------
    BadInput
        The mechanism cannot be made, or an option or a file is not valid.
    ComputationFailed
        The mechanism is singular, or a mesh or a solution does not pass its checks.
    """
    layers = elements_through(solid, thickness_resolution)
    folder = None if output is None else checked_path(output)
    paths = [checked_path(path) for path in cases]
    if folder is not None:
        check_folder(folder)
    # all files are read before the first computation
    comparisons = [_loaded(path, reading, solid) for path in paths]
    _check_names(paths, folder)
    results = list[Result]()
    for path, comparison in zip(paths, comparisons, strict=True):
        found = comparison.errors(layers)
        results.append(found)
        if folder is not None:
            found.write(folder / f"{path.stem}.json")
        if progress is not None:
            progress(path.stem)
    return results


def _loaded(
    path: Path,
    reading: Reading,
    solid: bool,
) -> Verifiable:
    """Read a mechanism, a drawing or a case. Raises BadInput."""
    if is_drawing(path):
        return VerifiableMechanism(imported(path, reading).mechanism)
    if kind_of(read_toml(path).data) == MechanismFile.kind:
        return VerifiableMechanism(load_mechanism(path))
    comparison: Verifiable = named(CASE)(path, solid)
    return comparison


def _check_names(paths: Sequence[Path], folder: Path | None) -> None:
    """Raise BadInput for results that would overwrite each other, or cannot be written."""
    seen = dict[str, Path]()
    for path in paths:
        other = seen.setdefault(path.stem, path)
        if other != path:
            raise BadInput(
                f"{path}: its results would overwrite those of {other}, expected another name"
            )
        if folder is not None:
            check_name(folder / f"{path.stem}.json")
            check_name(folder / f"{path.stem}.npz")
