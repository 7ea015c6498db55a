"""What circuit and sheets assume beyond the design and its catalogue, with unit, source and confidence."""

from __future__ import annotations

from design.fields.packaged import data_quantities
from design.fields.quantity import Quantity


def assumption(name: str) -> Quantity:
    """A named value of `design/data/assumptions.toml`."""
    return data_quantities("assumptions.toml")[name]
