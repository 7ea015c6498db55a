"""What circuit and sheets assume beyond the design and its catalogue, with unit, source and confidence."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files

from design.fields.quantity import Quantity

FILE = "assumptions.toml"


def assumption(name: str) -> Quantity:
    """A named value of `design/data/assumptions.toml`."""
    return _assumptions()[name]


@cache
def _assumptions() -> dict[str, Quantity]:
    text = (files("design") / "data" / FILE).read_text(encoding="utf-8")
    return {name: Quantity(**row) for name, row in tomllib.loads(text).items()}
