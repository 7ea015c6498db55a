"""The load that a tip feels over a load protocol: driven in steps with pauses, in and out.

    depth        ______
            ____|      |____
       ____|                |____        a step at one speed, then a pause
    __|                          |__     time

The load is that of the elastic press, or with `elastomer.viscoelastic` in the design its hereditary integral
(`viscoelastic`, which says what that leaves out). Depth counts from first contact; a pause follows every
step, in and out.

What it leaves out: how the stage speeds up and slows down, and errors of the zero of depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from design.protocols.load import LoadProtocol
from sims.contact.viscoelastic import StandardLinearSolid, loop_energy_mj, viscoelastic_load_n

SAMPLES_PER_STEP = 20
"""Samples of a step, and of a pause; ten times as many change the load by less than 1e-5 of its peak."""


@dataclass(frozen=True, kw_only=True)
class LoadHistory:
    """Depth and load of a protocol over time.

    Attributes
    ----------
    time_s, depth_mm : (n,) from the touch of the tip
    elastic_n : (n,) load of the elastic press [N]
    load_n : (n,) load [N]: the same without relaxation; never negative
    has_left : (n,) True where relaxation would need the tip to pull, so that it has left the surface
    pause_ends : (pause,) indices of the last sample of each pause, in order
    """

    time_s: FloatArray
    depth_mm: FloatArray
    elastic_n: FloatArray
    load_n: FloatArray
    has_left: BoolArray
    pause_ends: IntArray

    @property
    def turn(self) -> int:
        """Index of the last sample at the deepest press."""
        return int(self.pause_ends[self.pause_ends.size // 2 - 1])

    @property
    def has_relaxation(self) -> bool:
        """Whether the load differs from the elastic one."""
        return not np.array_equal(self.load_n, self.elastic_n)

    @property
    def lost_mj(self) -> float:
        """Work that stays in the pad over the protocol [mJ]; 0 without relaxation, but for the sampling."""
        return loop_energy_mj(self.depth_mm, self.load_n)


def protocol_path(protocol: LoadProtocol) -> tuple[FloatArray, FloatArray, IntArray]:
    """Times [s], depths [mm], and the indices at which pauses end."""
    step_mm, steps = protocol.step_mm.value, protocol.steps
    moving_s, pause_s = step_mm / protocol.speed_mm_per_s.value, protocol.pause_s.value
    stops = step_mm * np.concatenate([np.arange(steps + 1), np.arange(steps - 1, -1, -1)])
    time, depth, ends = [np.zeros(1)], [np.zeros(1)], []
    share = np.linspace(0.0, 1.0, SAMPLES_PER_STEP + 1)[1:]
    start = 0.0
    for before, after in pairwise(stops):
        time += [start + moving_s * share, start + moving_s + pause_s * share]
        depth += [before + (after - before) * share, np.full(share.size, after)]
        start += moving_s + pause_s
        ends.append(sum(part.size for part in time) - 1)
    return np.concatenate(time), np.concatenate(depth), np.array(ends, dtype=np.int64)


def load_history(
    protocol: LoadProtocol, elastic_n: Callable[[float], float], solid: StandardLinearSolid | None = None
) -> LoadHistory:
    """Drive the tip by a protocol.

    Parameters
    ----------
    protocol : how the tip is driven
    elastic_n : load of the elastic press [N] at a depth [mm], as `SolvedPress.force_n`
    solid : how the load relaxes; None: it does not
    """
    time_s, depth_mm, pause_ends = protocol_path(protocol)
    elastic = np.array([elastic_n(float(depth)) for depth in depth_mm])
    load = elastic if solid is None else viscoelastic_load_n(time_s, elastic, solid)
    return LoadHistory(
        time_s=time_s,
        depth_mm=depth_mm,
        elastic_n=elastic,
        load_n=np.maximum(load, 0.0),
        has_left=load < -1e-9 * float(elastic.max()),
        pause_ends=pause_ends,
    )
