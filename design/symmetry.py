"""Rotations and mirrors that carry a layout onto itself: what need be computed once only.

A rectangle has four symmetries (identity, half turn, two mirrors), a square four more (quarter turns,
mirrors at the diagonals). One belongs to the layout when it carries every emitter onto an emitter and
every receiver onto a receiver with the same part at the same height.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from design.cavity import CavityGeometry, PlacedPart

Point = tuple[float, float]

SAME_PLACE_MM = 1e-6
"""Two places are one when they agree to this; patterns make them agree to round-off."""


@dataclass(frozen=True, kw_only=True)
class Symmetry:
    """One rotation or mirror of the cavity that keeps its layout.

    Attributes
    ----------
    image : where it carries a point (x, y) [mm]
    emitters : number of the emitter that each emitter is carried onto
    receivers : likewise
    """

    image: Callable[[Point], Point]
    emitters: tuple[int, ...]
    receivers: tuple[int, ...]

    def pair(self, pair: tuple[int, int]) -> tuple[int, int]:
        """The pair that a pair is carried onto."""
        return self.emitters[pair[0]], self.receivers[pair[1]]


def symmetries(cavity: CavityGeometry) -> tuple[Symmetry, ...]:
    """All symmetries of a layout, the identity first."""
    found = []
    for image in _motions(cavity.length_mm, cavity.width_mm):
        emitters = _permutation(cavity, cavity.emitters, image)
        receivers = _permutation(cavity, cavity.receivers, image)
        if emitters is not None and receivers is not None:
            found.append(Symmetry(image=image, emitters=emitters, receivers=receivers))
    return tuple(found)


def same_place(one: Point, other: Point) -> bool:
    """Whether two points agree to round-off."""
    return abs(one[0] - other[0]) <= SAME_PLACE_MM and abs(one[1] - other[1]) <= SAME_PLACE_MM


def _motions(length_mm: float, width_mm: float) -> tuple[Callable[[Point], Point], ...]:
    rectangle: tuple[Callable[[Point], Point], ...] = (
        lambda p: p,
        lambda p: (length_mm - p[0], width_mm - p[1]),
        lambda p: (length_mm - p[0], p[1]),
        lambda p: (p[0], width_mm - p[1]),
    )
    if length_mm != width_mm:
        return rectangle
    return (
        *rectangle,
        lambda p: (length_mm - p[1], p[0]),
        lambda p: (p[1], length_mm - p[0]),
        lambda p: (p[1], p[0]),
        lambda p: (length_mm - p[1], length_mm - p[0]),
    )


def _permutation(
    cavity: CavityGeometry, parts: tuple[PlacedPart, ...], image: Callable[[Point], Point]
) -> tuple[int, ...] | None:
    places = [part.position_mm(cavity.length_mm, cavity.width_mm)[:2] for part in parts]
    onto = []
    for part, place in zip(parts, places, strict=True):
        target = image(place)
        hits = [
            k
            for k, other in enumerate(places)
            if same_place(target, other)
            and parts[k].part_id == part.part_id
            and abs(parts[k].height_mm - part.height_mm) <= SAME_PLACE_MM
        ]
        if len(hits) != 1:
            return None
        onto.append(hits[0])
    return tuple(onto) if len(set(onto)) == len(parts) else None
