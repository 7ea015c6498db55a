"""The specification of a sensor: all fields in which designs can differ.

The package imports only `design.parts`, `design.fields` and modules directly in `design`.
"""

from design.spec.indenter import Indenter
from design.spec.pad import Cavity, Crown
from design.spec.sensor import (
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
