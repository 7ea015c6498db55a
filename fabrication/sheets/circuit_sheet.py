"""The build sheet's section on the emitters' switches: resistors, currents, what the supply gives."""

from __future__ import annotations

from collections.abc import Iterator

from design.circuit.emitter_switch import emitter_switch
from design.circuit.pins import board_of
from design.circuit.supply_current import supply_current
from design.parts.assumptions import assumption
from design.parts.standard_values import ohm_text
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from fabrication.sheets.formats.table import number


def circuit_lines(design: SensorDesign) -> Iterator[str]:
    """The section's lines."""
    kinds = {one.part_id: one.part for one in cavity_of(design).emitters}
    board, current = board_of(design), supply_current(design)
    yield "## Wire the emitters"
    yield ""
    yield "One NPN transistor each, as `schematic.svg` draws it."
    yield ""
    yield "| emitter | series resistor | base resistor | through the emitter mA | out of the pin mA |"
    yield "|---|---|---|---|---|"
    for part_id, part in kinds.items():
        switch = emitter_switch(part)
        series = "none fits: a higher supply" if switch.series_ohm is None else ohm_text(switch.series_ohm)
        pin = f"{switch.base_current_ma:.1f}" + (" TOO MUCH" if switch.overloads_pin(board) else "")
        lit = f"{switch.usual_current_ma:.1f} usual, {switch.current_ma:.1f} at most"
        yield f"| {part_id} | {series} | {ohm_text(switch.base_ohm)} | {lit} | {pin} |"
    yield ""
    supply = number(assumption("supply_v").value)
    yield f"The supply, {supply}* V, gives {current.full_power_ma:.0f}* mA at full power: one emitter"
    yield f"lit with its base current ({current.emitter_ma:.0f}), the amplifiers ({current.amplifiers_ma:.0f}*) and the"
    yield f"board ({current.board_ma:.0f}*). With all emitters lit by a fault it would be {current.fault_ma:.0f}*."
    yield ""
