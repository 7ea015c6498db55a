"""Two balls pressed into one pad at once, solved with finite strains; the command renews `tips.csv`.

    python -m tests.validation.held.tips_truth              all cases, an hour
    python -m tests.validation.held.tips_truth CASE ...     those whose name begins so; the other rows stay

Model: that of `truth`. Two equal balls are pressed to the same depth at x = s/2 and x = -s/2 of a pad whose middle is
x = y = 0. Both planes through the middle are planes of symmetry, so a quarter of the pad with one ball is solved. The
same ball alone has one plane of symmetry: half the pad is solved, on a mesh that is the same for x > 0.

Forces and areas are those of one ball. Lengths are from its axis: inward (to the other ball), outward, and along y.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.layer_mesh import graded
from tests.validation.held.object_cases import OBJECT_CASES, PAD_MM, ObjectCase
from tests.validation.held.object_press import AxisGrading, ObjectPress
from tests.validation.held.truth import renew

STORED = Path(__file__).with_name("tips.csv")
APART_MM = (7.5, 12.0, 18.0)
FAR_MM = 1.5
"""Size of the elements at x < 0 where nothing presses."""


class TipPress(ObjectPress):
    """A ball beside the middle of a pad, x from its axis: a quarter of it with two balls or half with one."""

    copies = 2
    largest_step = 0.5
    ways: ClassVar = {"inward": (0, -1), "outward": (0, 1), "y": (1, 1)}


@dataclass(frozen=True, kw_only=True)
class TipsCase(ObjectCase):
    """Two balls, or one of them alone.

    Attributes
    ----------
    apart_mm : distance of both axes
    """

    apart_mm: float
    is_alone: bool
    depths_mm: tuple[float, ...] = (1.0, 2.0, 3.0)
    coarser: tuple[float, ...] = (1.7, 1.2)
    names: ClassVar = tuple(TipPress.ways)

    @classmethod
    def of(cls, apart_mm: float, is_alone: bool) -> TipsCase:
        """Of a distance."""
        ball = OBJECT_CASES["ball, radius 3"]
        along = AxisGrading(focus_mm=0.5 * apart_mm, size_mm=0.5, fine_mm=3.0)
        return cls(thing=ball.thing, grading=(along, ball.grading[1]), apart_mm=apart_mm, is_alone=is_alone)

    def ticks(self, coarser: float) -> tuple[FloatArray, ...]:
        """The mesh along x, from the ball's axis, along y and down."""
        x, y, z = super().ticks(coarser)
        if self.is_alone:
            along = self.grading[0]
            beyond = graded(PAD_MM[0], 0.0, coarser * FAR_MM, along.growth, coarser * along.largest_mm)
            x = np.concatenate([-beyond[:0:-1], x])
        return x - 0.5 * self.apart_mm, y, z

    def press(self, coarser: float) -> TipPress:
        """The untouched pad on one mesh."""
        mirrors = (1,) if self.is_alone else (0, 1)
        return TipPress(self.thing, self.ticks(coarser), POISSON_RATIO, self.penalty, mirrors)

    def places_mm(self, name: str, edge_mm: float) -> dict[str, float]:
        """Places along a way, by name; inward they end at the middle of the pad, outward before the wall."""
        half = 0.5 * self.apart_mm
        places = super().places_mm(name, edge_mm)
        if name == "inward":
            places = {key: at for key, at in places.items() if at < half}
            return places | {"half-way": 0.5 * (edge_mm + half), "middle": half}
        end = PAD_MM[0] - half if name == "outward" else PAD_MM[1]
        return {key: at for key, at in places.items() if at < end - 0.5}


CASES = {
    f"{'one ball' if is_alone else 'two balls'}, {apart:g} apart": TipsCase.of(apart, is_alone)
    for apart in APART_MM
    for is_alone in (False, True)
}


if __name__ == "__main__":
    renew(sys.argv[1:] or [""], CASES, STORED)
