"""What a search that was stopped has found so far: a line for every answer, each with its checksum."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from flexfem.files.writing import digest


class Store:
    """Answers, plain data, by the hash of their question; in a file when it has one, and only for this run else."""

    def __init__(self, path: Path | None) -> None:
        self.path, self._found = path, dict[str, Any]()
        lines: list[str] = []
        if path is not None:
            with suppress(OSError):
                lines = path.read_text(errors="replace").splitlines()
        for line in lines:
            checksum, _, content = line.partition(" ")
            if checksum == _checksum(content):
                question, answer = json.loads(content)
                self._found[question] = answer

    def answer(self, question: str) -> Any:
        """What is known, None else."""
        return self._found.get(question)

    def keep(self, question: str, answer: Any) -> None:
        """Add an answer; a folder that takes no file is told of when the results are written."""
        self._found[question] = answer
        content = json.dumps([question, answer])
        if self.path is None:
            return
        with suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab", buffering=0) as file:
                file.write(f"\n{_checksum(content)} {content}\n".encode())

    def found(self, asked: Any, counts: Counter[str], search: Callable[[], Any]) -> Any:
        """What `search`, or one before that was asked the same, found; `counts` grow as in that search.

        asked, and what `search` returns : plain data, lists and not tuples.
        """
        question, before = digest(asked), counts.copy()
        if (known := self.answer(question)) is not None:
            counts.update(known[1])
            return known[0]
        answer = search()
        self.keep(question, [answer, dict(counts - before)])
        return answer

    def forget(self) -> None:
        """Remove the file: the results are written."""
        if self.path is not None:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)


def _checksum(content: str) -> str:
    return hashlib.sha256(content.encode()).hexdigest()[:16]
