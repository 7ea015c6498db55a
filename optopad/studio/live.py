"""The manufactured sensor in the studio: a thread reads it through the driver and stores the newest snapshot.

    with LiveSensor(design, port=None, model=None, bundles=Path("outputs")) as live:
        live.start()
        view = live.latest()

The driver's own thread reads the port into a queue. The thread here takes frames from this queue and makes an immutable
snapshot, so drawing never delays reading. Nothing is simulated here: the expected readings of the untouched pad come
from the bundle, or are set with `set_expected`.

Do not touch the pad for the first 1.5 s after every connection. During this time the baseline, the check of the wiring
and the model's reference levels are measured. A press at that time counts as the untouched pad until `rebase`.

A simulated board can replace a real one: a process of `optopad driver fake`, which ends with this process.
"""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import DeviceError, InputError
from optopad.design.files import temporary_folder
from optopad.design.io import save_design
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.check import check_frames
from optopad.fabrication.driver.descriptor import Descriptor, descriptor_of
from optopad.fabrication.driver.link.frames import US_PER_S, Frame, normalised
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.driver.stream import LinkCounts
from optopad.fabrication.driver.touch_reader import Touch, TouchReader
from optopad.fabrication.driver.wiring_check import Problem
from optopad.sensor import fitting_model, source_of
from optopad.work import started

STARTING_BOARD = "starting the simulated board"

GENTLE_S = 1.0
"""Time in which the simulated board may end by itself before its process is killed [s]."""

BOARD_PROGRAM = """
import os, signal, threading
def follow():
    while os.read(0, 64):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
threading.Thread(target=follow, daemon=True).start()
from optopad.cli import main
main()
"""
"""Python program that runs `optopad` and ends when the other end of its standard input is closed, for any reason."""


class BoardProcess:
    """Runs `optopad driver fake` for a design as a process that ends with this process.

    Parameters
    ----------
    say : called with messages about the progress
    """

    def __init__(self, design: SensorDesign, bundles: Path, seed: int, say: Callable[[str], None]) -> None:
        self._folder = temporary_folder()
        file = Path(self._folder.name) / "design.toml"
        save_design(design, file)
        command = ["driver", "fake", str(file), "--bundles", str(bundles)]
        self._command = ["-c", BOARD_PROGRAM, *command, "--seed", str(seed)]
        self._say = say
        self._lock, self._is_closed = threading.Lock(), False
        self._process: subprocess.Popen[str] | None = None
        self._port = ""

    @property
    def has_ended(self) -> bool:
        """Whether the simulated board ended without a request to end."""
        return self._process is not None and self._process.poll() is not None

    def port(self) -> str:
        """Name of the simulated board's port; the board is started if it is not running.

        Raises
        ------
        DeviceError : the board was closed while it was starting.
        InputError : the board ended before it had a port; the text includes the board's own message.
        """
        if self._process is not None and not self.has_ended:
            return self._port
        self._say(STARTING_BOARD)
        process, told = self._started(), ""
        assert process.stdout is not None
        for line in process.stdout:
            word, _, rest = line.strip().partition(" ")
            if word == "port":
                self._port = rest.strip()
                return self._port
            told = " ".join(line.split()) or told
            self._say(f"{STARTING_BOARD}: {told}")
        if self._is_closed:
            raise DeviceError("the simulated board: closed before it had started")
        raise InputError(
            f"the simulated board did not start: {told.removeprefix('optopad: ') or 'no message'}"
        )

    def end(self) -> None:
        """End the board's process, by force if it does not react; afterwards it cannot be started again."""
        with self._lock:
            self._is_closed = True
        if self._process is not None:
            _end(self._process)

    def tidy(self) -> None:
        """Close the pipes and remove the temporary folder after the last read; a second call has no effect."""
        if self._process is not None:
            _close_pipes(self._process)
        self._folder.cleanup()

    def _started(self) -> subprocess.Popen[str]:
        with self._lock:
            if self._is_closed:
                raise DeviceError("the simulated board: closed before it had started")
            if self._process is not None:
                _close_pipes(self._process)
            self._process = started(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
            )
            return self._process


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.wait(GENTLE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _close_pipes(process: subprocess.Popen[str]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


FAKE = "fake"
"""Name of the port that requests a simulated board."""

START_S, START_FRAMES = 0.8, 5
"""Least time [s] and number of frames of the untouched pad for baseline and wiring check; a model measures its
reference levels after that."""

POLL_S = 0.2
SILENCE_S = 1.0
"""Time without a frame after which the sensor is reported as silent [s]; at least three frame periods."""

OPEN_AGAIN_S = 10.0
"""Time without a frame after which a lost port is opened again [s]; until then the driver looks for it by itself."""

TRY_EVERY_S = 2.0
SHOW_EVERY_S = 0.01
CLOSE_S = 2.0


@dataclass(frozen=True, kw_only=True)
class LiveView:
    """Snapshot of the sensor's state. While no frames arrive, the last readings remain, without rate and touch.

    Attributes
    ----------
    status : state of the connection in one sentence, for display
    is_reading : whether frames arrive
    frames, lost, damaged, reconnects : numbers of received, lost and damaged frames, and of reconnections, since
        `start`
    view_lost : number of frames that the driver received but this class missed, from gaps in the sequence numbers
    rate_hz : frames per second by the board's clock; None before two frames, and while no frames arrive
    signals : (emitter, receiver) lit minus dark readings [counts]; None before the first frame
    baseline : (emitter, receiver) signals of the untouched pad [counts]; None before they are measured
    normalised : (emitter, receiver) signals over the baseline [-]; NaN where the baseline is below 4 counts
    saturated : (emitter, receiver) whether the lit or the dark reading is at full scale
    expected : (emitter, receiver) simulated signals without contact [counts]; None if not known
    touch : the model's touch estimate from the newest frame; None without a model, and while no frames arrive
    problems : findings of the check of the wiring, errors first; also empty before the check
    """

    status: str
    is_reading: bool = False
    frames: int = 0
    lost: int = 0
    damaged: int = 0
    reconnects: int = 0
    view_lost: int = 0
    rate_hz: float | None = None
    signals: NDArray[np.int32] | None = None
    baseline: FloatArray | None = None
    normalised: FloatArray | None = None
    saturated: BoolArray | None = None
    expected: FloatArray | None = None
    touch: Touch | None = None
    problems: tuple[Problem, ...] = ()


class LiveSensor:
    """Reads a manufactured sensor, or a simulated board, in a thread until closed.

    Parameters
    ----------
    design : design of the sensor
    port : name of the port; if None, the board is found by its USB identity; if "fake", a simulated board is started
    model : file of a trained model of this design; if None, no touch is estimated
    bundles : folder of the bundles; the design's bundle provides the expected pattern if it exists
    seed : seed of the simulated board
    patience_s : longest wait for the board when its port is opened [s]; None for the driver's default

    Raises
    ------
    InputError, DesignError : the model is damaged or of another design.
    """

    def __init__(
        self,
        design: SensorDesign,
        *,
        port: str | None,
        model: Path | None,
        bundles: Path,
        seed: int = 0,
        patience_s: float | None = None,
    ) -> None:
        self._config = source_of(design, bundles).config
        self._said: Descriptor = descriptor_of(self._config)
        self._model = None if model is None else fitting_model(model, self._config)
        self._patience_s = patience_s
        self._port = port
        self._board = BoardProcess(design, bundles, seed, self._say) if port == FAKE else None
        self._expected = self._said.expected_counts
        self._silence_s = max(SILENCE_S, 3.0 / self._said.required_rate_hz)
        self._view: LiveView | None = None
        self._over, self._rebase = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="optopad live", daemon=True)
        self._past = LinkCounts()
        self._passed = _Passed()
        self._heard_s: float | None = None
        self._opened_s = 0.0
        self._reason = ""
        self._shown_s = 0.0
        self._baseline: FloatArray | None = None
        self._problems: tuple[Problem, ...] = ()
        self._connection: int | None = None
        self._start: list[Frame] = []
        self._is_settled = self._is_to_check = False
        self._reader: TouchReader | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start the reading thread; call this once."""
        self._say("looking for the board" if self._board is None else STARTING_BOARD)
        self._thread.start()

    def latest(self) -> LiveView | None:
        """The newest snapshot, without waiting; None before `start`."""
        return self._view

    @property
    def expected(self) -> FloatArray | None:
        """(emitter, receiver) simulated signals without contact [counts]; None if not in the bundle and not set."""
        return self._expected

    def set_expected(self, counts: ArrayLike) -> None:
        """Set the expected readings of the untouched pad, with which the wiring is checked.

        Parameters
        ----------
        counts : (emitter, receiver), as from `SimulatedGain.untouched_readings` [counts]

        Raises
        ------
        InputError : `counts` has the wrong shape, or is not numeric.
        """
        given = np.array(counts, dtype=np.float64)
        needed = len(self._said.emitters.names), len(self._said.receivers.names)
        if given.shape != needed or not np.isfinite(given).all():
            raise InputError(
                f"expected counts: of shape {given.shape}, {np.isfinite(given).sum()} of them finite; needs finite "
                f"{needed}; simulate the untouched pad of {self._said.design}"
            )
        self._expected = np.minimum(given, self._said.full_scale)
        self._is_to_check = True

    def rebase(self) -> None:
        """Measure baseline, wiring check and the model's reference levels again; do not touch the pad for 1.5 s."""
        self._rebase.set()

    def close(self) -> None:
        """End the thread, the sensor and the simulated board; a second call has no effect."""
        self._over.set()
        if self._board is not None:
            self._board.end()  # first: the thread may wait for its output
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)
        if self._board is not None:
            self._board.tidy()

    def _say(self, status: str) -> None:
        """Show a status while no frames arrive; the last readings remain, a touch and a rate do not."""
        shown = self._view or LiveView(status=status, expected=self._expected)
        self._view = replace(shown, status=status, is_reading=False, rate_hz=None, touch=None)

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                self._read()
            except DeviceError as err:
                self._reason = str(err)
            except InputError as err:  # no simulated board, and another attempt gives none either
                self._say(str(err))
                return
            except Exception as err:  # our own fault is shown and raised: old numbers must not pass for new
                self._say(f"reading has ended: {type(err).__name__}: {err}; this is optopad's own failure")
                raise
            self._say_silent()
            self._over.wait(TRY_EVERY_S)

    def _read(self) -> None:
        """Open the sensor and read it until `close`, or until it has been silent for `OPEN_AGAIN_S`."""
        port = self._port if self._board is None else self._board.port()
        opened = Sensor(
            self._config,
            port,
            baseline_s=0.0,
            patience_s=self._patience_s,
            on_wait=self._say,
        )
        with opened as sensor:
            if self._heard_s is not None:
                self._past.reconnects += 1
            self._begin_anew()
            self._passed.skip()
            self._opened_s = time.monotonic()
            try:
                while not self._over.is_set() and not self._is_given_up():
                    self._take(sensor)
            finally:
                self._past = self._counts(sensor)

    def _is_given_up(self) -> bool:
        has_ended = self._board is not None and self._board.has_ended
        return has_ended or self._silent_s() > max(OPEN_AGAIN_S, self._silence_s)

    def _silent_s(self) -> float:
        """Time since the open sensor last sent a frame [s]."""
        return time.monotonic() - max(self._heard_s or 0.0, self._opened_s)

    def _take(self, sensor: Sensor) -> None:
        """Process the frames of 0.2 s; report a long silence."""
        if self._rebase.is_set():
            self._rebase.clear()
            self._begin_anew()
        try:
            self._settle(sensor)
            for frame, touch in self._arriving(sensor):
                self._heard_s, self._reason = time.monotonic(), ""
                self._follow(sensor, frame, touch)
        except DeviceError as err:  # the driver's thread continues to look for the board
            self._reason = str(err)
            self._over.wait(POLL_S)
        if self._silent_s() > self._silence_s:
            self._say_silent()

    def _arriving(self, sensor: Sensor) -> Iterator[tuple[Frame, Touch | None]]:
        if self._reader is None:
            yield from ((frame, None) for frame in sensor.frames(seconds=POLL_S))
        else:
            yield from ((touch.frame, touch) for touch in self._reader.touches(seconds=POLL_S))

    def _follow(self, sensor: Sensor, frame: Frame, touch: Touch | None) -> None:
        if frame.connection != self._connection:
            if self._connection is not None:
                self._begin_anew()
            self._connection = frame.connection
        self._passed.take(frame)
        if not self._is_settled:
            self._start.append(frame)
        if (now_s := time.monotonic()) - self._shown_s >= SHOW_EVERY_S:
            self._shown_s = now_s
            self._view = self._snapshot(sensor, frame, touch)

    def _begin_anew(self) -> None:
        self._connection, self._start, self._reader = None, [], None
        self._is_settled = self._is_to_check = False

    def _settle(self, sensor: Sensor) -> None:
        """Measure baseline, wiring check and the model's reference levels as soon as there are enough frames."""
        if not self._is_settled and _is_enough(self._start):
            self._baseline = np.mean([frame.signals for frame in self._start], axis=0)
            self._is_settled = self._is_to_check = True
        if self._is_settled and self._is_to_check and self._expected is not None:
            self._is_to_check = False
            found = check_frames(self._start, replace(self._said, expected_counts=self._expected))
            self._problems = found.problems
        if self._is_settled and self._model is not None and self._reader is None:
            reader = TouchReader(sensor, self._model)
            self._passed.skip()  # the reader takes frames for itself
            reader.begin()
            self._reader = reader

    def _snapshot(self, sensor: Sensor, frame: Frame, touch: Touch | None) -> LiveView:
        counts, rate_hz, baseline = self._counts(sensor), sensor.rate_hz, self._baseline
        return LiveView(
            status=self._reading_text(sensor.port, rate_hz),
            is_reading=True,
            frames=counts.frames,
            lost=counts.lost,
            damaged=counts.damaged,
            reconnects=counts.reconnects,
            view_lost=self._passed.missed,
            rate_hz=rate_hz,
            signals=frame.signals,
            baseline=baseline,
            normalised=None if baseline is None else normalised(frame.signals, baseline),
            saturated=frame.saturated[:-1] | frame.saturated[-1],
            expected=self._expected,
            touch=touch,
            problems=self._problems,
        )

    def _reading_text(self, port: str, rate_hz: float | None) -> str:
        if not self._is_settled or (self._model is not None and self._reader is None):
            return f"measuring the untouched pad on {port}: do not touch it"
        return f"reading {port}" + ("" if rate_hz is None else f": {rate_hz:.1f} Hz")

    def _say_silent(self) -> None:
        if self._heard_s is None:
            self._say(f"no board yet, trying again: {self._reason or 'it sends nothing'}")
            return
        silent_s = time.monotonic() - self._heard_s
        reason = f" ({self._reason})" if self._reason else ""
        self._say(f"no frames for {silent_s:.0f} s: is the cable in? trying again{reason}")

    def _counts(self, sensor: Sensor) -> LinkCounts:
        """Numbers of received, lost and damaged frames since `start`, over all connections."""
        now, past = sensor.counts, self._past
        names = type(now).__dataclass_fields__
        return LinkCounts(**{name: getattr(past, name) + getattr(now, name) for name in names})


class _Passed:
    """Counter of frames that the driver received but the studio missed: sequence gaps that the line did not cause."""

    def __init__(self) -> None:
        self.missed = 0
        self._last: Frame | None = None

    def take(self, frame: Frame) -> None:
        """Count the frames missed before this frame."""
        last, self._last = self._last, frame
        if last is not None and last.connection == frame.connection:
            self.missed += max(frame.sequence - last.sequence - 1 - frame.lost_before, 0)

    def skip(self) -> None:
        """Ignore the gap before the next frame, because other code has taken the frames in between."""
        self._last = None


def _is_enough(frames: list[Frame]) -> bool:
    if len(frames) < START_FRAMES:
        return False
    return (frames[-1].device_us - frames[0].device_us) / US_PER_S >= START_S
