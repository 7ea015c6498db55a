"""The compiled firmware on a simulated board: scene out, log in.

An AVR board is simulated by `loop/simulated_board.c`, which runs the image of the chip. The simulator has inputs A0 to
A7; those above are converted by the harness around it, by the same rule, and `not_by_the_simulator` names them.

The program for a board with another Arduino core is compiled for this machine, with `loop/arduino/board.cpp` around it.
`portable_pad` puts a design on such a board.
"""

from __future__ import annotations

import ctypes.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.circuit.circuit import Chips
from optopad.design.circuit.circuit import Path as PinPath
from optopad.design.draft import Draft
from optopad.design.pad import Pad
from optopad.design.parts.board_firmware import BoardFirmware
from optopad.design.parts.catalog import find_board
from optopad.design.parts.circuits import Converter, LedDriver, ShiftRegister
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of
from optopad.fabrication.driver.link.protocol import (
    FrameFormat,
    Hello,
    Kind,
    Scanner,
    SelfTest,
    Unpacked,
    message_lengths,
    unpack_frames,
    unpack_hello,
    unpack_self_test,
)
from optopad.fabrication.flash import COMPILER, compile_elf, has_compiler
from optopad.fabrication.sketch import FirmwareSettings, firmware_settings, write_sketch

LOOP = Path(__file__).parent / "loop"
HARNESS = LOOP / "simulated_board.c"
LAYER = LOOP / "arduino"
PORTABLE_OPTIONS = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-fno-exceptions", "-fno-rtti")
LIBRARIES = ("-lsimavr", "-lelf", "-lm", "-lutil")
SIMULATED_INPUTS = 8
SUPPLY_MV = 5000
FULL_SCALE = 1023
NATIVE_HZ = 1e9
"""The log of a program that was compiled for this machine is in nanoseconds."""

US_PER_S = 1e6
LONGEST_US = 3_600_000_000
"""A board on a port ends by itself after so long."""

LIGHT_TAU_US, AMPLIFIER_TAU_US = 0.5, 2.0
"""A switched LED, and an amplifier of 1 Mohm and 2 pF. After 20 us 0.006 % of a step is left, 0.3 mV of 5 V."""

BYTE_SENT, INPUT_HELD, EMITTER_SWITCHED = range(3)
RECORD = np.dtype([("cycle", "<u8"), ("kind", "<u2"), ("number", "<u2"), ("millivolts", "<i4")])

Say = tuple[float, bytes]
"""When [us], and what."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a simulated board did.

    Attributes
    ----------
    first_input : of the first receiver, as the log names it
    messages : kind, time at which its first byte left [us], and bytes, in order
    skipped_bytes : bytes between them
    log : every byte, conversion and switch by clock cycle
    """

    layout: FrameFormat
    clock_hz: float
    first_input: int
    messages: list[tuple[Kind, float, bytes]]
    skipped_bytes: int
    log: NDArray[Any]

    def of(self, kind: Kind) -> list[bytes]:
        """Messages of one kind."""
        return [message for one, _, message in self.messages if one is kind]

    @property
    def frames(self) -> Unpacked:
        """All frames of readings."""
        return unpack_frames(self.layout, self.of(Kind.READINGS))

    @property
    def hellos(self) -> list[Hello]:
        """All hellos."""
        return [unpack_hello(message) for message in self.of(Kind.HELLO)]

    @property
    def self_tests(self) -> list[SelfTest]:
        """All answers to self-tests."""
        return [unpack_self_test(message) for message in self.of(Kind.SELF_TEST)]

    def times_us(self, kind: Kind) -> FloatArray:
        """When the messages of one kind began to leave, since the reset [us]."""
        return np.array([at for one, at, _ in self.messages if one is kind])

    def first_conversions_us(self) -> FloatArray:
        """When the first emitter's reading of the first receiver was held, since the reset [us]."""
        held = self.log[(self.log["kind"] == INPUT_HELD) & (self.log["number"] == self.first_input)]
        return np.asarray(held["cycle"] / self.clock_hz * US_PER_S)


def missing_compiler() -> str:
    """What compiling the firmware needs and this machine lacks; "" when nothing."""
    if not has_compiler():
        return "avr-gcc is not installed"
    probe = [COMPILER, "-mmcu=atmega2560", "-include", "avr/io.h", "-E", "-x", "c", os.devnull]
    found = subprocess.run(probe, capture_output=True, check=False).returncode == 0
    return "" if found else "avr-libc is not installed"


def missing_native_tools() -> str:
    """What a program for this machine needs and this machine lacks; "" when nothing."""
    if sys.platform != "linux":
        return "the simulated board needs Linux"
    return "" if shutil.which("g++") else "g++ is not installed"


def missing_tools() -> str:
    """What the loop of an AVR board needs and this machine lacks; "" when nothing."""
    if sys.platform != "linux":
        return "the simulated board needs Linux"
    if missing := missing_compiler():
        return missing
    if not shutil.which("gcc") or not Path("/usr/include/simavr/sim_avr.h").is_file():
        return "gcc or libsimavr-dev is not installed"
    return "" if ctypes.util.find_library("elf") else "libelf-dev is not installed"


def build_harness(folder: Path) -> Path:
    """The simulator's program."""
    program = folder / "simulated_board"
    subprocess.run(["gcc", "-O2", "-Wall", "-Werror", "-o", program, HARNESS, *LIBRARIES], check=True)
    return program


def not_by_the_simulator(settings: FirmwareSettings) -> str:
    """A sentence on the receivers whose inputs the simulator lacks; "" when it has all."""
    paths = zip(settings.circuit.cavity.receivers, settings.circuit.receivers, strict=True)
    others = [(part.name, path) for part, path in paths if input_of(settings, path) >= SIMULATED_INPUTS]
    names = ", ".join(f"{name} on {path.channel}" for name, path in others)
    return f"the simulator converts A0 to A7, and the harness around it {names}" if others else ""


def input_of(settings: FirmwareSettings, receiver: PinPath) -> int:
    """An input as the simulated board knows it: the multiplexer's setting, or the pin's number."""
    chip = settings.chip
    if settings.circuit.adc.separate is not None:
        return receiver.number
    if isinstance(chip, BoardFirmware):
        return chip.channel_mux[receiver.channel]
    return FIRST_ANALOG_PIN + int(chip.analog_pins[receiver.channel].removeprefix("A"))


FIRST_ANALOG_PIN = 54
"""A0 of the simulated Arduino core."""


def quantised(table_mv: IntArray, bits: int = 10, full_scale_mv: int = SUPPLY_MV) -> IntArray:
    """Counts of whole millivolts, as the simulated converter makes them."""
    return table_mv * ((1 << bits) - 1) // full_scale_mv


def portable_pad(design: SensorDesign, bits: int = 12) -> SensorDesign:
    """A design on a made-up board with an Arduino core that is no AVR's."""
    mega = find_board(entries_of(design), "arduino-mega-2560").model_dump(mode="json", exclude={"firmware"})
    board = mega | {
        "title": "Test board",
        "clock_hz": 64_000_000,
        "adc_bits": bits,
        "adc_clocks_per_conversion": 128,
        "adc_prescalers": [1],
        "link_number": 77,
        "arduino": {
            "source": "made up",
            "confidence": "unverified",
            "fqbn": "optopad:test:board",
            "core_macro": "ARDUINO_OPTOPAD_TEST",
            "serial": "usb",
            "analog_pins": {name: name for name in mega["analog_channels"]},
            "spi_pins": [52, 51, 50],
            "flash_bytes": 1_000_000,
            "ram_bytes": 100_000,
        },
    }
    chosen = {"board.kind": "my-board", "board.adc_prescaler": 1}
    return design.with_(catalog={"boards": {"my-board": board}}, **chosen)


def random_table(settings: FirmwareSettings, seed: int = 0) -> IntArray:
    """(state, receiver) made-up voltages over the whole range [mV]."""
    shape = settings.circuit.emitter_count + 1, settings.circuit.receiver_count
    return np.random.default_rng(seed).integers(0, SUPPLY_MV, shape)


def light_table_mv(design: SensorDesign) -> IntArray:
    """(state, receiver) voltages of a pressed pad by the light model, at the design's gain, on ambient light [mV]."""
    from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
    from optopad.sims.optics import trace
    from optopad.sims.readings.readout import readout_of

    light = trace(
        Draft.of(design), np.array([[16.0, 16.0, 0.0], [12.0, 20.0, 2.0]]), accuracy="draft", seed=0
    )
    cavity = cavity_of(design)
    readout = readout_of(Draft.of(design), light.flux[0], mask_of(judged_pairs(cavity), cavity))
    ambient_mv = np.full(light.flux.shape[2], 20)
    signal_mv = np.rint(readout.counts(light.flux[1]) / FULL_SCALE * SUPPLY_MV).astype(np.int64)
    return np.vstack([np.minimum(signal_mv + ambient_mv, SUPPLY_MV), ambient_mv])


def scene_text(
    settings: FirmwareSettings,
    table_mv: IntArray,
    said: Sequence[Say] = (),
    *,
    hold_adc_clocks: float = 1.5,
    edges: bool = True,
) -> str:
    """The simulator's scene of a design.

    Parameters
    ----------
    table_mv : (state, receiver) settled voltages, the dark state last [mV]
    said : what the host says, in order
    hold_adc_clocks : from a conversion's start to the moment at which its input is held
    edges : whether a conversion waits for the next edge of the converter's clock, as on a chip; if not, the simulator's
        own converter decides, which starts at once
    """
    lit, dark = table_mv[:-1], table_mv[-1]
    chip, circuit = settings.chip, settings.circuit
    ports = chip.pin_ports if isinstance(chip, BoardFirmware) else [f"D{pin}" for pin in range(256)]
    lines = [
        *([f"mcu {chip.mcu}"] if isinstance(chip, BoardFirmware) else []),
        f"clock {circuit.board.clock_hz}",
        f"supply {SUPPLY_MV}",
        f"baud {circuit.use.baud}",
        f"light_tau_us {LIGHT_TAU_US}",
        f"amplifier_tau_us {AMPLIFIER_TAU_US}",
        f"hold_adc_clocks {hold_adc_clocks}",
        f"edges {int(edges)}",
        *(f"receiver {input_of(settings, one)} {one.terminal or 0}" for one in circuit.receivers),
        *(line for chips in circuit.chips for line in chip_lines(chips, ports)),
        "dark " + " ".join(map(str, dark)),
    ]
    for pin, row in zip(circuit.emitters, lit, strict=True):
        port = f"Q{pin.number}" if circuit.emitter_chips else ports[pin.number]
        lines.append(f"emitter {port[0]} {port[1:]} " + " ".join(map(str, row)))
    return "\n".join([*lines, *(f"say {at_us} {what.hex()}" for at_us, what in said)]) + "\n"


def chip_lines(chips: Chips, ports: Sequence[str]) -> list[str]:
    """The scene's lines of all chips of one kind."""
    match chips.entry:
        case Converter() as entry:
            return [f"converter {entry.commands} {pin}" for pin in chips.pins]
        case LedDriver() as entry:
            return [f"driver {chips.pins[0]} {chips.pins[1]} {chips.count * entry.outputs}"]
        case entry:
            word = "shift" if isinstance(entry, ShiftRegister) else "address"
            return [f"{word} {ports[pin][0]} {ports[pin][1:]}" for pin in chips.pins]


_COMPILED: dict[tuple[str, tuple[str, ...]], bytes] = {}


def elf_of(design: SensorDesign, folder: Path, changes: Sequence[str] = ()) -> Path:
    """The compiled firmware in a folder; each is compiled once."""
    key, elf = (design.digest, tuple(changes)), folder / "image.elf"
    if key not in _COMPILED:
        _COMPILED[key] = compile_elf(firmware_settings(Pad.of(design)), folder, changes).read_bytes()
    elf.write_bytes(_COMPILED[key])
    return elf


def native_program(design: SensorDesign, folder: Path, changes: Sequence[str] = ()) -> Path:
    """The portable program with the simulated board around it, for this machine; each is compiled once."""
    key, program = (design.digest, tuple(changes)), folder / "board"
    if key not in _COMPILED:
        sketch = write_sketch(firmware_settings(Pad.of(design)), folder)
        command = ["g++", "-O1", *PORTABLE_OPTIONS, f"-I{LAYER}", f"-I{sketch}", "-include", "Arduino.h"]
        command += [f"-D{name}" for name in (firmware_settings(Pad.of(design)).chip.core_macro, *changes)]
        sources = [sketch / "core.cpp", "-xc++", sketch / "optopad.ino", LAYER / "board.cpp"]
        subprocess.run([*command, *map(str, sources), "-o", str(program), "-lutil"], check=True)
        _COMPILED[key] = program.read_bytes()
    program.write_bytes(_COMPILED[key])
    program.chmod(0o755)
    return program


def harness_name(design: SensorDesign) -> str:
    """The fixture with the simulator of a design's board; it skips where a tool is missing."""
    is_avr = isinstance(firmware_settings(Pad.of(design)).chip, BoardFirmware)
    return "board_harness" if is_avr else "native_harness"


def program_of(
    harness: Path | None, design: SensorDesign, folder: Path, changes: Sequence[str] = ()
) -> list[str]:
    """What is run for the board of a design.

    Parameters
    ----------
    harness : the simulator of AVR boards; None for another
    """
    if harness is None:
        return [str(native_program(design, folder, changes))]
    return [str(harness), str(elf_of(design, folder, changes))]


def simulate(
    harness: Path | None,
    folder: Path,
    design: SensorDesign,
    table_mv: IntArray,
    said: Sequence[Say],
    *,
    duration_us: float,
    changes: Sequence[str] = (),
    hold_adc_clocks: float = 1.5,
    edges: bool = True,
) -> Run:
    """Compile a design's firmware, run it, and read its line.

    Parameters
    ----------
    changes : definitions in place of those in config.h
    """
    return run_program(
        program_of(harness, design, folder, changes),
        folder,
        firmware_settings(Pad.of(design)),
        table_mv,
        said,
        duration_us=duration_us,
        hold_adc_clocks=hold_adc_clocks,
        edges=edges,
    )


def run_program(
    program: Sequence[str],
    folder: Path,
    settings: FirmwareSettings,
    table_mv: IntArray,
    said: Sequence[Say],
    *,
    duration_us: float,
    hold_adc_clocks: float = 1.5,
    edges: bool = True,
) -> Run:
    """Run a compiled program, with scene and log in a folder, and read its line."""
    scene, log = folder / "scene", folder / "log"
    text = scene_text(settings, table_mv, said, hold_adc_clocks=hold_adc_clocks, edges=edges)
    scene.write_text(text, encoding="ascii")
    command = [*program, str(scene), str(log), str(duration_us)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return read_log(settings, np.fromfile(log, RECORD))


@contextmanager
def board_on_a_port(
    harness: Path | None, folder: Path, design: SensorDesign, table_mv: IntArray
) -> Iterator[str]:
    """A simulated board on a pseudo-terminal, no faster than real time; the name of the port."""
    program, scene = program_of(harness, design, folder), folder / "scene"
    scene.write_text(scene_text(firmware_settings(Pad.of(design)), table_mv), encoding="ascii")
    command = [*program, str(scene), os.devnull, str(LONGEST_US), "pty"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        lines = iter(board.stdout.readline, "")  # the simulator says first what it loads
        try:
            yield next(line.strip() for line in lines if line.startswith("/dev/"))
        finally:
            board.kill()


def read_log(settings: FirmwareSettings, log: NDArray[Any]) -> Run:
    """Messages out of the bytes of a log."""
    circuit = settings.circuit
    layout = FrameFormat(
        emitters=circuit.emitter_count,
        receivers=circuit.receiver_count,
        bits=circuit.adc.bits,
        dark=circuit.use.dark,
    )
    sent = log[log["kind"] == BYTE_SENT]
    stream = sent["number"].astype(np.uint8).tobytes()
    clock_hz = circuit.board.clock_hz if isinstance(settings.chip, BoardFirmware) else NATIVE_HZ
    scanner = Scanner(message_lengths(layout))
    at, messages = 0, []
    for version_and_kind, message in scanner.feed(stream):
        at = stream.index(message, at)
        left_us = sent["cycle"][at] / clock_hz * US_PER_S
        messages.append((Kind(version_and_kind & 0x0F), float(left_us), message))
        at += len(message)
    return Run(
        layout=layout,
        clock_hz=clock_hz,
        first_input=input_of(settings, circuit.receivers[0]),
        messages=messages,
        skipped_bytes=scanner.skipped_bytes,
        log=log,
    )
