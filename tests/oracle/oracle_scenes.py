"""Scenes and analytic presses that the oracle's tests share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.top import Top
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField, smooth_field
from optopad.sims.press import Indentation
from tests.oracle.surface import Surface
from tests.oracle.top import Tip, lower_top


def scene_of(
    emitters: list[tuple[int, float, float, float, float]],
    receivers: list[tuple[int, float, float, float, float]],
    **changes: Any,
) -> OpticalScene:
    """A 32 x 32 x 8 mm block; emitters and receivers are rows of wall, along, z, half width, half height."""
    fields: dict[str, Any] = {
        "length_mm": 32.0,
        "width_mm": 32.0,
        "height_mm": 8.0,
        "refractive_index": 1.41,
        "absorption_per_mm": 0.0,
        "wall_reflectance": 0.05,
        "bottom_reflectance": 0.03,
        "tip_reflectance": 0.0,
        "emitter_wall": np.array([row[0] for row in emitters], dtype=np.int64),
        "emitter_patch": np.array([row[1:] for row in emitters], dtype=np.float64).reshape(-1, 4),
        "emitter_order": np.ones(len(emitters)),
        "receiver_wall": np.array([row[0] for row in receivers], dtype=np.int64),
        "receiver_patch": np.array([row[1:] for row in receivers], dtype=np.float64).reshape(-1, 4),
    }
    return OpticalScene(**(fields | changes))


def flat_top(*tips: Tip, field: SmoothField | None = None, where: str = "indentations") -> Surface:
    """The block's flat top in numbers, under tips, each a centre and a press."""
    return lower_top(Top(clear_mm=8.0, apex_mm=(16.0, 16.0)), tips, field, where)


def flat_field(height_mm: float) -> SmoothField:
    """One height added to the block's whole top."""
    return smooth_field(lambda x, y: height_mm + 0.0 * (x + y), 32.0, 32.0, 4.0)


def ring_scene(**changes: Any) -> OpticalScene:
    """8 emitters of 1 x 1 mm and 8 receivers of 2.65 x 2.65 mm in turn around the pad, at mid-height."""
    emitters, receivers = [], []
    for wall in range(4):
        for k, along in enumerate((4.0, 12.0, 20.0, 28.0)):
            if (k % 2 == 0) == (wall < 2):
                emitters.append((wall, along, 4.0, 0.5, 0.5))
            else:
                receivers.append((wall, along, 4.0, 1.325, 1.325))
    return scene_of(emitters, receivers, **changes)


def dimple_height_mm(radius_mm: FloatArray, depth_mm: float, bulge_mm: float = 0.0) -> FloatArray:
    """Height of an analytic dimple under a 3 mm tip: sphere, then a cubic skirt that meets it smoothly.

    The skirt carries an optional bulge, 16 b x² (1 - x)² with x from 0 at the contact to 1 at the rim.
    """
    contact, drop, reach = dimple_shape_mm(depth_mm)
    inside = -depth_mm + 3.0 - np.sqrt(9.0 - np.minimum(radius_mm, contact) ** 2)
    x = np.clip((radius_mm - contact) / reach, 0.0, 1.0)
    skirt = -drop * (1.0 - x) ** 3 + 16.0 * bulge_mm * x**2 * (1.0 - x) ** 2
    return np.where(radius_mm < contact, inside, skirt)


def dimple_shape_mm(depth_mm: float) -> tuple[float, float, float]:
    """Contact radius, height lost beyond it, and width of the skirt of the analytic dimple [mm]."""
    contact = min(math.sqrt(3.0 * depth_mm), 2.7)
    rise = 3.0 - math.sqrt(9.0 - contact**2)
    slope = contact / math.sqrt(9.0 - contact**2)
    return contact, depth_mm - rise, 3.0 * (depth_mm - rise) / slope


def dimple(depth_mm: float, bulge_mm: float = 0.0, points: int = 400) -> Indentation:
    """The analytic dimple as a press, sampled densely enough that readings of the curve agree."""
    contact, _, reach = dimple_shape_mm(depth_mm)
    radius = np.concatenate(
        [np.linspace(0.0, contact, 100)[:-1], np.linspace(contact, contact + reach, points)]
    )
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=3.0,
        radius_mm=radius,
        height_mm=dimple_height_mm(radius, depth_mm, bulge_mm),
        contact_radius_mm=contact,
        force_n=1.0,
    )


def wrapped_press() -> Indentation:
    """5.5 mm deep under a 3 mm tip: sphere, wetted shank up to -1.5 mm, a fold that runs back, a rim."""
    angle = np.linspace(0.0, 0.5 * math.pi, 60)
    tip = np.column_stack([3.0 * np.sin(angle), -2.5 - 3.0 * np.cos(angle)])
    shank = np.column_stack([np.full(10, 3.0), np.linspace(-2.5, -1.5, 11)[1:]])
    fold = np.array([[3.2, -1.1], [3.5, -0.8], [3.6, -0.6], [3.5, -0.4], [3.45, -0.2], [3.6, 0.0]])
    rim = np.array([[3.9, 0.1], [4.5, 0.1], [5.5, 0.04], [7.0, 0.0]])
    curve = np.vstack([tip, shank, fold, rim])
    return Indentation(
        depth_mm=5.5,
        tip_radius_mm=3.0,
        radius_mm=curve[:, 0],
        height_mm=curve[:, 1],
        contact_radius_mm=3.0,
        force_n=40.0,
    )


def shank_press() -> Indentation:
    """4.6 mm deep under a 3 mm tip: sphere, 0.5 mm of wetted shank, a smooth skirt with a bulge, no fold."""
    angle = np.linspace(0.0, 0.5 * math.pi, 60)
    tip = np.column_stack([3.0 * np.sin(angle), -1.6 - 3.0 * np.cos(angle)])
    shank = np.column_stack([np.full(6, 3.0), np.linspace(-1.6, -1.1, 7)[1:]])
    s = np.linspace(0.0, 1.0, 120)[1:]
    skirt = np.column_stack([3.0 + 3.0 * s**1.8, -1.1 * (1.0 - s) ** 2 + 1.92 * s**2 * (1.0 - s) ** 2])
    curve = np.vstack([tip, shank, skirt])
    return Indentation(
        depth_mm=4.6,
        tip_radius_mm=3.0,
        radius_mm=curve[:, 0],
        height_mm=curve[:, 1],
        contact_radius_mm=3.0,
        force_n=30.0,
    )
