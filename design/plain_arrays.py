"""Safe reader of NumPy archives (.npz): plain arrays only, with sizes checked before anything is allocated.

A damaged or malicious file may state any shape. NumPy's reader believes an array's header and allocates memory for it.
So each header is first compared with the size that the archive states for the array, and the sum of the sizes is
limited.
"""

from __future__ import annotations

import math
import os
import struct
import tokenize
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
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Errors that a damaged file raises.

Unknown flags raise RuntimeError. A header that is not a Python literal, or is deeply nested, raises SyntaxError,
TokenError, RecursionError (a RuntimeError) or MemoryError.
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
        try:
            _require_true_sizes(stream, most_bytes)
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        except _UNREADABLE as err:
            raise ValueError(str(err) or type(err).__name__) from None


def _require_true_sizes(stream: IO[bytes], most_bytes: int) -> None:
    """Raise ValueError if an archive states too large sizes, or other sizes than the arrays' headers."""
    most = min(most_bytes, max(FREE_BYTES, MOST_RATIO * os.fstat(stream.fileno()).st_size))
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > most:
            raise ValueError(f"unpacks to {size / 1e6:.0f} MB, reads at most {most / 1e6:.0f} MB")
        if len(members) > MOST_MEMBERS:
            raise ValueError(f"holds {len(members)} arrays, reads at most {MOST_MEMBERS}")
        for member in members:
            name = member.filename
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # unpack without limit
                raise ValueError(f"{name}: is packed in another way than NumPy packs arrays")
            with archive.open(member) as header:
                if np.lib.format.read_magic(header) != (1, 0):  # the headers of others may be of any length
                    raise ValueError(f"{name}: is no array of version 1.0")
                shape, _, kind = np.lib.format.read_array_header_1_0(header)
                length, held = math.prod(shape) * kind.itemsize, member.file_size - header.tell()
            if kind.kind not in "biufcSU" or not kind.itemsize:
                raise ValueError(f"{name}: is no array of numbers or texts; objects are not loaded")
            if held != length:
                raise ValueError(f"{name}: its header states {length:.6g} bytes, it has {held}")
