"""How much silicone a pad takes: base and curing agent of each layer, by weight.

Model: volume of the layer (area in plan x thickness, less what a crown takes) times density, plus a share that stays
in the cup. Base and agent follow from the mixing ratio. Left out: the parts' bodies and the gaps around
them, which the share covers; carbon black's own volume.
"""

from __future__ import annotations

from dataclasses import dataclass

from design.parts.assumptions import assumption
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from design.spec.properties import elastomer_of

MM3_PER_CM3 = 1e3


@dataclass(frozen=True, kw_only=True)
class Pour:
    """One layer's silicone.

    Attributes
    ----------
    layer : "black" or "clear"
    thickness_mm : of the layer, at its highest place
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
    plan = cavity.plan
    black, clear = plan.area_mm2 * cavity.black_mm, plan.clear_volume_mm3
    layers = (("black", cavity.black_mm, black), ("clear", cavity.clear_mm, clear))
    if not plan.top.is_flat:  # cast upside down
        layers = layers[::-1]
    return tuple(_pour(design, *layer) for layer in layers if layer[1] > 0)


def _pour(design: SensorDesign, layer: str, thickness_mm: float, volume_mm3: float) -> Pour:
    volume_cm3 = volume_mm3 / MM3_PER_CM3
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
