"""The environment GraspDepth: Gymnasium's own checks, seeds, rewards, and a simple rule that solves it."""

from __future__ import annotations

import os
import re
import runpy
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.envs import BONUS, CRUSHED, HOLD, TARGET_MM, WITHIN_MM, GraspDepth
from tests.fabrication.scene.made_up_scene import StandInLight

DESIGN = preset("gripper-stadium")
PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "grasp.md"
CLOSE, STAY = np.array([1.0], np.float32), np.array([0.0], np.float32)


class FineLight(StandInLight):
    """The stand-in for the map of light, with nodes so close that every object covers some."""

    def __init__(self, design: SensorDesign = DESIGN) -> None:
        super().__init__(design)
        x, y = (np.arange(0.25, side, 0.5) for side in (self._cavity.length_mm, self._cavity.width_mm))
        places = np.stack([one.ravel() for one in np.meshgrid(x, y)], axis=1)
        self.points_mm = np.column_stack([places, np.full(len(places), self._cavity.clear_mm)])


@cache
def made() -> GraspDepth:
    env = gymnasium.make("optopad.envs:GraspDepth-v0", design=DESIGN, light=FineLight())
    assert env.spec is not None
    assert env.spec.max_episode_steps == 200
    found = env.unwrapped
    assert isinstance(found, GraspDepth)
    return found


def episode(seed: int, action: np.ndarray, most: int = 200) -> Iterator[tuple[np.ndarray, float, bool, dict]]:
    env = made()
    env.reset(seed=seed)
    for _ in range(most):
        seen, reward, ended, _, info = env.step(action)
        yield seen, reward, ended, info
        if ended:
            return


@pytest.mark.slow
def test_gymnasiums_checks_pass() -> None:
    check_env(made(), skip_render_check=True)


def test_equal_seeds_give_equal_episodes_and_others_other_objects() -> None:
    first, again, other = (list(episode(seed, CLOSE, 30)) for seed in (3, 3, 4))
    for one, two in zip(first, again, strict=True):
        assert np.array_equal(one[0], two[0])
        assert one[1:] == two[1:]
    assert first[0][3]["half_mm"] != other[0][3]["half_mm"]


def test_the_observation_is_one_without_a_touch_and_changes_with_it() -> None:
    steps = list(episode(0, CLOSE))
    untouched = [seen for seen, _, _, info in steps if info["depth_mm"] == 0.0]
    assert len(untouched) > 3
    assert np.abs(np.array(untouched) - 1.0).mean() < 0.02
    deepest = max(steps, key=lambda one: one[3]["depth_mm"])
    assert np.abs(deepest[0] - 1.0).max() > 0.05


def test_closing_on_and_on_crushes_the_object_and_costs_the_bonus() -> None:
    *before, (_, reward, ended, info) = episode(1, CLOSE)
    assert ended
    assert info["depth_mm"] > CRUSHED * TARGET_MM
    assert reward == pytest.approx(-min((info["depth_mm"] - TARGET_MM) / TARGET_MM, 1.0) - BONUS)
    for _, earlier, _, told in before:
        assert earlier == pytest.approx(-min(abs(told["depth_mm"] - TARGET_MM) / TARGET_MM, 1.0))
        assert not told["is_success"]


def test_holding_the_depth_ends_with_the_bonus() -> None:
    env = made()
    _, info = env.reset(seed=2)
    held = 0
    while not info["is_success"]:
        speed = np.clip(
            2.0 * (TARGET_MM - info["depth_mm"]), -1.0, 1.0
        )  # by the depth that a robot does not know
        _, reward, ended, _, info = env.step(np.array([speed], np.float32))
        held = held + 1 if abs(info["depth_mm"] - TARGET_MM) <= WITHIN_MM else 0
    assert ended
    assert held == HOLD
    assert reward > BONUS - WITHIN_MM / TARGET_MM - 1e-9


def test_bad_input_is_refused() -> None:
    with pytest.raises(InputError, match=r"target_mm: 3 mm is refused; give 0.2 to 1 mm"):
        GraspDepth(DESIGN, light=FineLight(), target_mm=3.0)
    with pytest.raises(InputError, match=r"render_mode: 'human' is refused; give 'rgb_array' or None"):
        GraspDepth(DESIGN, light=FineLight(), render_mode="human")


@pytest.mark.full
def test_the_simple_rule_of_the_page_reaches_the_depth(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("optopad.sims.robot.fast_light.fast_light", FineLight)
    (program,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    (tmp_path / "rule.py").write_text(program, encoding="utf-8")
    reached = sum(runpy.run_path(str(tmp_path / "rule.py"))["results"])
    assert reached >= 24
    assert capsys.readouterr().out == f"{reached} of 30 grasps reached the depth\n"


@pytest.mark.slow
def test_the_picture_shows_the_scene() -> None:
    if os.environ.get("MUJOCO_GL") not in ("egl", "osmesa"):
        pytest.skip("pictures need OpenGL without a screen: MUJOCO_GL=egl or osmesa")
    env = GraspDepth(DESIGN, light=FineLight(), render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert picture.shape == (480, 640, 3)
    assert picture.std() > 20.0
    env.close()
