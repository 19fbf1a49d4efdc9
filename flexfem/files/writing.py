"""Write TOML that reads back exactly, Markdown tables, and files atomically."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import secrets
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from flexfem.arrays import AnyArray
from flexfem.files.inputs import require_unread, wrote
from flexfem.files.refusals import as_key, as_toml, place_of
from flexfem.refused import BadInput

FILE_ENDINGS = (  # of files that flexfem or others write
    *(
        ".bmp",
        ".csv",
        ".dxf",
        ".gif",
        ".html",
        ".inp",
        ".jpeg",
        ".jpg",
        ".json",
        ".mat",
        ".md",
        ".msh",
        ".npz",
    ),
    *(
        ".parquet",
        ".pdf",
        ".png",
        ".step",
        ".stp",
        ".svg",
        ".toml",
        ".txt",
        ".vtk",
        ".vtu",
        ".xlsx",
    ),
)
LONGEST_NAME = 240  # bytes; file systems take 255, and the name of the temporary file is longer
NO_FLUSH = (errno.EINVAL, errno.ENOTSUP)  # of file systems that cannot flush a folder


def toml_text(content: Mapping[str, Any]) -> str:
    """Return nested tables of numbers, texts, booleans and arrays as TOML."""
    return "\n".join(_lines(content, "")).strip() + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    tables = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    lists = {
        key: value for key, value in table.items() if isinstance(value, list | tuple) and value
    }
    arrays = {
        key: value
        for key, value in lists.items()
        if all(isinstance(item, Mapping) for item in value)
    }
    for key, value in table.items():
        if key not in tables and key not in arrays:
            yield f"{as_key(key)} = {as_toml(value)}"
    for key, value in tables.items():
        if not all(isinstance(inner, Mapping) for inner in value.values()) or not value:
            yield f"\n[{path}{as_key(key)}]"
        yield from _lines(value, f"{path}{as_key(key)}.")
    for key, values in arrays.items():
        for value in values:
            yield f"\n[[{path}{as_key(key)}]]"
            yield from _lines(value, f"{path}{as_key(key)}.")


def markdown_table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    align: str = "",
) -> str:
    """Return a table in Markdown without a final line end.

    `align` has l or r for each column, default l.
    """
    rule = ["---:" if side == "r" else "---" for side in align.ljust(len(head), "l")]
    lines = [head, rule, *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(
        "|" + "".join(f" {cell} |" if cell else " |" for cell in line) for line in lines
    )


def check_folder(folder: Path, written: bool = True) -> None:
    """Raise BadInput where a file is in the place of a folder, or the folder to be `written` is
    read-only.

    A new folder with the name of a file, such as picture.png, is a mistake: files in a folder are
    named by flexfem.
    """
    with _refused(folder):
        for place in (folder, *folder.parents):
            if place.is_dir():
                if written and not os.access(place, os.W_OK):
                    raise BadInput(
                        f"{place_of(folder)}: no permission to write in {place_of(place)}"
                    )
                return
            if place.suffix.lower() in FILE_ENDINGS and not place.exists():
                hint = "the files in it are named after the input"
                raise BadInput(
                    f"{place_of(place)}: the name of a file, expected the name of a folder: {hint}"
                )
            if place.exists() or place.is_symlink():
                raise BadInput(
                    f"{place_of(folder)}: {place_of(place)} is a file, expected a folder"
                )


def check_file(path: Path, *read: Path) -> None:
    """Raise BadInput for an output file that the user has named: as `check_name`, or its folder
    cannot take it.
    """
    check_name(path, *read)
    if not path.parent.is_dir():
        raise BadInput(
            f"{place_of(path)}: no folder {place_of(path.parent)}, expected an existing folder"
        )
    check_folder(path.parent)


def check_name(path: Path, *read: Path) -> None:
    """Raise BadInput for an output file that is a folder, has too long a name, or is one of the
    inputs (`read`).
    """
    with _refused(path):
        if path.is_dir():
            raise BadInput(f"{place_of(path)}: is a folder, expected a file")
        if len(os.fsencode(path.name)) > LONGEST_NAME:
            raise BadInput(
                f"{place_of(path)}: a name of more than {LONGEST_NAME} bytes, expected a shorter "
                "one"
            )
    require_unread(path, read=read)


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Turn errors of the system about a path into BadInput."""
    try:
        yield
    except OSError as error:
        raise BadInput(f"{place_of(path)}: cannot be written: {error.strerror or error}") from None


@contextmanager
def replacing(
    path: Path,
    suffix: str | None = None,
    again: bool = False,
) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, and move it to `path` when no error occurred.

    The file is on the disk before it replaces an older one, and the folder when this ends: whenever
    power fails, `path` is the old file or the new one as a whole.

    Parameters
    ----------
    suffix : extension of the temporary path, by default that of `path`; some writers choose the
    format by it.
    again : the file belongs to flexfem, which may have read it before.

    Raises BadInput when the file cannot be written, or is an input of the command.
    """
    if not again:
        require_unread(path)
    beside = path.with_name(f".{path.stem}-{secrets.token_hex(6)}{suffix or path.suffix}")
    with _refused(path):
        _make_folder(path.parent)
        try:
            os.close(os.open(beside, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))  # less the umask
            yield beside
            _flush(beside)
            beside.replace(path)
            wrote(path)
            _flush_folder(path.parent)
        finally:
            beside.unlink(missing_ok=True)


def _make_folder(folder: Path) -> None:
    """Make a folder and those above it, each entered in its parent on the disk."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for place in missing:
        _flush_folder(place.parent)


def _flush(path: Path) -> None:
    """Wait until the content of a file or folder is on the disk."""
    access = os.O_RDONLY if path.is_dir() else os.O_RDWR  # Windows flushes what it may write
    handle = os.open(path, access)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _flush_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk, where the system can flush folders."""
    if os.name != "posix":
        return
    try:
        _flush(folder)
    except OSError as error:
        if error.errno not in (
            *NO_FLUSH,
            errno.EACCES,
        ):  # a folder that may be written but not read
            raise


def write_atomically(
    path: Path,
    write: Callable[[BinaryIO], object],
    again: bool = False,
) -> None:
    """Write a file atomically by a function of the open file. Raises BadInput as `replacing`."""
    with replacing(path, ".tmp", again) as temporary, temporary.open("wb") as file:
        write(file)


def read_arrays(path: Path, what: str) -> dict[str, AnyArray]:
    """Return the arrays of an .npz file by name.

    Raises BadInput, naming the expected content `what`.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except OSError as error:
        raise BadInput(f"{path}: expected {what}: {error.strerror or 'cannot be read'}") from None
    except (ValueError, EOFError, zipfile.BadZipFile, zlib.error):
        raise BadInput(f"{path}: expected {what}: not an .npz file, or a damaged one") from None


def digest(content: Any) -> str:
    """Return the SHA-256 of plain data as JSON."""
    text = json.dumps(
        content,
        sort_keys=True,
        separators=(",", ":"),
        allow_nan=False,
    )
    return hashlib.sha256(text.encode()).hexdigest()


def digest_of_arrays(arrays: Mapping[str, AnyArray]) -> str:
    """Return the SHA-256 of named arrays with their types and shapes."""
    found = hashlib.sha256()
    for name in sorted(arrays):
        found.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        found.update(np.ascontiguousarray(arrays[name]).tobytes())
    return found.hexdigest()


def canonical(value: Any) -> Any:
    """Return plain data with numbers as floats, -0.0 as 0.0, and tuples as lists."""
    if isinstance(value, dict):
        return {key: canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    if isinstance(value, bool | str) or value is None:
        return value
    return float(value) + 0.0
