"""Score of a design: verdict, accuracy bounds and tolerance together, sweeps of one field, figures for a search.

This package imports `sims.bounds`, `sims.verdict` and the packages that these import.
"""

from sims.score.result import ContinuityScore
from sims.score.scoring import score

__all__ = ["ContinuityScore", "score"]
