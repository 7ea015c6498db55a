"""A design file's text under edit: only what differs changes, and every comment stays.

edited_text       the same text, field by field
standalone_text   a text of its own with the same comments, for what cannot be edited in place: own parts or a tip
                  in files that do not lie beside the new one, TOML written in ways that `tomlkit` cannot change
"""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import AoT, Array, Comment, Table, Trivia, Whitespace

from design.io import dump_design, without_empty
from design.spec import SensorDesign

CATALOG = "catalog"
"""Own parts stand in files beside a design; the studio does not edit them."""
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|(?P<comment>#[^\r\n]*)',
    re.DOTALL,
)


def edited_text(text: str, was: SensorDesign, now: SensorDesign) -> str:
    """A design file's text with the fields changed that differ between two designs; all else is left alone."""
    plain = text.replace("\r\n", "\n")
    is_windows = plain != text and "\n" not in text.replace("\r\n", "")
    plain = plain if is_windows else text
    document = tomlkit.parse(plain)
    _edit(document, _plain(was), _plain(now))
    edited = _with_comments(tomlkit.dumps(document), plain)
    return edited.replace("\n", "\r\n") if is_windows else edited


def standalone_text(text: str, now: SensorDesign) -> str:
    """A design with every value spelled out, and the comments of a former text."""
    _, _, whole = dump_design(now).partition(
        "\n"
    )  # its first line names the digest, which the next edit changes
    return _with_comments(whole, text)


def comments_of(text: str) -> tuple[str, ...]:
    """Every comment of a TOML text from its # on, in order."""
    found = (token.group("comment") for token in _TOKEN.finditer(text))
    return tuple(comment.rstrip() for comment in found if comment)


def _with_comments(text: str, former: str) -> str:
    """The text, with comments of a former one at its end that it has no more."""
    gone = Counter(comments_of(former)) - Counter(
        one for comment in comments_of(text) for one in _nested(comment)
    )
    if not gone:
        return text
    return "\n".join([text.rstrip("\n"), "", *gone.elements(), ""])


def _nested(comment: str) -> tuple[str, ...]:
    """A comment, and the one inside it: of a line that was made a comment."""
    return (comment, *comments_of(comment[1:]))


def _plain(design: SensorDesign) -> dict[str, Any]:
    document: dict[str, Any] = without_empty(design.model_dump(mode="json"))
    document.pop(CATALOG, None)
    return document


def _edit(target: Any, before: dict[str, Any], after: dict[str, Any]) -> None:
    for key in [*before, *(key for key in after if key not in before)]:
        old, new = before.get(key), after.get(key)
        if old == new:
            continue
        if new is None:
            _drop(target, key)
        elif key == "layout":
            _edit_layout(target, old or [], new)
        elif isinstance(old, dict) and isinstance(new, dict) and key in target:
            _edit(target[key], old, new)
        elif key in target and _is_as_long(target[key], new):
            _edit_list(target[key], new)
        elif key in target:
            target[key] = _item(new)
        else:
            _add(target, key, _item(new))


def _is_as_long(item: Any, new: Any) -> bool:
    return isinstance(item, Array) and isinstance(new, list) and len(item) == len(new)


def _edit_list(item: Array, new: list[Any]) -> None:
    for number, value in enumerate(new):
        if item[number] != value:
            item[number] = value


def _drop(target: Any, key: str) -> None:
    """Take a key out; a line with a comment becomes a comment."""
    if key not in target:
        return
    line = _as_comment(target, key) if isinstance(target, Table) else None
    place = next(
        (n for n, (name, _) in enumerate(_body(target)) if name is not None and name.key == key), None
    )
    target.pop(key)
    if line is not None and place is not None:
        _body(target)[place] = (None, line)


def _as_comment(table: Table, key: str) -> Comment | None:
    """A table's line as a comment, if it holds one; else there is nothing to keep."""
    item = table.value.item(key)
    if isinstance(item, Table | AoT | OutOfOrderTableProxy) or "\n" in item.as_string():
        return None
    trivia = item.trivia
    if not trivia.comment:
        return None
    line = f"# {key} = {item.as_string()}{trivia.comment_ws}{trivia.comment}"
    return Comment(Trivia(indent=trivia.indent, comment_ws="", comment=line, trail="\n"))


def _add(target: Any, key: str, item: Any) -> None:
    """Append a key after a table's last line, before the blank line and what follows it."""
    rest = _cut_rest(target) if isinstance(target, Table) else []
    target[key] = item
    _body(target).extend(rest)


def _cut_rest(table: Table) -> list[Any]:
    """Take off a table's end from the first blank line after its last key on."""
    body = _body(table)
    last = max((n for n, (name, _) in enumerate(body) if name is not None), default=-1)
    blank = (n for n in range(last + 1, len(body)) if isinstance(body[n][1], Whitespace))
    at = next(blank, len(body))
    rest = body[at:]
    del body[at:]
    return rest


def _body(table: Any) -> list[Any]:
    body: list[Any] = table.body if isinstance(table, tomlkit.TOMLDocument) else table.value.body
    return body


def _edit_layout(target: Any, old: list[dict[str, Any]], new: list[dict[str, Any]]) -> None:
    """Entries that stay keep their text; where as many of the same patterns stay, only their fields change."""
    given = target["layout"]
    if [one["pattern"] for one in old] == [one["pattern"] for one in new]:
        for table, before, after in zip(given, old, new, strict=True):
            _edit(table, before, after)
    elif isinstance(given, AoT):
        target["layout"] = _entries(list(zip(old, given, strict=True)), new)
    else:
        target["layout"] = _inline_entries(new)


def _entries(given: list[tuple[dict[str, Any], Table]], new: list[dict[str, Any]]) -> AoT:
    """Tables of a layout: those that stay as they are, new ones where there were others, with the others' comments."""
    rest = _cut_rest(given[-1][1]) or [(None, Whitespace("\n"))]
    left = list(given)
    entries: list[tuple[Table, bool]] = []
    for one in new:
        kept = next((pair for pair in left if pair[0] == one), None)
        if kept is not None:
            left.remove(kept)
        entries.append((_item(one), True) if kept is None else (kept[1], False))
    lines = [line for _, table in left for line in _comment_lines(table)]
    first = next((table for table, is_new in entries if is_new), entries[0][0])
    if lines:
        _put_first(first, lines)
    for (table, is_new), (_, is_next_new) in pairwise(entries):
        if (is_new or is_next_new) and not isinstance(_body(table)[-1][1], Whitespace):
            _body(table).append((None, Whitespace("\n")))
    _body(entries[-1][0]).extend(rest)
    return AoT([table for table, _ in entries], parsed=True)


def _comment_lines(table: Table) -> list[str]:
    """What a table says in comments, a line each; a key's with the key."""
    lines = [table.trivia.comment] if table.trivia.comment else []
    for key, item in _body(table):
        if isinstance(item, Comment):
            lines.append(item.as_string().strip())
        elif key is not None and (line := _as_comment(table, key.key)) is not None:
            lines.append(line.trivia.comment)
    return lines


def _put_first(table: Table, lines: list[str]) -> None:
    """Put comments before a table's own lines."""
    own = dict(table.items())
    for key in own:
        table.remove(key)
    _body(table).clear()
    for line in lines:
        table.add(Comment(Trivia(comment=line, trail="\n")))
    for key, value in own.items():
        table.add(key, value)


def _inline_entries(new: list[dict[str, Any]]) -> Array:
    """A layout in brackets, an entry a line."""
    found = tomlkit.array()
    for one in new:
        entry = tomlkit.inline_table()
        entry.update(one)
        found.append(entry)
    return found.multiline(True)


def _item(value: Any) -> Any:
    if not isinstance(value, dict):
        return tomlkit.item(value)
    table = tomlkit.table()
    for key, inner in value.items():
        table[key] = _item(inner)
    return table
