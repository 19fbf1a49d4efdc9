"""Materials of a user's own TOML file, which a stage file names beside the material: `[material] name, file`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from pydantic import ConfigDict, Field, ValidationError, create_model, model_validator

from flexfem.files.json_schema import Rule, ruled
from flexfem.files.keypath import key_path
from flexfem.files.lines import LineIndex
from flexfem.files.refusals import place_of, problem_of, refusal, shown
from flexfem.files.toml import Label, Path, Table, read_toml, validate
from flexfem.refused import BadInput
from flexfem.stage.materials import KEYS, Material, Registered, whole_fatigue


class Entry(Material):
    """A table of a file of materials: the numbers of one, which goes by the name of its table.

    source : of all its numbers, but for those that `sources` names by key.
    """

    model_config = ConfigDict(json_schema_extra=ruled(also=lambda schema: _without_its_name(schema)))

    name: Label = "of a file"
    source: Label = Field(
        description='Where its numbers come from; begins with "assumed" when they are', examples=["works certificate 7"]
    )
    sources: Mapping[str, Label] = Field(
        default_factory=dict,
        description="Of single numbers by their key, where they have another source",
        examples=[{"poissons_ratio": "assumed: as of others"}],
    )

    @model_validator(mode="after")
    def _goes_by_its_table(self) -> Entry:
        if "name" in self.model_fields_set:
            raise refusal("no name: a material goes by the name of its table", "name")
        return self

    @model_validator(mode="after")
    def _sources_are_of_keys(self) -> Entry:
        for key in self.sources:
            if key not in KEYS:
                raise refusal(f"a key of a material: {', '.join(KEYS)}", "sources", key)
        return self


def _without_its_name(schema: Rule) -> None:
    del schema["properties"]["name"]
    schema["properties"]["sources"]["propertyNames"] = {"enum": list(KEYS)}
    schema["allOf"] = [whole_fatigue()]


def read_materials(path: Path) -> dict[str, Registered]:
    """The materials of a TOML file, a table each with their numbers and `source`, by name.

    Raises BadInput, naming file and line, when a key is missing, unknown or has a value that is not possible.
    """
    data, lines = read_toml(path)
    fields: Any = {f"table_{k}": (Entry, Field(alias=name)) for k, name in enumerate(data)}
    made = validate(create_model("MaterialsFile", __base__=Table, **fields), path)
    found = {}
    for k, name in enumerate(data):
        entry: Entry = getattr(made, f"table_{k}")
        content = {"name": name, **_numbers(entry)}
        try:
            found[name] = Registered(Material.model_validate(content), entry.source, dict(entry.sources))
        except ValidationError as error:
            problem = problem_of(error.errors(include_url=False)[0], content)
            key, place = key_path((name, *problem.path)), place_of(path, lines.line((name, *problem.path)))
            raise BadInput(f"{place}: {key}: expected {problem.expected}") from None
    return found


def with_material_of_file(path: Path, data: dict[str, Any], lines: LineIndex) -> dict[str, Any]:
    """What the stage file at `path` says, with the numbers of a material that it names in a `file` beside it.

    Raises BadInput as `read_materials`, and when the file has no material of that name.
    """
    table, stated = data.get("material"), data.get("provenance", {})
    if not isinstance(table, dict) or "file" not in table or not isinstance(stated, dict):
        return data
    file, name, place = table["file"], table.get("name"), place_of(path, lines.line(("material", "file")))
    if set(table) != {"name", "file"} or not isinstance(file, str) or not isinstance(name, str):
        raise BadInput(f"{place}: material.file = {shown(file)}, expected a file name, beside material.name alone")
    beside = FilePath(path).parent / file
    found = read_materials(beside)
    if name not in found:
        known = ", ".join(found) or "one material or more"
        raise BadInput(f"{place}: material.name = {shown(name)}, expected one that {place_of(beside)} has: {known}")
    sources = {key: f"{text}, {file}" for key, text in found[name].provenance.items()}
    return data | {"material": {"name": name, **_numbers(found[name].material)}, "provenance": sources | stated}


def _numbers(of: Material) -> dict[str, Any]:
    return of.model_dump(by_alias=True, exclude_none=True, exclude={"name", "source", "sources"})
