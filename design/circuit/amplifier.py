r"""Choice of the receivers' amplifier from the catalogue, by the limits of the transimpedance circuit.

An amplifier with the open-loop gain w / s, where w = 2 pi GBW, gives with the feedback R, Cf and the capacitance C of
photodiode, input and wiring

    u / (i R) = 1 / (1 + s (R Cf + 1/w) + s^2 R (C + Cf) / w).

Its closed-loop bandwidth is about sqrt(GBW / (2 pi R C)), and Cf >= sqrt(C / (2 pi R GBW)) gives a phase margin of at
least 45 degrees (Graeme, "Photodiode Amplifiers", 1996, ch. 3; Texas Instruments, SBOA055). A step settles to half a
count of full scale when the error of this second-order response, or its envelope if it rings, is below
1 / 2^(bits + 1). If a step of full scale starts faster than the slew rate, the output first slews until the rest of the
step is within the linear range of R Cf times slew rate, and then settles.

An amplifier fits if

- the supply of the amplifiers is within its range,
- its output reaches `LEAST_SWING` of full scale,
- the high end of its input bias current is below the current of one count, full scale / 2^bits / R,
- the feedback capacitor keeps it at a phase margin of 45 degrees or more, and
- every receiver settles in time.

The slowest amplifier that fits is chosen: it draws the least current, and has the least noise bandwidth. If none fits,
it is the fastest one that suits supply and full scale. The design may name another in `board.amplifier`.

The model takes typical values of bandwidth and slew rate. It leaves out the amplifier's further poles, its noise, and
the few millivolts above ground at which the output ends, which are small without a load.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from optopad.design.circuit.circuit import Circuit
from optopad.design.parts.catalog import find_amplifier
from optopad.design.parts.circuits import Amplifier

LEAST_SWING = 0.95
"""Least share of full scale that an amplifier's output must reach [-].

The rule for the gain keeps judged pairs at three quarters of full scale; a twentieth is left for the rails.
"""
HZ_PER_MHZ = 1e6
F_PER_PF = 1e-12
US_PER_S = 1e6
PA_PER_A = 1e12
MV_PER_V = 1e3
ROUNDING = 1e-9
"""Relative tolerance within which a time counts as equal to its limit."""
BISECTIONS = 60


@dataclass(frozen=True, kw_only=True)
class Load:
    """Feedback and capacitance at the amplifier of one receiver.

    Attributes
    ----------
    ohm : feedback resistor
    feedback_pf : feedback capacitor
    input_pf : capacitance of photodiode, amplifier input and wiring
    """

    ohm: float
    feedback_pf: float
    input_pf: float


@dataclass(frozen=True, kw_only=True)
class Shortfall:
    """A limit of the circuit that a part does not keep: what it means, the value, and the limit, in words.

    `is_of_time` marks the limits that another feedback capacitor changes: ringing, and settling in time.
    """

    meaning: str
    value: str
    limit: str
    is_of_time: bool = False


@dataclass(frozen=True, kw_only=True)
class ChosenAmplifier:
    """The amplifier of all receivers of a design.

    Attributes
    ----------
    amplifier_id : identifier in the catalogue
    shortfalls : limits of the circuit that it does not keep; empty if it fits
    """

    amplifier_id: str
    entry: Amplifier
    shortfalls: tuple[Shortfall, ...]

    @property
    def is_in_time(self) -> bool:
        """Whether it neither rings nor settles too late."""
        return not any(one.is_of_time for one in self.shortfalls)


def least_feedback_pf(amplifier: Amplifier, ohm: float, input_pf: float) -> float:
    """Smallest feedback capacitance with a phase margin of 45 degrees [pF]."""
    bandwidth_hz = amplifier.bandwidth_mhz.value * HZ_PER_MHZ
    return math.sqrt(input_pf * F_PER_PF / (2 * math.pi * ohm * bandwidth_hz)) / F_PER_PF


def settles_us(amplifier: Amplifier, load: Load, bits: int, full_scale_v: float) -> float:
    """Time in which a step of full scale settles to half a count [us]."""
    return _settles_us(amplifier.bandwidth_mhz.value, amplifier.slew_v_per_us.value, load, bits, full_scale_v)


@cache
def _settles_us(
    bandwidth_mhz: float, slew_v_per_us: float, load: Load, bits: int, full_scale_v: float
) -> float:
    share = 1.0 / 2 ** (bits + 1)
    feedback_us = load.ohm * load.feedback_pf * F_PER_PF * US_PER_S
    linear_v = slew_v_per_us * feedback_us
    slewing_us = max(full_scale_v / slew_v_per_us - feedback_us, 0.0)
    return slewing_us + _linear_us(bandwidth_mhz, load, share * max(full_scale_v / linear_v, 1.0))


def _linear_us(bandwidth_mhz: float, load: Load, share: float) -> float:
    """Time after which the error of the linear step response stays below a share of the step [us]."""
    per_us = 2 * math.pi * bandwidth_mhz
    first = load.ohm * load.feedback_pf * F_PER_PF * US_PER_S + 1 / per_us
    second = load.ohm * (load.input_pf + load.feedback_pf) * F_PER_PF * US_PER_S / per_us
    end = first
    while _error(first, second, end) > share:
        end *= 2
    start = 0.0
    for _ in range(BISECTIONS):
        middle = (start + end) / 2
        start, end = (middle, end) if _error(first, second, middle) > share else (start, middle)
    return end


def _error(first: float, second: float, time: float) -> float:
    """Largest error from a time on, of the step response of 1 / (1 + first s + second s^2)."""
    squared = first**2 - 4 * second
    if squared > 0:
        slow = (first + math.sqrt(squared)) / 2
        fast = second / slow
        if slow > fast:
            return (slow * math.exp(-time / slow) - fast * math.exp(-time / fast)) / (slow - fast)
    decay = first / (2 * second)
    damping = first / (2 * math.sqrt(second))
    ringing = 1 / math.sqrt(1 - damping**2) if damping < 1 else math.inf
    return math.exp(-decay * time) * min(ringing, 1 + decay * time)


def shortfalls(
    circuit: Circuit, amplifier: Amplifier, loads: tuple[Load, ...] | None, settle_us: float
) -> Iterator[Shortfall]:
    """Limits of a circuit that an amplifier does not keep.

    Parameters
    ----------
    loads : feedback of each receiver; None if it is not known yet, and its limits are not checked
    settle_us : time within which the amplifiers must settle
    """
    supply_v, full_v = circuit.adc.supply_v, circuit.adc.full_scale_v
    if not amplifier.supply_low_v <= supply_v <= amplifier.supply_high_v:
        yield Shortfall(
            meaning="does not work at the supply of the amplifiers",
            value=f"{supply_v:g} V",
            limit=f"{amplifier.supply_low_v:g} to {amplifier.supply_high_v:g} V",
        )
    highest_v = supply_v - amplifier.output_margin_mv.value / MV_PER_V
    if highest_v < LEAST_SWING * full_v:
        yield Shortfall(
            meaning="does not reach full scale",
            value=f"{highest_v:.3g} V at most",
            limit=f"at least {LEAST_SWING:.0%} of {full_v:g} V",
        )
    if loads:
        yield from _load_shortfalls(circuit, amplifier, loads, settle_us)


def one_count_pa(circuit: Circuit, ohm: float) -> float:
    """Photocurrent that changes a reading by one count [pA]."""
    return circuit.adc.full_scale_v / 2.0**circuit.adc.bits / ohm * PA_PER_A


def _load_shortfalls(
    circuit: Circuit, amplifier: Amplifier, loads: tuple[Load, ...], settle_us: float
) -> Iterator[Shortfall]:
    count_pa = one_count_pa(circuit, max(load.ohm for load in loads))
    if amplifier.most_bias_pa > count_pa:
        yield Shortfall(
            meaning="takes more bias current than one count is",
            value=f"{amplifier.most_bias_pa:.3g} pA",
            limit=f"at most {count_pa:.3g} pA",
        )
    for load in loads:
        least_pf = least_feedback_pf(amplifier, load.ohm, load.input_pf)
        if load.feedback_pf < least_pf * (1 - ROUNDING):
            yield Shortfall(
                meaning="rings",
                value=f"{load.feedback_pf:g} pF",
                limit=f"at least {least_pf:.2g} pF at {load.ohm:.3g} ohm for a phase margin of 45 degrees",
                is_of_time=True,
            )
            break
    adc = circuit.adc
    slowest_us = max(settles_us(amplifier, load, adc.bits, adc.full_scale_v) for load in loads)
    if slowest_us > settle_us * (1 + ROUNDING):
        yield Shortfall(
            meaning="does not settle in time",
            value=f"{slowest_us:.1f} us",
            limit=f"at most {settle_us:.4g} us",
            is_of_time=True,
        )


def chosen_amplifier(circuit: Circuit, loads: tuple[Load, ...] | None, settle_us: float) -> ChosenAmplifier:
    """The amplifier that the design names, or else the slowest of the catalogue that fits, or the best there is.

    Raises
    ------
    DesignError : the design names an amplifier that is not in the catalogue.
    """
    entries, named = circuit.entries, circuit.use.amplifier
    distinct = None if loads is None else tuple(dict.fromkeys(loads))
    if named is not None:
        return _judged(circuit, named, find_amplifier(entries, named), distinct, settle_us)
    by_speed = sorted(entries.amplifiers.items(), key=lambda item: item[1].bandwidth_mhz.value)
    judged = [_judged(circuit, name, entry, distinct, settle_us) for name, entry in by_speed]
    fitting = next((one for one in judged if not one.shortfalls), None)
    if fitting is not None:
        return fitting
    suited = [one for one in judged if not any(shortfalls(circuit, one.entry, None, settle_us))]
    return (suited or judged)[-1]


def _judged(
    circuit: Circuit, name: str, entry: Amplifier, loads: tuple[Load, ...] | None, settle_us: float
) -> ChosenAmplifier:
    found = tuple(shortfalls(circuit, entry, loads, settle_us))
    return ChosenAmplifier(amplifier_id=name, entry=entry, shortfalls=found)
