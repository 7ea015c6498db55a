"""Table of a pad's signals over location and depth of a press: the input of the simulated board.

The table is interpolated linearly in x, y and depth. Presses outside the table's grid take the nearest values, and
depth 0 or less is the untouched pad. Real signals are not linear over depth steps of 0.2 mm, so the table serves to
test software, not to judge a layout.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from design.arrays import FloatArray
from design.errors import InputError
from fabrication.driver_file import DriverConfig

if TYPE_CHECKING:
    import xarray as xr

MOST_BYTES = 500_000_000
"""Largest size of the unpacked arrays of a signal file [bytes]; 6,000 presses with 1,024 pairs need 50 MB."""
SAME_MM = 1e-6
"""Tolerance within which two coordinates of the grid are equal [mm]."""


@dataclass(frozen=True, kw_only=True)
class PressTable:
    """Signals over a full grid of presses in x, y and depth.

    Attributes
    ----------
    x_mm, y_mm, depth_mm : (nx,), (ny,), (nd,) rising coordinates of the grid in the cavity frame [mm]; the first depth
        is 0
    counts : (nx, ny, nd, emitter, receiver) signals without ambient light, not clipped [counts]
    """

    x_mm: FloatArray
    y_mm: FloatArray
    depth_mm: FloatArray
    counts: FloatArray

    @property
    def untouched(self) -> FloatArray:
        """(emitter, receiver) signals of the untouched pad [counts]."""
        found: FloatArray = self.counts[0, 0, 0]
        return found

    @property
    def knows_presses(self) -> bool:
        """Whether the table contains any press, and not only the untouched pad."""
        return len(self.depth_mm) > 1

    def at(self, presses: ArrayLike) -> FloatArray:
        """(n, emitter, receiver) signals under presses, interpolated linearly [counts].

        presses : (n, 3) x, y, depth [mm]
        """
        rows = np.atleast_2d(np.asarray(presses, dtype=np.float64))
        found = np.zeros((len(rows), *self.counts.shape[3:]))
        corners = [
            _neighbours(line, rows[:, k]) for k, line in enumerate((self.x_mm, self.y_mm, self.depth_mm))
        ]
        for i, x_share in corners[0]:
            for j, y_share in corners[1]:
                for k, depth_share in corners[2]:
                    found += (x_share * y_share * depth_share)[:, None, None] * self.counts[i, j, k]
        return found


def _neighbours(line: FloatArray, values: FloatArray) -> list[tuple[NDArray[np.intp], FloatArray]]:
    """Indices of the coordinates in `line` below and above each value, and their weights for linear interpolation."""
    place = np.interp(values, line, np.arange(len(line)))
    low = np.minimum(place.astype(np.intp), max(len(line) - 2, 0))
    share = place - low
    return [(low, 1.0 - share), (np.minimum(low + 1, len(line) - 1), share)]


def untouched_table(config: DriverConfig) -> PressTable:
    """Table with only the untouched pad's signals, as a driver configuration contains them.

    Raises
    ------
    InputError : the configuration has no simulated signals.
    """
    if config.expected is None:
        raise InputError(
            f"driver.toml of {config.design} has no expected pattern; run `optopad score` and "
            "`optopad driver config` on the design, or name the design itself"
        )
    zero = np.zeros(1)
    counts = np.array(config.expected.untouched_counts)[None, None, None]
    return PressTable(x_mm=zero, y_mm=zero, depth_mm=zero, counts=counts)


def table_of(presses: FloatArray, counts: FloatArray, *, is_whole: bool = True) -> PressTable:
    """Build a table from presses that form a full grid, in any order.

    Parameters
    ----------
    presses : (state, 3) x, y, depth of each press [mm]; the least depth must be 0
    counts : (state, emitter, receiver) signals [counts]
    is_whole : True requires every location of the grid; with False, a missing location gets the signals of the nearest

    Raises
    ------
    InputError : the presses do not form a full grid.
    """
    if not is_whole:
        presses, counts = _squared(presses, counts)
    lines = [np.unique(presses[:, k]) for k in range(3)]
    shape = tuple(len(line) for line in lines)
    if (
        len(presses) != np.prod(shape)
        or len(np.unique(presses, axis=0)) != len(presses)
        or lines[2][0] != 0.0
    ):
        raise InputError(
            f"{len(presses)} presses are not a full grid of locations and depths from 0; simulate them again"
        )
    order = np.lexsort(presses.T[::-1])
    grid = counts[order].reshape(*shape, *counts.shape[1:])
    return PressTable(x_mm=lines[0], y_mm=lines[1], depth_mm=lines[2], counts=grid)


def _squared(presses: FloatArray, counts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Presses and signals on a full rectangular grid; a missing location gets the signals of the nearest one."""
    there = np.unique(presses[:, :2], axis=0)
    every = np.array([(x, y) for x in np.unique(presses[:, 0]) for y in np.unique(presses[:, 1])])
    absent = [place for place in every if not (np.abs(there - place).max(axis=1) < SAME_MM).any()]
    found, signals = [presses], [counts]
    for place in absent:
        nearest = there[np.argmin(((there - place) ** 2).sum(axis=1))]
        rows = np.flatnonzero((presses[:, :2] == nearest).all(axis=1))
        found.append(np.column_stack([np.tile(place, (len(rows), 1)), presses[rows, 2]]))
        signals.append(counts[rows])
    return np.concatenate(found), np.concatenate(signals)


def table_from_signals(file: Path, config: DriverConfig) -> PressTable:
    """Table of the simulated signals in `file` (a bundle's `sims/signals.nc`), with the configuration's gains.

    Needs xarray.

    Raises
    ------
    InputError : the file cannot be read, is of another design or is not a full grid, or the configuration has no gains.
    """
    import h5py
    import xarray as xr

    try:
        with h5py.File(file, "r") as held:  # as h5netcdf reads first: it must not half open a damaged file
            held.attrs.get("_nc3_strict")
        with xr.open_dataset(file, engine="h5netcdf", phony_dims="access") as dataset:
            size = sum(dataset[name].nbytes for name in ("press_x", "press_y", "press_depth", "flux"))
            if size > MOST_BYTES:
                raise ValueError(f"unpacks to {size / 1e6:.0f} MB, reads at most {MOST_BYTES / 1e6:.0f} MB")
            presses = np.stack([_numbers(dataset[f"press_{axis}"]) for axis in ("x", "y", "depth")], axis=1)
            flux = _numbers(dataset["flux"])
            belongs_to = str(dataset.attrs["design_digest"])
    except Exception as err:  # all on purpose: the library raises errors of many types on damage
        raise InputError(f"{file}: no simulated signals: {err}; run `optopad score` again") from None
    if belongs_to != config.digest:
        raise InputError(
            f"{file}: of design {belongs_to[:8]}, needed {config.digest[:8]}; run `optopad score` again"
        )
    gains = gains_of(config)
    if flux.ndim != 3 or flux.shape[2] != len(gains):
        raise InputError(
            f"{file}: flux of the shape {flux.shape}, needs (state, emitter, {len(gains)}); run `optopad score` again"
        )
    return table_of(presses, flux * gains, is_whole=not config.workspace.area.arcs)


def _numbers(array: xr.DataArray) -> FloatArray:
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{array.name} is of the type {array.dtype}, needs numbers")
    return np.asarray(array.values, dtype=np.float64)


def gains_of(config: DriverConfig) -> FloatArray:
    """Reading of each receiver if it got all of an emitter's power, (receiver,) [counts].

    Raises
    ------
    InputError : the configuration has no gains, because it was written before a simulation.
    """
    gain = config.gain
    each = gain.receiver_counts_per_flux or (gain.counts_per_flux,) * config.frame.receivers
    if any(one is None for one in each):
        raise InputError(
            f"driver.toml of {config.design} has no gain: nothing was simulated before it was written; run "
            "`optopad score`, then `optopad driver config`, on the design"
        )
    return np.array(each, dtype=np.float64)
