# mypy: allow-untyped-calls
"""`python -m sims.optics.compiling`: half of the light kernels, beside the process that needs them all.

Compiling takes a minute of one core, once on a machine. The process that traces compiles what it calls, in the order in
which it calls it; this one compiles what comes last in that order. Whoever comes second to a kernel waits for it
(`sims.cache.kernels`).
"""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

import numpy as np


def main() -> None:
    """Compile, in the order in which a tracing process needs the kernels."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from sims.optics.engine import compiled

    for name, types in signatures().items():
        getattr(compiled, name).compile(types)
    _walk_one_ray()


def signatures() -> dict[str, tuple[Any, ...]]:
    """Types that the kernels which are compiled here are called with; every scene calls them with the same."""
    import numba
    from numba import types

    from sims.optics.surface.top import Top

    one, two, three, four = (types.Array(types.float64, sides, "C") for sides in (1, 2, 3, 4))
    layout, wanted = types.Array(types.int64, 2, "C"), types.Array(types.boolean, 2, "C")
    top = numba.typeof(Top(np.zeros((1, 1)), np.zeros((0, 0, 16))))
    patches, orders = types.Tuple((layout, one)), types.Tuple((layout, one, two))
    flat = types.Tuple((three, two, three, two, two, two))
    state = (four, wanted, two, two, one, two, three, flat, two)
    return {
        "untouched_deposits": (
            two,
            types.boolean,
            two,
            one,
            top,
            two,
            types.int64,
            one,
            types.float64,
            layout,
        ),
        "scattered": (two, two, two, patches, one, orders, one, top),
        "trace_further": (*state, two, two, patches, one, orders, one, types.UniTuple(three, 3)),
    }


def _walk_one_ray() -> None:
    """Compile what draws rays, which a report needs."""
    from design.preset import preset
    from sims.optics.oracle.paths import LightWalker
    from sims.optics.scene.lower import scene_of

    scene = scene_of(preset("piacenza2017-pad"))
    LightWalker(scene, (0.5 * scene.length_mm, 0.5 * scene.width_mm), None, 0).follow(0, [0])


def _end_with_parent() -> None:
    """The parent holds the other end of standard input until it ends, however it does."""
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
