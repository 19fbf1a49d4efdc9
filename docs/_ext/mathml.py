"""Equations as MathML, which browsers draw without a script: pages read as well from a disk as from
a server.

A number of an equation is written `\\tag{16}`, as TeX has it, and stands at the right.
"""

from __future__ import annotations

import html
import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

TAG = re.compile(r"\\tag\{([^}]*)\}")


def equation(source: str, display: str) -> tuple[str, str]:
    """MathML of an equation in TeX, and its number, empty where it has none."""
    numbers = TAG.findall(source)
    return convert(TAG.sub("", source).strip(), display=display), ", ".join(
        f"({number})" for number in numbers
    )


def visit_inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(equation(node.astext(), "inline")[0])
    raise nodes.SkipNode


def visit_display(self: HTML5Translator, node: nodes.math_block) -> None:
    drawn, number = equation(node.astext(), "block")
    anchor = f' id="equation-{html.escape(number.strip("()"))}"' if number else ""
    self.body.append(
        f'<div class="equation"{anchor}>{drawn}<span class="number">{html.escape(number)}</span></div>\n'
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_display, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
