"""The design file under edit: its text with comments, what is saved into it, and whether somebody else changed it."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from tomlkit.exceptions import TOMLKitError

from design.errors import DesignError, InputError, OutputError
from design.io import load_design
from design.preset import PRESETS, preset, preset_text
from design.spec import SensorDesign
from design.whole_file import name_fault
from optopad.studio.design_text import edited_text, standalone_text

BYTE_ORDER_MARK = "\ufeff"
_CANNOT_EDIT = (TOMLKitError, LookupError, TypeError, ValueError, AttributeError)
"""What tomlkit raises where it cannot change a text in place."""
_NOT_IN_NAMES = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
"""Characters that lead to another folder, or that a file system refuses."""


class DesignFile:
    """Where a design comes from and goes to.

    Attributes
    ----------
    path : the file; None for a preset or a bundle's design, which are saved under a new name
    saved : the design that the file holds, as last read or written
    is_in_step : whether the file was last seen to hold it: neither gone nor made unusable
    """

    def __init__(self, where: str) -> None:
        """Read a file, a bundle's design or a preset.

        Raises
        ------
        DesignError, InputError : as for every verb.
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
        """The name that a save is offered: the file's own, or a new one after the design."""
        return f"{self.saved.name}.toml" if self.path is None else self.path.name

    @property
    def folder(self) -> Path:
        """Where a save writes: the file's folder; for a preset or a bundle's design, the current one."""
        return Path() if self.path is None else self.path.parent

    def changed_outside(self) -> SensorDesign | None:
        """The design of a file that somebody changed since it was last read or written; None: nobody did.

        Another text of the same design, as a comment more, is taken up without a word.

        Raises
        ------
        DesignError : the file as it is now is no usable design; said once for each state of it.
        """
        state = self._state()
        if self.path is None or state == self._seen:
            return None
        self._seen, self.is_in_step = state, False
        if state is None:
            raise DesignError(f"{self.path}: is gone; your edits are kept, Save writes it again")
        found = load_design(self.path)
        text = _read(self.path)
        former, self.saved, self._text, self.is_in_step = self.saved, found, text, True
        return None if found.digest == former.digest else found

    def save(self, design: SensorDesign, target: str | None = None) -> Path:
        """Write a design with the file's comments; loading what was written gives the same digest.

        Parameters
        ----------
        target : name of the file to write, in `folder`; None for the file itself

        Raises
        ------
        InputError, OutputError : no name, a path or a device in its place, another file in the way, a file that
            somebody changed since it was last looked at, a folder that cannot be written; nothing is changed.
        """
        file = self._target(target)
        self._text = _write_checked(file, self._texts(design), design)
        self.path, self.saved, self.is_in_step = file, design, True
        self._seen = self._state()
        return file

    def _texts(self, design: SensorDesign) -> Iterator[str]:
        """What may be written, the best first."""
        mark = BYTE_ORDER_MARK if self._text.startswith(BYTE_ORDER_MARK) else ""
        text = self._text.removeprefix(mark)
        with suppress(*_CANNOT_EDIT):
            yield mark + edited_text(text, self.saved, design)
        yield standalone_text(text, design)

    def _target(self, target: str | None) -> Path:
        own = "" if self.path is None else self.path.name
        name = (target or "").strip() or own
        if not name:
            raise InputError("save: this design has no file yet; give a name, as my-pad.toml")
        fault = "it is no plain name of a file" if _NOT_IN_NAMES.search(name) else name_fault(name)
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
            raise InputError(f"save: {file} was changed outside just now; it is read first, then save again")
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
    except (OSError, ValueError):  # one is not there, or has no name of a file
        return False


def _write_checked(file: Path, texts: Iterator[str], design: SensorDesign) -> str:
    """Write the first text that is the design, through a file beside the target that was read back; that text."""
    name = ""
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, prefix=".optopad-", suffix=".toml")
        os.close(handle)
        text = next((text for text in texts if _is_read_as(Path(name), text, design)), None)
        assert text is not None, f"{file}: a design written out whole is read as another one"
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
    """Write a text and read it back."""
    with file.open("w", encoding="utf-8", newline="") as stream:
        stream.write(text)
    try:
        return load_design(file).digest == design.digest
    except DesignError:
        return False


def _read(path: Path) -> str:
    """The text as it is, byte order mark and ends of lines too."""
    with path.open(encoding="utf-8", newline="") as stream:
        return stream.read()


def _without_digest(text: str) -> str:
    """A written design's text without its first line, which names the digest of what it was."""
    first, _, rest = text.partition("\n")
    return rest if first.startswith("# optopad design ") else text
