"""Limits on the size of a fit: numbers of samples, memory, and the size of the forest."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Limits on the size of a fit; a learner ignores the limits of other learners.

    Attributes
    ----------
    search_samples : largest number of samples in contact for the kernel-ridge grid search, fitted and held-out together
    fit_samples : largest number of samples in contact for the final kernel-ridge fit
    tree_samples : largest number of samples in contact for the trees
    memory_gb : largest size of the kernel matrix of the final fit [GB]
    landmarks : number of samples that the model stores if the kernel matrix exceeds `memory_gb` and is approximated
    trees : number of trees in the forest
    """

    search_samples: int = 6_000
    fit_samples: int = 10_000
    tree_samples: int = 30_000
    memory_gb: float = 5.0
    landmarks: int = 8_000
    trees: int = 80


DEFAULT = FitSettings()
QUICK = FitSettings(search_samples=2_000, fit_samples=4_000, tree_samples=8_000, trees=40)
"""Limits for a first look: a fit takes seconds instead of minutes."""
FULL = FitSettings(fit_samples=24_000, tree_samples=60_000, trees=120)
"""Limits that allow half of the paper's training samples in contact, in one exact kernel matrix."""
WHOLE = replace(FULL, fit_samples=60_000, memory_gb=12.0)
"""Limits that allow all 49,368 of the paper's samples in contact, in one single-precision kernel matrix of 9.8 GB."""
EFFORTS = {"quick": QUICK, "default": DEFAULT, "full": FULL, "whole": WHOLE}
