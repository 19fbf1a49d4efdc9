"""What a live page shows of a file: its numbers, the answers to changed ones, and what is wrong."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from flexfem.files.provenance import assumptions_said
from flexfem.files.toml import PathLike
from flexfem.importing.drawings import is_drawing, load
from flexfem.live.answers import PlateDrawing, Row, drawing_of, rows_by_model
from flexfem.live.numbers import Slider, changed, is_in_file, save, sliders_of
from flexfem.mechanism.mechanism import Mechanism
from flexfem.questions.handling import Handled, handled
from flexfem.refused import BadInput, ComputationFailed, line_of

AROUND = 3  # lines of the file that are shown before and after one at fault


class Fault(NamedTuple):
    """What is wrong: a line of text, the number of the line at fault, and lines around it.

    line : None where the fault is at no line of the file.   lines : with their numbers.
    """

    text: str
    line: int | None
    lines: list[tuple[int, str]]


class LiveAnswer(NamedTuple):
    """The answer to one set of numbers: drawing, key results, and how long they took, s.

    handled : the drawing that a hand moves; without one, `drawing` is a plain one.
    """

    values: dict[str, float]
    drawing: PlateDrawing | None
    handled: Handled | None
    rows: list[Row]
    doubts: list[str]
    seconds: float


class Session:
    """One file: the mechanism as it is stored, the one that sliders have made, and the last answer.

    `mechanism` is the changed one, and stays the last one that could be answered. `asked` are the
    numbers that sliders show, by key path, which may have no answer.
    """

    def __init__(
        self,
        path: PathLike,
        reading: Any,
    ) -> None:
        self.path = Path(path)
        self.reading = reading
        self.stored: Mechanism
        self.sliders: list[Slider]
        self.mechanism: Mechanism
        self.answer: LiveAnswer
        self.asked = dict[str, float]()
        self.read_at: Any = None
        self._fault_of_file: Fault | None = None
        self._fault_of_numbers: Fault | None = None
        self._read()

    @property
    def title(self) -> str:
        """Name of the mechanism."""
        return self.stored.name

    @property
    def fault(self) -> Fault | None:
        """What is wrong with the file, which remains while sliders move, or with their numbers."""
        return self._fault_of_file or self._fault_of_numbers

    @property
    def can_save(self) -> bool:
        """Whether numbers can be written into the file: a drawing has none."""
        return not is_drawing(self.path)

    @property
    def moved(self) -> dict[str, float]:
        """The numbers by key path that differ from those of the file."""
        of_file = self._of_file
        return {path: value for path, value in self.asked.items() if value != of_file.get(path)}

    @property
    def _of_file(self) -> dict[str, float]:
        return {slider.path: slider.value for slider in self.sliders}

    def stamp(self) -> Any:
        """Return what changes when the file is written; None where there is no file."""
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_size

    def reload(self) -> None:
        """Read the file again. What is wrong with it becomes the fault; the answer then stays.

        Numbers that sliders have moved stay moved, but for those that the file has changed.
        """
        before = self._of_file
        moved = self.moved
        try:
            self._read()
        except (BadInput, ComputationFailed) as refused:
            self._fault_of_file = fault_of(refused, self.path)
            return
        now = self._of_file
        kept = {path: value for path, value in moved.items() if now.get(path) == before.get(path)}
        if kept:
            self.change(now | kept)

    def change(self, values: Mapping[str, float]) -> None:
        """Answer other numbers. What is wrong with them becomes the fault; the answer then stays."""
        before = self.asked
        self.asked = {**self._of_file, **values}
        try:
            self._answer(changed(self.stored, values), values)
        except (BadInput, ComputationFailed) as refused:
            text = line_of(refused)
            for slider in self.sliders:
                if self.asked[slider.path] != before.get(slider.path):
                    value = f"{self.asked[slider.path]:g} {slider.unit}".rstrip()
                    text = f"{slider.name} {value}: {text.removeprefix(self._changed_place)}"
            self._fault_of_numbers = Fault(text, None, [])

    @property
    def _changed_place(self) -> str:
        """What a refusal of changed numbers begins with."""
        return f"{self.path}, changed: "

    def save(self) -> list[str]:
        """Write the moved numbers into the file; return their paths.

        What an editor has written since the file was read stays, and comes first. Raises BadInput
        for a drawing, and while something is wrong with the file or the numbers.
        """
        if not self.can_save:
            raise BadInput(
                f"{self.path}: a drawing has no numbers, expected a mechanism file: flexfem import"
            )
        if self.stamp() != self.read_at:
            self.reload()
        if self.fault is not None:
            raise BadInput(f"nothing was saved: {self.fault.text}")
        written = save(self.path, self.moved)
        self.reload()
        return written

    def _read(self) -> None:
        self.read_at = self.stamp()
        stored = load(self.path, self.reading)
        sliders = sliders_of(stored)
        if self.can_save:
            sliders = [slider for slider in sliders if is_in_file(self.path, slider.path)]
        values = {slider.path: slider.value for slider in sliders}
        self._answer(stored, values)
        self.stored = stored
        self.sliders = sliders
        self.asked = values
        self._fault_of_file = None

    def _answer(
        self,
        mechanism: Mechanism,
        values: Mapping[str, float],
    ) -> None:
        began = perf_counter()
        moved = handled(mechanism)
        drawing = drawing_of(mechanism.layout) if moved is None else None
        rows = rows_by_model(mechanism, "analytic")
        doubts = assumptions_said(mechanism.assumed, mechanism.not_stated)
        self.answer = LiveAnswer(dict(values), drawing, moved, rows, doubts, perf_counter() - began)
        self.mechanism = mechanism
        self._fault_of_numbers = None


def fault_of(refused: Exception, path: Path | None) -> Fault:
    """Return what a refusal says, with the lines of the file around the one that it names."""
    text = line_of(refused)
    named = re.match(r".*?, line (\d+): ", text) if path is not None else None
    if named is None or path is None:
        return Fault(text, None, [])
    line = int(named[1])
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return Fault(text, None, [])
    first = max(line - AROUND, 1)
    shown = list(enumerate(lines[first - 1 : line + AROUND], first))
    return Fault(text, line, shown)
