"""The score of a design: verdict, bounds and tolerance together, sweeps of one field, the figures of a search.

This package imports `optopad.sims.bounds`, `optopad.sims.verdict` and the packages that these import.
"""

from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import score

__all__ = ["ContinuityScore", "score"]
