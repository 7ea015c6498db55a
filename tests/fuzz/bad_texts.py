"""Texts and designs with something wrong: what a slip of the keyboard, a program, or malice leaves in a TOML file."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from random import Random
from typing import Any

from optopad.design.fields.base import known_paths
from optopad.design.preset import PRESETS, preset_text
from optopad.design.spec import SensorDesign

FIELDS = known_paths(SensorDesign)
WORDS = ("hemisphere", "glossy", "A0", "osram-sfh206k", "E1", "../a", "/etc/hostname", "cavity.length_mm", "")
STRANGE = (
    "\x00",
    "\x1b[31m",
    "\x7f",
    "\u202e",
    "\u2028",
    "\ufeff",
    "é",
    "漢",
    "\U0001f600",
    "\r",
    "\t",
    '"',
    "\\",
    "a\nb",
)


@dataclass(frozen=True)
class Raw:
    """A value as it is to stand in the file."""

    text: str


def bad_design(chance: Random) -> bytes:
    """A preset with one to four faults, or a damaged text of one."""
    text = preset_text(chance.choice(PRESETS))
    if chance.random() < 0.65:
        document = tomllib.loads(text)
        for _ in range(chance.choice((1, 1, 1, 2, 4))):
            chance.choice(DOCUMENT_FAULTS)(document, chance)
        text = written(document)
        if chance.random() < 0.8:
            return text.encode()
    return damaged_text(text, chance)


def damaged_text(text: str, chance: Random) -> bytes:
    """A text with one to three faults of writing."""
    for _ in range(chance.choice((1, 1, 2, 3))):
        text = chance.choice(TEXT_FAULTS)(text, chance)
    content = text.encode("utf-8", "surrogatepass")
    return damaged_bytes(content, chance) if chance.random() < 0.15 else content


def damaged_bytes(content: bytes, chance: Random) -> bytes:
    """Cut, flipped, overwritten, lengthened or shortened."""
    if not content:
        return content
    at = chance.randrange(len(content))
    length = min(chance.choice((1, 4, 16, 300, 5_000)), len(content) - at)
    match chance.randrange(6):
        case 0:
            return content[:at]
        case 1:
            flipped = bytearray(content)
            for _ in range(chance.choice((1, 3, 20))):
                flipped[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
            return bytes(flipped)
        case 2:
            return content[:at] + bytes(length) + content[at + length :]
        case 3:
            return content[:at] + chance.randbytes(length) + content[at + length :]
        case 4:
            return content[:at] + content[at : at + length] + content[at:]
        case _:
            return content[:at] + content[at + length :]


def written(value: Any) -> str:
    """Nested data as TOML, a line a key at the top, all else in the line."""
    return "".join(f"{_key(name)} = {_inline(one)}\n" for name, one in value.items())


def bad_value(chance: Random) -> Any:
    """Something that few fields take."""
    size = chance.choice((1, 3, 60, 300, 5_000, 100_000))
    match chance.randrange(16):
        case 0:
            return Raw(chance.choice(("inf", "-inf", "nan", "-0.0", "1e308", "1e400", "5e-324", "1e-9")))
        case 1:
            return Raw(
                chance.choice(("-", ""))
                + chance.choice("123456789") * chance.choice((1, 10, 19, 100, 400, 5_000))
            )
        case 2:
            return Raw(chance.choice(("0x" + "f" * size, "0b" + "1" * size, "0o" + "7" * size)))
        case 3:
            return chance.choice(("x", *STRANGE)) * size
        case 4:
            return "".join(chance.choice((*STRANGE, *WORDS)) for _ in range(chance.randrange(1, 20)))
        case 5:
            return chance.choice(WORDS)
        case 6:
            return chance.choice((True, False))
        case 7:
            return Raw(chance.choice(("1979-05-27T07:32:00Z", "1979-05-27", "07:32:00", "1979-13-40")))
        case 8:
            return [chance.choice((1, 1.5, "a", -1, "cavity.length_mm"))] * chance.choice(
                (0, 1, 3, 70, 2_000, 20_000, 200_000)
            )
        case 9:
            return Raw("[" * min(size, 2_000) + "]" * min(size, 2_000))
        case 10:
            return {chance.choice(("a", "part", "x y", "\x1b")): 1}
        case 11:
            return {f"k{number}": number for number in range(min(size, 5_000))}
        case 12:
            return ".".join(["a"] * size)
        case 13:
            return chance.choice((0, -1, 1, 63, 2**31, 2**63, 2**64, 10**18))
        case 14:
            return 10.0 ** chance.uniform(-12.0, 12.0) * chance.choice((1.0, -1.0))
        case _:
            return Raw(chance.choice(("True", "none", "1,5", "3 mm", "[1, 2", "{a = 1", '"open', "'''", "=")))


def _set_field(document: dict[str, Any], chance: Random) -> None:
    """Any field of the specification, there or not, set to anything."""
    *parents, last = chance.choice(FIELDS).split(".")
    table = document
    for name in parents:
        inner = table.setdefault(name, {})
        table = inner if isinstance(inner, dict) else table
    table[last] = bad_value(chance)


def _change_value(document: dict[str, Any], chance: Random) -> None:
    """Any value of the file set to anything, lists of tables included."""
    inner, name = _random_place(document, chance)
    inner[name] = bad_value(chance)


def _scale_value(document: dict[str, Any], chance: Random) -> None:
    inner, name = _random_place(document, chance)
    if isinstance(inner[name], int | float) and not isinstance(inner[name], bool):
        inner[name] *= chance.choice((0, -1, 1e-3, 0.5, 1.1, 2, 10, 1e3, 1e9))


def _drop_value(document: dict[str, Any], chance: Random) -> None:
    inner, name = _random_place(document, chance)
    del inner[name]


def _add_key(document: dict[str, Any], chance: Random) -> None:
    """A key that no design has, in any table."""
    inner, _ = _random_place(document, chance)
    if isinstance(inner, dict):
        inner[chance.choice(("lenght_mm", "x" * 5_000, "", *STRANGE, "name", "part", "catalog"))] = bad_value(
            chance
        )


def _repeat_entry(document: dict[str, Any], chance: Random) -> None:
    rows = document.get("layout")
    if isinstance(rows, list):
        document["layout"] = rows * chance.choice((2, 20, 129, 2_000))


def _name_a_file(document: dict[str, Any], chance: Random) -> None:
    name = chance.choice(("x", *STRANGE, "../", "/")) * chance.choice((1, 10, 300, 5_000))
    if chance.random() < 0.5:
        document["catalog_files"] = [name]
    else:
        document["indenter"] = {"shape": "profile", "profile_csv": name}


def _free_keys(document: dict[str, Any], chance: Random) -> None:
    """Tables whose keys the user chooses, small and large, of right and of wrong names."""
    names = ("osram-sfh206k", "osram-sfh206", "a" * 60, "A\x1b", "cavity.length_mm", "a." * 90)
    count = chance.choice((1, 3, 50, 500, 5_000))
    of_part = {"active_width_mm": chance.choice((2.0, -1.0, 1e9))}
    document[chance.choice(("part_measurements", "tolerances"))] = {
        f"{chance.choice(names)}{number if number else ''}": chance.choice((of_part, 0.1, 1e5, "x"))
        for number in range(count)
    }


def _profile(document: dict[str, Any], chance: Random) -> None:
    count = chance.choice((0, 1, 2, 40, 400, 4_000))
    points = [[3.0 * k / max(count - 1, 1), 1.0 * k] for k in range(count)]
    document["indenter"] = {"tip_radius_mm": 3.0, "shape": "profile", "profile_mm": points}


def _own_entry(document: dict[str, Any], chance: Random) -> None:
    """An entry of the user's catalogue with anything in it."""
    kind = chance.choice(("parts", "elastomers", "mold_materials", "boards", "party"))
    entry = {
        name: bad_value(chance)
        for name in chance.sample(("kind", "title", "spectrum", "index", "clock_hz"), 3)
    }
    document["catalog"] = {kind: {chance.choice(("mine", "x" * 300, "A B")): entry}}


DOCUMENT_FAULTS = (
    *(_set_field, _change_value, _scale_value) * 3,
    _drop_value,
    _add_key,
    _repeat_entry,
    _name_a_file,
    _free_keys,
    _profile,
    _own_entry,
)


def _cut(text: str, chance: Random) -> str:
    return text[: chance.randrange(len(text) + 1)]


def _insert(text: str, chance: Random) -> str:
    at = chance.randrange(len(text) + 1)
    return (
        text[:at]
        + chance.choice((*STRANGE, "[", "]", "=", ".", ",", "#", "{", "}", "'", "'''", '"""'))
        + text[at:]
    )


def _double_line(text: str, chance: Random) -> str:
    lines = text.split("\n")
    line = chance.choice(lines)
    lines.insert(chance.randrange(len(lines) + 1), line)
    return "\n".join(lines)


def _move_line(text: str, chance: Random) -> str:
    lines = text.split("\n")
    lines.insert(chance.randrange(len(lines)), lines.pop(chance.randrange(len(lines))))
    return "\n".join(lines)


def _add_line(text: str, chance: Random) -> str:
    """A line of deep keys, a header, or a value, anywhere."""
    deep = chance.choice(("a", '"a"', "a ")) + chance.choice((".a", '."a"', " . a")) * chance.choice(
        (1, 19, 300, 100_000)
    )
    line = chance.choice(
        (
            f"{deep} = 1",
            f"[{deep}]",
            f"[[{deep}]]",
            f"x = {{{deep} = 1}}",
            "[cavity]",
            "[[cavity]]",
            "[layout]",
            "cavity.a = 1",
        )
    )
    if chance.random() < 0.3:
        line = f"{chance.choice(FIELDS)} = {_inline(bad_value(chance))}"
    if chance.random() < 0.1:
        line = "\n".join(f"k{number} = 1" for number in range(chance.choice((100, 100_000))))
    lines = text.split("\n")
    lines.insert(chance.randrange(len(lines) + 1), line)
    return "\n".join(lines)


def _change_line(text: str, chance: Random) -> str:
    lines = text.split("\n")
    at = chance.randrange(len(lines))
    lines[at] = lines[at].partition("=")[0] + "= " + _inline(bad_value(chance))
    return "\n".join(lines)


TEXT_FAULTS = (
    _cut,
    _insert,
    _insert,
    _double_line,
    _move_line,
    _add_line,
    _add_line,
    _change_line,
    _change_line,
)


def _random_place(document: Any, chance: Random) -> tuple[Any, Any]:
    """A table or list, and the key of something in it."""
    places = [(document, name) for name in document]
    for inner, name in places:
        value = inner[name]
        if isinstance(value, dict):
            places += [(value, key) for key in value]
        elif isinstance(value, list) and len(value) < 100:
            places += [(value, number) for number in range(len(value))]
    return chance.choice(places) if places else ({"x": 1}, "x")


def _key(name: str) -> str:
    is_bare = name.isascii() and name.replace("-", "").replace("_", "").isalnum()
    return name if is_bare else _quoted(name)


def _inline(value: Any) -> str:
    match value:
        case Raw(text=text):
            return text
        case bool():
            return str(value).lower()
        case str():
            return _quoted(value)
        case dict():
            return "{" + ", ".join(f"{_key(name)} = {_inline(one)}" for name, one in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(_inline, value)) + "]"
        case _:
            return repr(value)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
