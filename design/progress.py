"""How long work tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

OnStep = Callable[[str, float], None]
"""Takes the stage and the share of it that is done, 0 to 1."""
OnShare = Callable[[float], None]
"""Takes the share that is done, 0 to 1."""


def silent(_stage: str, _share: float) -> None:
    """An `OnStep` that reports nothing."""
