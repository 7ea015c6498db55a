"""Signals sampled at depths, read as the straight lines between the samples.

Everything the verdict says about depth (mode boundaries, deadbands) is exact for this interpolant, so
it does not depend on any finer grid. What the samples themselves miss between two depths is missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError


def require_depths_mm(depth_mm: ArrayLike) -> FloatArray:
    """Depths as an array, refused unless they start untouched and grow.

    Parameters
    ----------
    depth_mm : (n,) depths of one press [mm]; n >= 2, the first 0, strictly increasing

    Returns
    -------
    (n,) the same depths [mm]
    """
    depth = np.asarray(depth_mm, dtype=np.float64)
    if depth.ndim != 1 or depth.size < 2:
        raise InputError(f"depth_mm: shape {depth.shape}, needs (n,) with n >= 2; trace more depths")
    if not np.all(np.isfinite(depth)):
        raise InputError("depth_mm: has a value that is not finite; needs finite depths, drop the bad ones")
    if depth[0] != 0.0:
        raise InputError(f"depth_mm[0]: {depth[0]} mm, needs 0 mm; put the untouched state first")
    if not np.all(np.diff(depth) > 0.0):
        i = int(np.flatnonzero(np.diff(depth) <= 0.0)[0])
        raise InputError(
            f"depth_mm[{i + 1}]: {depth[i + 1]} mm, needs more than {depth[i]} mm; "
            "sort the depths and drop repeats"
        )
    return depth


def require_samples(name: str, values: ArrayLike, depth_mm: FloatArray, *, axes: int = 1) -> FloatArray:
    """Samples as an array, refused unless there is one finite row a depth.

    Parameters
    ----------
    name : what to call the samples in a message
    values : (n,) or, with axes = 2, (n, m) samples
    depth_mm : (n,) depths [mm]
    axes : number of axes that the samples must have

    Returns
    -------
    the same samples
    """
    samples = np.asarray(values, dtype=np.float64)
    if samples.ndim != axes or samples.shape[0] != depth_mm.size or samples.size == 0:
        shape = f"({depth_mm.size},)" if axes == 1 else f"({depth_mm.size}, pairs >= 1)"
        raise InputError(f"{name}: shape {samples.shape}, needs {shape}; give one sample a depth")
    if not np.all(np.isfinite(samples)):
        raise InputError(f"{name}: has a value that is not finite; needs finite samples, retrace that state")
    return samples


def interpolated(depth_mm: FloatArray, values: FloatArray, at_mm: FloatArray) -> FloatArray:
    """Samples at other depths, along straight lines.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n, ...) samples
    at_mm : (m,) depths asked for [mm]; outside the samples the end value holds

    Returns
    -------
    (m, ...) samples at `at_mm`
    """
    right = np.clip(np.searchsorted(depth_mm, at_mm), 1, depth_mm.size - 1)
    left = right - 1
    share = np.clip((at_mm - depth_mm[left]) / (depth_mm[right] - depth_mm[left]), 0.0, 1.0)
    share = share.reshape(share.shape + (1,) * (values.ndim - 1))
    line: FloatArray = values[left] * (1.0 - share) + values[right] * share
    return line


def between(
    depth_mm: FloatArray, values: FloatArray, from_mm: float, to_mm: float
) -> tuple[FloatArray, FloatArray]:
    """The part of a curve between two depths, with a sample at each of its ends.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n, ...) samples
    from_mm, to_mm : first and last depth of the part [mm]

    Returns
    -------
    depth_mm : (m,) depths of the part [mm]
    values : (m, ...) samples of the part
    """
    inside = depth_mm[(depth_mm > from_mm) & (depth_mm < to_mm)]
    part_mm = np.concatenate(([from_mm], inside, [to_mm]))
    return part_mm, interpolated(depth_mm, values, part_mm)


def clipped(
    depth_mm: FloatArray, counts: FloatArray, full_scale_counts: float
) -> tuple[FloatArray, FloatArray]:
    """Counts as a converter reads them: never above full scale, with a sample wherever a line meets it.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    counts : (n,) or (n, pair) unlimited counts
    full_scale_counts : largest reading [counts]

    Returns
    -------
    depth_mm : (m,) the depths, and those where some pair enters or leaves full scale [mm]
    counts : (m,) or (m, pair) counts, at most full scale
    """
    table = counts.reshape(depth_mm.size, -1)
    before, after = table[:-1] - full_scale_counts, table[1:] - full_scale_counts
    segment, pair = np.nonzero(before * after < 0.0)
    share = before[segment, pair] / (before[segment, pair] - after[segment, pair])
    meets_mm = depth_mm[segment] + share * np.diff(depth_mm)[segment]
    all_mm = np.union1d(depth_mm, meets_mm)
    return all_mm, np.minimum(interpolated(depth_mm, counts, all_mm), full_scale_counts)


def share_above(depth_mm: FloatArray, values: FloatArray, level: float) -> float:
    """Share of the depth range over which a curve lies above a level.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    values : (n,) samples
    level : level, in the unit of the samples

    Returns
    -------
    share [-], 0 to 1
    """
    before, after = values[:-1] - level, values[1:] - level
    high, low = np.maximum(before, after), np.minimum(before, after)
    part = np.where(low > 0.0, 1.0, np.maximum(high, 0.0) / np.where(high > low, high - low, 1.0))
    part = np.where((high <= 0.0), 0.0, part)
    return float(np.sum(part * np.diff(depth_mm)) / (depth_mm[-1] - depth_mm[0]))
