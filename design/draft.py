"""A design as it is given, and what is resolved from it; the rules compare the one with the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from optopad.design.circuit.circuit import Circuit
from optopad.design.fields.quantity import Quantity
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.once import once
from optopad.design.parts.catalog import CatalogEntries, Elastomer
from optopad.design.shape.cavity import CavityGeometry, Plan, cavity_of, plan_of, workspace_of
from optopad.design.shape.outline import Outline
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import Placement, expand
from optopad.design.spec.properties import (
    SkinUse,
    absorption_db_per_cm,
    elastomer_of,
    entries_of,
    modulus,
    refractive_index,
    skin_of,
    wall_index,
)


@dataclass(frozen=True)
class Draft:
    """A design that may break rules.

    Each part is resolved when it is first asked for. DesignError means that the design is too wrong to have it, as with
    a name that is not in the catalogue.
    """

    design: SensorDesign

    @classmethod
    def of(cls, design: SensorDesign) -> Draft:
        """The draft of a design, which all that ask for it share."""
        return _draft_of(design)

    @cached_property
    def entries(self) -> CatalogEntries:
        """The packaged catalogue with the design's own entries."""
        return entries_of(self.design)

    @cached_property
    def elastomer(self) -> Elastomer:
        """Catalogue entry of the clear elastomer."""
        return elastomer_of(self.design)

    @cached_property
    def modulus(self) -> Quantity:
        """Young's modulus of the elastomer [MPa]."""
        return modulus(self.design)

    @cached_property
    def refractive_index(self) -> Quantity:
        """Refractive index of the clear elastomer for the default emitter's light [-]."""
        return refractive_index(self.design)

    @cached_property
    def absorption_db_per_cm(self) -> Quantity:
        """Absorption coefficient of the clear elastomer [dB/cm]."""
        return absorption_db_per_cm(self.design)

    @cached_property
    def wall_index(self) -> Quantity | None:
        """Refractive index of the material behind smooth walls [-]; None for walls that reflect diffusely."""
        return wall_index(self.design)

    @cached_property
    def skin(self) -> SkinUse | None:
        """The skin on the top; None for a bare one."""
        return skin_of(self.design)

    @cached_property
    def places(self) -> tuple[Placement, ...]:
        """Positions of the layout, in order."""
        return expand(self.design.layout, self.design.cavity)

    @cached_property
    def plan(self) -> Plan:
        """Outline and top of the pad, without the facets of parts in round walls."""
        return plan_of(self.design)

    @cached_property
    def workspace(self) -> Outline:
        """Area of the permitted press locations."""
        return workspace_of(self.design)

    @cached_property
    def cavity(self) -> CavityGeometry:
        """The cavity with the placed parts."""
        return cavity_of(self.design)

    @property
    def is_plain_block(self) -> bool:
        """Whether the pad is a flat rectangle with a bare top and parts in its walls, so that images give its light."""
        return self.plan.is_block and self.design.top is None and not self.cavity.on_floor

    @cached_property
    def outline(self) -> MoldOutline:
        """Dimensions of the mold."""
        return outline_of(self.design)

    @cached_property
    def circuit(self) -> Circuit:
        """The electronics."""
        return Circuit.of(self.design)


_draft_of = once(Draft)
