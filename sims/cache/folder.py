"""Where results are kept between runs: the system's cache folder for optopad, or the one that is named."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path

CACHE_VARIABLE = "OPTOPAD_CACHE"
"""Environment variable that names the cache folder."""


def cache_folder() -> Path:
    """The folder that `OPTOPAD_CACHE` names, else the system's cache folder for optopad; it need not exist."""
    chosen = os.environ.get(CACHE_VARIABLE)
    return Path(chosen) if chosen else user_cache_path("optopad")


def kernel_folder() -> Path:
    """Where compiled kernels are kept: `NUMBA_CACHE_DIR`, else in the cache folder; it need not exist."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return Path(chosen) if chosen else cache_folder() / "kernels"
