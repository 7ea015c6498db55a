"""Paths of one finger and of two, and the signals of a simulated board under both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import PRESETS
from optopad.fabrication.driver.simulated.board import LIGHT_NOISE, FakeBoard
from optopad.fabrication.driver.simulated.finger import (
    HOVER_MM,
    FingerPath,
    demo_path,
    read_path,
    two_finger_path,
)
from optopad.fabrication.driver.simulated.press_table import SplineTable
from optopad.fabrication.driver_file import MemoryNote
from tests.fabrication.driver.made_up_pad import FULL_SCALE, pad_config, press_table
from tests.sims.learning.made_up_map import made_up_signal_map, ratios, untouched_counts

HEADING = "t_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm\n"


def test_the_nearest_distance_of_two_fingers_is_that_of_many_times_at_which_both_touch() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        path = FingerPath(time_s=np.array([0.0, 1.0]), press_mm=rng.uniform(-3.0, 3.0, (2, 2, 3)))
        tips = path.at(np.linspace(0.0, 1.0 - 1e-9, 4001))
        both = (tips[..., 2] > 0.0).all(axis=1)
        distance = np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1)[both]
        if len(distance) > 2:
            assert path.nearest_mm()[0] == pytest.approx(distance.min(), abs=0.01)
        elif not len(distance):
            assert path.nearest_mm()[0] == np.inf
    assert (demo_path(pad_config().workspace).nearest_mm() == np.inf).all()


@pytest.mark.parametrize("name", PRESETS)
def test_the_fingers_of_the_demonstration_touch_alone_and_together_and_stay_apart(name: str) -> None:
    workspace = pad_config(name).workspace
    path = two_finger_path(workspace, tip_radius_mm=0.1 * (workspace.y1_mm - workspace.y0_mm))
    apart_mm = 0.4 * (workspace.y1_mm - workspace.y0_mm)
    assert path.nearest_mm().min() == pytest.approx(apart_mm, rel=0.01)
    touching = (path.at(np.arange(0.0, path.time_s[-1], 0.05))[..., 2] > 0.0).sum(axis=1)
    assert set(touching) == {0, 1, 2}
    places = path.press_mm[..., :2].reshape(-1, 2)
    assert all(workspace.area.contains(*place) for place in places)
    with pytest.raises(InputError, match=r"smaller indenter\.tip_radius_mm"):
        two_finger_path(workspace, tip_radius_mm=0.5 * (workspace.y1_mm - workspace.y0_mm))


def test_a_path_of_two_fingers_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "fingers.csv"
    path = two_finger_path(pad_config().workspace)
    file.write_text(path.csv_text())
    again = read_path(file, 3.0)
    assert again.press_mm == pytest.approx(path.press_mm, abs=1e-4)
    assert again.time_s == pytest.approx(path.time_s, abs=1e-4)
    file.write_text(HEADING.replace(",depth2_mm", "") + "0,10,16,1,22,16\n")
    with pytest.raises(InputError, match=r"has no depth2_mm; needs the heading t_s,x_mm,.*,depth2_mm"):
        read_path(file)
    file.write_text(HEADING + "0,10,16,1,15,16,0\n1,10,16,1,15,16,1\n")
    with pytest.raises(InputError, match=r"row 2: .* within 5.00 mm .* radius of 3 mm need 6 mm; move x2_mm"):
        read_path(file, 3.0)
    assert read_path(file, 2.4).press_mm.shape == (2, 2, 3)
    file.write_text(HEADING + "0,10,16,1,15,16,0\n1,10,16,0,15,16,1\n2,10,16,-1,15,16,1\n")
    with pytest.raises(InputError, match="row 2: "):  # half of both at a time
        read_path(file, 3.0)


def test_signals_under_two_fingers_are_the_product_of_single_ratios() -> None:
    table = press_table()
    tips = np.array([[10.0, 16.0, 2.0], [22.0, 18.0, 1.0]])
    one, other = table.at(tips) / table.untouched
    assert table.together(tips) == pytest.approx(table.untouched * one * other)
    assert table.together(tips[::-1]) == pytest.approx(table.together(tips), rel=1e-12)
    lifted = np.array([tips[0], [22.0, 18.0, HOVER_MM]])
    assert np.array_equal(table.together(lifted), table.at(tips[0])[0])
    dark = replace(table, counts=table.counts * (np.arange(8) > 0))
    assert np.isfinite(dark.together(tips)).all()


def test_a_spline_of_ratios_has_the_same_rule_for_several_tips() -> None:
    table = SplineTable(
        untouched=untouched_counts().reshape(8, 8), ratio_root=made_up_signal_map().ratio_root
    )
    tips = np.array([[10.3, 16.2, 2.0], [22.1, 18.4, 1.0], [16.0, 10.0, HOVER_MM]])
    expected = (untouched_counts() * ratios(tips[:2]).prod(axis=0)).reshape(8, 8)
    assert table.together(tips) == pytest.approx(expected, rel=5e-3)
    assert np.array_equal(table.together(tips[2]), table.untouched)


def test_what_two_fingers_leave_is_of_the_deeper_one_s_deepest_moment_and_begins_when_both_are_lifted() -> (
    None
):
    first, second = (10.0, 16.0), (22.0, 16.0)
    depths = [(HOVER_MM, HOVER_MM), (3.0, 1.0), (HOVER_MM, 0.5), (HOVER_MM, HOVER_MM), (HOVER_MM, HOVER_MM)]
    path = FingerPath(
        time_s=np.arange(5.0), press_mm=np.array([[(*first, one), (*second, other)] for one, other in depths])
    )
    config = replace(pad_config(), memory=MemoryNote(residue=0.2, decay_s=10.0))
    forgetful, keeping = (FakeBoard(one, press_table(), path) for one in (pad_config(), config))
    kept = {}
    for now_s in (0.5, 1.0, 2.0, 3.2):
        pairs = [keeping.counts(now_s) - 1.0 * forgetful.counts(now_s) for _ in range(40)]
        kept[now_s] = np.mean(pairs, axis=0)
    noise = 6.0 * LIGHT_NOISE * FULL_SCALE / np.sqrt(20.0)
    assert np.abs(kept[1.0]).max() < noise
    assert np.abs(kept[2.0]).max() < noise  # one finger is still down
    change = press_table().together(path.press_mm[1]) - press_table().untouched
    clear = press_table().untouched < 900.0  # below full scale
    assert kept[3.2][:-1][clear] == pytest.approx(0.2 * change[clear], abs=noise)
    assert 0.2 * np.abs(change).max() > 5.0 * noise
