"""The ROS 2 node through its life cycle, with a stand-in for rclpy and a simulated board."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from optopad.design.errors import OutputError
from optopad.design.preset import preset
from optopad.fabrication.driver.link.ports import FoundPort
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.ros_fields import (
    NodeClock,
    contact_markers,
    diagnosis,
    filled,
    touch_message,
    wrench_message,
)
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.driver.simulated.finger import FingerPath
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver.stream import LinkCounts
from optopad.fabrication.driver.touch_reader import NO_CONTACT, Contact, TouchReader
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.driver_file import load_driver_config
from optopad.sims.learning.inference.model_file import save_model
from tests.fabrication.driver.made_up_model import made_up_model
from tests.fabrication.driver.made_up_pad import NAME, board, frame, pad_config, untouched
from tests.fabrication.ros2.stand_in import (
    PACKAGE,
    STORE,
    LifecycleNode,
    Rclpy,
    cdr,
    class_of,
    launched,
    node_module,
)

FINGER = FingerPath(
    time_s=np.array([0.0, 1.0, 1.3, 2.2, 2.5, 60.0]),
    press_mm=np.array([[16.0, 12.0, d] for d in (-3.0, -3.0, 2.0, 2.0, -3.0, -3.0)]),
)
SOON = FingerPath(
    time_s=np.array([0.0, 0.4, 0.41, 60.0]),
    press_mm=np.array([[16.0, 12.0, d] for d in (-3.0, -3.0, 2.0, 2.0)]),
)
HELD = FingerPath(time_s=np.array([0.0, 60.0]), press_mm=np.array([[16.0, 12.0, 2.0]] * 2))
needs_pty = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
LATE_MS = 10.0
"""Longest time from a frame's last conversion to the published touch, for 99 of 100 frames [ms]."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("ros2")
    text = dump_driver_config(preset(NAME), 1e5, np.minimum(untouched(), 1023))
    (folder / "driver.toml").write_text(text, encoding="utf-8")
    assert load_driver_config(folder / "driver.toml").digest == pad_config().digest
    save_model(folder / "pad.optomodel", made_up_model())
    return folder / "driver.toml", folder / "pad.optomodel"


@pytest.fixture(autouse=True)
def _quick_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """The untouched pad is measured for 0.1 s in place of 0.5 s."""
    monkeypatch.setitem(Sensor.__init__.__kwdefaults__, "baseline_s", 0.1)
    monkeypatch.setitem(TouchReader.__init__.__kwdefaults__, "start_s", 0.1)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    nodes: list[Any] = []

    def node(**parameters: Any) -> Any:
        monkeypatch.setattr(LifecycleNode, "given", parameters)
        nodes.append(node_module().SensorNode())
        return nodes[-1]

    yield node
    for one in nodes:
        one.on_shutdown(None)


def wait_for(met: Callable[[], bool], patience_s: float = 20.0) -> None:
    end = time.monotonic() + patience_s
    while not met():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


def test_a_life_cycle_publishes_frames_and_touches_as_ros_encodes_them(
    made: Callable[..., Any], files: tuple[Path, Path], tmp_path: Path
) -> None:
    with FakePort(board(path=FINGER)) as port:
        node = made(
            config=str(files[0]), model=str(files[1]), port=port.name, rate=200.0, frame_id="left_pad"
        )
        assert node.on_configure(None) == "SUCCESS", node.log.lines
        assert set(node.topics) == {*("frame", "touch", "wrench", "sensor", "marker", "/diagnostics")}
        assert diagnosed(node).message == "not open"
        assert "open; activate" in node.call("self_test").message
        assert node.on_activate(None) == "SUCCESS"
        wait_for(lambda: len(node.topics["touch"].messages) > 50)
        assert node.call("record", file=str(tmp_path / "a.mcap")).success
        assert node.call("self_test").success
        assert node.call("baseline").success
        touched = node.topics["touch"].messages
        wait_for(lambda: any(one.is_touched for _, one in touched) and not touched[-1][1].is_touched)
        node._report()
        again = node.call("record", file=str(tmp_path / "a.mcap"))
        assert (again.success, "exists already" in again.message) == (False, True)
        assert node.on_deactivate(None) == "SUCCESS"
        assert node.on_cleanup(None) == "SUCCESS"
        assert (node.topics, node.offered, node.timers) == ({}, {}, [])
    check_messages(node)
    recorded = read_recorded(tmp_path / "a.mcap")
    assert recorded.ended_cleanly
    assert len(recorded.sequence) > 100


def check_messages(node: Any) -> None:
    frames, touches = ([one for _, one in node.published[name].messages] for name in ("frame", "touch"))
    for publisher in node.published.values():
        for _, message in (*publisher.messages[:20], *publisher.messages[-20:]):
            cdr(message)
    assert [one.sequence for one in touches] == [one.sequence for one in frames][: len(touches)]
    assert {one.header.frame_id for one in frames + touches} == {"left_pad"}
    stamps = [one.header.stamp.sec + one.header.stamp.nanosec / 1e9 for one in frames]
    steps = np.diff(stamps)
    assert np.median(steps) == pytest.approx(0.005, abs=1e-4)
    held = [one for one in touches if one.is_touched]
    middle = held[len(held) // 2]
    assert np.hypot(middle.point.x - 0.016, middle.point.y - 0.012) < 0.004
    assert middle.point.z == pytest.approx(0.008)
    assert middle.normal.z == pytest.approx(1.0)
    assert 0.0005 < middle.depth < 0.004
    assert np.isnan(touches[-1].point.x)
    wrenches = [one for _, one in node.published["wrench"].messages]
    assert [one.header.stamp for one in wrenches] == [one.header.stamp for one in touches][: len(wrenches)]
    assert {one.header.frame_id for one in wrenches} == {"left_pad"}
    for touch, one in zip(touches, (each.wrench for each in wrenches), strict=False):
        force, torque = one.force, one.torque
        assert (force.x, force.y, force.z) == (0.0, 0.0, pytest.approx(touch.force))
        if touch.is_touched:
            assert (torque.x, torque.y) == pytest.approx(
                (touch.point.y * force.z, -touch.point.x * force.z), abs=1e-9
            )
        else:
            assert (force.z, torque.x, torque.y, torque.z) == (0.0, 0.0, 0.0, 0.0)

    (sensor,) = (one for _, one in node.published["sensor"].messages)
    assert (sensor.design, len(sensor.emitters)) == (NAME, 8)
    status = node.published["/diagnostics"].messages[-1][1].status[0]
    assert {one.key for one in status.values} >= {"frames", "lost", "rate_hz", "required_hz"}
    assert node.transform.child_frame_id == "left_pad_top"
    assert node.transform.transform.translation.z == pytest.approx(0.008)
    kinds = [one.type for _, one in node.published["marker"].messages]
    assert (kinds[0], set(kinds[1:])) == (1, {1, 2})


NAN = np.full(3, np.nan)


def contact(number: int, x_mm: float, **changes: Any) -> Contact:
    values = {
        "press_mm": np.array([x_mm, 20.0, 1.0]),
        "sigma_mm": np.array([0.1, 0.2, 0.05]),
        "point_mm": np.array([x_mm, 20.0, 8.0]),
        "normal": np.array([0.0, 0.0, 1.0]),
        "force_n": 2.0,
        "force_sigma_n": 0.1,
    }
    return Contact(number=number, **(values | changes))


def touch_of(*contacts: Contact) -> Any:
    """A touch with these contacts, as far as messages need it."""
    first = contacts[0] if contacts else NO_CONTACT
    return SimpleNamespace(
        frame=SimpleNamespace(began_s=1.0, sequence=3),
        is_touched=bool(contacts),
        touch_score=1.0,
        contacts=contacts,
        slip_mm_s=np.zeros(2),
        drift=SimpleNamespace(drift=0.0, is_held=True, is_gain_like=False, gain_steps=0),
        latency_ms=1.0,
        **{name: value for name, value in vars(first).items() if name != "number"},
    )


def test_a_wrench_is_never_nan_is_along_the_normal_and_is_the_sum_of_all_contacts() -> None:
    bare = contact(1, 10.0, point_mm=NAN, normal=NAN)
    found = wrench_message(touch_of(bare), "pad")["wrench"]
    assert found == {"force": {"x": 0.0, "y": 0.0, "z": 2.0}, "torque": {"x": 0.04, "y": -0.02, "z": 0.0}}
    leaning = contact(1, 10.0, normal=np.array([0.6, 0.0, 0.8]))
    assert wrench_message(touch_of(leaning), "pad")["wrench"]["force"] == {"x": 1.2, "y": 0.0, "z": 1.6}
    for none in (
        touch_of(),
        touch_of(contact(1, 10.0, force_n=np.nan)),
        touch_of(contact(1, 10.0, force_n=None)),
    ):
        found = wrench_message(none, "pad")["wrench"]
        assert {value for one in found.values() for value in one.values()} == {0.0}
    both = wrench_message(touch_of(contact(1, 10.0), contact(2, 22.0, force_n=1.0)), "pad")["wrench"]
    assert both["force"] == {"x": 0.0, "y": 0.0, "z": 3.0}
    assert both["torque"] == {"x": pytest.approx(0.06), "y": pytest.approx(-0.042), "z": 0.0}


def test_a_touch_message_has_every_contact_and_the_first_in_its_own_fields() -> None:
    for contacts in (
        (),
        (contact(4, 10.0),),
        (contact(4, 10.0), contact(7, 22.0, force_n=None, sigma_mm=NAN)),
    ):
        fields = touch_message(touch_of(*contacts), "pad", class_of("optopad_msgs/msg/Contact"))
        message = filled(class_of("optopad_msgs/msg/Touch")(), fields)
        cdr(message)
        assert [one.number for one in message.contacts] == [one.number for one in contacts]
        for one, own in zip(message.contacts, contacts, strict=True):
            assert one.point.x == pytest.approx(own.press_mm[0] / 1e3)
            assert np.isnan(one.force) == (own.force_n is None)
            assert np.isnan(one.covariance[0]) == np.isnan(own.sigma_mm[0])
        if contacts:
            assert message.point == message.contacts[0].point
        else:
            assert np.isnan(message.point.x)


def test_the_markers_of_contacts_that_ended_are_removed() -> None:
    two = (contact(4, 10.0), contact(7, 22.0))
    for contacts, shown, ids, actions in (
        (two, 0, [1, 2], [0, 0]),
        (two[:1], 2, [1, 2], [0, 2]),
        ((), 2, [1, 2], [2, 2]),
        ((), 0, [], []),
    ):
        found = contact_markers(contacts, shown, "pad", 1.0)
        assert ([one["id"] for one in found], [one["action"] for one in found]) == (ids, actions)
        for one in found:
            cdr(filled(class_of("visualization_msgs/msg/Marker")(), one))


@pytest.mark.slow
def test_a_touch_is_published_soon_after_its_last_conversion(
    made: Callable[..., Any], files: tuple[Path, Path]
) -> None:
    late = latencies_ms(made, files, 400)
    assert np.median(late) < LATE_MS


@pytest.mark.full
def test_99_of_100_touches_are_published_in_time(made: Callable[..., Any], files: tuple[Path, Path]) -> None:
    late = latencies_ms(made, files, 4000)
    print(f"median {np.median(late):.2f} ms, 99 of 100 within {np.quantile(late, 0.99):.2f} ms")
    assert np.quantile(late, 0.99) < LATE_MS


def latencies_ms(made: Callable[..., Any], files: tuple[Path, Path], count: int) -> np.ndarray:
    """Time from the end of a frame's conversions to the publication of its touch, at 200 frames a second [ms].

    The frame's last conversion ends one frame's duration, without the transfer, after its first one begins.
    """
    timing = pad_config().timing
    with FakePort(board(path=FINGER)) as port:
        node = made(config=str(files[0]), model=str(files[1]), port=port.name, rate=200.0)
        assert node.on_configure(None) == "SUCCESS"
        node.on_activate(None)
        wait_for(lambda: len(node.topics["touch"].messages) > count, 60.0)
        node.on_deactivate(None)
    read_s = (timing.frame_ms - timing.link_ms) / 1e3
    found = node.published["touch"].messages[50:]
    began = np.array([one.header.stamp.sec + one.header.stamp.nanosec / 1e9 for _, one in found])
    return 1e3 * (np.array([at for at, _ in found]) - began - read_s)


def test_what_is_wrong_is_logged_and_leaves_the_node_unconfigured(
    made: Callable[..., Any], files: tuple[Path, Path], tmp_path: Path
) -> None:
    own = made_up_model()
    save_model(tmp_path / "other.optomodel", replace(own, header=replace(own.header, design_digest="0" * 64)))
    cases = (
        (
            {"config": str(files[0]), "model": str(tmp_path / "other.optomodel")},
            "model: is of design 00000000",
        ),
        ({"config": str(files[0]), "model": str(files[1]), "touches": 2}, "optopad train DATA"),
        ({"config": str(files[0]), "model": str(files[1]), "touches": 3}, "touches: 3 is refused"),
        (
            {"config": str(files[0]), "model": str(files[1]), "touches": 1.5},
            "touches: 1.5 is refused: give a whole",
        ),
        ({}, "config: is empty"),
        ({"config": str(tmp_path / "no.toml")}, "no.toml: no such file"),
        ({"config": str(files[0]), "model": str(tmp_path / "no.optomodel")}, "no.optomodel: no such file"),
        ({"config": str(files[0]), "rate": 1e9}, "rate_hz: 1e+09 is refused"),
    )
    for given, said in cases:
        node = made(**given)
        assert node.on_configure(None) == "FAILURE"
        assert said in node.log.lines[-1]
        assert node.topics == {}


def test_a_board_that_is_gone_is_an_error_in_the_diagnostics(
    made: Callable[..., Any], files: tuple[Path, Path], tmp_path: Path
) -> None:
    node = made(config=str(files[0]), port=str(tmp_path / "gone"), patience=0.2)
    assert node.on_configure(None) == "SUCCESS"
    node.on_activate(None)
    wait_for(lambda: bool(node._fault))
    status = diagnosed(node)
    assert (status.level, "gone" in status.message) == (b"\x02", True)
    assert node.on_deactivate(None) == "SUCCESS"


def diagnosed(node: Any) -> Any:
    """The next status of the sensor."""
    node._report()
    return node.topics["/diagnostics"].messages[-1][1].status[0]


@needs_pty
@pytest.mark.slow
def test_a_board_that_was_unplugged_is_read_again_at_another_port_and_a_held_press_stays_one(
    made: Callable[..., Any], files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LifecycleNode, "namespace", "/left")
    here = []
    monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: here)
    node = made(config=str(files[0]), model=str(files[1]), port="serial:42", rate=200, patience=0.2)
    assert node.on_configure(None) == "SUCCESS"
    node.on_activate(None)
    with FakePort(board(path=SOON)) as port:
        here[:] = [FoundPort(name=port.name, usb_id="", title="", serial_number="42")]
        frames, touches = node.topics["frame"].messages, node.topics["touch"].messages
        wait_for(lambda: len(touches) > 0 and touches[-1][1].is_touched)
        first = diagnosed(node)
        assert (first.name, first.hardware_id) == (f"/left/sensor: {NAME}", "42")
        assert {one.key: one.value for one in first.values}["digest"] == pad_config().digest
        assert node.call("record", file=str(tmp_path / "a.optorec")).success
        count = len(frames)
        wait_for(lambda: len(frames) > count + 20)
        node.log.lines.clear()
        here.clear()
    wait_for(lambda: bool(node.log.lines))
    away, count = diagnosed(node), len(frames)
    values = {one.key: one.value for one in away.values}
    assert (away.level, values["rate_hz"], "serial:42" in away.message) == (b"\x02", "0.0", True)
    assert float(values["silent_s"]) >= 0.2
    assert [one.action for _, one in node.topics["marker"].messages][-2:] == [2, 0]  # no touch, and the body
    assert not node.call("baseline").success
    with FakePort(board(path=HELD)) as port:
        here[:] = [FoundPort(name=port.name, usb_id="", title="", serial_number="42")]
        wait_for(lambda: len(frames) > count + 20)
        assert all(one.is_touched for _, one in touches[-10:])
        wait_for(lambda: len(node.log.lines) > 1)
        back = diagnosed(node)
        assert (back.level, back.message) == (b"\x00", "reading")
        assert {one.key: one.value for one in back.values}["reconnects"] == "1"
        assert [one.connection for _, one in frames[count - 1 : count + 1]] == [1, 2]
        assert len(node.log.lines) == 2
        assert node.call("record", file="").success
        node.on_deactivate(None)
    assert set(read_recorded(tmp_path / "a.optorec").connection) == {1, 2}


def test_another_board_in_the_place_of_the_first_has_its_untouched_pad_measured(
    made: Callable[..., Any], files: tuple[Path, Path]
) -> None:
    """Its serial number tells; a board without one, as many copies, is taken for the same."""
    node = made(config=str(files[0]))
    for serial_number, is_new in (("42", False), ("", False), ("42", False), ("43", True), ("43", False)):
        node._renew.clear()
        node._find(SimpleNamespace(port="pad", serial_number=serial_number))
        assert node._renew.is_set() == is_new
    (line,) = node.log.lines
    assert "43 after 42" in line


def test_a_fault_of_the_node_s_own_ends_its_process_with_an_error(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = node_module()

    def fail(*_: object) -> None:
        raise ZeroDivisionError

    with FakePort(board()) as port:
        given = {"config": str(files[0]), "port": port.name, "rate": 200.0, "autostart": True}
        monkeypatch.setattr(LifecycleNode, "given", given)
        monkeypatch.setattr(module, "frame_message", fail)
        assert module.main() == 1
    (node,) = Rclpy.nodes
    assert "ZeroDivisionError" in node.log.lines[-1]


def test_a_failed_recording_does_not_end_the_frames(
    made: Callable[..., Any], files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with FakePort(board()) as port:
        node = made(config=str(files[0]), port=port.name, rate=200.0)
        node.on_configure(None)
        node.on_activate(None)
        frames = node.topics["frame"].messages
        wait_for(lambda: len(frames) > 0)
        with node._sensor._open._changed:
            node._sensor._open._notice = OutputError("the disk is full")
        count = len(frames)
        wait_for(lambda: len(frames) > count + 20)
        assert "the disk is full" in node.log.lines


def test_parameters_may_be_written_in_any_type_that_yaml_makes_of_them(
    made: Callable[..., Any], files: tuple[Path, Path]
) -> None:
    given, _ = launched(config=str(files[0]), rate="200", frame_id="1", patience="10", port="/dev/ttyACM3")
    assert given == {
        "config": str(files[0]),
        "port": "/dev/ttyACM3",
        "model": "",
        "touches": 1,
        "rate": 200.0,
        "frame_id": "1",
        "patience": 10.0,
        "autostart": True,
    }
    for written in (given, {"config": str(files[0]), "rate": 200, "frame_id": 1, "patience": 10}):
        node = made(**written)
        assert node.on_configure(None) == "SUCCESS"
        assert (node._frame_id, node._device._rate_hz, node._device.patience_s) == ("1", 200.0, 10.0)
    fastest, _ = launched(config=str(files[0]), rate="0")
    node = made(**fastest)
    assert node.on_configure(None) == "SUCCESS"
    assert node._device._rate_hz == 0.0
    for name, wrong in (("rate", "fast"), ("rate", True), ("frame_id", True), ("patience", 0)):
        node = made(**({"config": str(files[0])} | {name: wrong}))
        assert node.on_configure(None) == "FAILURE"
        assert name in node.log.lines[-1]


def test_every_parameter_of_the_node_is_in_the_launch_file_and_in_the_example() -> None:
    own = node_module().PARAMETERS
    given, node = launched()
    assert {name: type(value) for name, value in given.items()} == {n: type(v) for n, v in own.items()}
    assert given == own | {"autostart": True}
    assert node["respawn"]
    example = yaml.safe_load((PACKAGE / "config" / "sensor.yaml").read_text())
    assert example["/**"]["ros__parameters"] == own


def test_the_boot_of_a_board_has_a_wait_of_its_own(
    made: Callable[..., Any], files: tuple[Path, Path]
) -> None:
    node = made(config=str(files[0]), patience=0.5)
    assert node.on_configure(None) == "SUCCESS"
    assert node._device.patience_s == 0.5
    assert node._device._opening_s > pad_config().board.boot_s + 2.0


def test_all_stamps_are_of_the_simulation_if_its_time_is_used(
    made: Callable[..., Any], files: tuple[Path, Path]
) -> None:
    with FakePort(board(path=SOON)) as port:
        node = made(config=str(files[0]), model=str(files[1]), port=port.name, rate=200.0)
        node.clock.simulated_s = 1000.0
        node.on_configure(None)
        node.on_activate(None)
        touches = node.topics["touch"].messages
        wait_for(lambda: len(touches) > 0 and touches[-1][1].is_touched)
        node._report()
        node.on_deactivate(None)
    stamps = [node.transform.header.stamp]
    for publisher in node.published.values():
        stamps += [one.header.stamp for _, one in publisher.messages]
    stamps += [one.arrived for _, one in node.published["frame"].messages]
    seconds = np.array([one.sec + one.nanosec / 1e9 for one in stamps])
    assert len(seconds) > 50
    assert (np.abs(seconds - 1000.0) < 1.0).all()
    frames = [one.header.stamp for _, one in node.published["frame"].messages]
    assert (np.diff([one.sec + one.nanosec / 1e9 for one in frames]) >= 0.0).all()


def test_times_of_frames_go_back_only_with_the_clock_of_the_simulation() -> None:
    clock, now_s = NodeClock(), time.time()
    frames = [replace(frame(np.zeros((9, 8))), began_s=now_s - age, host_s=now_s) for age in (0.01, 0.02)]
    first, second = (clock.frame(one, 50.0) for one in frames)
    assert first.began_s == second.began_s == pytest.approx(49.99, abs=0.009)
    assert clock.frame(frames[0], 3.0).began_s == pytest.approx(2.99, abs=0.009)
    assert clock.frame(frames[0], None) is frames[0]


def test_lost_frames_are_a_warning_only_while_they_are_new() -> None:
    old, new = LinkCounts(frames=10, lost=2), LinkCounts(frames=20, lost=3)
    assert diagnosis(new, old, 200.0, 200.0, "")["message"] == "lost"
    assert diagnosis(new, new, 200.0, 200.0, "")["message"] == "reading"
    assert diagnosis(new, new, 100.0, 200.0, "")["message"] == "slow"


def test_every_message_has_a_definition_that_ros_reads() -> None:
    assert {name for name in STORE.types if name.startswith("optopad_msgs")} == {
        f"optopad_msgs/msg/{name}" for name in ("Contact", "Frame", "Press", "Sensor", "Touch")
    }
