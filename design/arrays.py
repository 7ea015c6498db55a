"""Type aliases of NumPy arrays for the whole project; the docstrings of functions give shapes and units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def plain_numbers(values: FloatArray) -> Any:
    """An array as nested lists for JSON; None where a number is not finite."""
    if values.ndim:
        return [plain_numbers(one) for one in values]
    return float(values) if np.isfinite(values) else None
