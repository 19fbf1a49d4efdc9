"""Figures under docs/ are of the numbers and inputs that are accepted now.

`docs/figures.json` says of each figure what it was drawn from: accepted numbers that it shows,
hashes of its inputs, and the hash of the picture itself, so that no other one stands in its place.
After a figure is drawn anew, `python -m tests.test_docs` in the root of the project writes them
down again; `make designs` draws those of the worked designs and does so, too."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
from functools import cache
from pathlib import Path

import pytest

from flexfem import load
from flexfem.design.requirements import load_requirements
from flexfem.files.writing import digest
from flexfem.paper.fixture import fixture_of
from flexfem.paper.stage import load_stage
from flexfem.study.loaded import load_study

ROOT = Path(__file__).parent.parent
PAGES = [*ROOT.glob("*.md"), *ROOT.glob("*/README.md"), *ROOT.glob("docs/*.md")]
MANIFEST = ROOT / "docs/figures.json"
SEEN = 5e-3  # of a number: less is a pixel or two


@cache
def accepted(stem):
    return json.loads((ROOT / f"tests/baselines/{stem}.json").read_text())["numbers"]


def now(source):
    """What a source of a figure is now: a number of a baseline, `fig5: errors.x`, or the hash of an
    input file.

    That of a stage with its drive is `geometry/one.toml: drive`, those of a picture or chart are
    their own names."""
    name, _, path = source.partition(": ")
    if name.endswith((".png", ".json")):
        return hashlib.sha256((ROOT / name).read_bytes()).hexdigest()[:16]
    if name.startswith("cases/fixture"):
        content = fixture_of(ROOT / name).model_dump_json(exclude={"provenance", "measured"})
        return hashlib.sha256(content.encode()).hexdigest()[:16]
    if path == "drive":
        return load_stage(ROOT / name).drive_hash[:16]
    if name.startswith("cases/design-"):
        found = load_requirements(ROOT / name)
        asked = found.requirements.model_dump(
            mode="json", exclude={"name", "mechanism", "provenance"}
        )
        return digest([asked, found.base.hash])[:16]
    if not path:
        return (load_study if "study-" in name else load)(ROOT / name).hash[:16]
    question, _, key = path.partition(".")
    return accepted(name)[question][key][0]


def stale(figure, sources):
    """The sources of a figure that are not what they were when it was drawn."""
    found = {source: (was, now(source)) for source, was in sources.items()}
    return [
        f"docs/{figure} was drawn of {source} = {was}, now {is_now}: draw it again"
        for source, (was, is_now) in found.items()
        if (was != is_now if isinstance(was, str) else is_now != pytest.approx(was, rel=SEEN))
    ]


def test_every_figure_of_the_pages_is_there_shown_and_of_what_is_accepted():
    manifest = json.loads(MANIFEST.read_text())
    linked = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in links(page)
        if link.endswith(".png")
    }
    linked = {
        path for path in linked if path.parent == ROOT / "docs"
    }  # below: those that are made with their page
    assert (
        linked == set((ROOT / "docs").glob("*.png")) == {ROOT / "docs" / name for name in manifest}
    )
    assert all(f"docs/{figure}" in sources for figure, sources in manifest.items())
    assert [line for figure, sources in manifest.items() for line in stale(figure, sources)] == []


def case_of(figure):
    """What a figure of a worked design that has no sources yet is of: its requirements file."""
    found = [
        f"cases/{path.name}"
        for path in (ROOT / "cases").glob("design-*.toml")
        if figure.startswith(path.stem)
    ]
    return dict.fromkeys(found)


def links(page):
    """Targets of the links and pictures of a page that are files, without the heading that they
    lead to.
    """
    found = [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text())]
    return [link for link in found if link and "://" not in link]


def test_every_link_of_a_page_leads_to_a_file():
    assert [
        f"{page.name}: {link}"
        for page in PAGES
        for link in links(page)
        if not (page.parent / link).exists()
    ] == []


def test_every_file_that_a_docstring_comment_or_page_names_exists():
    """But those that commands make, and names with a part to fill in."""
    pattern = re.compile(r"(?<![\w/{*.<~-])((?:[\w-]+/)+[\w-]+\.(?:py|md|toml|json|npz))\b")
    sources = [
        *(ROOT / "flexfem").rglob("*.py"),
        *ROOT.glob("benchmarks/*.py"),
        *ROOT.glob("*/*.toml"),
    ]
    pages = [*sources, *ROOT.glob("*.md"), *ROOT.glob("*/*.md")]
    named = {(page, name) for page in pages for name in pattern.findall(page.read_text())}
    named = {
        (page, name) for page, name in named if not re.search(r"^reports/|QUESTION|NAME", name)
    }
    places = {page: (ROOT, ROOT / "flexfem", page.parent) for page in pages}
    assert [
        each for each in named if not any((place / each[1]).exists() for place in places[each[0]])
    ] == []


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_nothing_that_is_ignored_is_kept_by_git():
    """A link `.venv` that is kept takes the place of the folder of that name wherever the commit is
    checked out.
    """
    listed = ["git", "ls-files", "--cached", "--ignored", "--exclude-standard"]
    assert subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout == ""


def test_a_figure_of_other_numbers_or_another_input_is_stale():
    (line,) = stale("fig5.png", {"fig5: errors.percent.mobility_six.x": 12.4})
    assert line.startswith(
        "docs/fig5.png was drawn of fig5: errors.percent.mobility_six.x = 12.4, now 12.537"
    )
    assert stale("fig5.png", {"fig5: errors.percent.mobility_six.x": 12.54}) == []
    assert len(stale("study-reach.png", {"cases/study-reach.toml": "0123456789abcdef"})) == 1


if __name__ == "__main__":
    kept = json.loads(MANIFEST.read_text())
    kept = {
        figure: {
            source: now(source) for source in {f"docs/{figure}": "", **(sources or case_of(figure))}
        }
        for figure, sources in kept.items()
    }
    MANIFEST.write_text(json.dumps(kept, indent=1) + "\n")
