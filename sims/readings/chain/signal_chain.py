"""From flux to counts, frame by frame.

Of emitter e, receiver r, in a frame that begins at t, with flux F (share of the emitted power):

    lit      = F x power_e x gain_r                      counts of a still sensor (`sims.readings.readout`)
    drifted  = lit x (1 + a_e)(1 + b_r)                  a, b: drawn for a set, and steady within it by the hour
    now      = drifted x (1 + c_e)                       c: drawn for a frame, one for all receivers of an emitter
    ambient  = A (1 + m cos(2 pi f t_er + phase))        in all states, the off state too, each at its own time t_er
    reading  = now + ambient + dark + noise              noise: normal, variance = read^2 + shot x (now + ambient)
    counts   = whole number within 0 and full scale

States follow one another as on the board: every emitter alone, then all off; in each, receiver after receiver
(`design.circuit.timing`). Whoever takes the off state away is left with the flicker between its time and the others'.

Left out: settling of amplifiers (the firmware waits for it), crosstalk of the converter's inputs, ambient light that
the finger shadows, the converter's nonlinearity, temperature but for the drift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from design.circuit.pins import board_of
from design.circuit.timing import MS_PER_S, US_PER_S, conversion_time_ms
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from design.spec.noise import PURE, Noise
from sims.readings.chain.amplifier import relative_power, shot_variance_per_count
from sims.readings.readout import Readout

S_PER_HOUR = 3600.0


@dataclass(frozen=True, kw_only=True)
class SetDraw:
    """What holds for one data set: drawn once.

    Attributes
    ----------
    emitter_drift, receiver_drift : (emitter,), (receiver,) relative change of gain at the set's begin [-]
    emitter_rate, receiver_rate : the same by the hour [1/h]
    flicker_phase : of the lamps at time 0 [rad]
    ambient_counts : 0 in a dark set [counts]
    """

    emitter_drift: FloatArray
    receiver_drift: FloatArray
    emitter_rate: FloatArray
    receiver_rate: FloatArray
    flicker_phase: float
    ambient_counts: float

    def gain(self, time_s: FloatArray) -> FloatArray:
        """(n, emitter, receiver) factor of the signals at times within the set [-]."""
        hours = np.asarray(time_s, dtype=np.float64)[:, None] / S_PER_HOUR
        emitter = 1.0 + self.emitter_drift + hours * self.emitter_rate
        receiver = 1.0 + self.receiver_drift + hours * self.receiver_rate
        return np.asarray(emitter[:, :, None] * receiver[:, None, :])


@dataclass(frozen=True, kw_only=True)
class SignalChain:
    """The chain of one sensor; a copy with other gains (`dataclasses.replace`) is another build of it.

    Attributes
    ----------
    gains : (emitter, receiver) counts for all of an emitter's power on a receiver [counts]
    full_scale_counts : largest reading [counts]
    noise : the design's parameters
    shot_variance_per_count : (receiver,) [counts]
    read_at_s : (state, receiver) when each is read, from the frame's begin; off is last [s]
    """

    gains: FloatArray
    full_scale_counts: float
    noise: Noise
    shot_variance_per_count: FloatArray
    read_at_s: FloatArray

    def draw_set(self, rng: np.random.Generator, *, is_ambient: bool) -> SetDraw:
        """Drift and lamps of a new data set."""
        emitters, receivers = self.gains.shape
        noise = self.noise
        drifts: list[FloatArray] = [
            scale * np.asarray(rng.standard_normal(count))
            for scale in (noise.gain_drift, noise.gain_drift_per_hour)
            for count in (emitters, receivers)
        ]
        return SetDraw(
            emitter_drift=drifts[0],
            receiver_drift=drifts[1],
            emitter_rate=drifts[2],
            receiver_rate=drifts[3],
            flicker_phase=float(rng.uniform(0.0, 2.0 * np.pi)),
            ambient_counts=noise.ambient_counts if is_ambient else 0.0,
        )

    def counts(
        self,
        flux: FloatArray,
        time_s: FloatArray,
        rng: np.random.Generator,
        is_ambient: bool = False,
        drawn: SetDraw | None = None,
    ) -> NDArray[np.float32]:
        """Readings of frames.

        Parameters
        ----------
        flux : (n, emitter, receiver) share of the emitted power [-]
        time_s : (n,) begin of each frame within its set [s]
        rng : of all noise from frame to frame
        is_ambient : whether lamps are on; where `drawn` is given it decides
        drawn : of the set that the frames belong to; None draws a new one from `rng`

        Returns
        -------
        (n, state, receiver) whole counts, off last; not rounded where `noise.quantised` is false [counts]
        """
        held = self.draw_set(rng, is_ambient=is_ambient) if drawn is None else drawn
        emitters, receivers = self.gains.shape
        lit = flux * self.gains * held.gain(time_s)
        lit *= 1.0 + self.noise.led_fluctuation * rng.standard_normal((len(flux), emitters, 1))
        light = np.zeros((len(flux), emitters + 1, receivers))
        light[:, :-1] = lit
        light += self._ambient(np.asarray(time_s, dtype=np.float64), held)
        sigma = np.sqrt(self.noise.read_noise_counts**2 + self.shot_variance_per_count * light)
        reading = light + self.noise.dark_counts + sigma * rng.standard_normal(light.shape)
        if self.noise.quantised:
            np.rint(reading, out=reading)
        return np.clip(reading, 0.0, self.full_scale_counts).astype(np.float32)

    def pair_sigma_counts(self, signal: FloatArray) -> FloatArray:
        """Standard deviation from frame to frame of a pair's signal, the off state taken away [counts].

        Two readings with read noise, rounding and shot noise, and the emitter's fluctuation. Not in it: drift, and
        flicker (`flicker_sigma_counts`), which neighbouring pairs share.

        Parameters
        ----------
        signal : (..., emitter, receiver) signals [counts]
        """
        rounding = 1.0 / 12.0 if self.noise.quantised else 0.0
        each = self.noise.read_noise_counts**2 + rounding
        shot = self.shot_variance_per_count * np.maximum(signal, 0.0)
        return np.sqrt(2.0 * each + shot + (self.noise.led_fluctuation * signal) ** 2)

    def flicker_sigma_counts(self) -> FloatArray:
        """(emitter, receiver) what is left of the lamps' flicker without the off state, rms over phases [counts].

        A m sqrt(1 - cos(2 pi f dt)), dt the time between a pair's reading and the off state's.
        """
        apart_s = self.read_at_s[-1] - self.read_at_s[:-1]
        turn = 1.0 - np.cos(2.0 * np.pi * self.noise.flicker_hz * apart_s)
        return np.asarray(
            self.noise.ambient_counts * self.noise.ambient_flicker * np.sqrt(np.maximum(turn, 0.0))
        )

    def _ambient(self, time_s: FloatArray, held: SetDraw) -> FloatArray | float:
        if held.ambient_counts == 0.0:
            return 0.0
        turns = 2.0 * np.pi * self.noise.flicker_hz * (time_s[:, None, None] + self.read_at_s)
        wave = self.noise.ambient_flicker * np.cos(turns + held.flicker_phase)
        return np.asarray(held.ambient_counts * (1.0 + wave))


def chain_of(design: SensorDesign, readout: Readout) -> SignalChain:
    """The chain of a design with the gains of a readout.

    Unequal emitters count by their power where all are known; a readout's gains belong to the mean one.
    """
    cavity = cavity_of(design)
    gains = relative_power(design) * readout.of_each(len(cavity.receivers))
    return SignalChain(
        gains=gains,
        full_scale_counts=readout.full_scale_counts,
        noise=design.noise,
        shot_variance_per_count=shot_variance_per_count(design, readout),
        read_at_s=reading_times_s(design),
    )


def reading_times_s(design: SensorDesign) -> FloatArray:
    """(state, receiver) begin of each conversion, from the frame's begin: every emitter alone, then all off [s]."""
    cavity = cavity_of(design)
    states, receivers = len(cavity.emitters) + 1, len(cavity.receivers)
    conversion_s = conversion_time_ms(board_of(design), design.board.adc_prescaler) / MS_PER_S
    settle_s = design.board.settle_us / US_PER_S
    begins = np.arange(states) * (settle_s + receivers * conversion_s) + settle_s
    return np.asarray(begins[:, None] + np.arange(receivers) * conversion_s)


def without_noise(design: SensorDesign) -> SensorDesign:
    """The design with everything of the chain off: its counts are gain times light, up to full scale."""
    return design.with_(**{f"noise.{name}": value for name, value in PURE.items()})
