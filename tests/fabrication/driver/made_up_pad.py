"""A pad whose light is made up, not traced: enough to drive software with. Straight light falls with both cosines and
the distance squared; a press takes a share of it from the pairs whose chord it is near to."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np

from optopad.design.preset import preset
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.finger import NO_FINGER, Finger
from optopad.fabrication.driver.simulated.press_table import PressTable
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.driver_file import DriverConfig, config_from_document

NAME = "piacenza2017-pad"
FULL_SCALE = 1023


@cache
def pad_config(name: str = NAME) -> DriverConfig:
    """Driver configuration of a preset with the made-up pattern as the expected one."""
    document = tomllib.loads(dump_driver_config(preset(name), 1e5, np.minimum(untouched(name), FULL_SCALE)))
    return config_from_document(document, where="driver.toml")


@cache
def untouched(name: str = NAME) -> np.ndarray:
    """(emitter, receiver) signals of the untouched pad, median of the others 300; not clipped [counts]."""
    config = config_from_document(tomllib.loads(dump_driver_config(preset(name))), where="driver.toml")
    e, r = (np.array([part.position_mm for part in parts]) for parts in (config.emitters, config.receivers))
    en, rn = (np.array([part.normal for part in parts]) for parts in (config.emitters, config.receivers))
    way = r[None] - e[:, None]
    far = np.linalg.norm(way, axis=2)
    cosines = np.einsum("ijk,ik->ij", way, en) * -np.einsum("ijk,jk->ij", way, rn) / far**2
    straight = np.clip(cosines, 0.02, None) / far**2
    return np.asarray(300 * straight / np.median(straight))


@cache
def press_table(name: str = NAME) -> PressTable:
    """5 x 5 places, 6 depths."""
    config, flat = pad_config(name), untouched(name)
    area = config.workspace
    x, y = np.linspace(area.x0_mm, area.x1_mm, 5), np.linspace(area.y0_mm, area.y1_mm, 5)
    depth = np.linspace(0.0, area.max_depth_mm, 6)
    e, r = (
        np.array([part.position_mm[:2] for part in parts]) for parts in (config.emitters, config.receivers)
    )
    chord = r[None] - e[:, None]
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)[:, :, None, None]
    along = np.clip(((places - e[:, None]) * chord).sum(-1) / (chord**2).sum(-1), 0, 1)
    distance = np.linalg.norm(e[:, None] + along[..., None] * chord - places, axis=-1)
    kept = (
        1
        - 0.8 * np.exp(-((distance / 4.0) ** 2))[:, :, None] * (depth / depth[-1])[None, None, :, None, None]
    )
    return PressTable(x_mm=x, y_mm=y, depth_mm=depth, counts=flat * kept)


def board(path: Finger = NO_FINGER, **options: object) -> FakeBoard:
    """A simulated board of the made-up pad."""
    return FakeBoard(pad_config(), press_table(), path, **options)  # type: ignore[arg-type]


def frame(counts: np.ndarray) -> Frame:
    """A frame of these counts (state, receiver)."""
    whole = counts.astype(np.uint16)
    return Frame(
        connection=1,
        sequence=0,
        device_us=0,
        host_s=0.0,
        lost_before=0,
        counts=whole,
        signals=whole[:-1].astype(np.int32) - whole[-1],
        saturated=whole >= 1023,
    )
