"""Every field of a design file as Markdown tables, from the JSON Schema that `optopad schema` writes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

UNITS = {
    "_v_per_us": "V/µs",
    "_pa": "pA",
    "_mv": "mV",
    "_bytes_per_s": "bytes/s",
    "_g_per_cm3": "g/cm³",
    "_db_per_cm": "dB/cm",
    "_per_hour": "1/h",
    "_mm": "mm",
    "_deg": "degrees",
    "_us": "µs",
    "_nm": "nm",
    "_um": "µm",
    "_mpa": "MPa",
    "_mhz": "MHz",
    "_khz": "kHz",
    "_hz": "Hz",
    "_ohm": "ohm",
    "_counts": "counts",
    "_mw": "mW",
    "_ma": "mA",
    "_na": "nA",
    "_pf": "pF",
    "_a_per_w": "A/W",
    "_minutes": "minutes",
    "_c": "°C",
    "_v": "V",
    "_s": "s",
}
"""Unit by the end of a field's name, longer endings first."""

QUANTITY = "Quantity"
"""Title of the table of a value with its source; the page describes its fields once, in its head."""

Schema = dict[str, Any]


@dataclass(frozen=True)
class Field:
    """One field of a design file: `path` as `--set` takes it, `default` as a file would say it, "needed" if it must."""

    path: str
    unit: str
    allowed: str
    default: str
    meaning: str


def every_field() -> str:
    """Markdown: a heading and a table for every section of a design file."""
    schema = design_schema()
    lines: list[str] = []
    for title, about, fields in sections(schema):
        lines += [f"## {title}", "", about, ""]
        lines += ["| field | unit | allowed | default | meaning |", "|---|---|---|---|---|"]
        lines += [_row(field) for field in fields] + [""]
    return "\n".join(lines)


def design_schema() -> Schema:
    """What `optopad schema` writes."""
    from optopad.design.io import file_schema

    return file_schema()


def sections(schema: Schema) -> Iterator[tuple[str, str, list[Field]]]:
    """Heading, what the section is, and fields: the top of the file, then table by table."""
    tops, rest = [], []
    for name, part in schema["properties"].items():
        (rest if name in ("layout", "catalog") or _is_table(schema, part) else tops).append(name)
    yield (
        "Top of the file",
        "Before the first table.",
        [_field(schema, schema, name, name) for name in tops],
    )
    for name in rest:
        part = _resolved(schema, _present(schema["properties"][name]))
        if name == "layout":
            yield from _patterns(schema, part)
        elif name == "catalog":
            yield from _entries(schema, part)
        else:
            yield f"`[{name}]`", _line(part.get("description", "")), list(_fields(schema, part, f"{name}."))


def _patterns(schema: Schema, layout: Schema) -> Iterator[tuple[str, str, list[Field]]]:
    """The patterns of a layout: `layout` is a list of them."""
    for reference in layout["items"]["oneOf"]:
        part = _resolved(schema, reference)
        name = part["properties"]["pattern"]["const"]
        about = f'{_line(part.get("description", ""))} A table `[[layout]]` with `pattern = "{name}"`.'
        yield f"`[[layout]]`, {name}", about, list(_fields(schema, part, "layout.N."))


def _entries(schema: Schema, catalog: Schema) -> Iterator[tuple[str, str, list[Field]]]:
    """Own parts and materials, in the design under `catalog.` or in a file of their own without it."""
    for group, table in catalog["properties"].items():
        part = _resolved(schema, next(iter(table["patternProperties"].values())))
        about = (
            f"{_line(part.get('description', ''))} In a file of your own, named by `catalog_files`; in the design "
            f"itself `[catalog.{group}.NAME]`."
        )
        yield f"`[{group}.NAME]`", about, list(_fields(schema, part, f"{group}.NAME."))


def _fields(schema: Schema, part: Schema, prefix: str) -> Iterator[Field]:
    """Fields of a table, each followed by those of the tables inside it."""
    for name, raw in part.get("properties", {}).items():
        path = prefix + name
        yield _field(schema, part, name, path)
        inner = {
            one.path: one for table, end in _inner(schema, raw) for one in _fields(schema, table, path + end)
        }
        yield from inner.values()


def _inner(schema: Schema, raw: Schema) -> Iterator[tuple[Schema, str]]:
    """Tables with named fields inside a field, and how a path goes on into them; none for a quantity."""
    part = _resolved(schema, raw)
    for one in part.get("anyOf", part.get("oneOf", [])):
        yield from _inner(schema, one)
    if "items" in part:
        yield from ((table, f".N{end}") for table, end in _inner(schema, part["items"]))
    if part.get("properties") and not _is_quantity(part):
        yield part, "."


def _field(schema: Schema, owner: Schema, name: str, path: str) -> Field:
    raw = owner["properties"][name]
    whole = {**_resolved(schema, raw), **{key: raw[key] for key in ("description", "default") if key in raw}}
    return Field(
        path,
        _unit_of(name, whole),
        _allowed(schema, raw),
        _default(name, owner, whole),
        _meaning(whole, raw),
    )


def _meaning(whole: Schema, raw: Schema) -> str:
    """The schema's description; a table's own, if the field has none, only where it is not one of many."""
    said = raw.get("description")
    if said is None and not _is_quantity(whole):
        said = whole.get("description")
    return _line(said or "")


def _is_quantity(part: Schema) -> bool:
    return part.get("title") == QUANTITY or any(_is_quantity(one) for one in part.get("anyOf", []))


def _unit_of(name: str, part: Schema) -> str:
    if part.get("type") in ("string", "boolean"):
        return ""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def _allowed(schema: Schema, raw: Schema) -> str:
    """Range, choices or form, in words; what may be left out says so by its default."""
    part = _resolved(schema, raw)
    if part.get("title") == QUANTITY:
        return "a quantity"
    if "anyOf" in part or "oneOf" in part:
        kinds = [one for one in part.get("anyOf", part.get("oneOf")) if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(_allowed(schema, one) for one in kinds))
    if "const" in part:
        return f"`{json.dumps(part['const'])}`"
    if "enum" in part:
        return ", ".join(f"`{json.dumps(value)}`" for value in part["enum"])
    kind = part.get("type")
    if kind in ("number", "integer"):
        return _range(part)
    if kind == "array":
        return _list(schema, part)
    if kind == "object":
        return "a table" if part.get("properties") or "title" in part else "names and values"
    return {"boolean": "`true`, `false`", "string": "text"}.get(str(kind), "a value")


def _range(part: Schema) -> str:
    word = "whole, " if part["type"] == "integer" else ""
    low, high = part.get("minimum"), part.get("maximum")
    above, below = part.get("exclusiveMinimum"), part.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f"{word}{_number(low)} to {_number(high)}"
    if above is not None and high is not None:
        return f"{word}above {_number(above)}, to {_number(high)}"
    ends = {"from": low, "above": above, "to": high, "below": below}
    said = [f"{end} {_number(value)}" for end, value in ends.items() if value is not None]
    return word + ", ".join(said) if said else ("a whole number" if word else "a number")


def _list(schema: Schema, part: Schema) -> str:
    if "prefixItems" in part:
        inner = dict.fromkeys(_allowed(schema, one) for one in part["prefixItems"])
        return f"{len(part['prefixItems'])} values, each {' or '.join(inner)}"
    low, high = part.get("minItems"), part.get("maxItems")
    size = f" of {low or 0} to {high}" if high is not None else (f" of {low} or more" if low else "")
    return f"a list{size}: {_allowed(schema, part.get('items', {}))}"


def _default(name: str, owner: Schema, part: Schema) -> str:
    if name in owner.get("required", []):
        return "needed"
    default = part.get("default")
    if default is None or default in ({}, []):
        return "left out"
    return f"`{json.dumps(default, ensure_ascii=False)}`"


def _is_table(schema: Schema, raw: Schema) -> bool:
    return bool(_resolved(schema, _present(raw)).get("properties"))


def _present(raw: Schema) -> Schema:
    """What an optional table is where it is there."""
    others = [one for one in raw.get("anyOf", []) if one.get("type") != "null"]
    return others[0] if len(others) == 1 and len(raw["anyOf"]) == 2 else raw


def _resolved(schema: Schema, part: Schema) -> Schema:
    reference = part.get("$ref")
    return schema["$defs"][reference.removeprefix("#/$defs/")] if reference else part


def _number(value: float) -> str:
    return f"{int(value):,}" if float(value).is_integer() and abs(value) < 1e7 else f"{value:g}"


def _line(text: str) -> str:
    """The first paragraph, as one line."""
    return " ".join(text.partition("\n\n")[0].split())


def _row(field: Field) -> str:
    cells = (f"`{field.path}`", field.unit, field.allowed, field.default, field.meaning)
    return "| " + " | ".join(cell.replace("|", "\\|").replace("*", "\\*") for cell in cells) + " |"
