"""Files and folders that are written: names that every system takes, whole contents, true reasons for a refusal.

A file is written beside its target under a name that no other thread or process has, and takes the target's location
in one step: of several writers the last one's file stays, whole. A link at the target is replaced and not followed.
Needs the standard library only.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from design.errors import InputError, OutputError

FULL = (errno.ENOSPC, errno.EDQUOT)
_DEVICES = frozenset(
    {"con", "prn", "aux", "nul", "conin$", "conout$"}
    | {port + number for port in ("com", "lpt") for number in "123456789¹²³"}
)
"""Names that Windows keeps for devices, in every folder and with every extension."""

_FILE_SUFFIX = re.compile(
    r"\.(csv|tsv|txt|md|jsonl?|ndjson|toml|ya?ml|xml|html?|pdf|png|svg|jpe?g|gif|webp|nc|h5|hdf5|np[yz]|mat|pkl|pickle|"
    r"joblib|parquet|xlsx?|ods|db|sqlite3?|zip|gz|tar|stl|ste?p|3mf|gcode|hex|ino|optorec|optomodel)",
    re.IGNORECASE,
)


def name_fault(name: str) -> str | None:
    """Why no file or folder can have this name on every system, in words; None where it can."""
    stem = name.partition(".")[0].rstrip(" ")
    if stem.lower() in _DEVICES:
        return f"{stem} is the name of a device on Windows"
    return "Windows drops a dot or a blank at the end of a name" if name != name.rstrip(". ") else None


def require_file_name(file: Path, option: str = "") -> None:
    """Refuse a name that not every system takes.

    Parameters
    ----------
    option : start of the message, as "--out: "

    Raises
    ------
    InputError : the name and why.
    """
    if fault := name_fault(file.name):
        raise InputError(f"{option}{file}: is refused as a name: {fault}; choose another name")


def require_suffix(file: Path, suffixes: tuple[str, ...], option: str = "") -> None:
    """Refuse a name that promises another content than what is written.

    Parameters
    ----------
    suffixes : those of the formats that are written, as ".nc"
    option : start of the message, as "--out: "

    Raises
    ------
    InputError : the name, and which suffixes are written.
    """
    require_file_name(file, option)
    if file.suffix.lower() not in suffixes:
        say = f"; say {file.with_name((file.stem or 'file') + suffixes[0])}" if file.name else ""
        raise InputError(f"{option}{file}: what is written here ends in {' or '.join(suffixes)}{say}")


def has_file_suffix(path: Path) -> bool:
    """Whether a name promises a file, not a folder."""
    return _FILE_SUFFIX.fullmatch(path.suffix) is not None


def require_folder_name(folder: Path, option: str = "") -> None:
    """Refuse the name of a new folder that promises a file or is a device's; InputError with the way out."""
    if folder.is_dir():
        return
    require_file_name(folder, option)
    if has_file_suffix(folder):
        raise InputError(
            f"{option}{folder}: a folder is written here, and the name is that of a {folder.suffix} file; say "
            f"{folder.with_suffix('')}"
        )


@contextmanager
def whole_file(file: Path, way_out: str = "choose another folder") -> Iterator[Path]:
    """An empty file to write into: it takes the location of ``file`` when the block ends well, and is gone otherwise.

    Parameters
    ----------
    way_out : end of the message where the disk does not take it

    Raises
    ------
    InputError : the name is a device's on Windows.
    OutputError : the folder is missing, read-only or full; the old file is intact.
    """
    require_file_name(file)
    hidden = None
    try:
        descriptor, hidden = tempfile.mkstemp(
            dir=file.parent, prefix=f".{file.name[:40]}.", suffix=".partial"
        )
        os.close(descriptor)
        yield Path(hidden)
        os.chmod(hidden, 0o644)
        os.replace(hidden, file)
        hidden = None
    except OSError as err:
        raise unwritable(file, err, way_out) from err
    except ValueError as err:
        if hidden is not None:
            raise
        raise OutputError(f"{str(file)!r}: no name of a file: {err}") from None  # a null byte in it
    finally:
        if hidden is not None:
            Path(hidden).unlink(missing_ok=True)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file at once or not at all; raises as `whole_file`."""
    with whole_file(file) as hidden:
        hidden.write_bytes(content)


def made_folder(folder: Path, way_out: str = "choose another folder") -> Path:
    """Make a folder, its parents too, unless it is there; OutputError where it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise unwritable(folder, err, way_out) from err
    return folder


def own_folder(folder: Path, way_out: str = "choose another folder") -> Path:
    """As `made_folder`, of a folder whose files are replaced and removed; OutputError where it is a link."""
    if folder.is_symlink():
        raise OutputError(
            f"{folder}: is a link, and files are not written through links; replace it by a folder, or {way_out}"
        )
    return made_folder(folder, way_out)


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """A folder for files that nobody needs later; it is removed when its block ends.

    Raises
    ------
    OutputError : no folder of this system takes temporary files.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="optopad-")
    except OSError as err:
        raise OutputError(
            f"temporary files cannot be written: {err.strerror or err}; set TMPDIR to a folder that can be written"
        ) from None


def unwritable(file: Path, err: OSError, way_out: str = "choose another folder") -> OutputError:
    """The error of a file or folder that the system refused, with its reason."""
    room = "free some room on its disk, or " if err.errno in FULL else ""
    return OutputError(f"{file}: cannot be written: {err.strerror or err}; {room}{way_out}")


def nearest_existing(folder: Path) -> Path:
    """The folder itself, or the first of its ancestors that is there."""
    path = folder.absolute()
    return next((place for place in (path, *path.parents) if os.path.lexists(place)), Path(path.anchor))


def folder_fault(folder: Path) -> str | None:
    """Why no file can be written into a folder, or the folder cannot be made; None where it can.

    It is tried with a folder, which is removed again: the system's word on rights is not enough, since it says yes to
    an administrator even where nothing can be written.
    """
    if "\0" in str(folder):
        return "a null byte is in its name"
    existing = nearest_existing(folder)
    try:
        os.rmdir(tempfile.mkdtemp(prefix=".optopad-", dir=existing))
        return "its disk is full" if shutil.disk_usage(existing).free == 0 else None
    except (OSError, ValueError) as err:
        reason = _reason(existing, err)
    if existing == folder.absolute():
        return reason
    return f"it does not exist and cannot be made: {existing}: {reason}"


def _reason(existing: Path, err: OSError | ValueError) -> str:
    number = getattr(err, "errno", None)
    if existing.is_symlink() and not existing.exists():
        return "a link that leads nowhere"
    if not os.path.isdir(existing):
        return "a file, not a folder"
    if number in FULL:
        return "its disk is full"
    said = getattr(err, "strerror", None) or str(err)
    return f"it is not writable ({said})"
