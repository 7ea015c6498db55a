"""Single light paths for pictures, drawn from the oracle's own walk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from design.errors import InputError
from sims.indentation import Indentation
from sims.optics.oracle import check_seed, lower_presses, lower_scene
from sims.optics.oracle_surface import RevolvedSurface
from sims.optics.oracle_walk import FATES, UNSUBMERGED, Scene, ray_stream, walk
from sims.optics.scene import OpticalScene

FloatArray = NDArray[np.float64]

TRIES_PER_PATH = 1_000_000
"""Rays tried for each path asked for, before fewer paths are given back."""
PLACES = 200
"""Most places on one path; a longer path is passed over."""


def sample_paths(
    scene: OpticalScene,
    centre_mm: ArrayLike,
    indentation: Indentation | None,
    *,
    emitter: int,
    receiver: int | None = None,
    count: int,
    seed: int = 0,
) -> list[tuple[str, FloatArray]]:
    """Random paths of one emitter's light, each as likely as the power it carries.

    With absorption a path is drawn as if there were none: the picture shows where light goes, not how much.

    Parameters
    ----------
    centre_mm : (2,) press axis [mm]
    emitter, receiver : numbers; with a receiver only paths that end on it, without any fate
    count : paths wanted; fewer come back where light that reaches the receiver is too rare
    seed : of the random streams, >= 0

    Returns
    -------
    name of the class or fate (`sims.optics.oracle_walk.FATES`), and (n, 3) places along the path [mm]
    """
    lowered = lower_scene(replace(scene, absorption_per_mm=0.0))
    (surface,) = lower_presses(scene, np.asarray(centre_mm, dtype=np.float64)[None], [indentation])
    check_seed(seed)
    _check_number("emitter", emitter, len(scene.emitter_wall))
    if receiver is not None:
        _check_number("receiver", receiver, len(scene.receiver_wall))
    wanted = -1 if receiver is None else receiver
    paths: list[tuple[str, FloatArray]] = []
    ray = 0
    for _ in range(count):
        ray, fate, places = _next_path(lowered, surface, emitter, wanted, seed, ray, TRIES_PER_PATH)
        if fate < 0:
            break
        paths.append((FATES[fate], places))
    return paths


def _check_number(name: str, value: int, count: int) -> None:
    if not 0 <= value < count:
        raise InputError(f"{name}: {value} does not exist; the scene has {count}, numbered from 0")


@njit(cache=True)
def _next_path(
    scene: Scene, surface: RevolvedSurface, emitter: int, wanted: int, seed: int, ray: int, tries: int
) -> tuple[int, int, FloatArray]:
    """From a ray number on, the next one that ends on the wanted receiver (-1: any end)."""
    vertices = np.empty((PLACES, 3))
    for number in range(ray, ray + tries):
        stream = ray_stream(seed, 0, emitter, number)
        fate, receiver, _, count = walk(scene, surface, emitter, stream, vertices)
        if fate != UNSUBMERGED and count <= PLACES and (wanted < 0 or receiver == wanted):
            return number + 1, fate, vertices[:count].copy()
    return ray + tries, -1, vertices[:0].copy()
