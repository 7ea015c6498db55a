"""Bill of materials: items to buy, print and weigh for one sensor.

Reference designators extend the names of the layout: E3-Q is the transistor of emitter E3. Costs are from the
catalogue, with currency, date and source; unknown costs are blank. For a transistor or amplifier, the column `value`
gives the requirements, because no part is chosen. If the gain is not known, the `value` of a feedback component is
"set by gain".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from cad.volume import mold_volume_mm3
from design.circuit.emitter_switch import (
    CurrentSink,
    EmitterSwitch,
    current_sink,
    emitter_switch,
    most_drive_ma,
)
from design.circuit.pins import (
    amplifier_v,
    board_of,
    converter_of,
    driver_of,
    full_scale_v,
    multiplexer_of,
    shift_register_of,
)
from design.circuit.transimpedance import settle_words
from design.mold.filling import is_cast_under_lid
from design.mold.outline import outline_of
from design.parts.assumptions import assumption, ohm_text
from design.parts.catalog import Board, Chip, Converter, Cost, LedDriver, Part, find_mold_material
from design.shape.cavity import PlacedPart, cavity_of, plan_of
from design.spec import SensorDesign
from design.spec.properties import elastomer_of, entries_of
from fabrication.gain import SimulatedGain, feedbacks_for
from fabrication.sheets.casting import MM3_PER_CM3, Pour, pours
from fabrication.sheets.table import csv_text, number

COLUMNS = (
    "item",
    "catalogue_id",
    "quantity",
    "unit",
    "references",
    "value",
    "manufacturer",
    "unit_cost",
    "currency",
    "cost_date",
    "cost_source",
    "note",
)

SET_BY_GAIN = "set by gain"
NO_PRICE = "no price known"


@dataclass(frozen=True, kw_only=True)
class BomRow:
    """One item of the bill of materials.

    Attributes
    ----------
    quantity : number of pieces, or of other units named in `unit`; None if not known
    references : reference designators of the item, in the order of the layout
    cost : quoted cost of one unit; None if not known
    """

    item: str
    catalogue_id: str = ""
    quantity: float | None
    unit: str = "piece"
    references: tuple[str, ...] = ()
    value: str = ""
    manufacturer: str = ""
    cost: Cost | None = None
    note: str = ""


def bom_rows(design: SensorDesign, gain: SimulatedGain | None = None) -> tuple[BomRow, ...]:
    """All items of the bill of materials for one sensor.

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are not given
    """
    cavity, board = cavity_of(design), board_of(design)
    return (
        *_part_rows(cavity.emitters),
        *_part_rows(cavity.receivers),
        BomRow(item=board.title, catalogue_id=design.board.kind, quantity=1),
        *_switch_rows(design, cavity.emitters, board),
        *_amplifier_rows(design, cavity.receivers, gain),
        *_circuit_rows(design),
        *_silicone_rows(design),
        *_printed_rows(design),
    )


def bom_csv(design: SensorDesign, gain: SimulatedGain | None = None) -> str:
    """The bill of materials as CSV."""
    return csv_text(COLUMNS, (_cells(row) for row in bom_rows(design, gain)))


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
        None if cost is None else cost.value,
        None if cost is None else cost.currency,
        None if cost is None else cost.date,
        NO_PRICE if cost is None else cost.source,
        row.note,
    )


def _part_rows(placed: Sequence[PlacedPart]) -> Iterator[BomRow]:
    for part, names in _by_entry(placed):
        entry = part.part
        yield BomRow(
            item=entry.title,
            catalogue_id=part.part_id,
            quantity=len(names),
            references=names,
            manufacturer=entry.manufacturer,
            cost=entry.cost,
            note=" ".join(entry.notes),
        )


def _switch_rows(design: SensorDesign, emitters: Sequence[PlacedPart], board: Board) -> Iterator[BomRow]:
    driver, sink = driver_of(design), current_sink(design)
    if driver is not None and sink is not None:
        yield from _driver_rows(driver, sink, len(emitters))
        return
    for part, names in _by_entry(emitters):
        switch = emitter_switch(part.part, board)
        yield BomRow(
            item="NPN transistor",
            quantity=len(names),
            references=_marked(names, "Q"),
            value=f"collector current at least {_most_ma(part.part)} mA",
            note="one per LED: base to the base resistor, collector to the LED's cathode, its own emitter to ground",
        )
        yield BomRow(
            item="base resistor",
            quantity=len(names),
            references=_marked(names, "RB"),
            value=ohm_text(switch.base_ohm),
            note=_base_note(switch, *most_drive_ma(design, board)),
        )
        yield BomRow(
            item="series resistor",
            quantity=len(names),
            references=_marked(names, "RS"),
            value="none fits" if switch.series_ohm is None else ohm_text(switch.series_ohm),
            note=_series_note(switch, part.part, board),
        )


def _driver_rows(driver: LedDriver, sink: CurrentSink, emitter_count: int) -> Iterator[BomRow]:
    """Items for LED drivers: their reference resistors, and a resistor that keeps outputs off until firmware starts."""
    names = tuple(f"L{number + 1}" for number in range(driver.needed(emitter_count)))
    formula = f"{driver.current_ratio:g} x {driver.reference_v:g} V / current"
    yield BomRow(
        item="reference resistor",
        quantity=len(names),
        references=_marked(names, "RI"),
        value=ohm_text(sink.reference_ohm),
        note=f"IREF of each {driver.name} to ground: {sink.current_ma:.1f} mA at each output by {formula}; "
        f"{min(sink.asked_ma, driver.max_output_ma.value):g} mA allowed",
    )
    yield BomRow(
        item="pull-up resistor",
        quantity=1,
        references=_marked(names[:1], "RP"),
        value="10 kohm",
        note="BLANK to the supply of the LED drivers: all outputs are off until the program starts",
    )


def _amplifier_rows(
    design: SensorDesign, receivers: Sequence[PlacedPart], gain: SimulatedGain | None
) -> Iterator[BomRow]:
    names = tuple(part.name for part in receivers)
    yield BomRow(
        item="transimpedance amplifier",
        quantity=len(names),
        references=_marked(names, "A"),
        value=f"single supply of {amplifier_v(design):g} V, inputs and output down to ground",
        note=f"output to the receiver's channel; {_bandwidth_note()}",
    )
    yield _supply_capacitors(names, "ceramic, next to each amplifier's supply pins; one per package")
    feedbacks = feedbacks_for(design, gain)
    if feedbacks is None:
        yield from _open_feedback_rows(design, names)
        return
    resistors = [ohm_text(one.standard_ohm) for one in feedbacks]
    capacitors = [f"{one.capacitor_pf:g} pF" for one in feedbacks]
    for item, mark, values, note in (
        (
            "feedback resistor",
            "RF",
            resistors,
            "depends on the emitters' power; see casting.md, last section",
        ),
        (
            "feedback capacitor",
            "CF",
            capacitors,
            f"settles within {settle_words(design)}",
        ),
    ):
        for value in dict.fromkeys(values):
            same = [name for name, own in zip(names, values, strict=True) if own == value]
            late = mark == "CF" and not all(
                one.is_in_time for one, own in zip(feedbacks, values, strict=True) if own == value
            )
            yield BomRow(
                item=item,
                quantity=len(same),
                references=_marked(same, mark),
                value=value,
                note="smallest stable value: TOO SLOW for board.settle_us, see casting.md" if late else note,
            )


def _open_feedback_rows(design: SensorDesign, names: Sequence[str]) -> Iterator[BomRow]:
    rule = (
        f"so that the median judged pair reads {design.gain.target_counts:g} counts untouched, and none clips"
    )
    for item, mark, note in (
        ("feedback resistor", "RF", f"{rule}; see casting.md, last section"),
        (
            "feedback capacitor",
            "CF",
            f"with RF it must settle within {settle_words(design)}",
        ),
    ):
        yield BomRow(
            item=item, quantity=len(names), references=_marked(names, mark), value=SET_BY_GAIN, note=note
        )


def _bandwidth_note() -> str:
    return f"gain-bandwidth product taken as {assumption('amplifier_bandwidth_mhz').value:g} MHz (assumed)"


def _circuit_rows(design: SensorDesign) -> Iterator[BomRow]:
    cavity, use = cavity_of(design), design.board
    register, entry = shift_register_of(design), multiplexer_of(design)
    driver, converter = driver_of(design), converter_of(design)
    emitters, receivers = len(cavity.emitters), len(cavity.receivers)
    if register is not None and use.emitters is not None:
        yield from _chip_rows(design, register, use.emitters.shift_register, "S", register.needed(emitters))
    if driver is not None and use.emitters is not None:
        yield from _chip_rows(design, driver, use.emitters.driver, "L", driver.needed(emitters))
    if entry is not None and use.receivers is not None:
        yield from _chip_rows(design, entry, use.receivers.multiplexer, "M", entry.needed(receivers))
    if converter is not None and use.receivers is not None:
        yield from _chip_rows(design, converter, use.receivers.converter, "U", converter.needed(receivers))


def _chip_rows(
    design: SensorDesign, entry: Chip, part_id: str | None, letter: str, count: int
) -> Iterator[BomRow]:
    names, board = tuple(f"{letter}{number + 1}" for number in range(count)), board_of(design)
    supply = f"supply {board.pin_v:g} V"
    if isinstance(entry, Converter):
        supply += f", full scale {full_scale_v(design):g} V"
        if entry.has_own_logic:
            supply = f"AVDD {entry.analog_v(board):g} V, DVDD {board.pin_v:g} V, full scale {full_scale_v(design):g} V"
    yield BomRow(
        item=entry.title,
        catalogue_id=part_id or "",
        quantity=count,
        references=names,
        value=supply,
        note=" ".join(entry.notes),
    )
    yield _supply_capacitors(names, "ceramic, next to the supply pins of each")
    if isinstance(entry, Converter) and entry.has_own_logic:
        yield from _own_logic_rows(names)


def _own_logic_rows(names: tuple[str, ...]) -> Iterator[BomRow]:
    """Items for converters: capacitors of their digital supply and of their internal reference."""
    for mark, value, pins in (("CD", "100 nF", "DVDD to ground"), ("CR", "10 uF", "REFIO to ground")):
        yield BomRow(
            item="supply capacitor" if mark == "CD" else "reference capacitor",
            quantity=len(names),
            references=_marked(names, mark),
            value=value,
            note=f"ceramic, {pins} of each",
        )
    yield BomRow(
        item="reference capacitor",
        quantity=len(names),
        references=_marked(names, "CB"),
        value="10 uF",
        note="ceramic, REFCAP to ground of each",
    )


def _supply_capacitors(names: tuple[str, ...], note: str) -> BomRow:
    return BomRow(
        item="supply capacitor",
        quantity=len(names),
        references=_marked(names, "CS"),
        value="100 nF",
        note=note,
    )


def _silicone_rows(design: SensorDesign) -> Iterator[BomRow]:
    elastomer, layers = elastomer_of(design), pours(design)
    shares: tuple[tuple[str, Callable[[Pour], float]], ...] = (
        ("base", lambda pour: pour.base_g),
        ("curing agent", lambda pour: pour.agent_g),
    )
    for component, grams in shares:
        split = ", ".join(f"{pour.layer} layer {grams(pour):.2f} g" for pour in layers)
        yield BomRow(
            item=f"{elastomer.title}, {component}",
            catalogue_id=design.elastomer.material,
            quantity=round(sum(grams(pour) for pour in layers), 2),
            unit="g",
            value=f"{number(design.elastomer.mixing_ratio)} : 1 by weight",
            manufacturer=elastomer.manufacturer,
            note=f"{split}; includes {assumption('silicone_waste').value:.0%} waste (assumed)",
        )
    if any(pour.layer == "black" for pour in layers):
        yield BomRow(
            item="carbon black",
            quantity=round(sum(pour.carbon_g for pour in layers), 2),
            unit="g",
            value=f"{assumption('carbon_black_share').value:.0%} by weight (assumed)",
            note="black layer only; the paper adds it to saturation and states no share by weight",
        )


def _printed_rows(design: SensorDesign) -> Iterator[BomRow]:
    material = find_mold_material(entries_of(design), design.mold.material)
    density = material.density_g_per_cm3.value
    mold_g = mold_volume_mm3(design) / MM3_PER_CM3 * density
    files = "mold.stl" if design.mold.pieces == "one" else "mold_frame.stl and cad/mold_base.stl"
    yield BomRow(
        item="printed mold",
        catalogue_id=design.mold.material,
        quantity=1,
        value=material.title,
        note=f"cad/{files}; {mold_g:.1f} g when printed solid",
    )
    for tool, file in _tools(design):
        yield BomRow(
            item=f"printed {tool}",
            catalogue_id=design.mold.material,
            quantity=1,
            value=material.title,
            note=f"cad/{file}.stl",
        )
    if design.mold.pieces == "frame_and_base":
        size = design.mold.fixing_hole_diameter_mm
        yield BomRow(
            item="screw with nut",
            quantity=4,
            value=f"for holes of {size:g} mm, longer than {outline_of(design).height_mm:g} mm",
            note="hold frame and base together",
        )
    if design.mold.cover_ledge_mm:
        yield BomRow(item="glass cover", quantity=1, value="cut to the seat", note="size: see casting.md")


def _tools(design: SensorDesign) -> Iterator[tuple[str, str]]:
    if is_cast_under_lid(plan_of(design)):
        yield "lid", "lid"
    else:
        if design.cavity.black_thickness_mm > 0:
            yield "leveling blade", "leveling_blade"
        if design.mold.rim_mm > 0:
            yield "pour gauge", "pour_gauge"
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
