"""A printer as a stage: it goes where it is sent, never sideways while touching, and leaves the tip lifted."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.link.ports import Port
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.stage.gcode_stage import TRAVEL_MM, GcodeLine, GcodeStage, feed_word, place_of
from tests.fabrication.driver.made_up_pad import board
from tests.fabrication.stage.made_up_bench import LIMITS, MIDDLE, Bench, bench

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
RESOLUTION_MM = 0.011
"""M114 has two decimals, of position and of origin."""


def test_the_tip_is_where_the_stage_says_and_was_sent() -> None:
    with bench() as made, made.stage() as stage:
        stage.zero(*MIDDLE)
        for target in ((16.0, 16.0, 2.0), (8.0, 24.0, 0.5), (8.0, 24.0, -10.0), (20.0, 9.0, 3.25)):
            assert stage.move_to(*target) == pytest.approx(target, abs=RESOLUTION_MM)
            assert made.printer.here_mm() == pytest.approx(target, abs=RESOLUTION_MM)


def test_it_never_goes_sideways_below_the_travel_height() -> None:
    rng = np.random.default_rng(5)
    with bench() as made, made.stage() as stage:
        stage.zero(*MIDDLE)
        for _ in range(4):
            stage.move_to(*rng.uniform(7, 25, 2), rng.uniform(-8, 4.5))
        rides = made.printer.rides
    sideways = [(start, end) for start, end in rides if np.hypot(*(end - start)[:2]) > 0.001]
    assert len(sideways) == 4
    assert all(max(start[2], end[2]) <= -TRAVEL_MM + RESOLUTION_MM for start, end in sideways)


def test_it_goes_slowly_near_the_pad_and_fast_above_it() -> None:
    with bench() as made, made.stage(travel_speed_mm_s=300.0, press_speed_mm_s=50.0) as stage:
        stage.zero(*MIDDLE)
        stage.move_to(16.0, 16.0, 2.0)
        down = [line for line in made.printer.commands if line.startswith("G1")][-2:]
    assert [line.split()[-1] for line in down] == ["F18000", "F3000"]  # mm/min
    assert [line.split()[-2] for line in down] == ["Z1.000", "Z-2.000"]


PLACES = {
    "Marlin 2": "X:{0:.2f} Y:{1:.2f} Z:{2:.2f} E:0.00 Count X:0 Y:0 Z:0\nok\n",
    "Marlin 1.0": "X:{0:.2f}Y:{1:.2f}Z:{2:.2f}E:0.00 Count X: 7.00Y:7.00Z:7.00\nok\n",
    "tenths": "X:{0:.1f} Y:{1:.1f} Z:{2:.1f} E:0.0\nok\n",
    "Klipper": "X:{0:.3f} Y:{1:.3f} Z:{2:.3f} E:0.000\nok\n",
    "RepRapFirmware": "X:{0:.3f} Y:{1:.3f} Z:{2:.3f} E:0.000 E0:0.0 Count 7 7 7 Machine 7.0 7.0 7.0 Bed comp 0.0\nok\n",
    "Smoothie": "ok C: X:{0:.4f} Y:{1:.4f} Z:{2:.4f} E:0.0000\n",
    "with reports": "X:7.00 Y:7.00 Z:7.00 E:0.00\nT:20.1 /0.0 B:19.9\nX:{0:.2f} Y:{1:.2f} Z:{2:.2f} E:0.00\nok\n",
}


@pytest.mark.parametrize(
    "dialect",
    [
        pytest.param(name, marks=pytest.mark.slow) if number > 1 else name
        for number, name in enumerate(PLACES)
    ],
)
def test_each_dialect_s_position_is_read_and_a_tip_that_stopped_short_is_noticed(dialect: str) -> None:
    """The tip starts where no firmware's digits end, and goes to depths between the tenths."""
    start = (16.04, 15.97, 0.03)
    with bench() as made:
        made.printer.place_text = PLACES[dialect]
        made.printer._zero = made.printer._zero - [100.123, 90.456, 14.234]
        with made.stage() as stage:
            stage.zero(*start)
            offset = np.array(start) - MIDDLE  # the tip is told to stand there, and stands on the middle
            rides = len(made.printer.rides)
            for target in ((15.0, 16.0, 1.0), (15.0, 16.0, 1.25), (15.0, 16.0, 2.17)):
                assert stage.move_to(*target) == pytest.approx(target, abs=0.001)
                assert made.printer.here_mm() == pytest.approx(target - offset, abs=RESOLUTION_MM)
            sideways = [
                ride for ride in made.printer.rides[rides:] if np.hypot(*(ride[1] - ride[0])[:2]) > 0.001
            ]
            assert len(sideways) == 1  # no digit that is missing sends it away and back
            made.printer._fault, made.printer._left = "shifted", 0
            with pytest.raises(DeviceError, match=r"depth .* home"):
                stage.move_to(15.0, 16.0, 3.25)


NO_PLACES = (
    "<Idle|MPos:1.000,2.000,3.000|FS:0,0>",
    "ok MCS: X:1.0000 Y:2.0000 Z:3.0000",
    "Count X:1.00 Y:2.00 Z:3.00",
    '{"status":"I","pos":[1.0,2.0,3.0]}',
    "X:1,00 Y:2,00 Z:3,00 E:0,00",
    "X:1.00 Y:2.00 Z:3,00",
    "X:1.00 Y:2.00 Z:1e+02 E:0.00",
    "X:1.00 Y:2.00 Z:?",
    "X:nan Y:2.00 Z:3.00",
    "X:1.00.5Y:2.00Z:3.00",
    "X:1.00 Y:2.00",
    "X:1.00 Z:3.00 Y:2.00",
    "echo:Unknown command: M114",
)


@pytest.mark.parametrize("line", NO_PLACES)
def test_a_position_that_is_not_surely_one_is_refused(line: str) -> None:
    assert place_of(line) is None


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (f"{NO_PLACES[1]}\nok\n", "M114 has.*'ok MCS.*of G1"),
        ("X:1 Y:2 Z:3\nok\n", "M114 gives"),
    ],
)
def test_a_printer_whose_position_is_not_known_is_not_moved(answer: str, told: str) -> None:
    with bench() as made:
        made.printer.place_text = answer.replace("{", "{{").replace("}", "}}")
        with made.stage() as stage, pytest.raises(DeviceError, match=told):
            stage.zero(*MIDDLE)
        assert made.printer.rides == []


def test_a_command_that_a_firmware_lacks_is_told_unless_it_is_optional() -> None:
    """RepRapFirmware and Smoothie call it an error; M211 alone may be missing."""
    for words in (
        "echo:Unknown command: ",
        "Error: Bad command: ",
        "error:Unsupported command ",
        "Warning: not supported ",
    ):
        line = GcodeLine(Answering(f"{words}M211 S0\nok\n".encode()), 0.5)  # type: ignore[arg-type]
        assert line.send("M211 S0", is_optional=True)[-1] == "ok"
        with pytest.raises(DeviceError, match="the firmware lacks M211"):
            line.send("M211 S0")


class Answering:
    """A port whose device answers every command alike."""

    name = "port"

    def __init__(self, answer: bytes) -> None:
        self._answer, self._waiting = answer, b""

    def write(self, _: bytes) -> None:
        self._waiting = self._answer

    def read(self) -> bytes:
        waiting, self._waiting = self._waiting, b""
        return waiting


def test_a_machine_with_grbl_is_named() -> None:
    line = GcodeLine(Answering(b"\r\nGrbl 1.1h ['$' for help]\r\nerror:20\r\n"), 0.5)  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match=r"0\.1 s; Grbl.*M114 nor.*M400.*--stage-baud"):
        line.greet(0.1)


def test_the_tip_is_lifted_at_the_end_and_after_an_error() -> None:
    with bench() as made:
        with made.stage() as stage:
            stage.zero(*MIDDLE)
            stage.move_to(16.0, 16.0, 3.0)
        assert made.printer.here_mm()[2] == pytest.approx(-TRAVEL_MM, abs=RESOLUTION_MM)

        def fail_in_the_pad() -> None:
            with made.stage() as stage:
                stage.zero(16.0, 16.0, -TRAVEL_MM)
                stage.move_to(16.0, 16.0, 3.0)
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            fail_in_the_pad()
        assert made.printer.here_mm()[2] == pytest.approx(-TRAVEL_MM, abs=RESOLUTION_MM)


@pytest.mark.slow
def test_ctrl_c_in_the_middle_of_a_press_lifts_the_tip() -> None:
    import _thread

    def press(made: Bench) -> None:
        with made.stage(press_speed_mm_s=10.0) as stage:
            stage.zero(*MIDDLE)
            threading.Timer(0.3, _thread.interrupt_main).start()
            stage.move_to(16.0, 16.0, 4.0)  # 1 mm above to 4 mm below at 10 mm/s: half a second

    with bench() as made:
        with pytest.raises(KeyboardInterrupt):
            press(made)
        assert made.printer.here_mm()[2] == pytest.approx(-TRAVEL_MM, abs=RESOLUTION_MM)


@pytest.mark.parametrize(
    ("method", "call"),
    [
        pytest.param(
            method, call, marks=() if (method, call) in (("read", 2), ("write", 1)) else pytest.mark.slow
        )
        for method in ("read", "write")
        for call in range(6)
    ],
)
def test_an_interrupt_that_takes_an_answer_or_a_command_with_it_lifts_the_tip(
    method: str, call: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever of a move down it hits: what was read is lost, or what was to be sent is not."""
    usual = getattr(Port, method)
    left = [-1]

    def interrupted(port: Port, *given: bytes) -> bytes | None:
        left[0] -= 1
        if left[0] != 0:
            return usual(port, *given)
        if method == "read":
            usual(port)
        raise KeyboardInterrupt

    monkeypatch.setattr(Port, method, interrupted)
    with bench() as made:
        stage = made.stage(press_speed_mm_s=100.0)
        begun = time.monotonic()

        def press() -> None:
            with stage:
                stage.zero(*MIDDLE)
                left[0] = 1 + call
                stage.move_to(16.0, 16.0, 4.0)

        with pytest.raises(KeyboardInterrupt):
            press()
        assert made.printer.here_mm()[2] == pytest.approx(-TRAVEL_MM, abs=RESOLUTION_MM)
        assert stage.left_at == pytest.approx((16.0, 16.0, -TRAVEL_MM), abs=RESOLUTION_MM)
        assert time.monotonic() - begun < 10.0


def test_stop_ends_the_motion_and_lifts() -> None:
    with bench() as made, made.stage() as stage:
        stage.zero(*MIDDLE)
        stage.move_to(16.0, 16.0, 3.0)
        stage.stop()
        assert "M410" in made.printer.commands
        assert stage.position()[2] == pytest.approx(-TRAVEL_MM, abs=RESOLUTION_MM)


@pytest.mark.slow
def test_homing_makes_the_printer_s_own_coordinates_hold() -> None:
    with bench(home_mm=(-40.0, -40.0, 0.0)) as made, made.stage() as stage:
        stage.home((40.0, 40.0, 0.0))  # the cavity's corner is 40 mm from the end stops, level with the bed
        stage.move_to(10.0, 12.0, 1.5)
        assert made.printer.here_mm() == pytest.approx((10.0, 12.0, 1.5), abs=RESOLUTION_MM)
        first = next(line for line in made.printer.commands if line.startswith("G1"))
        assert first.split()[1] == "Z5.000"  # up before anything else


OUTSIDE = (
    ((40.0, 16.0, 0.0), "x 40 mm is outside of 6 to 26 mm"),
    ((16.0, 5.0, 0.0), "y 5 mm is outside of 6 to 26 mm"),
    ((16.0, 16.0, 5.5), "depth 5.5 mm is outside of -60 to 5 mm"),
    ((16.0, 16.0, -100.0), "depth -100 mm is outside"),
    ((16.0, float("nan"), 1.0), "mm is outside"),
)


def test_a_position_outside_of_the_limits_is_refused_before_anything_moves() -> None:
    with bench() as made, made.stage() as stage:
        stage.zero(*MIDDLE)
        rides = len(made.printer.rides)
        for target, told in OUTSIDE:
            with pytest.raises(InputError, match=told):
                stage.move_to(*target)
            assert len(made.printer.rides) == rides, target


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        pytest.param("silent", "may still touch", marks=pytest.mark.slow),
        ("error", r"the printer replied 'Error:Printer halted.*lift it by hand"),
        ("shifted", "x, y, depth"),
        pytest.param("restarted", "restarted during .* its position is lost", marks=pytest.mark.slow),
    ],
)
def test_a_printer_that_fails_is_told_by_what_it_did(fault: str, told: str) -> None:
    def press(made: Bench) -> None:
        with made.stage() as stage:
            stage.zero(*MIDDLE)
            for depth_mm in (1.0, -2.0, 1.0, -2.0, 1.0):
                stage.move_to(12.0, 16.0, depth_mm)

    with bench(fault=fault) as made, pytest.raises(DeviceError, match=told):
        press(made)


@pytest.mark.parametrize(
    "depth_mm",
    [0.0, pytest.param(-TRAVEL_MM, marks=pytest.mark.slow)],
    ids=["barely touching", "as the last run left it"],
)
def test_a_printer_that_began_anew_lifts_the_tip_and_tells_no_place(depth_mm: float) -> None:
    """Its coordinates count from where it stood in the pad: by the old ones the tip would stay there."""

    def press() -> None:
        with stage:
            stage.zero(16.0, 16.0, depth_mm)
            stage.move_to(12.0, 16.0, 2.0)
            made.printer._fault, made.printer._left = "restarted", 0
            stage.move_to(12.0, 16.0, 3.0)

    with bench() as made:
        with made.stage() as stage:
            stage.zero(*MIDDLE)
            stage.move_to(16.0, 16.0, depth_mm)
            stage.lift = lambda: None  # type: ignore[method-assign]
        time.sleep(0.1)  # the port is seen closed, and the next one to open it resets the printer
        stage = made.stage()
        with pytest.raises(DeviceError, match="its position is lost"):
            press()
        assert made.printer.here_mm()[2] == pytest.approx(
            2.0 - LIMITS.deepest_mm - TRAVEL_MM, abs=RESOLUTION_MM
        )
        assert stage.left_at is None


def test_a_slow_speed_is_not_rounded_to_another_nor_to_none() -> None:
    assert [feed_word(speed) for speed in (5.0, 0.012, 0.008)] == ["F300", "F0.72", "F0.48"]


def test_a_printer_that_is_unplugged_is_told_with_what_to_do_by_hand() -> None:
    def press(made: Bench) -> None:
        with made.stage() as stage:
            stage.zero(*MIDDLE)
            made.stage_port.unplug()
            stage.move_to(16.0, 16.0, 2.0)

    with bench() as made, pytest.raises(DeviceError, match=r"the port was lost.* lift it by hand"):
        press(made)


@pytest.mark.slow
def test_a_port_where_no_printer_answers_is_told() -> None:
    with (
        FakePort(board()) as port,
        pytest.raises(DeviceError, match=r"1\.0 s"),
    ):
        GcodeStage(port.name, LIMITS, boot_s=1.0).__enter__()


def test_a_stage_that_does_not_know_where_the_pad_is_does_not_move() -> None:
    with bench() as made, made.stage() as stage:
        with pytest.raises(DeviceError, match=r"call home\(\) or zero\(\) first"):
            stage.move_to(*MIDDLE)
        assert made.printer.rides == []


def test_a_stage_that_is_not_open_says_how_to_open_it() -> None:
    with pytest.raises(DeviceError, match="open; use"):
        GcodeStage("nowhere", LIMITS).zero(*MIDDLE)


@pytest.mark.parametrize("name", ["travel_mm", "travel_speed_mm_s", "press_speed_mm_s"])
def test_a_height_or_speed_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} is 0, needs a number above 0"):
        GcodeStage("nowhere", LIMITS, **{name: 0.0})


@pytest.mark.slow
def test_a_long_move_is_waited_for_as_long_as_the_printer_says_that_it_is_busy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("optopad.fabrication.stage.fake_printer.BUSY_EVERY_S", 0.1)
    with bench() as made, made.stage(answer_s=0.3) as stage:
        stage.zero(*MIDDLE)
        made.printer.speed_mm_s = 1.0
        begun = time.monotonic()
        stage._line.send("G1 Z6.2")  # 1.2 mm at 1 mm/s, of which the stage was told nothing
        stage._line.send("M400")
        assert time.monotonic() - begun > 1.0
