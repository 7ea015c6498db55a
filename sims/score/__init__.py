"""The score of a design: verdict, bounds and tolerance together, sweeps of one field, the figures of a search.

This package imports `sims.bounds`, `sims.verdict` and the packages that these import.
"""

from sims.score.result import ContinuityScore
from sims.score.scoring import score

__all__ = ["ContinuityScore", "score"]
