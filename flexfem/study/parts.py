"""A study on disk: chunks of designs as Parquet parts, and who sees to which.

The name of a part says what is in it: the chunk's number, and a hash of the study, the range of designs and the
versions that decide results. What exists is done; nothing else is kept about what was done.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import random
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from glob import escape
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from flexfem.study.loaded import LoadedStudy
from flexfem.study.versions import versions_of

KEY = b"flexfem.study"  # of the metadata that say what a part belongs to
PARQUET: Mapping[str, Any] = {  # how parts and tables are written
    "compression": "zstd",
    "use_dictionary": ["status", "reason"],
    "write_page_checksum": True,
}
BROADCAST = 8192  # designs a part, of a model that answers all of them at once
DRAWN = 512  # analytic designs that are drawn: some milliseconds each
LINKED = 32  # analytic designs whose links bend: a tenth of a second each
MESHED = 16
STALE = 3600.0  # s, after which the temporary file of a killed run is removed
PART = re.compile(r"part-(\d{7,})-([0-9a-f]{16})\.parquet")


class Chunk(NamedTuple):
    """Designs from `start` up to `stop`, kept in one part."""

    number: int
    start: int
    stop: int


@dataclass(frozen=True)
class Parts:
    """Where the parts of a study lie and what each is called; `size` designs a part."""

    loaded: LoadedStudy
    folder: Path
    size: int

    @cached_property
    def versions(self) -> Mapping[str, str]:
        """Versions of what decides the results."""
        return versions_of(self.loaded.study.model != "analytic")

    @cached_property
    def count(self) -> int:
        """Number of parts."""
        return -(-self.designs // self.size)

    @cached_property
    def designs(self) -> int:
        """Number of designs, which takes a study long to say where parts are many."""
        return self.loaded.count

    @cached_property
    def _key(self) -> str:
        return json.dumps([self.loaded.hash, dict(self.versions)], sort_keys=True)

    @cached_property
    def schema(self) -> Any:
        """Columns of the table, with what it belongs to as metadata."""
        loaded = self.loaded
        numbers = [column.name for column in loaded.columns]
        fields = [pa.field("design", pa.int64(), False), pa.field("status", pa.string(), False)]
        fields += [pa.field("reason", pa.string(), False), *(pa.field(name, pa.float64(), False) for name in numbers)]
        fields += [pa.field(name, pa.float64()) for name in loaded.outputs]
        about = {
            "stem": loaded.stem,
            "name": loaded.study.name,
            "hash": loaded.hash,
            "versions": dict(self.versions),
            "stress_accuracy": loaded.stress_accuracy,
            "assumed": list(loaded.assumed),
            "not_stated": list(loaded.not_stated),
        }
        return pa.schema(fields, metadata={KEY: json.dumps(about, sort_keys=True).encode()})

    @cached_property
    def table_schema(self) -> Any:
        """As `schema`, of the whole table: with how many designs it has when none is open."""
        about = json.loads(self.schema.metadata[KEY]) | {"count": self.loaded.count}
        return self.schema.with_metadata({KEY: json.dumps(about, sort_keys=True).encode()})

    @cached_property
    def stale(self) -> Path:
        """Where parts of other inputs or versions are kept apart."""
        return self.folder.parent / "stale"

    def chunk(self, number: int) -> Chunk:
        """The chunk of a number from 0."""
        return Chunk(number, number * self.size, min((number + 1) * self.size, self.designs))

    def name(self, chunk: Chunk) -> str:
        """What the part of a chunk is called."""
        digits = hashlib.sha256(f"{self._key} {chunk.start} {chunk.stop}".encode()).hexdigest()[:16]
        return f"part-{chunk.number:07d}-{digits}.parquet"

    def path(self, chunk: Chunk) -> Path:
        """Where the part of a chunk lies, once it is written."""
        return self.folder / self.name(chunk)


def about_of(metadata: Mapping[bytes, bytes] | None) -> dict[str, Any]:
    """What a file of flexfem says that it belongs to, nothing where it is none."""
    try:
        found = json.loads((metadata or {})[KEY])
    except (KeyError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def parts_of(loaded: LoadedStudy, output: Path, size: int | None = None) -> Parts:
    """The parts of a study in an output folder; `size` designs each, by default as many as are some seconds of work."""
    study = loaded.study
    analytic = LINKED if study.links else DRAWN if study.draws else BROADCAST
    usual = analytic if study.model == "analytic" else MESHED
    return Parts(loaded, output / loaded.stem / "parts", size or usual)


def sweep(folder: Path, stem: str = "part") -> None:
    """Remove temporary files and folders that killed runs left behind, not those of a run that may still be writing."""
    for path in folder.glob(f".{escape(stem)}-*.tmp"):
        try:
            if time.time() - path.stat().st_mtime > STALE:
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        except OSError:  # another run was quicker, or may remove what this one may not
            continue


def listed(parts: Parts) -> tuple[list[Chunk], tuple[Path, ...]]:
    """Chunks for which there is a part, in order, and the other Parquet files."""
    chunks, foreign = [], []
    for name in sorted(names_in(parts.folder)):
        chunk = chunk_of(parts, name)
        if chunk is not None:
            chunks.append(chunk)
        elif name.endswith(".parquet") and not name.startswith("."):
            foreign.append(parts.folder / name)
    return chunks, tuple(foreign)


def names_in(folder: Path) -> list[str]:
    """Names of what lies in a folder, none where there is no folder."""
    try:
        return os.listdir(folder)
    except (FileNotFoundError, NotADirectoryError):
        return []


def chunk_of(parts: Parts, name: str) -> Chunk | None:
    """The chunk whose part has that name, None where none has."""
    found = PART.fullmatch(name)
    chunk = parts.chunk(int(found[1])) if found and int(found[1]) < parts.count else None
    return chunk if chunk is not None and parts.name(chunk) == name else None


class Shard(NamedTuple):
    """The chunks of one of several runners that share them out: number `first`, and every `step` after it."""

    first: int
    step: int

    def chunks(self, parts: Parts) -> range:
        """Numbers of the chunks."""
        return range(self.first, parts.count, self.step)

    def designs(self, parts: Parts) -> int:
        """Number of designs in the chunks."""
        chunks = self.chunks(parts)
        missing = parts.count * parts.size - parts.loaded.count if parts.count - 1 in chunks else 0
        return len(chunks) * parts.size - missing


WHOLE = Shard(0, 1)


def shuffled(numbers: range, seed: int | None = None) -> Iterator[int]:
    """Numbers, each once, in an order that differs from runner to runner; none are held."""
    draw, size = random.Random(seed), len(numbers)
    if size == 0:
        return
    first, step = draw.randrange(size), draw.randrange(1, size + 1)
    while math.gcd(step, size) != 1:
        step = draw.randrange(1, size + 1)
    for k in range(size):
        yield numbers[(first + step * k) % size]
