"""The kinds of models there are: for each, how its numbers become a model again."""

from __future__ import annotations

from collections.abc import Callable

from sims.learning.inference.extra_trees import extra_trees_of_arrays
from sims.learning.inference.header import ModelHeader
from sims.learning.inference.kernel_ridge import kernel_ridge_of_arrays
from sims.learning.inference.network import network_of_arrays
from sims.learning.inference.signal_map.signal_map_model import signal_map_of_arrays
from sims.learning.inference.touch_model import Arrays, TouchModel

KINDS: dict[str, Callable[[ModelHeader, Arrays], TouchModel]] = {
    "kernel-ridge": kernel_ridge_of_arrays,
    "extra-trees": extra_trees_of_arrays,
    "network": network_of_arrays,
    "signal-map": signal_map_of_arrays,
}
"""Kind of a model's header -> model of header and arrays; raises InputError where the arrays do not fit."""
