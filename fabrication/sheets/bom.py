"""Bill of materials: items to buy, print and weigh for one sensor.

Reference designators extend the names of the layout: E3-Q is the transistor of emitter E3. A1 is the first package of
amplifiers. Part number, order unit and price of a bought item are from `design/data/orders.toml`; a price has currency,
date and source, and an unknown one is blank. Amplifier and transistor are chosen by the design's circuit. If the gain
is not known, neither is the amplifier, and the `value` of a feedback component is "set by gain".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from optopad.design.circuit.circuit import Chips, Circuit
from optopad.design.circuit.emitter_switch import (
    CurrentSink,
    EmitterSwitch,
    current_sink,
    emitter_switch,
    most_drive_ma,
    transistor_of,
)
from optopad.design.circuit.transimpedance import Feedback, settle_words
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import is_levelled, outline_of
from optopad.design.parts.assumptions import assumption, ohm_text
from optopad.design.parts.catalog import (
    Board,
    Converter,
    Cost,
    LedDriver,
    Part,
    find_amplifier,
    find_mold_material,
)
from optopad.design.parts.orders import order_of
from optopad.design.shape.cavity import PlacedPart, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import elastomer_of, entries_of
from optopad.fabrication.gain import SimulatedGain, feedbacks_for
from optopad.fabrication.sheets.silicone import MM3_PER_CM3, pours, silicone_g
from optopad.fabrication.sheets.template import csv_text, number

COLUMNS = (
    "item",
    "catalogue_id",
    "quantity",
    "unit",
    "references",
    "value",
    "manufacturer",
    "part_number",
    "order_quantity",
    "order_unit",
    "unit_cost",
    "currency",
    "cost_date",
    "cost_source",
    "note",
)

PULL_UP_OHM = 10e3
"""Resistor that keeps the outputs of LED drivers off until the program starts."""
WIRES_EACH = 2
"""Wires from each emitter and receiver to the circuit."""
USUAL_WIRE_MM = 0.8
"""Diameter of the wires over their insulation, if no part states one [mm]."""
BOARD_MM = 1.6
"""Usual thickness of a circuit board [mm]."""
THREADS_MM = (2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
"""Metric threads of the screws through the fixing holes (ISO 261)."""
SCREW_LENGTHS_MM = (6, 8, 10, 12, 16, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 80, 90, 100)
"""Standard lengths of hexagon socket screws (ISO 4762)."""
SET_BY_GAIN = "set by gain"
NO_PRICE = "no price known"
NOT_BOUGHT = "not bought"


@dataclass(frozen=True, kw_only=True)
class BomRow:
    """One item of the bill of materials.

    Attributes
    ----------
    quantity : number of pieces, or of other units named in `unit`; None if not known
    references : reference designators of the item, in the order of the layout
    part_number : maker's number to order; empty if the item is not bought, or has none
    is_number_read : whether the number was read in its source, and not inferred or recalled
    order_quantity, order_unit : number of order units that hold the quantity, such as 1 kit of 500 g
    cost : quoted cost of one order unit; None if not known
    is_bought : whether the item is bought; printed parts are not
    """

    item: str
    catalogue_id: str = ""
    quantity: float | None
    unit: str = "piece"
    references: tuple[str, ...] = ()
    value: str = ""
    manufacturer: str = ""
    part_number: str = ""
    is_number_read: bool = True
    order_quantity: int | None = None
    order_unit: str = "piece"
    cost: Cost | None = None
    is_bought: bool = True
    note: str = ""

    @property
    def price(self) -> float | None:
        """Price of all order units in the currency of the cost; None if one of them is not known."""
        if self.cost is None or self.order_quantity is None:
            return None
        return self.order_quantity * self.cost.value


def bom_rows(
    design: SensorDesign, gain: SimulatedGain | None = None, mold_mm3: float | None = None
) -> tuple[BomRow, ...]:
    """All items of the bill of materials for one sensor.

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are not given
    mold_mm3 : volume of the mold's solid; if None, the mold's weight is not given
    """
    circuit = Circuit.of(design)
    cavity, board = circuit.cavity, circuit.board
    return (
        *_coupler_rows(cavity.parts),
        *_part_rows([part for part in cavity.emitters if part.coupler is None]),
        *_part_rows([part for part in cavity.receivers if part.coupler is None]),
        _ordered(BomRow(item=board.title, catalogue_id=design.board.kind, quantity=1)),
        *_switch_rows(circuit),
        *_amplifier_rows(circuit, gain),
        *_circuit_rows(circuit),
        *(() if design.is_on_board else (_header_row(cavity.parts), *_wire_rows(cavity.parts))),
        *_silicone_rows(design),
        *_printed_rows(design, mold_mm3),
    )


def _ordered(row: BomRow, *keys: str, value: float | None = None, power_mw: float = 0.0) -> BomRow:
    """A row with what to order for it: by its catalogue entry, or by the kinds of part in `keys`, value and power."""
    found = order_of(keys or (row.catalogue_id,), value, power_mw)
    if found is None:
        return replace(row, order_quantity=None if row.quantity is None else math.ceil(row.quantity))
    order, number = found
    return replace(
        row,
        manufacturer=row.manufacturer or order.manufacturer,
        part_number=number,
        is_number_read=order.confidence in ("measured", "read"),
        order_quantity=None if row.quantity is None else order.units_for(row.quantity),
        order_unit=order.unit,
        cost=row.cost or order.cost,
    )


def bom_csv(rows: Sequence[BomRow]) -> str:
    """The bill of materials as CSV."""
    return csv_text(COLUMNS, (_cells(row) for row in rows))


def _cells(row: BomRow) -> tuple[str | float | None, ...]:
    cost = row.cost
    return (
        row.item,
        row.catalogue_id,
        row.quantity,
        row.unit,
        " ".join(row.references),
        row.value,
        row.manufacturer,
        row.part_number,
        row.order_quantity if row.is_bought else None,
        row.order_unit if row.is_bought else None,
        None if cost is None else cost.value,
        None if cost is None else cost.currency,
        None if cost is None else cost.date,
        cost.source if cost is not None else NO_PRICE if row.is_bought else NOT_BOUGHT,
        row.note,
    )


def _coupler_rows(parts: Sequence[PlacedPart]) -> Iterator[BomRow]:
    """Items for couplers: one package for an emitter and a receiver, which are two entries of the catalogue."""
    held: dict[str, list[PlacedPart]] = {}
    for part in parts:
        if part.coupler is not None:
            held.setdefault(part.coupler, []).append(part)
    kinds: dict[tuple[str, ...], list[str]] = {}
    for name, halves in held.items():
        kinds.setdefault(tuple(half.part_id for half in halves), []).append(name)
    for names in kinds.values():
        halves = held[names[0]]
        row = BomRow(
            item=f"coupler: {' and '.join(half.part.title for half in halves)}",
            catalogue_id=halves[0].part_id,
            quantity=len(names),
            references=tuple(names),
            manufacturer=halves[0].part.manufacturer,
            cost=halves[0].part.cost,
            note=" ".join(
                (
                    "; ".join(f"{name}: {' '.join(half.name for half in held[name])}" for name in names)
                    + ".",
                    *dict.fromkeys(note for half in halves for note in half.part.notes),
                )
            ),
        )
        yield _ordered(row)


def _part_rows(placed: Sequence[PlacedPart]) -> Iterator[BomRow]:
    for part, names in _by_entry(placed):
        entry = part.part
        row = BomRow(
            item=entry.title,
            catalogue_id=part.part_id,
            quantity=len(names),
            references=names,
            manufacturer=entry.manufacturer,
            cost=entry.cost,
            note=" ".join(entry.notes),
        )
        yield _ordered(row)


def _switch_rows(circuit: Circuit) -> Iterator[BomRow]:
    driver, sink = circuit.led_driver, current_sink(circuit)
    if driver is not None and sink is not None:
        yield from _driver_rows(driver, sink, circuit.emitter_chips[0].names)
        return
    board = circuit.board
    for part, names in _by_entry(circuit.cavity.emitters):
        switch, transistor = emitter_switch(part.part, board), transistor_of(circuit, part.part)
        row = BomRow(
            item=transistor.entry.title,
            catalogue_id=transistor.transistor_id,
            quantity=len(names),
            references=_marked(names, "Q"),
            value=f"{_most_ma(part.part)} mA of at most {number(transistor.entry.saturation_ma.value)} mA",
            note="one per LED: base to the base resistor, collector to the LED's cathode, its own emitter to ground",
        )
        yield _ordered(row)
        yield _resistor_row(
            "base resistor", "RB", names, switch.base_ohm, _base_note(switch, *most_drive_ma(circuit))
        )
        yield _resistor_row(
            "series resistor",
            "RS",
            names,
            switch.series_ohm,
            _series_note(switch, part.part, board),
            switch.series_mw,
        )


def _resistor_row(
    item: str, mark: str, names: Sequence[str], ohm: float | None, note: str, power_mw: float = 0.0
) -> BomRow:
    """A row of resistors of which each bears a power; above that of the orders, the note says so."""
    kinds = "resistor", "large-resistor"
    if ohm is not None and order_of(kinds, ohm, power_mw) is None and order_of(kinds, ohm) is not None:
        note += f"; NO PART NUMBER: choose a resistor for more than {power_mw:.0f} mW"
    row = BomRow(
        item=item,
        quantity=len(names),
        references=_marked(names, mark),
        value="none fits" if ohm is None else ohm_text(ohm),
        note=note,
    )
    return row if ohm is None else _ordered(row, *kinds, value=ohm, power_mw=power_mw)


def _driver_rows(driver: LedDriver, sink: CurrentSink, names: tuple[str, ...]) -> Iterator[BomRow]:
    """Items for LED drivers: their reference resistors, and a resistor that keeps outputs off until firmware starts."""
    formula = f"{driver.current_ratio:g} x {driver.reference_v:g} V / current"
    note = (
        f"IREF of each {driver.name} to ground: {sink.current_ma:.1f} mA at each output by {formula}; "
        f"{min(sink.asked_ma, driver.max_output_ma.value):g} mA allowed"
    )
    yield _resistor_row("reference resistor", "RI", names, sink.reference_ohm, note)
    off = "BLANK to the supply of the LED drivers: all outputs are off until the program starts"
    yield _resistor_row("pull-up resistor", "RP", names[:1], PULL_UP_OHM, off)


def _amplifier_rows(circuit: Circuit, gain: SimulatedGain | None) -> Iterator[BomRow]:
    names = tuple(part.name for part in circuit.cavity.receivers)
    feedbacks = feedbacks_for(circuit, gain)
    amplifier_id = circuit.use.amplifier if feedbacks is None else feedbacks[0].amplifier_id
    if amplifier_id is None:
        yield BomRow(
            item="transimpedance amplifier",
            quantity=len(names),
            references=_marked(names, "A"),
            value=f"single supply of {circuit.adc.supply_v:g} V; type {SET_BY_GAIN}",
            note="output to the receiver's channel; `optopad run` chooses the type",
        )
        yield _supply_capacitors(names, "ceramic, next to each amplifier's supply pins; one per package")
    else:
        yield from _package_rows(circuit, names, amplifier_id)
    if feedbacks is None:
        yield from _open_feedback_rows(circuit, names)
        return
    for ohm in dict.fromkeys(one.standard_ohm for one in feedbacks):
        same = [name for name, one in zip(names, feedbacks, strict=True) if one.standard_ohm == ohm]
        note = "depends on the emitters' power; see casting.md, last section"
        yield _resistor_row("feedback resistor", "RF", same, ohm, note)
    for capacitor_pf in dict.fromkeys(one.capacitor_pf for one in feedbacks):
        yield _capacitor_row(circuit, names, feedbacks, capacitor_pf)


def _package_rows(circuit: Circuit, names: tuple[str, ...], amplifier_id: str) -> Iterator[BomRow]:
    """Items for the amplifiers: their packages, with the receivers of each, and supply capacitors."""
    entry = find_amplifier(circuit.entries, amplifier_id)
    packages = tuple(f"A{number + 1}" for number in range(entry.needed(len(names))))
    served = (
        f"{package}: {' '.join(_marked(names[place * entry.channels :][: entry.channels], 'A'))}"
        for place, package in enumerate(packages)
    )
    row = BomRow(
        item=entry.title,
        catalogue_id=amplifier_id,
        quantity=len(packages),
        references=packages,
        value=f"single supply of {circuit.adc.supply_v:g} V",
        note=" ".join((f"{'; '.join(served)}; outputs to the receivers' channels.", *entry.notes)),
    )
    yield _ordered(row)
    yield _supply_capacitors(packages, "ceramic, next to the supply pins of each package")


def _capacitor_row(
    circuit: Circuit, names: Sequence[str], feedbacks: Sequence[Feedback], capacitor_pf: float
) -> BomRow:
    same = [
        (name, one) for name, one in zip(names, feedbacks, strict=True) if one.capacitor_pf == capacitor_pf
    ]
    in_time = all(one.is_in_time for _, one in same)
    late = "smallest stable value: TOO SLOW for board.settle_us, see casting.md"
    row = BomRow(
        item="feedback capacitor",
        quantity=len(same),
        references=_marked([name for name, _ in same], "CF"),
        value=f"{capacitor_pf:g} pF",
        note=f"settles within {settle_words(circuit)}" if in_time else late,
    )
    return _ordered(row, "tiny-capacitor", "small-capacitor", "capacitor", value=capacitor_pf)


def _open_feedback_rows(circuit: Circuit, names: Sequence[str]) -> Iterator[BomRow]:
    target = circuit.design.gain.target_counts
    rule = f"so that the median judged pair reads {target:g} counts untouched, and none clips"
    for item, mark, note in (
        ("feedback resistor", "RF", f"{rule}; see casting.md, last section"),
        ("feedback capacitor", "CF", f"with RF it must settle within {settle_words(circuit)}"),
    ):
        yield BomRow(
            item=item, quantity=len(names), references=_marked(names, mark), value=SET_BY_GAIN, note=note
        )


def _circuit_rows(circuit: Circuit) -> Iterator[BomRow]:
    for chips in circuit.chips:
        entry = chips.entry
        row = BomRow(
            item=entry.title,
            catalogue_id=chips.chip_id,
            quantity=chips.count,
            references=chips.names,
            value=_supply_words(circuit, chips),
            note=" ".join(entry.notes),
        )
        yield _ordered(row)
        yield _supply_capacitors(chips.names, "ceramic, next to the supply pins of each")
        if isinstance(entry, Converter) and entry.has_own_logic:
            logic = entry.family.pin_at("{level}")
            yield _small(
                "supply capacitor", "CD", "100 nF", chips.names, f"ceramic, {logic} to ground of each"
            )
        for item, mark, value, note, _ in entry.family.components:
            yield _small(item, mark, value, chips.names, note)


def _supply_words(circuit: Circuit, chips: Chips) -> str:
    entry, level_v = chips.entry, circuit.board.pin_v
    if not isinstance(entry, Converter):
        return f"supply {level_v:g} V"
    supply, full_scale = f"supply {level_v:g} V", f"full scale {circuit.adc.full_scale_v:g} V"
    if entry.has_own_logic:
        analog, logic = (entry.family.pin_at(net) for net in ("{analog}", "{level}"))
        supply = f"{analog} {circuit.adc.supply_v:g} V, {logic} {level_v:g} V"
    return f"{supply}, {full_scale}"


def _supply_capacitors(names: tuple[str, ...], note: str) -> BomRow:
    return _small("supply capacitor", "CS", "100 nF", names, note)


def _small(item: str, mark: str, value: str, names: tuple[str, ...], note: str) -> BomRow:
    row = BomRow(item=item, quantity=len(names), references=_marked(names, mark), value=value, note=note)
    return _ordered(row, item.replace(" ", "-"))


def _header_row(parts: Sequence[PlacedPart]) -> BomRow:
    """The connector between pad and circuit: a pin header with two positions for the wires of each part."""
    row = BomRow(
        item="pin header, 2.54 mm",
        quantity=WIRES_EACH * len(parts),
        unit="positions",
        note="connects the pad's wires to the circuit, two positions for each part; break the strips to length",
    )
    return _ordered(row, "pin-header")


def _wire_rows(parts: Sequence[PlacedPart]) -> Iterator[BomRow]:
    """Wires between pad and circuit, by their diameter [mm], which the neck of a surface part's slot pinches.

    A radial part has leads, to which the thickest of these wires is soldered.
    """
    held = {part.name: part.part.lead_diameter_mm.value for part in parts if part.part.mounting == "surface"}
    thickest, each_m = max(held.values(), default=USUAL_WIRE_MM), assumption("wire_m").value
    for size in dict.fromkeys(held.get(part.name, thickest) for part in parts):
        count = WIRES_EACH * sum(held.get(part.name, thickest) == size for part in parts)
        row = BomRow(
            item="hook-up wire",
            quantity=round(count * each_m, 2),
            unit="m",
            value=f"insulated copper, {size:g} mm over the insulation",
            note=f"{count} wires of {each_m:g} m (assumed) from the pad's parts to the circuit",
        )
        yield _ordered(row, "wire", "thin-wire", value=size)


def _silicone_rows(design: SensorDesign) -> Iterator[BomRow]:
    elastomer, layers = elastomer_of(design), pours(design)
    split = ", ".join(
        f"{pour.layer} layer {pour.base_g:.2f} g base and {pour.agent_g:.2f} g curing agent"
        for pour in layers
    )
    silicone = BomRow(
        item=elastomer.title,
        catalogue_id=design.elastomer.material,
        quantity=round(silicone_g(layers), 2),
        unit="g",
        value=f"{number(design.elastomer.mixing_ratio)} : 1 by weight",
        manufacturer=elastomer.manufacturer,
        note=f"{split}; includes {assumption('silicone_waste').value:.0%} waste (assumed)",
    )
    yield _ordered(silicone)
    if any(pour.layer == "black" for pour in layers):
        black = BomRow(
            item="carbon black",
            quantity=round(sum(pour.carbon_g for pour in layers), 2),
            unit="g",
            value=f"{assumption('carbon_black_share').value:.0%} by weight (assumed)",
            note="black layer only; the paper adds it to saturation and states no share by weight",
        )
        yield _ordered(black, "carbon-black")


def _printed_rows(design: SensorDesign, mold_mm3: float | None) -> Iterator[BomRow]:
    material = find_mold_material(entries_of(design), design.mold.material)
    note = "cad/" + ("mold.stl" if design.mold.pieces == "one" else "mold_frame.stl and cad/mold_base.stl")
    if mold_mm3 is not None:
        mold_g = mold_mm3 / MM3_PER_CM3 * material.density_g_per_cm3.value
        note += f"; {mold_g:.1f} g when printed solid"
    for name, files in [
        ("frame" if design.is_on_board else "mold", note),
        *((tool, f"cad/{file}.stl") for tool, file in _tools(design)),
    ]:
        yield BomRow(
            item=f"printed {name}",
            catalogue_id=design.mold.material,
            quantity=1,
            value=material.title,
            is_bought=False,
            note=files,
        )
    if design.mold.pieces == "frame_and_base":
        yield _screw_row(design, outline_of(design).height_mm, "hold frame and base together")
    if design.is_on_board and design.mold.fixing_hole_diameter_mm > 0:
        through_mm = outline_of(design).height_mm + BOARD_MM
        yield _screw_row(design, through_mm, "hold the frame on the circuit board")
    if design.mold.cover_ledge_mm:
        yield BomRow(
            item="glass cover",
            quantity=1,
            order_quantity=1,
            value="cut to the seat",
            note="size: see casting.md",
        )


def _screw_row(design: SensorDesign, height_mm: float, purpose: str) -> BomRow:
    """Screws with nuts through the fixing holes: the largest thread and the shortest standard length that fit."""
    hole_mm = design.mold.fixing_hole_diameter_mm
    thread = max((size for size in THREADS_MM if size < hole_mm), default=None)
    length = next((one for one in SCREW_LENGTHS_MM if thread and one >= height_mm + thread), None)
    fits = thread is not None and length is not None
    return BomRow(
        item="screw with nut",
        quantity=4,
        value=f"for holes of {hole_mm:g} mm, longer than {height_mm:g} mm",
        part_number=f"ISO 4762 M{thread:g} x {length:g} and ISO 4032 M{thread:g}" if fits else "",
        order_quantity=4,
        note=purpose,
    )


def _tools(design: SensorDesign) -> Iterator[tuple[str, str]]:
    is_under_lid = is_cast_under_lid(plan_of(design))
    if is_under_lid:
        yield "lid", "lid"
    if is_levelled(design):
        yield "leveling blade", "leveling_blade"
    if design.mold.rim_mm > 0 and not is_under_lid:
        yield "pour gauge", "pour_gauge"
    if not design.is_on_board:
        yield "solder jig", "solder_jig"
    yield "indenter tip", "indenter_tip"


def _by_entry(placed: Sequence[PlacedPart]) -> Iterator[tuple[PlacedPart, tuple[str, ...]]]:
    for part_id in dict.fromkeys(part.part_id for part in placed):
        same = [part for part in placed if part.part_id == part_id]
        yield same[0], tuple(part.name for part in same)


def _marked(names: Sequence[str], mark: str) -> tuple[str, ...]:
    return tuple(f"{name}-{mark}" for name in names)


def _most_ma(part: Part) -> str:
    assert part.max_current_ma is not None
    return number(part.max_current_ma.value)


def _base_note(switch: EmitterSwitch, driver: str, most_ma: float) -> str:
    volts, gain = assumption("base_emitter_v").value, assumption("forced_gain").value
    rests = f"{volts:g} V base to emitter, forced gain {gain:g} (assumed)"
    note = f"{switch.base_current_ma:.1f} mA from {driver}; {rests}"
    if switch.base_current_ma > most_ma:
        return f"{note}; TOO MUCH for it ({most_ma:g} mA): use a logic-level MOSFET or a driver instead"
    return note


def _series_note(switch: EmitterSwitch, part: Part, board: Board) -> str:
    forward, supply = switch.forward_v, board.emitter_v
    rests = f"at {forward.value:g} V forward voltage ({forward.confidence}) and {supply:g} V supply"
    if switch.series_ohm is None:
        return f"{rests} the supply cannot light it: use a higher supply for the emitters"
    return (
        f"{switch.current_ma:.1f} mA at most, {_most_ma(part)} mA allowed; {switch.series_mw:.0f} mW; {rests}"
    )
