"""The score of a design: verdict, bounds and tolerance together, one field varied, the aims of a search.

Imports of ours: bounds, verdict and below.
"""

from sims.continuity.result import ContinuityScore
from sims.continuity.scoring import score

__all__ = ["ContinuityScore", "score"]
