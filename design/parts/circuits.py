"""Circuits between a board and the sensor's parts: entries of the catalogue's `circuits.toml`.

Multiplexers and shift registers extend the board's inputs and pins. Converters and LED drivers are on the board's SPI
bus; converters replace the board's own converter, and LED drivers replace the emitters' transistors and resistors.

Chips of one family share pins and commands (`chip_families.toml`). An entry of a known family needs no code. A family
with other commands needs its file in the firmware's sources.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol, Self

from pydantic import Field, model_validator

from optopad.design.fields.base import Model
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import (
    BiasCurrentPa,
    Confidence,
    CurrentMa,
    FrequencyKhz,
    FrequencyMhz,
    Notes,
    OutputMarginMv,
    ResistanceOhm,
    SlewVPerUs,
    Text,
    TimeUs,
    Title,
    VoltageV,
)
from optopad.design.recordings import lit_emitters

HZ_PER_MHZ = 1e6
KHZ_PER_MHZ = 1e3
US_PER_MS = 1e3
MS_PER_S = 1e3
EDGE_US = 1.0
"""Wait of the firmware after each edge on the control pins of shift registers and LED drivers [us]."""
DRIVER_EDGES = 4
"""Edges on latch and blank of the LED drivers in each state."""


class Voltages(Protocol):
    """The two supply voltages of a board: for its pins, and for the emitters."""

    @property
    def pin_v(self) -> float:
        """High level of the pins [V]."""

    @property
    def emitter_v(self) -> float:
        """Supply voltage of the emitters [V]."""


class Chip(Model):
    """A circuit between the board and the sensor's parts, supplied at the level of the board's pins."""

    title: Title
    source: Annotated[Text, Field(description="where the plain numbers of this entry come from")]
    confidence: Confidence
    supply_low_v: Annotated[float, Field(gt=0.0, le=30.0, description="least supply [V]")]
    supply_high_v: Annotated[float, Field(gt=0.0, le=30.0, description="most supply [V]")]
    notes: Notes = ()

    @property
    def name(self) -> str:
        """The title up to its first comma, such as 74HC4067."""
        return self.title.split(",")[0]

    def works_on(self, board: Voltages) -> bool:
        """Whether the chip can be supplied at the level of the board's pins."""
        return self.supply_low_v <= board.pin_v <= self.supply_high_v


class Family(Model):
    """Table of the catalogue and pins of a family of chips, and the frames of a converter's readings."""

    table: str
    left: tuple[tuple[str, str], ...]
    right: tuple[tuple[str, str], ...]
    chain: tuple[str, str] = ("", "")
    below: tuple[str, ...] = ()
    first_below: tuple[str, ...] = ()
    components: tuple[tuple[str, str, str, str, str], ...] = ()
    clocks: int = 0
    frames: int = 1
    bits: int = 0
    inputs: int = 0
    needs: tuple[str, ...] = ()
    example: str = ""

    def pin_at(self, net: str) -> str:
        """Name of the first pin that is connected to a net."""
        return next(pin for pin, its in (*self.left, *self.right) if its == net)


@cache
def families() -> dict[str, Family]:
    """All families of chips, by name."""
    return {name: Family(**table) for name, table in data_table("chip_families.toml").items()}


if TYPE_CHECKING:
    ConverterFamily = str
    DriverFamily = str
else:
    ConverterFamily, DriverFamily = (
        Literal[tuple(name for name, family in families().items() if family.table == table)]
        for table in ("converters", "led_drivers")
    )


class BoardChip(Chip):
    """A chip between the board and the emitters or receivers, of which a design has as many as it needs.

    Attributes
    ----------
    table : table of the catalogue
    noun : what the chips are called in messages
    field : field of a design that names an entry
    pins_field : field of a design with the board's pins that control the chips
    controls : purposes of these pins
    letter, terminal : first letters of the names of chips and of their terminals, as in S1-Q3
    size_field : field with the number of emitters or receivers that one chip serves
    uses_bus : whether the chips are on the board's SPI bus
    """

    table: ClassVar[str]
    noun: ClassVar[str]
    field: ClassVar[str]
    pins_field: ClassVar[str]
    controls: ClassVar[str]
    letter: ClassVar[str]
    terminal: ClassVar[str]
    size_field: ClassVar[str]
    uses_bus: ClassVar[bool] = False

    @property
    def size(self) -> int:
        """Number of emitters or receivers that one chip serves."""
        return int(getattr(self, self.size_field))

    @property
    def family_name(self) -> str:
        """Name of the family of chips, with the same pins and commands."""
        return str(getattr(self, "commands", self.noun.replace(" ", "_")))

    @property
    def family(self) -> Family:
        """Pins and commands of the chip."""
        return families()[self.family_name]

    @property
    def own_ma(self) -> float:
        """Supply current of one chip that is counted [mA]."""
        return 0.0

    def needed(self, count: int) -> int:
        """Number of chips for this many emitters or receivers."""
        return math.ceil(count / self.size)

    def pin_count(self, count: int) -> int:
        """Number of the board's pins that control the chips for this many emitters or receivers."""
        raise NotImplementedError

    def switch_ms(self, emitter_count: int, dark: str) -> float:
        """Mean time in which emitters' chips switch from one state of a frame to the next [ms].

        Parameters
        ----------
        dark : ``frame`` or ``each``, as in `optopad.design.recordings.lit_emitters`
        """
        raise NotImplementedError

    def supply_fault(self, board: Voltages) -> tuple[str, str, str, str]:
        """What is wrong if the chip does not work on a board: meaning, value, limit and way out."""
        return (
            f"{self.name} does not work at the level of the board's pins",
            f"{board.pin_v:g} V",
            f"{self.supply_low_v:g} to {self.supply_high_v:g} V",
            "choose another one, or another board.kind",
        )


class Multiplexer(BoardChip):
    """Analogue switches that connect one of several amplifiers to an input of the board, chosen by address lines."""

    table = "multiplexers"
    noun = "multiplexer"
    field = "board.receivers.multiplexer"
    pins_field = "board.receivers.address_pins"
    controls = "address"
    letter = "M"
    terminal = "C"
    size_field = "channels"

    channels: Annotated[int, Field(ge=2, le=64, description="amplifiers that it chooses from")]
    enable: Annotated[
        Literal["ground", "supply"], Field(description="what its enable pin is wired to, so that it stays on")
    ]
    on_resistance_ohm: Annotated[ResistanceOhm, Field(description="of a closed switch")]
    settle_us: Annotated[TimeUs, Field(description="wait from a new address to the next reading")]

    @property
    def address_bits(self) -> int:
        """Number of address lines."""
        return (self.channels - 1).bit_length()

    def pin_count(self, _: int) -> int:
        """Number of address lines, which all multiplexers share."""
        return self.address_bits


class ShiftRegister(BoardChip):
    """Outputs in a chain, set by three pins: data, clock and latch; one output switches one emitter's transistor."""

    table = "shift_registers"
    noun = "shift register"
    field = "board.emitters.shift_register"
    pins_field = "board.emitters.pins"
    controls = "data, clock and latch"
    letter = "S"
    terminal = "Q"
    size_field = "outputs"

    outputs: Annotated[int, Field(ge=2, le=64, description="outputs of one of them")]
    max_output_ma: Annotated[CurrentMa, Field(description="of one output")]

    def pin_count(self, _: int) -> int:
        """Data, clock and latch of the chain."""
        return 3

    def switch_ms(self, emitter_count: int, dark: str) -> float:
        """Mean time to switch from one state of a frame to the next [ms]; see `switch_us`."""
        return self.switch_us(emitter_count, dark) / US_PER_MS

    def switch_us(self, emitter_count: int, dark: str) -> float:
        """Mean time to switch from one state of a frame to the next [us]; AVR boards need less.

        One clock pulse shifts the lit output by one, to the next emitter or out past the last one. To light any other
        emitter, a new bit is clocked in. For any other dark state, zeros are clocked into the whole chain. The latch
        needs one more pulse.

        Parameters
        ----------
        dark : ``frame`` or ``each``, as in `optopad.design.recordings.lit_emitters`
        """
        states, lit, edges = lit_emitters(emitter_count, dark), emitter_count, 0
        for emitter in states:
            now = emitter_count if emitter is None else emitter
            moves, all_bits = now == lit + 1, self.needed(emitter_count) * self.outputs
            clocks = 1 if moves else all_bits if emitter is None else now + 1
            data_edges = 1 if moves or emitter is None else 2
            edges += data_edges + 2 * (clocks + 1)
            lit = now
        return EDGE_US * edges / len(states)


FIVE_V = 4.75
"""Lowest supply that counts as 5 V, which is 5 V less its usual tolerance [V]."""


class Converter(BoardChip):
    """Converter on the board's SPI bus that reads receivers in place of the board's own; each has its own chip select.

    The chip is supplied at the level of the board's pins. If it has separate digital and analogue supplies, the digital
    one is at this level, and the analogue one is the emitters' supply. The amplifiers share the analogue supply.
    """

    unsaid = ("logic_low_v", "logic_high_v", "full_scale_v", "range_code", "clock_5v_mhz", "input_filter_khz")

    table = "converters"
    noun = "converter"
    field = "board.receivers.converter"
    pins_field = "board.receivers.select_pins"
    controls = "chip selects"
    letter = "U"
    terminal = "C"
    size_field = "channels"
    uses_bus = True

    channels: Annotated[int, Field(ge=1, le=64, description="inputs, as many as its commands can name")]
    bits: Annotated[int, Field(ge=8, le=16, description="of one reading")]
    commands: Annotated[
        ConverterFamily, Field(description="chip whose commands and frames the firmware sends")
    ]
    spi_mode: Annotated[int, Field(ge=0, le=3, description="polarity and phase of the bus's clock")]
    clock_mhz: Annotated[
        FrequencyMhz, Field(description="fastest clock of the bus at every permitted supply")
    ]
    clock_5v_mhz: Annotated[
        FrequencyMhz | None, Field(description="fastest clock at a supply of 5 V; absent: clock_mhz")
    ] = None
    supply_ma: Annotated[CurrentMa, Field(description="its own current, while it converts")]
    gap_us: Annotated[TimeUs, Field(description="chip select high between two readings")]
    call_us: Annotated[TimeUs, Field(description="calls in the board's core for one reading")]
    logic_low_v: Annotated[
        float | None,
        Field(
            gt=0.0, le=30.0, description="least digital supply, if that is separate; absent: one supply [V]"
        ),
    ] = None
    logic_high_v: Annotated[float | None, Field(gt=0.0, le=30.0, description="most digital supply [V]")] = (
        None
    )
    full_scale_v: Annotated[
        float | None, Field(gt=0.0, le=30.0, description="full scale; absent: the analogue supply [V]")
    ] = None
    range_code: Annotated[
        int | None, Field(ge=0, le=15, description="ads8688: code of the range from 0 to full_scale_v")
    ] = None
    input_filter_khz: Annotated[
        FrequencyKhz | None, Field(description="second-order low-pass filter of its inputs; absent: none")
    ] = None

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if (self.logic_low_v is None) != (self.logic_high_v is None):
            raise ValueError("logic_low_v and logic_high_v: give both, or neither for a chip of one supply")
        family = self.family
        if self.bits != family.bits:
            raise ValueError(
                f"bits = {self.bits}: the frames of {self.commands} have {family.bits} bits; set bits = {family.bits}"
            )
        if self.channels > family.inputs:
            raise ValueError(
                f"channels = {self.channels}: must be at most {family.inputs}, the inputs that commands of "
                f"{self.commands} can name"
            )
        if any(getattr(self, name) is None for name in family.needs):
            needed = " and ".join(family.needs)
            raise ValueError(f"commands = '{self.commands}' needs {needed}; give both, as {family.example}")
        return self

    @property
    def own_ma(self) -> float:
        """Supply current of one converter [mA]."""
        return self.supply_ma.value

    def pin_count(self, count: int) -> int:
        """Chip selects: one for each converter."""
        return self.needed(count)

    @property
    def has_own_logic(self) -> bool:
        """Whether the digital supply is separate from the analogue one."""
        return self.logic_low_v is not None

    def works_on(self, board: Voltages) -> bool:
        """Whether the board has supplies that suit the converter."""
        if self.logic_low_v is None or self.logic_high_v is None:
            return super().works_on(board)
        logic = self.logic_low_v <= board.pin_v <= self.logic_high_v
        return logic and self.supply_low_v <= board.emitter_v <= self.supply_high_v

    def analog_v(self, board: Voltages) -> float:
        """Analogue supply of the converter, and supply of the amplifiers [V]."""
        return board.emitter_v if self.has_own_logic else board.pin_v

    def full_scale_on(self, board: Voltages) -> float:
        """Input voltage that gives a full-scale reading [V]."""
        return self.analog_v(board) if self.full_scale_v is None else self.full_scale_v

    def clock_hz(self, board: Voltages) -> int:
        """Clock of the bus [Hz]."""
        fast = self.clock_5v_mhz if self.analog_v(board) >= FIVE_V else None
        return round((fast or self.clock_mhz).value * HZ_PER_MHZ)

    def reading_us(self, board: Voltages) -> float:
        """Time of one reading [us]: clock cycles, the gap in whole microseconds, and the core's function calls."""
        family = self.family
        clocks_us = family.clocks / self.clock_hz(board) * HZ_PER_MHZ
        return clocks_us + family.frames * math.ceil(self.gap_us.value) + family.frames * self.call_us.value

    @property
    def filter_settles_us(self) -> float:
        """Time in which the input filter (Butterworth) settles to half a count of full scale [us]; 0 without one.

        Notes
        -----
        The error of its step response decays with the envelope exp(-w t / sqrt 2), w = 2 pi f.
        """
        if self.input_filter_khz is None:
            return 0.0
        per_us = 2 * math.pi * self.input_filter_khz.value / KHZ_PER_MHZ
        return math.sqrt(2.0) * math.log(2 ** (self.bits + 1)) / per_us

    def supply_fault(self, board: Voltages) -> tuple[str, str, str, str]:
        """What is wrong if the converter does not work on a board: meaning, value, limit and way out."""
        supply = f"{self.supply_low_v:g} to {self.supply_high_v:g} V"
        if not self.has_own_logic:
            return (
                f"{self.name} has one supply, and its data output is at the level of that supply, which a pin of the "
                "board does not bear",
                f"pins of {board.pin_v:g} V",
                supply,
                "name a converter that works at the level of the pins, as mcp3208 at 2.7 to 5.5 V, or one "
                "with a digital supply of its own, as ads8688",
            )
        return (
            f"{self.name} has its analogue supply from the emitters' supply and its digital supply at the level of the "
            "board's pins",
            f"{board.emitter_v:g} V and {board.pin_v:g} V",
            f"{supply} and {self.logic_low_v:g} to {self.logic_high_v:g} V",
            "name another converter, as mcp3208, or another board.kind",
        )


class LedDriver(BoardChip):
    """Constant-current outputs in a chain on the board's SPI bus; they replace the emitters' transistors and resistors.

    A resistor at its reference pin sets one current for all of its outputs. The data of an output are its grayscale:
    the share of a PWM period in which it is on.
    """

    unsaid = ("commands",)

    table = "led_drivers"
    noun = "LED driver"
    field = "board.emitters.driver"
    pins_field = "board.emitters.pins"
    controls = "latch and blank"
    letter = "L"
    terminal = "Q"
    size_field = "outputs"
    uses_bus = True

    commands: Annotated[DriverFamily, Field(description="chip whose data the firmware sends")] = "tlc5947"
    outputs: Annotated[int, Field(ge=1, le=64, description="outputs of one of them")]
    grayscale_bits: Annotated[int, Field(ge=1, le=16, description="data of one output")]
    least_output_ma: Annotated[CurrentMa, Field(description="least current of one output")]
    max_output_ma: Annotated[CurrentMa, Field(description="most current of one output")]
    supply_ma: Annotated[CurrentMa, Field(description="its own current, without the emitters'")]
    current_ratio: Annotated[
        float,
        Field(gt=0.0, le=1e4, description="output's current over the current through the reference resistor"),
    ]
    reference_v: Annotated[float, Field(gt=0.0, le=5.0, description="at the reference resistor [V]")]
    dropout_v: Annotated[VoltageV, Field(description="least voltage at an output that is on")]
    max_led_v: Annotated[float, Field(gt=0.0, le=100.0, description="most supply of the emitters [V]")]
    clock_mhz: Annotated[FrequencyMhz, Field(description="fastest clock of the bus to one of them")]
    chain_clock_mhz: Annotated[FrequencyMhz, Field(description="fastest clock of the bus to a chain")]
    turn_on_us: Annotated[TimeUs, Field(description="from the end of blanking until the outputs are on")]
    pwm_period_us: Annotated[
        TimeUs, Field(description="period of the grayscale, at whose end every output is off for one step")
    ]

    @property
    def own_ma(self) -> float:
        """Supply current of one driver [mA]."""
        return self.supply_ma.value

    def pin_count(self, _: int) -> int:
        """Latch and blank of the chain."""
        return 2

    def switch_ms(self, emitter_count: int, _: str) -> float:
        """Time to send the data of all outputs, latch them, and light an emitter [ms]."""
        sent_ms = self.bits(emitter_count) / self.clock_hz(emitter_count) * MS_PER_S
        return sent_ms + (DRIVER_EDGES * EDGE_US + self.turn_on_wait_us) / US_PER_MS

    def bits(self, emitter_count: int) -> int:
        """Number of bits that are sent through the chain to change which emitters are lit."""
        return self.needed(emitter_count) * self.outputs * self.grayscale_bits

    def clock_hz(self, emitter_count: int) -> int:
        """Clock of the bus [Hz]."""
        clock = self.clock_mhz if self.needed(emitter_count) == 1 else self.chain_clock_mhz
        return round(clock.value * HZ_PER_MHZ)

    @property
    def turn_on_wait_us(self) -> int:
        """Time that the firmware waits after blanking [us]: the longest time until the outputs are on."""
        return math.ceil(self.turn_on_us.value if self.turn_on_us.high is None else self.turn_on_us.high)

    @property
    def least_period_us(self) -> float:
        """Shortest PWM period [us]."""
        return self.pwm_period_us.value if self.pwm_period_us.low is None else self.pwm_period_us.low


EMITTER_CHIPS: tuple[type[BoardChip], ...] = (ShiftRegister, LedDriver)
RECEIVER_CHIPS: tuple[type[BoardChip], ...] = (Multiplexer, Converter)


def named_chip(use: object, kind: type[BoardChip]) -> str | None:
    """Identifier of the chips of one kind in a design's table `board`; None if the design has none."""
    _, side, key = kind.field.split(".")
    return getattr(getattr(use, side), key, None)


class Amplifier(Chip):
    """A package of operational amplifiers with one supply; each amplifier serves one receiver."""

    channels: Annotated[int, Field(ge=1, le=8, description="amplifiers in one package")]
    bandwidth_mhz: Annotated[FrequencyMhz, Field(description="gain-bandwidth product, typical")]
    slew_v_per_us: Annotated[SlewVPerUs, Field(description="slew rate, typical")]
    bias_current_pa: Annotated[
        BiasCurrentPa,
        Field(description="input bias current; its high end is compared with a count's current"),
    ]
    output_margin_mv: Annotated[OutputMarginMv, Field(description="supply less the largest output voltage")]
    supply_ma: Annotated[CurrentMa, Field(description="supply current of one amplifier")]

    @property
    def most_bias_pa(self) -> float:
        """Upper end of the input bias current [pA]."""
        bias = self.bias_current_pa
        return bias.value if bias.high is None else bias.high

    def needed(self, receiver_count: int) -> int:
        """Number of packages for this many receivers."""
        return math.ceil(receiver_count / self.channels)


class Transistor(Model):
    """A bipolar NPN transistor that switches one emitter."""

    title: Title
    source: Annotated[Text, Field(description="where the plain numbers of this entry come from")]
    confidence: Confidence
    saturation_ma: Annotated[
        CurrentMa,
        Field(description="most collector current with stated saturation at a base current of a tenth"),
    ]
    most_collector_v: Annotated[float, Field(gt=0.0, le=1000.0, description="most collector voltage [V]")]
    notes: Notes = ()

    @property
    def name(self) -> str:
        """The title up to its first comma, such as 2N3904."""
        return self.title.split(",")[0]
