"""Driver configuration of exactly this geometry: design in, `driver.toml` out.

Every index, pin and place comes from `fabrication.connections`; times and bytes from
`design.circuit.timing`. Reading it back needs nothing of this: see `fabrication.driver_file`.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

import tomlkit
from tomlkit.items import AoT, Table

from design.arrays import FloatArray
from design.circuit import timing
from design.circuit.pins import board_of
from design.circuit.transimpedance import feedbacks_of
from design.geometry.cavity import workspace_of
from design.geometry.plan import plan_of
from design.parts.assumptions import assumption
from design.parts.catalog import Board
from design.spec import SensorDesign
from fabrication.bundle import versions
from fabrication.connections import Connection, Connections, connections_of
from fabrication.driver_file import CHECKSUM, FORMAT_VERSION, content_sha256, load_driver_config
from fabrication.firmware.settings import firmware_gaps, firmware_settings

__all__ = ["driver_config", "dump_driver_config", "load_driver_config"]


US_PER_MS = timing.US_PER_MS

HEADING = (
    "Driver configuration of one sensor design; written by optopad, read by the PC beside the sensor.",
    "Change the design and write it anew: the checksum refuses edits. Lengths in mm in the cavity frame:",
    "x and y from 0 at one cavity corner, z = 0 at the bottom of the clear layer.",
)

TABLE_COMMENTS = {
    "board": "full scale of the converter is the board's supply; baud_error is made_baud / baud - 1",
    "frame": "readings are packed bit by bit, state by state and within a state receiver by receiver",
    "timing": "a plain sum: settle and convert state by state, then send",
    "workspace": "press centres that the verdict is about, in plan; outline disc: within the four sides",
    "surface": "the untouched top, by its highest place; a press goes against its normal",
    "ambient": "subtract this state's readings from those of every other state",
    "gain": "counts for all of an emitter's power on one receiver (median; each); absent if not simulated",
    "states": "in order: each emitter alone, then all off",
    "emitters": "active_mm: emitting area along the wall and upward; normal points into the cavity",
    "expected": "untouched pad by simulation: a row an emitter, a column a receiver; absent if not simulated",
    "receivers": "column: place within a state's readings; channel_number: place among the board's channels",
}


def driver_config(
    design: SensorDesign,
    counts_per_flux: float | Sequence[float] | None = None,
    untouched_counts: FloatArray | None = None,
) -> dict[str, Any]:
    """The configuration as plain data.

    Parameters
    ----------
    counts_per_flux : the gain that the simulation set, of all receivers or of each [counts]; None leaves it out
    untouched_counts : (emitter, receiver) readings expected of the untouched pad [counts]; None leaves them out

    Raises
    ------
    DesignError : pins or parts that the board or the catalogue does not have.
    """
    connections, board = connections_of(design), board_of(design)
    counts = len(connections.emitters), len(connections.receivers)
    document = {
        "format_version": FORMAT_VERSION,
        "design": design.name,
        "digest": design.digest,
        "optopad": versions()["optopad"],
        CHECKSUM: "",
        "units": {"length": "mm", "time": "us or ms, as named", "rate": "Hz", "reading": "ADC counts"},
        "board": _board(design, board),
        "frame": _frame(board, *counts),
        "timing": _timing(design, board, *counts),
        "workspace": _workspace(design),
        "surface": _surface(design),
        "ambient": {"subtract_state": counts[0]},
        "gain": _gain(design, counts_per_flux, counts[1]),
        "states": _states(connections),
        "emitters": [_emitter(one) for one in connections.emitters],
        "receivers": [_receiver(one) for one in connections.receivers],
        **_expected(untouched_counts),
    }
    document[CHECKSUM] = content_sha256(document)
    return document


def dump_driver_config(
    design: SensorDesign,
    counts_per_flux: float | Sequence[float] | None = None,
    untouched_counts: FloatArray | None = None,
) -> str:
    """The configuration as TOML text with comments."""
    text = tomlkit.document()
    for line in HEADING:
        text.add(tomlkit.comment(line))
    for key, value in driver_config(design, counts_per_flux, untouched_counts).items():
        if isinstance(value, dict):
            text.add(key, _table(key, value))
        elif isinstance(value, list):
            text.add(key, _tables(key, value))
        else:
            text.add(key, value)
    return tomlkit.dumps(text)


def _board(design: SensorDesign, board: Board) -> dict[str, Any]:
    use = design.board
    return {
        "kind": use.kind,
        "title": board.title,
        "clock_hz": board.clock_hz,
        "adc_bits": board.adc_bits,
        "adc_reference": f"board supply, taken as {assumption('supply_v').value:g} V",
        "adc_clocks_per_conversion": board.adc_clocks_per_conversion,
        "adc_prescaler": use.adc_prescaler,
        "settle_us": use.settle_us,
        "baud": use.baud,
        "made_baud": timing.made_baud(board.clock_hz, use.baud),
        "baud_error": timing.baud_error(board.clock_hz, use.baud),
        "link_number": board.link_number,
        "usb_ids": list(board.usb_ids),
        "bridge_usb_ids": list(board.bridge_usb_ids),
        "boot_s": board.boot_s,
        **_program(design),
    }


def _program(design: SensorDesign) -> dict[str, int]:
    """What the firmware says of itself, where one can be made for the board."""
    return {} if firmware_gaps(design) else {"config_crc": firmware_settings(design).config_crc()}


def _frame(board: Board, emitter_count: int, receiver_count: int) -> dict[str, Any]:
    states = timing.state_count(emitter_count)
    total = timing.frame_bytes(emitter_count, receiver_count, board.adc_bits)
    around = {
        "magic_bytes": timing.MAGIC_BYTES,
        "version_bytes": timing.VERSION_BYTES,
        "sequence_bytes": timing.SEQUENCE_BYTES,
        "time_bytes": timing.TIME_BYTES,
        "check_bytes": timing.CHECK_BYTES,
    }
    return {
        "order": ["state", "receiver"],
        "states": states,
        "receivers": receiver_count,
        "readings": states * receiver_count,
        "bits_per_reading": board.adc_bits,
        **around,
        "reading_bytes": total - sum(around.values()),
        "total_bytes": total,
    }


def _timing(design: SensorDesign, board: Board, emitter_count: int, receiver_count: int) -> dict[str, Any]:
    use = design.board
    sent = timing.frame_bytes(emitter_count, receiver_count, board.adc_bits)
    frame_ms = timing.frame_time_ms(board, use, emitter_count, receiver_count)
    return {
        "conversion_us": timing.conversion_time_ms(board, use.adc_prescaler) * US_PER_MS,
        "settle_us": use.settle_us,
        "link_ms": timing.link_time_ms(sent, use.baud),
        "frame_ms": frame_ms,
        "possible_hz": timing.MS_PER_S / frame_ms,
        "wanted_hz": use.frame_rate_hz,
    }


def _surface(design: SensorDesign) -> dict[str, Any]:
    plan, crown = plan_of(design), design.crown
    return {
        "top_mm": [*plan.centre_mm, plan.clear_mm],
        "crown": "none" if crown is None else crown.shape,
        **({} if crown is None else {"radius_mm": crown.radius_mm}),
        **({} if crown is None or crown.axis is None else {"axis": crown.axis}),
    }


def _workspace(design: SensorDesign) -> dict[str, Any]:
    area = workspace_of(design)
    return {
        "x0_mm": area.x0_mm,
        "x1_mm": area.x1_mm,
        "y0_mm": area.y0_mm,
        "y1_mm": area.y1_mm,
        "max_depth_mm": design.operating.max_depth_mm,
        **({} if area.kind == "rectangle" else {"outline": area.kind}),
    }


def _gain(
    design: SensorDesign, counts_per_flux: float | Sequence[float] | None, receivers: int
) -> dict[str, Any]:
    given, rule = design.gain.feedback_ohm, {"target_counts": design.gain.target_counts}
    document: dict[str, Any] = {**rule, "rule": given if isinstance(given, str) else "ohms"}
    if isinstance(counts_per_flux, (int, float)):
        counts_per_flux = (float(counts_per_flux),) * receivers
    feedbacks = feedbacks_of(design, counts_per_flux)
    if feedbacks is not None:
        counts_per_flux = counts_per_flux or [one.counts_per_flux for one in feedbacks]
    if counts_per_flux is not None:
        document["counts_per_flux"] = float(median(counts_per_flux))
        document["receiver_counts_per_flux"] = [float(one) for one in counts_per_flux]
    if feedbacks is not None:
        document["feedback_ohm"] = [one.standard_ohm for one in feedbacks]
        document["feedback_pf"] = [one.capacitor_pf for one in feedbacks]
    return document


def _states(connections: Connections) -> list[dict[str, Any]]:
    lit = [{"number": one.number, "emitter": one.part.name} for one in connections.emitters]
    return [*lit, {"number": len(lit), "emitter": ""}]


def _emitter(one: Connection) -> dict[str, Any]:
    return {"name": one.part.name, "pin": one.pin_number, "state": one.number, **_place(one)}


def _receiver(one: Connection) -> dict[str, Any]:
    wired = {"channel": one.pin, "channel_number": one.pin_number, "column": one.number}
    return {"name": one.part.name, **wired, **_place(one)}


def _place(one: Connection) -> dict[str, Any]:
    return {
        "position_mm": list(one.position_mm),
        "wall": one.part.wall,
        "normal": list(one.normal),
        "part": one.part.part_id,
        "active_mm": [one.part.part.active_width_mm.value, one.part.part.active_height_mm.value],
    }


def _expected(untouched_counts: FloatArray | None) -> dict[str, Any]:
    if untouched_counts is None:
        return {}
    rows = [[round(float(count), 1) for count in row] for row in untouched_counts]
    return {"expected": {"source": "simulated, untouched", "untouched_counts": rows}}


def _table(key: str, values: dict[str, Any]) -> Table:
    table = tomlkit.table()
    if key in TABLE_COMMENTS:
        table.comment(TABLE_COMMENTS[key])
    for name, value in values.items():
        table.add(name, value)
    return table


def _tables(key: str, rows: list[dict[str, Any]]) -> AoT:
    tables = tomlkit.aot()
    for place, row in enumerate(rows):
        table = tomlkit.table()
        if place == 0:
            table.comment(TABLE_COMMENTS[key])
        for name, value in row.items():
            table.add(name, value)
        tables.append(table)
    return tables
