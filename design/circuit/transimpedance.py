r"""The receivers' transimpedance amplifiers: gain from light to counts, feedback resistor and capacitor.

            +--[ RF ]--+        current  i = flux x power x responsivity
            +--| CF |--+        voltage  u = i x RF
    diode --+--|-\     |        counts   n = u / full scale x 2^bits
      |        |  >----+-- A0
    ground  ---|+/

The flux is the share of an emitter's power that reaches the receiver. The power is proportional to the emitter's
current, which follows from its typical forward voltage and its series resistor. The responsivity is the data sheet's
value if it is given near the emitter's wavelength. Otherwise silicon's quantum efficiency is assumed constant, which is
too high by `silicon_blue_loss` at worst. For several types of emitter, the mean product of power and responsivity is
used.

The capacitor CF is the largest standard value with RF CF ln 2^(bits + 1) <= settle time with which an amplifier of the
catalogue settles in time, so that the noise is least; the amplifier is the slowest one that does
(`optopad.design.circuit.amplifier`). If none does, the fastest one, or the one that the design names, has the CF with
which it does not ring and settles soonest.
The model does not include the dark current (2 nA, millivolts), the LED's fall time, or the stray capacitance of the
resistor (about 0.2 pF in addition to CF).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.circuit.amplifier import (
    ChosenAmplifier,
    Load,
    chosen_amplifier,
    least_feedback_pf,
    one_count_pa,
    settles_us,
)
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import CurrentSink, current_sink, emitter_switch
from optopad.design.errors import DesignError
from optopad.design.fields.finding import FAILS, Finding, error, warning
from optopad.design.fields.quantity import Quantity, weakest
from optopad.design.parts.assumptions import (
    E12,
    assumption,
    ohm_text,
    standard_at_least,
    standard_at_most,
    standard_nearest,
)
from optopad.design.parts.catalog import Board, Part, find_amplifier
from optopad.design.parts.circuits import Amplifier

NEAR_NM = 25.0
"""Largest distance from a responsivity's stated wavelength at which the value is used unchanged.

It is half the spectral width of a usual LED.
"""
W_PER_MW = 1e-3
F_PER_PF = 1e-12
S_PER_US = 1e-6
MOST_STEPS_DOWN = 12
"""Number of standard capacitors that are tried, from the largest on; they span a decade."""
LEAST_SETTLE_US = 1e-3
"""Shortest time for which a capacitor is computed; no amplifier settles within it [us]."""


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """Feedback resistor and capacitor of one receiver's amplifier.

    Attributes
    ----------
    exact_ohm : resistance that gives the required gain, or the one given in the design
    low_ohm, high_ohm : range of this resistance from the bands of power and responsivity
    standard_ohm : nearest standard value, or the resistance given in the design
    counts_per_flux : required gain: counts if all emitted power reached the receiver
    capacitor_pf : standard value of the feedback capacitor
    amplifier_id : amplifier that all receivers share, in the catalogue
    settles_us : time until the reading of a step of full scale is within half a count of its final value
    is_in_time : whether `settles_us` is at most the design's settling time
    """

    exact_ohm: float
    low_ohm: float
    high_ohm: float
    standard_ohm: float
    counts_per_flux: float
    capacitor_pf: float
    amplifier_id: str
    settles_us: float
    is_in_time: bool

    @property
    def gain_factor(self) -> float:
        """Gain with the standard resistor divided by the required gain [-]."""
        return self.standard_ohm / self.exact_ohm


def emitted_mw(part: Part, board: Board, sink: CurrentSink | None = None) -> Quantity | None:
    """Light power of an emitter with its series resistor, or at the constant current of an LED driver [mW].

    None if the emitter's power is unknown, or if the supply cannot light it.
    """
    full, switch, forward = part.radiant_power_mw, emitter_switch(part, board), part.forward_voltage_v
    current_ma = switch.usual_current_ma if sink is None else sink.current_ma
    if full is None or switch.series_ohm is None or forward is None:
        return None
    if sink is not None and forward.value + sink.dropout_v > board.emitter_v:
        return None
    assert part.max_current_ma is not None
    return _scaled(full, current_ma / part.max_current_ma.value, "mW", "in proportion to current")


def responsivity_at(part: Part, wavelength_nm: float) -> Quantity:
    """Responsivity of a receiver at a wavelength: photocurrent per light power [A/W]."""
    stated, at = part.responsivity_a_per_w, part.responsivity_wavelength_nm
    assert stated is not None
    assert at is not None
    if abs(wavelength_nm - at.value) <= NEAR_NM:
        return stated
    ratio = wavelength_nm / at.value
    loss = assumption("silicon_blue_loss").value if ratio < 1 else 0.0
    scaled = _scaled(stated, ratio, "A/W", f"taken to {wavelength_nm:g} nm at equal quantum efficiency")
    assert scaled.low is not None
    return scaled.model_copy(
        update={"low": scaled.low * (1 - loss), "confidence": weakest(stated.confidence, "inferred")}
    )


def counts_per_flux_per_ohm(circuit: Circuit) -> tuple[Quantity, ...] | None:
    """Counts of each receiver per ohm of feedback resistance if all emitted power reached it [counts/ohm].

    None if the power or the wavelength of an emitter is unknown.
    """
    cavity, board, sink = circuit.cavity, circuit.board, current_sink(circuit)
    powers = [(emitted_mw(one.part, board, sink), one.part.wavelength_nm) for one in cavity.emitters]
    lit = [(power, at.value) for power, at in powers if power is not None and at is not None]
    if not lit or len(lit) < len(powers):
        return None
    scale = W_PER_MW * 2**circuit.adc.bits / circuit.adc.full_scale_v
    found: dict[str, Quantity] = {}
    for one in cavity.receivers:
        if one.part_id not in found:
            found[one.part_id] = _mean_product(lit, one.part, scale)
    return tuple(found[one.part_id] for one in cavity.receivers)


def fitted_counts_per_flux(circuit: Circuit) -> tuple[float, ...]:
    """Gain of each receiver with the resistances in `gain.feedback_ohm`: its counts if all emitted power reached it.

    Raises
    ------
    DesignError : the design has a rule instead of resistances, a wrong number of resistances, or an emitter of unknown
        power.
    """
    findings = list(gain_findings(circuit))
    per_ohm, ohms = counts_per_flux_per_ohm(circuit), given_ohms(circuit)
    if findings or per_ohm is None or ohms is None:
        raise DesignError("\n".join(map(str, findings)) or "gain.feedback_ohm: a rule gives no ohms")
    return tuple(each.value * ohm for each, ohm in zip(per_ohm, ohms, strict=True))


def given_ohms(circuit: Circuit) -> tuple[float, ...] | None:
    """Feedback resistances given in a design, one per receiver; None if it has a rule instead."""
    given = circuit.design.gain.feedback_ohm
    if isinstance(given, str):
        return None
    return given if isinstance(given, tuple) else (given,) * len(circuit.cavity.receivers)


def feedbacks_of(circuit: Circuit, counts_per_flux: Sequence[float] | None) -> tuple[Feedback, ...] | None:
    """Compute the feedback resistor and capacitor of each receiver's amplifier.

    Parameters
    ----------
    counts_per_flux : required gain of each receiver, computed by a simulation: its counts if all emitted power reached
        it. None if there was no simulation. Ignored if the design gives resistances.

    Returns
    -------
    One result per receiver; or None if an emitter's power is unknown, or if neither gains nor resistances are known.
    """
    per_ohm, ohms = counts_per_flux_per_ohm(circuit), given_ohms(circuit)
    if per_ohm is None:
        return None
    if ohms is None:
        if counts_per_flux is None:
            return None
        ohms = tuple(gain / each.value for gain, each in zip(counts_per_flux, per_ohm, strict=True))
    amplifier, loads = fitted_amplifier(circuit, ohms)
    return tuple(
        _feedback(circuit, amplifier, load, each, ohm)
        for load, each, ohm in zip(loads, per_ohm, ohms, strict=True)
    )


def fitted_amplifier(
    circuit: Circuit, exact_ohms: Sequence[float]
) -> tuple[ChosenAmplifier, tuple[Load, ...]]:
    """The amplifier of a design, and the feedback of each receiver with standard resistors and capacitors.

    Parameters
    ----------
    exact_ohms : required feedback resistance of each receiver
    """
    settle_us, is_given = amplifier_settle_us(circuit), not isinstance(circuit.design.gain.feedback_ohm, str)
    ohms = [ohm if is_given else standard_nearest(ohm) for ohm in exact_ohms]
    tried = [_loads(circuit, ohms, step) for step in range(MOST_STEPS_DOWN)]
    found = [(chosen_amplifier(circuit, wanted, settle_us), wanted) for wanted in tried]
    best = next((one for one in found if not one[0].shortfalls), None)
    best = best or next((one for one in found if one[0].is_in_time), None)
    if best is not None:
        return best
    amplifier = found[0][0]
    return amplifier, tuple(_soonest(circuit, load, amplifier.entry) for load in tried[0])


def _loads(circuit: Circuit, ohms: Sequence[float], step: int) -> tuple[Load, ...]:
    """Feedback of each receiver, with a capacitor of `step` standard steps below the largest that settles in time."""
    constants, settle_us = math.log(2 ** (circuit.adc.bits + 1)), amplifier_settle_us(circuit)
    found = []
    for receiver, ohm in zip(circuit.cavity.receivers, ohms, strict=True):
        assert receiver.part.capacitance_pf is not None
        most_pf = settle_us * S_PER_US / (ohm * constants) / F_PER_PF
        feedback_pf = standard_at_most(most_pf * 10 ** (-step / len(E12)), E12)
        input_pf = receiver.part.capacitance_pf.value + assumption("amplifier_input_pf").value
        found.append(Load(ohm=ohm, feedback_pf=feedback_pf, input_pf=input_pf))
    return tuple(found)


def _soonest(circuit: Circuit, load: Load, amplifier: Amplifier) -> Load:
    """The feedback with the standard capacitor with which the amplifier does not ring and settles soonest."""
    least_pf = least_feedback_pf(amplifier, load.ohm, load.input_pf)
    tried = [
        replace(load, feedback_pf=standard_at_least(least_pf * 10 ** (step / len(E12)), E12))
        for step in range(MOST_STEPS_DOWN)
    ]
    return min(tried, key=lambda one: settles_us(amplifier, one, circuit.adc.bits, circuit.adc.full_scale_v))


def amplifier_settle_us(circuit: Circuit) -> float:
    """Time within which the amplifiers must settle [us]: `board.settle_us` less that of a converter's input filter."""
    return max(circuit.use.settle_us - circuit.adc.filter_settles_us, LEAST_SETTLE_US)


def gain_findings(circuit: Circuit) -> Iterator[Finding]:
    """Errors about given resistances that define no gain: a wrong number of them, or an emitter of unknown power."""
    given = circuit.design.gain.feedback_ohm
    if isinstance(given, str):
        return
    receivers = len(circuit.cavity.receivers)
    if isinstance(given, tuple) and len(given) != receivers:
        yield error(
            "gain.feedback_ohm",
            f"the layout has {receivers} receivers, the list is for {len(given)}",
            value=f"{len(given)} entries",
            limit=f"exactly {receivers}",
            way_out="give one resistance for each receiver, or one number for all",
        )
    for one in {one.part_id: one for one in circuit.cavity.emitters}.values():
        if emitted_mw(one.part, circuit.board, current_sink(circuit)) is None:
            yield error(
                "gain.feedback_ohm",
                f"ohms make a gain only with the emitters' power, which {one.part_id} does not have",
                value=str(given),
                limit="a rule, or emitters with radiant_power_mw",
                way_out=f"give part_measurements.{one.part_id}.radiant_power_mw, or set gain.feedback_ohm = 'each'",
            )


def settling_findings(circuit: Circuit, counts_per_flux: Sequence[float] | None = None) -> Iterator[Finding]:
    """Warning about amplifiers that do not settle within `board.settle_us`; none if the resistors are unknown.

    Parameters
    ----------
    counts_per_flux : required gain of each receiver, as in `feedbacks_of`
    """
    feedbacks, settle_us = feedbacks_of(circuit, counts_per_flux) or (), circuit.use.settle_us
    converter, filter_us = circuit.adc.separate, circuit.adc.filter_settles_us
    if converter is not None and settle_us <= filter_us:
        yield warning(
            "board.settle_us",
            f"the input filter of {converter.name} does not settle, so readings lag behind the light",
            value=f"{settle_us:g} us",
            limit=f"more than {math.ceil(filter_us)} us, and the amplifiers' settling in addition",
            weight=FAILS,
            way_out="raise it, or name a converter without an input filter, as mcp3208",
        )
        return
    late = [
        (one.settles_us, part.name)
        for one, part in zip(feedbacks, circuit.cavity.receivers, strict=False)
        if not one.is_in_time
    ]
    named = circuit.use.amplifier
    if late:
        lower = "gain.target_counts" if given_ohms(circuit) is None else "gain.feedback_ohm"
        faster = "" if named is None else "remove board.amplifier, so that a faster one is chosen, "
        yield warning(
            "board.settle_us",
            f"the amplifiers of {' '.join(name for _, name in late)} do not settle, so readings lag behind the light",
            value=f"{settle_us:g} us",
            limit=f"at least {math.ceil(max(late)[0] + filter_us)} us",
            weight=FAILS,
            way_out=f"raise it, {faster}or lower {lower}",
        )
    if feedbacks:
        yield from _bias_findings(circuit, feedbacks)


def _bias_findings(circuit: Circuit, feedbacks: Sequence[Feedback]) -> Iterator[Finding]:
    ohms = [one.standard_ohm for one in feedbacks]
    entry = find_amplifier(circuit.entries, feedbacks[0].amplifier_id)
    count_pa = one_count_pa(circuit, max(ohms))
    if entry.most_bias_pa > count_pa:
        yield warning(
            "board.amplifier",
            f"{entry.name} takes more bias current than one count is, which shifts every reading with temperature",
            value=f"{entry.most_bias_pa:.3g} pA",
            limit=f"at most {count_pa:.3g} pA, one count at {ohm_text(max(ohms))}",
            way_out="lower the resistor, as by more light"
            if circuit.use.amplifier is None
            else "remove board.amplifier, so that one with a CMOS or JFET input is chosen",
        )


def _mean_product(lit: list[tuple[Quantity, float]], receiver: Part, scale: float) -> Quantity:
    pairs = [(power, responsivity_at(receiver, at_nm)) for power, at_nm in lit]
    value, low, high = (
        scale * float(np.mean([end(power) * end(answer) for power, answer in pairs]))
        for end in (lambda q: q.value, _low, _high)
    )
    first_power, first_answer = pairs[0]
    return Quantity(
        value=value,
        unit="counts/ohm",
        source=f"power: {first_power.source}; responsivity: {first_answer.source}",
        confidence=weakest(*(one.confidence for pair in pairs for one in pair)),
        low=low,
        high=high,
    )


def settle_words(circuit: Circuit) -> str:
    """Text for messages: the time within which an amplifier has to settle, with the field that sets it."""
    words, filter_us = f"board.settle_us = {circuit.use.settle_us:g} us", circuit.adc.filter_settles_us
    return f"{words} less {filter_us:.0f} us of the converter's input filter" if filter_us else words


def _feedback(
    circuit: Circuit, amplifier: ChosenAmplifier, load: Load, per_ohm: Quantity, exact_ohm: float
) -> Feedback:
    gain, is_given = per_ohm.value * exact_ohm, not isinstance(circuit.design.gain.feedback_ohm, str)
    settles = settles_us(amplifier.entry, load, circuit.adc.bits, circuit.adc.full_scale_v)
    return Feedback(
        exact_ohm=exact_ohm,
        low_ohm=exact_ohm if is_given else gain / _high(per_ohm),
        high_ohm=exact_ohm if is_given else gain / _low(per_ohm),
        standard_ohm=load.ohm,
        counts_per_flux=gain,
        capacitor_pf=load.feedback_pf,
        amplifier_id=amplifier.amplifier_id,
        settles_us=settles,
        is_in_time=settles <= amplifier_settle_us(circuit) * (1 + 1e-9),
    )


def _scaled(quantity: Quantity, factor: float, unit: str, how: str) -> Quantity:
    return Quantity(
        value=quantity.value * factor,
        unit=unit,
        source=f"{quantity.source}, {how}",
        confidence=quantity.confidence,
        low=_low(quantity) * factor,
        high=_high(quantity) * factor,
    )


def _low(quantity: Quantity) -> float:
    return quantity.value if quantity.low is None else quantity.low


def _high(quantity: Quantity) -> float:
    return quantity.value if quantity.high is None else quantity.high
