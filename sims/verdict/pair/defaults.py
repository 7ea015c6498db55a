"""The numbers that a verdict depends on, in one place; every function takes them as keywords.

Sources
-------
[P] P. Piacenza et al., "Accurate contact localization and indentation depth prediction with an
    optics-based tactile sensor", ICRA 2017: two modes, and the deadband between them, as words.
[F] A feasibility study of one emitter and one receiver 20 mm apart under clear layers of 6 to 12 mm,
    which turned the words into the definitions used here. Confidence: chosen, then varied. Mode
    boundaries move by at most 0.28 mm for mode tolerances of 2 to 10 %; the same thicknesses have
    deadbands for a relative noise of 0.001 to 0.01.
[S] Rounding to whole counts has the variance of a uniform error one count wide, 1/12 (Bennett 1948).
[T] L. H. C. Tippett, Biometrika 17 (1925): the range of 30 independent normal errors is on average
    4.09 standard errors; 30 is more samples than a deadband of 2.5 mm has at steps of 0.1 mm.
"""

from __future__ import annotations

from typing import Final

QUANTISATION_VARIANCE: Final = 1.0 / 12.0
"""Variance of rounding to whole counts [counts squared]; [S]."""

READ_NOISE_COUNTS: Final = 0.5
"""Standard deviation of one reading in the dark, without rounding [counts]; [F], assumed."""

RELATIVE_NOISE: Final = 0.003
"""Standard deviation of the light over its mean [-]; [F], assumed."""

DEADBAND_THRESHOLD: Final = 3.0
"""A signal that varies by less than this many noise units is flat [-]; [F]."""

DEADBAND_MIN_LENGTH_MM: Final = 0.3
"""A flat interval shorter than this is not a deadband [mm]; [F]."""

EVENNESS_WINDOW_MM: Final = 0.5
"""Length of the depth window whose signal range evenness compares [mm]; [F]."""

MODE_TOLERANCE: Final = 0.05
"""How near to its first and last value the light counts as being there, as a share [-]; [F]."""

TRACE_ERROR_LIMIT: Final = 0.5
"""Largest Monte-Carlo standard error that a verdict takes without a warning [noise units]; chosen so
that the range it adds over a typical deadband, 4.09 times itself, stays below the threshold of 3."""

TRACE_ERROR_SPREAD: Final = 4.09
"""Range that independent errors add over a deadband, in standard errors [-]; [T]."""
