"""The reference of cell.toml, generated from the schema for editors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from texts import code, plain, table

from axisbus.cell.json_schema import schema_of_cells

_ABOUT = """# Every key of `cell.toml`

All tables and keys, generated from the schema that axisbus uses to read cell files; `axisbus check --schema` prints the schema for
an editor. [The cell file](../cell-file.md) explains how the keys work together, with examples.
"""
_NAMES = {"nodes": "N", "axes": "NAME", "groups": "NAME", "gantries": "NAME", "io": "NAME", "pdo": "NAME"}


def pages() -> Mapping[str, str]:
    """Return the page of the keys."""
    schema = schema_of_cells()
    parts = [_ABOUT]
    for name, each in schema["properties"].items():
        parts += _tables(name, each)
    return {"reference/cell-toml": "\n".join(parts)}


def _tables(name: str, schema: Mapping[str, Any]) -> Iterator[str]:
    """Yield a table and its subtables; a table whose names the user chooses is shown with a placeholder."""
    if "patternProperties" in schema:
        (inner,) = schema["patternProperties"].values()
        yield from _table(f"{name}.{_NAMES[name.rpartition('.')[2]]}", inner, schema.get("description", ""))
    else:
        yield from _table(name, schema, schema.get("description", ""))


def _table(name: str, schema: Mapping[str, Any], about: str) -> Iterator[str]:
    keys = schema.get("properties", {})
    rows = [
        (code(key), _kind(each), _required(key, schema) + plain(each.get("description", "")))
        for key, each in keys.items()
        if not _is_table(each)
    ]
    yield f"## `[{name}]`\n\n{plain(about)}\n"
    if rows:
        yield table(("key", "value", "meaning"), rows)
    for key, each in keys.items():
        if _is_table(each):
            yield from _tables(f"{name}.{key}", each)


def _is_table(schema: Mapping[str, Any]) -> bool:
    return schema.get("type") == "object"


def _required(key: str, schema: Mapping[str, Any]) -> str:
    return "**Required.** " if key in schema.get("required", ()) else ""


def _kind(schema: Mapping[str, Any]) -> str:
    """Return the permitted values as a short text."""
    if "enum" in schema:
        return ", ".join(code(_toml(each)) for each in schema["enum"])
    if "const" in schema:
        return code(_toml(schema["const"]))
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(_kind(each) for each in schema[several]))
    kinds = schema.get("type", "any")
    names = [kinds] if isinstance(kinds, str) else kinds
    return " or ".join(_named(name, schema) for name in names)


def _named(name: str, schema: Mapping[str, Any]) -> str:
    if name == "array":
        return f"list of {_kind(schema['items'])}" if isinstance(schema.get("items"), dict) else "list"
    bounds = [
        f"{word} {schema[key]}"
        for key, word in (
            *(("minimum", "from"), ("exclusiveMinimum", "above")),
            *(("maximum", "to"), ("exclusiveMaximum", "below")),
        )
        if key in schema
    ]
    return " ".join([{"string": "text", "boolean": "true, false"}.get(name, name), *bounds])


def _toml(value: object) -> str:
    return (
        str(value).lower()
        if isinstance(value, bool)
        else f'"{value}"'
        if isinstance(value, str)
        else str(value)
    )
