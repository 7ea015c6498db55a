"""Presses into a stadium pad, solved in three dimensions as those beside the apex of a round one (`offset_oracle`).

    python -m tests.validation.contact.crown.stadium_oracle    (half an hour, resumable) writes stadium_oracle.npz

The pad of `gripper-stadium`, flat: in its middle, and at the centre of a half round. The chart's first derivatives jump
at the centres of the half rounds, where the mesh has edges; the second press is on one. And, on elements of the same
size, the round pad of its area, which the contact model takes it for.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.validation.contact.crown.offset_oracle import OffsetPad, build

STORED = Path(__file__).with_name("stadium_oracle.npz")
MIDDLE = OffsetPad(
    tip_mm=1.5,
    crown_mm=np.inf,
    layer_mm=6,
    wall_mm=7,
    offset_mm=0,
    depths_mm=(0.5, 1.0, 2.0),
    straight_mm=5,
)
AREA_MM2 = np.pi * MIDDLE.wall_mm**2 + 4.0 * MIDDLE.straight_mm * MIDDLE.wall_mm
PADS = {
    "middle": MIDDLE,
    "end": replace(MIDDLE, offset_mm=5),
    "round": replace(MIDDLE, straight_mm=0, wall_mm=float(np.sqrt(AREA_MM2 / np.pi))),
}


if __name__ == "__main__":
    build(PADS, STORED, "python -m tests.validation.contact.crown.stadium_oracle")
