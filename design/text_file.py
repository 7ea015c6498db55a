"""Files as people have them: one way to read text, and the kind of a file by its first bytes.

Text is UTF-8, with or without a byte order mark. Line ends of any system become line feeds. A file of another kind is
named, so that the message can say what to do with it. Needs the standard library only.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from design.errors import InputError, OptopadError

BYTES_FOR_KIND = 16_384
"""Of a file's start: a workbook names its sheets within them."""

_UTF16 = "text in UTF-16"
_STARTS = (
    (b"\x89HDF\r\n\x1a\n", "an HDF5 or netCDF-4 file"),
    (b"CDF\x01", "a netCDF-3 file"),
    (b"CDF\x02", "a netCDF-3 file"),
    (b"CDF\x05", "a netCDF file of the CDF-5 format"),
    (b"PAR1", "a Parquet file"),
    (b"ARROW1", "an Arrow file"),
    (b"\x89MCAP0\r\n", "an MCAP log"),
    (b"#ROSBAG", "a ROS 1 bag"),
    (b"SQLite format 3\x00", "an SQLite database, as ROS 2 bags and searches are"),
    (b"MATLAB ", "a MATLAB file (.mat)"),
    (b"\x93NUMPY", "a NumPy array (.npy)"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook (.xls)"),
    (b"\x1f\x8b", "a gzip file"),
    (b"BZh", "a bzip2 file"),
    (b"\xfd7zXZ", "an xz file"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard file"),
    (b"%PDF", "a PDF"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"ISO-10303-21", "a STEP file"),
    (b'{"format": "optopad-recording"', "a recording of `optopad driver record` (.optorec)"),
    (b"\xff\xfe", _UTF16),
    (b"\xfe\xff", _UTF16),
)
_IN_ARCHIVES = (
    (b"opendocument.spreadsheet", "an OpenDocument spreadsheet (.ods)"),
    (b"xl/", "an Excel workbook (.xlsx)"),
    (b"word/", "a Word document (.docx)"),
    (b".npy", "a NumPy archive (.npz), as models are"),
)
TEXT_KINDS = ("TOML text", "JSON text", "XML or HTML text", "a CSV table", "plain text", "an empty file")
_PICKLE = re.compile(rb"\x80[\x02-\x05]")
_TOML = re.compile(r"\s*(?:#[^\n]*\n\s*)*(?:\[|[\w.\"'-]+\s*=)")


def kind_of(content: bytes) -> str:
    """The kind of a file by its first bytes, in words, as "an Excel workbook (.xlsx)"."""
    for start, kind in _STARTS:
        if content.startswith(start):
            return kind
    if content.startswith(b"PK\x03\x04"):
        return next((kind for part, kind in _IN_ARCHIVES if part in content), "a zip archive")
    if _PICKLE.match(content):
        return "a Python pickle, which is not read because it can hold a program"
    if not content.strip():
        return "an empty file"
    if b"\x00" in content:
        return "binary data of an unknown kind"
    text = content.decode("utf-8-sig", errors="replace")
    if text.lstrip()[:1] in "{<":
        return "JSON text" if text.lstrip()[0] == "{" else "XML or HTML text"
    if _TOML.match(text):
        return "TOML text"
    return "a CSV table" if re.search(r"[,;\t]", text.partition("\n")[0]) else "plain text"


def kind_of_file(file: Path) -> str:
    """The kind of a file that can be opened; "a file that cannot be opened" for others."""
    try:
        with file.open("rb") as stream:
            return kind_of(stream.read(BYTES_FOR_KIND))
    except (OSError, ValueError):
        return "a file that cannot be opened"


def read_bytes(file: Path, *, needed: str, most_bytes: int, error: type[OptopadError] = InputError) -> bytes:
    """The content of a file.

    Parameters
    ----------
    needed : what the file must be and how it is made, in words for the message
    most_bytes : size above which the file is refused unread
    error : class of the error that is raised

    Raises
    ------
    OptopadError : missing, a folder, unreadable or too large; of the class `error`.
    """
    try:
        with file.open("rb") as stream:
            status = os.fstat(stream.fileno())
            size = status.st_size if stat.S_ISREG(status.st_mode) else most_bytes
            content = stream.read(min(size, most_bytes) + 1)
    except FileNotFoundError:
        raise error(f"{file}: no such file; needed is {needed}") from None
    except IsADirectoryError:
        raise error(f"{file}: a folder; needed is {needed}") from None
    except OSError as err:
        raise error(f"{file}: cannot be read: {err.strerror}; name the right file") from None
    except ValueError as err:  # a null byte in the name
        raise error(f"{str(file)!r}: no name of a file: {err}") from None
    if len(content) > most_bytes:
        raise error(f"{file}: larger than {most_bytes} bytes, which is too much; needed is {needed}")
    return content


def read_text(file: Path, *, needed: str, most_bytes: int, error: type[OptopadError] = InputError) -> str:
    """The text of a file, without a byte order mark, its lines ended by line feeds.

    Parameters, errors: as `read_bytes`; files that are no UTF-8 text are refused with their kind.
    """
    content = read_bytes(file, needed=needed, most_bytes=most_bytes, error=error)
    return text_of(content, str(file), needed=needed, error=error)


def text_of(content: bytes, where: str, *, needed: str, error: type[OptopadError] = InputError) -> str:
    """As `read_text`, of bytes that were read already; `where` names the file in messages."""
    kind = kind_of(content[:BYTES_FOR_KIND])
    if kind == _UTF16:
        raise error(f"{where}: not UTF-8 but {kind}; save it as UTF-8")
    if kind not in TEXT_KINDS:
        raise error(f"{where}: {kind}, not UTF-8 text; needed is {needed}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as err:
        line = content.count(b"\n", 0, err.start) + 1
        raise error(f"{where}: not UTF-8 text (byte {err.start}, line {line}); save it as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
