"""What the name of a layer says about its curves.

They are marks of the ground, the output or screws, remarks, or metal."""

from __future__ import annotations

import re

REMARKS = re.compile(
    r"(?<![a-z])(dims?|dimension\w*|texts?|anno\w*|hidden|cent(er|re)([ _-]?(lines?|marks?))?"
    r"|axis|axes|construction|hatch\w*|notes?|title\w*|defpoints|wire[ _-]?path|tool[ _-]?path"
    r"|phantom|leaders?|viewports?)(?![a-z])",
    re.IGNORECASE,
)
MARKS = re.compile(
    r"(?<![a-z])(ground\w*|clamp\w*|fixed|fix|fixtures?|frame|anchor\w*|output\w*|stage"
    r"|platform|end[ _-]?effector|inputs?|actuators?|loads?|forces?)(?![a-z])",
    re.IGNORECASE,
)
GROUND = re.compile(
    r"(?<![a-z])(ground\w*|clamp\w*|fixed|fix|fixtures?|frame|anchor\w*)(?![a-z])", re.IGNORECASE
)
OUTPUT = re.compile(
    r"(?<![a-z])(output\w*|stage|platform|end[ _-]?effector)(?![a-z])", re.IGNORECASE
)
SCREWS = re.compile(
    r"(?<![a-z])(screws?|bolts?|holes?|drill\w*|threads?|taps?|tapped)(?![a-z])", re.IGNORECASE
)


def is_remark(layer: str) -> bool:
    """Whether the curves of a layer are no edges of metal.

    They are dimensions, texts, centre lines or paths of a tool.
    """
    return REMARKS.search(layer) is not None


def is_mark(layer: str) -> bool:
    """Whether a layer marks the ground, the output or what acts on the part.

    Its curves need not be edges of metal.
    """
    return MARKS.search(layer) is not None


def is_ground(layer: str) -> bool:
    """Whether a layer marks what is fixed."""
    return GROUND.search(layer) is not None


def is_output(layer: str) -> bool:
    """Whether a layer marks the output."""
    return OUTPUT.search(layer) is not None


def is_screws(layer: str) -> bool:
    """Whether a layer has holes for screws: edges of metal, and marks."""
    return SCREWS.search(layer) is not None
