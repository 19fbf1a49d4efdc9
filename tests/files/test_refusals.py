"""What refusals show of a file: short, on one line, and no more than was asked."""

from __future__ import annotations

from flexfem.files.refusals import one_line, shown


def test_what_is_shown_is_clipped_to_its_length_with_three_points() -> None:
    assert one_line("abcdefghij", 10) == "abcdefghij"
    assert one_line("abcdefghijk", 10) == "abcdefg..."
    assert one_line("abcdefgh\n\n", 10) == "abcdefg..."  # escapes are longer than what they stand for
    assert shown("x" * 80) == '"' + 56 * "x" + "..." and len(shown(list(range(50)))) == 60
    assert one_line("a\tb") == "a\\tb"
