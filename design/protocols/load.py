"""How a tip is driven while its load is read: steps to a depth and back, with pauses.

Values with their sources are data (`data/load_protocols.toml`). What load belongs to a protocol is the
contact model's business.
"""

from __future__ import annotations

from functools import cache
from typing import Self

from pydantic import model_validator

from design.errors import InputError
from design.fields.base import Model
from design.fields.packaged import data_table
from design.fields.paths import nearest
from design.fields.quantity import Quantity, Text


class LoadProtocol(Model):
    """Steps of one size at one speed to the deepest press and back, and a pause after each."""

    title: Text
    step_mm: Quantity
    deepest_mm: Quantity
    pause_s: Quantity
    speed_mm_per_s: Quantity

    @model_validator(mode="after")
    def _can_be_driven(self) -> Self:
        for name in ("step_mm", "speed_mm_per_s"):
            if not getattr(self, name).value > 0.0:
                raise ValueError(f"{name}: {getattr(self, name).value:g} must be above 0")
        if self.pause_s.value < 0.0:
            raise ValueError(f"pause_s: {self.pause_s.value:g} must be at least 0")
        count = self.deepest_mm.value / self.step_mm.value
        if round(count) < 1 or abs(count - round(count)) > 1e-9:
            raise ValueError(
                f"deepest_mm: {self.deepest_mm.value:g} must be a whole number of steps of {self.step_mm.value:g}"
            )
        return self

    @property
    def steps(self) -> int:
        """Steps from contact to the deepest press."""
        return round(self.deepest_mm.value / self.step_mm.value)


@cache
def _packaged() -> dict[str, LoadProtocol]:
    return {name: LoadProtocol.model_validate(row) for name, row in data_table("load_protocols.toml").items()}


def load_protocol(name: str) -> LoadProtocol:
    """A packaged protocol.

    Raises
    ------
    InputError : there is none of that name; the nearest, or all, are named
    """
    known = _packaged()
    if name not in known:
        near = nearest(name, tuple(known))
        hint = f"did you mean {near[0]}?" if near else f"there are: {', '.join(sorted(known))}"
        raise InputError(f"load protocol: {name!r} is not known; {hint}")
    return known[name]
