"""The error of a Monte-Carlo light trace, and what it can do to a verdict.

The noise of a reading is modelled (`noise_units`); the error of the simulation that predicts the
mean reading is not noise of the sensor, and must never pass for information. Jitter between depths
widens the range of a flat signal, so it *hides* deadbands; on a slope just steep enough it can also
make one up. Errors of neighbouring depths share random numbers and are correlated to an unknown degree,
so they cannot be subtracted in quadrature. What is given instead:

- the noise margin: the largest standard error within an interval, in noise units. Up to one half, the
  range that errors add to a constant stays on average below the deadband threshold; above, a verdict
  carries a warning;
- possible deadbands: those found when the threshold is raised by 4.09 times the margin, the mean range
  of 30 independent errors (Tippett 1925). Correlation lowers that range. It is a band of doubt,
  not a confidence limit, and it leaves out bias of the trace.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError
from sims.verdict.pair.defaults import (
    DEADBAND_THRESHOLD,
    READ_NOISE_COUNTS,
    RELATIVE_NOISE,
    TRACE_ERROR_LIMIT,
    TRACE_ERROR_SPREAD,
)
from sims.verdict.pair.depth_curve import between, require_depths_mm, require_samples
from sims.verdict.pair.noise_units import sigma_counts
from sims.verdict.pair.window_range import Interval


def samples_between(depth_mm: FloatArray, start_mm: float, end_mm: float) -> slice:
    """The samples that straight lines between two depths rest on, those at or just outside the ends included."""
    first = int(np.searchsorted(depth_mm, start_mm, side="right")) - 1
    return slice(max(first, 0), int(np.searchsorted(depth_mm, end_mm, side="left")) + 1)


def noise_margin(
    depth_mm: ArrayLike,
    counts: ArrayLike,
    standard_error_counts: ArrayLike,
    *,
    within_mm: Interval | None = None,
    read_noise_counts: float = READ_NOISE_COUNTS,
    relative_noise: float = RELATIVE_NOISE,
) -> float:
    """Largest standard error of the trace within an interval of depth.

    Parameters
    ----------
    depth_mm : (n,) depths of the press [mm]; the first 0, increasing
    counts : (n,) or (n, pair) mean readings [counts]
    standard_error_counts : same shape, standard error of these means from the trace [counts]
    within_mm : interval (from, to) that is looked at, its ends included [mm]; None is all depths
    read_noise_counts, relative_noise : noise of one reading [counts], [-]

    Returns
    -------
    standard error [noise units]; the largest over depths, and over pairs where there are several
    """
    depth = require_depths_mm(depth_mm)
    readings = require_samples("counts", counts, depth, axes=2 if np.ndim(counts) == 2 else 1)
    error = require_samples("standard_error_counts", standard_error_counts, depth, axes=readings.ndim)
    if np.any(error < 0.0) or error.shape != readings.shape:
        raise InputError(
            f"standard_error_counts: shape {error.shape}, smallest {error.min()}, "
            f"needs shape {readings.shape} and no negative value; "
            "pass the trace's own standard error times the gain"
        )
    units = error / sigma_counts(readings, read_noise_counts, relative_noise)
    if within_mm is None:
        return float(units.max())
    return float(between(depth, units, *within_mm)[1].max())


def widened_threshold(
    margin: float, *, threshold: float = DEADBAND_THRESHOLD, spread: float = TRACE_ERROR_SPREAD
) -> float:
    """Deadband threshold that also takes in the range which trace errors may add.

    Parameters
    ----------
    margin : largest standard error of the trace [noise units]
    threshold : deadband threshold of an exact trace [noise units]
    spread : range of the errors over an interval, in standard errors [-]

    Returns
    -------
    threshold [noise units]
    """
    return threshold + spread * margin


def trace_noise_warning(
    margin: float, *, hidden_mm: float = 0.0, limit: float = TRACE_ERROR_LIMIT
) -> str | None:
    """What to tell the reader of a verdict about the error of its light trace.

    Parameters
    ----------
    margin : largest standard error of the trace over the judged depth [noise units]
    hidden_mm : length of possible deadband beyond the deadband found [mm]
    limit : margin up to which nothing is said [noise units]

    Returns
    -------
    one sentence with the value, the limit and the way out; None when the trace is fine enough
    """
    if margin <= limit:
        return None
    hidden = f" and may hide up to {hidden_mm:.2f} mm of deadband" if hidden_mm > 0.0 else ""
    return (
        f"light trace: standard error up to {margin:.2g} noise units, limit {limit:.2g}; "
        f"its jitter can pass for signal{hidden}; run with --fine"
    )
