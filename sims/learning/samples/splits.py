"""Which samples tune, which train: by location, never by sample; and a smaller share that covers all of them."""

from __future__ import annotations

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray


def held_out(location: IntArray, share: float, rng: np.random.Generator) -> BoolArray:
    """(sample,) whether the sample's location is held out; at least one location is, and one is not.

    Parameters
    ----------
    location : (sample,) number of the location, or of the press where presses are to be held out
    share : of the locations that are held out
    """
    numbers = np.unique(location)
    count = int(np.clip(round(share * len(numbers)), 1, len(numbers) - 1))
    return np.asarray(np.isin(location, rng.permutation(numbers)[:count]))


def spread_samples(press: IntArray, depth_mm: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Numbers of at most ``count`` samples, spread over presses and depths, in rising order.

    Every press gives its share, taken at even steps along its depths from a start of its own: each press covers the
    depths evenly, and neighbouring presses do not all fall on the same ones.
    """
    samples = len(press)
    if samples <= count:
        return np.arange(samples)
    order = np.lexsort((depth_mm, press))
    _, begins, sizes = np.unique(press[order], return_index=True, return_counts=True)
    wanted = _shares(sizes, count, rng)
    chosen = [
        order[begin + ((np.arange(take) + rng.random()) * size / take).astype(np.int64)]
        for begin, size, take in zip(begins, sizes, wanted, strict=True)
        if take
    ]
    return np.sort(np.concatenate(chosen))


def _shares(sizes: IntArray, count: int, rng: np.random.Generator) -> IntArray:
    """How many of each press, in proportion to its size; what rounding leaves over goes to presses drawn at random."""
    exact = sizes * (count / sizes.sum())
    shares: IntArray = np.floor(exact).astype(np.int64)
    order = rng.permutation(len(sizes))
    left = count - int(shares.sum())
    open_ones = order[shares[order] < sizes[order]][:left]
    shares[open_ones] += 1
    return shares
