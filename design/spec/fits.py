"""Fit classes: the clearance that the mold leaves around a body, and its grip on a wire."""

from __future__ import annotations

from design.fields.packaged import data_quantities
from design.fields.quantity import Quantity
from design.spec import Mold


def fit(name: str) -> Quantity:
    """A named length of `design/data/fits.toml` [mm]."""
    return data_quantities("fits.toml")[name]


def clearance_mm(mold: Mold, part_id: str) -> float:
    """Gap at each side of a part's body: by its fit class, or `part_clearance_mm` for a part without one [mm]."""
    named = mold.fits.get(part_id)
    return mold.part_clearance_mm if named is None else fit(named).value


def fit_name(mold: Mold, part_id: str) -> str:
    """The fit of a part in words."""
    return mold.fits.get(part_id, "own clearance")
