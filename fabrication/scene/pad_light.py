"""What a simulated pad needs to know of light: that of the untouched pad, and its change under objects."""

from __future__ import annotations

from typing import Protocol

from optopad.design.arrays import FloatArray
from optopad.sims.robot.fast_light import Imprint
from optopad.sims.robot.shapes import Shape


class PadLight(Protocol):
    """The light of a pad under objects, as `optopad.sims.robot.fast_light.FastLight` has it."""

    @property
    def digest(self) -> str:
        """Digest of the design."""

    @property
    def untouched(self) -> FloatArray:
        """(emitter, receiver) flux of the untouched pad, as a share of the emitted power [-]."""

    @property
    def deepest_mm(self) -> float:
        """Largest depth of objects that the map of light covers [mm]."""

    def imprint(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> Imprint:
        """Where a shape in n poses reaches below the untouched top; centres (n, 3) [mm], rotations (n, 3, 3)."""

    def ratios(self, imprint: Imprint) -> FloatArray:
        """Light over untouched light (n, emitter, receiver), exactly 1 where nothing touches [-]."""
