"""The specification of a sensor: all fields in which designs can differ.

The package imports only `optopad.design.parts`, `optopad.design.fields` and modules directly in `design`.
"""

from optopad.design.spec.indenter import Indenter
from optopad.design.spec.pad import Cavity, Covering, Crown
from optopad.design.spec.sensor import (
    SCHEMA_VERSION,
    BoardUse,
    Elastomer,
    Emitters,
    Gain,
    Mold,
    Operating,
    Receivers,
    SensorDesign,
    Surfaces,
    Viscoelastic,
    canonical_json,
)

__all__ = [
    "SCHEMA_VERSION",
    "BoardUse",
    "Cavity",
    "Covering",
    "Crown",
    "Elastomer",
    "Emitters",
    "Gain",
    "Indenter",
    "Mold",
    "Operating",
    "Receivers",
    "SensorDesign",
    "Surfaces",
    "Viscoelastic",
    "canonical_json",
]
