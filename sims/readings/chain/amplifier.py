"""Shot noise of the receivers' amplifiers, and the emitters' unequal power.

The current i of a photodiode has the spectral density 2 q i (Schottky). A transimpedance amplifier with feedback
R and C passes the noise bandwidth 1 / (4 R C), its step is V = supply / 2^bits, and n counts are i R = n V. In counts

    variance = 2 q i R^2 / (4 R C V^2) = n q / (2 C V)

so that neither the light nor the resistor matters, but for the capacitor that goes with it. With 27 pF and 10 bits
of 5 V it is 6e-7 a count: 0.01 counts at 300, far below the reading noise of any board here. Left out: the
resistor's thermal noise, which no data sheet of a chosen amplifier allows to be added up; `read_noise_counts` has it.
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.circuit.pins import board_of
from design.circuit.transimpedance import emitted_mw, feedbacks_of, responsivity_at
from design.parts.assumptions import assumption
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from sims.readings.readout import Readout

ELECTRON_C = 1.602176634e-19
"""Charge of the electron, exact in the SI [C]."""
F_PER_PF = 1e-12
UNKNOWN_FEEDBACK_PF = 22.0
"""Feedback capacitor where an emitter's power is unknown, so that none can be chosen; assumed [pF]."""


def shot_variance_per_count(design: SensorDesign, readout: Readout) -> FloatArray:
    """(receiver,) variance of a reading over its counts, or the design's own value for all [counts]."""
    count = len(cavity_of(design).receivers)
    if design.noise.shot_variance_per_count is not None:
        return np.full(count, design.noise.shot_variance_per_count)
    feedbacks = feedbacks_of(design, readout.of_each(count))
    capacitors = (
        [UNKNOWN_FEEDBACK_PF] * count if feedbacks is None else [one.capacitor_pf for one in feedbacks]
    )
    step_v = assumption("supply_v").value / 2 ** board_of(design).adc_bits
    return np.asarray(ELECTRON_C / (2.0 * np.array(capacitors) * F_PER_PF * step_v))


def relative_power(design: SensorDesign) -> FloatArray:
    """(emitter, receiver) photocurrent over that of the mean emitter, for equal flux [-].

    1 where all emitters are one part, and where the power of one is unknown. The gains of a readout belong to the
    mean emitter.
    """
    cavity = cavity_of(design)
    powers = [emitted_mw(one.part) for one in cavity.emitters]
    colours = [one.part.wavelength_nm for one in cavity.emitters]
    shape = (len(cavity.emitters), len(cavity.receivers))
    if len({one.part_id for one in cavity.emitters}) == 1 or any(one is None for one in (*powers, *colours)):
        return np.ones(shape)
    current = np.array(
        [
            [
                power.value * responsivity_at(receiver.part, colour.value).value
                for receiver in cavity.receivers
            ]
            for power, colour in zip(powers, colours, strict=True)
            if power is not None and colour is not None
        ]
    )
    return np.asarray(current / current.mean(axis=0))
