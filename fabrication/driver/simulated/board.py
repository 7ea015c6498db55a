"""A simulated board, which sends the firmware's messages for a pad with simulated light.

The board supports the full protocol: a hello (its identification) at the reset and once per second until it is started,
frames at the requested interval, and replies between frames. A reading is the sum of a signal from the press table, an
ambient level and noise, rounded and limited as by the converter. The board takes bytes and times and returns bytes;
`port.FakePort` connects it to a port.

If the driver configuration has a memory, the last press stays in the signals at its place, as in
`optopad.sims.readings.signal_chain`. The press is followed from one reading of the signals to the next. Of two fingers,
the deeper one decides: what stays is the change of both when it was deepest, after both are lifted.

Settling of LED and amplifier, drift and baud rate are not simulated; the frame rate is limited only by the timing
budget.

The board can show faults of a unit, which `optopad driver check` must find:

    swap:E1,E2        wires of two emitters exchanged; swap:R1,R2 wires of two receivers
    dead:E3, dead:R4  a part without any signal
    saturated:R5      an amplifier that stays at full scale
    dim:E2            a part with a fifth of its signal
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.design.recordings import kept_share
from optopad.fabrication.driver.link.protocol import (
    COMMAND_BYTES,
    COMMAND_MAGIC,
    VERSION,
    Command,
    Hello,
    Scanner,
    SelfTest,
    frame_format,
    pack_frames,
    pack_hello,
    pack_self_test,
    unpack_command,
)
from optopad.fabrication.driver.simulated.finger import NO_FINGER, Finger
from optopad.fabrication.driver.simulated.press_table import SignalTable
from optopad.fabrication.driver_file import DriverConfig, MemoryNote

DIM_SHARE = 0.2
KINDS = ("swap", "dead", "saturated", "dim")


@dataclass(frozen=True, kw_only=True)
class Faults:
    """Effect of a simulated unit's faults on its signals.

    Attributes
    ----------
    emitter_of_pin : for each emitter pin, the index of the emitter that is connected to it
    receiver_of_channel : for each channel, the index of the receiver that is connected to it
    emitter_share, receiver_share : for each part, the fraction of its signal that remains [-]
    is_saturated : for each channel, whether it stays at full scale
    """

    emitter_of_pin: NDArray[np.intp]
    receiver_of_channel: NDArray[np.intp]
    emitter_share: FloatArray
    receiver_share: FloatArray
    is_saturated: BoolArray

    def applied(self, signals: FloatArray) -> FloatArray:
        """Signals of the faulty unit from `signals` without faults, both of shape (..., emitters, receivers) [counts].

        The axes of the result are emitter pins and channels.
        """
        left = signals * self.emitter_share[:, None] * self.receiver_share
        found: FloatArray = left[..., self.emitter_of_pin, :][..., self.receiver_of_channel]
        return found


@dataclass
class _Draft:
    emitters: list[int]
    receivers: list[int]
    shares: dict[str, float] = field(default_factory=dict)
    saturated: set[str] = field(default_factory=set)


def faults_of(config: DriverConfig, texts: Iterable[str] = ()) -> Faults:
    """Parse faults from texts such as `swap:E1,E2` (types of faults: swap, dead, saturated, dim).

    Raises
    ------
    InputError : a fault's type or part is unknown, or a fault has the wrong number of parts.
    """
    names = {"E": [e.name for e in config.emitters], "R": [r.name for r in config.receivers]}
    draft = _Draft(emitters=list(range(len(names["E"]))), receivers=list(range(len(names["R"]))))
    for text in texts:
        _add(draft, names, text)
    return Faults(
        emitter_of_pin=np.array(draft.emitters),
        receiver_of_channel=np.array(draft.receivers),
        emitter_share=np.array([draft.shares.get(name, 1.0) for name in names["E"]]),
        receiver_share=np.array([draft.shares.get(name, 1.0) for name in names["R"]]),
        is_saturated=np.array([name in draft.saturated for name in names["R"]]),
    )


def _add(draft: _Draft, names: dict[str, list[str]], text: str) -> None:
    kind, _, listed = text.partition(":")
    parts = [part.strip() for part in listed.split(",") if part.strip()]
    known = [*names["E"], *names["R"]]
    strange = [part for part in parts if part not in known]
    if kind not in KINDS or strange or len(parts) != (2 if kind == "swap" else 1):
        raise InputError(
            f"fault {text!r} is refused{': no ' + strange[0] if strange else ''}; write swap:E1,E2, dead:E3, "
            f"dim:E3 or saturated:R5, with parts {known[0]} to {names['E'][-1]} and {names['R'][0]} to {known[-1]}"
        )
    if kind == "swap":
        _swap(draft, names, *parts)
    elif kind == "saturated":
        if parts[0] not in names["R"]:
            raise InputError(f"fault {text!r} is refused: a receiver's amplifier saturates, as saturated:R1")
        draft.saturated.add(parts[0])
    else:
        draft.shares[parts[0]] = 0.0 if kind == "dead" else DIM_SHARE


def _swap(draft: _Draft, names: dict[str, list[str]], one: str, other: str) -> None:
    is_emitter = [part in names["E"] for part in (one, other)]
    if is_emitter[0] != is_emitter[1] or one == other:
        raise InputError(f"fault 'swap:{one},{other}' is refused: name two emitters or two receivers")
    table, row = (draft.emitters, names["E"]) if is_emitter[0] else (draft.receivers, names["R"])
    a, b = row.index(one), row.index(other)
    table[a], table[b] = table[b], table[a]


class PadMemory:
    """What the last press on a simulated pad has left in its signals.

    Parameters
    ----------
    note : residue and decay from the driver configuration
    untouched : signals of the untouched pad, shape (emitters, receivers) [counts]
    """

    def __init__(self, note: MemoryNote, untouched: FloatArray) -> None:
        self._note, self._untouched = note, untouched
        self._left = np.zeros_like(untouched)
        """Change of the last press at its deepest [counts]."""
        self._released_s = 0.0
        self._pressed: tuple[float, FloatArray] | None = None
        """Deepest depth of the press so far [mm] and its change [counts]; None if the pad is untouched."""

    def added(self, signals: FloatArray, depth_mm: float, now_s: float) -> FloatArray:
        """Signals with what the last press has left, from those of the present depth alone; time never goes back."""
        if depth_mm > 0.0:
            if self._pressed is None or depth_mm > self._pressed[0]:
                self._pressed = depth_mm, signals - self._untouched
        elif self._pressed is not None:
            self._left, self._released_s = self._pressed[1], now_s
            self._pressed = None
        since_s = np.array(now_s - self._released_s)
        share = kept_share(since_s, residue=self._note.residue, decay_s=self._note.decay_s)
        return np.asarray(np.maximum(signals + share * self._left, 0.0))


AMBIENT_COUNTS = 2.0
"""Assumed ambient level in every simulated reading [counts]; the paper's untouched readings agree with it."""

READ_NOISE_COUNTS = 0.5
"""Standard deviation of a simulated reading in the dark [counts]; the verdict assumes the same value."""

LIGHT_NOISE = 0.002
"""Standard deviation of an emitter's light, relative to its mean [-]; the paper's readings do not contradict it."""

HELLO_EVERY_S = 1.0
US_PER_S = 1e6
REFERENCE_V, SUPPLY_V = 1.1, 5.0
FREE_RAM_BYTES = 4096
FIRMWARE = (0, 0)
"""Firmware version that the simulated board reports; 0.0 means that it has no firmware."""


def hello_message(config: DriverConfig, interval_us: int, digest: str | None = None) -> bytes:
    """Message in which a simulated board describes itself; `digest` replaces that of the configuration's design."""
    board, layout = config.board, frame_format(config)
    hello = Hello(
        firmware=FIRMWARE,
        board=board.link_number,
        emitters=layout.emitters,
        receivers=layout.receivers,
        bits=layout.bits,
        dark=layout.dark,
        prescaler_exponent=0 if board.adc_prescaler is None else board.adc_prescaler.bit_length() - 1,
        settle_us=math.ceil(board.settle_us),
        baud=board.baud,
        interval_us=interval_us,
        digest=digest or config.digest,
    )
    return pack_hello(hello)


class FakeBoard:
    """A simulated sensor board with a pad on which a simulated finger moves.

    Parameters
    ----------
    config : driver configuration of the simulated design
    table : signals of the design's pad, by location and depth of the press
    path : path of the finger, or of several, over time
    faults : faults of the simulated unit; None for a unit without faults
    seed : seed of the noise
    digest : design digest that the board reports; if None, that in `config`
    clock_offset_us : device time at the reset, to test the counter's wrap [us]
    sequence_offset : sequence number of the first frame, to test the counter's wrap
    """

    def __init__(
        self,
        config: DriverConfig,
        table: SignalTable,
        path: Finger = NO_FINGER,
        *,
        faults: Faults | None = None,
        seed: int = 0,
        digest: str | None = None,
        clock_offset_us: int = 0,
        sequence_offset: int = 0,
    ) -> None:
        self._config = config
        self._layout = frame_format(config)
        self._reading_s = (config.timing.frame_ms - config.timing.link_ms) / 1e3
        self._table = table
        self._path = path
        self._memory = None if config.memory is None else PadMemory(config.memory, table.untouched)
        self._faults = faults or faults_of(config)
        self._rng = np.random.default_rng(seed)
        self._digest = digest or config.digest
        self._clock_offset_us = clock_offset_us
        self._sequence_offset = sequence_offset
        self._scanner = Scanner(
            {VERSION << 4 | command: COMMAND_BYTES for command in Command}, magic=COMMAND_MAGIC
        )
        self._shortest_s = config.timing.frame_ms / 1e3
        self.reset(0.0)

    def reset(self, now_s: float) -> None:
        """Restart the board at time `now_s` of any clock that never goes back [s]; opening the port does the same."""
        self._reset_s = now_s
        self._due_s = now_s
        self._is_started = False
        self._interval_us = math.ceil(US_PER_S / self._config.timing.wanted_hz)
        self._sequence = self._sequence_offset
        self._late = 0
        self._scanner.forget()

    @property
    def due_s(self) -> float:
        """Time of the next message that the board sends without a request [s]."""
        return self._due_s

    @property
    def is_started(self) -> bool:
        """Whether the board sends frames."""
        return self._is_started

    def press_mm(self, now_s: float) -> FloatArray:
        """Position (x, y, depth) of each finger at time `now_s` [s], in the cavity's system; shape (tip, 3) [mm]."""
        return self._path.at(now_s - self._reset_s).reshape(-1, 3)

    def heard(self, piece: bytes, now_s: float) -> bytes:
        """Process bytes from the host at time `now_s` [s] and return the reply."""
        answer = b""
        for _, message in self._scanner.feed(piece):
            answer += self._obeyed(*unpack_command(message), now_s)
        return answer

    def spoken(self, now_s: float) -> bytes:
        """Bytes that the board sends without a request at time `now_s` [s]; empty before `due_s`."""
        if now_s < self._due_s:
            return b""
        if not self._is_started:
            self._due_s = now_s + HELLO_EVERY_S
            return self._hello()
        wanted_s = self._interval_us / US_PER_S
        step_s = max(wanted_s, self._shortest_s)
        self._late += wanted_s > 0 and (wanted_s < self._shortest_s or now_s > self._due_s + step_s)
        behind = now_s - self._due_s > 1.0  # this process slept: a board would have lost these frames
        self._due_s = now_s + step_s if behind else self._due_s + step_s
        frame = self._frame(now_s)
        self._sequence += 1
        return frame

    def counts(self, now_s: float) -> NDArray[np.uint16]:
        """Readings at time `now_s` [s] in all states that the board sends, shape (states, receivers) [counts]."""
        press_mm = self.press_mm(now_s)
        signals = self._table.together(press_mm)
        if self._memory is not None:
            signals = self._memory.added(signals, float(press_mm[:, 2].max()), now_s)
        signals = self._faults.applied(signals)
        light = np.zeros((self._layout.states, signals.shape[1]))
        light[[emitter is not None for emitter in self._layout.lit]] = signals
        light *= 1.0 + LIGHT_NOISE * self._rng.standard_normal((len(light), 1))
        levels = light + AMBIENT_COUNTS + READ_NOISE_COUNTS * self._rng.standard_normal(light.shape)
        levels[:, self._faults.is_saturated] = np.inf
        found: NDArray[np.uint16] = np.clip(np.round(levels), 0, self._layout.full_scale).astype(np.uint16)
        return found

    def _frame(self, now_s: float) -> bytes:
        began_s = max(now_s - self._reading_s, self._reset_s)
        device_us = self._clock_offset_us + round((began_s - self._reset_s) * US_PER_S)
        (frame,) = pack_frames(self._layout, [self._sequence], [device_us], self.counts(began_s)[None])
        return frame

    def _obeyed(self, command: Command, argument: int, now_s: float) -> bytes:
        actions: dict[Command, Callable[[], bytes]] = {
            Command.START: lambda: self._start(now_s),
            Command.STOP: lambda: self._stop(now_s),
            Command.RATE: lambda: self._rate(argument),
            Command.IDENTIFY: self._hello,
            Command.SELF_TEST: self._self_test,
        }
        return actions[command]()

    def _start(self, now_s: float) -> bytes:
        if not self._is_started:
            self._is_started, self._due_s = True, now_s
        return b""

    def _stop(self, now_s: float) -> bytes:
        if self._is_started:
            self._is_started, self._due_s = False, now_s + HELLO_EVERY_S
        return b""

    def _rate(self, interval_us: int) -> bytes:
        self._interval_us = interval_us
        return b""

    def _hello(self) -> bytes:
        return hello_message(self._config, self._interval_us, self._digest)

    def _self_test(self) -> bytes:
        reference = round(REFERENCE_V / SUPPLY_V * (self._layout.full_scale + 1))
        found = SelfTest(
            reference_counts=reference,
            late_frames=self._late,
            least_free_ram_bytes=FREE_RAM_BYTES,
            config_crc=self._config.board.config_crc or 0,
        )
        return pack_self_test(found)
