"""Links to pages beside the code, as a Git forge follows them, lead to the page here that shows them."""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

SHOWN = {
    "README.md": "front",
    "CONVENTIONS.md": "conventions",
    "CHANGELOG.md": "changelog",
    "geometry/README.md": "files/stages",
    "cases/README.md": "files/cases",
}


def lead_inside(app: Sphinx, doctree: nodes.document) -> None:
    """Turn downloads of such pages into links to documents."""
    root = Path(app.srcdir).parent
    for node in list(doctree.findall(addnodes.download_reference)):
        found = (Path(app.srcdir) / node["reftarget"].lstrip("/")).resolve()
        beside = (Path(doctree["source"]).parent / node["reftarget"]).resolve()
        for place in (beside, found):
            name = str(place.relative_to(root)) if place.is_relative_to(root) else ""
            if name in SHOWN:
                link = addnodes.pending_xref(
                    refdomain="std", reftype="doc", refexplicit=True, refwarn=True, refdoc=app.env.docname,
                    reftarget=f"/{SHOWN[name]}",
                )  # fmt: skip
                link += nodes.inline("", node.astext(), classes=["doc"])
                node.replace_self(link)
                break


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", lead_inside)
    return {"parallel_read_safe": True}
