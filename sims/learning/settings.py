"""Limits on the size of a fit: numbers of samples, and the size of the forest."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Limits on the size of a fit; a learner ignores the limits of other learners.

    Attributes
    ----------
    search_samples : largest number of samples in contact for the kernel-ridge grid search, fitted and held-out together
    fit_samples : largest number of samples in contact for the final kernel-ridge fit
    tree_samples : largest number of samples in contact for the trees
    trees : number of trees in the forest
    """

    search_samples: int = 6_000
    fit_samples: int = 10_000
    tree_samples: int = 30_000
    trees: int = 80


DEFAULT = FitSettings()
QUICK = FitSettings(search_samples=2_000, fit_samples=4_000, tree_samples=8_000, trees=40)
"""Limits for a first look: a fit takes seconds instead of minutes."""
FULL = FitSettings(fit_samples=24_000, tree_samples=60_000, trees=120)
"""Limits that allow half of the paper's training samples in contact, in one kernel matrix of 4.6 GB."""
EFFORTS = {"quick": QUICK, "default": DEFAULT, "full": FULL}
