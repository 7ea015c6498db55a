"""Force on a tip that is driven through a load protocol: steps with pauses, into the pad and out again.

    depth        ______
            ____|      |____
       ____|                |____        a step at one speed, then a pause
    __|                          |__     time

The force is that of the elastic press. If the design sets `elastomer.viscoelastic`, the force also depends on the past,
by the model below. Depth is measured from first contact. A pause follows every step, both into the pad and out.

Left out: acceleration of the stage, and errors in the depth of first contact.

Viscoelastic model
------------------
The standard linear solid (a spring parallel to a spring and a dashpot in series) relaxes after a step as

    g(t) = 1 + s/(1 - s) exp(-t/τ)

where g is the modulus over the long-time modulus, s the share of the instantaneous modulus that relaxes away, and τ the
time constant. `elastomer.youngs_modulus_mpa` comes from slow tests and is taken as the long-time modulus, so g(∞) = 1
and g(0) = 1/(1 - s). Quasi-linear viscoelasticity (Fung, Biomechanics, 1981, section 7.6) applies g to the force F_e(d)
of the elastic press:

    F(t) = ∫ g(t - t') dF_e(d(t'))/dt' dt'

If F_e is linear in time between samples, the integral is computed exactly. With q the part that relaxes,
q(t + Δ) = q(t) exp(-Δ/τ) + ΔF_e (1 - exp(-Δ/τ)) τ/Δ and F = F_e + s/(1 - s) q.

While the contact grows, this is Lee and Radok's solution for a linear solid (J. Appl. Mech. 27, 1960, 438-444), because
Hertz' force depends on depth alone. For large strains it is an assumption.

What the viscoelastic model leaves out
--------------------------------------
* The true contact in retraction. The skin recovers more slowly than the tip leaves, so the contact shrinks faster than
  an elastic one, which affects the force (Ting, J. Appl. Mech. 33, 1966, 845-854). Here the elastic contact is assumed,
  which gives negative forces at the end of a fast retraction. A tip without adhesion cannot pull, so they count as 0
  (`LoadHistory.has_left`). A test compares this with Ting's solution for a Hertz contact that is pressed and retracted
  at one speed within a time of τ. For s = 0.1, 0.3 and 0.5, the force in retraction is off by up to 2, 4 and 5 % of the
  peak, and the lost work is 16, 11 and 8 % too high.
* The slow recovery of the surface. Shape and light are those of the elastic press.
* More than one time constant.
* A guarantee that dissipation is positive. It is positive for a linear force, and tests find it positive for single
  cycles of press and retraction, but the model does not enforce it.
* Default values. The paper shows hysteresis but gives no figures from which to derive them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.press_protocol import LoadProtocol
from optopad.design.spec import SensorDesign


@dataclass(frozen=True, kw_only=True)
class StandardLinearSolid:
    """Relaxation of the force at constant depth, by one spring-dashpot element.

    Attributes
    ----------
    relaxed_share : share of the instantaneous modulus that relaxes away [-], at least 0 and below 1
    time_constant_s : time constant of the relaxation [s]
    """

    relaxed_share: float
    time_constant_s: float

    @property
    def excess(self) -> float:
        """Ratio of the instantaneous to the long-time modulus, minus 1 [-]."""
        return self.relaxed_share / (1.0 - self.relaxed_share)

    def relaxation(self, time_s: FloatArray) -> FloatArray:
        """Force (...) over its long-time value [-], at times (...) after a sudden step of depth [s]."""
        return np.asarray(1.0 + self.excess * np.exp(-time_s / self.time_constant_s), dtype=np.float64)


def solid_of(design: SensorDesign) -> StandardLinearSolid | None:
    """The relaxation set in the design; None if there is none, and the force is purely elastic."""
    given = design.elastomer.viscoelastic
    if given is None:
        return None
    return StandardLinearSolid(relaxed_share=given.relaxed_share, time_constant_s=given.time_constant_s)


def viscoelastic_load_n(time_s: FloatArray, elastic_n: FloatArray, solid: StandardLinearSolid) -> FloatArray:
    """Force with relaxation (the hereditary integral); it may be negative, although a real tip cannot pull.

    Parameters
    ----------
    time_s : (n,) times in ascending order [s]; two equal times make a sudden step
    elastic_n : (n,) elastic force at these times, linear between them [N]. It is 0 before the first time, so the force
        may start with a jump
    solid : how the force relaxes

    Returns
    -------
    (n,) force with relaxation [N].

    Raises
    ------
    InputError : times decrease, or differ in number from the forces
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
    """Work that a press and its retraction leave in the pad: ∮ F dd by the trapezoidal rule [mJ = N mm]."""
    return float(np.sum(0.5 * (force_n[1:] + force_n[:-1]) * np.diff(depth_mm)))


SAMPLES_PER_STEP = 20
"""Number of samples per step and per pause. Ten times as many change the force by less than 1e-5 of its peak."""


@dataclass(frozen=True, kw_only=True)
class LoadHistory:
    """Depth and force over time, while the tip follows a load protocol.

    Attributes
    ----------
    time_s, depth_mm : (n,) time since first contact [s], and depth [mm]
    elastic_n : (n,) force of the elastic press [N]
    load_n : (n,) force with relaxation [N], never negative; equal to `elastic_n` without relaxation
    has_left : (n,) True where the model's force would be negative, which means that the tip has left the surface
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
        """Index of the last sample at the largest depth, where retraction starts."""
        return int(self.pause_ends[self.pause_ends.size // 2 - 1])

    @property
    def has_relaxation(self) -> bool:
        """Whether relaxation changes the force."""
        return not np.array_equal(self.load_n, self.elastic_n)

    @property
    def lost_mj(self) -> float:
        """Work that the whole protocol leaves in the pad [mJ]; without relaxation, 0 except for sampling errors."""
        return loop_energy_mj(self.depth_mm, self.load_n)


def protocol_path(protocol: LoadProtocol) -> tuple[FloatArray, FloatArray, IntArray]:
    """Times [s] and depths [mm] of a protocol, and the indices of the last sample of each pause."""
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
    """Compute the force while the tip follows a load protocol.

    Parameters
    ----------
    protocol : how the tip is driven
    elastic_n : function from depth [mm] to the force of the elastic press [N], e.g. `SolvedPress.force_n`
    solid : relaxation of the force; if None, the force is purely elastic
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
