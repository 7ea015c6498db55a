"""Makes a design's driver configuration, `driver.toml`.

Every index, pin and position comes from `optopad.fabrication.connections`; times and bytes come from
`optopad.design.circuit.pins`. The data classes and the reader are in `optopad.fabrication.driver_file`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import tomlkit
from tomlkit.items import AoT, Table

from optopad.design.arrays import FloatArray
from optopad.design.circuit import pins as timing
from optopad.design.circuit.pins import board_of
from optopad.design.circuit.transimpedance import feedbacks_of
from optopad.design.parts.catalog import Board
from optopad.design.recordings import lit_emitters
from optopad.design.shape.cavity import plan_of, workspace_of
from optopad.design.shape.outline import PLAIN
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import versions
from optopad.fabrication.connections import Connection, connections_of
from optopad.fabrication.driver_file import (
    FORMAT_VERSION,
    AmbientRule,
    BoardSetup,
    DriverConfig,
    EmitterEntry,
    ExpectedPattern,
    FrameLayout,
    GainNote,
    ReceiverEntry,
    StateEntry,
    SurfaceEntry,
    TimingBudget,
    Units,
    WorkspaceLimits,
    content_sha256,
)
from optopad.fabrication.record import plain_of
from optopad.fabrication.sketch import firmware_gaps, firmware_settings

HEADING = (
    "Driver configuration of one sensor design; written by optopad, read by the computer at the sensor.",
    "Edits fail the checksum: change the design and write this file again. Lengths in mm, cavity frame:",
    "x and y from 0 at one cavity corner, z = 0 at the bottom of the clear layer.",
)

TABLE_COMMENTS = {
    "board": "adc_reference: source and voltage of full scale; baud_error is made_baud / baud - 1",
    "frame": "readings are packed bit by bit, state by state and within a state receiver by receiver",
    "timing": "sum of all states' switching, settling and conversion times and of the sending",
    "workspace": "press centres that the verdict covers, seen from above; outline disc: within the four sides",
    "surface": "the untouched top, by its highest point; a press moves against its normal",
    "ambient": "subtract_state: dark state to subtract from all others; absent: subtract the mean of both neighbours",
    "gain": "counts if one receiver received an emitter's total power (median; each); absent if not simulated",
    "states": "in order: the emitter that is lit alone; empty: all off",
    "emitters": "active_mm: emitting area along the wall and upward; normal points into the cavity",
    "expected": "simulated untouched pad: one row per emitter, one column per receiver; absent if not simulated",
    "receivers": "column: index within a state's readings; channel_number: index among the board's channels, or the "
    "converter's number",
}


def driver_config(
    design: SensorDesign,
    counts_per_flux: float | Sequence[float] | None = None,
    untouched_counts: FloatArray | None = None,
) -> DriverConfig:
    """The driver configuration of a design.

    Parameters
    ----------
    counts_per_flux : simulated gain, the reading if a receiver got all of an emitter's power [counts]: one number for
        all receivers, or one for each. If None, the gain is omitted
    untouched_counts : expected readings of the untouched pad, shape (emitters, receivers) [counts]. If None, they are
        omitted

    Raises
    ------
    DesignError : the catalogue does not have a part, or the board does not have a pin.
    """
    connections, board = connections_of(design), board_of(design)
    lit = [one.part.name for one in connections.emitters]
    counts = len(lit), len(connections.receivers)
    states = lit_emitters(len(lit), design.board.dark)
    config = DriverConfig(
        format_version=FORMAT_VERSION,
        design=design.name,
        digest=design.digest,
        optopad=versions()["optopad"],
        content_sha256="",
        units=Units(length="mm", time="us or ms, as named", rate="Hz", reading="ADC counts"),
        board=_board(design, board),
        frame=_frame(design, *counts),
        timing=_timing(design, board, *counts),
        workspace=_workspace(design),
        surface=_surface(design),
        ambient=AmbientRule(subtract_state=counts[0] if design.board.dark == "frame" else None),
        gain=_gain(design, counts_per_flux, counts[1]),
        states=tuple(
            StateEntry(number=k, emitter="" if one is None else lit[one]) for k, one in enumerate(states)
        ),
        emitters=tuple(
            EmitterEntry(
                name=one.part.name,
                pin=one.pin_number,
                output=None if design.board.emitters is None else one.pin,
                state=states.index(one.number),
                **_place(one),
            )
            for one in connections.emitters
        ),
        receivers=tuple(
            ReceiverEntry(
                name=one.part.name,
                channel=one.pin,
                channel_number=one.pin_number,
                address=one.address,
                column=one.number,
                **_place(one),
            )
            for one in connections.receivers
        ),
        expected=_expected(untouched_counts),
    )
    return replace(config, content_sha256=content_sha256(plain_of(config)))


def dump_driver_config(
    design: SensorDesign,
    counts_per_flux: float | Sequence[float] | None = None,
    untouched_counts: FloatArray | None = None,
) -> str:
    """The driver configuration as TOML text with comments; for parameters and errors see `driver_config`."""
    text = tomlkit.document()
    for line in HEADING:
        text.add(tomlkit.comment(line))
    for key, value in plain_of(driver_config(design, counts_per_flux, untouched_counts)).items():
        if isinstance(value, dict):
            text.add(key, _table(value, TABLE_COMMENTS.get(key)))
        elif isinstance(value, list):
            text.add(key, _tables(value, TABLE_COMMENTS[key]))
        else:
            text.add(key, value)
    return tomlkit.dumps(text)


def _board(design: SensorDesign, board: Board) -> BoardSetup:
    use, converter, driver = design.board, timing.converter_of(design), timing.driver_of(design)
    switches = timing.switch_pins(design, board, len(connections_of(design).emitters))
    return BoardSetup(
        kind=use.kind,
        title=board.title,
        clock_hz=board.clock_hz,
        adc_bits=timing.adc_bits(design),
        adc_reference=_reference_words(design, board),
        adc_clocks_per_conversion=board.adc_clocks_per_conversion,
        adc_prescaler=use.adc_prescaler if board.divides_clock else None,
        settle_us=use.settle_us,
        baud=use.baud,
        made_baud=timing.made_baud(board.clock_hz, use.baud) if board.divides_clock else float(use.baud),
        baud_error=timing.baud_error(board.clock_hz, use.baud) if board.divides_clock else 0.0,
        link_number=board.link_number,
        usb_ids=tuple(board.usb_ids),
        bridge_usb_ids=tuple(board.bridge_usb_ids),
        boot_s=board.boot_s,
        address_pins=timing.address_pins(design) or None,
        shift_pins=switches if timing.shift_register_of(design) else None,
        spi_pins=timing.spi_pins(design, board) or None,
        converter=None if converter is None else converter.name,
        select_pins=timing.select_pins(design) or None,
        led_driver=None if driver is None else driver.name,
        driver_pins=None if driver is None else switches,
        config_crc=None if firmware_gaps(design) else firmware_settings(design).config_crc(),
    )


def _reference_words(design: SensorDesign, board: Board) -> str:
    volts, converter = timing.full_scale_v(design), timing.converter_of(design)
    if converter is not None:
        reference = "its supply" if converter.full_scale_v is None else "its own range"
        return f"{converter.name}, {reference}, {volts:g} V"
    if design.board.reference == "internal":
        return f"internal reference, {volts:g} V"
    return f"board supply, taken as {volts:g} V" if board.divides_clock else f"{volts:g} V"


def _frame(design: SensorDesign, emitter_count: int, receiver_count: int) -> FrameLayout:
    bits, dark = timing.adc_bits(design), design.board.dark
    states = timing.state_count(emitter_count, dark)
    total = timing.frame_bytes(emitter_count, receiver_count, bits, dark)
    head = timing.MAGIC_BYTES + timing.VERSION_BYTES + timing.SEQUENCE_BYTES + timing.TIME_BYTES
    return FrameLayout(
        order=("state", "receiver"),
        states=states,
        receivers=receiver_count,
        readings=states * receiver_count,
        bits_per_reading=bits,
        magic_bytes=timing.MAGIC_BYTES,
        version_bytes=timing.VERSION_BYTES,
        sequence_bytes=timing.SEQUENCE_BYTES,
        time_bytes=timing.TIME_BYTES,
        check_bytes=timing.CHECK_BYTES,
        reading_bytes=total - head - timing.CHECK_BYTES,
        total_bytes=total,
    )


def _timing(design: SensorDesign, board: Board, emitter_count: int, receiver_count: int) -> TimingBudget:
    use, driver = design.board, timing.driver_of(design) or timing.shift_register_of(design)
    sent = timing.frame_bytes(emitter_count, receiver_count, timing.adc_bits(design), use.dark)
    frame_ms = timing.design_frame_time_ms(design, emitter_count, receiver_count, board, use)
    switch_ms = timing.switch_time_ms(driver, emitter_count, use.dark)
    return TimingBudget(
        conversion_us=timing.reading_time_ms(board, use, timing.converter_of(design)) * timing.US_PER_MS,
        settle_us=use.settle_us,
        link_ms=timing.sending_time_ms(board, use, sent),
        frame_ms=frame_ms,
        possible_hz=timing.MS_PER_S / frame_ms,
        wanted_hz=use.frame_rate_hz,
        switch_us=None if driver is None else switch_ms * timing.US_PER_MS,
    )


def _surface(design: SensorDesign) -> SurfaceEntry:
    plan = plan_of(design)
    return SurfaceEntry(
        top_mm=(*plan.centre_mm, plan.clear_mm),
        crown=plan.top.kind,
        radius_mm=None if plan.top.is_flat else round(plan.top.radius_mm, 9),
        axis=plan.top.straight,
    )


def _workspace(design: SensorDesign) -> WorkspaceLimits:
    area = workspace_of(design)
    return WorkspaceLimits(
        x0_mm=area.x0_mm,
        x1_mm=area.x1_mm,
        y0_mm=area.y0_mm,
        y1_mm=area.y1_mm,
        max_depth_mm=design.operating.max_depth_mm,
        outline=None if area.kind == PLAIN else area.kind,
    )


def _gain(design: SensorDesign, counts_per_flux: float | Sequence[float] | None, receivers: int) -> GainNote:
    given = design.gain.feedback_ohm
    if isinstance(counts_per_flux, (int, float)):
        counts_per_flux = (float(counts_per_flux),) * receivers
    feedbacks = feedbacks_of(design, counts_per_flux)
    if feedbacks is not None:
        counts_per_flux = counts_per_flux or [one.counts_per_flux for one in feedbacks]
    each = None if counts_per_flux is None else tuple(float(one) for one in counts_per_flux)
    return GainNote(
        target_counts=design.gain.target_counts,
        rule=given if isinstance(given, str) else "ohms",
        counts_per_flux=None if each is None else median(each),
        receiver_counts_per_flux=each,
        feedback_ohm=None if feedbacks is None else tuple(one.standard_ohm for one in feedbacks),
        feedback_pf=None if feedbacks is None else tuple(one.capacitor_pf for one in feedbacks),
    )


def _place(one: Connection) -> dict[str, Any]:
    part = one.part.part
    return {
        "position_mm": one.position_mm,
        "wall": one.part.wall,
        "normal": one.normal,
        "part": one.part.part_id,
        "active_mm": (part.active_width_mm.value, part.active_height_mm.value),
    }


def _expected(untouched_counts: FloatArray | None) -> ExpectedPattern | None:
    if untouched_counts is None:
        return None
    rows = tuple(tuple(round(float(count), 1) for count in row) for row in untouched_counts)
    return ExpectedPattern(source="simulated, untouched", untouched_counts=rows)


def _table(values: dict[str, Any], comment: str | None) -> Table:
    table = tomlkit.table()
    if comment is not None:
        table.comment(comment)
    for name, value in values.items():
        table.add(name, value)
    return table


def _tables(rows: list[dict[str, Any]], comment: str) -> AoT:
    tables = tomlkit.aot()
    for place, row in enumerate(rows):
        tables.append(_table(row, comment if place == 0 else None))
    return tables
