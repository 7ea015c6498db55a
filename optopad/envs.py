"""A Gymnasium environment: close a gripper on an object until the touch has a depth, by the pad's frames alone.

    env = gymnasium.make("optopad.envs:GraspDepth-v0", design="piacenza2017-pad")

It needs the extra `gym`, and the pad's map of light: run `optopad scene DESIGN --fit` once.

    observation   signals of the left pad over its untouched signals, a row of all pairs [-]
    action        speed of closing over `FASTEST_MM_S`, -1 (open) to 1 (close)
    reward        minus the error of the depth over the target, at least -1; and `BONUS` for a success, or its negative
                  for a crushed object
    terminated    the depth was within `WITHIN_MM` of the target for `HOLD` steps, or exceeds `CRUSHED` targets
    truncated     after 200 steps of 20 ms

The depth of MuJoCo is in the reward and in `info`, not in the observation. The object's kind, size and place are drawn
at each reset, and the noise of the electronics with them; all follow from the seed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from optopad.api import load
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.grasp import GraspScene

if TYPE_CHECKING:
    from optopad.fabrication.scene.pad_light import PadLight

Observation = NDArray[np.float32]

TARGET_MM, WITHIN_MM, HOLD = 0.5, 0.1, 5
"""Depth to reach, accepted error [mm], and steps for which it is held."""
CRUSHED = 1.6
"""Depth at which an episode fails, over the target; maps of light of thin pads end at about twice the target."""
FASTEST_MM_S = 10.0
"""Largest speed of each finger."""
BONUS = 10.0
HIGHEST = 4.0
"""Largest signal in an observation, over the untouched one [-]."""
MOST_STEPS = 200


class GraspDepth(gymnasium.Env[Observation, Observation]):
    """Close on an object until the touch is 0.5 mm deep.

    Parameters
    ----------
    design : the pads' design, or a design file or preset
    light : map of its light, or its file; None for the one that `optopad scene DESIGN --fit` stored
    target_mm : depth to reach [mm]
    render_mode : "rgb_array" for pictures of the scene, which need OpenGL (without a screen: MUJOCO_GL=egl); or None

    Raises
    ------
    InputError : a value is invalid, or the design has no map of light.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 (Gymnasium's own form)

    def __init__(
        self,
        design: SensorDesign | str | Path = "piacenza2017-pad",
        *,
        light: PadLight | str | None = None,
        target_mm: float = TARGET_MM,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode: {render_mode!r} is refused; give 'rgb_array' or None")
        if not 0.2 <= target_mm <= 1.0:
            raise InputError(f"target_mm: {target_mm:g} mm is refused; give 0.2 to 1 mm")
        self.render_mode, self.target_mm = render_mode, target_mm
        self._scene = GraspScene(design if isinstance(design, SensorDesign) else load(design), light)
        self._scene.begin(np.random.default_rng(0))
        pairs = self._scene.frame.signals.size
        self.observation_space = spaces.Box(0.0, HIGHEST, (pairs,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self._held = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Draw an object; equal seeds give equal episodes."""
        super().reset(seed=seed, options=options)
        self._scene.begin(self.np_random)
        self._held = 0
        return self._observation(), self._info()

    def step(self, action: Observation) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Close at a speed for 20 ms."""
        speed = float(np.clip(np.asarray(action, np.float64).ravel()[0], -1.0, 1.0))
        self._scene.close(speed * FASTEST_MM_S)
        off_mm = abs(self._scene.depth_mm - self.target_mm)
        self._held = self._held + 1 if off_mm <= WITHIN_MM else 0
        is_success = self._held >= HOLD
        is_crushed = self._scene.depth_mm > CRUSHED * self.target_mm
        reward = -min(off_mm / self.target_mm, 1.0) + BONUS * is_success - BONUS * is_crushed
        return self._observation(), reward, is_success or is_crushed, False, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """Picture of the scene (480, 640, 3); None without a render mode."""
        return None if self.render_mode is None else self._scene.picture()

    def close(self) -> None:
        """Free the renderer."""
        self._scene.close_renderer()

    def _observation(self) -> Observation:
        signals = np.nan_to_num(self._scene.frame.normalised.ravel(), nan=1.0)
        return np.clip(signals, 0.0, HIGHEST).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        return {"depth_mm": self._scene.depth_mm, "is_success": self._held >= HOLD, **self._scene.object}


gymnasium.register(id="GraspDepth-v0", entry_point="optopad.envs:GraspDepth", max_episode_steps=MOST_STEPS)
