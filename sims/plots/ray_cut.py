"""The line of a section: a pair's chord, straight across from a part, or through a place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.cavity import CavityGeometry, PlacedPart
from design.shape.plan import outline_mm
from sims.plots.shapes.pressed_top import CutPlane

SILHOUETTE_POINTS = 60


@dataclass(frozen=True, kw_only=True)
class Cut:
    """The line of a section from wall to wall, seen from its left hand.

    Attributes
    ----------
    start_mm, end_mm : (x, y) of its ends [mm]
    name : what it is, for the axis
    """

    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    name: str

    @property
    def length_mm(self) -> float:
        """Length of the line [mm]."""
        return float(np.hypot(*np.subtract(self.end_mm, self.start_mm)))

    @property
    def direction(self) -> FloatArray:
        """(2,) unit vector from start to end [-]."""
        return np.subtract(self.end_mm, self.start_mm) / self.length_mm

    def plane(self, ceiling_mm: float) -> CutPlane:
        """The vertical plane over the line, up to a height [mm]."""
        right, up = self.direction.tolist()
        reach = 0.0, self.length_mm
        return CutPlane(start_mm=self.start_mm, direction=(right, up), reach_mm=reach, ceiling_mm=ceiling_mm)

    def reach_mm(self, cavity: CavityGeometry) -> tuple[float, float]:
        """Ends of the whole block as seen from the side, along the line [mm]."""
        along = self.along_mm(outline_mm(cavity.plan))
        return float(along.min()), float(along.max())

    def along_mm(self, places_mm: FloatArray) -> FloatArray:
        """(...,) distance from the start along the line of (..., 2 or 3) places [mm]."""
        return np.asarray((places_mm[..., :2] - np.array(self.start_mm)) @ self.direction)

    def silhouette_mm(self, cavity: CavityGeometry, reach: tuple[float, float]) -> FloatArray:
        """(n, 2) distance and height of the clear layer's outline as seen from the side [mm]."""
        along = np.linspace(*reach, SILHOUETTE_POINTS)
        size = cavity.plan.radius_mm
        aside = np.linspace(-2.0 * size, 2.0 * size, 4 * SILHOUETTE_POINTS)
        across = self.direction[::-1] * [-1.0, 1.0]
        tops = []
        for distance in along:
            places = np.array(self.start_mm) + distance * self.direction + aside[:, None] * across
            inside = [(x, y) for x, y in places.tolist() if cavity.plan.contains(x, y)]
            tops.append(max((cavity.plan.top_mm(x, y) for x, y in inside), default=0.0))
        return np.column_stack([[reach[0], *along, reach[1]], [0.0, *tops, 0.0]])

    def beside_mm(self, place_mm: tuple[float, float]) -> float:
        """Distance of a place from the line [mm]."""
        ahead, aside = np.subtract(place_mm, self.start_mm), self.direction[::-1] * [-1.0, 1.0]
        return float(abs(ahead @ aside))


def cut_of_pair(cavity: CavityGeometry, pair: tuple[int, int]) -> Cut:
    """The chord of a pair, from emitter to receiver."""
    ends = cavity.emitters[pair[0]], cavity.receivers[pair[1]]
    start, end = (part.position_mm[:2] for part in ends)
    return Cut(start_mm=start, end_mm=end, name=f"along the chord from {ends[0].name} to {ends[1].name}")


def cut_across(cavity: CavityGeometry, part: PlacedPart) -> Cut:
    """The line from a part straight across to the opposite wall."""
    x, y, _ = part.position_mm
    right, up = part.line.outward
    far = cavity.plan.outline.way_out_mm((x, y), (-right, -up))
    end = (x - far * right, y - far * up)
    return Cut(start_mm=(x, y), end_mm=end, name=f"from {part.name} straight across")


def cut_through(cavity: CavityGeometry, x_mm: float, y_mm: float) -> Cut:
    """The line through a place from wall to wall along the longer side; of a disc along x."""
    outline, place = cavity.plan.outline, (x_mm, y_mm)
    if cavity.length_mm >= cavity.width_mm:
        back, far = (outline.way_out_mm(place, (way, 0.0)) for way in (-1.0, 1.0))
        return Cut(
            start_mm=(x_mm - back, y_mm), end_mm=(x_mm + far, y_mm), name=f"along x at y = {y_mm:g} mm"
        )
    back, far = (outline.way_out_mm(place, (0.0, way)) for way in (-1.0, 1.0))
    return Cut(start_mm=(x_mm, y_mm - back), end_mm=(x_mm, y_mm + far), name=f"along y at x = {x_mm:g} mm")
