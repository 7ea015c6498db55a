"""A design's electronics, resolved once: board, chips, pins, the path of every part, timing and frame.

`driver.toml`, `config.h`, wiring, schematic, bill and orders are made from this record.

Pins and inputs are as the design lists them, in the order of E1, E2, ... and R1, R2, ...; without a list, they are
assigned in the board's recommended order.

- Shift registers and LED drivers: each is a chain, whose outputs are assigned to the emitters in their order.
- Multiplexers: each is connected to one input. Consecutive receivers are on different multiplexers, and all
  multiplexers share the address lines. After each change of the address, every multiplexer therefore gives one reading.
- Converters: receivers are assigned in blocks. With 8 inputs each, U1 has R1 to R8, and U2 has R9 to R16. Converters
  have separate chip selects and no shared address, so blocks cost no time, and one converter is wired to neighbouring
  receivers.

A frame has one state for each emitter lit alone, and then one with all emitters off. The frame time is a sum: for each
state, the settling time of the light and the conversions of every receiver; then the time to send the packed frame.
With LED drivers, each state begins by sending their data on the SPI bus. With converters, a conversion is a reading on
the bus. The sum is conservative, because the firmware sends one frame while it converts the next. For 9 states, 8
receivers, prescaler 64 and 1 Mbaud the sum is 5.0 ms, and a simulated ATmega2560 needs 4.1 ms
(docs/validation/firmware.md).

The sum includes neither the processor's time for packing, which overlaps with the conversions, nor the longer first
conversion after a reset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from optopad.design.once import once
from optopad.design.parts import catalog
from optopad.design.parts.catalog import Board, CatalogEntries, Converter, LedDriver, Multiplexer
from optopad.design.parts.circuits import EMITTER_CHIPS, RECEIVER_CHIPS, BoardChip, named_chip
from optopad.design.recordings import lit_emitters
from optopad.design.shape.cavity import CavityGeometry, cavity_of
from optopad.design.spec import BoardUse, SensorDesign
from optopad.design.spec.layout import expand
from optopad.design.spec.properties import entries_of

MAGIC_BYTES = 2
VERSION_BYTES = 1
SEQUENCE_BYTES = 4
TIME_BYTES = 4
CHECK_BYTES = 4
"""Length of a frame's check value [bytes], the CRC-32 of all preceding bytes."""
LINE_BITS_PER_BYTE = 10
"""Bits on the serial line for each byte: start bit, 8 data bits, stop bit."""

UART_CLOCKS_PER_BIT = 8
"""Smallest number of clock cycles per bit of an AVR's UART at double speed (U2X); all others are its multiples."""

UART_MAX_DIVISOR = 4096
"""Largest divisor of an AVR's UART, whose register has 12 bits."""

MS_PER_S = 1e3
US_PER_MS = 1e3
US_PER_S = 1e6


def state_count(emitter_count: int, dark: str = "frame") -> int:
    """Number of states in a frame, as in `lit_emitters`."""
    return len(lit_emitters(emitter_count, dark))


def frame_bytes(emitter_count: int, receiver_count: int, adc_bits: int, dark: str = "frame") -> int:
    """Length of a packed frame [bytes]: header, readings packed bit by bit, check value."""
    readings = state_count(emitter_count, dark) * receiver_count
    packed = math.ceil(readings * adc_bits / 8)
    return MAGIC_BYTES + VERSION_BYTES + SEQUENCE_BYTES + TIME_BYTES + packed + CHECK_BYTES


def link_time_ms(byte_count: int, baud: int) -> float:
    """Time to send a number of bytes on the serial line [ms]."""
    return byte_count * LINE_BITS_PER_BYTE / baud * MS_PER_S


def sending_time_ms(board: Board, use: BoardUse, byte_count: int) -> float:
    """Time to send a number of bytes to the host, by native USB or by the serial line [ms]."""
    if board.usb_bytes_per_s is not None:
        return byte_count / board.usb_bytes_per_s * MS_PER_S
    return link_time_ms(byte_count, use.baud)


def baud_divisor(clock_hz: int, baud: int) -> int:
    """Number by which an eighth of an AVR's clock is divided to get the serial rate nearest to `baud`."""
    return min(max(round(clock_hz / (UART_CLOCKS_PER_BIT * baud)), 1), UART_MAX_DIVISOR)


def made_baud(clock_hz: int, baud: int) -> float:
    """Serial rate nearest to the requested one that an AVR's UART can produce [baud]."""
    return clock_hz / (UART_CLOCKS_PER_BIT * baud_divisor(clock_hz, baud))


def baud_error(clock_hz: int, baud: int) -> float:
    """Relative error of an AVR's serial rate [-]; positive if it is too fast."""
    return made_baud(clock_hz, baud) / baud - 1.0


@dataclass(frozen=True, kw_only=True)
class Chips:
    """All chips of one kind in a circuit.

    Attributes
    ----------
    chip_id, entry : identifier and entry in the catalogue
    count : number of chips
    pins : the board's pins that control them, as the design lists them or in the board's order
    given_pins : pins that the design lists; None if it lists none
    """

    chip_id: str
    entry: BoardChip
    count: int
    pins: tuple[int, ...]
    given_pins: tuple[int, ...] | None

    @property
    def names(self) -> tuple[str, ...]:
        """Reference designators of the chips, such as S1 and S2."""
        return tuple(f"{self.entry.letter}{number + 1}" for number in range(self.count))


@dataclass(frozen=True, kw_only=True)
class Path:
    """The connection of one emitter or receiver to the board.

    Attributes
    ----------
    pin : name of the terminal: D22 (digital pin), A0 (analogue input), S1-Q3 (output 3 of shift register S1), L1-Q3
        (of LED driver L1), M1-C3 (channel 3 of multiplexer M1), or U1-C3 (of converter U1)
    number : digital pin, or output along the chain of shift registers or LED drivers; of a receiver, the index of the
        board's analogue input, or of the converter
    channel : name of the board's analogue input; "" without one
    chip, terminal : index of the chip and of its terminal, from 0; None without a chip
    """

    pin: str
    number: int
    channel: str = ""
    chip: int | None = None
    terminal: int | None = None


@dataclass(frozen=True, kw_only=True)
class Adc:
    """The analogue-to-digital converter of the receivers: the board's own, or separate ones.

    Attributes
    ----------
    bits : number of bits in a reading
    full_scale_v : voltage at an input that gives a full-scale reading
    supply_v : supply voltage of the amplifiers, which no reading can exceed
    reference : source and voltage of full scale, in words
    reading_ms : time of one reading
    filter_settles_us : time in which the input filter settles; 0 without a filter
    separate : entry of separate converters; None for the board's own
    """

    bits: int
    full_scale_v: float
    supply_v: float
    reference: str
    reading_ms: float
    filter_settles_us: float = 0.0
    separate: Converter | None = None

    @property
    def full_scale_counts(self) -> float:
        """Largest reading [counts]: full scale, or less if the amplifiers' supply voltage is below it."""
        steps = 2**self.bits
        return float(min(steps - 1, math.floor(steps * self.supply_v / self.full_scale_v)))


def own_adc(board: Board, use: BoardUse) -> Adc:
    """The board's own converter."""
    volts, words = board.full_scale_v, "board supply, taken as " if board.divides_clock else ""
    if use.reference == "internal":
        volts, words = board.internal_reference_v or volts, "internal reference, "
    return Adc(
        bits=board.adc_bits,
        full_scale_v=volts,
        supply_v=board.pin_v,
        reference=f"{words}{volts:g} V",
        reading_ms=conversion_time_ms(board, use.adc_prescaler),
    )


def separate_adc(board: Board, converter: Converter) -> Adc:
    """Separate converters on the bus of a board."""
    volts = converter.full_scale_on(board)
    source = "its supply" if converter.full_scale_v is None else "its own range"
    return Adc(
        bits=converter.bits,
        full_scale_v=volts,
        supply_v=converter.analog_v(board),
        reference=f"{converter.name}, {source}, {volts:g} V",
        reading_ms=converter.reading_us(board) / US_PER_MS,
        filter_settles_us=converter.filter_settles_us,
        separate=converter,
    )


def conversion_time_ms(board: Board, adc_prescaler: int) -> float:
    """Time of one conversion by the board's own converter [ms]; the prescaler matters for AVR chips only."""
    if board.conversion_us is not None:
        return board.conversion_us.value / US_PER_MS
    assert board.adc_clocks_per_conversion is not None, "the entry gives one of the two"
    return board.adc_clocks_per_conversion * adc_prescaler / board.clock_hz * MS_PER_S


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """The electronics of a design with its board, or with another one.

    The pins may be wrong: `optopad.design.circuit.pin_rules` compares them with the board.

    Attributes
    ----------
    use : settings of the board
    emitter_count, receiver_count : number of parts in the layout
    """

    design: SensorDesign
    entries: CatalogEntries
    board: Board
    use: BoardUse
    emitter_count: int
    receiver_count: int

    @classmethod
    def of(cls, design: SensorDesign) -> Circuit:
        """The electronics of a design.

        Raises
        ------
        DesignError : the board or a chip is not in the catalogue.
        """
        return _circuit_of(design)

    @cached_property
    def cavity(self) -> CavityGeometry:
        """The placed emitters and receivers."""
        return cavity_of(self.design)

    @property
    def chips(self) -> tuple[Chips, ...]:
        """All chips between the board and the parts: those of the emitters, then those of the receivers."""
        return (*self.emitter_chips, *self.receiver_chips)

    @cached_property
    def emitter_chips(self) -> tuple[Chips, ...]:
        """Shift registers or LED drivers; empty if each emitter is switched by a pin."""
        given = None if self.use.emitters is None else self.use.emitters.pins
        return tuple(
            self._chips(name, entry, self.emitter_count, given, self.open_pins)
            for name, entry in self._named(EMITTER_CHIPS)
        )

    @cached_property
    def receiver_chips(self) -> tuple[Chips, ...]:
        """Multiplexers or converters; empty if each receiver has an input of the board."""
        use = self.use.receivers
        given = None if use is None else use.select_pins if use.address_pins is None else use.address_pins
        switches = self.switch_pins
        spare = tuple(pin for pin in self.open_pins if pin not in switches)
        return tuple(
            self._chips(name, entry, self.receiver_count, given, spare)
            for name, entry in self._named(RECEIVER_CHIPS)
        )

    def _named(self, kinds: tuple[type[BoardChip], ...]) -> list[tuple[str, BoardChip]]:
        names = ((kind, named_chip(self.use, kind)) for kind in kinds)
        return [
            (name, catalog.find_chip(self.entries, kind, name)) for kind, name in names if name is not None
        ]

    @staticmethod
    def _chips(
        name: str, entry: BoardChip, parts: int, given: tuple[int, ...] | None, free: tuple[int, ...]
    ) -> Chips:
        return Chips(
            chip_id=name,
            entry=entry,
            count=entry.needed(parts),
            pins=given or free[: entry.pin_count(parts)],
            given_pins=given,
        )

    @cached_property
    def spi_pins(self) -> tuple[int, ...]:
        """Pins of the board's SPI bus: clock, data out, data in; empty if no chip uses the bus."""
        named = self._named((*EMITTER_CHIPS, *RECEIVER_CHIPS))
        return self.board.spi_pins if any(entry.uses_bus for _, entry in named) else ()

    @cached_property
    def open_pins(self) -> tuple[int, ...]:
        """Digital pins in recommended order, without those of the SPI bus."""
        return tuple(pin for pin in self.board.digital_pins if pin not in self.spi_pins)

    @property
    def switch_pins(self) -> tuple[int, ...]:
        """The board's pins that switch emitters: one per emitter, or those that control the emitters' chips."""
        for chips in self.emitter_chips:
            return chips.pins
        given = self.use.emitter_pins
        return self.open_pins[: self.emitter_count] if given is None else given

    @property
    def switch_count(self) -> int:
        """Number of pins that are needed to switch the emitters."""
        return (
            sum(chips.entry.pin_count(self.emitter_count) for chips in self.emitter_chips)
            or self.emitter_count
        )

    @property
    def input_count(self) -> int:
        """Number of the board's analogue inputs that the receivers need, directly or through multiplexers."""
        for chips in self.receiver_chips:
            return chips.count if isinstance(chips.entry, Multiplexer) else 0
        return self.receiver_count

    @property
    def channels(self) -> tuple[str, ...]:
        """The board's analogue inputs in the order of the receivers or multiplexers; empty with converters."""
        given = self.use.receiver_channels
        return self.board.analog_channels[: self.input_count] if given is None else given

    @cached_property
    def emitters(self) -> tuple[Path, ...]:
        """The connection of each emitter, in the order of the layout."""
        for chips in self.emitter_chips:
            places = (divmod(number, chips.entry.size) for number in range(self.emitter_count))
            return tuple(
                Path(
                    pin=f"{chips.names[chip]}-{chips.entry.terminal}{output}",
                    number=number,
                    chip=chip,
                    terminal=output,
                )
                for number, (chip, output) in enumerate(places)
            )
        return tuple(Path(pin=f"D{pin}", number=pin) for pin in self.switch_pins)

    @cached_property
    def receivers(self) -> tuple[Path, ...]:
        """The connection of each receiver, in the order of the layout."""
        inputs, index = self.channels, self.board.analog_channels.index
        for chips in self.receiver_chips:
            if isinstance(chips.entry, Multiplexer):
                places = [divmod(j, len(inputs))[::-1] for j in range(self.receiver_count)]
            else:
                places = [divmod(j, chips.entry.size) for j in range(self.receiver_count)]
            return tuple(
                Path(
                    pin=f"{chips.names[chip]}-{chips.entry.terminal}{terminal}",
                    number=index(inputs[chip]) if inputs else chip,
                    channel=inputs[chip] if inputs else "",
                    chip=chip,
                    terminal=terminal,
                )
                for chip, terminal in places
            )
        return tuple(Path(pin=name, number=index(name), channel=name) for name in inputs)

    @cached_property
    def adc(self) -> Adc:
        """The converter of the receivers."""
        for chips in self.receiver_chips:
            if isinstance(chips.entry, Converter):
                return separate_adc(self.board, chips.entry)
        return own_adc(self.board, self.use)

    @property
    def led_driver(self) -> LedDriver | None:
        """Entry of the LED drivers; None if a transistor switches each emitter."""
        return next((one.entry for one in self.emitter_chips if isinstance(one.entry, LedDriver)), None)

    @property
    def address_settle_us(self) -> float:
        """Wait from a new address of the multiplexers to the next reading [us]; 0 without multiplexers."""
        settles = (
            one.entry.settle_us.value for one in self.receiver_chips if isinstance(one.entry, Multiplexer)
        )
        return next(settles, 0.0)

    @property
    def state_count(self) -> int:
        """Number of states in a frame."""
        return state_count(self.emitter_count, self.use.dark)

    @property
    def frame_bytes(self) -> int:
        """Length of a packed frame [bytes]."""
        return frame_bytes(self.emitter_count, self.receiver_count, self.adc.bits, self.use.dark)

    @property
    def switch_ms(self) -> float:
        """Time that the emitters' chips take to switch at the beginning of each state [ms]; 0 without chips."""
        return sum(one.entry.switch_ms(self.emitter_count, self.use.dark) for one in self.emitter_chips)

    @property
    def lit_ms(self) -> float:
        """Time from lighting an emitter until the end of its state [ms]: settling, then all readings."""
        conversions = self.receiver_count * self.use.averages * self.adc.reading_ms
        if self.address_settle_us:
            addresses = math.ceil(self.receiver_count / self.input_count)
            conversions += addresses * self.address_settle_us / US_PER_MS
        return self.use.settle_us / US_PER_MS + conversions

    @property
    def sending_ms(self) -> float:
        """Time to send a frame to the host [ms]."""
        return sending_time_ms(self.board, self.use, self.frame_bytes)

    @property
    def frame_ms(self) -> float:
        """Time of one full frame [ms]: all states, then sending it."""
        return self.state_count * (self.switch_ms + self.lit_ms) + self.sending_ms

    @property
    def frame_rate_hz(self) -> float:
        """Possible frames per second, as the reciprocal of `frame_ms`."""
        return MS_PER_S / self.frame_ms

    def with_use(self, **changes: object) -> Circuit:
        """The circuit with other settings of the board."""
        return replace(self, use=self.use.model_copy(update=changes))

    def on(self, name: str) -> Circuit:
        """The circuit with another board of the catalogue."""
        return replace(self.with_use(kind=name), board=self.entries.boards[name])


@once
def _circuit_of(design: SensorDesign) -> Circuit:
    entries, kinds = entries_of(design), [one.kind for one in expand(design.layout, design.cavity)]
    circuit = Circuit(
        design=design,
        entries=entries,
        board=catalog.find_board(entries, design.board.kind),
        use=design.board,
        emitter_count=kinds.count("emitter"),
        receiver_count=kinds.count("receiver"),
    )
    assert circuit.chips is not None, "raises if a chip is unknown"
    return circuit
