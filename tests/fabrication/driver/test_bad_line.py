"""Ports that are wrong, busy, refused, or talk something else; boards that send half frames for ever."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import serial

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link import link
from optopad.fabrication.driver.link.link import printer_words, require_no_printer
from optopad.fabrication.driver.link.ports import FoundPort, Port, find_port, is_guess, port_of_serial
from optopad.fabrication.driver.link.protocol import FrameFormat, Hello, pack_frames, pack_hello
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.driver.simulated.press_table import untouched_table
from optopad.screen.live_sensor import link_line
from tests.fabrication.driver.made_up_pad import board, pad_config
from tests.fabrication.driver.other_devices import PRINTERS, Talker, printer_of
from tests.said import says

CONFIG = replace(pad_config(), board=replace(pad_config().board, boot_s=0.2))
pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
MEGA = FoundPort(name="ttyACM0", usb_id="2341:0042", title="Arduino Mega 2560")
COPY = FoundPort(name="ttyUSB0", usb_id="1a86:7523", title="USB2.0-Serial")
MOUSE = FoundPort(name="ttyS0", usb_id="", title="")
HELLO = pack_hello(
    Hello(
        firmware=(1, 0),
        board=1,
        emitters=8,
        receivers=8,
        bits=10,
        prescaler_exponent=6,
        settle_us=20,
        baud=1_000_000,
        interval_us=2500,
        digest=CONFIG.digest,
    )
)


@pytest.fixture(autouse=True)
def _short_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boards here answer at once, so that no opening waits for long."""
    monkeypatch.setattr("optopad.fabrication.driver.sensor.ANSWER_S", 0.3)


@contextmanager
def talking(says: Callable[[], bytes]) -> Iterator[str]:
    """A device on a pseudo-terminal that says something every 10 ms, whatever it hears."""
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    over = threading.Event()

    def run() -> None:
        while not over.wait(0.01):
            if select.select([], [master], [], 0)[1] and (text := says()):
                os.write(master, text)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        over.set()
        thread.join()
        os.close(master)
        os.close(slave)


def opened(port: str, **options: object) -> Sensor:
    return Sensor(CONFIG, port, baseline_s=0, rate_hz=100, **options)  # type: ignore[arg-type]


def test_a_port_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(DeviceError, match="such port; ports"):
        opened("/dev/ttyNONE").__enter__()


def test_a_file_is_no_port(tmp_path) -> None:
    file = tmp_path / "port"
    file.write_text("x")
    with pytest.raises(DeviceError, match="is no serial port"):
        opened(str(file)).__enter__()


def test_a_socket_where_nobody_answers_is_told() -> None:
    with pytest.raises(DeviceError, match="no reply there"):
        opened("socket://localhost:1").__enter__()


def test_a_port_without_permission_says_which_group_to_join(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port: [Errno 13] Permission denied")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(DeviceError, match="ttyACM0"):
        opened("/dev/ttyACM0").__enter__()


def test_a_port_that_another_program_holds_is_told() -> None:
    with (
        FakePort(board()) as port,
        Port(port.name, 1_000_000),
        pytest.raises(DeviceError, match="in use by another"),
    ):
        opened(port.name).__enter__()


@pytest.mark.slow
def test_a_device_that_talks_something_else_is_told_from_a_silent_one() -> None:
    with (
        talking(lambda: b"$GPGGA,1,2,3*00\r\n") as port,
        pytest.raises(DeviceError, match="another device sends"),
    ):
        opened(port, patience_s=0.6).__enter__()
    with (
        talking(lambda: b"") as port,
        pytest.raises(DeviceError, match=r"0\.6 s.*SECONDS"),
    ):
        opened(port, patience_s=0.6).__enter__()


def test_a_board_that_only_streams_and_never_says_who_it_is_is_refused() -> None:
    (frame,) = pack_frames(FrameFormat(emitters=8, receivers=8, bits=10), [1], [1], np.zeros((1, 9, 8)))
    with talking(lambda: frame) as port, pytest.raises(DeviceError, match="no hello among them"):
        opened(port, patience_s=0.6).__enter__()


@pytest.mark.slow
def test_half_frames_for_ever_end_in_an_error_that_counts_them() -> None:
    (frame,) = pack_frames(FrameFormat(emitters=8, receivers=8, bits=10), [1], [1], np.full((1, 9, 8), 300))
    said = iter([HELLO])
    with talking(lambda: next(said, frame[:60])) as port, opened(port, patience_s=1.0) as sensor:
        with pytest.raises(
            DeviceError, match=r"no whole frame for 1 s \(\d+ bytes outside frames, \d+ damaged"
        ):
            sensor.read()
        assert sensor.counts.frames == 0
        assert sensor.counts.damaged > 10
        assert sensor._open.link.scanner.kept_bytes < 105


def test_noise_before_and_between_frames_costs_only_what_it_hits() -> None:
    layout, rng = FrameFormat(emitters=8, receivers=8, bits=10), np.random.default_rng(5)
    numbers = iter(range(100_000))

    def says() -> bytes:
        number = next(numbers)
        if number < 3:
            return bytes(rng.bytes(50)) + HELLO
        (frame,) = pack_frames(layout, [number], [number * 10_000], np.full((1, 9, 8), 300))
        return (frame[:40] if number % 10 == 0 else frame) + bytes(rng.bytes(20))

    with talking(says) as port, opened(port) as sensor:
        frames = list(sensor.frames(count=60))
        assert all((frame.counts == 300).all() for frame in frames)
        assert {frame.sequence % 10 for frame in frames} == set(range(1, 10))
        assert sensor.counts.lost == pytest.approx(60 / 9, abs=1.5)


def test_a_doubled_frame_is_dropped_and_counted_as_it_comes_and_in_a_recording(tmp_path) -> None:
    """Single frames, blocks of three, and hellos come twice; the recording is read as if they had come once."""
    layout, numbers = FrameFormat(emitters=8, receivers=8, bits=10), iter(range(100_000))

    def says() -> bytes:
        number = next(numbers)
        if number < 3:
            return HELLO + HELLO
        block = pack_frames(
            layout, 3 * number + np.arange(3), 1000 * number + np.arange(3), np.ones((3, 9, 8))
        )
        return block[0] * 2 + block[1] + block[2] if number % 2 else b"".join(block * 2)

    file = tmp_path / "doubled.optorec"
    with (
        talking(says) as port,
        Sensor(pad_config(), port, baseline_s=0, rate_hz=100) as sensor,
        sensor.record(file) as recorder,
    ):
        frames = list(sensor.frames(count=90))
        assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 89
        assert {frame.connection for frame in frames} == {1}
        assert sensor.counts.doubled >= 50
        assert (sensor.counts.lost, sensor.counts.reconnects) == (0, 0)
        assert f"{sensor.counts.doubled} doubled" in link_line(sensor)
        assert recorder.frames <= sensor.counts.frames
    assert read_recorded(file).doubled == 0


def test_a_reset_in_mid_stream_starts_a_connection_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    from optopad.fabrication.driver import stream

    monkeypatch.setattr(stream, "LATE_HELLO_S", 0.05)
    simulated = board()
    with FakePort(simulated) as port, Sensor(CONFIG, port.name, rate_hz=100, baseline_s=0) as sensor:
        list(sensor.frames(count=10))
        simulated.reset(time.monotonic())
        frame = next(frame for frame in sensor if frame.connection == 2)
        assert frame.sequence < 10
        assert sensor.counts.lost == 0


def test_the_board_is_found_by_its_usb_identity_before_a_copy_s() -> None:
    assert find_port(CONFIG.board, [MOUSE, COPY, MEGA]) == MEGA
    assert find_port(CONFIG.board, [MOUSE, COPY]) == COPY


def test_a_serial_chip_that_any_device_may_have_is_a_guess_whatever_the_board_s_entry_says() -> None:
    assert not is_guess(MEGA, CONFIG.board)
    for chip in ("1a86:7523", "0403:6001", "10c4:ea60", "067b:2303", "1a86:55d4"):
        assert is_guess(replace(COPY, usb_id=chip), replace(CONFIG.board, usb_ids=(chip,)))


def test_no_board_or_two_of_them_are_listed() -> None:
    with pytest.raises(DeviceError, match=r"no Arduino Mega 2560 found .*ttyS0 \(no USB device\)"):
        find_port(CONFIG.board, [MOUSE])
    with pytest.raises(DeviceError, match=r"2 ports.*Arduino Mega 2560: ttyACM0.*ttyACM1"):
        find_port(CONFIG.board, [MEGA, replace(MEGA, name="ttyACM1")])
    with pytest.raises(DeviceError, match="no Arduino Mega 2560 found"):
        find_port(CONFIG.board, [COPY], not_ports=[COPY.name])  # the stage's


class SlowBoard(FakeBoard):
    """A board whose boot loader takes a while, and begins again with each byte that reaches it before its end."""

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._due_s = self._boots_s = now_s + 0.9

    def heard(self, piece: bytes, now_s: float) -> bytes:
        if now_s >= self._boots_s:
            return super().heard(piece, now_s)
        self._due_s = self._boots_s = now_s + 0.9
        return b""


@pytest.mark.slow
def test_a_slow_boot_loader_is_waited_for_and_the_wait_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "SAY_EVERY_S", 0.3)
    told: list[str] = []
    with FakePort(SlowBoard(CONFIG, untouched_table(CONFIG))) as port:
        with pytest.raises(DeviceError, match=r"silent for 0\.5 s"):
            opened(port.name, patience_s=0.5).__enter__()
        time.sleep(0.1)  # the port is seen closed
        with opened(port.name, on_wait=told.append) as sensor:
            assert sensor.read().connection == 1
    assert says(told[0], "0 s; still ... to 10 s")
    assert opened("loop://")._opening_s == 10.0
    boots_slower = replace(CONFIG, board=replace(CONFIG.board, boot_s=20.0))
    assert Sensor(boots_slower, "loop://")._opening_s > 20.0


@pytest.mark.parametrize("patience_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_patience_that_is_none_is_refused(patience_s: float) -> None:
    with pytest.raises(InputError, match=r"patience_s.*than 0"):
        opened("loop://", patience_s=patience_s)


@pytest.mark.parametrize(
    "printer",
    [pytest.param(name, marks=pytest.mark.slow if k > 1 else ()) for k, name in enumerate(PRINTERS)],
)
def test_a_printer_is_known_by_its_words_and_is_told_nothing_by_a_guess(
    printer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = printer_of(printer)
    with FakePort(made) as port:
        with pytest.raises(DeviceError, match="device there") as caught:
            require_no_printer(port.name, 1_000_000, 1.0)
        assert "--port" in str(caught.value)
        time.sleep(0.1)
        made.told.clear()
        found = replace(COPY, name=port.name)
        monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: [found])
        said: list[str] = []
        with pytest.raises(DeviceError, match=r"printer|serial chip"):
            Sensor(CONFIG, patience_s=0.6, on_wait=said.append).__enter__()
    assert made.told == []
    assert "reset the device" in said[0]


def test_a_port_where_no_printer_answers_may_be_written_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optopad.fabrication.driver.link.link.PRINTER_ANSWER_S", 0.1)
    silent = Talker(b"", lambda piece: b"")
    for device in (
        board(),
        board(digest="ab" * 32),
        silent,
        Talker(b"blink 1\r\n", lambda piece: b"what?\r\n"),
    ):
        with FakePort(device) as port:
            require_no_printer(port.name, 1_000_000, 0.4)
    assert b"M115" in b"".join(silent.told)


@pytest.mark.parametrize(
    "text", [b"start", b"starting\n", b"it is ok\n", b"\x05\x10\x00\x00\x7e", bytes(range(256)) * 4]
)
def test_words_that_not_only_a_printer_says_are_no_printer_s(text: bytes) -> None:
    assert printer_words(text) == ""


def test_a_sensor_of_a_guessed_port_is_looked_for_there_again_and_not_at_its_like(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unplugged, it leaves a printer as the only device with such a chip."""
    sensor_at, printer = tmp_path / "pad", printer_of("Marlin 2")
    with FakePort(printer) as printer_port:
        here = [replace(COPY, name=str(sensor_at))]
        monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: here)
        with FakePort(board(), PtyWire(sensor_at)) as port:
            sensor = Sensor(CONFIG, baseline_s=0, rate_hz=100, patience_s=1.0)
            sensor.__enter__()
            sensor.read()
            here[:] = [replace(COPY, name=printer_port.name)]
            port.unplug()
        time.sleep(0.4)
        sensor.__exit__(None, None, None)
    assert (printer.opened, printer.told) == (0, [])


def test_a_long_message_that_the_line_takes_in_pieces_arrives_whole() -> None:
    wire = PtyWire()
    host = os.open(wire.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        assert wire.is_open()
        message = bytes(range(256)) * 240  # more than the system's buffer holds
        heard = b""
        wire.exchange(message, 0.0)
        wire.exchange(b"dropped whole", 0.0)
        for _ in range(200):
            with contextlib.suppress(BlockingIOError):
                heard += os.read(host, 65536)
            wire.exchange(b"", 0.0)
        assert heard[: len(message)] == message
        assert heard[len(message) :] == b""
    finally:
        os.close(host)
        wire.close()


def test_a_port_is_found_by_the_serial_number_of_its_device(monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = (replace(MEGA, name=f"ttyACM{k}", serial_number=f"8573531{k}") for k in range(2))
    here = [MOUSE, COPY, left, right]
    assert port_of_serial("serial:85735311", here) == "ttyACM1"
    assert port_of_serial("/dev/ttyACM7", here) == "/dev/ttyACM7"
    with pytest.raises(DeviceError, match=r"--port serial:1.*here: ttyS0"):
        port_of_serial("serial:1", here)
    twins = [left, replace(right, serial_number=left.serial_number)]
    with pytest.raises(DeviceError, match=r"2 devices.*ttyACM0.*ttyACM1.*name"):
        port_of_serial("serial:85735310", twins)
    with pytest.raises(DeviceError, match="serial number"):
        port_of_serial("serial:", here)
    with FakePort(board()) as port:
        found = replace(MEGA, name=port.name, serial_number="42")
        monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: [found])
        with Sensor(CONFIG, "serial:42") as sensor:
            assert sensor.port == port.name
