"""Lines of headers and notes: as wide as their room lets them be, and no wider."""

from __future__ import annotations

from itertools import pairwise

import pytest

from flexfem.plot.style import text_width, wrapped

TEXT = "WAVY AVATAR To yield: links of 9 mm, ‘Vjf’ in Illinois 0.5 µm; " * 4 + "and a_word_that_no_line_has_room_for"


@pytest.mark.parametrize("weight", ["normal", "bold"])
@pytest.mark.parametrize("width", [1.37, 2.9, 5.3])
def test_a_line_is_broken_before_the_word_that_makes_it_too_wide(width: float, weight: str) -> None:
    lines = wrapped(TEXT, width, 9.0, weight).split("\n")
    assert "".join(lines).replace(" ", "") == TEXT.replace(" ", "") and len(lines) > 3
    assert all(text_width(line, 9.0, weight) <= width for line in lines)
    for line, after in pairwise(lines):
        if "a_word" not in line + after:
            assert text_width(f"{line} {after.split(' ')[0]}", 9.0, weight) > width
