"""How much silicone a pad takes: base and curing agent of each layer, by weight.

Model: volume of the layer (inner length x width x thickness) times density, plus a share that stays in
the cup. Base and agent follow from the mixing ratio. Left out: the parts' bodies and the gaps around
them, which the share covers; carbon black's own volume.
"""

from __future__ import annotations

from dataclasses import dataclass

from design.geometry.cavity import cavity_of
from design.parts.assumptions import assumption
from design.spec import SensorDesign
from design.spec.properties import elastomer_of

MM3_PER_CM3 = 1e3


@dataclass(frozen=True, kw_only=True)
class Pour:
    """One layer's silicone.

    Attributes
    ----------
    layer : "black" or "clear"
    thickness_mm : of the layer
    net_g : what the layer weighs
    mixed_g : what to mix, waste included
    base_g, agent_g : the two components of what to mix
    carbon_g : carbon black to stir in, by the assumed share; 0 in the clear layer
    """

    layer: str
    thickness_mm: float
    net_g: float
    mixed_g: float
    base_g: float
    agent_g: float
    carbon_g: float


def pours(design: SensorDesign) -> tuple[Pour, ...]:
    """The layers in the order in which they are cast; no black one where its thickness is 0."""
    cavity = cavity_of(design)
    layers = (("black", cavity.black_mm), ("clear", cavity.clear_mm))
    return tuple(_pour(design, layer, thickness) for layer, thickness in layers if thickness > 0)


def _pour(design: SensorDesign, layer: str, thickness_mm: float) -> Pour:
    size = design.cavity
    volume_cm3 = size.length_mm * size.width_mm * thickness_mm / MM3_PER_CM3
    net = volume_cm3 * elastomer_of(design).density_g_per_cm3.value
    mixed = net * (1 + assumption("silicone_waste").value)
    parts = design.elastomer.mixing_ratio + 1
    return Pour(
        layer=layer,
        thickness_mm=thickness_mm,
        net_g=net,
        mixed_g=mixed,
        base_g=mixed * design.elastomer.mixing_ratio / parts,
        agent_g=mixed / parts,
        carbon_g=mixed * assumption("carbon_black_share").value if layer == "black" else 0.0,
    )
