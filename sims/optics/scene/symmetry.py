"""Rotations and reflections that map a scene onto itself, and groups of states whose light is equal because of them.

A rectangular block has four candidate motions (identity, half turn, two reflections), a square block four more. For a
round pad, the candidates are the turns about its axis and reflections through it that move the first emitter to the
direction of any emitter. A motion is a symmetry if it maps every emitter to an emitter and every receiver to a
receiver, equal in all but position. A pad that is not a block must also keep its shape: every wall is mapped to a wall,
and the crown keeps its apex and its straight direction. Under a symmetry, a press and its image have the same light,
apart from the numbers of emitters and receivers. So only one of the two is traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.scene.optical_scene import WHOLE_CIRCLE, OpticalScene, PadForm
from optopad.sims.press import Indentation

SAME_PLACE_MM = 1e-6
"""Two points count as the same if their coordinates differ by no more than this, which allows for rounding."""
SAME_WAY = 1e-9
"""Two unit vectors count as the same if their components differ by no more than this, which allows for rounding."""
Key = tuple[tuple[int, int, float], ...]
Presses = Sequence[Sequence[float | None]]


@dataclass(frozen=True, kw_only=True)
class SceneSymmetry:
    """A motion in plan that maps the scene onto itself: a point p moves to matrix · p + offset.

    Attributes
    ----------
    matrix : (2, 2) rotation or reflection [-]
    offset_mm : (2,) translation [mm]
    emitters : (e,) number of the emitter to which each emitter moves
    receivers : (r,) number of the receiver to which each receiver moves
    """

    matrix: FloatArray
    offset_mm: FloatArray
    emitters: IntArray
    receivers: IntArray

    def image(self, places_mm: FloatArray) -> FloatArray:
        """Move points (..., 2) by this symmetry; return their (..., 2) images [mm]."""
        return np.asarray(places_mm @ self.matrix.T + self.offset_mm)


@dataclass(frozen=True, kw_only=True)
class StateClasses:
    """Groups of states with the same light, because their presses are equal or symmetric.

    Attributes
    ----------
    first : (class,) number of the state that represents each class
    member : (state,) number of each state's class
    emitters : (state, e) for each emitter of a state, the emitter that has the same light in the state that represents
        its class
    receivers : (state, r) the same for receivers
    """

    first: IntArray
    member: IntArray
    emitters: IntArray
    receivers: IntArray


def symmetries_of(scene: OpticalScene) -> tuple[SceneSymmetry, ...]:
    """Find all symmetries of a scene; the identity is the first."""
    found = []
    for matrix, offset in _motions_of(scene):
        emitters = _permutation(
            _places(scene, "emitter"), scene.emitter_patch, _traits(scene.emitter_order, scene.emitter_pattern),
            scene.emitter_pose, matrix, offset,
        )  # fmt: skip
        receivers = _permutation(
            _places(scene, "receiver"), scene.receiver_patch,
            _traits(np.zeros(len(scene.receiver_wall)), scene.receiver_response), scene.receiver_pose, matrix, offset,
        )  # fmt: skip
        if emitters is not None and receivers is not None:
            found.append(
                SceneSymmetry(matrix=matrix, offset_mm=offset, emitters=emitters, receivers=receivers)
            )
    return tuple(found)


def press_keys(pressed: Sequence[Indentation | None]) -> Presses:
    """Keys of states of one tip, equal if they have the same curve object; None where the tip does not touch."""
    return [[None if press is None or press.depth_mm <= 0 else id(press)] for press in pressed]


def each_its_own(scene: OpticalScene, states: int) -> StateClasses:
    """Classes for states that are all to be traced: each state is a class of its own."""
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
    pressed : for each state and tip, a value that is the same for equal presses; None where the tip does not touch
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
    """Key of a state: locations and press keys of its touching tips, sorted, as the tips' order does not matter."""
    rounded = np.round(places_mm / SAME_PLACE_MM).astype(np.int64)
    return tuple(
        sorted((int(x), int(y), tip) for (x, y), tip in zip(rounded, tips, strict=False) if tip is not None)
    )


def _motions_of(scene: OpticalScene) -> list[tuple[FloatArray, FloatArray]]:
    """Candidate motions in plan, the identity first; for a pad that is not a block, only those that keep its shape."""
    form = scene.form
    if form is None:
        return block_motions(scene.length_mm, scene.width_mm)
    whole = [arc for arc in form.arcs if tuple(arc[3:]) == WHOLE_CIRCLE]
    if whole:
        motions = _turns_and_mirrors(scene, np.asarray(whole[0][:2]))
    else:
        motions = block_motions(scene.length_mm, scene.width_mm)
    return [motion for motion in motions if _keeps(form, *motion)]


def _turns_and_mirrors(scene: OpticalScene, centre_mm: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Motions of a round pad that move the first emitter to any emitter's direction: turns, then reflections."""
    away = _places(scene, "emitter") - centre_mm
    angles = np.arctan2(away[:, 1], away[:, 0])
    turns = _distinct(angles - angles[0])
    mirrors = _distinct(angles + angles[0])
    matrices = [np.array([[c, -s], [s, c]]) for c, s in zip(np.cos(turns), np.sin(turns), strict=True)]
    matrices += [np.array([[c, s], [s, -c]]) for c, s in zip(np.cos(mirrors), np.sin(mirrors), strict=True)]
    return [(matrix, centre_mm - matrix @ centre_mm) for matrix in matrices]


def _distinct(angles: FloatArray) -> FloatArray:
    """Angles [rad] without those that equal an earlier angle up to whole turns."""
    kept: list[float] = []
    for angle in angles:
        if all(abs(np.exp(1j * angle) - np.exp(1j * one)) > SAME_WAY for one in kept):
            kept.append(float(angle))
    return np.array(kept)


def _keeps(form: PadForm, matrix: FloatArray, offset_mm: FloatArray) -> bool:
    """Whether a motion maps every wall to a wall, and keeps the top's apex and its straight direction."""
    walls, arcs = (np.asarray(rows, dtype=np.float64).reshape(-1, 6) for rows in (form.walls, form.arcs))
    places, normals = walls[:, :2], walls[:, 4:6]
    moved = normals @ matrix.T
    levels = np.sum(places * normals, axis=1)
    moved_levels = np.sum((places @ matrix.T + offset_mm) * moved, axis=1)
    near = (np.abs(moved[:, None] - normals).max(axis=2) <= SAME_WAY) & (
        np.abs(moved_levels[:, None] - levels) <= SAME_PLACE_MM
    )
    bent = np.hstack([arcs[:, :2] @ matrix.T + offset_mm, arcs[:, 2:3], arcs[:, 3:5] @ matrix.T, arcs[:, 5:]])
    off = np.abs(bent[:, None] - arcs) / ([SAME_PLACE_MM] * 3 + [SAME_WAY] * 3)
    apex, bends = np.asarray(form.top.apex_mm, dtype=np.float64), np.array([form.top.kx, form.top.ky])
    if np.abs(matrix @ np.diag(bends) @ matrix.T - np.diag(bends)).max() > SAME_WAY:
        return False
    if (np.abs(matrix @ apex + offset_mm - apex)[bends > 0.0] > SAME_PLACE_MM).any():
        return False
    return bool(near.any(axis=1).all() and (off.max(axis=2) <= 1.0).any(axis=1).all())


def block_motions(length_mm: float, width_mm: float) -> list[tuple[FloatArray, FloatArray]]:
    """Rotations and reflections of a block onto itself, as matrices (2, 2) and translations (2,) [mm]."""
    signs = [(1, 1), (-1, -1), (-1, 1), (1, -1)]
    motions = [
        (np.diag([float(a), float(b)]), np.array([length_mm * (a < 0), width_mm * (b < 0)])) for a, b in signs
    ]
    if length_mm == width_mm:
        turned = np.array([[0.0, 1.0], [1.0, 0.0]])
        motions += [(matrix @ turned, offset) for matrix, offset in motions]
    return motions


def _traits(orders: FloatArray, table: FloatArray | None) -> FloatArray:
    """(part, n) properties of emitters or receivers, besides position and size, that a symmetry keeps; -1 for NaN."""
    if table is None:
        return orders[:, None]
    return np.hstack([orders[:, None], np.nan_to_num(table, nan=-1.0)])


def _permutation(
    places: FloatArray,
    patches: FloatArray,
    traits: FloatArray,
    poses: FloatArray | None,
    matrix: FloatArray,
    offset: FloatArray,
) -> IntArray | None:
    """(part,) number of the emitter or receiver to which each one moves; None if some of them has no image."""
    looks = np.zeros((len(places), 2)) if poses is None else _looks(poses)
    tilts = np.zeros(len(places)) if poses is None else np.nan_to_num(poses[:, 3], nan=-1.0)
    moved = places @ matrix.T + offset
    turned = looks @ matrix.T
    rest = np.hstack([patches[:, 1:], traits, tilts[:, None]])
    onto = []
    for k, place in enumerate(moved):
        near = np.abs(places - place).max(axis=1) <= SAME_PLACE_MM
        same = near & (np.abs(rest - rest[k]).max(axis=1) <= SAME_PLACE_MM)
        apart = np.abs(looks - turned[k]).max(axis=1)
        if (
            tilts[k] == 0.0
        ):  # a face that looks up is the same after half a turn, and a square one after a quarter
            apart = np.minimum(apart, np.abs(looks + turned[k]).max(axis=1))
            if abs(patches[k, 2] - patches[k, 3]) <= SAME_PLACE_MM:
                quarter = turned[k, ::-1] * (-1.0, 1.0)
                apart = np.minimum(apart, np.abs(looks - quarter).max(axis=1))
                apart = np.minimum(apart, np.abs(looks + quarter).max(axis=1))
        same &= apart <= SAME_WAY
        if same.sum() != 1:
            return None
        onto.append(int(np.argmax(same)))
    return np.array(onto, dtype=np.int64) if len(set(onto)) == len(onto) else None


def _looks(poses: FloatArray) -> FloatArray:
    """(part, 2) plan directions in which faces with a pose look or are turned; 0 for those on walls."""
    turn = poses[:, 4]
    return np.asarray(np.nan_to_num(np.column_stack([np.cos(turn), np.sin(turn)]), nan=0.0))


def _places(scene: OpticalScene, kind: str) -> FloatArray:
    """(part, 2) positions of the emitters or receivers in plan [mm], which also identify their walls."""
    walls, patches = getattr(scene, f"{kind}_wall"), getattr(scene, f"{kind}_patch")
    poses = getattr(scene, f"{kind}_pose")
    along = patches[:, 0]
    if scene.form is not None:
        on_wall = np.zeros((len(walls), 2))
        if len(scene.form.walls):
            wall = np.asarray(scene.form.walls)[walls]
            on_wall = np.asarray(wall[:, :2] + along[:, None] * wall[:, 2:4])
        return (
            on_wall if poses is None else np.asarray(np.where(np.isnan(poses[:, :2]), on_wall, poses[:, :2]))
        )
    x = np.select(
        [walls == 1, walls == 3], [np.full(len(walls), scene.length_mm), np.zeros(len(walls))], along
    )
    y = np.select(
        [walls == 0, walls == 2], [np.zeros(len(walls)), np.full(len(walls), scene.width_mm)], along
    )
    return np.stack([x, y], axis=1)
