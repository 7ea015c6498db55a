"""What the supply has to give: the lit emitter and its base, the amplifiers, the board.

One emitter is lit at a time, at full power; with all of them lit by a fault the supply sees their sum. Emitters at
the largest current that their resistors let through; the rest is assumed (`design/data/assumptions.toml`).
"""

from __future__ import annotations

from dataclasses import dataclass

from design.circuit.emitter_switch import emitter_switch
from design.parts.assumptions import assumption
from design.shape.cavity import cavity_of
from design.spec import SensorDesign


@dataclass(frozen=True, kw_only=True)
class SupplyCurrent:
    """Currents of the supply [mA].

    Attributes
    ----------
    emitter_ma : the emitter that takes most, with the base current of its transistor
    all_emitters_ma : all of them at once, which the firmware never does
    amplifiers_ma, board_ma : assumed
    """

    emitter_ma: float
    all_emitters_ma: float
    amplifiers_ma: float
    board_ma: float

    @property
    def full_power_ma(self) -> float:
        """While the sensor runs: one emitter lit [mA]."""
        return self.emitter_ma + self.amplifiers_ma + self.board_ma

    @property
    def fault_ma(self) -> float:
        """With every emitter lit [mA]."""
        return self.all_emitters_ma + self.amplifiers_ma + self.board_ma


def supply_current(design: SensorDesign) -> SupplyCurrent:
    """The currents of a design."""
    cavity = cavity_of(design)
    switches = [emitter_switch(one.part) for one in cavity.emitters]
    each = [switch.current_ma + switch.base_current_ma for switch in switches]
    return SupplyCurrent(
        emitter_ma=max(each, default=0.0),
        all_emitters_ma=sum(each),
        amplifiers_ma=assumption("amplifier_supply_ma").value * len(cavity.receivers),
        board_ma=assumption("board_supply_ma").value,
    )
