"""Stage files: what is refused and in which words, and what a stage that is accepted means."""

from __future__ import annotations

import math
import os
import pickle
import signal
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from flexfem.files.lines import MAX_DEPTH, KeyPath
from flexfem.files.provenance import key_paths, numeric_key_paths
from flexfem.files.toml import MAX_BYTES, read_toml
from flexfem.mechanism.designs import elastic, out_of_plane
from flexfem.mechanism.stage import (
    CHAINS,
    HINGE_NAMES,
    Stage,
    load_stage,
)
from flexfem.mechanism.stage_file import scopes_of
from flexfem.refused import BadInput

SHIPPED = sorted((Path(__file__).parents[2] / "geometry").glob("*.toml"))
PATIENCE = 15.0  # s of processor time for a hostile file of at most 1 MiB; they take 1.5 s, quadratic reading minutes

VALID = """\
name = "generic stage"
thickness_mm = 9.7

[material]
name = "generic metal"
youngs_modulus_gpa = 68.3
poissons_ratio = 0.29
density_kg_m3 = 2739.0
yield_strength_mpa = 411.0

[chain]
link_lengths_mm = [31.0, 33.5, 23.0]
joint_angles_deg = [175.0, -85.0, 92.0]
link_width_mm = 8.9

[hinges.base]
radius_mm = 3.9
neck_mm = 0.53
prismatic = true

[hinges.elbow]
radius_mm = 1.6
neck_mm = 0.47

[hinges.platform]
radius_mm = 1.7
neck_mm = 0.51

[platform]
radius_mm = 16.0
hub_radius_mm = 7.0
"""


@contextmanager
def processor_time(seconds: float = PATIENCE) -> Iterator[None]:
    """Fail what takes more processor time, however busy the machine is; what hangs in a loop is ended."""

    def stop(*_: object) -> None:
        raise AssertionError(f"not done after {seconds:g} s of processor time")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def edited(old: str, new: str) -> str:
    assert VALID.count(old) == 1, f"{old!r} must stand once in the valid file"
    return VALID.replace(old, new)


def added(text: str) -> str:
    return VALID + text


class Hostile(NamedTuple):
    """A file, a piece of the line its message must name (None: no line), and pieces of the message."""

    id: str
    content: str | bytes
    line_with: str | None
    said: tuple[str, ...]


ELBOW = '\n[[override]]\nchain = 2\nhinge = "elbow"\n'
FAKE_KEYS = 'name = """\\\nneck_mm = -3 \\\n[hinges.base] \\\nneck_mm = -3\\\n"""\n'

HOSTILE = [
    # numbers
    Hostile("negative neck", edited("0.53", "-0.1"), "-0.1", ("hinges.base.neck_mm = -0.1, expected > 0",)),
    Hostile("zero radius", edited("3.9", "0.0"), "= 0.0", ("hinges.base.radius_mm = 0.0, expected > 0",)),
    Hostile("minus zero", edited("9.7", "-0.0"), "-0.0", ("thickness_mm = -0.0, expected > 0",)),
    Hostile("kilometre link", edited("33.5", "1e6"), "1e6", ("chain.link_lengths_mm[1] = 1000000.0", "<= 10000")),
    Hostile("nan", edited("9.7", "nan"), "nan", ("thickness_mm = nan, expected a finite number",)),
    Hostile("infinite", edited("9.7", "+inf"), "+inf", ("thickness_mm = inf, expected a finite number",)),
    Hostile("overflowing float", edited("2739.0", "1e999"), "1e999", ("density_kg_m3 = inf", "finite")),
    Hostile("infinite angle", edited("-85.0", "-inf"), "-inf", ("chain.joint_angles_deg[1] = -inf", "finite")),
    Hostile("nan axis", edited("0.47", "0.47\naxis_deg = nan"), "nan", ("hinges.elbow.axis_deg = nan", "finite")),
    Hostile("angle above a turn", edited("175.0", "360.5"), "360.5", ("joint_angles_deg[0] = 360.5, expected <= 360",)),
    Hostile("modulus in MPa", edited("68.3", "68300"), "68300", ("youngs_modulus_gpa = 68300, expected <= 2000",)),
    Hostile("incompressible", edited("0.29", "0.5"), "= 0.5\n", ("material.poissons_ratio = 0.5, expected < 0.5",)),
    Hostile("auxetic", edited("0.29", "-0.1"), "-0.1", ("material.poissons_ratio = -0.1, expected >= 0",)),
    Hostile("weightless", edited("2739.0", "0"), "kg_m3 = 0", ("material.density_kg_m3 = 0, expected > 0",)),
    Hostile("no strength", edited("411.0", "0.0"), "mpa = 0.0", ("yield_strength_mpa = 0.0, expected > 0",)),
    Hostile("huge integer", edited("9.7", "1" + 400 * "0"), "10000", ("thickness_mm = ", "expected a number below")),
    Hostile("integer of 5000 digits", edited("9.7", 5000 * "7"), "7777", ("too many digits",)),
    Hostile("huge hexadecimal", edited("9.7", "0x" + 9000 * "f"), "ffff", ("thickness_mm = ", "36000 bits")),
    Hostile("hub is huge", edited("= 7.0", "= 10001.0"), "10001", ("platform.hub_radius_mm = 10001.0", "<= 10000")),
    # types
    Hostile("text for a number", edited("0.53", '"0.53"'), '"0.53"', ('neck_mm = "0.53", expected a number',)),
    Hostile("bool for a number", edited("9.7", "true"), "= true", ("thickness_mm = true, expected a number",)),
    Hostile("date for a number", edited("9.7", "2003-08-01"), "2003", ("thickness_mm = 2003-08-01", "a number")),
    Hostile("table for a number", edited("9.7", "{ mm = 9.7 }"), "9.7", ("thickness_mm = {mm = 9.7}", "a number")),
    Hostile("integer for a flag", edited("true", "1"), "prismatic", ("hinges.base.prismatic = 1, expected true or",)),
    Hostile("number for a name", edited('"generic stage"', "6"), "name = 6", ("name = 6, expected text",)),
    Hostile(
        "empty name", edited('"generic stage"', '" "'), 'name = " "', ('name = " ", expected one line of 1 to 500',)
    ),
    Hostile("control character in a name", edited("generic stage", "a\\u001b[2Jb"), "001b", ("\\u001b[2Jb",)),
    Hostile("two links", edited(", 23.0]", "]"), "33.5", ("link_lengths_mm = [31.0, 33.5], expected 3 values, not 2",)),
    Hostile("no links", edited("[31.0, 33.5, 23.0]", "[]"), "lengths_mm = []", ("expected 3 values, not 0",)),
    Hostile("four links", edited("23.0]", "23.0, 1.0]"), "33.5", ("expected at most 3 values, not 4",)),
    Hostile("a link is text", edited("33.5", '"33.5"'), '"33.5"', ('chain.link_lengths_mm[1] = "33.5"', "a number")),
    Hostile("nested links", edited("33.5", "[33.5]"), "[33.5]", ("chain.link_lengths_mm[1] = [33.5], expected a",)),
    Hostile("number for links", edited("[31.0, 33.5, 23.0]", "31.0"), "mm = 31", ("mm = 31.0, expected an array",)),
    Hostile(
        "number for a table",
        edited("\n[platform]\n", "\n[other]\n").replace("thick", "platform = 3\nthick"),
        "= 3",
        ("platform = 3, expected a table", "(and 1 more)"),
    ),
    Hostile(
        "array for a table",
        edited("[platform]\n", "[[platform]]\n"),
        "[[platform]]",
        ("platform = [{radius", "expected a table"),
    ),
    # keys
    Hostile("missing neck", edited("neck_mm = 0.47\n", ""), "[hinges.elbow]", ("hinges.elbow.neck_mm is missing",)),
    Hostile("missing thickness", edited("thickness_mm = 9.7\n", ""), None, ("thickness_mm is missing",)),
    Hostile(
        "missing hinge",
        edited("[hinges.elbow]\nradius_mm = 1.6\nneck_mm = 0.47\n", ""),
        "[hinges.base]",
        ("hinges.elbow.radius_mm and hinges.elbow.neck_mm are missing",),
    ),
    Hostile(
        "misspelt key",
        edited("neck_mm = 0.47", "nekc_mm = 0.47"),
        "nekc",
        ("hinges.elbow.nekc_mm is an unknown key, did you mean neck_mm?",),
    ),
    Hostile(
        "key without unit",
        edited("thickness_mm", "thickness"),
        "thickness",
        ("thickness is an unknown key, did you mean thickness_mm?",),
    ),
    Hostile(
        "attribute name for a key",
        edited("hub_radius_mm", "hub_radius"),
        "hub_radius",
        ("did you mean hub_radius_mm?",),
    ),
    Hostile(
        "strange key",
        added('"a\\nb" = 1\n'),
        '"a\\nb"',
        ('platform."a\\nb" is an unknown key, expected one of radius_mm, hub_radius_mm',),
    ),
    Hostile(
        "strange table",
        added("[hinges.toe]\n"),
        "toe",
        ("hinges.toe is an unknown key, expected one of base, elbow, platform",),
    ),
    Hostile("very long key", added(5000 * "k" + " = 1\n"), "kkkk", ("platform.kkkk", "... is an unknown key")),
    Hostile(
        "three mistakes",
        edited("0.53", "-0.1").replace("16.0", "nan").replace("1.6", "true"),
        "-0.1",
        ("neck_mm = -0.1, expected > 0 (and 2 more)",),
    ),
    Hostile(
        "mistakes in file order",
        edited("radius_mm = 3.9\nneck_mm = 0.53", "neck_mm = -1\nradius_mm = -2"),
        "-1",
        ("hinges.base.neck_mm = -1, expected > 0 (and 1 more)",),
    ),
    Hostile(
        "key in a long string",
        edited('name = "generic metal"\n', FAKE_KEYS).replace("0.53", "-1"),
        "-1",
        ("hinges.base.neck_mm = -1, expected > 0",),
    ),
    Hostile(
        "inline table",
        edited(
            "[hinges.elbow]\nradius_mm = 1.6\nneck_mm = 0.47\n",
            "[hinges]\nelbow = { neck_mm = -4, radius_mm = -1.6 }\n",
        ),
        "-4",
        ("hinges.elbow.neck_mm = -4, expected > 0 (and 1 more)",),
    ),
    Hostile(
        "array over lines",
        edited("[31.0, 33.5, 23.0]", "[\n  31.0, # l1\n\n  -33.5,\n  23.0,\n]"),
        "-33.5",
        ("chain.link_lengths_mm[1] = -33.5",),
    ),
    Hostile(
        "dotted quoted key",
        edited("[platform]\nradius_mm = 16.0\nhub_radius_mm = 7.0\n", "").replace(
            "\n[material]", '"platform".radius_mm = 16\nplatform."hub_\\u0072adius_mm" = -7\n\n[material]'
        ),
        "-7",
        ("platform.hub_radius_mm = -7, expected > 0",),
    ),
    # overrides
    Hostile(
        "chain four",
        added(ELBOW.replace("2", "4") + "neck_mm = 0.5\n"),
        "chain = 4",
        ("override[0].chain = 4, expected <= 3",),
    ),
    Hostile(
        "chain zero",
        added(ELBOW.replace("2", "0") + "neck_mm = 0.5\n"),
        "chain = 0",
        ("override[0].chain = 0, expected >= 1",),
    ),
    Hostile(
        "chain is a float",
        added(ELBOW.replace("2", "2.0") + "neck_mm = 0.5\n"),
        "= 2.0",
        ("override[0].chain = 2.0, expected an integer",),
    ),
    Hostile(
        "chain is a flag",
        added(ELBOW.replace("2", "true") + "neck_mm = 0.5\n"),
        "chain = true",
        ("chain = true, expected an integer",),
    ),
    Hostile(
        "chain is astronomical",
        added(ELBOW.replace("2", 300 * "2") + "neck_mm = 0.5\n"),
        "222",
        ("override[0].chain = ", "expected "),
    ),
    Hostile(
        "no such hinge",
        added(ELBOW.replace("elbow", "knee") + "neck_mm = 0.5\n"),
        "knee",
        ("override[0].hinge = \"knee\", expected 'base', 'elbow' or 'platform'",),
    ),
    Hostile(
        "override changes nothing",
        added(ELBOW),
        "[[override]]",
        ("override.2.elbow = {chain = 2", "expected at least one of radius_mm, neck_mm"),
    ),
    Hostile(
        "same hinge twice",
        added(ELBOW + "neck_mm = 0.5\n" + ELBOW.replace("[[override]]", "[[override]] # again") + "radius_mm = 1.0\n"),
        "again",
        ("override.2.elbow = {", "expected each hinge overridden once"),
    ),
    Hostile(
        "second override",
        added(ELBOW + "neck_mm = 0.5\n" + ELBOW.replace("2", "3") + "neck_mm = -7\n"),
        "-7",
        ("override.3.elbow.neck_mm = -7, expected > 0",),
    ),
    Hostile(
        "unknown key in an override",
        added(ELBOW + "neck = 0.5\n"),
        "neck = 0.5",
        ("override.2.elbow.neck is an unknown key, did you mean neck_mm?",),
    ),
    Hostile(
        "override in single brackets",
        added(ELBOW.replace("[[override]]", "[override]") + "neck_mm = 0.5\n"),
        "[override]",
        ("expected an array of tables, [[override]]",),
    ),
    # provenance
    Hostile(
        "provenance of nothing",
        added('[provenance]\n"chain.link_length_mm" = "x"\n'),
        'length_mm"',
        (
            'provenance."chain.link_length_mm" = "x", expected a key path of this file, ',
            "did you mean chain.link_lengths_mm?",
        ),
    ),
    Hostile(
        "provenance of a default",
        added('[provenance]\n"hinges.elbow.prismatic" = "x"\n'),
        'prismatic"',
        ("expected a key path of this file",),
    ),
    Hostile(
        "provenance of no override",
        added('[provenance]\n"override.2.elbow.neck_mm" = "x"\n'),
        "override.2",
        ("expected a key path of this file",),
    ),
    Hostile(
        "provenance without quotes",
        added('[provenance]\nchain.link_width_mm = "x"\n'),
        'width_mm = "x',
        ("provenance.chain = {link_width_mm", "write the whole key path in quotes"),
    ),
    Hostile(
        "provenance is a number",
        added('[provenance]\n"chain" = 3\n'),
        '"chain" = 3',
        ("provenance.chain = 3, expected text",),
    ),
    Hostile(
        "empty provenance",
        added('[provenance]\n"chain" = ""\n'),
        '"chain" = ""',
        ('provenance.chain = "", expected one line',),
    ),
    # not TOML, not text
    Hostile(
        "empty",
        "",
        None,
        (
            ": name, thickness_mm, material.name, material.youngs_modulus_gpa, material.poissons_ratio, ",
            ", chain.link_lengths_mm, chain.joint_angles_deg, chain.link_width_mm, hinges.base.radius_mm, ",
            ", hinges.platform.neck_mm, platform.radius_mm and platform.hub_radius_mm are missing",
        ),
    ),
    Hostile(
        "several keys missing and one wrong",
        edited("neck_mm = 0.47\n", "").replace("thickness_mm = 9.7", "thickness_mm = -9.7"),
        "thickness_mm",
        ("thickness_mm = -9.7, expected > 0; hinges.elbow.neck_mm is missing",),
    ),
    Hostile("prose", 40 * "dear reader " + "\n", "dear", ("not TOML",)),
    Hostile("unclosed string", edited('"generic metal"', '"generic metal'), "metal", ("not TOML",)),
    Hostile("unclosed array", edited("23.0]", "23.0"), "joint_angles", ("not TOML",)),
    Hostile("cut off", VALID.rstrip("\n") + "\nx = [1,\n\n", "x = [", ("not TOML",)),
    Hostile("same key twice", edited("neck_mm = 0.47", "neck_mm = 0.47\nneck_mm = 0.48"), "0.48", ("not TOML",)),
    Hostile("same table twice", added("[chain] # again\n"), "again", ("not TOML",)),
    Hostile("json", '{"name": 3}', "name", ("not TOML",)),
    Hostile(
        "latin-1",
        edited("generic metal", "acier inoxyd\u00e9").encode("latin-1"),
        b"inoxyd\xe9".decode("latin-1"),
        ("byte 0xe9 is not UTF-8",),
    ),
    Hostile("byte order mark", b"\xef\xbb\xbf" + VALID.encode(), "generic stage", ("byte order mark",)),
    Hostile("utf-16", VALID.encode("utf-16-le"), "n\0a\0m\0e", ("a NUL byte",)),
    Hostile("NUL", edited("generic metal", "a\0b"), "\0", ("a NUL byte",)),
    Hostile("bell", edited("generic metal", "a\ab"), "\a", ("not TOML", "\\x07")),
    Hostile("too large", VALID + MAX_BYTES * "#", None, ("expected at most 1 MiB",)),
    # built to break the reader
    Hostile("deep arrays", "x = " + 100_000 * "[", "x", ("nested deeper than 32 levels",)),
    Hostile(
        "deep inline tables", "x = " + 100_000 * "{a=" + "1" + 100_000 * "}", "x", ("nested deeper than 32 levels",)
    ),
    Hostile("deep header", "[" + 100_000 * "a." + "a]\n", "a", ("nested deeper than 32 levels",)),
    Hostile("deep dotted key", 500_000 * "a." + "a = 1", "a", ("nested deeper than 32 levels",)),
    Hostile(
        "deep through headers", added("[" + 20 * "a." + "a]\n" + 20 * "b." + "b = 1"), "b.b", ("nested deeper than",)
    ),
    Hostile("strings that never close", '"""' + 200_000 * '\\"""' + "\\", '"""', ("not TOML",)),
    Hostile("quotes only", 500_000 * '" ', '"', ("not TOML",)),
    Hostile(
        "many unknown keys",
        "".join(f"k{n} = 1\n" for n in range(5_000)),
        "k0 = 1",
        ("k0 is an unknown key", "(and 4999 more); name, thickness_mm, "),
    ),
    Hostile(
        "very many links",
        edited("23.0]", 50_000 * "1," + "1]"),
        "33.5",
        ("link_lengths_mm = [31.0", "..., expected at most 3 values, not 50003"),
    ),
]


def refused(path: Path | str) -> str:
    with pytest.raises(BadInput) as caught:
        load_stage(path)
    message = str(caught.value)
    assert message.isprintable(), "one line, nothing a terminal would obey"
    return message


@pytest.mark.parametrize("hostile", HOSTILE, ids=lambda hostile: hostile.id)
def test_a_hostile_file_is_refused_in_one_line_naming_file_line_key_value_and_expectation(
    hostile: Hostile, tmp_path: Path
) -> None:
    path = tmp_path / "hostile.toml"
    path.write_bytes(hostile.content if isinstance(hostile.content, bytes) else hostile.content.encode())
    with processor_time():
        message = refused(path)
    text = hostile.content.decode("latin-1") if isinstance(hostile.content, bytes) else hostile.content
    line = "" if hostile.line_with is None else f", line {text[: text.index(hostile.line_with)].count(chr(10)) + 1}"
    assert message.startswith(f"{path}{line}: ")
    for said in hostile.said:
        assert said in message
    assert len(message) < len(str(path)) + 600


def test_the_whole_message_is_the_one_promised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(edited("0.53", "-0.1"))
    assert refused("x.toml") == "x.toml, line 18: hinges.base.neck_mm = -0.1, expected > 0"


def test_a_misspelt_key_and_the_key_then_missing_are_one_mistake(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(edited("neck_mm = 0.47", "neck = 0.47"))
    assert "more)" not in refused(tmp_path / "x.toml")


# --- files that are not files --------------------------------------------------------------------------------------


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    assert refused(tmp_path / "none.toml") == f"{tmp_path}/none.toml: no such file"


def test_a_directory_is_refused(tmp_path: Path) -> None:
    assert refused(tmp_path) == f"{tmp_path}: a directory, expected a file"


def test_a_pipe_is_refused_without_waiting_for_a_writer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    assert "a pipe, socket or device" in refused(tmp_path / "pipe.toml")


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_refused(device: str) -> None:
    assert "a pipe, socket or device" in refused(device)


def test_a_file_that_grows_while_it_is_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "grows.toml"
    path.write_text(VALID)
    small = path.stat()
    path.write_text(VALID + MAX_BYTES * "#")
    monkeypatch.setattr(os, "stat", lambda *_, **__: small)
    monkeypatch.setattr(os, "fstat", lambda *_: small)
    assert "more than 1048576 bytes" in refused(path)


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, pipe, flags_seen, really_open = tmp_path / "file", tmp_path / "pipe.toml", list[int](), os.open
    file.write_text(VALID)
    os.mkfifo(pipe)
    regular = file.stat()

    def open_noting_flags(path: str, flags: int) -> int:
        flags_seen.append(flags)
        return really_open(path, flags | os.O_NONBLOCK)

    monkeypatch.setattr(os, "stat", lambda *_, **__: regular)
    monkeypatch.setattr(os, "open", open_noting_flags)
    message = refused(pipe)
    monkeypatch.undo()
    assert "a pipe, socket or device" in message
    assert flags_seen[0] & os.O_NONBLOCK


def test_a_huge_file_is_refused_without_being_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (tmp_path / "sparse.toml").open("wb") as file:
        file.truncate(2**33)
    monkeypatch.setattr(os, "open", None)
    assert "8589934592 bytes, expected at most 1 MiB" in refused(tmp_path / "sparse.toml")


def test_a_file_of_exactly_the_largest_size_is_read(tmp_path: Path) -> None:
    path = tmp_path / "largest.toml"
    path.write_text(VALID + (MAX_BYTES - len(VALID)) * "#")
    assert load_stage(path).thickness == 9.7


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(VALID)
    (tmp_path / "x.toml").chmod(0)
    assert "Permission denied" in refused(tmp_path / "x.toml")


def test_a_file_the_system_will_not_open_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deny(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "x.toml").write_text(VALID)
    monkeypatch.setattr(os, "open", deny)
    assert "cannot be read: Permission denied" in refused(tmp_path / "x.toml")


@pytest.mark.parametrize("name", ["", "nul\0name", 5000 * "n", "loop.toml", "file/x.toml", "new\nline\x1b[2J"])
def test_a_name_that_cannot_be_opened_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("loop.toml").symlink_to("loop.toml")
    Path("file").touch()
    refused(name)


def test_a_link_to_a_stage_is_followed(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(VALID)
    (tmp_path / "link.toml").symlink_to("x.toml")
    assert load_stage(tmp_path / "link.toml").name == "generic stage"


# --- any file ------------------------------------------------------------------------------------------------------

SOUP = [
    *(
        "a",
        "b",
        "chain",
        '"c d"',
        "'e'",
        '"\\u0061"',
        '"""',
        "'''",
        '"',
        "'",
        "\\",
        "#c = [",
        "1",
        "-1.5e3",
        "true",
        "é",
    ),
    *('"""x\n[y]\nz = 1"""', "'''\nq=1'''", '""""q"""""', "1979-05-27 07:32:00", "nan", "\x00", "\r\n", "\r"),
    *(".", "=", " = ", "[", "]", "[[", "]]", "{", "}", ",", "\n", "\n", " ", "\n[a]\n", "\n[[a.b]]\n", "\na.b = 1\n"),
]
STATEMENTS = [
    *(
        "a = 1",
        "b.c = 'x'",
        '"d e".f = """\nz = 1\n"""',
        "g = [1, [2,\n{h = 3}], # ]\n\n 4,]",
        "i = {j.k = [{l = 1}], m = {}}",
    ),
    *(
        "[t]",
        "[t.u]",
        '["t"."v w".x]',
        "[[p]]",
        "[[p.q]]",
        "[p.r]",
        "[[p.q.s]]",
        "[p.q.t]",
        "n = ''''it''''",
        "# o = 1",
    ),
    *("y = 1979-05-27 07:32:00", "z = [ ]", "aa = {}", "ab = [\n'''\n]''', '\\\"', \"\\\"]\",\n1]", "'' = 1"),
]


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("any") / "any.toml"


def paths_in(data: Any, path: KeyPath = ()) -> Iterator[KeyPath]:
    for key, value in data.items() if isinstance(data, dict) else enumerate(data if isinstance(data, list) else ()):
        yield (*path, key)
        yield from paths_in(value, (*path, key))


def accept_or_refuse(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    try:
        load_stage(path)
    except BadInput as refusal:
        assert str(refusal).startswith(str(path))
        assert str(refusal).isprintable()


@given(content=st.binary(max_size=300))
def test_any_bytes_are_refused_cleanly(scratch: Path, content: bytes) -> None:
    accept_or_refuse(scratch, content)


@settings(max_examples=40)
@given(content=st.text(max_size=300))
def test_any_text_is_refused_cleanly(scratch: Path, content: str) -> None:
    accept_or_refuse(scratch, content.encode("utf-8", "replace"))


@settings(max_examples=200)
@given(data=st.data())
def test_a_stage_file_damaged_anywhere_is_accepted_or_refused_cleanly(scratch: Path, data: st.DataObject) -> None:
    text = VALID + ELBOW + 'neck_mm = 0.5\n[provenance]\n"chain" = "assumed"\n'
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + data.draw(st.sampled_from(["", *SOUP])) + text[end:]
    accept_or_refuse(scratch, text.encode())


NESTED_TABLES = ["[[p]]", "[p.r]", "[[p]]", "[[p.q]]", "[[p.q]]", "[p.r]", "[[p.q.s]]", "[p.q.t]", "a = 1"]
QUOTES_AT_THE_END = [
    'af = ["""q"""", 2]',
    "ag = ['''q'''', 2]",
    'ac = """q"""""',
    "[t]",
    "ad = '''q'''''",
    "ae = '''it''s\n[zz]\nx = '1''''",
    "a = 1",
]


@settings(max_examples=300)
@example(tokens=NESTED_TABLES)
@example(tokens=QUOTES_AT_THE_END)
@given(tokens=st.lists(st.sampled_from(SOUP), max_size=8) | st.lists(st.sampled_from(STATEMENTS), max_size=8))
def test_the_line_index_knows_exactly_the_keys_tomllib_finds(scratch: Path, tokens: list[str]) -> None:
    text = ("\n" if "a = 1" in tokens or set(tokens) & set(STATEMENTS) else "").join(tokens)
    scratch.write_text(text, newline="")
    try:
        data, lines = read_toml(scratch)
    except BadInput:
        return
    assert set(lines.offsets) == set(paths_in(data))
    assert repr(data) == repr(tomllib.loads(text))  # nan is not equal to itself


PADDING = [
    "",
    "",
    "# a.b = [\n",
    "\n\n",
    "zz{n} = '''\n[chain]\nx = 1'''\n",
    'zz{n} = """\\\n  q"""\n',
    "zz{n} = [\n1,\n]\n",
]


@st.composite
def documents(draw: st.DrawFn) -> tuple[str, dict[KeyPath, int]]:
    """Draw a TOML text of numbered keys between misleading lines, with the true line of every key."""
    text, truth, count, table = "", dict[KeyPath, int](), 0, KeyPath()
    for n in range(draw(st.integers(1, 8))):
        text += draw(st.sampled_from(PADDING)).format(n=n)
        here = text.count("\n") + 1
        form = draw(st.sampled_from(["plain", "dotted", "inline", "array", "header", "tables"]))
        if form == "plain":
            text, truth[*table, f"k{n}"] = text + f"  'k{n}' = 1 # k{n} = 2\n", here
        elif form == "dotted":
            text, truth[*table, f"k{n}", "x.y"] = text + f'k{n} . "x.y" = "k{n} = 1"\n', here
        elif form == "inline":
            text, truth[*table, f"k{n}", "z"] = text + f"k{n} = {{ y = [\n1,\n2], z = 3 }}\n", here + 2
        elif form == "array":
            text, truth[*table, f"k{n}", 1, "x"] = text + f"k{n} = [ {{ x = 0 }},\n\n{{ x = 1 }} ]\n", here + 2
        elif form == "header":
            text, table = text + f'[ "k{n}" .sub]\n', (f"k{n}", "sub")
            truth[table] = here
        else:
            text, table = text + "[[many]]\n", ("many", count)
            truth[table], count = here, count + 1
    return text, truth


@given(document=documents())
def test_the_line_of_a_key_is_where_it_stands(scratch: Path, document: tuple[str, dict[KeyPath, int]]) -> None:
    text, truth = document
    scratch.write_text(text)
    lines = read_toml(scratch).lines
    assert {path: lines.line(path) for path in truth} == truth


def test_the_line_of_a_key_that_is_not_there_is_its_tables(scratch: Path) -> None:
    scratch.write_text("a = 1\n[b.c]\nd = [1,\n2]\n")
    lines = read_toml(scratch).lines
    assert [lines.line(path) for path in (("b", "c", "x"), ("b", "x"), ("b", "c", "d", 9), ("x",), ())] == [
        2,
        2,
        3,
        None,
        None,
    ]


def test_the_line_of_a_table_is_its_own_header_though_a_sub_table_came_first(scratch: Path) -> None:
    scratch.write_text("[b.c]\n\n[b]\nd = 1\n")
    assert read_toml(scratch).lines.line(("b",)) == 3


def test_line_endings_of_windows_count_once(scratch: Path) -> None:
    scratch.write_bytes(edited("0.53", "-0.1").replace("\n", "\r\n").encode())
    assert ", line 18: hinges.base.neck_mm" in refused(scratch)


def test_nesting_up_to_the_limit_is_read(scratch: Path) -> None:
    scratch.write_text("a = " + (MAX_DEPTH - 1) * "[" + (MAX_DEPTH - 1) * "]")
    assert read_toml(scratch).data


# --- what a stage means --------------------------------------------------------------------------------------------


def stage(text: str, path: Path) -> Stage:
    path.write_text(text)
    return load_stage(path)


def number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high) | st.integers(math.ceil(low) + 1, math.floor(min(high, 1e9)))


LENGTH = number(1e-6, 1e4)
ANGLE = number(-360, 360)
HINGE = st.fixed_dictionaries(
    {"radius_mm": LENGTH, "neck_mm": LENGTH}, optional={"prismatic": st.booleans(), "axis_deg": ANGLE}
)
LABEL = st.text(st.characters(exclude_categories=("C", "Z"), codec="utf-8"), min_size=1, max_size=20)
STAGES: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
    {
        "name": LABEL,
        "thickness_mm": LENGTH,
        "material": st.fixed_dictionaries(
            {
                "name": LABEL,
                "youngs_modulus_gpa": number(1e-3, 2000),
                "poissons_ratio": st.floats(0, 0.5, exclude_max=True),
                "density_kg_m3": number(0.1, 1e5),
                "yield_strength_mpa": number(1e-3, 1e5),
            }
        ),
        "chain": st.fixed_dictionaries(
            {
                "link_lengths_mm": st.lists(LENGTH, min_size=3, max_size=3),
                "joint_angles_deg": st.lists(ANGLE, min_size=3, max_size=3),
                "link_width_mm": LENGTH,
            }
        ),
        "hinges": st.fixed_dictionaries({name: HINGE for name in HINGE_NAMES}),
        "platform": st.fixed_dictionaries({"radius_mm": LENGTH, "hub_radius_mm": LENGTH}),
    },
    optional={
        "override": st.lists(
            st.fixed_dictionaries(
                {"chain": st.sampled_from(CHAINS), "hinge": st.sampled_from(HINGE_NAMES), "neck_mm": LENGTH},
                optional={"radius_mm": LENGTH, "prismatic": st.booleans(), "axis_deg": ANGLE},
            ),
            unique_by=lambda override: (override["chain"], override["hinge"]),
            max_size=9,
        ),
        "provenance": st.dictionaries(st.sampled_from(["name", "material", "chain.link_lengths_mm"]), LABEL),
    },
)


def as_toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{key}" = {as_toml(item)}' for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value).lower() if isinstance(value, bool) else repr(value)


def as_file(stage: dict[str, Any], headers: bool) -> str:
    """Write a stage with headers, or all of it as inline tables at the top."""
    lines = [f"{key} = {as_toml(value)}" for key, value in stage.items() if not (headers and isinstance(value, dict))]
    for key, value in stage.items() if headers else ():
        if isinstance(value, dict):
            lines += [f"[{key}]", *(f'"{inner}" = {as_toml(item)}' for inner, item in value.items())]
    return "\n".join(lines)


def inside(key: str, value: Any) -> Any:
    """Convert a value of the file to N-mm-MPa-rad, told by the suffix of its key alone."""
    if isinstance(value, list):
        return tuple(inside(key, item) for item in value)
    factor = 1000 if key.endswith("_gpa") else 1
    return math.radians(value) if key.endswith("_deg") else value * factor


ATTRIBUTE = {"density_kg_m3": "density"}
SUFFIXES = ("_mm", "_gpa", "_mpa", "_deg")


def attribute(key: str) -> str:
    suffix = next((suffix for suffix in SUFFIXES if key.endswith(suffix)), "")
    return ATTRIBUTE.get(key, key.removesuffix(suffix))


def assert_same(table: Any, file: dict[str, Any]) -> None:
    for key, value in file.items():
        got = getattr(table, attribute(key))
        if isinstance(value, dict) and key != "provenance":
            assert_same(got, value)
        elif key == "override":
            assert len(got) == len(value)
            for one, other in zip(got, value, strict=True):
                assert_same(one, other)
        else:
            assert got == (value if isinstance(value, str | bool | dict) else inside(key, value)), key


@settings(max_examples=40)
@given(file=STAGES, headers=st.booleans())
def test_every_valid_stage_comes_back_in_newton_millimetre_megapascal_radian(
    scratch: Path, file: dict[str, Any], headers: bool
) -> None:
    read = stage(as_file(file, headers), scratch)
    assert_same(read, file)
    assert read == Stage.model_validate(file)
    assert pickle.loads(pickle.dumps(read)) == read
    assert all(path in key_paths(read) for path in numeric_key_paths(read))


def test_units_end_at_the_file_border(tmp_path: Path) -> None:
    read = stage(VALID, tmp_path / "x.toml")
    assert read.material.youngs_modulus == pytest.approx(68300.0)
    assert read.chain.joint_angles == pytest.approx((175 * np.pi / 180, -85 * np.pi / 180, 92 * np.pi / 180))
    assert (read.material.density, read.material.yield_strength, read.thickness) == (2739.0, 411.0, 9.7)


def test_integers_are_accepted_for_numbers(tmp_path: Path) -> None:
    read = stage(edited("9.7", "10").replace("33.5", "33"), tmp_path / "x.toml")
    assert (read.thickness, read.chain.link_lengths) == (10.0, (31.0, 33.0, 23.0))
    assert isinstance(read.thickness, float)
    assert isinstance(read.chain.link_lengths[1], float)


def test_a_stage_is_frozen_hashable_and_changed_by_copy(tmp_path: Path) -> None:
    read = stage(VALID, tmp_path / "x.toml")
    with pytest.raises(ValidationError, match="frozen"):
        read.thickness = 3.0
    thinner = read.model_copy(update={"thickness": 3.0})
    assert {read: 1, thinner: 2}[stage(VALID, tmp_path / "x.toml")] == 1
    assert thinner.hash != read.hash


def test_an_override_changes_its_hinge_and_no_other(tmp_path: Path) -> None:
    plain = stage(VALID, tmp_path / "x.toml")
    changed = stage(VALID + ELBOW + "neck_mm = 0.52\naxis_deg = 30\n", tmp_path / "x.toml")
    for chain in CHAINS:
        for name in HINGE_NAMES:
            if (chain, name) != (2, "elbow"):
                assert changed.hinge(chain, name) == plain.hinge(chain, name)
    elbow = changed.hinge(2, "elbow")
    assert (elbow.radius, elbow.neck, elbow.prismatic) == (1.6, 0.52, False)
    assert elbow.axis == pytest.approx(np.pi / 6)
    assert changed.array("neck").tolist() == [[0.53, 0.47, 0.51], [0.53, 0.52, 0.51], [0.53, 0.47, 0.51]]
    assert plain.chains_alike
    assert not changed.chains_alike


def test_an_override_can_free_and_lock_the_axial_motion(tmp_path: Path) -> None:
    free = stage(VALID + ELBOW + "prismatic = true\n", tmp_path / "x.toml")
    locked = stage(VALID + ELBOW.replace("elbow", "base") + "prismatic = false\n", tmp_path / "x.toml")
    assert (stage(VALID, tmp_path / "x.toml").mobility, free.mobility, locked.mobility) == (6, 7, 5)
    assert free.array("prismatic").tolist() == [[True, False, False], [True, True, False], [True, False, False]]
    assert locked.array("prismatic").dtype == np.bool_


def test_chains_are_alike_when_overrides_change_all_three(tmp_path: Path) -> None:
    text = VALID + "".join(ELBOW.replace("2", str(chain)) + "neck_mm = 0.6\n" for chain in CHAINS)
    assert stage(text, tmp_path / "x.toml").chains_alike


@pytest.mark.parametrize(("chain", "name"), [(0, "base"), (4, "base"), (1, "knee"), (-1, "elbow")])
def test_a_hinge_that_does_not_exist_is_an_error(chain: int, name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no hinge"):
        stage(VALID, tmp_path / "x.toml").hinge(chain, name)


def test_an_array_of_something_else_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="axis"):
        stage(VALID, tmp_path / "x.toml").array("axis")  # type: ignore[call-overload]


SAME = {
    "another name": edited("generic stage", "the same stage"),
    "another name of the material": edited("generic metal", "the same metal"),
    "provenance": added('[provenance]\n"chain" = "assumed"\n'),
    "override equal to nothing": added(ELBOW + "neck_mm = 0.47\n"),
    "default written out": edited("neck_mm = 0.47", "neck_mm = 0.47\nprismatic = false"),
    "integer": edited("31.0", "31"),
    "another order": edited("radius_mm = 16.0\nhub_radius_mm = 7.0", "hub_radius_mm = 7.0\nradius_mm = 16.0"),
    "exponent": edited("9.7", "97e-1"),
}
DIFFERENT = {
    "last digit": edited("9.7", repr(np.nextafter(9.7, 10).item())),
    "modulus": edited("68.3", "68.4"),
    "poisson": edited("0.29", "0.28"),
    "density": edited("2739.0", "2732.0"),
    "strength": edited("411.0", "412.0"),
    "link": edited("33.5", "33.6"),
    "links exchanged": edited("31.0, 33.5", "33.5, 31.0"),
    "angle": edited("-85.0", "-86.0"),
    "width": edited("8.9", "8.8"),
    "neck": edited("0.47", "0.48"),
    "prismatic": edited("true", "false"),
    "axis": edited("0.47", "0.47\naxis_deg = 0.0"),
    "hub": edited("= 7.0", "= 7.1"),
    "override": added(ELBOW + "neck_mm = 0.52\n"),
    "the same override elsewhere": added(ELBOW.replace("2", "3") + "neck_mm = 0.52\n"),
}


@pytest.mark.parametrize("text", SAME.values(), ids=SAME.keys())
def test_what_is_not_physical_does_not_change_the_hash(text: str, tmp_path: Path) -> None:
    assert stage(text, tmp_path / "x.toml").hash == stage(VALID, tmp_path / "y.toml").hash


def test_what_is_physical_changes_the_hash(tmp_path: Path) -> None:
    hashes = {stage(text, tmp_path / "x.toml").hash for text in (VALID, *DIFFERENT.values())}
    assert len(hashes) == 1 + len(DIFFERENT)


def test_overriding_a_hinge_in_every_chain_is_the_same_as_changing_it(tmp_path: Path) -> None:
    text = VALID + "".join(ELBOW.replace("2", str(chain)) + "neck_mm = 0.6\n" for chain in CHAINS)
    assert stage(text, tmp_path / "x.toml").hash == stage(edited("0.47", "0.6"), tmp_path / "x.toml").hash


def test_the_sign_of_zero_does_not_change_the_hash(tmp_path: Path) -> None:
    zeros = [stage(edited("-85.0", zero), tmp_path / "x.toml").hash for zero in ("0.0", "-0.0", "0")]
    assert len(set(zeros)) == 1


# --- provenance ----------------------------------------------------------------------------------------------------

SOURCES = """
[provenance]
"material" = "handbook"
"material.density_kg_m3" = "Assumed: weighed by hand"
"chain.link_lengths_mm" = "assumed: Table I"
"hinges" = "  ASSUMED"
"hinges.elbow" = "measured"
"override.2.elbow.neck_mm" = "assumed to be worn"
"""


def test_the_provenance_of_a_table_covers_its_keys(tmp_path: Path) -> None:
    read = stage(VALID + ELBOW + "neck_mm = 0.5\nradius_mm = 1.5\n" + SOURCES, tmp_path / "x.toml")
    assert read.sources["material.poissons_ratio"] == "handbook"
    assert read.sources["material.density_kg_m3"] == "Assumed: weighed by hand"
    assert read.sources["hinges.elbow.neck_mm"] == "measured"
    assert read.sources["override.2.elbow.neck_mm"] == "assumed to be worn"
    assert read.sources["override.2.elbow.radius_mm"] is None
    assert read.sources["thickness_mm"] is None
    with pytest.raises(KeyError):
        read.sources["chain.link_length_mm"]


def test_assumed_lists_every_value_with_an_assumed_source(tmp_path: Path) -> None:
    read = stage(VALID + ELBOW + "neck_mm = 0.5\nradius_mm = 1.5\n" + SOURCES, tmp_path / "x.toml")
    base = tuple(f"hinges.base.{key}" for key in ("radius_mm", "neck_mm", "prismatic"))
    platform = tuple(f"hinges.platform.{key}" for key in ("radius_mm", "neck_mm"))
    expected = ("material.density_kg_m3", "chain.link_lengths_mm", *base, *platform, "override.2.elbow.neck_mm")
    assert read.assumed == expected
    assert stage(VALID, tmp_path / "x.toml").assumed == ()


def numbers_in(data: Any, path: str = "") -> Iterator[str]:
    """List the numbers of a parsed file without flexfem: the chain of an override is none."""
    for key, value in data.items() if isinstance(data, dict) else ():
        here = f"{path}.{key}".removeprefix(".")
        if isinstance(value, dict):
            yield from numbers_in(value, here)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for item in value:
                about = item["name"] if key == "actuator" else f"{item['chain']}.{item['hinge']}"
                yield from numbers_in(item, f"{here}.{about}")
        elif not isinstance(value, str | bool) and key not in ("chain", "between"):
            yield here


@pytest.mark.parametrize("text", [VALID, added(ELBOW + "neck_mm = 0.5\naxis_deg = 1\n")], ids=["plain", "override"])
def test_numeric_key_paths_are_the_numbers_of_the_file(text: str, tmp_path: Path) -> None:
    assert set(numeric_key_paths(stage(text, tmp_path / "x.toml"))) == set(numbers_in(tomllib.loads(text)))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_stage_says_where_every_number_comes_from(path: Path) -> None:
    shipped = load_stage(path)
    numbers = set(numbers_in(tomllib.loads(path.read_text())))
    assert numbers == set(numeric_key_paths(shipped))
    assert [key for key in numbers if not shipped.sources[key]] == []


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_stage_admits_that_its_material_is_assumed(path: Path) -> None:
    shipped = load_stage(path)
    assert {key for key in key_paths(shipped) if key.startswith("material.")} <= set(shipped.heat_doubts.assumed)
    assert "frame.expansion_um_per_m_k" in shipped.heat_doubts.assumed and len(shipped.assumed) == 17


def test_the_two_reference_stages_differ_in_the_base_hinge_alone() -> None:
    six, three = (load_stage(SHIPPED[0].parent / f"mobility{n}.toml") for n in (6, 3))
    assert (six.mobility, three.mobility) == (6, 3)
    assert six.chains_alike
    assert three.chains_alike
    assert set(three.array("radius").flat) == {1.5}
    base = six.hinges.model_copy(update={"base": three.hinges.base})
    assert six.model_copy(update={"hinges": base}).hash == three.hash


def test_constants_of_plane_strain_and_the_stress_it_holds_out_of_the_plane():
    """nu = 1/4: E / (1 - nu^2) = 16/15 E, nu / (1 - nu) = 1/3; the stress across is nu times the sum of those in it."""
    found = elastic("plane_strain", 60.0, 0.25)
    np.testing.assert_allclose([found.youngs_modulus, found.poissons_ratio], [64.0, 1 / 3], rtol=1e-15)
    for model in ("plane_stress", "corrected"):
        assert elastic(model, 60.0, 0.25) == (60.0, 0.25) and out_of_plane(model, 0.25) == 0.0
    assert out_of_plane("plane_strain", 0.25) == 0.25


def test_numbers_in_doubt_are_counted_by_what_they_are_of():
    keys = ["stage: thickness_mm", "hinges.base.neck_mm", "override.2.actuator.base.preload_n", "actuator.base.arm_mm"]
    keys += ["frame.expansion_um_per_m_k", "material.expansion_um_per_m_k", "case: points", "measured: pole.height_mm"]
    assert scopes_of(keys) == (
        "2 of geometry and material, 2 of the drive, 2 of expansion, 1 of the case, 1 of the measurements"
    )
    assert scopes_of([]) == ""
