"""Files of a result: all of them in a folder, or the one whose name a user states."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flexfem.refused import BadInput

IN_A_FOLDER = (".json", ".png", ".pdf", ".vtu", ".npz", ".mat")  # endings of files of a result
PICTURES = (".png", ".pdf")
ALWAYS = (".csv", ".json", ".html")  # every result can be written as these
FIELDS = ".vtu"
ENDINGS = (*ALWAYS, *PICTURES, FIELDS)


def is_file(path: Path) -> bool:
    """Return whether a stated output is the name of one file of a result, and not of a folder."""
    return path.suffix.lower() in ENDINGS and not path.is_dir()


def check_output(path: Path | None) -> Path | None:
    """Return an output that is usable as a folder or as a file. Raises BadInput."""
    from flexfem.files.writing import check_file, check_folder

    if path is None:
        return None
    if is_file(path):
        check_file(path)
    elif path.suffix[1:].isalpha() and not path.exists():
        raise BadInput(
            f"{path}: ends in {path.suffix}, expected {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}, "
            "or the name of a folder"
        )
    else:
        check_folder(path)
    return path


def check_ending(path: Path | None, kind: Any) -> None:
    """Refuse the name of a file that no result of a kind can give, before any computation."""
    if path is None or not is_file(path):
        return
    endings = list(ALWAYS)
    if kind.figure:
        endings += PICTURES
    if kind.has_mesh_fields:
        endings.append(FIELDS)
    ending = path.suffix.lower()
    if ending in endings:
        return
    what = "field of finite elements" if ending == FIELDS else "figure"
    raise BadInput(
        f"{path}: no {what} of {kind.title}, expected a name that ends in "
        f"{', '.join(endings[:-1])} or {endings[-1]}, or a folder"
    )


def lacking(found: Any, output: Path) -> str:
    """Return a refusal of a stated output that a result cannot give, which is empty otherwise."""
    ending = output.suffix.lower()
    what = ""
    if ending == FIELDS and not hasattr(found.fields, "write_vtu"):
        what = "field of finite elements"
    if ending in PICTURES and not _has_figure(found):
        what = "figure"
    if not what or not is_file(output):
        return ""
    return (
        f"{output}: this result has no {what}, expected finite elements (and of a stiffness "
        "a load), or a name that ends in .csv, .json or .html"
    )


def write(
    found: Any,
    output: Path,
    stem: str,
) -> list[Path]:
    """Write a result to a folder, as files with this stem, or to the file that is named.

    Returns the paths. Raises BadInput when a file cannot be written, when the result cannot give
    it, or when an input file of the command would be replaced.
    """
    if not is_file(output):
        return _write_all(found, output / f"{stem}.json")
    from flexfem.files.writing import check_name

    check_name(output)
    ending = output.suffix.lower()
    make = {
        ".csv": _csv,
        ".json": _json,
        ".html": _html,
        FIELDS: _fields,
    }.get(ending, _picture)
    return make(found, output)


def _write_all(found: Any, path: Path) -> list[Path]:
    """Write the document, the figures and the fields of a result beside each other."""
    from flexfem.files.writing import check_name

    for ending in IN_A_FOLDER:
        check_name(path.with_suffix(ending))
    paths = [found.write(path)]
    if _has_figure(found):
        from flexfem.plot.write import write_of_result

        paths += write_of_result(found, path)
    if hasattr(found.fields, "write"):
        paths += found.fields.write(path)
    return paths


def _has_figure(found: Any) -> bool:
    return bool(found.figure) and (found.fields is not None or not found.drawn_from_fields)


def _csv(found: Any, path: Path) -> list[Path]:
    from flexfem.plot.write import write_text

    return [write_text(path, found.to_csv())]


def _json(found: Any, path: Path) -> list[Path]:
    return [found.write(path)]


def _html(found: Any, path: Path) -> list[Path]:
    from html import escape

    from flexfem.lazy import named
    from flexfem.plot.write import write_text

    if found.page:
        return [write_text(path, named(found.page)(found))]
    head = f'<meta charset="utf-8"><title>{escape(found.heading())}</title>'
    style = "<style>body { font-family: sans-serif; margin: 2em } td, th { padding: 0 1em 0 0 }"
    style += (
        " @media (prefers-color-scheme: dark) { body { background: #111; color: #eee } }</style>"
    )
    page = f'<!doctype html><html lang="en"><head>{head}{style}</head><body>'
    return [write_text(path, f"{page}{found._repr_html_()}</body></html>\n")]


def _fields(found: Any, path: Path) -> list[Path]:
    found.fields.write_vtu(path)
    return [path]


def _picture(found: Any, path: Path) -> list[Path]:
    """Write the first figure of a result; those that are films need a folder."""
    from flexfem.plot import figures_of
    from flexfem.plot.write import write_picture

    figures = [each for each in figures_of(found).values() if not callable(each)]
    if not figures:
        raise BadInput(f"{path}: this result has no single figure, expected a folder")
    return [write_picture(path, figures[0])]
