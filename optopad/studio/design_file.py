"""The edited design file: its text with comments, saving, and detection of changes by other programs.

Saving changes only the edited fields in the file's text and keeps every comment:

edited_text       the same text with changed fields
standalone_text   a complete new text with the same comments, for files that cannot be edited in place: own parts or a
                  tip in files of another folder, or TOML in a form that `tomlkit` cannot change
"""

from __future__ import annotations

import os
import re
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Array, Comment, Table, Trivia, Whitespace

from optopad.design.errors import DesignError, InputError, OutputError
from optopad.design.files import name_fault
from optopad.design.io import dump_design, load_design, without_empty
from optopad.design.preset import PRESETS, preset, preset_text
from optopad.design.spec import SensorDesign

CATALOG = "catalog"
"""Field of a design for its own parts. They are defined in files next to it; the studio does not edit them."""
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|(?P<comment>#[^\r\n]*)',
    re.DOTALL,
)


def edited_text(text: str, was: SensorDesign, now: SensorDesign) -> str:
    """A design file's text in which only the fields that differ between two designs are changed."""
    plain = text.replace("\r\n", "\n")
    is_windows = plain != text and "\n" not in text.replace("\r\n", "")
    plain = plain if is_windows else text
    document = tomlkit.parse(plain)
    _edit(document, _plain(was), _plain(now))
    edited = _with_comments(tomlkit.dumps(document), plain)
    return edited.replace("\n", "\r\n") if is_windows else edited


def standalone_text(text: str, now: SensorDesign) -> str:
    """A new text with every value of a design, followed by the comments of an earlier text."""
    _, _, whole = dump_design(now).partition(
        "\n"
    )  # its first line names the digest, which the next edit changes
    return _with_comments(whole, text)


def comments_of(text: str) -> tuple[str, ...]:
    """Every comment of a TOML text, from its # to the end of its line, in order."""
    found = (token.group("comment") for token in _TOKEN.finditer(text))
    return tuple(comment.rstrip() for comment in found if comment)


def _with_comments(text: str, former: str) -> str:
    gone = Counter(comments_of(former)) - Counter(
        one for comment in comments_of(text) for one in _nested(comment)
    )
    if not gone:
        return text
    return "\n".join([text.rstrip("\n"), "", *gone.elements(), ""])


def _nested(comment: str) -> tuple[str, ...]:
    """A comment, and the comment inside it if it is a commented-out line."""
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
    """Remove a key from a table; if its line ends with a comment, the whole line becomes a comment."""
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
    """The line of a table's key as a comment; None if the line does not end with a comment."""
    item = table.value.item(key)
    if isinstance(item, Table | AoT | OutOfOrderTableProxy) or "\n" in item.as_string():
        return None
    trivia = item.trivia
    if not trivia.comment:
        return None
    line = f"# {key} = {item.as_string()}{trivia.comment_ws}{trivia.comment}"
    return Comment(Trivia(indent=trivia.indent, comment_ws="", comment=line, trail="\n"))


def _add(target: Any, key: str, item: Any) -> None:
    """Append a key after a table's last key, before any blank line that follows it."""
    rest = _cut_rest(target) if isinstance(target, Table) else []
    target[key] = item
    _body(target).extend(rest)


def _cut_rest(table: Table) -> list[Any]:
    """Remove and return the end of a table, from the first blank line after its last key."""
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
    """Change the layout and keep the text of unchanged entries.

    If the sequence of patterns is the same, only fields of the entries are changed.
    """
    given = target["layout"]
    if [one["pattern"] for one in old] == [one["pattern"] for one in new]:
        for table, before, after in zip(given, old, new, strict=True):
            _edit(table, before, after)
    elif isinstance(given, AoT):
        target["layout"] = _entries(list(zip(old, given, strict=True)), new)
    else:
        target["layout"] = _inline_entries(new)


def _entries(given: list[tuple[dict[str, Any], Table]], new: list[dict[str, Any]]) -> AoT:
    """Tables of a layout: the unchanged ones, and new ones that take over the comments of removed ones."""
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
    """The comments of a table, one per line; a comment next to a key includes the key's line."""
    lines = [table.trivia.comment] if table.trivia.comment else []
    for key, item in _body(table):
        if isinstance(item, Comment):
            lines.append(item.as_string().strip())
        elif key is not None and (line := _as_comment(table, key.key)) is not None:
            lines.append(line.trivia.comment)
    return lines


def _put_first(table: Table, lines: list[str]) -> None:
    own = dict(table.items())
    for key in own:
        table.remove(key)
    _body(table).clear()
    for line in lines:
        table.add(Comment(Trivia(comment=line, trail="\n")))
    for key, value in own.items():
        table.add(key, value)


def _inline_entries(new: list[dict[str, Any]]) -> Array:
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


BYTE_ORDER_MARK = "\ufeff"
_CANNOT_EDIT = (TOMLKitError, LookupError, TypeError, ValueError, AttributeError)
"""Errors that tomlkit raises if it cannot change a text in place."""
_NOT_IN_NAMES = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
"""Characters that lead from a file name to another folder, or that a file system rejects."""


class DesignFile:
    """The file of the design that is edited in the studio.

    Attributes
    ----------
    path : path of the file; None for a preset or a bundle's design, which is saved under a new name
    saved : the design in the file, as last read or written
    is_in_step : whether the file contained the saved design when it was last checked; False if it was removed or became
        unusable
    """

    def __init__(self, where: str) -> None:
        """Read a design file, the design of a bundle, or a preset.

        Raises
        ------
        DesignError, InputError : there is no such file, or it contains no usable design.
        """
        path = Path(where)
        self.path: Path | None = None
        self.is_in_step = True
        if not path.exists() and where in PRESETS:
            self.saved, self._text = preset(where), preset_text(where)
        elif (path / "manifest.json").is_file():
            self.saved = load_design(path / "design.toml")
            self._text = _without_digest((path / "design.toml").read_text(encoding="utf-8"))
        else:
            self.saved = load_design(path)
            self.path = path
            self._text = _read(path)
        self._seen = self._state()

    @property
    def default_name(self) -> str:
        """The file name proposed for saving: the present name, or a new one made from the design's name."""
        return f"{self.saved.name}.toml" if self.path is None else self.path.name

    @property
    def folder(self) -> Path:
        """The folder for saving: the file's own folder or, for a preset or a bundle's design, the current folder."""
        return Path() if self.path is None else self.path.parent

    def changed_outside(self) -> SensorDesign | None:
        """The design in the file, if another program changed it since it was last read or written; otherwise None.

        Raises
        ------
        DesignError : the file contains no usable design; raised once for each change of the file.
        """
        state = self._state()
        if self.path is None or state == self._seen:
            return None
        self._seen, self.is_in_step = state, False
        if state is None:
            raise DesignError(f"{self.path}: was deleted; your edits are kept, Save writes it again")
        found = load_design(self.path)
        text = _read(self.path)
        former, self.saved, self._text, self.is_in_step = self.saved, found, text, True
        return None if found.digest == former.digest else found

    def save(self, design: SensorDesign, target: str | None = None) -> Path:
        """Write a design with the file's comments, and return the path; reading it back gives the same digest.

        Parameters
        ----------
        target : name of the file to write, in `folder`; if None, the file itself is written

        Raises
        ------
        InputError, OutputError : the name is empty, or is that of a path, a device or another existing file; the file
            was changed since it was last read; or the folder cannot be written. No file is changed.
        """
        file = self._target(target)
        self._text = _write_checked(file, self._texts(design), design)
        self.path, self.saved, self.is_in_step = file, design, True
        self._seen = self._state()
        return file

    def _texts(self, design: SensorDesign) -> Iterator[str]:
        """Possible texts of the file, the preferred one first."""
        mark = BYTE_ORDER_MARK if self._text.startswith(BYTE_ORDER_MARK) else ""
        text = self._text.removeprefix(mark)
        with suppress(*_CANNOT_EDIT):
            yield mark + edited_text(text, self.saved, design)
        yield standalone_text(text, design)

    def _target(self, target: str | None) -> Path:
        own = "" if self.path is None else self.path.name
        name = (target or "").strip() or own
        if not name:
            raise InputError("save: this design has no file yet; give a name, such as my-pad.toml")
        fault = "it is not a plain file name" if _NOT_IN_NAMES.search(name) else name_fault(name)
        if fault is not None and name != own:
            raise InputError(
                f"save: {name!r} is refused: {fault}; give a name alone, as my-pad.toml: "
                f"the design is saved in {self.folder.absolute()}"
            )
        file = self.folder / name
        is_own = self.path is not None and _is_same(file, self.path)
        if file.suffix != ".toml" and not is_own:
            raise InputError(f"save: {name!r} is refused: the name of a design file ends in .toml")
        if os.path.lexists(file) and not is_own:
            raise InputError(f"save: {file} exists and is another file; choose another name")
        if is_own and self._state() not in (self._seen, None):
            raise InputError(f"save: {file} was just changed outside and is read first; then save again")
        if is_own and file.exists() and not os.access(file, os.W_OK):
            raise OutputError(f"save: {file} is write-protected; choose another name")
        return file

    def _state(self) -> tuple[int, int, int] | None:
        if self.path is None:
            return None
        try:
            found = self.path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino


def _is_same(file: Path, other: Path) -> bool:
    try:
        return file.absolute() == other.absolute() or file.samefile(other)
    except (OSError, ValueError):  # one does not exist, or has no valid file name
        return False


def _write_checked(file: Path, texts: Iterator[str], design: SensorDesign) -> str:
    """Write the first text that gives the design when read back, and return it; the target is replaced in one step."""
    name = ""
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=".optopad-", suffix=".toml")
        os.close(handle)
        text = next((text for text in texts if _is_read_as(Path(name), text, design)), None)
        assert text is not None, f"{file}: the written design differs when read again"
        os.chmod(name, file.stat().st_mode & 0o777 if os.path.exists(file) else 0o644)
        os.replace(name, file.resolve())  # a link stays a link
    except (OSError, ValueError) as err:  # ValueError: a null byte in the name
        why = getattr(err, "strerror", None) or err
        raise OutputError(f"save: {file} cannot be written: {why}; choose another name or folder") from None
    finally:
        if name:
            Path(name).unlink(missing_ok=True)
    return text


def _is_read_as(file: Path, text: str, design: SensorDesign) -> bool:
    with file.open("w", encoding="utf-8", newline="") as stream:
        stream.write(text)
    try:
        return load_design(file).digest == design.digest
    except DesignError:
        return False


def _read(path: Path) -> str:
    """The text of a file; its byte order mark and line endings are kept."""
    with path.open(encoding="utf-8", newline="") as stream:
        return stream.read()


def _without_digest(text: str) -> str:
    """The text of a written design without its first line, which contains the digest."""
    first, _, rest = text.partition("\n")
    return rest if first.startswith("# optopad design ") else text
