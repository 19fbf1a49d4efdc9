"""What the JSON schema of a file says beyond its keys and limits: rules between keys, in terms of JSON schema draft 7.

Every rule is a schema of a table. `Keywords` adds to the schema of a type, `ruled` to that of a model. What a rule
refuses the model refuses, too; the model refuses more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

Rule: TypeAlias = dict[str, Any]

UNIT = "x-unit"  # keyword of every number: its unit
COUNT: dict[str, Any] = {UNIT: "1"}  # of a number without a unit
OF_THE_KEY: dict[str, Any] = {UNIT: "of the key"}  # of a number in the unit of what it stands for


class Keywords(NamedTuple):
    """Annotation of a type: keywords that its JSON schema has besides, found when the schema is made."""

    found: Callable[[], Rule]

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], Rule]) -> Rule:
        return {**handler(core), **self.found()}


def keywords(**given: Any) -> Keywords:
    """Keywords that are known beforehand."""
    return Keywords(lambda: given)


def ruled(*rules: Rule, also: Callable[[Rule], None] | None = None) -> Callable[[Rule], None]:
    """For `json_schema_extra` of a model: all rules hold of its tables; `also` changes the schema itself."""

    def added(schema: Rule) -> None:
        if rules:
            schema["allOf"] = list(rules)
        if also is not None:
            also(schema)

    return added


def has(*keys: str) -> Rule:
    """All these keys are there."""
    return {"required": list(keys)}


def without(*keys: str) -> Rule:
    """None of these keys is there."""
    return {"propertyNames": {"not": {"enum": list(keys)}}}


def only(*keys: str) -> Rule:
    """No other key is there."""
    return {"propertyNames": {"enum": list(keys)}}


def says(key: str, *values: Any) -> Rule:
    """The key is there and has one of these values."""
    return {"properties": {key: {"enum": list(values)}}, "required": [key]}


def both(*rules: Rule) -> Rule:
    """All of these rules hold."""
    return {"allOf": list(rules)}


def either(*rules: Rule) -> Rule:
    """One of these rules holds, or more."""
    return {"anyOf": list(rules)}


def when(condition: Rule, then: Rule, otherwise: Rule | None = None) -> Rule:
    """Where a rule holds, another does."""
    return {"if": condition, "then": then} | ({} if otherwise is None else {"else": otherwise})


def beside(needed: Mapping[str, list[str]]) -> Rule:
    """Each key has these keys beside it."""
    return {"dependencies": dict(needed)}
