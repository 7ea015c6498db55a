"""Pictures of the demo scene: the objects are seen, and the taxels show where the pad is touched."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        os.environ.get("MUJOCO_GL") not in ("egl", "osmesa"),
        reason="pictures need OpenGL without a screen: MUJOCO_GL=egl or osmesa",
    ),
]


def test_the_film_shows_the_objects_and_the_touch(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    from tests.validation.scene.film import SCENE_PX, film, write

    from .pads import FLAT, design_of

    pictures = film(design_of(FLAT), 2.4)
    scene = [np.asarray(one, np.float64)[:, : SCENE_PX[1]] for one in pictures]
    pad = [np.asarray(one, np.float64)[:, SCENE_PX[1] :] for one in pictures]
    red, green, blue = (scene[0][..., k] for k in range(3))
    assert ((red > 1.8 * blue) & (red > 1.8 * green)).sum() > 30  # the cylinder
    assert ((blue > 1.5 * red) & (blue > 1.2 * green)).sum() > 60  # the box
    assert ((green > 1.4 * red) & (green > 1.4 * blue)).sum() > 60  # the ball
    touched = [int((one[..., 0] - one[..., 1] > 40.0).sum()) for one in pad]
    assert touched[0] == 0
    assert touched[-1] > 300
    write(pictures, tmp_path / "scene.gif")
    with image.open(tmp_path / "scene.gif") as found:
        assert found.n_frames >= len(pictures) - 2  # equal pictures become one
