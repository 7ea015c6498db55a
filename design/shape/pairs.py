"""Which emitter-receiver pairs are judged, in which order, and where each is pressed.

A pair has a direct path when its parts sit in different walls. It is judged, under a press at its chord's midpoint
clamped to the workspace, if the tip comes over the chord there: pairs of one wall, and those across a corner that no
press comes between, are reported and not judged. In facing rows (all emitters in one wall, all receivers in the
opposite one) the judged pairs are the facing ones, the middle one first.
"""

from __future__ import annotations

import numpy as np

from design.arrays import BoolArray
from design.shape.cavity import CavityGeometry
from design.spec.layout import OPPOSITE

FACING_TOLERANCE_MM = 1e-6
"""Two parts face each other when their places along the wall agree; patterns make them agree exactly."""


def direct_path_pairs(cavity: CavityGeometry) -> BoolArray:
    """(emitter, receiver) pairs whose parts sit in different walls."""
    return np.array(
        [[e.wall != r.wall for r in cavity.receivers] for e in cavity.emitters], dtype=np.bool_
    ).reshape(len(cavity.emitters), len(cavity.receivers))


def is_facing_rows(cavity: CavityGeometry) -> bool:
    """Whether emitters and receivers sit in opposite walls and at least one of each face each other."""
    return bool(facing_pairs(cavity))


def _sit_opposite(cavity: CavityGeometry) -> bool:
    """Whether all emitters sit in one wall and all receivers in the opposite one."""
    emitter_walls = {part.wall for part in cavity.emitters}
    receiver_walls = {part.wall for part in cavity.receivers}
    opposite = {wall: other for wall, other in OPPOSITE.items() if emitter_walls == {wall}}
    return receiver_walls == set(opposite.values()) and bool(opposite)


def facing_pairs(cavity: CavityGeometry) -> tuple[tuple[int, int], ...]:
    """(emitter, receiver) numbers at the same place along facing rows, the middle pair first."""
    if not _sit_opposite(cavity):
        return ()
    pairs = [
        (i, j)
        for i, e in enumerate(cavity.emitters)
        for j, r in enumerate(cavity.receivers)
        if abs(e.along_mm - r.along_mm) <= FACING_TOLERANCE_MM
    ]
    middle = cavity.wall_length_mm(cavity.emitters[0].wall) / 2
    return tuple(sorted(pairs, key=lambda pair: abs(cavity.emitters[pair[0]].along_mm - middle)))


def judged_pairs(cavity: CavityGeometry) -> tuple[tuple[int, int], ...]:
    """(emitter, receiver) numbers that are judged one by one, and that set the gain; facing pairs in facing rows.

    Of a pad, pairs whose straight path lies within a tip radius of their press; all with a direct path if none does.
    """
    facing = facing_pairs(cavity)
    if facing:
        return facing
    direct = tuple((int(i), int(j)) for i, j in np.argwhere(direct_path_pairs(cavity)))
    return tuple(pair for pair in direct if _comes_between(cavity, pair)) or direct


def _comes_between(cavity: CavityGeometry, pair: tuple[int, int]) -> bool:
    """Whether the tip is over a pair's chord where the pair is pressed."""
    return beside_chord(cavity, pair, chord_midpoint_mm(cavity, pair))[0] <= cavity.tip_radius_mm


def beside_chord(
    cavity: CavityGeometry, pair: tuple[int, int], place_mm: tuple[float, float]
) -> tuple[float, float]:
    """Distance of a place from a pair's chord [mm], and where along it it is nearest, from 0 (emitter) to 1 [-]."""
    ends = (cavity.emitters[pair[0]], cavity.receivers[pair[1]])
    start, end = (np.array(part.position_mm[:2]) for part in ends)
    along, to_place = end - start, np.array(place_mm) - start
    share = float(np.clip(to_place @ along / (along @ along), 0.0, 1.0))
    return float(np.hypot(*(to_place - share * along))), share


def pair_name(cavity: CavityGeometry, pair: tuple[int, int]) -> str:
    """A pair's name, as E1-R3."""
    return f"{cavity.emitters[pair[0]].name}-{cavity.receivers[pair[1]].name}"


def mask_of(pairs: tuple[tuple[int, int], ...], cavity: CavityGeometry) -> BoolArray:
    """(emitter, receiver) mask of a list of pairs."""
    mask = np.zeros((len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for i, j in pairs:
        mask[i, j] = True
    return mask


def chord_midpoint_mm(cavity: CavityGeometry, pair: tuple[int, int]) -> tuple[float, float]:
    """Midpoint of a pair's chord, clamped to the workspace (x, y) [mm]."""
    ex, ey, _ = cavity.emitters[pair[0]].position_mm
    rx, ry, _ = cavity.receivers[pair[1]].position_mm
    return cavity.workspace.clamped((ex + rx) / 2, (ey + ry) / 2)
