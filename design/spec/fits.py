"""Fit classes: the clearance that the mold leaves around a part's body, and the neck that grips a wire."""

from __future__ import annotations

from optopad.design.fields.packaged import data_quantities
from optopad.design.fields.quantity import Quantity
from optopad.design.spec import Mold


def fit(name: str) -> Quantity:
    """A length [mm] from the file `design/data/fits.toml`, by its name."""
    return data_quantities("fits.toml")[name]


def clearance_mm(mold: Mold, part_id: str) -> float:
    """Gap on each side of a part's body [mm]: from its fit class, or else the mold's `part_clearance_mm`."""
    named = mold.fits.get(part_id)
    return mold.part_clearance_mm if named is None else fit(named).value


def fit_name(mold: Mold, part_id: str) -> str:
    """Name of a part's fit class; "own clearance" for a part without a fit class."""
    return mold.fits.get(part_id, "own clearance")
