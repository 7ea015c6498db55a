"""The detection threshold: the lightest press that the pad detects at each location, in millimetres and newtons.

A press is detected when at least one pair's reading differs from its untouched value by the deadband threshold, 3
noise units, in a single frame. Several pairs or frames evaluated together detect lighter presses. The error of the
light trace gives a band of depths: at its ends, the change plus or minus two standard errors reaches the threshold.
Loads come from the contact model at each location, also near walls. The band of a load is due to that of Young's
modulus. Changes are interpolated linearly between the traced depths. Below the first traced depth, this makes the
threshold too small, because signals grow faster than depth at first contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.bounds.fisher import BAND
from optopad.sims.contact.force_curve import band_factors
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import Contact
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, noise_units, sigma_counts


@dataclass(frozen=True, kw_only=True)
class DetectionThreshold:
    """The lightest detected press at each location of a grid.

    Arrays are infinite where no press within the usable range is detected, and NaN outside the workspace.

    Attributes
    ----------
    x_mm, y_mm : (nx,) and (ny,) coordinates of the grid [mm]
    depth_mm : (ny, nx) depth from which a press is detected [mm]
    depth_low_mm, depth_high_mm : (ny, nx) the same depth if every signal change is raised or lowered, respectively,
        by two standard errors of the light trace [mm]
    force_n : (ny, nx) load at `depth_mm` for the nominal Young's modulus [N]
    force_error_low_n, force_error_high_n : (ny, nx) load at `depth_low_mm` and `depth_high_mm` [N]
    low_n, high_n : (ny, nx) load at `depth_mm` for the lower and upper end of the modulus's band [N]
    threshold : change of a reading that counts as detected [noise units]
    """

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    depth_mm: FloatArray
    depth_low_mm: FloatArray
    depth_high_mm: FloatArray
    force_n: FloatArray
    force_error_low_n: FloatArray
    force_error_high_n: FloatArray
    low_n: FloatArray
    high_n: FloatArray
    threshold: float

    @property
    def worst(self) -> tuple[int, int]:
        """Indices (y, x) of the location where a press must be deepest to be detected."""
        row, column = np.unravel_index(int(np.nanargmax(self.depth_mm)), self.depth_mm.shape)
        return int(row), int(column)


def detection_threshold(
    contact: Contact,
    flux: FloatArray,
    standard_error: FloatArray,
    x_mm: tuple[float, ...],
    y_mm: tuple[float, ...],
    depth_mm: FloatArray,
    readout: Readout,
    threshold: float = DEADBAND_THRESHOLD,
) -> DetectionThreshold:
    """The lightest detected press at each location of a grid.

    Parameters
    ----------
    flux, standard_error : (ny, nx, nd, pair) received over emitted power, and its standard error [-]. The first depth
        is the untouched pad. Values outside the workspace are NaN
    x_mm, y_mm, depth_mm : (nx,), (ny,) and (nd,) coordinates of the grid [mm]
    readout : gains of the receivers, and the noise of a reading
    threshold : change of a reading that counts as detected [noise units]
    """
    noise, gains = readout.noise, readout.of_all_pairs(flux.shape[-1])
    counts = np.minimum(flux * gains, readout.full_scale_counts)
    units = noise_units(counts, **noise)
    error = standard_error * gains / sigma_counts(counts, **noise)
    change = np.abs(units - units[:, :, :1])
    depths = [
        _first_reached_mm(depth_mm, (change + shift * BAND * error).max(axis=-1), threshold)
        for shift in (0.0, 1.0, -1.0)
    ]
    forces = _forces_n(contact, x_mm, y_mm, depths)
    low, high = band_factors(contact.draft.modulus)
    return DetectionThreshold(
        x_mm=x_mm,
        y_mm=y_mm,
        depth_mm=depths[0],
        depth_low_mm=depths[1],
        depth_high_mm=depths[2],
        force_n=forces[0],
        force_error_low_n=forces[1],
        force_error_high_n=forces[2],
        low_n=low * forces[0],
        high_n=high * forces[0],
        threshold=threshold,
    )


def _first_reached_mm(depth_mm: FloatArray, change: FloatArray, threshold: float) -> FloatArray:
    """(ny, nx) depth where the linearly interpolated change first reaches the threshold [mm].

    It is infinite where the threshold is not reached, and NaN outside the workspace.
    """
    is_above = change >= threshold
    first = np.argmax(is_above, axis=-1)
    before = np.maximum(first - 1, 0)
    after_value, before_value = (
        np.take_along_axis(change, index[..., None], axis=-1)[..., 0] for index in (first, before)
    )
    rise = after_value - before_value
    share = np.divide(threshold - before_value, rise, out=np.zeros_like(rise), where=rise > 0.0)
    found = depth_mm[before] + np.clip(share, 0.0, 1.0) * (depth_mm[first] - depth_mm[before])
    found = np.where(is_above.any(axis=-1), found, np.inf)
    return np.where(np.isnan(change[:, :, 0]), np.nan, found)


def _forces_n(
    contact: Contact, x_mm: tuple[float, ...], y_mm: tuple[float, ...], depths_mm: Sequence[FloatArray]
) -> FloatArray:
    """(set, ny, nx) load at each location's depths [N]; infinite or NaN where the depth is infinite or NaN."""
    depth_mm = np.stack(depths_mm)
    force = np.where(np.isnan(depth_mm), np.nan, np.inf)
    for row, column in np.argwhere(np.isfinite(depth_mm).any(axis=0)):
        press = solved_press(contact, at_mm=(x_mm[column], y_mm[row]))
        for number in np.flatnonzero(np.isfinite(depth_mm[:, row, column])):
            force[number, row, column] = press.force_n(float(depth_mm[number, row, column]))
    return force
