"""Pages of the reference in Markdown: every key of a kind of file, and what is known by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from flexfem.files.provenance import is_assumed
from flexfem.files.writing import markdown_table
from flexfem.mechanism.actuators import catalogue
from flexfem.mechanism.materials import KEYS, REGISTERED, materials
from flexfem.reference.formats import format_of
from flexfem.reference.keys import KeyRow, KeyTable, tables_of
from flexfem.refused import BadInput
from flexfem.study.columns import MEANINGS
from flexfem.units import unit_of

HEAD = ("key", "meaning", "unit", "value", "default", "example")
MUST = r" \*"
MARKED = r"Keys marked \* must be given; a file with other keys than these is refused."
TOP = "Top of the file"
OVERRIDE = "override"  # its other keys are those of hinges and actuators


class FormatTables(NamedTuple):
    """Tables of a format on a page: `only` those of a name, or all but those `without`."""

    format: str
    only: str | None = None
    without: tuple[str, ...] = ()

    def holds(self, name: str) -> bool:
        """Whether a table is on the page."""
        return name == self.only if self.only else name not in self.without


class ReferencePage(NamedTuple):
    """A page: title, the parts of formats, and what comes after their keys."""

    title: str
    parts: tuple[FormatTables, ...]
    after: Callable[[], str] = str


def page(name: str) -> str:
    """A page of the reference in Markdown. Raises BadInput, saying which there are."""
    if name not in PAGES:
        raise BadInput(f"page {name!r} is not known, expected one of: {', '.join(PAGES)}")
    of = PAGES[name]
    parts = [block for part in of.parts for block in _blocks(part, several=len(of.parts) > 1)]
    return "\n\n".join(filter(None, [f"# {of.title}", MARKED, *parts, of.after()])) + "\n"


def _blocks(part: FormatTables, several: bool) -> Iterator[str]:
    of, every = format_of(part.format), tables_of(part.format)
    if several:
        yield f"## {of.title}"
    yield of.about if part.only is None else "A table of a [stage file](stage.md)."
    found = [table for table in every if part.holds(table.name) and (table.rows or _holds_none(table, every))]
    others = {(row.key, row.meaning) for table in every if table.name != OVERRIDE for row in table.rows}
    while found:
        first = found[0]
        alike = [each for each in found if each.rows == first.rows]
        yield f"{'###' if several else '##'} {_heading(alike)}"
        yield _about(alike)
        yield _table([row for row in first.rows if first.name != OVERRIDE or (row.key, row.meaning) not in others])
        found = [each for each in found if each not in alike]


def _holds_none(table: KeyTable, every: list[KeyTable]) -> bool:
    return bool(table.name) and not any(each.name.startswith(f"{table.name}.") for each in every)


def _heading(alike: list[KeyTable]) -> str:
    return ", ".join(f"`{each.header}`" if each.name else TOP for each in alike)


def _about(alike: list[KeyTable]) -> str:
    """What the tables are; the top of a file is what the file is."""
    if len(alike) == 1:
        return f"{alike[0].about}." if alike[0].name else ""
    return "\n".join(f"- `{each.header}`: {each.about}." for each in alike)


def _table(rows: list[KeyRow]) -> str:
    """The keys of a table, where numbers come from last."""
    return (
        ""
        if not rows
        else markdown_table(
            HEAD,
            (
                (
                    f"`{row.key}`" + MUST * row.needed,
                    row.meaning,
                    row.unit,
                    row.value,
                    f"`{row.default}`" if row.default else "",
                    f"`{row.example}`",
                )
                for row in sorted(rows, key=lambda row: row.key == "provenance")
            ),
        )
    )


def _registered() -> str:
    """The registered materials, their numbers and sources."""
    shown = [key for key in KEYS if any(key in _numbers(name) for name in materials())]
    head = ("`name`", *(f"`{key}`" for key in shown))
    rows = [(f"`{name}`", *(_number(name, key) for key in shown)) for name in materials()]
    sources = [f"- `{name}`: {'; '.join(_sources(name))}" for name in materials()]
    return "\n\n".join(
        [
            "## Registered materials",
            "At room temperature. Where a fatigue constant or an expansion is not given, none was found with a source. "
            "`flexfem check` prints the source of every number; `flexfem.register_material` adds your own.",
            markdown_table(head, rows, "l" + "r" * len(shown)),
            "\n".join(sources),
        ]
    )


def _numbers(name: str) -> dict[str, object]:
    return materials()[name].model_dump(by_alias=True, exclude_none=True)


def _number(name: str, key: str) -> str:
    """A number of a registered material, marked where it is assumed."""
    value, of = _numbers(name).get(key), REGISTERED[name]
    doubt = " (assumed)" if is_assumed(of.sources.get(key, of.source)) else ""
    return "" if value is None else f"{value}{doubt}"


def _sources(name: str) -> Iterator[str]:
    of = REGISTERED[name]
    yield of.source
    for key, text in of.sources.items():
        yield f"`{key}`: {text}"


def _stacks() -> str:
    head = ("`stack`", "maker", "stroke, µm", "blocking force, N", "stiffness, N/µm", "at, V")
    rows = [
        (
            f"`{name}`",
            one.maker,
            f"{1e3 * one.stroke:g} ± {1e3 * one.tolerance:g}",
            f"{one.blocking_force:g}",
            f"{one.blocking_force / one.stroke / 1e3:.3g}",
            f"{one.voltage:g}",
        )
        for name, one in catalogue().items()
    ]
    return "## Catalogue of stacks\n\n" + markdown_table(head, rows, "llrrrr")


def _outputs() -> str:
    head = ("column", "unit", "meaning")
    rows = [
        (
            ", ".join(f"`{each}`" for each in group),
            ", ".join(dict.fromkeys(str(unit_of(each)) for each in group if str(unit_of(each)))),
            said,
        )
        for group, said in MEANINGS.items()
    ]
    return "## Outputs\n\n" + markdown_table(head, rows)


def _quantities() -> str:
    return """## Quantities

Expressions name outputs of [studies](study.md) and keys of the stage file, and besides

- `mass_kg`: of what is drawn;
- `error_x_percent`, `error_y_percent`, `error_theta_percent`: error of the model of `paper_formula` along a command;
- with `[tolerance]`, `coupling_xy_95`, `coupling_xt_95`, `coupling_yt_95`: what the coupling does not exceed in 95 % of
  stages, and `coupling_95`, of the largest of the three."""


PAGES: Mapping[str, ReferencePage] = MappingProxyType(
    {
        "stage": ReferencePage("Stage files", (FormatTables("stage", without=("material", "actuator")),)),
        "material": ReferencePage(
            "Materials", (FormatTables("stage", only="material"), FormatTables("material")), _registered
        ),
        "actuator": ReferencePage(
            "Actuators and stacks", (FormatTables("stage", only="actuator"), FormatTables("stack")), _stacks
        ),
        "case": ReferencePage("Case files", (FormatTables("case"),)),
        "study": ReferencePage("Study files", (FormatTables("study"),), _outputs),
        "fixture": ReferencePage(
            "Set-ups of the experiment, and measurements",
            (FormatTables("fixture"), FormatTables("measured", without=("measured",)), FormatTables("necks")),
        ),
        "requirements": ReferencePage("Requirements files", (FormatTables("requirements"),), _quantities),
    }
)
