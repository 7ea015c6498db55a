"""Keeps what was resolved from the last designs, so that each is resolved once."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Generic, TypeVar

Design = TypeVar("Design")
Resolved = TypeVar("Resolved")
KEPT = 128
"""Number of designs whose results are kept: more than the variants of a design that one score judges."""


class _Same(Generic[Design]):
    """A design, compared by identity, which costs no time."""

    def __init__(self, design: Design) -> None:
        self.design = design

    def __hash__(self) -> int:
        return id(self.design)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.design is other.design


def once(resolve: Callable[[Design], Resolved]) -> Callable[[Design], Resolved]:
    """Decorate a function of a design whose result never changes: it is called once for each design."""

    @lru_cache(KEPT)
    def kept(one: _Same[Design]) -> Resolved:
        return resolve(one.design)

    @wraps(resolve)
    def resolved(design: Design) -> Resolved:
        return kept(_Same(design))

    return resolved
