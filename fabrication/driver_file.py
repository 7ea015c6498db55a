"""Reads and checks the driver configuration `driver.toml`, and returns it as frozen dataclasses.

The laboratory's PC needs only Python's standard library to read the file, not the CAD kernel, the models or the schema
of designs. The file belongs to one design, identified by its `digest`. It contains a checksum of its content, by which
a damaged or hand-edited file is detected and refused. To change the file, change the design and write the file again.

`record_of` converts plain data to frozen dataclasses; missing or unknown fields and wrong types are refused. Supported
types are str, bool, int, finite float (an int is converted), tuple (from a list), nested dataclasses, and `X | None`
for optional fields.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import types
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from optopad.design.errors import InputError
from optopad.design.files import name_fault, read_text
from optopad.design.toml_text import parsed_toml

if TYPE_CHECKING:
    from optopad.design.shape.outline import Kind, Outline

Record = TypeVar("Record")


LARGEST_WHOLE = 2**63 - 1
"""Largest magnitude of an integer in a field; arrays and packed frames cannot hold larger numbers."""


class RecordError(ValueError):
    """A field is missing, unknown or of the wrong type; the message names the field."""


def record_of(kind: type[Record], data: Any, path: str = "") -> Record:
    """Convert nested plain data to a frozen dataclass.

    Raises
    ------
    RecordError : a field is missing, unknown or of the wrong type; the message gives its dotted path.
    """
    if not isinstance(data, dict):
        raise RecordError(f"{path or 'the file'}: is no table")
    hints = get_type_hints(kind)
    unknown = [key for key in data if key not in hints]
    if unknown:
        raise RecordError(f"{_join(path, unknown[0])}: is not a field")
    values = {}
    for field in fields(cast(Any, kind)):
        if field.name in data:
            values[field.name] = _value(hints[field.name], data[field.name], _join(path, field.name))
        elif field.default is MISSING:
            raise RecordError(f"{_join(path, field.name)}: is missing")
    return kind(**values)


def plain_of(value: Any) -> Any:
    """Convert a frozen dataclass to the plain data that `record_of` reads; fields whose value is None are omitted."""
    if is_dataclass(value):
        named = {field.name: getattr(value, field.name) for field in fields(value)}
        return {name: plain_of(entry) for name, entry in named.items() if entry is not None}
    return [plain_of(entry) for entry in value] if isinstance(value, tuple) else value


def _value(hint: Any, value: Any, path: str) -> Any:
    if isinstance(hint, types.UnionType):
        return _value(next(kind for kind in get_args(hint) if kind is not types.NoneType), value, path)
    if get_origin(hint) is tuple:
        return _tuple(get_args(hint), value, path)
    if is_dataclass(hint):
        return record_of(cast(type[Any], hint), value, path)
    return _plain(hint, value, path)


def _tuple(kinds: tuple[Any, ...], value: Any, path: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise RecordError(f"{path}: {value!r} is no list")
    each = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else list(kinds)
    if len(each) != len(value):
        raise RecordError(f"{path}: has {len(value)} entries, needs {len(each)}")
    return tuple(
        _value(kind, item, f"{path}[{k}]") for k, (kind, item) in enumerate(zip(each, value, strict=True))
    )


def _plain(kind: type[Any], value: Any, path: str) -> Any:
    if isinstance(value, int) and abs(value) > LARGEST_WHOLE:
        raise RecordError(f"{path}: is beyond 64 bits")
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise RecordError(f"{path}: {value!r} is no {kind.__name__}")
    if kind is float and not math.isfinite(value):
        raise RecordError(f"{path}: {value!r} is no finite number")
    return value


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


FORMAT_VERSION = 2
MOST_BYTES = 1_000_000
"""Largest size of a file that is read [bytes]; the largest configuration is about 30 kB."""
CHECKSUM = "content_sha256"
DESIGN_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,62}")
"""Pattern that a design's name must match, as in `optopad.design.fields.base.FileName`, because recordings are named
after the design."""
Point = tuple[float, float, float]
WAY_OUT = "write it again with `optopad driver config DESIGN`"


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of all numbers in `driver.toml`, in words; in addition, each quantity's name ends with its unit."""

    length: str
    time: str
    rate: str
    reading: str


@dataclass(frozen=True, kw_only=True)
class BoardSetup:
    """The board, and the settings of its converter and serial line.

    Attributes
    ----------
    adc_reference : source and voltage of the converter's full scale
    baud_error : relative error of the baud rate that the board can generate: made_baud / baud - 1 [-]
    link_number : number with which the firmware identifies the type of board; 0 for boards without a number
    usb_ids : "vendor:product" USB identifiers of the manufacturer's boards
    bridge_usb_ids : "vendor:product" USB identifiers of serial chips on copies of the board
    boot_s : longest time from opening the port, which resets the board, to the start of the firmware [s]
    shift_pins : digital pins for data, clock and latch of the emitters' shift registers; None without shift registers
    address_pins : digital pins of the multiplexers' address, lowest bit first; None without multiplexers
    spi_pins : clock, data out and data in of the SPI bus; None if it is not used
    converter : name of the converters that read the receivers; None for the board's own converter
    select_pins : chip selects of the converters, in their order; None without converters
    led_driver : name of the LED drivers; None for a transistor at each emitter
    driver_pins : latch and blank of the LED drivers; None without LED drivers
    config_crc : checksum that the self-test of this design's firmware reports; None if the board has no firmware
    """

    kind: str
    title: str
    clock_hz: int
    adc_bits: int
    adc_reference: str
    adc_clocks_per_conversion: int | None = None
    adc_prescaler: int | None = None
    settle_us: float
    baud: int
    made_baud: float
    baud_error: float
    link_number: int
    usb_ids: tuple[str, ...]
    bridge_usb_ids: tuple[str, ...]
    boot_s: float
    config_crc: int | None = None
    address_pins: tuple[int, ...] | None = None
    shift_pins: tuple[int, ...] | None = None
    spi_pins: tuple[int, ...] | None = None
    converter: str | None = None
    select_pins: tuple[int, ...] | None = None
    led_driver: str | None = None
    driver_pins: tuple[int, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class StateEntry:
    """One step of the emitter sequence: its index, and the name of the only lit emitter ("" in a dark state)."""

    number: int
    emitter: str


@dataclass(frozen=True, kw_only=True)
class EmitterEntry:
    """An emitter: its name, pin or output, index of the state in which it is lit, position and direction.

    With shift registers or LED drivers, `pin` is the number of the emitter's output, counted along their chain, and
    `output` is the name of that output.
    """

    name: str
    pin: int
    state: int
    position_mm: tuple[float, float, float]
    wall: str
    normal: tuple[float, float, float]
    part: str
    active_mm: tuple[float, float]
    output: str | None = None


@dataclass(frozen=True, kw_only=True)
class ReceiverEntry:
    """A receiver: its name, board input, multiplexer address, column, position and direction.

    The column is the receiver's index among the readings of one state. With separate converters, `channel_number` is
    the number of the receiver's converter, from 0, and `address` is the input of that converter.
    """

    name: str
    channel: str
    channel_number: int
    column: int
    position_mm: tuple[float, float, float]
    wall: str
    normal: tuple[float, float, float]
    part: str
    active_mm: tuple[float, float]
    address: int | None = None


@dataclass(frozen=True, kw_only=True)
class FrameLayout:
    """Layout of a frame on the serial line: head, packed readings, checksum.

    Attributes
    ----------
    order : axes of the array of readings, the slowest-varying first
    head_bytes : number of bytes before the readings: magic, version, sequence number, time
    """

    order: tuple[str, ...]
    states: int
    receivers: int
    readings: int
    bits_per_reading: int
    magic_bytes: int
    version_bytes: int
    sequence_bytes: int
    time_bytes: int
    check_bytes: int
    reading_bytes: int
    total_bytes: int


@dataclass(frozen=True, kw_only=True)
class TimingBudget:
    """Duration of a frame, durations of its steps, and the resulting frame rate; computed in
    `optopad.design.circuit.circuit`.

    Attributes
    ----------
    switch_us : time at the beginning of each state for the LED drivers to receive their data and switch [us]; None
        without LED drivers
    """

    conversion_us: float
    settle_us: float
    link_ms: float
    frame_ms: float
    possible_hz: float
    wanted_hz: float
    switch_us: float | None = None


@dataclass(frozen=True, kw_only=True)
class WorkspaceLimits:
    """Workspace of the verdict: limits of the press centres in cavity coordinates, and the deepest press [mm].

    Attributes
    ----------
    outline : name of the shape of the region of press centres; None for the rectangle between the limits of x and y
    """

    x0_mm: float
    x1_mm: float
    y0_mm: float
    y1_mm: float
    max_depth_mm: float
    outline: str | None = None

    @property
    def area(self) -> Outline:
        """The region of the press centres, in the cavity's coordinate system."""
        from optopad.design.shape.outline import PLAIN, outline_in

        box = (self.x0_mm, self.y0_mm, self.x1_mm, self.y1_mm)
        return outline_in(cast("Kind", self.outline or PLAIN), box)


@dataclass(frozen=True, kw_only=True)
class SurfaceEntry:
    """Shape of the untouched top surface: flat, or convex with its highest point over the middle of the pad.

    Attributes
    ----------
    top_mm : highest point, or middle of a flat top (x, y, z), in the cavity's coordinate system [mm]
    crown : "none", "sphere" or "cylinder"
    radius_mm : radius of curvature; None for a flat top
    axis : direction of a cylinder's axis, "x" or "y"; None for other shapes
    """

    top_mm: tuple[float, float, float]
    crown: str
    radius_mm: float | None = None
    axis: str | None = None

    def point_and_normal(self, x_mm: float, y_mm: float) -> tuple[Point, Point]:
        """Point where a press at x, y first touches the top [mm], and the outward unit normal there [-].

        A press moves against the normal. Both vectors are in the cavity's coordinate system. If x, y is farther from
        the top's middle than its radius of curvature, the height and normal are those of the nearest surface point.
        """
        x, y, z = self.top_mm
        if self.radius_mm is None:
            return (x_mm, y_mm, z), (0.0, 0.0, 1.0)
        away = [0.0 if self.axis == "x" else x_mm - x, 0.0 if self.axis == "y" else y_mm - y]
        most = 0.999 * self.radius_mm
        shrunk = min(1.0, most / max(math.hypot(*away), 1e-12))
        away = [shrunk * one for one in away]
        up = math.sqrt(self.radius_mm**2 - away[0] ** 2 - away[1] ** 2)
        normal = away[0] / self.radius_mm, away[1] / self.radius_mm, up / self.radius_mm
        return (x_mm, y_mm, z - self.radius_mm + up), normal


@dataclass(frozen=True, kw_only=True)
class AmbientRule:
    """Correction of ambient light: the readings in the dark state `subtract_state` are subtracted from all others.

    If `subtract_state` is None, the mean of the dark states before and after each emitter's state is subtracted.
    """

    subtract_state: int | None = None


@dataclass(frozen=True, kw_only=True)
class GainNote:
    """The receivers' gain: the intended reading of the median pair on the untouched pad [counts], and the components.

    Attributes
    ----------
    rule : how the gain is set, "common", "each" or "ohms"; see `optopad.design.spec.Gain`
    counts_per_flux : reading of the median receiver if it got all of an emitter's power [counts]; None if not simulated
    receiver_counts_per_flux : the same quantity for each receiver, in the order of columns; None if not simulated
    feedback_ohm, feedback_pf : feedback resistor [ohm] and capacitor [pF] of each receiver's amplifier; None if the
        emitters' power is not known. They are standard values, so the gain may differ by up to 5 %
    """

    target_counts: float
    rule: str
    counts_per_flux: float | None = None
    receiver_counts_per_flux: tuple[float, ...] | None = None
    feedback_ohm: tuple[float, ...] | None = None
    feedback_pf: tuple[float, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class ExpectedPattern:
    """Simulated readings of the untouched pad.

    Attributes
    ----------
    source : description of the simulation
    untouched_counts : readings without ambient light [emitter][receiver], limited to full scale [counts]
    """

    source: str
    untouched_counts: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class MemoryNote:
    """What the pad keeps of a press after its release, as the simulation assumes it.

    Attributes
    ----------
    residue : share of the press's signal change that is left right after its release [-]
    decay_s : time until half of that is left [s]
    """

    residue: float
    decay_s: float


@dataclass(frozen=True, kw_only=True)
class DriverConfig:
    """Everything that a program needs to read a manufactured unit of one design."""

    format_version: int
    design: str
    digest: str
    optopad: str
    content_sha256: str
    units: Units
    board: BoardSetup
    frame: FrameLayout
    timing: TimingBudget
    workspace: WorkspaceLimits
    surface: SurfaceEntry | None = None
    ambient: AmbientRule
    memory: MemoryNote | None = None
    gain: GainNote
    states: tuple[StateEntry, ...]
    emitters: tuple[EmitterEntry, ...]
    receivers: tuple[ReceiverEntry, ...]
    expected: ExpectedPattern | None = None


def driver_file_of(where: str | os.PathLike[str]) -> Path | None:
    """The driver configuration that a path names: the file itself, or the one in a bundle's folder.

    The path of a design file or the name of a preset gives None. A file is a driver configuration if it has a format
    version; a damaged or missing one is recognised by its name.
    """
    path = Path(where)
    if path.is_dir():
        in_bundle = path / "fabrication" / "driver.toml"
        return in_bundle if in_bundle.is_file() else path / "driver.toml"
    try:
        if path.is_file():
            return path if "format_version" in _document(path) else None
    except InputError:
        pass
    return path if path.name == "driver.toml" else None


def load_driver_config(path: str | os.PathLike[str], *, digest: str | None = None) -> DriverConfig:
    """Read and check a driver configuration.

    Parameters
    ----------
    digest : digest of the required design; if None, any design is accepted

    Raises
    ------
    InputError : the file is missing or damaged, has another format version, or is for another design.
    """
    file = Path(path)
    config = config_from_document(_document(file), where=str(file))
    if digest is not None and config.digest != digest:
        raise InputError(
            f"{file}: belongs to design {config.design} with digest {config.digest[:8]}, needed {digest[:8]}; "
            f"use the bundle of the same design, or {WAY_OUT}"
        )
    return config


def config_from_document(document: dict[str, Any], *, where: str) -> DriverConfig:
    """Make a driver configuration from parsed TOML and check it; `where` is the data's origin for error messages.

    Raises
    ------
    InputError : the data are incomplete, damaged, or of another format version.
    """
    _check_version(document, where)
    try:
        config = record_of(DriverConfig, document)
    except RecordError as err:
        raise InputError(f"{where}: damaged: {err}; {WAY_OUT}") from None
    _check_consistent(config, where)
    if config.content_sha256 != content_sha256(document):
        raise InputError(
            f"{where}: its content does not match its checksum: damaged or changed by hand; change the "
            f"design instead and {WAY_OUT}"
        )
    return config


def content_sha256(document: dict[str, Any]) -> str:
    """SHA-256 of a driver configuration's content, except for the checksum itself; formatting has no influence."""
    content = {key: value for key, value in document.items() if key != CHECKSUM}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _document(file: Path) -> dict[str, Any]:
    text = read_text(
        file, needed="a driver.toml, which `optopad driver config` writes", most_bytes=MOST_BYTES
    )
    try:
        return parsed_toml(text)
    except ValueError as err:
        raise InputError(f"{file}: damaged: not valid TOML: {err}; {WAY_OUT}") from None


def _check_version(document: dict[str, Any], where: str) -> None:
    version = document.get("format_version")
    if version is None:
        raise InputError(f"{where}: no driver configuration: format_version is missing; name a driver.toml")
    if version != FORMAT_VERSION:
        raise InputError(
            f"{where}: format_version: {version!r}, this optopad reads {FORMAT_VERSION}; {WAY_OUT}"
        )


def _check_consistent(config: DriverConfig, where: str) -> None:
    for claim, holds in _claims(config).items():
        if not holds:
            raise InputError(f"{where}: damaged: {claim}; {WAY_OUT}")


def _claims(config: DriverConfig) -> dict[str, bool]:
    frame, lit = config.frame, [emitter.name for emitter in config.emitters]
    names = lit + [receiver.name for receiver in config.receivers]
    between = () if config.ambient.subtract_state is not None else ("",)
    states = [*(name for emitter in lit for name in (*between, emitter)), ""]
    head = frame.magic_bytes + frame.version_bytes + frame.sequence_bytes + frame.time_bytes
    return {
        "design must be a file's name: letters, digits, dots, dashes": bool(
            DESIGN_NAME.fullmatch(config.design) and name_fault(config.design) is None
        ),
        "names, pins and channels must be printable": all(
            text.isprintable() for text in (*names, *(receiver.channel for receiver in config.receivers))
        ),
        "states must be numbered from 0": [s.number for s in config.states] == list(range(frame.states)),
        "each emitter must be lit in turn, with a dark state at the end or before and after each": [
            s.emitter for s in config.states
        ]
        == states,
        "emitters must be in the order of states": [e.state for e in config.emitters]
        == [state for state, emitter in enumerate(states) if emitter],
        "receivers must be in the order of columns": [r.column for r in config.receivers]
        == list(range(frame.receivers)),
        "names must be unique": len(set(names)) == len(names),
        "pins must be unique": len({e.pin for e in config.emitters}) == len(lit),
        "channels must be unique": len({r.channel for r in config.receivers}) == frame.receivers,
        "readings must be states x receivers": frame.readings == frame.states * frame.receivers,
        "readings must fit their bytes": frame.reading_bytes
        == -(-frame.readings * frame.bits_per_reading // 8),
        "the frame's bytes must add up": frame.total_bytes == head + frame.reading_bytes + frame.check_bytes,
        "the last state must be the one subtracted, or none named": config.ambient.subtract_state
        in {None, frame.states - 1},
        "the readings' order must be state, receiver": frame.order == ("state", "receiver"),
        "the expected pattern must be emitters x receivers": config.expected is None
        or [len(row) for row in config.expected.untouched_counts] == [frame.receivers] * len(lit),
    }
