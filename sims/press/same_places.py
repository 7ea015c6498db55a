"""Places that a stage reports a little differently each time, and that are one."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from design.arrays import FloatArray, IntArray

SAME_PLACE_MM = 0.15
"""Places this near are one: seven positioning errors of the default stage, random places lie a millimetre apart."""


def place_numbers(at_mm: FloatArray, within_mm: float = SAME_PLACE_MM) -> IntArray:
    """Number the places of samples.

    Parameters
    ----------
    at_mm : (n, 2) reported x, y [mm]
    within_mm : places linked by steps of at most this are one [mm]

    Returns
    -------
    (n,) numbers from 0 without gaps
    """
    distinct, number = np.unique(at_mm, axis=0, return_inverse=True)
    linked = cKDTree(distinct).query_pairs(within_mm, output_type="ndarray")
    count = len(distinct)
    graph = coo_array((np.ones(len(linked)), (linked[:, 0], linked[:, 1])), shape=(count, count))
    _, cluster = connected_components(graph, directed=False)
    return np.asarray(cluster[np.asarray(number).reshape(-1)], dtype=np.int64)
