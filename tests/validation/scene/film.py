"""The demo scene as a moving picture: gripper and objects, and what the left pad's taxels measure.

MUJOCO_GL=egl python -m tests.validation.scene.film     writes docs/images/scene.gif; a few seconds
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from optopad.design.preset import preset
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.contact_fit import tuned
from optopad.fabrication.scene.demo import OBJECT_RGBA, demo_spec, drive, duration_s
from optopad.fabrication.scene.mjcf import SILICONE_RGBA, taxels_mm

FILE = Path(__file__).parents[3] / "docs" / "images" / "scene.gif"
PAD, FRAMES_HZ, SPEED = "gripper-teensy", 8.0, 1.6
"""Design, pictures per second, and time of the scene over that of the film."""
SCENE_PX, TAXEL_PX, GAP_PX = (252, 336), 6, 8
COLOURS = 128
DEEPEST_MM = 1.0
BLANK, TOUCHED = np.array([238.0, 240.0, 243.0]), np.array([176.0, 32.0, 40.0])


def taxel_picture(design: SensorDesign, depth_m: np.ndarray) -> np.ndarray:
    """Picture (rows, columns, 3) of taxels by their depth; y upward, as on the pad."""
    taxels = taxels_mm(design)
    (columns, column), (rows, row) = (np.unique(taxels[:, axis], return_inverse=True) for axis in (0, 1))
    share = np.zeros((len(rows), len(columns)))
    share[len(rows) - 1 - row, column] = np.clip(depth_m * 1e3 / DEEPEST_MM, 0.0, 1.0)
    colours = BLANK + share[..., None] * (TOUCHED - BLANK)
    return np.kron(colours, np.ones((TAXEL_PX, TAXEL_PX, 1))).astype(np.uint8)


def film(design: SensorDesign, seconds: float | None = None) -> list[Image.Image]:
    """Pictures of the demo scene, up to a time of the scene [s] or its end."""
    model = demo_spec(design).compile()
    for name in ("left", "right"):
        tuned(model, name)
    data, pictures = mujoco.MjData(model), []
    end, due = seconds or duration_s(model), 0.0
    with mujoco.Renderer(model, *SCENE_PX) as renderer:
        while data.time < end:
            drive(model, data)
            mujoco.mj_step(model, data)
            if data.time < due:
                continue
            due += SPEED / FRAMES_HZ
            renderer.update_scene(data, "side")
            scene = renderer.render()
            depth = data.sensor("left_pad_tactile").data.reshape(3, -1)[0]
            pad = taxel_picture(design, depth)
            whole = np.full((SCENE_PX[0], SCENE_PX[1] + pad.shape[1] + 2 * GAP_PX, 3), 255, np.uint8)
            top = (SCENE_PX[0] - pad.shape[0]) // 2
            whole[:, : SCENE_PX[1]] = scene
            whole[top : top + pad.shape[0], SCENE_PX[1] + GAP_PX : -GAP_PX] = pad
            pictures.append(Image.fromarray(whole))
    return pictures


def write(pictures: list[Image.Image], file: Path) -> None:
    """Write pictures as a GIF with one palette, repeated for ever.

    The palette is that of a few pictures and of the colours of small things, which would be too few to count.
    """
    some = np.concatenate([np.asarray(one) for one in pictures[:: max(len(pictures) // 6, 1)]])
    shares = np.linspace(0.0, 1.0, 16)[:, None]
    bright = [
        255.0 * np.array(one[:3]) * (0.4 + 0.6 * shares) for one in (*OBJECT_RGBA.values(), SILICONE_RGBA)
    ]
    swatches = np.concatenate([*bright, BLANK + shares * (TOUCHED - BLANK)])
    strip = np.kron(swatches[:, None], np.ones((40, some.shape[1], 1))).astype(np.uint8)
    palette = Image.fromarray(np.concatenate([some, strip])).quantize(COLOURS)
    first, *rest = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures)
    first.save(
        file, save_all=True, append_images=rest, duration=round(1e3 / FRAMES_HZ), loop=0, optimize=True
    )


if __name__ == "__main__":
    assert plan_of(preset(PAD)).is_block
    write(film(preset(PAD)), FILE)
    print(f"{FILE}: {FILE.stat().st_size / 1e6:.2f} MB")
