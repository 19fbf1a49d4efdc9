"""Reads mutated DXF, SVG and STEP files: each must be read or refused in one line, soon, and
nothing written.

    python benchmarks/fuzz_drawings.py [number of files] [seed]

Exits with 1 after an exception of another kind, and when one file takes more than `LONGEST` s.
"""

from __future__ import annotations

import faulthandler
import random
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

import ezdxf

import flexfem
from flexfem.cad.part import export
from flexfem.importing.read import read_drawing

LONGEST = 60.0  # s
ROOT = Path(__file__).parent.parent
PLATES = ("bridge-amplifier", "lever-amplifier", "xy-stage")
NUMBERS = (
    b"nan",
    b"inf",
    b"-1e308",
    b"1e400",
    b"0",
    b"-1",
    b"99999999999999999999",
    b"1e-320",
    b"",
)
INKSCAPE = """<svg xmlns="http://www.w3.org/2000/svg" width="80mm" height="60mm" viewBox="0 0 80 60">
<style>.cut {stroke: red; fill: none}</style><defs><g id="p"><path
class="cut" d="M26 0H0v40h60V0L34 0A4 4 0 0 1 26 0Z"/>
<circle class="cut" cx="12" cy="25" r="3"/></g></defs><use href="#p" transform="rotate(30) scale(-1 1)"/>
<g id="GROUND"><path d="M0 0c3 4 5 6 9 9q3 3 4 0t9 0s3 3 9 9z" style="stroke-dasharray:none"/></g></svg>"""


def originals(folder: Path) -> list[Path]:
    """Write the files that are mutated: exported plates, and drawings of other dialects."""
    paths = list[Path]()
    for name in PLATES:
        mechanism = flexfem.load(ROOT / "geometry" / f"{name}.toml")
        for suffix in (".dxf", ".svg", ".step"):
            paths.append(folder / f"{name}{suffix}")
            export(mechanism, paths[-1])
    for release in ("R12", "R2000", "R2018"):
        document = ezdxf.new(release)
        document.header["$INSUNITS"] = 1
        block = document.blocks.new("PART")
        block.add_polyline2d(
            [(0, 0, 0, 0, 0.5), (3, 0, 0, 0, 0), (3, 2, 0, 0, -1)], format="xyseb", close=True
        )
        block.add_circle((1, 1), 0.25)
        space = document.modelspace()
        space.add_blockref("PART", (5, 5), {"xscale": -2, "yscale": 2, "rotation": 33})
        if release != "R12":
            space.add_ellipse((2, 2), (1, 0), 0.4)
            space.add_spline([(0, 9), (3, 11), (5, 8), (0, 9)])
            space.add_lwpolyline([(20, 0, 0, 0, 1), (24, 0, 0, 0, 1)], close=True)
        paths.append(folder / f"{release}.dxf")
        document.saveas(paths[-1])
    paths.append(folder / "binary.dxf")
    with paths[-1].open("wb") as file:
        document.write(file, fmt="bin")
    paths.append(folder / "inkscape.svg")
    paths[-1].write_text(INKSCAPE)
    return paths


def mutated(data: bytes, chance: random.Random) -> tuple[str, bytes]:
    """Return a mutation by name, and its result."""
    kind = chance.choice(["flips", "cut", "lines", "numbers", "repeat", "swap", "splice"])
    content = bytearray(data)
    lines = data.splitlines(keepends=True)
    if kind == "flips":
        for _ in range(chance.choice([1, 3, 30, 300])):
            content[chance.randrange(len(content))] = chance.randrange(256)
    elif kind == "cut":
        content = content[: chance.randrange(len(content))]
    elif kind == "lines":
        for _ in range(min(chance.choice([1, 2, 20]), len(lines))):
            del lines[chance.randrange(len(lines))]
        content = bytearray(b"".join(lines))
    elif kind == "numbers":
        places = [k for k in range(len(content) - 1) if chr(content[k]).isdigit()]
        for place in sorted(
            chance.sample(places, min(len(places), chance.choice([1, 5, 50]))), reverse=True
        ):
            content[place : place + 1] = chance.choice(NUMBERS)
    elif kind == "repeat":
        first = chance.randrange(len(lines))
        some = lines[first : first + chance.choice([2, 40])]
        content = bytearray(b"".join(lines[:first] + some * chance.choice([2, 50]) + lines[first:]))
    elif kind == "swap":
        one = chance.randrange(len(lines))
        other = chance.randrange(len(lines))
        lines[one], lines[other] = lines[other], lines[one]
        content = bytearray(b"".join(lines))
    else:
        place = chance.randrange(len(content))
        start = chance.randrange(len(content))
        content[place:place] = data[start : start + chance.choice([10, 1000])]
    return kind, bytes(content)


def main(number: int, seed: int) -> int:
    """Read mutated files and print what became of them; return the number of failures."""
    chance = random.Random(seed)
    outcome = Counter[str]()
    failures = 0
    slowest = (0.0, "")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = originals(folder)
        contents = {path: path.read_bytes() for path in paths}
        for path in paths:
            path.unlink()
        for k in range(number):
            original = paths[k % len(paths)]
            kind, data = mutated(contents[original], chance)
            path = folder / f"{k}-{kind}-{original.name}"
            path.write_bytes(data)
            faulthandler.dump_traceback_later(LONGEST, exit=True)
            start = time.perf_counter()
            try:
                read_drawing(path)
                outcome[f"{original.suffix} read"] += 1
            except flexfem.BadInput as error:
                outcome[f"{original.suffix} refused"] += 1
                if len(str(error).splitlines()) != 1 or len(str(error)) > 1000:
                    failures += 1
                    print(f"{path.name}: refused with a long text: {error}")
            except Exception:
                failures += 1
                print(f"{path.name}:\n{traceback.format_exc()}")
            faulthandler.cancel_dump_traceback_later()
            slowest = max(slowest, (time.perf_counter() - start, path.name))
            path.unlink()
        left = [each.name for each in folder.iterdir()]
    print(
        f"{number} files: {dict(sorted(outcome.items()))}, {failures} failures, files written: "
        f"{left}"
    )
    print(f"slowest: {slowest[0]:.2f} s, {slowest[1]}")
    return failures + len(left)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:]]
    sys.exit(min(main(*given, *(500, 1)[len(given) :]), 1))
