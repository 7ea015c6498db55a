"""Safe reader of NumPy archives (.npz): plain arrays only, with sizes checked before anything is allocated.

A damaged or malicious file may state any shape, nest its headers, or contain members that are not arrays. NumPy's own
reader trusts the header and allocates memory. Here only the headers are unpacked first. Every header must match the
size that the archive states for the array, and all sizes must be plausible. Only then are the arrays unpacked.
"""

from __future__ import annotations

import ast
import math
import os
import re
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

MOST_MEMBERS = 10_000
MOST_RATIO = 100
"""Largest accepted ratio of unpacked to packed size.

Model data are compressed by a factor of 10 at most, arrays of zeros by 1000.
"""
FREE_BYTES = 1_000_000
"""Total unpacked size up to which any ratio of unpacked to packed size is accepted."""
CHUNK_BYTES = 1_000_000
LONGEST_HEADER = 1_000
"""Longest accepted header with an array's type and shape [bytes]; optopad's own headers have 118 bytes."""
_SUFFIX = ".npy"
_MAGIC = b"\x93NUMPY"
_LENGTHS = {
    b"\x01\x00": struct.Struct("<H"),
    b"\x02\x00": struct.Struct("<I"),
    b"\x03\x00": struct.Struct("<I"),
}
"""Format of the length field in an array's header, by the header's version (see numpy.lib.format)."""
_KIND = re.compile(r"[<>|=]?[biufcSU]\d{1,4}")
"""Accepted array types: numbers and strings of fixed length, but neither objects nor records."""
_UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    RuntimeError,
    SyntaxError,
    MemoryError,
    OverflowError,
    TypeError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""Errors that a damaged file raises.

Unknown flags raise RuntimeError. A header that is not a Python literal, or is deeply nested, raises SyntaxError,
RecursionError (a RuntimeError) or MemoryError.
"""


def plain_arrays(file: Path, *, most_bytes: int) -> dict[str, NDArray[Any]]:
    """Read all arrays of an archive, by name.

    Parameters
    ----------
    most_bytes : upper limit of the total unpacked size; a second limit is `MOST_RATIO` times the file's size

    Raises
    ------
    OSError : the file cannot be opened or read.
    ValueError : the file is not an archive of plain arrays, damaged, or too large; the message says which.
    """
    with file.open("rb") as stream:
        most = min(most_bytes, max(FREE_BYTES, MOST_RATIO * os.fstat(stream.fileno()).st_size))
        try:
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
                size = sum(member.file_size for member in members)
                if size > most:
                    raise ValueError(f"unpacks to {size / 1e6:.0f} MB, reads at most {most / 1e6:.0f} MB")
                if len(members) > MOST_MEMBERS:
                    raise ValueError(f"holds {len(members)} arrays, reads at most {MOST_MEMBERS}")
                for member in members:
                    _require_fitting(archive, member)
                return {member.filename.removesuffix(_SUFFIX): _array(archive, member) for member in members}
        except _UNREADABLE as err:
            raise ValueError(str(err) or type(err).__name__) from None


def _require_fitting(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Raise ValueError if an array's size differs from the size stated by the archive; only its header is unpacked."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # others unpack without limit
        raise ValueError(f"{member.filename}: is packed in another way than NumPy packs arrays")
    with archive.open(member) as stream:
        kind, shape, _ = _header(stream, member.filename)
        length, held = math.prod(shape) * kind.itemsize, member.file_size - stream.tell()
    if held != length:
        raise ValueError(f"{member.filename}: its header states {length:.6g} bytes, it has {held}")


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        kind, shape, is_column_major = _header(stream, member.filename)
        content = bytearray(math.prod(shape) * kind.itemsize)
        view, filled = memoryview(content), 0
        while chunk := stream.read(CHUNK_BYTES):
            view[filled : filled + len(chunk)] = chunk
            filled += len(chunk)
    if filled != len(content):
        raise ValueError(f"{member.filename}: ends after {filled} of {len(content)} bytes")
    return np.ndarray(shape, kind, content, order="F" if is_column_major else "C")


def _header(stream: IO[bytes], name: str) -> tuple[np.dtype[Any], tuple[int, ...], bool]:
    """Read an array's header: its type, its shape, and whether it is in column-major order."""
    begin = stream.read(len(_MAGIC) + 2)
    packed = _LENGTHS.get(begin[len(_MAGIC) :])
    if not begin.startswith(_MAGIC) or packed is None:
        raise ValueError(f"{name}: is no array")
    (length,) = packed.unpack(stream.read(packed.size))
    if length > LONGEST_HEADER:
        raise ValueError(f"{name}: has a header of {length} bytes, reads at most {LONGEST_HEADER}")
    match ast.literal_eval(stream.read(length).decode("latin-1").strip()):
        case {"descr": str(kind), "fortran_order": bool(order), "shape": tuple(shape)} if _KIND.fullmatch(
            kind
        ) and all(type(one) is int and 0 <= one < 2**40 for one in shape):
            if (found := np.dtype(kind)).itemsize:  # strings of length 0 take no bytes, whatever the shape
                return found, shape, order
    raise ValueError(
        f"{name}: its header is not that of an array of numbers or texts; objects are not loaded"
    )
