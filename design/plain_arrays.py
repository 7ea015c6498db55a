"""NumPy archives (.npz) read with suspicion: plain arrays only, sizes checked before anything is allocated.

A file that was damaged or made by hand may say any shape, nest its headers, or hold what is no array. NumPy's own
reader believes the header and allocates; here the header must fit the bytes that the archive holds.
"""

from __future__ import annotations

import ast
import math
import re
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

MOST_MEMBERS = 10_000
LONGEST_HEADER = 1_000
"""Of an array's type and shape, in bytes; ours have 118."""
_SUFFIX = ".npy"
_MAGIC = b"\x93NUMPY"
_LENGTHS = {
    b"\x01\x00": struct.Struct("<H"),
    b"\x02\x00": struct.Struct("<I"),
    b"\x03\x00": struct.Struct("<I"),
}
"""Version of an array's header -> how its length is packed (numpy.lib.format)."""
_KIND = re.compile(r"[<>|=]?[biufcSU]\d{1,4}")
"""Types of numbers and of texts of one length; neither objects nor records."""
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
"""What a damaged file raises: RuntimeError by flags that are not known; SyntaxError, RecursionError (a RuntimeError)
and MemoryError by a header that is no Python literal or nested deep."""


def plain_arrays(file: Path, *, most_bytes: int) -> dict[str, NDArray[Any]]:
    """The arrays of an archive by name.

    Parameters
    ----------
    most_bytes : of all arrays unpacked

    Raises
    ------
    OSError : the file cannot be opened or read.
    ValueError : no archive of plain arrays, damaged, or larger; the message says which.
    """
    with file.open("rb") as stream:
        try:
            with zipfile.ZipFile(stream) as archive:
                members = archive.infolist()
                size = sum(member.file_size for member in members)
                if size > most_bytes:
                    raise ValueError(
                        f"unpacks to {size / 1e6:.0f} MB, reads at most {most_bytes / 1e6:.0f} MB"
                    )
                if len(members) > MOST_MEMBERS:
                    raise ValueError(f"holds {len(members)} arrays, reads at most {MOST_MEMBERS}")
                return {member.filename.removesuffix(_SUFFIX): _array(archive, member) for member in members}
        except _UNREADABLE as err:
            raise ValueError(str(err) or type(err).__name__) from None


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        kind, shape, is_column_major = _header(stream, member.filename)
        length = math.prod(shape) * kind.itemsize
        content = stream.read(member.file_size)  # no more than the archive says, which was limited
    if len(content) != length:
        raise ValueError(f"{member.filename}: its header speaks of {length:.6g} bytes, it has {len(content)}")
    return np.ndarray(shape, kind, content, order="F" if is_column_major else "C").copy()


def _header(stream: IO[bytes], name: str) -> tuple[np.dtype[Any], tuple[int, ...], bool]:
    """Type, shape, and whether columns run first."""
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
            return np.dtype(kind), shape, order
    raise ValueError(f"{name}: its header is none of an array of numbers or texts; objects are not loaded")
