"""Makes a design's driver configuration, `driver.toml`.

Every index, pin and position comes from `optopad.fabrication.connections`; times and bytes come from
`optopad.design.circuit.circuit`. The data classes and the reader are in `optopad.fabrication.driver_file`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import tomlkit
from tomlkit.items import AoT, Table

from optopad.design.arrays import FloatArray
from optopad.design.circuit import circuit as electronics
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import feedbacks_of
from optopad.design.pad import Pad
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
    MemoryNote,
    ReceiverEntry,
    StateEntry,
    SurfaceEntry,
    TimingBudget,
    Units,
    WorkspaceLimits,
    content_sha256,
    plain_of,
)
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
    "memory": "share of a press's signal change that is left after its release, and time until half of that is left",
    "gain": "counts if one receiver received an emitter's total power (median; each); absent if not simulated",
    "states": "in order: the emitter that is lit alone; empty: all off",
    "emitters": "active_mm: width and height of the emitting area; normal: direction in which it looks",
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
    circuit = Circuit.of(design)
    connections = connections_of(circuit)
    lit = [one.part.name for one in connections.emitters]
    states = lit_emitters(len(lit), design.board.dark)
    config = DriverConfig(
        format_version=FORMAT_VERSION,
        design=design.name,
        digest=design.digest,
        optopad=versions()["optopad"],
        content_sha256="",
        units=Units(length="mm", time="us or ms, as named", rate="Hz", reading="ADC counts"),
        board=_board(circuit),
        frame=_frame(circuit),
        timing=_timing(circuit),
        workspace=_workspace(design),
        surface=_surface(design),
        ambient=AmbientRule(subtract_state=len(lit) if design.board.dark == "frame" else None),
        memory=_memory(design),
        gain=_gain(circuit, counts_per_flux),
        states=tuple(
            StateEntry(number=k, emitter="" if one is None else lit[one]) for k, one in enumerate(states)
        ),
        emitters=tuple(
            EmitterEntry(
                name=one.part.name,
                pin=one.path.number,
                output=one.pin if circuit.emitter_chips else None,
                state=states.index(one.number),
                **_place(one),
            )
            for one in connections.emitters
        ),
        receivers=tuple(
            ReceiverEntry(
                name=one.part.name,
                channel=one.pin,
                channel_number=one.path.number,
                address=one.path.terminal,
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


CHIP_NAMES = {"U": "converter", "L": "led_driver"}
CHIP_PINS = {"M": "address_pins", "S": "shift_pins", "U": "select_pins", "L": "driver_pins"}
"""Fields of the table `board` with the name of chips and with their pins, by the letter of the chips."""


def _board(circuit: Circuit) -> BoardSetup:
    use, board = circuit.use, circuit.board
    made_baud = electronics.made_baud(board.clock_hz, use.baud) if board.divides_clock else float(use.baud)
    chips: dict[str, Any] = {CHIP_PINS[one.entry.letter]: one.pins for one in circuit.chips}
    chips |= {
        CHIP_NAMES[one.entry.letter]: one.entry.name
        for one in circuit.chips
        if one.entry.letter in CHIP_NAMES
    }
    return BoardSetup(
        kind=use.kind,
        title=board.title,
        clock_hz=board.clock_hz,
        adc_bits=circuit.adc.bits,
        adc_reference=circuit.adc.reference,
        adc_clocks_per_conversion=board.adc_clocks_per_conversion,
        adc_prescaler=use.adc_prescaler if board.divides_clock else None,
        settle_us=use.settle_us,
        baud=use.baud,
        made_baud=made_baud,
        baud_error=electronics.baud_error(board.clock_hz, use.baud) if board.divides_clock else 0.0,
        link_number=board.link_number,
        usb_ids=tuple(board.usb_ids),
        bridge_usb_ids=tuple(board.bridge_usb_ids),
        boot_s=board.boot_s,
        spi_pins=circuit.spi_pins or None,
        config_crc=None if firmware_gaps(circuit) else firmware_settings(Pad.of(circuit.design)).config_crc(),
        **chips,
    )


def _frame(circuit: Circuit) -> FrameLayout:
    head = (
        electronics.MAGIC_BYTES
        + electronics.VERSION_BYTES
        + electronics.SEQUENCE_BYTES
        + electronics.TIME_BYTES
    )
    return FrameLayout(
        order=("state", "receiver"),
        states=circuit.state_count,
        receivers=circuit.receiver_count,
        readings=circuit.state_count * circuit.receiver_count,
        bits_per_reading=circuit.adc.bits,
        magic_bytes=electronics.MAGIC_BYTES,
        version_bytes=electronics.VERSION_BYTES,
        sequence_bytes=electronics.SEQUENCE_BYTES,
        time_bytes=electronics.TIME_BYTES,
        check_bytes=electronics.CHECK_BYTES,
        reading_bytes=circuit.frame_bytes - head - electronics.CHECK_BYTES,
        total_bytes=circuit.frame_bytes,
    )


def _timing(circuit: Circuit) -> TimingBudget:
    return TimingBudget(
        conversion_us=circuit.adc.reading_ms * electronics.US_PER_MS,
        settle_us=circuit.use.settle_us,
        link_ms=circuit.sending_ms,
        frame_ms=circuit.frame_ms,
        possible_hz=circuit.frame_rate_hz,
        wanted_hz=circuit.use.frame_rate_hz,
        switch_us=circuit.switch_ms * electronics.US_PER_MS or None,
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


def _gain(circuit: Circuit, counts_per_flux: float | Sequence[float] | None) -> GainNote:
    gain = circuit.design.gain
    given = gain.feedback_ohm
    if isinstance(counts_per_flux, (int, float)):
        counts_per_flux = (float(counts_per_flux),) * circuit.receiver_count
    feedbacks = feedbacks_of(circuit, counts_per_flux)
    if feedbacks is not None:
        counts_per_flux = counts_per_flux or [one.counts_per_flux for one in feedbacks]
    each = None if counts_per_flux is None else tuple(float(one) for one in counts_per_flux)
    return GainNote(
        target_counts=gain.target_counts,
        rule=given if isinstance(given, str) else "ohms",
        counts_per_flux=None if each is None else median(each),
        receiver_counts_per_flux=each,
        feedback_ohm=None if feedbacks is None else tuple(one.standard_ohm for one in feedbacks),
        feedback_pf=None if feedbacks is None else tuple(one.capacitor_pf for one in feedbacks),
    )


def _place(one: Connection) -> dict[str, Any]:
    part = one.part.part
    return {
        "position_mm": one.part.position_mm,
        "wall": one.part.wall,
        "normal": one.normal,
        "part": one.part.part_id,
        "active_mm": (part.active_width_mm.value, part.active_height_mm.value),
    }


def _memory(design: SensorDesign) -> MemoryNote | None:
    noise = design.noise
    if noise.release_residue == 0.0:
        return None
    return MemoryNote(residue=noise.release_residue, decay_s=noise.release_decay_s)


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
