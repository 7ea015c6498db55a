"""Section of the casting instructions on the amplifiers: resistors, capacitors, pairs above full scale, trimming."""

from __future__ import annotations

from collections.abc import Iterator

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import Feedback, counts_per_flux_per_ohm, settling_findings
from optopad.design.parts.assumptions import ohm_text
from optopad.design.shape.cavity import cavity_of, facing_pairs
from optopad.design.spec import SensorDesign
from optopad.fabrication.gain import SimulatedGain, clipped_pairs, feedbacks_for
from optopad.fabrication.sheets.table import number, plain
from optopad.sims.readings.readout import full_scale_counts

SHOWN_CLIPPED = 24
"""Largest number of pairs above full scale that are listed by name; any others are only counted."""


def gain_lines(design: SensorDesign, gain: SimulatedGain | None) -> Iterator[str]:
    """Lines of the section on amplifiers in the casting instructions, as Markdown."""
    yield "## Set the gain"
    yield ""
    circuit = Circuit.of(design)
    feedbacks = feedbacks_for(circuit, gain)
    if feedbacks is None:
        yield from _unknown(circuit)
    else:
        yield from _values(circuit, feedbacks, None if gain is None else gain.counts_per_flux)
    yield from _trimming(design)
    if gain is not None:
        yield from _clipped(design, gain)


def _unknown(circuit: Circuit) -> Iterator[str]:
    if counts_per_flux_per_ohm(circuit) is None:
        yield "No feedback resistor is computed: that needs the emitters' power, which the catalogue does not have for"
        yield "all of them (give `part_measurements.<part>.radiant_power_mw`)."
    else:
        yield "No feedback resistor is computed: `gain.feedback_ohm` is a rule, and nothing has been simulated yet"
        yield "(`optopad run` does)."
    yield ""


def _values(
    circuit: Circuit, feedbacks: tuple[Feedback, ...], gain: tuple[float, ...] | None
) -> Iterator[str]:
    names = [one.name for one in circuit.cavity.receivers]
    per_ohm = counts_per_flux_per_ohm(circuit)
    assert per_ohm is not None
    yield f"By `gain.feedback_ohm` = {_rule(circuit.design)}:"
    yield ""
    yield (
        "| receivers | required | for the bands of power and responsivity | fit RF | gain error | CF | "
        "settles in us |"
    )
    yield "|---|---|---|---|---|---|---|"
    for row in dict.fromkeys(_row(one) for one in feedbacks):
        same = " ".join(name for name, one in zip(names, feedbacks, strict=True) if _row(one) == row)
        yield f"| {same} | {row}"
    yield ""
    star = "*" if per_ohm[0].confidence in ("inferred", "unverified") else ""
    yield f"One ohm gives {per_ohm[0].value:.3g}{star} counts if a receiver receives an emitter's total power"
    yield f"({plain(per_ohm[0].source)})."
    yield from (f"Warning: {plain(str(one))}." for one in settling_findings(circuit, gain))
    yield ""


def _row(one: Feedback) -> str:
    late = "" if one.is_in_time else " (too slow)"
    return (
        f"{_ohm(one.exact_ohm)} | {_ohm(one.low_ohm)} to {_ohm(one.high_ohm)} | {ohm_text(one.standard_ohm)} | "
        f"{one.gain_factor - 1:+.1%} | {one.capacitor_pf:g} pF | {one.settles_us:.1f}{late} |"
    )


def _ohm(value: float) -> str:
    return ohm_text(float(f"{value:.3g}"))


def _rule(design: SensorDesign) -> str:
    given, target = design.gain.feedback_ohm, number(design.gain.target_counts)
    if given == "common":
        return f'"common": the median of all judged pairs, untouched, reads {target} counts'
    if given == "each":
        return (
            f'"each": the median of each receiver\'s judged pairs, untouched, reads {target} counts, or less, so that '
            "none reads above three quarters of full scale"
        )
    return "ohms"


def _trimming(design: SensorDesign) -> Iterator[str]:
    pairs = "facing pairs" if facing_pairs(cavity_of(design)) else "judged pairs (score.json lists them)"
    if isinstance(design.gain.feedback_ohm, str):
        yield "Light and responsivity of real parts scatter: start with a trimmer on one amplifier. With the pad"
        yield f"untouched, and the all-off reading subtracted, adjust it until the median over {pairs}"
        yield f"reads {number(design.gain.target_counts)} counts, then fit that value to all (to each its own,"
        yield "by rule `each`). Then put the ohms into `gain.feedback_ohm`: signals, sheets and driver follow them."
    else:
        yield "The resistors are the design's: signals, sheets and driver follow them."
    yield f"The capacitor next to each must let the reading settle within {number(design.board.settle_us)} us and"
    yield "keep the amplifier from ringing."
    yield ""


def _clipped(design: SensorDesign, gain: SimulatedGain) -> Iterator[str]:
    found, full_scale = clipped_pairs(design, gain), round(full_scale_counts(design))
    total = len(gain.untouched_flux) * len(gain.counts_per_flux)
    if not found:
        yield f"No pair reads above full scale ({full_scale} counts) while the pad is untouched."
        yield ""
        return
    named = ", ".join(f"{one.name} ({one.counts:.0f})" for one in found[:SHOWN_CLIPPED])
    more = f" and {len(found) - SHOWN_CLIPPED} more" if len(found) > SHOWN_CLIPPED else ""
    yield (
        f"Untouched, {len(found)} of {total} pairs read above full scale ({full_scale} counts) and resolve nothing "
        f"until a press dims them: {named}{more}. Lower `gain.target_counts` to unclip them."
    )
    yield ""
