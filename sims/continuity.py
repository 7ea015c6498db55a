"""Alias of `optopad.sims.score` under its former name, for one release."""

from optopad.sims.score import ContinuityScore, score

__all__ = ["ContinuityScore", "score"]
