"""Reads netCDF-4 files, which are HDF5 files: all sizes are checked before the library allocates memory for them.

A damaged or malicious file may state any size. The HDF5 library believes it: a file of 260 kB that states a header of
1.7 GB takes 1.7 GB of memory. Two means prevent this:

    the file is opened here, and reading past its end is refused   sizes of headers, groups and heaps
    the headers are checked before the arrays are read             sizes of arrays, chunks, texts and attributes

Packed data need checks of their own. A packed chunk can unpack to more than the size that its header states: by deflate
to 1032 times its packed size, and packed twice to a million times.

The HDF5 library reads metadata only when they are needed, so damage may cause errors of many types. All of them become
an `InputError` that names the file.
"""

from __future__ import annotations

import io
import math
import os
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.errors import InputError
from optopad.design.files import HDF5, NETCDF3, kind_of_file, require_file

if TYPE_CHECKING:
    import h5py
    import xarray as xr

MOST_BYTES = 8_000_000_000
"""Largest accepted size of all unpacked arrays [bytes]: twice the largest file, as 2-byte counts become 4 bytes."""
MOST_RATIO = 200
"""Largest accepted ratio of unpacked size to file size: packing divides measured counts by 5, constant ones by 1000."""
FREE_BYTES = 500_000_000
"""Unpacked size below which any ratio is accepted [bytes]."""
NEWER = "; `nccopy -k nc4 OLD NEW` makes netCDF-4 of it"
MOST_TEXT_BYTES = 10_000_000
"""Largest total size of texts of variable length; each of them may refer to the same long text of the file."""
MOST_TEXTS = 10_000
MOST_ATTRIBUTE_BYTES = 1_000_000
DEFLATE, SHUFFLE, CHECKSUM = 1, 2, 3
"""Numbers of HDF5's filters; all others unpack data, too."""
DEFLATE_RATIO = 1032
"""Largest ratio of unpacked to packed size that the format deflate permits."""
GROWTH = 1.1, 1_000
"""Accepted ratio and additional bytes by which packing may lengthen a chunk that cannot be packed."""
PIECE_BYTES = 1_000_000


def read_netcdf(file: Path, *, needed: str, most_bytes: int, **options: Any) -> xr.Dataset:
    """The content of a netCDF-4 file, in memory; texts are `str` without blanks at the end.

    Parameters
    ----------
    needed : for error messages: what file is needed, and the command that makes it
    most_bytes : unpacked size above which the file is refused before it is read [bytes]
    options : options for `xarray.open_dataset`

    Raises
    ------
    InputError : the file is missing, in another format, damaged, or too large; the message names it.
    """
    import xarray as xr

    require_file(file, needed=needed)
    if (size := file.stat().st_size) > most_bytes:
        raise InputError(f"{file}: {size / 1e6:.0f} MB, reads at most {most_bytes / 1e6:.0f} MB; cut it")
    if (kind := kind_of_file(file)) != HDF5:
        raise InputError(f"{file}: {kind}; needs {needed}{NEWER if kind == NETCDF3 else ''}")
    try:
        most = min(MOST_BYTES, max(FREE_BYTES, MOST_RATIO * size))
        with (
            limited_hdf5(file, most_bytes=most) as source,
            xr.open_dataset(source, engine="h5netcdf", phony_dims="access", **options) as dataset,
        ):
            if dataset.nbytes > most:
                raise ValueError(f"holds {dataset.nbytes:.3g} bytes, reads at most {most:.3g}")
            found = dataset.load()
    except Exception as err:  # catch every type of error: see the module docstring
        said = str(err) or type(err).__name__
        raise InputError(f"{file}: {kind} that cannot be read: {said}; needs {needed}") from None
    return found.assign({name: _text_of(one) for name, one in found.variables.items() if _is_text(one)})


def _is_text(array: xr.Variable) -> bool:
    return array.dtype.kind in "SU" or (
        array.dtype.kind == "O" and all(isinstance(one, str | bytes) for one in array.values.ravel())
    )


def _text_of(array: xr.Variable) -> xr.Variable:
    """Texts as `str`, however a program stored them: as bytes, as arrays of characters, or filled up with blanks."""
    import xarray as xr

    values, axes = array.values, array.dims
    if (
        values.ndim > 1
        and values.dtype.kind in "SU"
        and values.dtype.itemsize == np.dtype(f"{values.dtype.kind}1").itemsize
    ):
        values, axes = (
            np.ascontiguousarray(values).view(f"{values.dtype.kind}{values.shape[-1]}")[..., 0],
            axes[:-1],
        )
    texts = [one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in values.ravel()]
    plain = np.array([text.rstrip(" \0") for text in texts], dtype=str).reshape(values.shape)
    return xr.Variable(axes, plain, array.attrs)


def require_numbers(found: xr.Dataset, file: Path, names: Sequence[str], axes: tuple[str, ...]) -> None:
    """Check that arrays are numeric, and that their dimensions are `axes` in any order.

    Raises
    ------
    InputError : an array fails the check; the message names the first one that does.
    """
    for name in names:
        array = found[name]
        if sorted(map(str, array.dims)) != sorted(axes):
            raise InputError(f"{file}: {name} has the dimensions {array.dims}, needs {axes}")
        if array.dtype.kind not in "fiu":
            raise InputError(f"{file}: {name} is of the type {array.dtype}, needs numbers")


class WholeReads(io.FileIO):
    """File whose `readinto`, by which the HDF5 library reads, raises OSError if the file ends too early."""

    def readinto(self, buffer: Any, /) -> int:
        """Fill the buffer completely."""
        length, filled = len(memoryview(buffer)), super().readinto(buffer)
        if filled is None or filled < length:
            raise OSError(
                f"its headers state {length} bytes where the file ends after {filled or 0}; it is damaged"
            )
        return filled


@contextmanager
def limited_hdf5(file: Path, *, most_bytes: float) -> Iterator[WholeReads]:
    """Context manager for an open HDF5 file that does not unpack to more than `most_bytes`, for h5py or xarray.

    Raises
    ------
    ValueError : the arrays are too large, packed in an unusual way, or in other files.
    OSError, KeyError, RuntimeError and others of the library : the file is damaged.
    """
    import h5py

    with WholeReads(str(file), "rb") as stream:
        with h5py.File(stream, "r") as held:
            _require_unpackable(held, os.fstat(stream.fileno()).st_size, most_bytes)
        yield stream


def _require_unpackable(held: h5py.File, file_bytes: int, most_bytes: float) -> None:
    """Raise ValueError if the arrays and attributes of a file unpack to too much, or are not in the file itself."""
    import h5py

    groups: list[h5py.Group] = [held]
    arrays: list[h5py.Dataset] = []

    def add(_name: str, found: Any) -> None:
        if isinstance(found, h5py.Dataset):
            arrays.append(found)
        elif isinstance(found, h5py.Group):
            groups.append(found)

    held.visititems(add)
    for group in groups:
        _require_own_links(group)
    size = sum(map(_bytes_of, arrays))
    if size > most_bytes:
        raise ValueError(f"unpacks to {size:.3g} bytes, reads at most {most_bytes:.3g}")
    for one in (*groups, *arrays):
        _require_short_attributes(one, file_bytes, most_bytes)
    for array in arrays:
        _require_plain_packing(array, most_bytes)
        _require_short_texts(array, file_bytes, most_bytes)


def _require_own_links(group: h5py.Group) -> None:
    import h5py

    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
            raise ValueError(f"{name}: refers to another file; copy its content into this one")


def _bytes_of(array: h5py.Dataset) -> float:
    """Memory that reading an array takes, at least that of one chunk [bytes]."""
    shape, chunk = array.shape or (), array.chunks or ()
    return float(max(math.prod(shape), math.prod(chunk) if chunk else 0) * array.id.get_type().get_size())


def _require_short_attributes(one: h5py.Group | h5py.Dataset, file_bytes: int, most_bytes: float) -> None:
    for name in one.attrs:
        found = one.attrs.get_id(name)
        count = math.prod(found.shape or ())
        size = count * found.get_type().get_size()
        if size > MOST_ATTRIBUTE_BYTES or (found.dtype.hasobject and count * file_bytes > most_bytes):
            raise ValueError(f"{name}: an attribute of {count} entries is too much")


def _require_plain_packing(array: h5py.Dataset, most_bytes: float) -> None:
    """Raise ValueError if an array is packed twice, in other files, or in chunks that hold more than they state."""
    if array.is_virtual or array.external:
        raise ValueError(f"{array.name}: its data are in other files; copy them into this one")
    plan = array.id.get_create_plist()
    filters = [plan.get_filter(number)[0] for number in range(plan.get_nfilters())]
    unpacking = [number for number in filters if number not in (SHUFFLE, CHECKSUM)]
    if len(unpacking) > 1 or (DEFLATE in filters and filters[-1] not in (DEFLATE, CHECKSUM)):
        raise ValueError(f"{array.name}: is packed more than once; pack it once")
    if not unpacking or not array.chunks:
        return
    stated = math.prod(array.chunks) * array.id.get_type().get_size()
    sizes: list[tuple[tuple[int, ...], int]] = []
    array.id.chunk_iter(lambda chunk: sizes.append((chunk.chunk_offset, chunk.size)))
    for offset, packed in sizes:
        if packed > GROWTH[0] * stated + GROWTH[1]:
            raise ValueError(f"{array.name}: a chunk of {packed} bytes that states {stated}; it is damaged")
        if DEFLATE in filters and packed * DEFLATE_RATIO > most_bytes:
            _require_stated(array, offset, stated)


def _require_stated(array: h5py.Dataset, offset: tuple[int, ...], stated: int) -> None:
    """Raise ValueError if a chunk packed by deflate unpacks to more bytes than its header states."""
    _, packed = array.id.read_direct_chunk(offset)
    unpacking, left, rest = zlib.decompressobj(), stated, packed
    while rest and not unpacking.eof:
        left -= len(unpacking.decompress(rest, PIECE_BYTES))
        rest = unpacking.unconsumed_tail
        if left < 0:
            raise ValueError(f"{array.name}: a chunk unpacks to more than the {stated} bytes that it states")


def _require_short_texts(array: h5py.Dataset, file_bytes: int, most_bytes: float) -> None:
    """Raise ValueError if the texts of an array are too long in total, which its header does not state.

    Each entry may refer to the same long text of the file, so texts are measured one by one if this could matter.
    """
    if not array.dtype.hasobject or array.shape is None or array.size * file_bytes <= most_bytes:
        return
    if array.size > MOST_TEXTS:
        raise ValueError(f"{array.name}: {array.size} texts in so large a file, reads at most {MOST_TEXTS}")
    size = 0
    for place in np.ndindex(array.shape):
        size += len(array[place])
        if size > MOST_TEXT_BYTES:
            raise ValueError(f"{array.name}: texts of more than {MOST_TEXT_BYTES} bytes; shorten them")
