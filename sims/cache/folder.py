"""Where results are kept between runs: the system's cache folder for optopad, or the one that is named."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path

CACHE_VARIABLE = "OPTOPAD_CACHE"
"""Environment variable that names the cache folder."""


NO_HOME = Path(os.devnull) / "no home folder"
"""The home of a user who has none: nothing can be kept below it, and a run goes on without."""


def cache_folder() -> Path:
    """The folder that `OPTOPAD_CACHE` names, else the system's cache folder for optopad; it need not exist."""
    if chosen := os.environ.get(CACHE_VARIABLE):
        return Path(os.path.expanduser(chosen))
    try:
        folder = user_cache_path("optopad")
    except RuntimeError:  # no home
        return NO_HOME
    return folder if folder.is_absolute() else NO_HOME


def kernel_folder() -> Path:
    """Where compiled kernels are kept: `NUMBA_CACHE_DIR`, else in the cache folder; it need not exist."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    return Path(chosen) if chosen else cache_folder() / "kernels"
