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

if TYPE_CHECKING:
    import xarray as xr

MOST_BYTES = 8_000_000_000
"""Of all arrays unpacked: twice the largest file that is read, whose counts have 2 bytes and become 4."""


def read_netcdf(file: Path, **options: Any) -> xr.Dataset:
    """Everything in a file, in memory.

    Parameters
    ----------
    options : for `xarray.open_dataset`

    Raises
    ------
    InputError : no netCDF file, damaged, or larger when unpacked; the message names the file.
    """
    import xarray as xr

    try:
        size = _unpacked_bytes(file)
        if size > MOST_BYTES:
            raise ValueError(f"unpacks to {size:.3g} bytes, reads at most {MOST_BYTES:.3g}")
        with xr.open_dataset(file, engine="h5netcdf", phony_dims="access", **options) as dataset:
            return dataset.load()
    except Exception as err:  # on purpose all: see above
        said = str(err) or type(err).__name__
        raise InputError(f"{file}: no netCDF file that can be read: {said}") from None


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
