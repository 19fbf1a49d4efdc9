"""Links that a Git forge follows out of docs/ lead to the page here that shows the same; absent
pages are left out.
"""

from __future__ import annotations

import re
from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

SHOWN = {
    "README": "front",
    "examples": "gallery/index",
    "CONVENTIONS": "conventions",
    "CHANGELOG": "changelog",
    "geometry/README": "files/stages",
    "cases/README": "files/cases",
}


def lead_inside(app: Sphinx, doctree: nodes.document) -> None:
    """Turn links to such files into links to documents."""
    root = Path(app.srcdir).parent
    for node in doctree.findall(addnodes.pending_xref):
        if node.get("reftype") == "myst":
            target = str(node["reftarget"]).removesuffix(".md")
            shown = SHOWN.get(target.removeprefix(f"{root.as_posix()}/"))
            if shown:
                node["refdomain"] = "doc"
                node["reftarget"] = shown
                node["reftargetid"] = None


def leave_out(app: Sphinx, docname: str, source: list[str]) -> None:
    """Drop from the index what is not there: pages that are made by others, or not yet."""
    if docname == "index":
        pages = re.compile(r"^[\w/*-]+\n", re.MULTILINE)
        source[0] = pages.sub(
            lambda page: page[0] if any(Path(app.srcdir).glob(f"{page[0].strip()}.*")) else "",
            source[0],
        )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", lead_inside)
    app.connect("source-read", leave_out)
    return {"parallel_read_safe": True}
