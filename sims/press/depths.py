"""The depths at which signals are computed: fine near contact, where mode 1 can be over in 0.3 mm."""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray

NEAR_CONTACT_MM = (0.0, 0.02, 0.05, 0.1, 0.15)
"""First depths [mm]; from the study of depth steps."""

NEAR_CONTACT_COARSE_MM = (0.0, 0.1)
"""First depths of a coarse schedule [mm]."""

STEP_MM = 0.1
"""Step of the fine schedule [mm]."""

COARSE_STEP_MM = 0.2
"""Step of the coarse schedule [mm]: it moves mode boundaries by up to 0.04 mm, at half the cost."""


def depth_schedule_mm(max_depth_mm: float, step_mm: float = STEP_MM) -> FloatArray:
    """Depths from 0 to the deepest press, rising, the deepest one included.

    Parameters
    ----------
    max_depth_mm : deepest press [mm]
    step_mm : step beyond 0.2 mm [mm]

    Returns
    -------
    (n,) depths [mm]
    """
    first = NEAR_CONTACT_MM if step_mm < COARSE_STEP_MM else NEAR_CONTACT_COARSE_MM
    near = [depth for depth in first if depth < max_depth_mm]
    regular = np.arange(0.2, max_depth_mm - 1e-9, step_mm)
    return np.unique(np.round(np.concatenate([near, regular, [max_depth_mm]]), 6))
