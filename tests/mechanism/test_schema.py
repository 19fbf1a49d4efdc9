"""Stage files: what is refused and in which words, and what a stage that is accepted means."""

from __future__ import annotations

import signal
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from flexfem.files.refusals import KeyPath
from flexfem.files.toml import MAX_BYTES, read_toml
from flexfem.paper.designs import design_arrays
from flexfem.paper.stage import CHAINS, HINGE_NAMES, Stage, load_stage
from flexfem.paper.stage_file import Plane
from flexfem.refused import BadInput

from ..conftest import with_changes

SHIPPED = sorted((Path(__file__).parents[2] / "geometry").glob("mobility*.toml"))
# s of processor time for a hostile file of at most 1 MiB; they take 1.5 s, quadratic reading
# minutes
PATIENCE = 15.0

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
    """Fail what takes more processor time, however busy the machine is; what hangs in a loop is
    ended.
    """

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


ELBOW = '\n[[override]]\nchain = 2\nhinge = "elbow"\n'
TWICE = (
    ELBOW
    + "neck_mm = 0.5\n"
    + ELBOW.replace("[[override]]", "[[override]] # again")
    + "radius_mm = 1.0\n"
)
MISSING = (
    ": name, thickness_mm, material.name, material.youngs_modulus_gpa, material.poissons_ratio, "
    "... , chain.link_lengths_mm, chain.joint_angles_deg, chain.link_width_mm, "
    "hinges.base.radius_mm, ... , hinges.platform.neck_mm, platform.radius_mm and "
    "platform.hub_radius_mm are missing"
)
STRANGE = 'platform."a\\nb" is an unknown key, expected one of radius_mm, hub_radius_mm'
OF_NOTHING = 'provenance."chain.link_length_mm" = "x", expected a key path of this file, ... did you mean chain.link_lengths'
# content, a piece of the line that its message must name (None: no line), pieces of the message
HOSTILE = {
    # numbers
    "negative neck": (edited("0.53", "-0.1"), "-0.1", "hinges.base.neck_mm = -0.1, expected > 0"),
    "kilometre link": (
        edited("33.5", "1e6"),
        "1e6",
        "chain.link_lengths_mm[1] = 1000000.0 ... <= 10000",
    ),
    "nan": (edited("9.7", "nan"), "nan", "thickness_mm = nan, expected a finite number"),
    "angle above a turn": (
        edited("175.0", "360.5"),
        "360.5",
        "joint_angles_deg[0] = 360.5, expected <= 360",
    ),
    "huge integer": (
        edited("9.7", "1" + 400 * "0"),
        "10000",
        "thickness_mm =  ... expected a number below",
    ),
    "integer of 5000 digits": (edited("9.7", 5000 * "7"), "7777", "too many digits"),
    # types
    "text for a number": (
        edited("0.53", '"0.53"'),
        '"0.53"',
        'neck_mm = "0.53", expected a number',
    ),
    "two links": (
        edited(", 23.0]", "]"),
        "33.5",
        "link_lengths_mm = [31.0, 33.5], expected 3 values, not 2",
    ),
    # keys
    "missing neck": (
        edited("neck_mm = 0.47\n", ""),
        "[hinges.elbow]",
        "hinges.elbow.neck_mm is missing",
    ),
    "misspelt key": (
        edited("neck_mm = 0.47", "nekc_mm = 0.47"),
        "nekc",
        "elbow.nekc_mm is an unknown key, did you mean",
    ),
    "strange key": (added('"a\\nb" = 1\n'), '"a\\nb"', STRANGE),
    "mistakes in file order": (
        edited("radius_mm = 3.9\nneck_mm = 0.53", "neck_mm = -1\nradius_mm = -2"),
        "-1",
        "hinges.base.neck_mm = -1, expected > 0 (and 1 more)",
    ),
    "array over lines": (
        edited("[31.0, 33.5, 23.0]", "[\n  31.0, # l1\n\n  -33.5,\n  23.0,\n]"),
        "link_lengths",
        "chain.link_lengths_mm[1] = -33.5",
    ),
    # overrides
    "override changes nothing": (
        added(ELBOW),
        "[[override]]",
        "2.elbow = {chain = 2 ... at least one of radius_mm, neck",
    ),
    "same hinge twice": (
        added(TWICE),
        "again",
        "override.2.elbow = { ... expected one override for each hinge",
    ),
    "unknown key in an override": (
        added(ELBOW + "neck = 0.5\n"),
        "neck = 0.5",
        "override.2.elbow.neck is an unknown key, did you mean neck_mm?",
    ),
    "override in single brackets": (
        added(ELBOW.replace("[[override]]", "[override]") + "neck_mm = 0.5\n"),
        "[override]",
        "expected an array of tables, [[override]]",
    ),
    # provenance
    "provenance of nothing": (
        added('[provenance]\n"chain.link_length_mm" = "x"\n'),
        'length_mm"',
        OF_NOTHING,
    ),
    "provenance without quotes": (
        added('[provenance]\nchain.link_width_mm = "x"\n'),
        'width_mm = "x',
        "provenance.chain = {link_width_mm ... write the whole key path in quotes",
    ),
    # not TOML, not text
    "empty": ("", None, MISSING),
    "prose": (40 * "dear reader " + "\n", "dear", "not TOML"),
    "latin-1": (
        edited("generic metal", "acier \xe9").encode("latin-1"),
        b"acier \xe9".decode("latin-1"),
        "byte 0xe9",
    ),
    "byte order mark": (b"\xef\xbb\xbf" + VALID.encode(), "generic stage", "byte order mark"),
    "too large": (VALID + MAX_BYTES * "#", None, "expected at most 1 MiB"),
    # built to break the reader
    "deep arrays": ("x = " + 100_000 * "[", "x", "nested deeper than 32 levels"),
    "deep header": ("[" + 100_000 * "a." + "a]\n", "a", "nested deeper than 32 levels"),
    "strings that never close": ('"""' + 200_000 * '\\"""' + "\\", '"""', "not TOML"),
    "many unknown keys": (
        "".join(f"k{n} = 1\n" for n in range(5_000)),
        "k0 = 1",
        "k0 is an unknown key ... (and 4999 more); name, thickness_mm, ",
    ),
    "very many links": (
        edited("23.0]", 50_000 * "1," + "1]"),
        "33.5",
        "..., expected at most 3 values, not 50003",
    ),
}


def refused(path: Path | str) -> str:
    with pytest.raises(BadInput) as caught:
        load_stage(path)
    message = str(caught.value)
    assert message.isprintable(), "one line, nothing a terminal would obey"
    return message


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_in_one_line_naming_file_line_key_value_and_expectation(
    name, tmp_path
) -> None:
    path = tmp_path / "hostile.toml"
    content, line_with, said = HOSTILE[name]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with processor_time():
        message = refused(path)
    text = content.decode("latin-1") if isinstance(content, bytes) else content
    line = "" if line_with is None else f", line {text[: text.index(line_with)].count(chr(10)) + 1}"
    assert message.startswith(f"{path}{line}: ")
    for piece in said.split(" ... "):
        assert piece in message
    assert len(message) < len(str(path)) + 600


# --- files that are not files
# --------------------------------------------------------------------------------------


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    assert refused(tmp_path / "none.toml") == f"{tmp_path}/none.toml: no such file"


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_refused(device: str) -> None:
    assert "a pipe, socket or device" in refused(device)


@pytest.mark.parametrize(
    "name", ["", "nul\0name", 5000 * "n", "loop.toml", "file/x.toml", "new\nline\x1b[2J"]
)
def test_a_name_that_cannot_be_opened_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("loop.toml").symlink_to("loop.toml")
    Path("file").touch()
    refused(name)


# --- any file
# ------------------------------------------------------------------------------------------------------

SOUP = [
    *(
        "a",
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
    *(
        '"""x\n[y]\nz = 1"""',
        "'''\nq=1'''",
        '""""q"""""',
        "1979-05-27 07:32:00",
        "nan",
        "\x00",
        "\r\n",
        "\r",
    ),
    *(
        ".",
        "=",
        " = ",
        "[",
        "]",
        "[[",
        "]]",
        "{",
        "}",
        ",",
        "\n",
        "\n",
        " ",
        "\n[a]\n",
        "\n[[a.b]]\n",
        "\na.b = 1\n",
    ),
]


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("any") / "any.toml"


@settings(max_examples=200)
@given(data=st.data())
def test_a_stage_file_damaged_anywhere_is_accepted_or_refused_cleanly(
    scratch: Path, data: st.DataObject
) -> None:
    text = VALID + ELBOW + 'neck_mm = 0.5\n[provenance]\n"chain" = "assumed"\n'
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + data.draw(st.sampled_from(["", *SOUP])) + text[end:]
    scratch.write_bytes(text.encode())
    try:
        load_stage(scratch)
    except BadInput as refusal:
        assert str(refusal).startswith(str(scratch)) and str(refusal).isprintable()


DOCUMENT = [  # each line, keys among misleading ones
    "# a.b = [",
    'k0 . "x.y" = "k0 = 1"',
    "zz = '''",
    "[chain]",
    "k1 = 1'''",
    'yy = """\\',
    '  k1 = 1"""',
    "  'k1' = 1 # k1 = 2",
    "xx = [",
    "1,",
    "]",
    "k2 = { y = [",
    "1,",
    "2], z = 3 }",
    "k3 = [ { x = 0 },",
    "",
    "{ x = 1 } ]",
    '[ "k4" .sub]',
    "# k5 = 2",
    "k5 = 1",
    "[[many]]",
    "[[many]]",
    "k6 = 1",
]
TRUE_LINES: dict[KeyPath, int] = {
    **{
        ("k0", "x.y"): 2,
        ("k1",): 8,
        ("k2", "z"): 12,
        ("k3", 1, "x"): 15,
        ("k4", "sub"): 18,
        ("k4", "sub", "k5"): 20,
    },
    **{("many", 0): 21, ("many", 1): 22, ("many", 1, "k6"): 23},
}


def test_the_line_of_a_key_is_where_it_stands(scratch: Path) -> None:
    scratch.write_text("\n".join(DOCUMENT))
    lines = read_toml(scratch)
    assert {path: lines.line(path) for path in TRUE_LINES} == TRUE_LINES


# --- what a stage means
# --------------------------------------------------------------------------------------------


def stage(text: str, path: Path) -> Stage:
    path.write_text(text)
    return load_stage(path)


def test_a_stage_is_in_inside_units_frozen_hashable_and_changed_by_copy(tmp_path: Path) -> None:
    read = stage(VALID, tmp_path / "x.toml")
    assert read.material.youngs_modulus == pytest.approx(68300.0)
    assert read.chain.joint_angles == pytest.approx(np.deg2rad([175.0, -85.0, 92.0]))
    assert (read.material.density, read.material.yield_strength, read.thickness) == (
        2739.0,
        411.0,
        9.7,
    )
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
    assert changed.array("neck").tolist() == [
        [0.53, 0.47, 0.51],
        [0.53, 0.52, 0.51],
        [0.53, 0.47, 0.51],
    ]
    assert plain.chains_alike
    assert not changed.chains_alike


SAME = {
    "another name": edited("generic stage", "the same stage"),
    "provenance": added('[provenance]\n"chain" = "assumed"\n'),
    "override equal to nothing": added(ELBOW + "neck_mm = 0.47\n"),
    "default written out": edited("neck_mm = 0.47", "neck_mm = 0.47\nprismatic = false"),
    "exponent": edited("9.7", "97e-1"),
}
DIFFERENT = {
    "last digit": edited("9.7", repr(np.nextafter(9.7, 10).item())),
    "modulus": edited("68.3", "68.4"),
    "link": edited("33.5", "33.6"),
    "neck": edited("0.47", "0.48"),
    "prismatic": edited("true", "false"),
    "axis": edited("0.47", "0.47\naxis_deg = 0.0"),
    "override": added(ELBOW + "neck_mm = 0.52\n"),
    "the same override elsewhere": added(ELBOW.replace("2", "3") + "neck_mm = 0.52\n"),
}


def test_what_is_physical_changes_the_hash_and_nothing_else(tmp_path: Path) -> None:
    same = {stage(text, tmp_path / "x.toml").hash for text in (VALID, *SAME.values())}
    different = {stage(text, tmp_path / "x.toml").hash for text in DIFFERENT.values()}
    assert len(same) == 1 and len(different - same) == len(DIFFERENT)


# --- provenance
# ----------------------------------------------------------------------------------------------------

SOURCES = """
[provenance]
"material" = "handbook"
"material.density_kg_m3" = "Assumed: weighed by hand"
"chain.link_lengths_mm" = "assumed: Table I"
"hinges" = "  ASSUMED"
"hinges.elbow" = "measured"
"override.2.elbow.neck_mm" = "assumed to be worn"
"""


def test_the_provenance_of_a_table_covers_its_keys_and_what_is_assumed_is_listed(
    tmp_path: Path,
) -> None:
    read = stage(VALID + ELBOW + "neck_mm = 0.5\nradius_mm = 1.5\n" + SOURCES, tmp_path / "x.toml")
    expected = {
        "material.poissons_ratio": "handbook",
        "material.density_kg_m3": "Assumed: weighed by hand",
        "hinges.elbow.neck_mm": "measured",
        "override.2.elbow.neck_mm": "assumed to be worn",
        "override.2.elbow.radius_mm": None,
        "thickness_mm": None,
    }
    assert {
        key: read.sources[key] for key in expected
    } == expected and "chain.link_length_mm" not in read.sources
    base = tuple(f"hinges.base.{key}" for key in ("radius_mm", "neck_mm", "prismatic"))
    platform = tuple(f"hinges.platform.{key}" for key in ("radius_mm", "neck_mm"))
    others = ("material.density_kg_m3", "chain.link_lengths_mm")
    assert read.assumed == (*others, *base, *platform, "override.2.elbow.neck_mm")
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


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_shipped_stage_says_where_every_number_comes_from(path: Path) -> None:
    shipped = load_stage(path)
    numbers = set(numbers_in(tomllib.loads(path.read_text())))
    assert numbers == {*super(Stage, shipped).numbers}
    assert [key for key in numbers if not shipped.sources[key]] == []


def test_constants_of_plane_strain_and_the_stress_it_holds_out_of_the_plane():
    """nu = 1/4: E / (1 - nu^2) = 16/15 E, nu / (1 - nu) = 1/3; the stress across is nu times the
    sum of those in it.
    """
    metal = {"material.youngs_modulus_gpa": 60.0, "material.poissons_ratio": 0.25}
    found = {
        model: design_arrays(with_changes(metal | {"model": model})) for model in get_args(Plane)
    }
    np.testing.assert_allclose(np.ravel(found["plane_strain"].elastic), [64e3, 1 / 3], rtol=1e-15)
    for model in ("plane_stress", "corrected"):
        assert (
            np.ravel(found[model].elastic).tolist() == [60e3, 0.25]
            and found[model].out_of_plane[0] == 0.0
        )
    assert found["plane_strain"].out_of_plane[0] == 0.25
