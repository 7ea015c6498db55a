"""The numbers that bounds and their summaries depend on, in one place; every function takes them as keywords.

Sources
-------
[R] Chosen for this tool: a fingertip-sized contact is useful when it is placed to a millimetre and its depth to half a
    millimetre (coverage); a voxel is dead when it cannot be placed to half a millimetre or its depth to a tenth, the
    limits of the feasibility study. Confidence: chosen; they are limits to rank layouts by, not findings.
[M] Measured on the paper's pad: docs/understand/model.md, "What the signals can tell".
"""

from __future__ import annotations

from typing import Final

from design.rules.light import SURROUND_MM

COVERED_LOCATION_MM: Final = 1.0
"""A covered voxel's location bound is below this [mm]; [R]."""

COVERED_DEPTH_MM: Final = 0.5
"""A covered voxel's depth bound is below this [mm]; [R]."""

DEAD_LOCATION_MM: Final = 0.5
"""A dead voxel's location bound is above this, or its depth bound above the next [mm]; [R]."""

DEAD_DEPTH_MM: Final = 0.1
"""See `DEAD_LOCATION_MM` [mm]; [R]."""

LATERAL_STEP_MM: Final = SURROUND_MM
"""Offset of the presses that give the derivatives by place [mm]; [M]."""

DEPTH_STEP_MM: Final = 0.1
"""Offset of the presses that give the derivative by depth [mm]; [M]."""

LARGEST_DEPTH_STEP_SHARE: Final = 0.25
"""The depth offset is at most this share of the depth [-]: near contact, signals grow like a power of depth."""

SPIKE: Final = 5.0
"""A pair whose reading has a larger trace error than this at some press of a voxel tells nothing there [noise units];
[M]: two of 960 at draft, one of which hid all the others."""

TOLD_FROM_ZERO: Final = 2.0
"""Information within this many of the trace's standard errors of zero counts as none [-]."""

BAND: Final = 2.0
"""Low and high of a summary are its values with all bounds moved by this many standard errors of the trace [-]."""

FORMED_SPIKE: Final = 20.0
"""The same for discs and crowned pads [noise units]: their light is integrated on lattices and has no spikes, and the
difference of its halves enters the bounds' error anyway; [M]: with 5, light of half as many points leaves out so many
pairs of the crowned preset that bounds at 2.9 and 3.9 mm come out up to 24 % wider; with 20 they agree within 6 %."""

CLEAR_ERROR: Final = 0.05
"""A bound whose trace error is a larger share of it is traced again with finer light [-]; [M]. At a tenth, a depth
bound of the paper's pad late in the press came out at 18 to 30 µm by six seeds, with errors stated as 0.7 to 2.4; at a
twentieth at 20 to 21, for an eighth more of the bounds' time."""

SHALLOW_MM: Final = 0.3
"""Voxels above this begin with the second settings of the light [mm]: on the paper's pad four in five of them at 0.2 mm
are open after the first, most of them blind; [M]."""

COARSE_DEPTHS_MM: Final = (0.2, 0.7, 1.5, 2.9)
"""Depths of the bounds of a quick score; those beyond the range of use are left out, its end is added [mm]. Most lie
half-way between depths of its map, whose light then serves both."""

FINE_DEPTHS_MM: Final = (0.15, 0.4, 0.8, 1.5, 2.5, 3.6)
"""Depths of the bounds of a fine score, likewise [mm]. Bounds change slowly with depth, so these are coarser than the
deadband map's."""
