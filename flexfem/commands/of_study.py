"""The one file of a study that `--output` names: its table, numbers, page or figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexfem.refused import BadInput
from flexfem.study import REPORTS

if TYPE_CHECKING:
    from flexfem.studies import StudyFindings

TABLES = (".csv", ".parquet")
PICTURES = (".png", ".pdf")
ENDINGS = (*TABLES, ".json", ".html", *PICTURES)
OF_FILES = ("run", "plot")  # commands that write the named file
OF_STUDIES = "flexfem.studies"  # module of the functions of `flexfem study`


def taken_file(name: str, given: dict[str, Any]) -> Path | None:
    """Return the file that `--output` of a command on studies names, None where it is a folder.

    The results are then in the default folder, or in that of the stated results. Raises BadInput
    for a file that the command cannot write.
    """
    path = given.get("output")
    if not isinstance(path, Path) or path.is_dir() or not path.suffix[1:].isalpha():
        return None
    if name == "collect" and path.suffix.lower() in TABLES:
        given |= {"to": path, "output": REPORTS}
        return None
    if name not in OF_FILES:
        return None
    if path.suffix.lower() not in ENDINGS:
        raise BadInput(
            f"{path}: ends in {path.suffix}, expected {', '.join(ENDINGS[:-1])} or {ENDINGS[-1]}, "
            "or the name of a folder"
        )
    from flexfem.files.writing import check_file

    check_file(path)
    given["output"] = REPORTS
    if name == "run":
        given["no_figures"] = True
    return path


def is_done(facts: Any) -> bool:
    """Return whether all designs of a study are computed, and some have a result."""
    return bool(facts["ok"]) and not (facts["open"] or facts["open_elsewhere"])


def write_study(
    study: Path,
    path: Path,
    partial: bool = False,
) -> list[Path]:
    """Write a study, or the folder of its results, to a file; return what is written.

    Pictures are one file for each figure. partial : leave out unfinished designs. Raises BadInput.
    """
    from flexfem import studies

    ending = path.suffix.lower()
    if ending == ".html":
        return [_written_page(study, path)]
    if ending in TABLES:
        studies.collect_study(study, to=path, partial=partial)
        return [path]
    found = studies.study_findings(study, partial=partial)
    if ending == ".json":
        return [_written_numbers(found, path)]
    return _written_pictures(found, path)


def _written_page(study: Path, path: Path) -> Path:
    from flexfem import studies
    from flexfem.page.report import report

    parts = studies.parts_of(study)
    report(parts.loaded.path, path, folder=parts.folder.parents[1])
    return path


def _written_numbers(found: StudyFindings, path: Path) -> Path:
    from flexfem import studies
    from flexfem.files.writing import write_atomically

    numbers = {name: studies.facts_of(record) for name, record in found.found.items()}
    text = json.dumps(numbers, indent=1, ensure_ascii=False).encode()
    write_atomically(path, lambda file: file.write(text))
    return path


def _written_pictures(found: StudyFindings, path: Path) -> list[Path]:
    from flexfem.plot.write import write_picture

    figures = found.figures()
    if not figures:
        raise BadInput(f"{path}: this study has no figure, expected .csv, .json or .html")
    others = [path.with_stem(f"{path.stem}-{number}") for number in range(2, len(figures) + 1)]
    pairs = zip([path, *others], figures.values(), strict=True)
    return [write_picture(target, figure) for target, figure in pairs]
