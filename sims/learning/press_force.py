"""Force on the tip under a recorded press, at the times of a load cell's log.

Model
-----
Let d(t) be the depth that the stage reports, by the recording's clock, and T the log's clock. With

    t = T + b + r (T - T_mid)         b: clock offset [s], r: clock rate [-]
    D(t) = max(d(t) + δ, 0)           δ: error of the stage's zero of depth [mm]; in retraction δ + β, β: backlash [mm]
    q_X(t) = ∫ exp(-(t - t')/τ) dX    the part of X = F_e or D that relaxes

the force until the deepest hold ends is F = a (F_e(D) + e q_F), as in `optopad.sims.contact.load_protocol`. There F_e
is the elastic force at the design's modulus, a the modulus over it, τ the time constant, and e = s/(1 - s) the excess
of the instantaneous modulus, where s is the share that relaxes away.

In retraction the contact shrinks faster than an elastic one. Ting (J. Appl. Mech. 33, 1966, 845-854) takes the force
from the time t_1 at which the approaching contact was as large as now:

    D(t) - D(t_1) + e (q_D(t) - exp(-(t - t_1)/τ) q_D(t_1)) = 0
    F(t) = a (F_e(D(t_1)) + e exp(-(t - t_1)/τ) q_F(t_1)),   0 if there is no such t_1 (the tip has left)

The elastic contact gives F(t) = a max(F_e(D) + e q_F, 0). Which of the two is nearer to a thick, strongly indented
layer is not known, so the retraction is (1 - κ) times the latter and κ times the former; the fit has κ as an unknown.
Between the path's rows the tip moves in a straight line, except over the stretches that `TipPath.after_unknown` names:
there it may have pressed, so no press, rest or pause reaches into them. Rows are added so that no step in contact is
longer than `STEP_MM` and `STEP_S`.

Labels that jump
----------------
If the reported depth reaches its largest value within `JUMP_ROWS` rows, it was set, and the motion is not recorded.
Such a press is used while it is held. The times of the ramps are then taken from the force: where it crosses `LOW` and
`HALF` of its largest value, at a constant speed. The samples of the ramps do not count; the ramp only says since when
the pad relaxes. If rows are more than `LONGEST_GAP_S` apart while the tip moves, nothing says where it was, and the
press is not used.

Left out: several turns within one press (the contact counts as elastic until the deepest hold ends); adhesion; memory
of the previous press; averaging within the load cell's amplifier, apart from its mean delay, which is part of b.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of

LOG_MODULUS, EXCESS, LOG_TIME, ZERO_MM, CLOCK_S, RATE, TING, BACKLASH_MM = range(8)
"""Places of ln a, e, ln τ, δ, b, r, κ and β in a vector of unknowns."""
UNKNOWNS = 8

LEAST_DEPTH_MM = 0.3
"""Presses that stay above this depth are not used: an error of the zero of depth outweighs their force [mm]."""
REST_S, REST_SHARE, ROW_SHARE = 3.0, 0.6, 0.75
"""Longest rest that is used on either side of a press [s], and shares of the pause to the neighbouring press whose
samples, and whose rows, are used [-]."""
LEAST_REST = 3
"""Least number of samples at rest around a press, from which its tare is taken."""
REST_MARGIN_S = 0.1
"""A sample is at rest this long before contact and after it [s]; the clock offset is not known better at first."""
HELD_MM = 0.02
"""The deepest hold ends at the last row that is this close to the largest depth [mm]."""
STEP_MM, STEP_S = 0.03, 0.04
"""Longest step of depth [mm] and of time [s] between two nodes of the path in contact."""
FORCE_DEPTHS, TABLE_MM = 60, 0.002
MARGIN_MM = 0.3
"""How far the elastic force is continued beyond the deepest press [mm], for errors of the zero of depth."""
TAKEN_UP_MM = 0.05
"""Way back over which the stage takes up its backlash [mm]."""
SMOOTHED_ROWS, AGREE = (1, 2, 4, 8, 16, 32, 64), 1.0
"""Half widths of the lines that smooth the depth [rows], and half width of a confidence interval [sigma]."""
FLICKER_MM, FLICKER_S = 0.02, 0.25
"""Height [mm] and time [s] of a pause between two contacts that noise of the depth explains."""
LARGEST_EXPONENT = 500.0
JUMP_ROWS, JUMP_SHARE = 2, 0.9
"""Rows within which a label reaches this share of its largest depth, if it was set and not recorded."""
LONGEST_GAP_S, GAP_MM = 0.25, 0.2
"""Time between two rows of a press, and motion, above which the path between them is not known."""
LOW, HALF = 0.05, 0.5
"""Shares of the largest force that give the times of a ramp [-]."""


@dataclass(frozen=True, kw_only=True)
class TipPath:
    """Positions of the tip: `time_s` (m,), increasing [s], and `press_mm` (m, 3), location and depth [mm].

    A depth of 0 or less means no contact. `after_unknown` (k,) are the rows since whose row before the positions are
    unknown, in increasing order and from 1.
    """

    time_s: FloatArray
    press_mm: FloatArray
    after_unknown: IntArray = field(default_factory=lambda: np.empty(0, np.int64))

    @property
    def contacts(self) -> IntArray:
        """(press, 2) first row in contact, and first row after it, of each press.

        Noise of the depth near 0 does not divide a press: pauses above -`FLICKER_MM` and below `FLICKER_S` count as
        contact. An unknown stretch does.
        """
        depth = self.press_mm[:, 2]
        touched = depth > 0.0
        anew = np.zeros(len(depth) + 1, dtype=bool)
        anew[self.after_unknown] = anew[0] = anew[-1] = True
        begins = np.flatnonzero(touched & (anew[:-1] | ~np.roll(touched, 1)))
        ends = np.flatnonzero(touched & (anew[1:] | ~np.roll(touched, -1))) + 1
        if not len(begins):
            return np.empty((0, 2), np.int64)
        part = np.cumsum(anew)
        known = part[ends[:-1] - 1] == part[begins[1:]]
        short = known & (self.time_s[begins[1:]] - self.time_s[ends[:-1] - 1] < FLICKER_S)
        near = np.array(
            [depth[a:b].min(initial=0.0) > -FLICKER_MM for a, b in zip(ends[:-1], begins[1:], strict=True)],
            bool,
        )
        apart = ~(short & near)
        return np.stack([begins[np.append(True, apart)], ends[np.append(apart, True)]], axis=1)

    @property
    def touches_s(self) -> tuple[FloatArray, FloatArray]:
        """Times at which the presses begin, and at which they end, interpolated [s]; those on a known path only."""
        begin, end = (
            rows[(rows > 0) & (rows < len(self.time_s)) & ~np.isin(rows, self.after_unknown)]
            for rows in self.contacts.T
        )
        return self._crossings_s(begin - 1), self._crossings_s(end - 1)

    def _crossings_s(self, row: IntArray) -> FloatArray:
        depth, time_s = self.press_mm[:, 2], self.time_s
        share = depth[row] / (depth[row] - depth[row + 1])
        return time_s[row] + share * (time_s[row + 1] - time_s[row])


@dataclass(frozen=True, kw_only=True)
class PressWindow:
    """One press and the force samples around it.

    Attributes
    ----------
    node_s, node_mm : (node,) times by the recording's clock [s], and depths as the stage reports them [mm]
    rounded_mm : (node,) the same depths with a smooth curve between the path's rows in place of straight lines [mm]
    turn : index of the last node of the deepest hold
    table_n : elastic force at the design's modulus, at depths of 0, `TABLE_MM`, ... [N]
    time_s, force_n : (sample,) times by the log's clock [s], and measured force [N]
    rests : samples at rest before the press, and after it
    used : (sample,) whether a sample counts in the fit
    jumps : whether the reported depth jumps, so that only rest and hold are used
    """

    node_s: FloatArray
    node_mm: FloatArray
    rounded_mm: FloatArray
    turn: int
    table_n: FloatArray
    time_s: FloatArray
    force_n: FloatArray
    rests: tuple[int, int]
    used: BoolArray
    jumps: bool = False

    @property
    def deepest_mm(self) -> float:
        """Largest depth of the press [mm]."""
        return float(self.node_mm.max())

    @cached_property
    def way_back(self) -> FloatArray:
        """(node,) share of the backlash that is taken up: 0 until the turn, 1 after `TAKEN_UP_MM` back [-]."""
        share = np.clip((self.deepest_mm - self.node_mm) / TAKEN_UP_MM, 0.0, 1.0)
        share[: self.turn + 1] = 0.0
        return share

    @property
    def at_rest_n(self) -> tuple[FloatArray, FloatArray]:
        """Forces at rest before the press, and after it [N]."""
        before, after = self.rests
        return self.force_n[:before], self.force_n[len(self.force_n) - after :]

    @property
    def is_covered(self) -> bool:
        """Whether there are samples at rest before the press, enough at rest in all, and enough to the deepest hold."""
        pressed = (self.time_s > self.node_s[self.node_mm > 0.0][0]) & (self.time_s < self.node_s[self.turn])
        last = self.time_s[-1] > self.node_s[self.turn]
        rests = self.rests[0] > 0 and sum(self.rests) >= LEAST_REST
        return bool(rests and last and np.count_nonzero(pressed) >= LEAST_REST)

    @property
    def is_held(self) -> BoolArray:
        """(sample,) whether the tip is held at the largest depth."""
        held = self.node_s[self.node_mm >= self.deepest_mm - HELD_MM]
        found: BoolArray = (self.time_s > held[0]) & (self.time_s < held[-1])
        return found

    def elastic_n(self, depth_mm: FloatArray) -> FloatArray:
        """Elastic force at the design's modulus at depths [mm] of 0 or more [N]."""
        place = np.minimum(depth_mm / TABLE_MM, len(self.table_n) - 1.001)
        below = place.astype(np.int64)
        share = place - below
        found: FloatArray = self.table_n[below] * (1.0 - share) + self.table_n[below + 1] * share
        return found

    def tare_basis(self, weight: FloatArray) -> FloatArray:
        """(sample, 1 or 2) orthonormal basis of weighted tares: a level, and a slope if there is rest on both sides."""
        columns = [np.ones(len(self.time_s))]
        if min(self.rests) > 0:
            columns.append(self.time_s - self.time_s.mean())
        basis: FloatArray = np.linalg.qr(weight[:, None] * np.stack(columns, axis=1))[0]
        return basis


def press_windows(
    design: SensorDesign, path: TipPath, time_s: FloatArray, force_n: FloatArray
) -> list[PressWindow]:
    """Windows of all presses of `LEAST_DEPTH_MM` and deeper that have samples at rest around them, in their order.

    Raises
    ------
    ModelScopeError : the contact model does not cover a press.
    """
    found = []
    for begin, end, rows in spans(path):
        if largest_gap(path, begin, end)[0] > LONGEST_GAP_S:
            continue
        own_rows, ends = _around(path, begin, end, rows)
        inside = slice(*np.searchsorted(time_s, ends))
        own = time_s[inside], force_n[inside]
        made = _window(design, path, own_rows, own) if len(own[0]) > 2 * LEAST_REST else None
        made = _held(made) if made is not None and _jumps(path, begin, end) else made
        if made is not None and made.is_covered:
            found.append(made)
    return found


def spans(path: TipPath) -> list[tuple[int, int, slice]]:
    """First row in contact, first row after it, and rows up to the neighbours, of each usable press.

    A neighbour is a press or an unknown stretch; a press at which one begins or ends is not usable.
    """
    contacts, count = path.contacts, len(path.time_s)
    found = []
    for k, (begin, end) in enumerate(contacts):
        first = int(contacts[k - 1, 1]) if k else 0
        last = int(contacts[k + 1, 0]) if k + 1 < len(contacts) else count
        first = int(path.after_unknown[path.after_unknown <= begin].max(initial=first))
        last = int(path.after_unknown[path.after_unknown >= end].min(initial=last))
        if first < begin and end < last and path.press_mm[begin:end, 2].max() >= LEAST_DEPTH_MM:
            found.append((int(begin), int(end), slice(first, last)))
    return found


def _around(path: TipPath, begin: int, end: int, rows: slice) -> tuple[slice, tuple[float, float]]:
    """Rows of a press without the ends of its neighbours, and first and last time of its samples."""
    times, count = path.time_s, len(path.time_s)
    before, after = times[begin] - times[rows.start], times[rows.stop - 1] - times[end]
    first, last = rows.start == 0, rows.stop == count
    wide = ROW_SHARE * before + first, ROW_SHARE * after + last
    near = slice(
        min(int(np.searchsorted(times, times[begin] - wide[0])), begin - 1),
        max(int(np.searchsorted(times, times[end] + wide[1], side="right")), end + 1),
    )
    low = min(REST_S, before if first else REST_SHARE * before)
    high = min(REST_S, after if last else REST_SHARE * after)
    return near, (float(times[begin] - low), float(times[end] + high))


def largest_gap(path: TipPath, begin: int, end: int) -> tuple[float, float]:
    """Longest time between two rows of a press over which the tip moves by more than `GAP_MM` [s], and motion [mm]."""
    rows = slice(begin - 1, end + 1)
    step_s, moved = np.diff(path.time_s[rows]), np.abs(np.diff(np.maximum(path.press_mm[rows, 2], 0.0)))
    step_s = np.where(moved > GAP_MM, step_s, 0.0)
    longest = int(np.argmax(step_s))
    return float(step_s[longest]), float(moved[longest])


def _jumps(path: TipPath, begin: int, end: int) -> bool:
    depth = path.press_mm[begin:end, 2]
    return int(np.argmax(depth >= JUMP_SHARE * depth.max())) < JUMP_ROWS


def _window(
    design: SensorDesign, path: TipPath, rows: slice, samples: tuple[FloatArray, FloatArray]
) -> PressWindow:
    press_mm = path.press_mm[rows]
    x, y, deepest = press_mm[int(np.argmax(press_mm[:, 2]))]
    solved = solved_press(contact_of(design), float(deepest), at_mm=(float(x), float(y)))
    depths = np.linspace(0.0, deepest, FORCE_DEPTHS)
    curve = PchipInterpolator(depths, [solved.force_n(float(depth)) for depth in depths])
    time_s = path.time_s[rows]
    depth_mm = smoothed(time_s, press_mm[:, 2])
    node_s, node_mm = _refined(time_s, depth_mm)
    return PressWindow(
        node_s=node_s,
        node_mm=node_mm,
        rounded_mm=PchipInterpolator(time_s, depth_mm)(node_s),
        turn=_turn(node_mm),
        table_n=curve(np.arange(0.0, deepest + MARGIN_MM + 2 * TABLE_MM, TABLE_MM)),
        time_s=samples[0],
        force_n=samples[1],
        rests=_rests(samples[0], node_s[node_mm > 0.0]),
        used=np.ones(len(samples[0]), dtype=bool),
    )


def _turn(depth_mm: FloatArray) -> int:
    return int(np.flatnonzero(depth_mm >= depth_mm.max() - HELD_MM)[-1])


def _rests(time_s: FloatArray, contact_s: FloatArray) -> tuple[int, int]:
    return (
        int(np.count_nonzero(time_s < contact_s[0] - REST_MARGIN_S)),
        int(np.count_nonzero(time_s > contact_s[-1] + REST_MARGIN_S)),
    )


def _held(window: PressWindow) -> PressWindow | None:
    """The window with ramps at the times that its force says, and its ramps left out; None if no hold is found."""
    deepest, time_s = window.deepest_mm, window.time_s
    above = window.force_n - np.quantile(window.force_n, 0.1)
    top = float(above.max())
    high = np.flatnonzero(above > HALF * top)
    shares = window.table_n[: int(deepest / TABLE_MM) + 1] / window.elastic_n(np.array([deepest]))[0]
    way = np.interp([LOW, HALF], shares, np.linspace(0.0, 1.0, len(shares)))
    rise, fall = (
        _ramp(time_s[part][::order], above[part][::order] / top, way)
        for part, order in ((slice(0, high[0] + 1), 1), (slice(high[-1], None), -1))
    )
    if rise is None or fall is None or not rise[0] < rise[1] < fall[1] < fall[0]:
        return None
    margin = max(REST_MARGIN_S, 1.5 * float(np.median(np.diff(time_s))))
    knots = np.array([rise[0] - 1.0, rise[0], rise[1], fall[1], fall[0], fall[0] + 1.0])
    node_s, node_mm = _refined(
        knots, np.array([-MARGIN_MM - 1.0, 0.0, deepest, deepest, 0.0, -MARGIN_MM - 1.0])
    )
    held = (time_s > rise[1] + margin) & (time_s < fall[1] - margin)
    if np.count_nonzero(held) < LEAST_REST:
        return None
    return replace(
        window,
        node_s=node_s,
        node_mm=node_mm,
        rounded_mm=node_mm,
        turn=_turn(node_mm),
        rests=_rests(time_s, np.array([rise[0], fall[0]])),
        used=held | (time_s < rise[0] - margin) | (time_s > fall[0] + margin),
        jumps=True,
    )


def _ramp(time_s: FloatArray, share: FloatArray, way: FloatArray) -> tuple[float, float] | None:
    """Times of first contact and of the full depth of a ramp that ends (or begins) above `HALF`; None without rest.

    Parameters
    ----------
    time_s, share : samples towards the hold, and force over its largest [-]
    way : share of the ramp's depth at which the force is `LOW` and `HALF` of its largest [-]
    """
    below = np.flatnonzero(share < LOW)
    if not below.size:
        return None
    at = []
    for level in (LOW, HALF):
        k = int(np.flatnonzero(share[below[-1] :] >= level)[0] + below[-1])
        at.append(np.interp(level, share[k - 1 : k + 1], time_s[k - 1 : k + 1]))
    speed = (at[1] - at[0]) / (way[1] - way[0])
    begin = at[0] - way[0] * speed
    return float(begin), float(begin + speed)


def smoothed(time_s: FloatArray, depth_mm: FloatArray) -> FloatArray:
    """Depths with less noise: each from a straight line through the rows around it, over as many as agree.

    Noise of the depth is noise of the modelled force, times 1 + e; least squares would make e smaller for it. The width
    follows the rule of intersecting confidence intervals (Goldenshluger and Nemirovski, Math. Methods Stat. 6, 1997,
    135-170): it doubles as long as the intervals of all widths so far have a point in common. So corners stay.
    """
    count = len(depth_mm)
    if count < 3:
        return depth_mm
    noise = 1.4826 * float(np.median(np.abs(np.diff(depth_mm, 2)))) / np.sqrt(6.0)
    own = time_s - time_s[0]
    sums = [
        np.concatenate([[0.0], np.cumsum(one)])
        for one in (np.ones(count), own, depth_mm, own**2, own * depth_mm)
    ]
    found, low, high = depth_mm.copy(), depth_mm - AGREE * noise, depth_mm + AGREE * noise
    agrees = np.full(count, noise > 0.0)
    for half in SMOOTHED_ROWS:
        first, last = np.maximum(np.arange(count) - half, 0), np.minimum(np.arange(count) + half + 1, count)
        n, t, d, tt, td = (one[last] - one[first] for one in sums)
        spread = np.maximum(tt - t**2 / n, 1e-12)
        away = own - t / n
        line = d / n + away * (td - t * d / n) / spread
        width = AGREE * noise * np.sqrt(1.0 / n + away**2 / spread)
        low, high = np.maximum(low, line - width), np.minimum(high, line + width)
        agrees &= low <= high
        found = np.where(agrees, line, found)
    return found


def _refined(time_s: FloatArray, depth_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Nodes of a path with steps of at most `STEP_MM` and `STEP_S` where the tip is in contact or near it."""
    near = np.maximum(depth_mm[1:], depth_mm[:-1]) > -MARGIN_MM
    steps = np.maximum(np.abs(np.diff(depth_mm)) / STEP_MM, np.diff(time_s) / STEP_S)
    parts = np.maximum(np.where(near, np.ceil(steps - 1e-6), 1.0), 1.0).astype(np.int64)
    ends = np.concatenate([[0], np.cumsum(parts)])
    place = np.arange(ends[-1] + 1)
    row = np.interp(place, ends, np.arange(len(time_s)))
    return np.interp(row, np.arange(len(time_s)), time_s), np.interp(row, np.arange(len(time_s)), depth_mm)


def force_at(window: PressWindow, unknowns: FloatArray, middle_s: float) -> FloatArray:
    """Force without tare at the samples of a window, by the module's model, (sample,) [N].

    Parameters
    ----------
    unknowns : (`UNKNOWNS`,) in the order of `LOG_MODULUS` to `BACKLASH_MM`
    middle_s : time of the log at which the clock offset holds, T_mid [s]
    """
    excess, tau = float(unknowns[EXCESS]), float(np.exp(unknowns[LOG_TIME]))
    depth = np.maximum(window.node_mm + unknowns[ZERO_MM] + unknowns[BACKLASH_MM] * window.way_back, 0.0)
    load = window.elastic_n(depth)
    if excess == 0.0:
        force = load
    else:
        ratio = (window.node_s - window.node_s[0]) / tau
        relaxing = relaxing_part(ratio, load)
        force = np.maximum(load + excess * relaxing, 0.0)
        if unknowns[TING] != 0.0:
            late = slice(window.turn + 1, None)
            shrunk = _shrinking(ratio, depth, load, relaxing, window.turn, excess)
            force[late] += unknowns[TING] * (shrunk - force[late])
    at = window.time_s + unknowns[CLOCK_S] + unknowns[RATE] * (window.time_s - middle_s)
    found: FloatArray = np.exp(unknowns[LOG_MODULUS]) * np.interp(
        at, window.node_s, force, left=0.0, right=0.0
    )
    return found


def relaxing_part(ratio: FloatArray, values: FloatArray) -> FloatArray:
    """q of values that are linear between nodes and 0 before: ∫ exp(-(t - t')/τ) dX, (node,).

    Parameters
    ----------
    ratio : (node,) increasing times over τ [-]
    """
    step = np.diff(ratio)
    gained = np.concatenate(
        [[0.0], np.diff(values) * np.where(step > 0.0, -np.expm1(-step) / np.maximum(step, 1e-300), 1.0)]
    )
    found, first, carried = np.empty_like(values), 0, 0.0
    while first < len(ratio):  # exp overflows over long spans, so they are cut
        last = int(np.searchsorted(ratio, ratio[first] + LARGEST_EXPONENT, side="right"))
        own = ratio[first:last] - ratio[first]
        found[first:last] = np.exp(-own) * (carried + np.cumsum(np.exp(own) * gained[first:last]))
        if last < len(ratio):
            carried = float(found[last - 1] * np.exp(ratio[last - 1] - ratio[last]))
        first = last
    return found


def _shrinking(
    ratio: FloatArray, depth: FloatArray, load: FloatArray, relaxing: FloatArray, turn: int, excess: float
) -> FloatArray:
    """Force after the turn over a, with the contact of Ting's solution, (node after the turn,)."""
    memory = relaxing_part(ratio, depth)
    first = max(int(np.argmax(depth > 0.0)) - 1, 0)
    late = np.arange(turn + 1, len(depth))

    def balance(then: IntArray) -> FloatArray:
        faded = np.exp(ratio[then] - ratio[late])
        found: FloatArray = depth[late] - depth[then] + excess * (memory[late] - faded * memory[then])
        return found

    low, high = np.full(len(late), first), np.full(len(late), turn)
    at_low, at_high = balance(low), balance(high)
    has_left = at_low <= 0.0
    for _ in range(int(np.ceil(np.log2(max(turn - first, 2))))):
        middle = (low + high) // 2
        value = balance(middle)
        grows = value > 0.0
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
        at_low, at_high = np.where(grows, value, at_low), np.where(grows, at_high, value)
    share = np.clip(at_low / np.maximum(at_low - at_high, 1e-12), 0.0, 1.0)
    faded = np.exp(ratio[low] + share * (ratio[high] - ratio[low]) - ratio[late])
    force = (
        load[low]
        + share * (load[high] - load[low])
        + excess * faded * (relaxing[low] + share * (relaxing[high] - relaxing[low]))
    )
    return np.where(has_left, 0.0, np.maximum(force, 0.0))
