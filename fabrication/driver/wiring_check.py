"""Compares measured and simulated readings of the untouched pad, and detects exchanged wires: finds the order of
emitters and receivers for which readings fit the expected pattern.

A reading is modelled as the expected reading times four factors: a common factor, and one factor each for the emitter,
the receiver and the pair. Their logarithms are fitted by ridge regression, with no penalty on the common factor. The
factors of parts have a spread of `PART_SPREAD`; those of pairs have `PAIR_SPREAD`, or more if the best fit requires it.
The misfit is the sum of squares of the logarithms divided by these spreads. Readings below a floor are set to the
floor. Exchanged wires are thus detected by the contrast between pairs, not by brightness.

The search starts from the correct wiring. In each step it applies the exchange of two emitters or of two receivers that
reduces the misfit most. A cyclic permutation of three parts becomes two exchanges. A pair whose measured and expected
readings are both dark has no weight. If only one of these two readings is at full scale, the pair's misfit is the
distance of the other reading below full scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.recordings import signals_of
from optopad.fabrication.driver.descriptor import Descriptor, PartArray

FLOOR_COUNTS = 8.0
"""Readings below this value are not compared, because ambient light, noise and light outside the model dominate them
[counts]."""

SEEN_COUNTS = 24.0
"""Expected reading below which a pair is too dark to be used in judging its parts [counts]."""

CLIP_SHARE = 0.95
"""A measured or expected reading counts as clipped if it is at least this fraction of full scale [-]."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A fault of the unit, with the parts and pins to inspect.

    Attributes
    ----------
    kind : type of fault: dead, swapped, saturated, dim, ambient, noisy, supply or program
    parts : names of the affected parts
    message : the observation, and what to do
    is_error : True for an error, False for a warning
    """

    kind: str
    parts: tuple[str, ...]
    message: str
    is_error: bool = True


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Measured and expected mean readings of all pairs, as arrays of shape (emitters, receivers) [counts]."""

    measured: FloatArray
    expected: FloatArray
    is_clipped: BoolArray
    is_meant_to_clip: BoolArray
    full_scale: int
    emitters: PartArray
    receivers: PartArray


def pattern_of(counts: NDArray[np.uint16], found: Descriptor) -> Pattern:
    """Means of readings of shape (n, states, receivers), and the descriptor's expected readings, which must exist."""
    assert found.expected_counts is not None, "requested by the caller"
    mean: FloatArray = counts.mean(axis=0)
    lit = mean[:-1]
    return Pattern(
        measured=signals_of(mean),
        expected=found.expected_counts,
        is_clipped=lit >= CLIP_SHARE * found.full_scale,
        is_meant_to_clip=found.expected_counts >= CLIP_SHARE * found.full_scale,
        full_scale=found.full_scale,
        emitters=found.emitters,
        receivers=found.receivers,
    )


def emitter_text(parts: PartArray, i: int) -> str:
    """Name and pin of emitter i (from 0), for messages."""
    return f"{parts.names[i]} (pin {parts.pins[i]})"


def receiver_text(parts: PartArray, j: int) -> str:
    """Name and input of receiver j (from 0), for messages."""
    return f"{parts.names[j]} (input {parts.pins[j]})"


Order = tuple[int, ...]

PART_SPREAD = 0.3
"""Standard deviation of the logarithm of a part's actual over expected brightness or sensitivity [-].

Causes are resistors (5 %), brightness classes of LEDs (factor 1.5), and seating.
"""

PAIR_SPREAD = 0.12
"""Standard deviation of the logarithm of a pair's actual over expected reading, without the factors of parts [-].

Causes are positions and heights of parts, and errors of the model.
"""

LARGEST_MISS = 5.0
"""Limit of one pair's deviation in the misfit, so that an outlier does not dominate [spreads]."""

EVIDENCE = 20.0
"""Smallest reduction of the misfit for which an exchange of wires is reported [-]; it means odds of e^10 to one."""

EQUAL = 8.0
"""Exchanges whose misfit exceeds that of the best exchange by no more than this are reported as well [-]."""

NORMAL_MEDIAN_SQUARE = 0.455
"""Median of the square of a standard normal variable [-]."""


@dataclass(frozen=True, kw_only=True)
class _Fit:
    """Misfit of the readings for an assumed wiring, and the pairs' spread over `PAIR_SPREAD`, at least 1 [-]."""

    misfit: float
    spread: float


@dataclass(frozen=True, kw_only=True)
class _Exchange:
    """Exchange of the wires of two emitters (axis 0) or two receivers (axis 1), whose indices are in `pair`."""

    axis: int
    pair: tuple[int, int]

    def applied(self, rows: Order, columns: Order) -> tuple[Order, Order]:
        """The orders of emitters (rows) and receivers (columns) after this exchange."""
        orders = [list(rows), list(columns)]
        a, b = self.pair
        order = orders[self.axis]
        order[a], order[b] = order[b], order[a]
        return tuple(orders[0]), tuple(orders[1])


def exchanged_wires(pattern: Pattern, usable: BoolArray) -> tuple[list[int], list[int], list[Problem]]:
    """Find the exchanges of wires that explain the readings.

    Parameters
    ----------
    pattern : measured and expected readings
    usable : whether both parts of each pair work, shape (emitters, receivers)

    Returns
    -------
    indices of the emitters in the order in which they are wired, the same for the receivers, and one problem for each
    exchange
    """
    rows: Order = tuple(range(usable.shape[0]))
    columns: Order = tuple(range(usable.shape[1]))
    exchanges = _exchanges(usable)
    problems: list[Problem] = []
    now = _fitted(pattern, usable, rows, columns)
    while exchanges and len(problems) < len(rows) + len(columns):
        fits = [_fitted(pattern, usable, *one.applied(rows, columns)) for one in exchanges]
        best = min(range(len(fits)), key=lambda k: fits[k].misfit)
        scale = fits[best].spread ** 2
        if now.misfit - fits[best].misfit < EVIDENCE * scale:
            break
        limit = fits[best].misfit + EQUAL * scale
        equal = [one for one, fit in zip(exchanges, fits, strict=True) if fit.misfit <= limit]
        problems.append(_problem(pattern, exchanges[best], equal))
        rows, columns = exchanges[best].applied(rows, columns)
        now = fits[best]
    return list(rows), list(columns), problems


def _exchanges(usable: BoolArray) -> list[_Exchange]:
    living = [map(int, np.flatnonzero(usable.any(axis=1 - axis))) for axis in (0, 1)]
    return [_Exchange(axis=axis, pair=pair) for axis in (0, 1) for pair in combinations(living[axis], 2)]


def _fitted(pattern: Pattern, usable: BoolArray, rows: Order, columns: Order) -> _Fit:
    """Misfit of the readings, assuming that emitters and receivers are wired in the orders `rows` and `columns`."""
    expected = pattern.expected[list(rows)][:, list(columns)]
    meant = pattern.is_meant_to_clip[list(rows)][:, list(columns)]
    difference = _scaled(pattern.measured) - _scaled(expected)
    told = usable & ~meant & ~pattern.is_clipped
    told &= (expected >= SEEN_COUNTS) | (pattern.measured >= SEEN_COUNTS)
    if not told.any():
        return _Fit(misfit=0.0, spread=1.0)
    by_emitter, by_receiver, common = _part_factors(difference, told)
    left = difference - common - by_emitter[:, None] - by_receiver
    one_sided = usable & (meant != pattern.is_clipped)
    below = np.where(meant, np.maximum(-left, 0.0), np.maximum(left, 0.0))
    miss = np.where(told, np.abs(left), np.where(one_sided, below, 0.0)) / PAIR_SPREAD
    parts = ((by_emitter**2).sum() + (by_receiver**2).sum()) / PART_SPREAD**2
    spread = np.sqrt(np.median(miss[told] ** 2) / NORMAL_MEDIAN_SQUARE)
    capped = np.minimum(miss, LARGEST_MISS * max(1.0, float(spread)))
    return _Fit(misfit=float((capped**2).sum() + parts), spread=max(1.0, float(spread)))


def _part_factors(difference: FloatArray, told: BoolArray) -> tuple[FloatArray, FloatArray, float]:
    """Fit differences of shape (emitters, receivers) by a term per emitter, a term per receiver and a common term.

    The method is ridge regression over the pairs for which `told` is True. The terms are returned in this order.
    """
    emitters, receivers = difference.shape
    weight = told.astype(np.float64)
    target = np.where(told, difference, 0.0)
    ridge = (PAIR_SPREAD / PART_SPREAD) ** 2
    normal = np.zeros((emitters + receivers + 1,) * 2)
    normal[:emitters, :emitters] = np.diag(weight.sum(axis=1) + ridge)
    normal[emitters:-1, emitters:-1] = np.diag(weight.sum(axis=0) + ridge)
    normal[:emitters, emitters:-1] = weight
    normal[emitters:-1, :emitters] = weight.T
    normal[-1, :-1] = normal[:-1, -1] = np.concatenate([weight.sum(axis=1), weight.sum(axis=0)])
    normal[-1, -1] = weight.sum()
    right = np.concatenate([target.sum(axis=1), target.sum(axis=0), [target.sum()]])
    found = np.linalg.solve(normal, right)
    return found[:emitters], found[emitters:-1], float(found[-1])


def _scaled(values: FloatArray) -> FloatArray:
    scaled: FloatArray = np.log(np.maximum(values, FLOOR_COUNTS))
    return scaled


def _problem(pattern: Pattern, best: _Exchange, equal: list[_Exchange]) -> Problem:
    ways = [best, *(one for one in equal if one != best)]
    names = [_named(pattern, one) for one in ways]
    parts = tuple(dict.fromkeys(part for one in ways for part in _parts(pattern, one)))
    if len(names) == 1:
        message = f"{names[0]}: the readings fit if these two wires are exchanged; exchange them"
    else:
        message = (
            f"{' or '.join(names)}: the readings fit if two wires are exchanged; it is not resolved which"
        )
    return Problem(kind="swapped", parts=parts, message=message)


def _parts(pattern: Pattern, one: _Exchange) -> tuple[str, str]:
    names = (pattern.emitters, pattern.receivers)[one.axis].names
    return names[one.pair[0]], names[one.pair[1]]


def _named(pattern: Pattern, one: _Exchange) -> str:
    parts = (pattern.emitters, pattern.receivers)[one.axis]
    text = (emitter_text, receiver_text)[one.axis]
    return f"{text(parts, one.pair[0])} and {text(parts, one.pair[1])}"
