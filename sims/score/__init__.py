"""The score of a design: verdict, bounds and tolerance together, one field varied, the aims of a search.

Imports of ours: bounds, verdict and below.
"""

from sims.score.result import ContinuityScore
from sims.score.scoring import score

__all__ = ["ContinuityScore", "score"]
