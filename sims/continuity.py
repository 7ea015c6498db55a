"""Alias of `sims.score` under its former name, for one release."""

from sims.score import ContinuityScore, score

__all__ = ["ContinuityScore", "score"]
