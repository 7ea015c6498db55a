"""How much silicone a pad needs: base and curing agent of each cast layer, by weight.

The weight of a layer is volume times density, plus a share that remains in the cup. The volume is area in plan times
thickness, less the volume that a convex top removes. The curing agent is rounded up to a step of the scale, and is at
least as much as the scale weighs with an error of `MOST_WEIGHING_ERROR`; base and agent are in the mixing ratio. All
sheets take the weights from here, so that they agree.

The volume of bodies on the floor is subtracted. The computation neglects the volumes of bodies in walls, of the gaps
around them, and of carbon black.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from optopad.design.parts.assumptions import assumption
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import elastomer_of

MM3_PER_CM3 = 1e3
MOST_WEIGHING_ERROR = 0.05
"""Largest accepted relative error of the mixing ratio due to the scale's resolution [-]."""


@dataclass(frozen=True, kw_only=True)
class Pour:
    """Weights of silicone for one cast layer of the pad.

    Attributes
    ----------
    layer : "black" or "clear"
    thickness_mm : thickness of the layer at its highest point
    net_g : weight of the layer in the pad [g]
    used_g : weight to use, including what remains in the cup and in gaps [g]
    mixed_g : weight to mix, which is at least `used_g` [g]
    base_g, agent_g : weights of base and curing agent, whose sum is `mixed_g` [g]
    carbon_g : weight of carbon black, an assumed fraction of the mixed weight [g]; 0 in the clear layer
    """

    layer: str
    thickness_mm: float
    net_g: float
    used_g: float
    mixed_g: float
    base_g: float
    agent_g: float
    carbon_g: float

    @property
    def is_larger_batch(self) -> bool:
        """Whether more is mixed than used because a scale could not weigh so little curing agent."""
        return self.agent_g <= _least_agent_g() * (1 + 1e-9)


def pours(design: SensorDesign) -> tuple[Pour, ...]:
    """Weights of silicone for each layer, in the order of casting; a black layer of thickness 0 is left out."""
    cavity = cavity_of(design)
    black, clear = cavity.layers_mm3
    layers = (("black", cavity.black_mm, black), ("clear", cavity.clear_mm, clear))
    if not (cavity.plan.top.is_flat or design.is_on_board):  # cast upside down
        layers = layers[::-1]
    density, ratio = elastomer_of(design).density_g_per_cm3.value, design.elastomer.mixing_ratio
    return tuple(_pour(density, ratio, *layer) for layer in layers if layer[1] > 0)


def silicone_g(layers: Sequence[Pour]) -> float:
    """Weight of silicone to mix for all layers [g]."""
    return sum(pour.mixed_g for pour in layers)


def _least_agent_g() -> float:
    return assumption("scale_step").value / MOST_WEIGHING_ERROR


def _pour(density: float, ratio: float, layer: str, thickness_mm: float, volume_mm3: float) -> Pour:
    step_g = assumption("scale_step").value
    net = volume_mm3 / MM3_PER_CM3 * density
    used = net * (1 + assumption("silicone_waste").value)
    agent = max(math.ceil(used / (ratio + 1) / step_g - 1e-9) * step_g, _least_agent_g())
    mixed = agent * (ratio + 1)
    return Pour(
        layer=layer,
        thickness_mm=thickness_mm,
        net_g=net,
        used_g=used,
        mixed_g=mixed,
        base_g=agent * ratio,
        agent_g=agent,
        carbon_g=mixed * assumption("carbon_black_share").value if layer == "black" else 0.0,
    )
