"""Catalogue of parts, elastomers, mold materials, boards and chips: the entries, the packaged files, and look-up.

Every file, packaged or the user's own, has tables such as `parts`, `elastomers`, `mold_materials` and `boards`, each of
which holds its entries by identifier. A part is an emitter or a receiver. The drawing shows a part seen from the
cavity, with its active face flush with the wall:

          body_width_mm                     wall
        +---------------+            |  body_depth_mm |
        |    +-----+    |  ^         +----------------+
        |    |  x  |    |  | body_   |active          |
        |    +-----+    |  | height  |face            |
        |       |       |  | _mm     +----------------+
        +---------------+  v            |  |   leads (radial: down from the base;
                x above the base:       |  |   surface: wires leave through the back)
                active_height_in_body_mm

An emitter's intensity is a power of the cosine that matches its half angle, or its `angular_pattern`. Its light has one
effective wavelength, or a `spectrum`, over which the elastomer's refractive index is averaged. A receiver detects all
light on its active area with equal weight, unless `epoxy_index` gives the medium on the chip. Then light refracts into
this medium, and the angular response follows from the half angle or from `angular_response`.

The catalogue does not include drift with temperature.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from optopad.design.errors import DesignError, shown
from optopad.design.fields.base import Model, PartId, sheet_name_hint
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import (
    CapacitancePf,
    Confidence,
    Cost,
    CurrentMa,
    DarkCurrentNa,
    DensityGPerCm3,
    HalfAngleDeg,
    LengthMm,
    Maker,
    Notes,
    PowerMw,
    Quantity,
    Reflectance,
    RefractiveIndex,
    ResponsivityAPerW,
    Text,
    TimeUs,
    Title,
    VoltageV,
    WavelengthNm,
)
from optopad.design.fields.validation import PATTERN_WORDS
from optopad.design.parts.angular import AngularTable
from optopad.design.parts.assumptions import assumption
from optopad.design.parts.board_firmware import ArduinoProgram, BoardFirmware
from optopad.design.parts.circuits import (
    Amplifier,
    BoardChip,
    Chip,
    Converter,
    LedDriver,
    Multiplexer,
    ShiftRegister,
    Transistor,
)
from optopad.design.parts.elastomer import (
    Cure,
    Elastomer,
    IndexFormula,
    IndexTable,
    ModulusRow,
    refractive_index,
    youngs_modulus_mpa,
)
from optopad.design.parts.skin import ReflectanceTable, Skin
from optopad.design.parts.spectrum import Spectrum

__all__ = [
    "PACKAGED_FILES",
    "Amplifier",
    "Board",
    "BoardChip",
    "CatalogEntries",
    "Chip",
    "Converter",
    "Cost",
    "Cure",
    "Elastomer",
    "IndexFormula",
    "IndexTable",
    "LedDriver",
    "ModulusRow",
    "MoldMaterial",
    "Multiplexer",
    "Part",
    "Quantity",
    "ReflectanceTable",
    "ShiftRegister",
    "Skin",
    "Transistor",
    "find_amplifier",
    "find_board",
    "find_chip",
    "find_elastomer",
    "find_mold_material",
    "find_part",
    "find_skin",
    "find_transistor",
    "merged",
    "packaged",
    "parse_entries",
    "refractive_index",
    "youngs_modulus_mpa",
]

PACKAGED_FILES = (
    "emitters",
    "receivers",
    "elastomers",
    "mold_materials",
    "skins",
    "boards",
    "circuits",
    "electronics",
)

_EMITTER_ONLY = ("wavelength_nm", "forward_voltage_v", "max_current_ma")
_RECEIVER_ONLY = ("responsivity_a_per_w", "responsivity_wavelength_nm", "dark_current_na", "capacitance_pf")
_EMITTER_OPTIONS = ("angular_pattern", "spectrum", "radiant_power_mw")
_RECEIVER_OPTIONS = ("epoxy_index", "angular_response")

Entry = TypeVar("Entry")

UsbId = Annotated[str, Field(pattern=r"^[0-9a-f]{4}:[0-9a-f]{4}$")]
"""Vendor and product identifier of a USB device in hexadecimal digits, such as 2341:0042."""

DEFAULT_BOOT_S = 2.5
"""Default boot time of boards [s]: the longest of the packaged boards."""


class Part(Model):
    """An emitter or a receiver: its optical properties, and the dimensions of its body and leads."""

    unsaid = (*_EMITTER_OPTIONS, *_RECEIVER_OPTIONS, "view", "junction")

    kind: Annotated[Literal["emitter", "receiver"], Field(description="emitter or receiver")]
    title: Title
    manufacturer: Maker
    mounting: Annotated[
        Literal["radial", "surface"],
        Field(
            description="radial: leads leave downward from the base; surface: wires leave through the back"
        ),
    ]
    view: Annotated[
        Literal["top", "side"] | None,
        Field(
            description="top: the light leaves opposite to the leads, as from a round 5 mm LED; side: across them"
        ),
    ] = None
    junction: Annotated[
        Literal["photodiode", "phototransistor"], Field(description="receiver: kind of its junction")
    ] = "photodiode"
    active_width_mm: Annotated[LengthMm, Field(description="emitting or sensitive area, along the wall")]
    active_height_mm: Annotated[LengthMm, Field(description="emitting or sensitive area, upward")]
    half_angle_deg: Annotated[HalfAngleDeg, Field(description="angle at which intensity or response is half")]
    body_width_mm: Annotated[LengthMm, Field(description="body along the wall")]
    body_depth_mm: Annotated[LengthMm, Field(description="body into the wall")]
    body_height_mm: Annotated[LengthMm, Field(description="body upward, without leads")]
    active_height_in_body_mm: Annotated[
        LengthMm, Field(description="centre of the active area above the base")
    ]
    lead_pitch_mm: Annotated[LengthMm, Field(description="distance of neighbouring leads or pads")]
    lead_diameter_mm: Annotated[
        LengthMm, Field(description="diagonal of a square lead; for surface parts, of the wire soldered on")
    ]
    lead_count: Annotated[int, Field(ge=2, le=16, description="leads or wires of the part")]
    lead_setback_mm: Annotated[
        LengthMm | None,
        Field(description="radial: leads behind the active face; default: half the body's depth"),
    ] = None
    wavelength_nm: Annotated[WavelengthNm | None, Field(description="emitter: effective wavelength")] = None
    forward_voltage_v: Annotated[VoltageV | None, Field(description="emitter: at its rated current")] = None
    max_current_ma: Annotated[CurrentMa | None, Field(description="emitter: continuous")] = None
    responsivity_a_per_w: Annotated[ResponsivityAPerW | None, Field(description="receiver")] = None
    responsivity_wavelength_nm: Annotated[
        WavelengthNm | None, Field(description="receiver: wavelength of the responsivity")
    ] = None
    dark_current_na: Annotated[DarkCurrentNa | None, Field(description="receiver: typical")] = None
    capacitance_pf: Annotated[CapacitancePf | None, Field(description="receiver: without bias")] = None
    angular_pattern: Annotated[
        AngularTable | None,
        Field(
            description="emitter: intensity of the data sheet; replaces the power of the cosine by the half angle"
        ),
    ] = None
    spectrum: Annotated[
        Spectrum | None,
        Field(
            description="emitter: the refractive index is averaged over this spectrum instead of taken at wavelength_nm"
        ),
    ] = None
    radiant_power_mw: Annotated[
        PowerMw | None,
        Field(
            description=(
                "emitter: total light at max_current_ma; used for resistors; the verdict needs "
                "it only if gain.feedback_ohm is given in ohms"
            )
        ),
    ] = None
    epoxy_index: Annotated[
        RefractiveIndex | None,
        Field(
            description="receiver: index of the material on the chip, behind a flat face; absent: a bare active area"
        ),
    ] = None
    angular_response: Annotated[
        AngularTable | None,
        Field(
            description="receiver: response of the data sheet in air; replaces the half angle; needs epoxy_index"
        ),
    ] = None
    cost: Annotated[
        Cost | None,
        Field(
            description="price of one component, for the bill of materials and as an objective of a search"
        ),
    ] = None
    notes: Notes = ()

    @model_validator(mode="after")
    def _has_the_fields_of_its_kind(self) -> Self:
        emits = self.kind == "emitter"
        own, other = (_EMITTER_ONLY, _RECEIVER_ONLY) if emits else (_RECEIVER_ONLY, _EMITTER_ONLY)
        others_options = _RECEIVER_OPTIONS if emits else _EMITTER_OPTIONS
        missing = [name for name in own if getattr(self, name) is None]
        foreign = [name for name in (*other, *others_options) if getattr(self, name) is not None]
        if missing:
            raise ValueError(f"kind = {self.kind!r} needs {', '.join(missing)}; add it")
        if foreign:
            raise ValueError(
                f"kind = {self.kind!r} has no {', '.join(foreign)}; remove it or correct the kind"
            )
        return self

    @model_validator(mode="after")
    def _light_meets_the_pad(self) -> Self:
        if self.view == "top" and self.mounting == "radial":
            raise ValueError(
                "mounting = 'radial' with view = 'top': leads that leave downward send its light upward, not into the "
                "pad; lay the part on its side with mounting = 'surface', its length as body_depth_mm"
            )
        return self

    @model_validator(mode="after")
    def _response_can_be_refracted(self) -> Self:
        response = self.angular_response
        if response is not None and self.epoxy_index is None:
            raise ValueError(
                "angular_response needs epoxy_index, into which its angles in air refract; "
                "add it (1.0 for a chip in air)"
            )
        if response is not None and response.relative[0] <= 0.0:
            raise ValueError(
                "angular_response.relative is 0 on the axis, where responsivity is defined; correct it"
            )
        return self

    @model_validator(mode="after")
    def _active_area_lies_on_the_body(self) -> Self:
        centre, half = self.active_height_in_body_mm.value, self.active_height_mm.value / 2
        if self.active_width_mm.value > self.body_width_mm.value:
            raise ValueError(
                f"active_width_mm = {self.active_width_mm.value:g} must be at most "
                f"body_width_mm = {self.body_width_mm.value:g}"
            )
        if centre - half < 0 or centre + half > self.body_height_mm.value:
            raise ValueError(
                f"active_height_in_body_mm = {centre:g}: the area reaches from {centre - half:g} to "
                f"{centre + half:g} mm above the base, must be within 0 to "
                f"body_height_mm = {self.body_height_mm.value:g}"
            )
        if self.lead_diameter_mm.value >= self.lead_pitch_mm.value:
            raise ValueError(
                f"lead_diameter_mm = {self.lead_diameter_mm.value:g} must be below "
                f"lead_pitch_mm = {self.lead_pitch_mm.value:g}"
            )
        return self


class MoldMaterial(Model):
    """Material of the printed mold; the mold's inner faces are the walls that reflect light."""

    unsaid = ("refractive_index",)

    title: Title
    wall_reflectance: Annotated[Reflectance, Field(description="diffuse share of the incident light")]
    density_g_per_cm3: Annotated[DensityGPerCm3, Field(description="density of the printed material")]
    refractive_index: Annotated[
        RefractiveIndex | None,
        Field(description="of the bulk material, for walls with surfaces.wall_finish = 'glossy'"),
    ] = None
    notes: Notes = ()


class Board(Model):
    """A microcontroller board: voltages, analogue-to-digital converter, pins, and link to the host.

    On boards with AVR chips, the converter and the serial line divide the processor's clock. The fields
    `adc_clocks_per_conversion`, `adc_prescalers` and `exact_bauds` apply to these only. Every other board has
    `conversion_us`.
    """

    unsaid = (
        "supply_v",
        "logic_v",
        "adc_reference_v",
        "internal_reference_v",
        "adc_clocks_per_conversion",
        "adc_prescalers",
        "conversion_us",
        "uart_pins",
        "exact_bauds",
        "usb_bytes_per_s",
        "link_number",
        "usb_ids",
        "bridge_usb_ids",
        "boot_s",
        "firmware",
        "arduino",
        "warnings",
    )

    title: Title
    source: Annotated[Text, Field(description="source of the plain numbers of this entry")]
    confidence: Confidence
    clock_hz: Annotated[int, Field(gt=0, le=1000000000, description="clock of the chip")]
    adc_bits: Annotated[int, Field(ge=8, le=24, description="resolution of the converter")]
    supply_v: Annotated[
        float | None,
        Field(
            gt=0.0, le=30.0, description="supply that the board gives the emitters; absent: 5 is assumed [V]"
        ),
    ] = None
    logic_v: Annotated[
        float | None,
        Field(
            ge=1.5,
            le=6.0,
            description="level of the pins and supply of the amplifiers; absent: 5 is assumed [V]",
        ),
    ] = None
    adc_reference_v: Annotated[
        float | None, Field(gt=0.0, le=6.0, description="full scale of the converter; absent: logic_v [V]")
    ] = None
    internal_reference_v: Annotated[
        float | None,
        Field(
            gt=0.0, le=6.0, description="of the converter, for board.reference = 'internal'; absent: none [V]"
        ),
    ] = None
    adc_clocks_per_conversion: Annotated[
        int | None, Field(ge=1, le=1000, description="AVR boards: clock cycles of the converter per reading")
    ] = None
    adc_prescalers: Annotated[
        tuple[int, ...] | None, Field(min_length=1, description="AVR only: ADC clock = clock / prescaler")
    ] = None
    conversion_us: Annotated[
        TimeUs | None, Field(description="not AVR: one reading, with its call in the board's core")
    ] = None
    analog_channels: Annotated[
        tuple[Text, ...], Field(min_length=1, description="names, in recommended order")
    ]
    digital_pins: Annotated[
        tuple[Annotated[int, Field(ge=0, le=200)], ...],
        Field(min_length=1, description="pins that may switch emitters, in recommended order"),
    ]
    reserved_pins: Annotated[tuple[int, ...], Field(description="pins with another job")] = ()
    uart_pins: Annotated[
        tuple[int, int] | None,
        Field(description="receive, transmit of the serial line to the host; absent: on no pins"),
    ] = None
    exact_bauds: Annotated[
        tuple[int, ...], Field(description="AVR only: rates that divide the clock exactly")
    ] = ()
    usb_bytes_per_s: Annotated[
        int | None,
        Field(ge=1000, description="native USB: what the link carries; absent: a serial chip at board.baud"),
    ] = None
    max_pin_current_ma: Annotated[CurrentMa, Field(description="largest current of one pin")]
    max_total_current_ma: Annotated[CurrentMa, Field(description="largest current of all pins together")]
    link_number: Annotated[
        int, Field(ge=0, le=255, description="how the firmware names the board to the host; 0: any other")
    ] = 0
    usb_ids: Annotated[tuple[UsbId, ...], Field(description="vendor:product of the maker's own boards")] = ()
    bridge_usb_ids: Annotated[
        tuple[UsbId, ...], Field(description="serial chips of copies; many other devices have them, too")
    ] = ()
    boot_s: Annotated[
        float, Field(ge=0.0, le=60.0, description="longest time from the port's opening to the sketch")
    ] = DEFAULT_BOOT_S
    firmware: Annotated[
        BoardFirmware | None, Field(description="of an AVR chip: data for the generated program")
    ] = None
    arduino: Annotated[
        ArduinoProgram | None,
        Field(description="of another chip with an Arduino core: what the program needs"),
    ] = None
    warnings: Annotated[
        tuple[Text, ...] | None,
        Field(description="faults of the board that `check` repeats to whoever uses it"),
    ] = None
    notes: Notes = ()

    @property
    def divides_clock(self) -> bool:
        """Whether the converter and the serial line divide the processor's clock, as on AVRs."""
        return self.adc_prescalers is not None

    @property
    def spi_pins(self) -> tuple[int, ...]:
        """Pins of the SPI bus that the portable program drives: clock, data out, data in; empty if there is none."""
        return () if self.arduino is None or self.arduino.spi_pins is None else self.arduino.spi_pins

    @property
    def emitter_v(self) -> float:
        """Supply voltage of the emitters [V]."""
        return _assumed_v() if self.supply_v is None else self.supply_v

    @property
    def pin_v(self) -> float:
        """High level of the pins, which is also the supply voltage of the amplifiers [V]."""
        return _assumed_v() if self.logic_v is None else self.logic_v

    @property
    def full_scale_v(self) -> float:
        """Voltage at an analogue input that gives the largest reading [V]."""
        return self.pin_v if self.adc_reference_v is None else self.adc_reference_v

    @model_validator(mode="after")
    def _has_one_timing(self) -> Self:
        avr = (self.adc_clocks_per_conversion, self.adc_prescalers)
        if self.conversion_us is None:
            if None in avr:
                raise ValueError(
                    "conversion_us is missing; give the time of one reading, or, for an AVR, "
                    "adc_clocks_per_conversion and adc_prescalers"
                )
        elif self.firmware is not None:
            raise ValueError(
                "firmware is the program of AVR boards, whose converter divides the clock; give "
                "adc_clocks_per_conversion and adc_prescalers instead of conversion_us"
            )
        elif avr != (None, None) or self.exact_bauds:
            raise ValueError(
                "conversion_us is of boards that are no AVR, adc_clocks_per_conversion, adc_prescalers and exact_bauds "
                "of AVRs; give one or the other"
            )
        return self

    @model_validator(mode="after")
    def _inputs_bear_their_voltages(self) -> Self:
        if self.full_scale_v > self.pin_v:
            raise ValueError(
                f"adc_reference_v = {self.full_scale_v:g} V is above logic_v = {self.pin_v:g} V, "
                "the most that an input bears; lower it"
            )
        return self

    @model_validator(mode="after")
    def _has_one_program(self) -> Self:
        if self.firmware and self.arduino:
            raise ValueError("firmware, arduino: a board has one of them; remove the other")
        return self

    @model_validator(mode="after")
    def _pins_are_free_and_single(self) -> Self:
        taken = set(self.digital_pins) & (set(self.reserved_pins) | set(self.uart_pins or ()))
        if taken:
            raise ValueError(f"digital_pins: {sorted(taken)} are reserved; remove them from one of the two")
        for name in ("digital_pins", "analog_channels"):
            pins = getattr(self, name)
            if len(set(pins)) != len(pins):
                raise ValueError(f"{name}: each may be listed once, got {list(pins)}")
        for baud in self.exact_bauds:
            if baud <= 0 or self.clock_hz % (8 * baud):
                raise ValueError(f"exact_bauds: {baud} does not divide clock_hz / 8 = {self.clock_hz / 8:g}")
        return self


def _assumed_v() -> float:
    """Supply voltage assumed for a board whose entry does not state it [V]."""
    return assumption("supply_v").value


class CatalogEntries(Model):
    """Catalogue entries by identifier, in the same form for the packaged files and a user's file."""

    unsaid = (
        "multiplexers",
        "shift_registers",
        "converters",
        "led_drivers",
        "amplifiers",
        "transistors",
        "skins",
    )

    parts: dict[PartId, Part] = Field(default_factory=dict)
    elastomers: dict[PartId, Elastomer] = Field(default_factory=dict)
    mold_materials: dict[PartId, MoldMaterial] = Field(default_factory=dict)
    boards: dict[PartId, Board] = Field(default_factory=dict)
    multiplexers: dict[PartId, Multiplexer] = Field(default_factory=dict)
    shift_registers: dict[PartId, ShiftRegister] = Field(default_factory=dict)
    converters: dict[PartId, Converter] = Field(default_factory=dict)
    led_drivers: dict[PartId, LedDriver] = Field(default_factory=dict)
    amplifiers: dict[PartId, Amplifier] = Field(default_factory=dict)
    transistors: dict[PartId, Transistor] = Field(default_factory=dict)
    skins: dict[PartId, Skin] = Field(default_factory=dict)


@cache
def packaged() -> CatalogEntries:
    """All entries of the packaged catalogue."""
    entries = CatalogEntries()
    for name in PACKAGED_FILES:
        entries = merged(entries, parse_entries(data_table(f"{name}.toml"), f"{name}.toml"))
    return entries


def parse_entries(mapping: Mapping[str, Any], where: str) -> CatalogEntries:
    """Make catalogue entries from the nested plain data of a catalogue file.

    Parameters
    ----------
    mapping : tables `parts`, `elastomers`, `mold_materials`, `boards`, `multiplexers`, `shift_registers`,
        `converters`, `led_drivers`, `amplifiers`, `transistors`, `skins`, each {identifier: fields}
    where : name of the file, for messages

    Raises
    ------
    DesignError : invalid fields; the message lists each with its limit.
    """
    try:
        return CatalogEntries.model_validate_json(json.dumps(mapping, default=str), strict=True)
    except ValidationError as err:
        findings = dict.fromkeys(_finding(detail) for detail in err.errors(include_url=False))
        lines = "\n".join(f"  {line}" for line in findings)
        raise DesignError(f"{where}: not a usable catalogue\n{lines}") from None
    except RecursionError:
        raise DesignError(f"{where}: nested too deep to be a catalogue") from None


def identifiers(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Identifiers of all packaged entries and of a design document's own entries, for suggestions in messages."""
    own = document.get("catalog")
    tables = [*dict(packaged()).values(), *(own.values() if isinstance(own, dict) else ())]
    return tuple(name for table in tables if isinstance(table, dict) for name in table)


def merged(base: CatalogEntries, extra: CatalogEntries) -> CatalogEntries:
    """Both sets of entries; where an identifier is in both, `extra` takes precedence."""
    if extra == CatalogEntries():
        return base
    tables = CatalogEntries.model_fields
    return CatalogEntries(**{name: {**getattr(base, name), **getattr(extra, name)} for name in tables})


def find_part(entries: CatalogEntries, part_id: str, kind: Literal["emitter", "receiver"]) -> Part:
    """Find the part with an identifier and a kind.

    Raises
    ------
    DesignError : there is no such part, or it is of the other kind; the message suggests similar parts of the right
        kind.
    """
    of_kind = {name: part for name, part in entries.parts.items() if part.kind == kind}
    if part_id in entries.parts and part_id not in of_kind:
        other = entries.parts[part_id].kind
        raise DesignError(
            f"part {part_id!r} is one of the {other}s, needed as one of the {kind}s; "
            f"known {kind}s: {', '.join(sorted(of_kind)) or 'none'}"
        )
    return _find(of_kind, part_id, kind, "parts")


def find_elastomer(entries: CatalogEntries, elastomer_id: str) -> Elastomer:
    """Find the elastomer with an identifier; DesignError with similar names if there is none."""
    return _find(entries.elastomers, elastomer_id, "elastomer", "elastomers")


def find_mold_material(entries: CatalogEntries, material_id: str) -> MoldMaterial:
    """Find the mold material with an identifier; DesignError with similar names if there is none."""
    return _find(entries.mold_materials, material_id, "mold material", "mold_materials")


def find_board(entries: CatalogEntries, board_id: str) -> Board:
    """Find the board with an identifier; DesignError with similar names if there is none."""
    return _find(entries.boards, board_id, "board", "boards")


def find_chip(entries: CatalogEntries, kind: type[BoardChip], chip_id: str) -> BoardChip:
    """Find the chip of one kind with an identifier; DesignError with similar names if there is none."""
    table: dict[str, BoardChip] = getattr(entries, kind.table)
    return _find(table, chip_id, kind.noun, kind.table)


def find_amplifier(entries: CatalogEntries, amplifier_id: str) -> Amplifier:
    """Find the amplifier with an identifier; DesignError with similar names if there is none."""
    return _find(entries.amplifiers, amplifier_id, "amplifier", "amplifiers")


def find_transistor(entries: CatalogEntries, transistor_id: str) -> Transistor:
    """Find the transistor with an identifier; DesignError with similar names if there is none."""
    return _find(entries.transistors, transistor_id, "transistor", "transistors")


def find_skin(entries: CatalogEntries, skin_id: str) -> Skin:
    """Find the skin with an identifier; DesignError with similar names if there is none."""
    return _find(entries.skins, skin_id, "skin", "skins")


def _find(table: Mapping[str, Entry], name: str, noun: str, section: str) -> Entry:
    if name in table:
        return table[name]
    near = difflib.get_close_matches(name, table, n=3, cutoff=0.4)
    hint = f"did you mean {', '.join(near)}?" if near else f"known: {', '.join(sorted(table)) or 'none'}."
    raise DesignError(
        f"{noun} {name!r} is not in the catalogue; {hint} "
        f'To use your own, add a table [catalog.{section}."{name}"] to the design file'
    )


def _finding(detail: ErrorDetails) -> str:
    field = ".".join(str(key) for key in detail["loc"] if key != "[key]") or "the file"
    match detail["type"]:
        case "missing":
            return f"{field}: is missing; add it"
        case "extra_forbidden":
            hint = sheet_name_hint(field)
            return (
                f"{field}: is not a field of a catalogue entry; {hint or 'remove it or correct its spelling'}"
            )
        case "value_error":
            return f"{field}: {detail['msg'].removeprefix('Value error, ')}"
    message = PATTERN_WORDS.get(detail.get("ctx", {}).get("pattern", ""), "")
    limit = f"must be {message}" if message else detail["msg"][0].lower() + detail["msg"][1:]
    return f"{field}: {shown(detail['input'])} is refused: {limit}"
