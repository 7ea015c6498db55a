"""Rotations and mirrors that carry a scene onto itself, and the states that they make one.

A rectangle has four motions (identity, half turn, two mirrors), a square four more. One is a symmetry of the scene
when every emitter comes to lie on an emitter and every receiver on a receiver that are the same in all but place. A
press and its image then have the same light, with emitters and receivers renumbered: only one of them is traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sims.optics.scene.optical_scene import OpticalScene
from sims.press.indentation import Indentation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
SAME_PLACE_MM = 1e-6
"""Two places are one when they agree to this: patterns make them agree to round-off."""
Key = tuple[tuple[int, int, float], ...]
Presses = Sequence[Sequence[float | None]]


@dataclass(frozen=True, kw_only=True)
class SceneSymmetry:
    """One motion of the box that keeps the scene.

    Attributes
    ----------
    matrix : (2, 2) and offset_mm : (2,), so that a place p goes to matrix p + offset
    emitters : (e,) number of the emitter that each emitter goes to; receivers : (r,) likewise
    """

    matrix: FloatArray
    offset_mm: FloatArray
    emitters: IntArray
    receivers: IntArray

    def image(self, places_mm: FloatArray) -> FloatArray:
        """(..., 2) where (..., 2) places go [mm]."""
        return np.asarray(places_mm @ self.matrix.T + self.offset_mm)


@dataclass(frozen=True, kw_only=True)
class StateClasses:
    """States that symmetries, or equal presses, make one.

    Attributes
    ----------
    first : (class,) the state that stands for each class
    member : (state,) class of each state
    emitters : (state, e) emitter of the class's state that each state's emitter corresponds to
    receivers : (state, r) likewise
    """

    first: IntArray
    member: IntArray
    emitters: IntArray
    receivers: IntArray


def symmetries_of(scene: OpticalScene) -> tuple[SceneSymmetry, ...]:
    """All symmetries of a scene, the identity first."""
    found = []
    for matrix, offset in _motions(scene.length_mm, scene.width_mm):
        emitters = _permutation(
            scene, scene.emitter_wall, scene.emitter_patch, _traits(scene.emitter_order, scene.emitter_pattern),
            matrix, offset,
        )  # fmt: skip
        receivers = _permutation(
            scene, scene.receiver_wall, scene.receiver_patch,
            _traits(np.zeros(len(scene.receiver_wall)), scene.receiver_response), matrix, offset,
        )  # fmt: skip
        if emitters is not None and receivers is not None:
            found.append(
                SceneSymmetry(matrix=matrix, offset_mm=offset, emitters=emitters, receivers=receivers)
            )
    return tuple(found)


def press_keys(pressed: Sequence[Sequence[Indentation | None]]) -> Presses:
    """What tells presses apart where each has a curve of its own: the curve."""
    return [[None if tip is None or tip.depth_mm <= 0 else id(tip) for tip in tips] for tips in pressed]


def each_its_own(scene: OpticalScene, states: int) -> StateClasses:
    """Every state a class by itself."""
    every = np.arange(states)
    return StateClasses(
        first=every,
        member=every,
        emitters=np.tile(np.arange(len(scene.emitter_wall)), (states, 1)),
        receivers=np.tile(np.arange(len(scene.receiver_wall)), (states, 1)),
    )


def state_classes(scene: OpticalScene, centres_mm: FloatArray, pressed: Presses) -> StateClasses:
    """Sort states into classes of equal light.

    Parameters
    ----------
    centres_mm : (state, tip, 2) press axes [mm]
    pressed : per state and tip what tells presses at one place apart, None where the tip does not touch
    """
    symmetries = symmetries_of(scene)
    known: dict[Key, tuple[int, SceneSymmetry]] = {}
    first: list[int] = []
    member = np.zeros(len(pressed), dtype=np.int64)
    emitters = np.tile(np.arange(len(scene.emitter_wall)), (len(pressed), 1))
    receivers = np.tile(np.arange(len(scene.receiver_wall)), (len(pressed), 1))
    for state, tips in enumerate(pressed):
        for motion in symmetries:
            key = _key(motion.image(centres_mm[state]), tips)
            if key in known:
                member[state], back = known[key]
                emitters[state] = np.argsort(back.emitters)[motion.emitters]
                receivers[state] = np.argsort(back.receivers)[motion.receivers]
                break
        else:
            member[state] = len(first)
            for motion in symmetries:
                known.setdefault(_key(motion.image(centres_mm[state]), tips), (len(first), motion))
            first.append(state)
    return StateClasses(
        first=np.array(first, dtype=np.int64), member=member, emitters=emitters, receivers=receivers
    )


def _key(places_mm: FloatArray, tips: Sequence[float | None]) -> Key:
    """A state's touching tips by place and press, in any order."""
    rounded = np.round(places_mm / SAME_PLACE_MM).astype(np.int64)
    return tuple(
        sorted((int(x), int(y), tip) for (x, y), tip in zip(rounded, tips, strict=False) if tip is not None)
    )


def _motions(length_mm: float, width_mm: float) -> list[tuple[FloatArray, FloatArray]]:
    signs = [(1, 1), (-1, -1), (-1, 1), (1, -1)]
    motions = [
        (np.diag([float(a), float(b)]), np.array([length_mm * (a < 0), width_mm * (b < 0)])) for a, b in signs
    ]
    if length_mm == width_mm:
        turned = np.array([[0.0, 1.0], [1.0, 0.0]])
        motions += [(matrix @ turned, offset) for matrix, offset in motions]
    return motions


def _traits(orders: FloatArray, table: FloatArray | None) -> FloatArray:
    """(part, n) what must agree besides place and size."""
    if table is None:
        return orders[:, None]
    return np.hstack([orders[:, None], np.nan_to_num(table, nan=-1.0)])


def _permutation(
    scene: OpticalScene,
    walls: IntArray,
    patches: FloatArray,
    traits: FloatArray,
    matrix: FloatArray,
    offset: FloatArray,
) -> IntArray | None:
    """(part,) the part that each part goes to; None where one goes to none."""
    places = _places(scene, walls, patches)
    moved = places @ matrix.T + offset
    rest = np.hstack([patches[:, 1:], traits])
    onto = []
    for k, place in enumerate(moved):
        near = np.abs(places - place).max(axis=1) <= SAME_PLACE_MM
        same = near & (np.abs(rest - rest[k]).max(axis=1) <= SAME_PLACE_MM)
        if same.sum() != 1:
            return None
        onto.append(int(np.argmax(same)))
    return np.array(onto, dtype=np.int64) if len(set(onto)) == len(onto) else None


def _places(scene: OpticalScene, walls: IntArray, patches: FloatArray) -> FloatArray:
    """(part, 2) places of patches in plan [mm]; a place on an edge tells its wall, too."""
    along = patches[:, 0]
    x = np.select(
        [walls == 1, walls == 3], [np.full(len(walls), scene.length_mm), np.zeros(len(walls))], along
    )
    y = np.select(
        [walls == 0, walls == 2], [np.zeros(len(walls)), np.full(len(walls), scene.width_mm)], along
    )
    return np.stack([x, y], axis=1)
