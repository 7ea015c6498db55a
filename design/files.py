"""Files of users: valid names, writing a file completely or not at all, and reading text with clear errors.

A file is written next to its target under a unique name, and then replaces the target in one step. If several programs
write the same file, the result is the complete file of the last one. A symbolic link at the target is replaced, not
followed.

Text is UTF-8, with or without a byte order mark. Line ends of any system become line feeds. If a file is not text, the
error message gives its type, detected from its first bytes, and a remedy. The module needs the standard library only.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from optopad.design.errors import InputError, OptopadError, OutputError

FULL = (errno.ENOSPC, errno.EDQUOT)
_DEVICES = frozenset(
    {"con", "prn", "aux", "nul", "conin$", "conout$"}
    | {port + number for port in ("com", "lpt") for number in "123456789¹²³"}
)
"""Names that Windows reserves for devices, in every folder and with any suffix."""

_FILE_SUFFIX = re.compile(
    r"\.(csv|tsv|txt|md|jsonl?|ndjson|toml|ya?ml|xml|html?|pdf|png|svg|jpe?g|gif|webp|nc|h5|hdf5|np[yz]|mat|pkl|pickle|"
    r"joblib|parquet|xlsx?|ods|db|sqlite3?|zip|gz|tar|stl|ste?p|3mf|gcode|hex|ino|optorec|optomodel)",
    re.IGNORECASE,
)


def name_fault(name: str) -> str | None:
    """Reason why a name is not valid for files and folders on every operating system; None if it is valid."""
    stem = name.partition(".")[0].rstrip(" ")
    if stem.lower() in _DEVICES:
        return f"{stem} is the name of a device on Windows"
    return "Windows drops a dot or a blank at the end of a name" if name != name.rstrip(". ") else None


def require_file_name(file: Path, option: str = "") -> None:
    """Refuse a file name that is not valid on every operating system.

    Parameters
    ----------
    option : start of the message, such as "--out: "

    Raises
    ------
    InputError : the name is not valid; the message gives the reason.
    """
    if fault := name_fault(file.name):
        raise InputError(f"{option}{file}: is refused as a name: {fault}; choose another name")


def require_suffix(file: Path, suffixes: tuple[str, ...], option: str = "") -> None:
    """Refuse a file name whose suffix does not match the written content.

    Parameters
    ----------
    suffixes : permitted suffixes, such as ".nc"
    option : start of the message, such as "--out: "

    Raises
    ------
    InputError : the suffix is not permitted; the message lists those that are.
    """
    require_file_name(file, option)
    if file.suffix.lower() not in suffixes:
        say = f"; use {file.with_name((file.stem or 'file') + suffixes[0])}" if file.name else ""
        raise InputError(f"{option}{file}: output files here end in {' or '.join(suffixes)}{say}")


def has_file_suffix(path: Path) -> bool:
    """Whether a path ends in a suffix that is usual for files, so it is unlikely to be a folder."""
    return _FILE_SUFFIX.fullmatch(path.suffix) is not None


def require_folder_name(folder: Path, option: str = "") -> None:
    """Raise InputError for the name of a new folder that has a file's suffix or is reserved for a device."""
    if folder.is_dir():
        return
    require_file_name(folder, option)
    if has_file_suffix(folder):
        raise InputError(
            f"{option}{folder}: a folder is written here, and the name is that of a {folder.suffix} file; use "
            f"{folder.with_suffix('')}"
        )


@contextmanager
def whole_file(file: Path, way_out: str = "choose another folder") -> Iterator[Path]:
    """Context manager for a new file, which replaces `file` if the `with` block succeeds and is removed otherwise.

    Parameters
    ----------
    way_out : remedy at the end of the message if the file cannot be written

    Raises
    ------
    InputError : the name is reserved for a device on Windows.
    OutputError : the folder is missing, read-only or full; the old file is unchanged.
    """
    require_file_name(file)
    _sweep(file)
    hidden = None
    try:
        descriptor, hidden = tempfile.mkstemp(dir=file.parent, prefix=_hidden_start(file), suffix=".partial")
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


@contextmanager
def whole_folder(folder: Path, *, replaces: bool = False) -> Iterator[Path]:
    """Context manager for a new folder, which gets its name if the `with` block succeeds and is removed otherwise.

    Parameters
    ----------
    replaces : whether an existing folder of this name is replaced; it stays as it was if the `with` block fails

    Raises
    ------
    OutputError : the folder exists and is not replaced, or the folder that holds it cannot be written.
    """
    before = folder.with_name(f".{folder.name[:40]}.before")
    if replaces:  # a process may have been ended while it replaced the folder
        _one_of(folder, before)
    if folder.exists() and not replaces:
        raise OutputError(f"{folder}: exists already; choose another folder")
    made_folder(folder.parent)
    try:
        with alone_in(folder.parent):
            _sweep(folder)
            hidden = Path(
                tempfile.mkdtemp(dir=folder.parent, prefix=_hidden_start(folder), suffix=".partial")
            )
            lock = locked(hidden)
    except OSError as err:
        raise unwritable(folder, err) from err
    try:
        yield hidden
        hidden.chmod(0o755)
        if replaces and folder.exists():
            folder.rename(before)
        hidden.rename(folder)
    except OSError as err:
        raise unwritable(folder, err) from err
    finally:
        if replaces:
            _one_of(folder, before)
        shutil.rmtree(hidden, ignore_errors=True)
        if lock is not None:
            os.close(lock)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Make other processes that call this function for a folder wait while the `with` block runs."""
    if os.name == "nt":  # it has no locks of folders
        yield
        return
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def locked(folder: Path) -> int | None:
    """Lock a folder; return its open descriptor, or None if another process has locked it or locking is unsupported.

    The lock ends when the descriptor is closed or the process ends.
    """
    if os.name == "nt":
        return None
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


ABANDONED_S = 86_400.0


def is_abandoned(hidden: Path) -> bool:
    """Whether the process that writes a hidden file or folder has died.

    A process locks its folder (`locked`). Files, and folders on systems without locks, are abandoned if nothing was
    written to them for a day.
    """
    try:
        if hidden.is_dir() and (lock := locked(hidden)) is not None:
            os.close(lock)
            return True
        return time.time() - hidden.stat().st_mtime > ABANDONED_S
    except OSError:  # its process has just removed it
        return False


def _sweep(target: Path) -> None:
    """Remove hidden files and folders that died writers of `target` have left; errors are ignored."""
    pattern = re.compile(re.escape(_hidden_start(target)) + r"[a-z0-9_]{8}\.partial")
    with suppress(OSError):
        for left in [target.parent / name for name in os.listdir(target.parent) if pattern.fullmatch(name)]:
            if is_abandoned(left):
                shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)


def _hidden_start(target: Path) -> str:
    return f".{target.name[:40]}."


def _one_of(folder: Path, before: Path) -> None:
    """Remove a replaced folder, or give it its name back if no new one has it."""
    if before.exists() and folder.exists():
        shutil.rmtree(before, ignore_errors=True)
    elif before.exists():
        before.rename(folder)


def write_whole(file: Path, content: bytes) -> None:
    """Write a file completely or not at all; errors are as in `whole_file`."""
    with whole_file(file) as hidden:
        hidden.write_bytes(content)


def made_folder(folder: Path, way_out: str = "choose another folder") -> Path:
    """Make a folder and its parents if they do not exist, and return it; OutputError if this fails.

    Parameters
    ----------
    way_out : remedy at the end of the message
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise unwritable(folder, err, way_out) from err
    return folder


def own_folder(folder: Path, way_out: str = "choose another folder") -> Path:
    """Make and return a folder whose files may be replaced or removed; a link or a failure raises OutputError.

    Parameters
    ----------
    way_out : remedy at the end of the message
    """
    if folder.is_symlink():
        raise OutputError(
            f"{folder}: is a link, and files are not written through links; replace it by a folder, or {way_out}"
        )
    return made_folder(folder, way_out)


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Context manager for a folder of temporary files, which is removed at the end of the `with` block.

    Raises
    ------
    OutputError : no folder of this system accepts temporary files.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="optopad-")
    except OSError as err:
        raise OutputError(
            f"temporary files cannot be written: {err.strerror or err}; set TMPDIR to a folder that can be written"
        ) from None


def unwritable(file: Path, err: OSError, way_out: str = "choose another folder") -> OutputError:
    """Make an error about a file or folder that could not be written, with the system's reason and a remedy."""
    room = "free some room on its disk, or " if err.errno in FULL else ""
    return OutputError(f"{file}: cannot be written: {err.strerror or err}; {room}{way_out}")


def nearest_existing(folder: Path) -> Path:
    """The folder itself if it exists, else its nearest existing ancestor."""
    path = folder.absolute()
    return next((place for place in (path, *path.parents) if os.path.lexists(place)), Path(path.anchor))


def folder_fault(folder: Path) -> str | None:
    """Reason why a folder cannot be created or written to; None if there is none.

    The function creates a trial folder and removes it. Access rights are not a sufficient test, because an
    administrator has them even on a read-only disk.
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


BYTES_FOR_KIND = 16_384
"""Bytes read from a file's start to detect its type; in an Excel workbook, they include the names of its sheets."""

HDF5, NETCDF3 = "an HDF5 or netCDF-4 file", "a netCDF-3 file"
TEXT, EMPTY, UTF16 = "a text", "an empty file", "text in UTF-16"
_STARTS = (
    (b"\x89HDF\r\n\x1a\n", HDF5),
    (b"CDF", NETCDF3),
    (b"PAR1", "a Parquet file"),
    (b"\x89MCAP0\r\n", "an MCAP log"),
    (b"SQLite format 3\x00", "an SQLite database (.db3), as ROS 2 bags and searches are"),
    (b"MATLAB ", "a MATLAB file (.mat)"),
    (b"\x1f\x8b", "a gzip file"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xfe", UTF16),
    (b"\xfe\xff", UTF16),
)


def kind_of(content: bytes) -> str:
    """Type of a file in words, detected from its first bytes, such as "an Excel workbook (.xlsx)"."""
    for start, kind in _STARTS:
        if content.startswith(start):
            return kind
    if content.startswith(b"PK\x03\x04"):
        return "an Excel workbook (.xlsx)" if b"xl/" in content else "a zip archive"
    if not content.strip():
        return EMPTY
    return "binary data of an unknown kind" if b"\x00" in content else TEXT


def kind_of_file(file: Path) -> str:
    """Type of a file in words, as in `kind_of`; "a file that cannot be opened" if opening fails or could wait."""
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            return "a file that cannot be opened"
        with file.open("rb") as stream:
            return kind_of(stream.read(BYTES_FOR_KIND))
    except (OSError, ValueError):
        return "a file that cannot be opened"


_SHELL_PIPE = re.compile(r"/(?:dev/stdin$|dev/fd/|proc/)")


@contextmanager
def opened_file(file: Path, *, needed: str, error: type[OptopadError] = InputError) -> Iterator[IO[bytes]]:
    """Context manager for a file that is open for reading; system errors in the `with` block are explained, too.

    Devices and named pipes are refused before they are opened, because a program could wait for them forever. The pipes
    that a shell makes, as /dev/stdin or /dev/fd/63, are read.

    Parameters
    ----------
    needed : type of file required and how to make it, for messages
    error : exception class to raise

    Raises
    ------
    OptopadError : the file is missing, a folder, a device or unreadable; the exception is of the class `error`.
    """
    try:
        mode = file.stat().st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError
        of_shell = stat.S_ISFIFO(mode) and _SHELL_PIPE.match(os.path.abspath(file)) is not None
        if not (stat.S_ISREG(mode) or of_shell):
            raise error(f"{file}: a pipe or a device, not a file; needs {needed}")
        stream = file.open("rb")
    except FileNotFoundError:
        raise error(f"{file}: no such file; needs {needed}") from None
    except IsADirectoryError:
        raise error(f"{file}: a folder; needs {needed}") from None
    except OSError as err:
        raise error(_unreadable(file, err)) from None
    except ValueError as err:  # a null byte in the name
        raise error(f"{str(file)!r}: no name of a file: {err}") from None
    with stream:
        try:
            yield stream
        except OSError as err:
            raise error(_unreadable(file, err)) from None


def _unreadable(file: Path, err: OSError) -> str:
    return f"{file}: cannot be read: {err.strerror}; name the right file"


def size_of(stream: IO[bytes], most_bytes: int) -> int:
    """Size of an open file [bytes]; `most_bytes` of a pipe, whose size is unknown."""
    status = os.fstat(stream.fileno())
    return status.st_size if stat.S_ISREG(status.st_mode) else most_bytes


def require_file(file: Path, *, needed: str, error: type[OptopadError] = InputError) -> None:
    """Refuse a path that is not a file which can be read; parameters and errors are as in `opened_file`."""
    with opened_file(file, needed=needed, error=error):
        pass


def read_bytes(file: Path, *, needed: str, most_bytes: int, error: type[OptopadError] = InputError) -> bytes:
    """Read the content of a file.

    Parameters
    ----------
    needed : type of file required and how to make it, for messages
    most_bytes : size above which the file is refused without being read
    error : exception class to raise

    Raises
    ------
    OptopadError : the file is missing, a folder, a device, unreadable or too large; the exception is of the class
        `error`.
    """
    with opened_file(file, needed=needed, error=error) as stream:
        content = stream.read(min(size_of(stream, most_bytes), most_bytes) + 1)
    if len(content) > most_bytes:
        raise error(too_large(file, needed=needed, most_bytes=most_bytes))
    return content


def too_large(file: Path, *, needed: str, most_bytes: int) -> str:
    """Message about a file of more than `most_bytes`; parameters are as in `read_bytes`."""
    return f"{file}: larger than {most_bytes} bytes, which is too much; needs {needed}"


def read_text(file: Path, *, needed: str, most_bytes: int, error: type[OptopadError] = InputError) -> str:
    """Read a text file in UTF-8, without its byte order mark and with line feeds as line ends.

    Parameters and errors are as in `read_bytes`. Content other than UTF-8 text is refused, and the message gives its
    type.
    """
    content = read_bytes(file, needed=needed, most_bytes=most_bytes, error=error)
    return text_of(content, str(file), needed=needed, error=error)


def text_of(content: bytes, where: str, *, needed: str, error: type[OptopadError] = InputError) -> str:
    """Decode the content of a text file as `read_text` does; `where` names the file in error messages."""
    kind = kind_of(content[:BYTES_FOR_KIND])
    if kind == UTF16:
        raise error(f"{where}: not UTF-8 but {kind}; save it as UTF-8")
    if kind not in (TEXT, EMPTY):
        raise error(f"{where}: {kind}, not UTF-8 text; needs {needed}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as err:
        line = content.count(b"\n", 0, err.start) + 1
        raise error(f"{where}: not UTF-8 text (byte {err.start}, line {line}); save it as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
