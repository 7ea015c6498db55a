"""No test reads or writes the user's kept light: what a test claims to trace is traced."""

from __future__ import annotations

import os

os.environ["OPTOPAD_LIGHT_CACHE_MB"] = "0"  # processes that tests start inherit it
