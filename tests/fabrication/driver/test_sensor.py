"""The sensor on a simulated board: frames, losses, reconnection, a clean end."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import serial

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.link import Link
from optopad.fabrication.driver.link.ports import PortLostError
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.finger import FingerPath
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire, SocketWire
from optopad.fabrication.driver_file import MemoryNote
from tests.fabrication.driver.made_up_pad import board, pad_config, press_table, untouched

ROOT = Path(__file__).parents[3]
CONFIG = replace(pad_config(), board=replace(pad_config().board, boot_s=0.2))
"""A simulated board boots at once; one that was not reset is asked without a long wait."""

PRESSED = FingerPath(time_s=np.array([0.0, 1000.0]), press_mm=np.array([[16.0, 16.0, 3.0]] * 2))
needs_pty = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")


def quick(port: str, **options: object) -> Sensor:
    return Sensor(CONFIG, port, **({"rate_hz": 200.0, "baseline_s": 0.1} | options))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["pseudo-terminal", pytest.param("socket", marks=pytest.mark.slow)])
def test_frames_come_in_order_at_the_rate_asked_for_and_none_is_lost(kind: str) -> None:
    wire = SocketWire() if kind == "socket" else None
    with FakePort(board(), wire) as port, quick(port.name) as sensor:
        frames = list(sensor.frames(count=150))
        assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 149
        assert (np.diff([frame.device_us for frame in frames]) > 0).all()
        assert sensor.counts.lost == sensor.counts.damaged == sensor.counts.skipped_bytes == 0
        assert sensor.rate_hz == pytest.approx(200, rel=0.05)  # a busy machine delays single frames
        assert frames[0].counts.shape == (9, 8)
        assert frames[0].signals.shape == (8, 8)


def test_signals_are_the_simulated_ones_less_ambient_and_baseline_normalised() -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:
        frames = list(sensor.frames(count=60))
    mean = np.mean([frame.signals for frame in frames], axis=0)
    clear = untouched() < 900  # the others may clip
    noise = 0.5 + 0.002 * untouched()[clear]  # read noise and the light's, see fake_board
    assert (
        np.abs(mean - untouched())[clear] < 5 * noise / np.sqrt(60) * np.sqrt(2) + 0.3
    ).all()  # and rounding
    assert np.nanmax(np.abs(np.mean([f.normalised for f in frames], axis=0) - 1)[clear]) < 0.05
    assert all(frame.saturated[:8][untouched() > 1023].all() for frame in frames)
    assert not any(frame.saturated[8].any() for frame in frames)


def test_a_simulated_pad_keeps_a_residue_of_the_last_press_at_its_place() -> None:
    """In the untouched pad and under the next press elsewhere: half of it is left after the decay."""
    at = np.array(
        [[16.0, 16.0, -1.0], [16.0, 16.0, 3.0], [16.0, 16.0, -1.0], [8.0, 8.0, -1.0], [8.0, 8.0, 1.0]]
    )
    path = FingerPath(time_s=np.array([0.0, 1.0, 2.0, 4.0, 5.0]), press_mm=at)
    keeps = FakeBoard(
        replace(pad_config(), memory=MemoryNote(residue=0.1, decay_s=2.0)), table := press_table(), path
    )
    whole = (table.at(at[1]) - table.untouched)[0]
    clear = (untouched() < 900) & (np.abs(whole) > 20.0)

    def added(now_s: float) -> np.ndarray:
        counts = np.mean([keeps.counts(now_s) for _ in range(200)], axis=0)
        return np.asarray((counts[:-1] - counts[-1] - table.at(path.at(now_s))[0])[clear] / whole[clear])

    np.testing.assert_allclose(added(1.0), 0.0, atol=0.01)
    np.testing.assert_allclose(
        [added(2.0), added(4.0), added(5.0 - 1e-6)], [[0.1], [0.05], [0.04]] * np.ones(clear.sum()), atol=0.01
    )


def test_a_press_lowers_the_pairs_that_it_is_near_to() -> None:
    rest_then_press = FingerPath(
        time_s=np.array([0.0, 0.4, 0.41, 1000.0]),
        press_mm=np.array([[16.0, 16.0, -1.0]] * 2 + [[16.0, 16.0, 3.0]] * 2),
    )
    with FakePort(board(rest_then_press)) as port, quick(port.name) as sensor:
        frames = list(sensor.frames(seconds=0.7))
        before, after = frames[0], frames[-1]
    assert np.nanmin(after.normalised) < 0.8 < np.nanmin(before.normalised)


def test_a_ratio_over_nearly_nothing_is_not_told() -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:
        frame, baseline = sensor.read(), sensor.baseline
    assert baseline is not None
    assert np.array_equal(np.isnan(frame.normalised), baseline < 4.0)


def test_without_a_baseline_there_is_no_normalised_signal() -> None:
    with FakePort(board()) as port, quick(port.name, baseline_s=0.0) as sensor:
        with pytest.raises(DeviceError, match="no baseline was taken"):
            _ = sensor.read().normalised
        sensor.take_baseline(0.05)
        assert sensor.read().normalised.shape == (8, 8)


@pytest.mark.slow
def test_both_counters_wrap_without_a_seam() -> None:
    near_the_end = board(clock_offset_us=2**32 - 400_000, sequence_offset=2**32 - 60)
    with FakePort(near_the_end) as port, quick(port.name) as sensor:
        frames = list(sensor.frames(count=150))
        assert sensor.counts.lost == sensor.counts.reconnects == 0
    assert frames[-1].sequence > 2**32
    assert frames[-1].device_us > 2**32
    assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 149


@pytest.mark.slow
def test_frames_that_a_slow_reader_leaves_wait_for_it() -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:
        sensor.read()
        time.sleep(1.0)
        frames = list(sensor.frames(count=150))
        assert sensor.counts.lost == sensor.counts.overrun == 0
    assert np.diff([frame.sequence for frame in frames]).tolist() == [1] * 149


@needs_pty
def test_it_is_back_within_a_second_after_the_board_was_plugged_in_again(tmp_path: Path) -> None:
    link = tmp_path / "pad"
    with FakePort(board(), PtyWire(link)) as first, quick(str(link)) as sensor:
        sensor.read()
        first.unplug()
        sensor._stream.link.scanner.damaged = 7  # type: ignore[union-attr]
        time.sleep(0.3)
        assert sensor.counts.damaged == 7  # once, also while it is away
        with FakePort(board(), PtyWire(link)):
            plugged_at = time.monotonic()
            while (frame := sensor.read()).connection == 1:
                pass
            back_s = time.monotonic() - plugged_at
        assert back_s < 1.0
        assert frame.connection == 2
        assert sensor.counts.reconnects == 1


@pytest.mark.slow
@needs_pty
def test_closing_does_not_wait_for_a_board_that_is_greeted_again(tmp_path: Path) -> None:
    link = tmp_path / "pad"
    slow = replace(CONFIG, board=replace(CONFIG.board, boot_s=20.0))
    with FakePort(board(), PtyWire(link)) as first, Sensor(slow, str(link), baseline_s=0.1) as sensor:
        sensor.read()
        first.unplug()
        silent = PtyWire(link)  # nobody speaks on it: it would be waited for through the boot time
        time.sleep(0.5)
        begun = time.monotonic()
        sensor.__exit__(None, None, None)
        assert time.monotonic() - begun < 1.0
        silent.close()


@pytest.mark.slow
@needs_pty
def test_a_board_that_stays_away_is_named_after_the_patience(tmp_path: Path) -> None:
    link = tmp_path / "pad"
    with FakePort(board(), PtyWire(link)) as port, quick(str(link), patience_s=0.5) as sensor:
        sensor.read()
        port.unplug()
        with pytest.raises(DeviceError, match="pad: no such port"):
            for _ in sensor:
                pass


@pytest.mark.slow
@needs_pty
def test_a_board_that_leaves_before_the_time_is_over_is_an_error_and_no_clean_end(tmp_path: Path) -> None:
    link, file, seen = tmp_path / "pad", tmp_path / "cut.optorec", []
    with FakePort(board(), PtyWire(link)) as port:

        def read_on(sensor: Sensor) -> None:
            for frame in sensor.frames(seconds=1.5):
                seen.append(frame.sequence)
                if len(seen) == 21:
                    port.unplug()

        with (
            pytest.raises(DeviceError, match="pad"),
            Sensor(pad_config(), str(link), rate_hz=200.0, baseline_s=0.0) as sensor,
            sensor.record(file),
        ):
            read_on(sensor)
    cut = read_recorded(file)
    # frames that came before the recording began are handed out, too
    assert seen[-1] <= cut.sequence[-1]
    assert len(cut.sequence) == cut.sequence[-1] - cut.sequence[0] + 1 > 10
    assert not cut.ended_cleanly


def test_a_silent_board_is_an_error_also_within_a_given_time(monkeypatch: pytest.MonkeyPatch) -> None:
    with FakePort(board()) as port, quick(port.name, patience_s=0.4) as sensor:
        sensor.read()
        monkeypatch.setattr(
            "optopad.fabrication.driver.link.link.Link.messages", lambda link: time.sleep(0.01) or []
        )
        with pytest.raises(DeviceError, match="no whole frame"):
            list(sensor.frames(seconds=2.5))


class HungBoard(FakeBoard):
    """A board that falls silent once `is_hung` is set, until it is reset."""

    is_hung = False

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self.is_hung = False

    def spoken(self, now_s: float) -> bytes:
        return b"" if self.is_hung else super().spoken(now_s)

    def heard(self, piece: bytes, now_s: float) -> bytes:
        return b"" if self.is_hung else super().heard(piece, now_s)


def test_the_port_of_a_silent_board_is_opened_again_which_resets_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optopad.fabrication.driver.stream.START_AGAIN_S", 0.05)
    monkeypatch.setattr("optopad.fabrication.driver.stream.OPEN_AGAIN", 1)
    hung = HungBoard(CONFIG, press_table())
    with FakePort(hung) as port, quick(port.name) as sensor:
        sensor.read()
        hung.is_hung = True
        assert any(frame.connection == 2 for frame in sensor)


def test_a_rate_is_0_and_a_timed_reading_fails_while_no_frames_arrive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:
        list(sensor.frames(count=20))
        assert (sensor.fault, sensor.rate_hz) == ("", pytest.approx(200, rel=0.2))
        kept, stream = sensor.read(), sensor._open
        monkeypatch.setattr(stream, "_keep", lambda *_: None)
        with stream._changed:
            stream.heard_at = time.monotonic() - 2.0
            stream._queue.append(kept)  # a frame that a slow reader left
        assert "no whole frame for 2 s" in sensor.fault
        assert sensor.rate_hz == 0.0
        with pytest.raises(DeviceError, match="no whole frame for 2"):
            list(sensor.frames(seconds=0.05))


def test_a_board_that_begins_anew_with_another_design_s_firmware_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("optopad.fabrication.driver.stream.LATE_HELLO_S", 0.0)
    built = board()
    with FakePort(built) as port, quick(port.name, patience_s=0.5) as sensor:
        sensor.read()
        built._digest = "ab" * 32
        built.reset(time.monotonic())
        with pytest.raises(DeviceError, match="digest abababab"):
            for _ in sensor:
                pass


@needs_pty
def test_a_port_that_goes_again_while_it_is_started_is_looked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = tmp_path / "pad"
    with FakePort(board(), PtyWire(link)) as first, quick(str(link), patience_s=5.0) as sensor:
        sensor.read()
        start, calls = Link.start, []

        def failing_once(self: Link, interval_us: int) -> None:
            calls.append(interval_us)
            if len(calls) == 1:
                raise PortLostError("gone again")
            start(self, interval_us)

        monkeypatch.setattr(Link, "start", failing_once)
        first.unplug()
        with FakePort(board(), PtyWire(link)):
            assert any(frame.connection == 2 for frame in sensor.frames(seconds=4.0))
    assert len(calls) >= 2


@pytest.mark.parametrize("rate_hz", [1e-5, 2e5, -1.0])
def test_a_rate_that_no_board_keeps_is_refused(rate_hz: float) -> None:
    with pytest.raises(InputError, match="rate_hz"):
        quick("nowhere", rate_hz=rate_hz)


def test_a_terminal_without_a_rate_is_opened_at_a_standard_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS, where a pseudo-terminal refuses 1 Mbaud with ENOTTY."""
    real, asked = serial.serial_for_url, []

    def refusing(name: str, **options: object) -> object:
        asked.append(options["baudrate"])
        if options["baudrate"] == 1_000_000:
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        return real(name, **options)

    monkeypatch.setattr(serial, "serial_for_url", refusing)
    with FakePort(board()) as port, quick(port.name) as sensor:
        assert sensor.read().counts.shape == (9, 8)
    assert asked[:2] == [1_000_000, 115_200]


@pytest.mark.slow
@needs_pty
def test_another_design_s_board_plugged_in_its_place_is_refused(tmp_path: Path) -> None:
    link = tmp_path / "pad"
    with FakePort(board(), PtyWire(link)) as first, quick(str(link), patience_s=1.0) as sensor:
        sensor.read()
        first.unplug()
        with (
            FakePort(board(digest="cd" * 32), PtyWire(link)),
            pytest.raises(DeviceError, match="digest cdcdcdcd"),
        ):
            {frame.connection for frame in sensor}


def test_a_fault_of_our_own_in_the_thread_reaches_the_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:

        def fail(*_: object) -> None:
            raise ZeroDivisionError

        monkeypatch.setattr(sensor._decoder, "decoded", fail)
        with pytest.raises(ZeroDivisionError):
            list(sensor.frames(seconds=2.0))


def test_a_board_of_another_design_is_refused_and_can_be_accepted_by_name() -> None:
    with FakePort(board(digest="ab" * 32)) as port:
        with pytest.raises(DeviceError, match=r"digest abababab.*--accept-digest abababab"):
            quick(port.name).__enter__()
        with pytest.raises(DeviceError, match="another design"):
            quick(port.name, accept_digest="ab" * 3 + "00").__enter__()
        with quick(port.name, accept_digest="abababab") as sensor:
            assert sensor.hello.digest == "ab" * 32
            assert sensor.read().counts.shape == (9, 8)


@pytest.mark.parametrize("digits", ["ab", "", "not-a-digest", "a" * 65])
def test_a_digest_that_names_no_design_is_refused(digits: str) -> None:
    with pytest.raises(InputError, match="names no design; give 8 to 64"):
        Sensor(CONFIG, "loop://", accept_digest=digits)


@pytest.mark.slow
def test_a_slow_rate_is_waited_for_longer_than_the_patience() -> None:
    with FakePort(board()) as port, quick(port.name, rate_hz=2.0, baseline_s=0.0, patience_s=0.3) as sensor:
        assert [frame.sequence for frame in sensor.frames(count=3)] == [0, 1, 2]


def test_a_board_of_another_shape_is_refused_even_by_name() -> None:
    from optopad.fabrication.driver.simulated.press_table import untouched_table

    other = pad_config("piacenza2017-pair")
    with (
        FakePort(FakeBoard(other, untouched_table(other))) as port,
        pytest.raises(DeviceError, match=r"3 emitters, 3 receivers, 10 bits; .* has 8, 8, 10"),
    ):
        quick(port.name, accept_digest=other.digest[:8]).__enter__()


def test_the_self_test_is_answered_between_frames() -> None:
    with FakePort(board()) as port, quick(port.name) as sensor:
        found = sensor.self_test()
        frames = list(sensor.frames(count=20))
        assert sensor.counts.lost == 0
    assert found.reference_counts == 225  # 1.1 V of 5 V
    assert len(frames) == 20


def test_the_end_stops_board_and_thread() -> None:
    simulated = board()
    with FakePort(simulated) as port:
        with quick(port.name) as sensor:
            sensor.read()
            assert simulated.is_started
        time.sleep(0.1)
        assert not simulated.is_started
        assert "optopad sensor" not in [thread.name for thread in threading.enumerate()]
        with quick(port.name) as sensor:  # and the port can be opened again at once
            assert sensor.read().connection == 1


def test_a_sensor_that_is_not_open_says_how_to_open_it() -> None:
    with pytest.raises(DeviceError, match="Sensor"):
        Sensor(CONFIG, "loop://").read()


def test_a_rate_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(InputError, match="rate_hz: -1 is refused"):
        Sensor(CONFIG, "loop://", rate_hz=-1)


def test_the_descriptor_tells_geometry_and_units_apart_from_the_stream() -> None:
    found = Sensor(CONFIG, "loop://").descriptor
    assert found.states == ("E1", "E2", "E3", "E4", "E5", "E6", "E7", "E8", "off")
    assert found.emitters.position_mm.shape == (8, 3)
    assert found.receivers.pins[0] == "A0"
    assert found.units["signals"].startswith("ADC counts")
    assert found.expected_counts is not None


def test_the_driver_loads_nothing_heavy() -> None:
    program = (
        "import sys; import optopad.fabrication.driver, optopad.fabrication.driver.check; "
        "import optopad.fabrication.driver.recording.export, optopad.fabrication.driver.simulated.port; "
        "print([n for n in ('pydantic', 'tomlkit', 'cadquery', 'mujoco', 'numba', 'scipy', 'xarray', 'rich', 'typer', "
        "*('optopad.' + room for room in ('sims', 'cad', 'sensor', 'results', 'work', 'cli'))) if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@needs_pty
def test_a_living_board_s_name_is_not_taken_and_a_dead_one_s_is(tmp_path: Path) -> None:
    link = tmp_path / "pad"
    with FakePort(board(), PtyWire(link)):
        target = link.readlink()
        with pytest.raises(InputError, match=r"--link .*pad: leads to .*another simulated board"):
            PtyWire(link)
        assert link.readlink() == target
    link.symlink_to(tmp_path / "gone")
    with FakePort(board(), PtyWire(link)):
        assert link.exists()


@needs_pty
def test_a_link_is_gone_before_its_port_s_name_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link, close, seen = tmp_path / "pad", os.close, []

    def watched(descriptor: int) -> None:
        seen.append(link.is_symlink())
        close(descriptor)

    wire = PtyWire(link)
    monkeypatch.setattr(os, "close", watched)
    wire.close()
    assert seen == [False]


@needs_pty
def test_a_link_that_leads_to_another_board_by_now_stays(tmp_path: Path) -> None:
    link, other = tmp_path / "pad", PtyWire()
    wire = PtyWire(link)
    link.unlink()
    link.symlink_to(other.name)
    wire.close()
    assert str(link.readlink()) == other.name
    other.close()
