"""Callbacks that report the progress of long computations."""

from __future__ import annotations

from collections.abc import Callable

OnStep = Callable[[str, float], None]
"""Progress callback that takes the name of the stage and its completed share, 0 to 1."""
OnShare = Callable[[float], None]
"""Progress callback that takes the completed share, 0 to 1."""


def silent(_stage: str, _share: float) -> None:
    """An `OnStep` that reports nothing."""
