"""A dimple in closed form: for tests, benchmarks and pictures, never for a verdict.

Exact sphere inside the contact radius a = min(sqrt(R d), 0.9 R), a cubic skirt that leaves it with the
sphere's slope s and ends after L = 3 D / s (D the depth left at the contact edge), and, if asked for, a
pile-up b q² (1 - q)² 16 over q = (r - a) / (outer - a). It is not the shape of a real elastomer.
"""

from __future__ import annotations

import numpy as np

from optopad.sims.press import Indentation


def compact_dimple(
    depth_mm: float, tip_radius_mm: float = 3.0, *, bulge_mm: float = 0.0, outer_radius_mm: float = 16.0
) -> Indentation:
    """Sphere, cubic skirt and pile-up as an indentation.

    Parameters
    ----------
    depth_mm : depth of the tip's apex, above 0 [mm]
    tip_radius_mm : radius of the tip [mm]
    bulge_mm : height of the pile-up half-way between contact and outer radius [mm]
    outer_radius_mm : where the pile-up ends [mm]
    """
    contact = min(np.sqrt(tip_radius_mm * depth_mm), 0.9 * tip_radius_mm)
    root = np.sqrt(tip_radius_mm**2 - contact**2)
    left = depth_mm - (tip_radius_mm - root)
    skirt = 3.0 * left * root / contact
    inside = np.linspace(0.0, contact, 40)
    outside = contact + np.concatenate(
        [
            np.linspace(0.0, skirt, 120)[1:],
            np.linspace(skirt, max(outer_radius_mm - contact, skirt + 1.0), 80)[1:],
        ]
    )
    share = np.clip(1.0 - (outside - contact) / skirt, 0.0, None)
    q = np.clip((outside - contact) / (outside[-1] - contact), 0.0, 1.0)
    pile_up = bulge_mm * 16.0 * q**2 * (1.0 - q) ** 2
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=tip_radius_mm,
        radius_mm=np.concatenate([inside, outside]),
        height_mm=np.concatenate(
            [-depth_mm + tip_radius_mm - np.sqrt(tip_radius_mm**2 - inside**2), -left * share**3 + pile_up]
        ),
        contact_radius_mm=float(contact),
        force_n=0.0,
    )
