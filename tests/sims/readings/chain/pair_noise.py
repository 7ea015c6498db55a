"""The noise of a pair by a formula, for comparison with drawn readings."""

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.recordings import lit_emitters, nearest_dark_states
from optopad.sims.readings.signal_chain import SignalChain


def pair_sigma_counts(chain: SignalChain, signal: FloatArray) -> FloatArray:
    """Standard deviation of pairs' signals (..., emitter, receiver) from frame to frame [counts].

    It includes noise and rounding of the pair's reading and of its dark readings, the rounding of the mean of two dark
    readings to whole counts (variance 1/8), shot noise, and the emitter's fluctuation, but no drift and no flicker.
    """
    rounding, of_mean = (1.0 / 12.0, 1.0 / 8.0) if chain.noise.quantised else (0.0, 0.0)
    each = chain.noise.read_noise_counts**2 + rounding
    earlier, later = nearest_dark_states(lit_emitters(len(chain.gains), chain.dark)).T[..., None]
    dark = np.where(earlier == later, each, each / 2.0 + of_mean)
    shot = chain.shot_variance_per_count * np.maximum(signal, 0.0)
    return np.sqrt(each + dark + shot + (chain.noise.led_fluctuation * signal) ** 2)
