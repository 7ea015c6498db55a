"""The load on a tip over a load protocol: driven in steps with pauses, in and out.

    depth        ______
            ____|      |____
       ____|                |____        a step at one speed, then a pause
    __|                          |__     time

The load is that of the elastic press, or with `elastomer.viscoelastic` in the design its hereditary integral
(see below for its limits). Depth counts from first contact; a pause follows every step, in and out.

Left out: acceleration of the stage, and errors of the zero of depth.

Load that depends on the past: an option for press and retract, off unless a design sets it.

Model
-----
The standard linear solid (a spring parallel to a spring and a dashpot in series) relaxes after a step as

    g(t) = 1 + s/(1 - s) exp(-t/τ)

over its long-time modulus, s being the share of the instantaneous modulus that relaxes away and τ the time
constant. `elastomer.youngs_modulus_mpa`, from slow tests, is taken as the long-time modulus, so g(∞) = 1 and
g(0) = 1/(1 - s). Quasi-linear viscoelasticity (Fung, Biomechanics, 1981, section 7.6) applies g to the load
F_e(d) of the elastic press:

    F(t) = ∫ g(t - t') dF_e(d(t'))/dt' dt'

Where F_e is linear in time between samples the integral is exact: with q the part that relaxes,
q(t + Δ) = q(t) exp(-Δ/τ) + ΔF_e (1 - exp(-Δ/τ)) τ/Δ and F = F_e + s/(1 - s) q.

While the contact grows this is Lee and Radok's solution for a linear solid (J. Appl. Mech. 27, 1960,
438-444), because Hertz' load is one function of depth; for large strains it is an assumption.

What it leaves out
------------------
* True retraction: the skin recovers more slowly than the tip leaves, the contact shrinks faster than the
elastic one (Ting, J. Appl. Mech. 33, 1966, 845-854), and the load depends on that. Here the elastic contact
is kept, which gives negative loads at the end of a fast retraction; a tip without adhesion cannot pull,
so they count as 0 (`LoadHistory.has_left`). Against Ting's solution for a Hertz contact, pressed and
  retracted at one rate in a time of τ, the load in retraction is off by up to 2, 4 and 5 % of the peak for
  s = 0.1, 0.3 and 0.5, and the work lost is 16, 11 and 8 % too high (a test compares them).
* The slow recovery of the surface: shape, and with it light, stay those of the elastic press.
* More than one time constant, and a proof that dissipation is positive: it is for a linear load, and tests
find it so for this one over single cycles of press and retract, but the model does not enforce it.
* Values: none is offered. The paper shows hysteresis but prints no figure from which to take them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError
from design.press_protocol import LoadProtocol
from design.spec import SensorDesign


@dataclass(frozen=True, kw_only=True)
class StandardLinearSolid:
    """Relaxation of the load.

    Attributes
    ----------
    relaxed_share : share of the instantaneous modulus that relaxes away [-]; 0 to below 1
    time_constant_s : time constant of the relaxation at constant depth [s]
    """

    relaxed_share: float
    time_constant_s: float

    @property
    def excess(self) -> float:
        """Instantaneous over long-time modulus, less 1 [-]."""
        return self.relaxed_share / (1.0 - self.relaxed_share)

    def relaxation(self, time_s: FloatArray) -> FloatArray:
        """(...,) load after a step over its long-time value [-], at times after it [s]."""
        return np.asarray(1.0 + self.excess * np.exp(-time_s / self.time_constant_s), dtype=np.float64)


def solid_of(design: SensorDesign) -> StandardLinearSolid | None:
    """The relaxation given in the design; None where it has none, and the load is elastic."""
    given = design.elastomer.viscoelastic
    if given is None:
        return None
    return StandardLinearSolid(relaxed_share=given.relaxed_share, time_constant_s=given.time_constant_s)


def viscoelastic_load_n(time_s: FloatArray, elastic_n: FloatArray, solid: StandardLinearSolid) -> FloatArray:
    """The hereditary integral, also where it would need the tip to pull.

    Parameters
    ----------
    time_s : (n,) times that do not decrease [s]; two equal ones are a step
    elastic_n : (n,) elastic load at those times [N], linear in time between them; before the first it was 0
        and jumped
    solid : how the load relaxes

    Returns
    -------
    (n,) load [N].

    Raises
    ------
    InputError : times decrease, or differ in number from the loads
    """
    if time_s.shape != elastic_n.shape or bool(np.any(np.diff(time_s) < 0.0)):
        raise InputError("time_s: needs one time per load, in rising order; sort the samples by time")
    ratio = np.diff(time_s, prepend=time_s[:1]) / solid.time_constant_s
    rise = np.diff(elastic_n, prepend=0.0)
    with np.errstate(invalid="ignore"):
        gained = rise * np.where(ratio > 0.0, -np.expm1(-ratio) / np.where(ratio > 0.0, ratio, 1.0), 1.0)
    kept = np.exp(-ratio)
    relaxing = np.empty_like(elastic_n)
    present = 0.0
    for place in range(elastic_n.size):
        present = kept[place] * present + gained[place]
        relaxing[place] = present
    return np.asarray(elastic_n + solid.excess * relaxing, dtype=np.float64)


def loop_energy_mj(depth_mm: FloatArray, force_n: FloatArray) -> float:
    """Work that a press and its retraction leave in the pad, ∮ F dd [mJ = N mm], by trapezia."""
    return float(np.sum(0.5 * (force_n[1:] + force_n[:-1]) * np.diff(depth_mm)))


SAMPLES_PER_STEP = 20
"""Number of samples of a step, and of a pause; ten times as many change the load by less than 1e-5 of its peak."""


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
        """Work that stays in the pad over the protocol [mJ]; 0 without relaxation, apart from sampling errors."""
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
    solid : relaxation of the load; None: it does not relax
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
