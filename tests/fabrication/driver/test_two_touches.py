"""Two touches in the frames of a simulated board: found, numbered, and said on the screen and in JSON."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from optopad.cli import main
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.fabrication.driver.simulated.finger import HOVER_MM, FingerPath
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver.stream import LinkCounts
from optopad.fabrication.driver.touch_reader import Touch, TouchReader
from optopad.fabrication.driver_config import dump_driver_config
from optopad.screen.live_sensor import contacts_json, picture, touch_json, touch_view
from optopad.sims.learning.inference.model_file import save_model
from tests.fabrication.driver.made_up_model import made_up_model
from tests.fabrication.driver.made_up_pad import untouched
from tests.fabrication.driver.two_finger_pad import RADIUS_MM, PlainSensor, board_of, two_touch_model

REST_S, RATE_HZ = 0.6, 60.0
STEPS = [  # time [s], x and depth of the first finger at y = 13 mm, x and depth of the second one at y = 18.5 mm
    (0.0, 10.0, HOVER_MM, 22.0, HOVER_MM),
    (REST_S, 10.0, HOVER_MM, 22.0, HOVER_MM),
    (REST_S + 0.3, 10.0, 2.0, 22.0, 1.0),
    (REST_S + 1.1, 22.0, 1.0, 10.0, 2.0),
    (REST_S + 1.3, 22.0, HOVER_MM, 10.0, 2.0),
    (REST_S + 1.6, 22.0, HOVER_MM, 10.0, 2.0),
    (REST_S + 1.8, 22.0, HOVER_MM, 10.0, HOVER_MM),
    (REST_S + 2.0, 22.0, HOVER_MM, 10.0, HOVER_MM),
    (REST_S + 2.2, 22.0, 2.0, 10.0, HOVER_MM),
]
FINGERS = FingerPath(
    time_s=np.array([step[0] for step in STEPS]),
    press_mm=np.array([[(a, 13.0, da), (b, 18.5, db)] for _, a, da, b, db in STEPS]),
)
"""Two fingers that pass each other while the second one becomes the deeper one; then each is lifted."""


@pytest.fixture(scope="module")
def read() -> tuple[TouchReader, list[Touch]]:
    sensor = PlainSensor(board_of(FINGERS), RATE_HZ)
    reader = TouchReader(sensor, two_touch_model(), touches=2, start_s=0.5)  # type: ignore[arg-type]
    return reader, list(reader.touches(seconds=FINGERS.time_s[-1] - 0.5))


def tips_at(touch: Touch) -> np.ndarray:
    tips = FINGERS.at(touch.frame.device_us / 1e6)
    return np.asarray(tips[tips[:, 2] > 0.0])


def test_every_finger_is_found_where_it_presses_and_keeps_its_number(
    read: tuple[TouchReader, list[Touch]],
) -> None:
    assert FINGERS.nearest_mm().min() < 2.8 * RADIUS_MM
    seen = {1: 0, 2: 0}
    for touch in read[1]:
        tips = tips_at(touch)
        if (tips[:, 2] < 0.3).any():  # too light for a model
            continue
        assert len(touch.contacts) == len(tips)
        assert touch.is_touched == bool(len(tips))
        depths = [one.press_mm[2] for one in touch.contacts]
        assert depths == sorted(depths, reverse=True)
        for one in touch.contacts:
            (finger,) = np.flatnonzero(np.linalg.norm(tips - one.press_mm, axis=1) < 0.3)
            first = tips[finger, 1] == 13.0
            late = touch.frame.device_us / 1e6 > REST_S + 1.9
            assert one.number == (3 if late else 1 if first else 2)
            seen[2 - first] += 1
    assert min(seen.values()) > 50


def test_the_frame_s_own_fields_are_those_of_the_deeper_contact_and_two_never_slip(
    read: tuple[TouchReader, list[Touch]],
) -> None:
    two = [touch for touch in read[1] if len(touch.contacts) == 2]
    assert {touch.contacts[0].number for touch in two} == {1, 2}
    for touch in two:
        first, second = touch.contacts
        for name in ("press_mm", "sigma_mm", "point_mm", "normal", "force_n", "force_sigma_n"):
            assert getattr(touch, name) is getattr(first, name)
        assert first.force_n >= second.force_n > 0.0
        assert second.point_mm == pytest.approx([*second.press_mm[:2], 8.0])
        assert not touch.is_slipping
    (still, *_) = (touch for touch in read[1] if not touch.contacts)
    assert np.isnan(still.press_mm).all()
    assert still.force_n == 0.0


def test_one_touch_is_the_same_for_a_reader_of_one_and_of_two() -> None:
    path = FingerPath(
        time_s=np.array([0.0, 0.6, 0.8, 1.2]),
        press_mm=np.array([[12.0, 15.0, depth] for depth in (HOVER_MM, HOVER_MM, 2.0, 2.0)]),
    )
    one, two = (
        list(
            TouchReader(
                PlainSensor(board_of(path), RATE_HZ), two_touch_model(), touches=n, start_s=0.5
            ).touches(40)
        )  # type: ignore[arg-type]
        for n in (1, 2)
    )
    assert [len(touch.contacts) for touch in one] == [len(touch.contacts) for touch in two]
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a.press_mm, b.press_mm, equal_nan=True)
        assert np.array_equal(a.sigma_mm, b.sigma_mm, equal_nan=True)
        assert (a.force_n, a.is_slipping) == (b.force_n, b.is_slipping)
        assert [c.number for c in a.contacts] == [c.number for c in b.contacts]


def test_two_contacts_have_a_line_each_an_entry_each_and_a_mark_each(
    read: tuple[TouchReader, list[Touch]],
) -> None:
    reader, touches = read
    two = next(touch for touch in touches if len(touch.contacts) == 2 and touch.contacts[1].press_mm[2] > 0.9)
    first, second = str(two).splitlines()
    assert first.startswith("touched   #1 x 1")
    assert ", score +" in first
    assert second == f"touched   {two.contacts[1]}"
    assert str(two.contacts[1]).startswith("#2 x 2")
    assert "depth 0.9" in second or "depth 1.0" in second
    (still, *_) = (touch for touch in touches if not touch.contacts)
    assert str(still) == f"untouched, score {still.touch_score:+.2f}"
    listed = json.loads(json.dumps(contacts_json(two)))["contacts"]
    assert [one["number"] for one in listed] == [1, 2]
    assert listed[0]["x_mm"] == touch_json(two)["x_mm"]
    assert set(listed[1]) == {"number", "x_mm", "y_mm", "depth_mm", "sigma_mm", "force_n", "force_sigma_n"}
    assert contacts_json(still) == {"contacts": []}
    sensor = reader.sensor
    assert sum(mark in row for row in picture(two, reader) for mark in "○◉●") == 2
    sensor.port, sensor.counts = "pad", LinkCounts(frames=9)  # type: ignore[misc]
    for touch, rows in ((two, [str(one) for one in two.contacts]), (still, ["#- -", "#- -"])):
        console = Console(width=160, record=True, file=io.StringIO())
        console.print(touch_view(touch, reader))
        said = [" ".join(line.rpartition("|")[2].split()) for line in console.export_text().splitlines()]
        assert [line for line in said if line.startswith("#")] == rows


def test_a_model_of_one_touch_and_three_touches_are_refused_with_the_way_out() -> None:
    sensor = PlainSensor(board_of(FINGERS), RATE_HZ)
    ridge, single = made_up_model(), replace(two_touch_model(), together=None)
    for model in (ridge, single):
        with pytest.raises(InputError, match=r"optopad train DATA .*--touches 2"):
            TouchReader(sensor, model, touches=2)  # type: ignore[arg-type]
    for number in (0, 3):
        with pytest.raises(InputError, match=f"touches: {number} is refused; the models know one or two"):
            TouchReader(sensor, two_touch_model(), touches=number)  # type: ignore[arg-type]


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str, str]:
    text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
    (tmp_path / "driver.toml").write_text(text, encoding="utf-8")
    save_model(tmp_path / "two.optomodel", two_touch_model())
    save_model(tmp_path / "one.optomodel", made_up_model())
    return str(tmp_path / "driver.toml"), str(tmp_path / "two.optomodel"), str(tmp_path / "one.optomodel")


def test_read_refuses_touches_that_its_model_does_not_know_before_the_port_is_opened(
    files: tuple[str, str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    config, two, one = files
    for options, told in (
        (
            ["--touches", "2"],
            "--touches: 2 needs --model, which finds the touches; add it, or drop --touches",
        ),
        (["--touches", "2", "--model", one], f"{one}: model: kernel-ridge knows one touch"),
        (["--touches", "3", "--model", two], "touches: 3 is refused; the models know one or two"),
    ):
        assert main(["driver", "read", config, "--port", "nowhere", *options]) == 2
        assert told in capsys.readouterr().err


@pytest.mark.slow
def test_read_lists_the_contacts_of_every_frame(
    files: tuple[str, str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    config, two, _ = files
    slow = replace(FINGERS, time_s=FINGERS.time_s + 2.0 * (FINGERS.time_s > 0.0))  # for a busy machine
    with FakePort(board_of(slow)) as port:
        command = ["driver", "read", config, "--port", port.name, "--model", two, "--touches", "2"]
        assert main([*command, "--json", "--seconds", "4"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    both = [line["contacts"] for line in lines if len(line["contacts"]) == 2]
    assert len(both) > 30
    assert {tuple(sorted(one["number"] for one in contacts)) for contacts in both} == {(1, 2)}
    assert next(line["contacts"] for line in lines if not line["touched"]) == []
