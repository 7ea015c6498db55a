"""The score of a design: verdict, bounds and tolerance together, sweeps of one field, the figures of a search.

It imports bounds, verdict and the rooms below them.
"""

from sims.score.result import ContinuityScore
from sims.score.scoring import score

__all__ = ["ContinuityScore", "score"]
