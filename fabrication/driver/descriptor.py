"""Description of a sensor's stream of readings: geometry, names, units and rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.recordings import OFF
from optopad.fabrication.driver_file import (
    DriverConfig,
    EmitterEntry,
    ReceiverEntry,
    SurfaceEntry,
    WorkspaceLimits,
)


@dataclass(frozen=True, kw_only=True)
class PartArray:
    """Names and geometry of all emitters, or of all receivers, in the order of the readings.

    Attributes
    ----------
    names : names of the parts, E1, ... or R1, ...
    pins : names of the pins or inputs, such as D22 or A0
    position_mm : centres of the active areas in the cavity's coordinate system, shape (n, 3) [mm]
    normal : unit vectors from the active areas into the cavity, shape (n, 3) [-]
    """

    names: tuple[str, ...]
    pins: tuple[str, ...]
    position_mm: FloatArray
    normal: FloatArray


@dataclass(frozen=True, kw_only=True)
class Descriptor:
    """Geometry, units and rates of a sensor's stream.

    Attributes
    ----------
    states : for each state in `Frame.counts`, the name of the lit emitter; "off" for the last state, in which none is
    full_scale : largest reading [counts]
    required_rate_hz : frame rate required by the design [Hz]; `Sensor.rate_hz` is the measured one
    possible_rate_hz : largest frame rate according to the timing budget [Hz]; the firmware is slightly faster
    surface : shape of the untouched top surface; None if the configuration is too old to describe it
    expected_counts : simulated readings without contact, shape (emitters, receivers) [counts]; None if not simulated
    config_crc : checksum that the self-test of this design's firmware reports; None if it is not known
    """

    design: str
    digest: str
    states: tuple[str, ...]
    emitters: PartArray
    receivers: PartArray
    workspace: WorkspaceLimits
    surface: SurfaceEntry | None
    full_scale: int
    required_rate_hz: float
    possible_rate_hz: float
    expected_counts: FloatArray | None
    units: dict[str, str]
    config_crc: int | None = None


UNITS = {
    "counts": "ADC counts",
    "signals": "ADC counts, the dark state's subtracted",
    "normalised": "1, signal over its untouched baseline",
    "device_us": "us since the board's reset",
    "host_s": "s since 1970 on this machine",
    "position": "mm in the cavity frame: x, y from a corner, z from the bottom of the clear layer",
}


def descriptor_of(config: DriverConfig) -> Descriptor:
    """Description of the readings that a sensor with this driver configuration sends."""
    expected = config.expected
    return Descriptor(
        design=config.design,
        digest=config.digest,
        states=(*(emitter.name for emitter in config.emitters), OFF),
        emitters=_parts(config.emitters, [entry.output or f"D{entry.pin}" for entry in config.emitters]),
        receivers=_parts(config.receivers, [entry.channel for entry in config.receivers]),
        workspace=config.workspace,
        surface=config.surface,
        full_scale=(1 << config.frame.bits_per_reading) - 1,
        required_rate_hz=config.timing.wanted_hz,
        possible_rate_hz=config.timing.possible_hz,
        expected_counts=None if expected is None else np.array(expected.untouched_counts),
        units=UNITS,
        config_crc=config.board.config_crc,
    )


def _parts(entries: tuple[EmitterEntry, ...] | tuple[ReceiverEntry, ...], pins: list[str]) -> PartArray:
    return PartArray(
        names=tuple(entry.name for entry in entries),
        pins=tuple(pins),
        position_mm=np.array([entry.position_mm for entry in entries]),
        normal=np.array([entry.normal for entry in entries]),
    )
