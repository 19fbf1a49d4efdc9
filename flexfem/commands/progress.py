"""How far a run is, for whoever watches: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from flexfem.commands.at_work import EVERY
from flexfem.commands.streams import raw
from flexfem.study.content import RETRIED
from flexfem.study.run import Progress as Step

SHOWN = 10  # reasons of a status


@contextmanager
def watching() -> Iterator[Callable[[Step], None]]:
    """Yield a function that shows on standard error how far a run is."""
    console = Console(file=raw(sys.stderr))
    began = time.monotonic()
    if console.is_terminal:
        columns = (BarColumn(), TextColumn("{task.description}", markup=False))
        with Progress(*columns, console=console, transient=True) as bar:
            task = bar.add_task("", total=None)

            def draw(step: Step) -> None:
                text = said(step, time.monotonic() - began)
                bar.update(task, total=step.designs, completed=step.counts.total(), description=text)

            yield draw
        return
    latest = began

    def line(step: Step) -> None:
        nonlocal latest
        if time.monotonic() - latest > EVERY:
            latest = time.monotonic()
            print(said(step, latest - began), file=sys.stderr, flush=True)

    yield line


def said(step: Step, seconds: float) -> str:
    """One line on a run that has gone on for `seconds`: done, rate, time left, failed."""
    done = step.counts.total()
    failed = sum(n for (status, _), n in step.counts.items() if status in RETRIED)
    rate = (done - step.known) / seconds if seconds > 0 else 0.0
    left = f"{_duration((step.designs - done) / rate)} left" if rate > 0 else "waiting for the first"
    return f"{done:,}/{step.designs:,} designs, {rate:,.{0 if rate > 10 else 2}f}/s, {left}, {failed:,} failed"


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {seconds:02d} s" if minutes else f"{seconds} s"


def print_cleaned(facts: dict[str, Any]) -> None:
    """Print what `study clean` found."""
    for one in facts["stale"]:
        print(f"{one['parts']:,} parts of {one['study']}, hash {one['hash'][:8]}: {size_of(one['bytes'])}")
    total = f"{sum(one['parts'] for one in facts['stale']):,} stale parts"
    print(f"{total} removed" if facts["removed"] else f"{total}; nothing removed")


def size_of(count: int) -> str:
    """Bytes in a unit that suits them."""
    value, units = float(count), ["B", "kB", "MB", "GB"]
    while value >= 1000 and len(units) > 1:
        value, units = value / 1000, units[1:]
    return f"{value:.3g} {units[0]}"


def print_status(facts: dict[str, Any]) -> None:
    """Print what `study run` and `study status` found."""
    from flexfem.mechanism.stage_file import doubts_said

    share = f", share {facts['shard']}" if facts.get("shard", "1/1") != "1/1" else ""
    elsewhere = f", {facts['open_elsewhere']:,} in other shares" if share else ""
    print(f"{facts['name']}{share}: {facts['designs']:,} designs, {facts['open']:,} open{elsewhere}")
    print(f"done {facts['done']:,}: {facts['ok']:,} ok, {facts['refused']:,} refused, {facts['failed']:,} failed")
    for status, reasons in facts["reasons"].items():
        for reason, n in list(reasons.items())[:SHOWN]:
            print(f"  {n:,} {status}: {reason}")
        if others := list(reasons.values())[SHOWN:]:
            print(f"  {sum(others):,} {status} for {len(others):,} other reasons")
    print(f"{facts['parts']:,} parts in {facts['folder']}")
    if facts["under_way"]:
        print(f"{facts['under_way']:,} of the open designs are kept there for parts that are not whole yet")
    for text in facts["damaged"]:
        print(f"{text}; flexfem study run computes it again")
    if facts["foreign"]:
        print(f"{len(facts['foreign'])} other Parquet files there, of other inputs or versions:")
        print(f"  {', '.join(facts['foreign'][:3])}{', ...' if len(facts['foreign']) > 3 else ''}")
    if facts["stale"]:
        print(f"{facts['stale']:,} parts of other inputs or versions kept apart; flexfem study clean removes them")
    for text in facts["warnings"]:
        print(f"warning: {text}")
    print(f"stress: {facts['stress_accuracy']}")
    for text in doubts_said(facts["assumed"], facts["not_stated"], "of the numbers behind it "):
        print(f"{text}: --json lists them")
    if "next" in facts:
        print(f"next: {facts['next']}")
