"""netCDF files read with suspicion: sizes are checked before anything is loaded, and damage is the file's fault.

The HDF5 library looks at metadata only when they are needed, and answers damage with whatever its caller was about to
do: errors of many types, or arrays of the size that a damaged header says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from design.errors import InputError
from design.text_file import kind_of_file

if TYPE_CHECKING:
    import xarray as xr

ENGINES: dict[str, dict[str, Any]] = {
    "an HDF5 or netCDF-4 file": {"engine": "h5netcdf", "phony_dims": "access"},
    "a netCDF-3 file": {"engine": "scipy"},
}
"""How xarray reads each kind of file."""
MOST_BYTES = 8_000_000_000
"""Of all arrays unpacked: twice the largest file that is read, whose counts have 2 bytes and become 4."""
MOST_RATIO = 200
"""Of the unpacked size over the file's: measured counts shrink to a fifth, equal ones to a thousandth."""
FREE_BYTES = 500_000_000
"""Unpacked size below which any ratio is taken."""


def read_netcdf(file: Path, *, needed: str, most_bytes: int, **options: Any) -> xr.Dataset:
    """Everything in a netCDF-4 or netCDF-3 file, in memory; texts are `str`.

    Parameters
    ----------
    needed : what the file must be and which command makes it, in words for messages
    most_bytes : size above which the file is refused unread
    options : for `xarray.open_dataset`

    Raises
    ------
    InputError : no such file, another kind of file, damaged, or too large; the message names the file.
    """
    import xarray as xr

    if not file.is_file():
        what = "a folder" if file.is_dir() else "no such file"
        raise InputError(f"{file}: {what}; needed is {needed}")
    if (size := file.stat().st_size) > most_bytes:
        raise InputError(f"{file}: {size / 1e6:.0f} MB, reads at most {most_bytes / 1e6:.0f} MB; cut it")
    engine = ENGINES.get(kind := kind_of_file(file))
    if engine is None:
        raise InputError(f"{file}: {kind}; needed is {needed}")
    try:
        most = min(MOST_BYTES, max(FREE_BYTES, MOST_RATIO * size))
        if engine["engine"] == "h5netcdf" and (unpacked := _unpacked_bytes(file)) > most:
            raise ValueError(f"unpacks to {unpacked:.3g} bytes, reads at most {most:.3g}")
        with xr.open_dataset(file, **engine, **options) as dataset:
            if dataset.nbytes > most:
                raise ValueError(f"holds {dataset.nbytes:.3g} bytes, reads at most {most:.3g}")
            found = dataset.load()
    except Exception as err:  # on purpose all: see above
        said = str(err) or type(err).__name__
        raise InputError(f"{file}: {kind} that cannot be read: {said}; needed is {needed}") from None
    return found.assign(
        {name: one.astype(str) for name, one in found.variables.items() if one.dtype.kind == "S"}
    )


def require_numbers(found: xr.Dataset, file: Path, names: Sequence[str], axes: tuple[str, ...]) -> None:
    """Refuse arrays of other dimensions (in any order), and of what is no number.

    Raises
    ------
    InputError : the first array that is refused.
    """
    for name in names:
        array = found[name]
        if sorted(map(str, array.dims)) != sorted(axes):
            raise InputError(f"{file}: {name} has the dimensions {array.dims}, needs {axes}")
        if array.dtype.kind not in "fiu":
            raise InputError(f"{file}: {name} is of the type {array.dtype}, needs numbers")


def _unpacked_bytes(file: Path) -> int:
    """Bytes of all arrays by their headers. What is read first also keeps h5netcdf from half opening a damaged file."""
    import h5py

    sizes: list[int] = []

    def add(_name: str, found: Any) -> None:
        if isinstance(found, h5py.Dataset):
            sizes.append(math.prod(found.shape or ()) * found.dtype.itemsize)

    with h5py.File(file, "r") as held:
        held.attrs.get("_nc3_strict")
        held.visititems(add)
    return sum(sizes)
