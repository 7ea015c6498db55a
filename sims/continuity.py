"""The former name of `sims.score`, kept for one release."""

from sims.score import ContinuityScore, score

__all__ = ["ContinuityScore", "score"]
