"""The table of the configuration: each key with its values, its default, and what it means.

Keys, their limits and meanings are those of the schemas. Defaults are those of `conf/`, whose comments give their
source.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from typing import Any

from pipeline.compose import compose
from pipeline.metrics.limits import flatten
from pipeline.params.config import Config

_HELD_ELSEWHERE = ("validation.limits", "validation.certificate.limits")  # the page of metrics has them
_WIDEST = 160  # characters of a line in Markdown
_BOUNDS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}


def noted_table(titles: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a table whose lines are at most 160 characters: a last cell that is too long stands below the table."""
    lines, notes = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"], []
    for row in rows:
        line = _line(row)
        if len(line) > _WIDEST:
            line = _line((*row[:-1], "see below"))
            notes.append(textwrap.fill(f"- {row[0]}: {row[-1]}", 120, subsequent_indent="  "))
        lines.append(line)
    return "\n".join([*lines, "", *notes]).rstrip()


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def configuration_table() -> str:
    """Return a table a section of the configuration."""
    schema = Config.model_json_schema()
    defaults = flatten(compose([]).model_dump(mode="json"))
    texts = []
    for section, node in schema["properties"].items():
        rows: dict[str, tuple[str, ...]] = {}
        for key, leaf in leaves(node, schema["$defs"], section):
            if key.startswith(_HELD_ELSEWHERE):
                continue
            values, default = values_of(leaf, schema["$defs"]), _shown(defaults.get(key, leaf.get("default", "")))
            meaning = leaf.get("description", "")
            if key in rows:  # of another kind of survey
                _, others, default, known = rows[key]
                values = others if values in others else f"{others}, {values}"
                meaning = known if meaning in known else f"{known}; or: {meaning}"
            rows[key] = (f"`{key.removeprefix(section + '.')}`", values, default, meaning)
        texts.append(f"### `{section}`\n\n{noted_table(('key', 'values', 'default', 'meaning'), rows.values())}")
    return "\n\n".join(texts)


def leaves(node: dict[str, Any], definitions: dict[str, Any], key: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each key of a schema that has no keys of its own, with its schema, in the schema's order."""
    if "$ref" in node:
        target = definitions[node["$ref"].rpartition("/")[2]]
        node = {**target, **{k: v for k, v in node.items() if k != "$ref"}}
    choices = [choice for choice in node.get("anyOf", node.get("oneOf", [])) if "$ref" in choice]
    if "properties" in node:
        for name, child in node["properties"].items():
            yield from leaves(child, definitions, f"{key}.{name}")
    elif choices:
        for choice in choices:
            yield from leaves(choice, definitions, key)
    else:
        yield key, node


def values_of(leaf: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Return what a key may hold: its choices, or its type with its bounds."""
    if "$ref" in leaf:
        return values_of(definitions[leaf["$ref"].rpartition("/")[2]], definitions)
    parts = leaf.get("anyOf") or leaf.get("oneOf")
    if parts:
        return " or ".join(dict.fromkeys(values_of(part, definitions) for part in parts))
    if "enum" in leaf:
        return ", ".join(f"`{value}`" for value in leaf["enum"])
    if "const" in leaf:
        return f"`{leaf['const']}`"
    bounds = [f"{sign} {leaf[name]:g}" for name, sign in _BOUNDS.items() if name in leaf]
    return " ".join([leaf.get("type", "any"), *bounds])


def _shown(value: Any) -> str:
    text = "" if value == "" else "null" if value is None else str(value)
    return f"`{text}`" if 0 < len(text) <= 40 else "" if not text else "(see `conf/`)"
