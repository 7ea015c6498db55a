"""Types of kernels: results of their decorators, and tuples that they take (`sims.optics.engine.untouched`).

Numba ignores annotations; the type checker uses them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from numba.core.dispatcher import Dispatcher

from design.arrays import FloatArray, IntArray

Function = TypeVar("Function", bound=Callable[..., object])


class KernelDecorator(Protocol):
    """`numba.njit` with options that its own types do not have."""

    def __call__(self, function: Function, /) -> Dispatcher[Function]:
        """The compiled function; `py_func` is its source function."""


StraightRules = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Nodes and weights over the emitter, the receiver's columns, and the heights of a column."""
ImageRules = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Nodes and weights of whole images (`sims.optics.engine.mirrored`)."""
Patches = tuple[IntArray, FloatArray]
"""Layout of the patches (`sims.optics.engine.scattered.layout_of`), and their areas."""
Orders = tuple[IntArray, FloatArray, FloatArray]
"""Data for light scattered more than once (`sims.optics.engine.repeated`)."""
UntouchedLight = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Data of the untouched pad: direct flux, mirrored flux and gain of direct flux in one array; scattered and
wall-mirrored flux; both deposits, and their join."""
UntouchedRays = tuple[FloatArray, FloatArray, FloatArray]
"""Data of the untouched pad by replicate: both deposits, and the light that smooth walls mirror onto receivers."""
