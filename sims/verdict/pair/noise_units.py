"""Counts on a scale where equal steps are equal numbers of standard deviations.

Model: one reading of c counts has the variance σ² = σ0² + (ρ c)², σ0² = 1/12 + read noise². The first
part is rounding and electronics, the second is light that fluctuates in proportion to itself. The
noise unit u is the variance-stabilising scale of that model, du = dc / σ(c), which integrates to
u = asinh(ρ c / σ0) / ρ, and to u = c / σ0 when ρ is zero.

Left out: shot noise (its variance grows with c, not c²), drift between recordings, ambient light, and
noise that is correlated between readings. A step of one unit is one standard deviation of one
reading; the difference of two readings is √2 times as noisy.

Source: Bartlett, "The use of transformations", Biometrics 3 (1947); default figures in `defaults`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from design.arrays import FloatArray
from design.errors import InputError
from design.spec import SensorDesign
from sims.verdict.pair.defaults import QUANTISATION_VARIANCE, READ_NOISE_COUNTS, RELATIVE_NOISE

_SERIES_BELOW = 1e-8  # there asinh(x)/x and sinh(x)/x differ from 1 by x²/6 < 2e-17, less than rounding


def _zero_signal_sigma_counts(read_noise_counts: float, relative_noise: float) -> float:
    for name, value in (("read_noise_counts", read_noise_counts), ("relative_noise", relative_noise)):
        if not (np.isfinite(value) and value >= 0.0):
            raise InputError(f"{name}: {value}, needs a finite number >= 0; give the noise of one reading")
    return float(np.sqrt(QUANTISATION_VARIANCE + read_noise_counts**2))


def sigma_counts(
    counts: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Standard deviation of one reading.

    Parameters
    ----------
    counts : (...) mean reading [counts]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light over its mean [-]

    Returns
    -------
    (...) standard deviation [counts]
    """
    sigma0 = _zero_signal_sigma_counts(read_noise_counts, relative_noise)
    return np.hypot(sigma0, relative_noise * np.asarray(counts, dtype=np.float64))


def noise_units(
    counts: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Counts in noise units, u = asinh(ρ c / σ0) / ρ.

    Parameters
    ----------
    counts : (...) mean reading [counts]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light over its mean [-]; zero gives u = c / σ0

    Returns
    -------
    (...) reading [noise units]; odd and increasing in counts
    """
    linear = np.asarray(counts, dtype=np.float64) / _zero_signal_sigma_counts(
        read_noise_counts, relative_noise
    )
    return linear * _ratio_to_argument(np.arcsinh, relative_noise * linear)


def counts_of_noise_units(
    units: ArrayLike, read_noise_counts: float = READ_NOISE_COUNTS, relative_noise: float = RELATIVE_NOISE
) -> FloatArray:
    """Counts of a reading given in noise units, c = σ0 sinh(ρ u) / ρ: the inverse of `noise_units`.

    Parameters
    ----------
    units : (...) reading [noise units]
    read_noise_counts : standard deviation in the dark, without rounding [counts]
    relative_noise : standard deviation of the light over its mean [-]; zero gives c = σ0 u

    Returns
    -------
    (...) reading [counts]
    """
    u = np.asarray(units, dtype=np.float64)
    sigma0 = _zero_signal_sigma_counts(read_noise_counts, relative_noise)
    return sigma0 * u * _ratio_to_argument(np.sinh, relative_noise * u)


def _ratio_to_argument(function: np.ufunc, x: FloatArray) -> FloatArray:
    """function(x) / x for asinh or sinh, with its limit 1 where x is too small to matter."""
    small = np.abs(x) < _SERIES_BELOW
    safe = np.where(small, 1.0, x)
    ratio: FloatArray = np.where(small, 1.0, function(safe) / safe)
    return ratio


def noise_of(design: SensorDesign) -> dict[str, float]:
    """The design's noise model, as keywords of the verdict's functions."""
    return {
        "read_noise_counts": design.noise.read_noise_counts,
        "relative_noise": design.noise.relative_noise,
    }
