"""Keeps what was resolved from the last designs, so that each is resolved once."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign

Resolved = TypeVar("Resolved")
KEPT = 32
"""Number of designs whose results are kept."""


class _Same:
    """A design, compared by identity, which costs no time."""

    def __init__(self, design: SensorDesign) -> None:
        self.design = design

    def __hash__(self) -> int:
        return id(self.design)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.design is other.design


def once(resolve: Callable[[SensorDesign], Resolved]) -> Callable[[SensorDesign], Resolved]:
    """Decorate a function of a design whose result never changes: it is called once for each design."""

    @lru_cache(KEPT)
    def kept(one: _Same) -> Resolved:
        return resolve(one.design)

    @wraps(resolve)
    def resolved(design: SensorDesign) -> Resolved:
        return kept(_Same(design))

    return resolved
