"""The real sensor in the studio: read, checked, missed when it goes, and closed without a trace."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.fabrication.bundle import bundle_name
from optopad.fabrication.driver.simulated.board import faults_of
from optopad.fabrication.driver.simulated.finger import HOVER_MM
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.driver_config import dump_driver_config
from optopad.sims.learning.inference.model_file import save_model
from optopad.studio.live import LiveSensor, LiveView
from tests.fabrication.driver.made_up_model import header, made_up_model
from tests.fabrication.driver.made_up_pad import NAME, board, pad_config, press_table, untouched

GAIN = 1e5
needs_pty = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")


class FingerOnDemand:
    """A finger that hovers until `is_down` is set: a path over time would press before a slow machine has looked."""

    is_down = False

    def at(self, time_s: ArrayLike) -> FloatArray:
        place = np.array([10.0, 22.0, 3.0 if self.is_down else HOVER_MM])
        return np.broadcast_to(place, (*np.shape(time_s), 3))


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the bundle of the made-up pad: its expected pattern, and light for a simulated board."""
    import xarray as xr

    folder = tmp_path_factory.mktemp("bundles")
    bundle = folder / bundle_name(preset(NAME))
    (bundle / "fabrication").mkdir(parents=True)
    (bundle / "sims").mkdir()
    text = dump_driver_config(preset(NAME), [GAIN] * 8, np.minimum(untouched(), 1023))
    (bundle / "fabrication" / "driver.toml").write_text(text, encoding="utf-8")
    table = press_table()
    places = np.stack(np.meshgrid(table.x_mm, table.y_mm, table.depth_mm, indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    signals = xr.Dataset(
        {f"press_{axis}": ("state", places[:, k]) for k, axis in enumerate(("x", "y", "depth"))}
        | {"flux": (("state", "emitter", "receiver"), table.counts.reshape(len(places), 8, 8) / GAIN)},
        attrs={"design_digest": preset(NAME).digest},
    )
    signals.to_netcdf(bundle / "sims" / "signals.nc", engine="h5netcdf")
    return folder


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shorter start, and no long wait for a port."""
    monkeypatch.setattr("optopad.studio.live.START_S", 0.3)
    monkeypatch.setattr("optopad.studio.live.TRY_EVERY_S", 0.1)


def sensor(port: str, bundles: Path, model: Path | None = None) -> LiveSensor:
    return LiveSensor(preset(NAME), port=port, model=model, bundles=bundles)


def waited(live: LiveSensor, is_so: Callable[[LiveView], bool], seconds: float = 10.0) -> LiveView:
    """The first snapshot of which something is so."""
    end, view = time.monotonic() + seconds, live.latest()
    while time.monotonic() < end:
        view = live.latest()
        if view is not None and is_so(view):
            return view
        time.sleep(0.01)
    pytest.fail(f"not so within {seconds:g} s: {view}")


@pytest.mark.slow
def test_the_simulated_board_is_read_without_a_loss_and_leaves_no_process_and_no_thread(
    bundles: Path,
) -> None:
    with sensor("fake", bundles) as live:
        assert live.latest() is None
        live.start()
        said = [live.latest().status]  # type: ignore[union-attr]
        first = waited(live, lambda view: view.normalised is not None, 20.0)
        time.sleep(1.0)
        last = live.latest()
        begun_s = time.monotonic()
        live.close()
        assert time.monotonic() - begun_s < 2.0
    assert not {"optopad live", "optopad sensor"} & {thread.name for thread in threading.enumerate()}
    assert live._board._process.returncode == 0  # type: ignore[union-attr]  # of its own, not by force
    assert said == ["starting the simulated board"]
    assert last is not None
    assert last.is_reading
    assert last.frames - first.frames == pytest.approx(60, abs=15)  # a busy machine
    assert last.lost == last.damaged == last.view_lost == last.reconnects == 0
    assert last.rate_hz == pytest.approx(60, rel=0.05)
    assert last.status.startswith("reading /dev/")
    assert last.status.endswith(" Hz")
    assert last.signals is not None
    assert last.baseline is not None
    assert last.saturated is not None
    assert last.expected is not None
    assert last.signals.shape == last.baseline.shape == last.expected.shape == (8, 8)
    assert (last.saturated == (untouched() > 1023))[untouched() < 900].all()
    clear = (untouched() < 900) & (untouched() > 50)
    assert np.abs(last.baseline / untouched() - 1)[clear].max() < 0.05
    assert last.problems == ()
    assert last.touch is None


def test_parts_that_are_off_are_named(bundles: Path) -> None:
    built = board(faults=faults_of(pad_config(), ["swap:R3,R4", "dead:E7", "saturated:R2"]))
    with FakePort(built) as port, sensor(port.name, bundles) as live:
        live.start()
        view = waited(live, lambda view: bool(view.problems))
    found = {(problem.kind, problem.parts) for problem in view.problems if problem.is_error}
    assert found == {("swapped", ("R3", "R4")), ("dead", ("E7",)), ("saturated", ("R2",))}
    assert view.saturated is not None
    assert view.saturated[:, 1].all()


def test_the_wiring_is_checked_when_the_expected_pattern_is_there_at_last(tmp_path: Path) -> None:
    built = board(faults=faults_of(pad_config(), ["dead:E3"]))
    with FakePort(built) as port, sensor(port.name, tmp_path) as live:
        assert live.expected is None
        live.start()
        assert waited(live, lambda view: view.normalised is not None).problems == ()
        with pytest.raises(InputError, match=r"expected counts: of shape \(3, 3\).*needs finite \(8, 8\)"):
            live.set_expected(np.ones((3, 3)))
        live.set_expected(untouched())
        (problem,) = waited(live, lambda view: bool(view.problems)).problems
        view = waited(live, lambda view: view.expected is not None)
    assert problem.parts == ("E3",)
    assert "receiver reads" in problem.message
    assert view.expected is not None
    assert view.expected.max() == 1023


def test_a_model_tells_the_touch(bundles: Path, tmp_path: Path) -> None:
    save_model(tmp_path / "pad.optomodel", made_up_model())
    finger = FingerOnDemand()
    with FakePort(board(finger)) as port, sensor(port.name, bundles, tmp_path / "pad.optomodel") as live:
        live.start()
        said = waited(live, lambda view: view.is_reading).status
        still = waited(live, lambda view: view.touch is not None)
        finger.is_down = True
        held = waited(live, lambda view: view.touch is not None and view.touch.is_touched)
        time.sleep(0.3)
        held = live.latest()  # type: ignore[assignment]
    assert f"{port.name}" in said
    assert still.touch is not None
    assert not still.touch.is_touched
    assert held.touch is not None
    assert held.touch.press_mm == pytest.approx(
        (10.0, 22.0, 3.0), abs=1.5
    )  # one frame, see test_touch_reader
    assert held.touch.force_n is not None
    assert held.view_lost == 0


@pytest.mark.slow
def test_rebase_takes_the_pad_as_it_is_now_for_untouched(bundles: Path) -> None:
    finger = FingerOnDemand()
    with FakePort(board(finger)) as port, sensor(port.name, bundles) as live:
        live.start()
        waited(live, lambda view: view.normalised is not None)
        finger.is_down = True
        waited(live, lambda view: view.normalised is not None and bool(np.nanmin(view.normalised) < 0.8))
        live.rebase()
        view = waited(
            live, lambda view: view.normalised is not None and bool(np.nanmin(view.normalised) > 0.8)
        )
    assert view.view_lost == 0


@pytest.mark.slow
@needs_pty
def test_a_board_that_goes_is_told_and_read_again_when_it_is_back(bundles: Path, tmp_path: Path) -> None:
    link = tmp_path / "pad"
    with sensor(str(link), bundles) as live:
        live.start()
        assert "board yet, trying" in waited(live, lambda view: "no such port" in view.status).status
        with FakePort(board(), PtyWire(link)) as first:
            before = waited(live, lambda view: view.normalised is not None)
            first.unplug()
            gone = waited(live, lambda view: not view.is_reading)
        assert "1 s: is" in gone.status
        assert gone.frames >= before.frames > 0
        assert gone.signals is not None
        assert (gone.rate_hz, gone.touch) == (None, None)
        with FakePort(board(faults=faults_of(pad_config(), ["dead:E3"])), PtyWire(link)):
            back = waited(live, lambda view: view.is_reading)
            assert back.reconnects == 1
            mended = waited(live, lambda view: bool(view.problems))  # what is plugged in is checked anew
    assert mended.problems[0].parts == ("E3",)
    assert mended.view_lost == 0


@pytest.mark.slow
@needs_pty
def test_a_sensor_silent_for_long_is_opened_anew_and_what_was_counted_stays(
    bundles: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("optopad.studio.live.OPEN_AGAIN_S", 1.1)
    link = tmp_path / "pad"
    with sensor(str(link), bundles) as live:
        live.start()
        time.sleep(0.2)
        with FakePort(board(), PtyWire(link)):
            before = waited(live, lambda view: view.normalised is not None)
        again = waited(live, lambda view: "no frames for 2 s" in view.status)
        assert "optopad sensor" not in [thread.name for thread in threading.enumerate()]
        with FakePort(board(), PtyWire(link)):
            back = waited(live, lambda view: view.is_reading)
    assert back.frames > again.frames >= before.frames
    assert back.reconnects == 1


def test_a_simulated_board_that_does_not_start_says_why(
    bundles: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = sensor("fake", bundles)
    assert live._board is not None
    live._board._command[-1] = "no number"
    with live:
        live.start()
        view = waited(live, lambda view: "did not start" in view.status, 20.0)
    assert not view.is_reading
    assert "--seed" in view.status


@pytest.mark.slow
def test_a_simulated_board_that_dies_is_started_again(bundles: Path) -> None:
    with sensor("fake", bundles) as live:
        live.start()
        waited(live, lambda view: view.is_reading, 20.0)
        live._board._process.kill()  # type: ignore[union-attr]
        waited(live, lambda view: not view.is_reading)
        view = waited(live, lambda view: view.is_reading, 20.0)
    assert view.reconnects == 1


@pytest.mark.slow
@needs_pty
def test_a_simulated_board_ends_with_a_window_that_was_killed(bundles: Path) -> None:
    program = f"""
import time
from pathlib import Path
from optopad.design.preset import preset
from optopad.studio.live import LiveSensor
live = LiveSensor(preset({NAME!r}), port="fake", model=None, bundles=Path({str(bundles)!r}))
live.start()
while not live.latest().is_reading:
    time.sleep(0.05)
print(live._board._process.pid, flush=True)
time.sleep(60)
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as window:
        assert window.stdout is not None
        pid = int(window.stdout.readline())
        os.kill(pid, 0)
        window.send_signal(signal.SIGKILL)
    end = time.monotonic() + 5.0
    while time.monotonic() < end and _runs(pid):
        time.sleep(0.05)
    assert not _runs(pid)


def _runs(pid: int) -> bool:
    """Whether a process lives; one that ended and that nobody has asked after does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("fault", ["design", "parts", "missing"])
def test_a_model_that_does_not_fit_is_refused_before_a_port_is_opened(
    fault: str, bundles: Path, tmp_path: Path
) -> None:
    told = {"design": "is of design abababab", "parts": "its receivers are Q1", "missing": "no such file"}[
        fault
    ]
    file = tmp_path / "other.optomodel"
    if fault != "missing":
        changes = {"design_digest": "ab" * 32} if fault == "design" else {"receiver_names": ("Q1",) * 8}
        save_model(file, replace(made_up_model(), header=header(**changes)))
    with pytest.raises(InputError, match=told) as caught:
        sensor("nowhere", bundles, file)
    assert str(file) in str(caught.value)


def test_a_frame_of_the_queue_that_was_dropped_is_missed(
    bundles: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with FakePort(board()) as port, sensor(port.name, bundles) as live:
        live.start()
        waited(live, lambda view: view.normalised is not None)
        monkeypatch.setattr("optopad.fabrication.driver.stream.QUEUE_FRAMES", 0)
        time.sleep(0.1)
        monkeypatch.undo()
        view = waited(live, lambda view: view.view_lost > 0)
    assert view.lost == 0


def test_closing_does_not_wait_for_a_simulated_board_that_is_not_ready(tmp_path: Path) -> None:
    live = sensor("fake", tmp_path)
    live.start()
    time.sleep(0.3)
    begun_s = time.monotonic()
    live.close()
    assert time.monotonic() - begun_s < 2.0
    assert "optopad live" not in [thread.name for thread in threading.enumerate()]
