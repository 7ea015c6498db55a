"""What a simulated pad needs to know of light: that of the untouched pad, and its change under objects."""

from __future__ import annotations

from typing import Protocol

from optopad.design.arrays import FloatArray
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
        """Largest overlap that the map of light covers [mm]."""

    def overlap_mm(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> FloatArray:
        """Overlap (n, node) of a shape in n poses with the untouched top [mm]."""

    def ratios(self, overlap_mm: FloatArray) -> FloatArray:
        """(n, emitter, receiver) light over the untouched light, for overlaps (n, node) [-]."""
