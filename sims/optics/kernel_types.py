"""Types of kernels: what their decorators make, and what they are handed in tuples (`sims.optics.engine.untouched`).

Numba takes no notice of annotations; the type checker does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from numba.core.dispatcher import Dispatcher

from design.arrays import FloatArray, IntArray

Function = TypeVar("Function", bound=Callable[..., object])


class KernelDecorator(Protocol):
    """`numba.njit` with options that its own types do not know."""

    def __call__(self, function: Function, /) -> Dispatcher[Function]:
        """The compiled function; `py_func` is what it was made of."""


StraightRules = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Nodes and weights over the emitter, the receiver's columns, and the heights of a column."""
ImageRules = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Nodes and weights of whole images (`sims.optics.engine.mirrored`)."""
Patches = tuple[IntArray, FloatArray]
"""Layout of the patches (`sims.optics.engine.scattered.layout_of`), and their areas."""
Orders = tuple[IntArray, FloatArray, FloatArray]
"""What light that is scattered more than once needs (`sims.optics.engine.repeated`)."""
UntouchedLight = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Of the untouched pad: straight flux, mirrored flux and gain of straight flux in one array; scattered and
wall-mirrored flux; both deposits, and their join."""
UntouchedRays = tuple[FloatArray, FloatArray, FloatArray]
"""Of the untouched pad, replicate by replicate: both deposits, and what smooth walls mirror onto receivers."""
