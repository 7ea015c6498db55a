"""Limits of the work of a fit: numbers of samples, memory, and the sizes of the better learners."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Limits of a fit; every learner uses those that concern it.

    Attributes
    ----------
    search_samples : touched samples that the grid search sees, fitted and held out together
    fit_samples : touched samples of the final kernel-ridge fit; those beyond are used by the approximation only
    network_samples : touched samples of trees and network
    memory_gb : of the kernel matrix of the final fit [GB]
    landmarks : kept samples of the approximation for systems that do not fit into memory_gb
    trees : trees of the forest
    epochs : passes of the network over its samples
    """

    search_samples: int = 6_000
    fit_samples: int = 10_000
    network_samples: int = 30_000
    memory_gb: float = 5.0
    landmarks: int = 8_000
    trees: int = 80
    epochs: int = 60


DEFAULT = FitSettings()
QUICK = FitSettings(search_samples=2_000, fit_samples=4_000, network_samples=8_000, trees=40, epochs=40)
"""Seconds instead of minutes, for a first look."""
FULL = FitSettings(fit_samples=24_000, network_samples=60_000, trees=120, epochs=100)
"""Half of the paper's touched training samples in one exact kernel."""
WHOLE = replace(FULL, fit_samples=60_000, memory_gb=12.0)
"""All of the paper's touched training samples, 49,368, in one kernel: single precision, 9.8 GB."""
EFFORTS = {"quick": QUICK, "default": DEFAULT, "full": FULL, "whole": WHOLE}
