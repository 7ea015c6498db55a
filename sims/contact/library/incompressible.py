"""From two slightly compressible solves to the nearly incompressible layer.

Silicone is nearly incompressible, but linear tetrahedra lock as Poisson's ratio ν nears 1/2. At ν = 0.49
they are accurate and the layer is not: 3 mm deep in 9 mm, compression takes 16 % of the dimple and the free surface
lies 17 µm too low. The press depends smoothly on the compressibility 1/K = 3 (1 - 2ν) / E, a regular
perturbation: two solves, at ν = 0.48 and 0.49, are extrapolated linearly in 1 - 2ν to ν = 0.499,

    f(0.499) = f(0.49) + 0.9 (f(0.49) - f(0.48)),

for every number that describes a press (`SmoothPress`). docs/validation/contact.md compares the result with
an independent finite-element solution at ν = 0.499.

What it leaves out: the second order in 1 - 2ν, and what locking is left, which grows by about a half.
"""

from __future__ import annotations

from dataclasses import replace

from sims.contact.library.smooth_press import SmoothPress

POISSON_RATIOS = (0.48, 0.49)
"""Poisson's ratios that are solved [-]."""
NEARLY_INCOMPRESSIBLE = 0.499
"""Poisson's ratio of the result [-]."""


def extrapolation_weight() -> float:
    """Share of the difference between the two solves that is added to the stiffer one [-]: 0.9."""
    soft, stiff = POISSON_RATIOS
    return (NEARLY_INCOMPRESSIBLE - stiff) / (stiff - soft)


def nearly_incompressible(soft: SmoothPress, stiff: SmoothPress) -> SmoothPress:
    """Extrapolate the presses at the two `POISSON_RATIOS`, solved at the same depths on the same mesh."""
    difference = stiff.coefficients - soft.coefficients
    return replace(stiff, coefficients=stiff.coefficients + extrapolation_weight() * difference)
