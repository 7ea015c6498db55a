"""Table of a pad's signals by location and depth of a press, which the simulated board uses.

A `PressTable` is interpolated linearly in x, y and depth. Presses outside the table's grid get the nearest values, and
a depth of 0 or less is the untouched pad. Real signals are not linear over depth steps of 0.2 mm, so the table is only
suitable for testing software, not for judging a layout. A model of two touches may explain what linear interpolation
leaves by a second touch; a `SplineTable`, of more locations, is smooth.

The signals of two fingers are those of the untouched pad times the product of the single fingers' ratios. The product
leaves out that the fingers deform the surface between them together, and that light passes both: the correction that
`optopad.sims.touches` computes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.netcdf_file import read_netcdf, require_numbers
from optopad.fabrication.driver_file import DriverConfig
from optopad.sims.learning.inference.signal_map import TensorSpline

MOST_BYTES = 500_000_000
"""Largest size of a signal file [bytes]; 6,000 presses with 1,024 pairs need 50 MB."""
NEEDED = "simulated signals; run `optopad score` again"
PRESS = ("press_x", "press_y", "press_depth")
SAME_MM = 1e-6
"""Coordinates of the grid that differ by less than this are considered equal [mm]."""


@dataclass(frozen=True, kw_only=True)
class PressTable:
    """Signals for a full grid of presses in x, y and depth.

    Attributes
    ----------
    x_mm, y_mm, depth_mm : coordinates of the grid in the cavity's coordinate system, in increasing order [mm]; the
        first depth is 0
    counts : signals without ambient light, not limited to full scale; shape (number of x, number of y, number of
        depths, emitters, receivers) [counts]
    """

    x_mm: FloatArray
    y_mm: FloatArray
    depth_mm: FloatArray
    counts: FloatArray

    @property
    def untouched(self) -> FloatArray:
        """Signals of the untouched pad, shape (emitters, receivers) [counts]."""
        found: FloatArray = self.counts[0, 0, 0]
        return found

    @property
    def knows_presses(self) -> bool:
        """Whether the table contains presses, not only the untouched pad."""
        return len(self.depth_mm) > 1

    def at(self, presses: ArrayLike) -> FloatArray:
        """Signals during n presses, interpolated linearly; shape (n, emitters, receivers) [counts].

        Parameters
        ----------
        presses : x, y and depth of each press, shape (n, 3) [mm]
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

    def together(self, tips: ArrayLike) -> FloatArray:
        """Signals while several tips press at a time, shape (emitters, receivers) [counts].

        Parameters
        ----------
        tips : x, y and depth of each tip, shape (tip, 3) [mm]; a tip at a depth of 0 or less changes nothing
        """
        touching = _touching(tips)
        if not len(touching):
            return self.untouched.copy()
        first, *more = self.at(touching)
        for one in more:
            first = first * np.divide(one, self.untouched, out=np.ones_like(one), where=self.untouched > 0.0)
        return np.asarray(first)


@dataclass(frozen=True, kw_only=True)
class SplineTable:
    """Signals by a spline over x, y and √depth.

    Attributes
    ----------
    untouched : signals of the untouched pad without ambient light, shape (emitters, receivers) [counts]
    ratio_root : √(signal / untouched signal) of every pair
    """

    untouched: FloatArray
    ratio_root: TensorSpline
    knows_presses = True

    def together(self, tips: ArrayLike) -> FloatArray:
        """Signals while several tips press at a time, as of `PressTable`."""
        ratio = self.ratio_root.values(_touching(tips)).prod(axis=0) ** 2
        return np.asarray(self.untouched * ratio.reshape(self.untouched.shape))


SignalTable = PressTable | SplineTable


def _touching(tips: ArrayLike) -> FloatArray:
    rows = np.atleast_2d(np.asarray(tips, dtype=np.float64))
    return np.asarray(rows[rows[:, 2] > 0.0])


def _neighbours(line: FloatArray, values: FloatArray) -> list[tuple[NDArray[np.intp], FloatArray]]:
    """Indices of the coordinates in `line` below and above each value, and their weights for linear interpolation."""
    place = np.interp(values, line, np.arange(len(line)))
    low = np.minimum(place.astype(np.intp), max(len(line) - 2, 0))
    share = place - low
    return [(low, 1.0 - share), (np.minimum(low + 1, len(line) - 1), share)]


def untouched_table(config: DriverConfig) -> PressTable:
    """Table with only the untouched pad's simulated signals, which a driver configuration contains.

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
    presses : x, y and depth of n presses, shape (n, 3) [mm]; the smallest depth must be 0
    counts : signals during each press, shape (n, emitters, receivers) [counts]
    is_whole : if True, every location of the grid is required; if False, a missing location gets the signals of the
        nearest one

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
    """Presses and signals for a full rectangular grid; a missing location gets the signals of the nearest one."""
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
    """Table of the simulated signals in `file` (a bundle's `sims/signals.nc`), using the configuration's gains.

    This function needs xarray.

    Raises
    ------
    InputError : the file cannot be read, is of another design or is not a full grid, or the configuration has no gains.
    """
    dataset = read_netcdf(file, needed=NEEDED, most_bytes=MOST_BYTES)
    if missing := [name for name in (*PRESS, "flux") if name not in dataset]:
        raise InputError(f"{file}: has no {', '.join(missing)}; needs {NEEDED}")
    require_numbers(dataset, file, PRESS, ("state",))
    require_numbers(dataset, file, ("flux",), ("state", "emitter", "receiver"))
    presses = np.stack([np.asarray(dataset[name].values, dtype=np.float64) for name in PRESS], axis=1)
    flux = np.asarray(dataset["flux"].values, dtype=np.float64)
    belongs_to = str(dataset.attrs.get("design_digest", "unknown"))
    if belongs_to != config.digest:
        raise InputError(
            f"{file}: of design {belongs_to[:8]}, needed {config.digest[:8]}; run `optopad score` again"
        )
    gains = gains_of(config)
    if flux.shape[2] != len(gains):
        raise InputError(
            f"{file}: flux of the shape {flux.shape}, needs (state, emitter, {len(gains)}); run `optopad score` again"
        )
    return table_of(presses, flux * gains, is_whole=not config.workspace.area.arcs)


def gains_of(config: DriverConfig) -> FloatArray:
    """Reading of each receiver if it got all of an emitter's power, shape (receivers,) [counts].

    Raises
    ------
    InputError : the configuration has no gains, because it was written before the design was simulated.
    """
    gain = config.gain
    each = gain.receiver_counts_per_flux or (gain.counts_per_flux,) * config.frame.receivers
    if any(one is None for one in each):
        raise InputError(
            f"driver.toml of {config.design} has no gain: nothing was simulated before it was written; run "
            "`optopad score`, then `optopad driver config`, on the design"
        )
    return np.array(each, dtype=np.float64)
