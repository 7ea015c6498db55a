"""Types of the kernels' decorators and of tuples of arrays; only the type checker uses them, not Numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from numba.core.dispatcher import Dispatcher

from optopad.design.arrays import FloatArray, IntArray

Function = TypeVar("Function", bound=Callable[..., object])


class KernelDecorator(Protocol):
    """Type of `numba.njit` with options that Numba's own types do not have."""

    def __call__(self, function: Function, /) -> Dispatcher[Function]:
        """Return the compiled function, whose attribute `py_func` is the Python function."""


StraightRules = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Gauss nodes and weights for direct light: over the emitter, the receiver's columns, and the height of a column."""
ImageRules = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Gauss nodes and weights for images that are summed path by path (`optopad.sims.optics.engine.mirrored`)."""
Patches = tuple[IntArray, FloatArray]
"""Layout of the patches into which walls, bottom and tip are divided
(`optopad.sims.optics.engine.scattered.layout_of`), and their areas [mm²]."""
Orders = tuple[IntArray, FloatArray, FloatArray]
"""Data for light scattered more than once: layout of patches, their areas, and transfer between them
(`optopad.sims.optics.engine.repeated`)."""
UntouchedLight = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Light of the untouched pad: an array of direct flux, flux mirrored by the top, and correction factor of direct flux;
scattered flux; flux mirrored by walls; light deposited on patches by emitters, and by receivers; scattered flux
computed from these deposits."""
UntouchedRays = tuple[FloatArray, FloatArray, FloatArray]
"""Light of the untouched pad by replicate: emitters' and receivers' deposits on patches, and light mirrored by smooth
walls."""
