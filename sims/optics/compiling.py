# mypy: allow-untyped-calls
"""`python -m optopad.sims.optics.compiling`: compile the light kernels in parallel to the process that needs them.

Compiling takes one core a minute, once per machine. The tracing process compiles kernels in the order in which it calls
them, while this program begins with the last of them. If both need the same kernel, the later one waits for the other
(`optopad.sims.kernels`). The program ends when its standard input closes. With `--alone` it continues until all kernels
are compiled.
"""

from __future__ import annotations

import os
import sys
import threading
from typing import Any

import numpy as np

BESIDE = ("untouched_deposits", "scattered", "trace_further")


def main(arguments: list[str]) -> None:
    """First compile the kernels in `BESIDE`, which the tracing process leaves to this program, then all others."""
    if arguments != ["--alone"]:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    from optopad.sims.optics.engine import compiled

    types = signatures()
    for name in BESIDE:
        getattr(compiled, name).compile(types[name])
    _walk_one_ray()
    for name in types:
        getattr(compiled, name).compile(types[name])


def signatures() -> dict[str, tuple[Any, ...]]:
    """Argument types of each kernel, by kernel name; they are the same for every scene."""
    import numba
    from numba import types

    from optopad.sims.optics.surface.tops import Top

    one, two, three, four = (types.Array(types.float64, sides, "C") for sides in (1, 2, 3, 4))
    layout, wanted = types.Array(types.int64, 2, "C"), types.Array(types.boolean, 2, "C")
    top = numba.typeof(Top(np.zeros(1), np.zeros((0, 0, 16))))
    patches, orders = types.Tuple((layout, one)), types.Tuple((layout, one, two))
    flat = types.Tuple((three, two, three, two, two, two))
    state = (four, wanted, two, two, one, one, three, flat, two)
    flags, whole, real = types.boolean, types.int64, types.float64
    return {
        "trace_once": (*state, types.UniTuple(one, 6), types.UniTuple(one, 8), two, one),
        "trace_further": (*state, two, two, patches, one, orders, one, types.UniTuple(three, 3)),
        "untouched_deposits": (two, flags, two, one, top, two, whole, one, real, layout),
        "scattered": (two, two, two, patches, one, orders, one, top),
        "joined": (two, two, two, one, layout, one),
        "bounce_matrix": (layout, two, one, top, two, whole),
        "flat_matrix": (two, two, one, types.UniTuple(one, 6)),
        "patch_areas": (layout, two, one),
        "patch_layout": (one, real),
    }


def _walk_one_ray() -> None:
    """Compile the kernels that trace sample rays for the report's pictures."""
    from optopad.design.preset import preset
    from optopad.sims.optics.paths import LightWalker
    from optopad.sims.optics.scene.lower import scene_of

    scene = scene_of(preset("piacenza2017-pad"))
    LightWalker(scene, (0.5 * scene.length_mm, 0.5 * scene.width_mm), None, 0).follow(0, [0])


def _end_with_parent() -> None:
    """End this process when its parent ends, which closes standard input."""
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
