"""From flux to counts, frame by frame, with drift, noise, ambient light, errors of the stage, loose walls and memory.

Signal chain
------------
For emitter e and receiver r, in a frame that begins at t, with flux F (share of the emitted power):

    lit      = F x power_e x gain_r                      counts of a still sensor (`optopad.sims.readings.readout`)
    drifted  = lit x (1 + a_e)(1 + b_r)                  a, b: drawn for a set, with a constant hourly rate within it
    now      = drifted x (1 + c_e)                       c: drawn for a frame, one for all receivers of an emitter
    ambient  = A (1 + m cos(2 pi f t_er + phase))        in all states, the off state too, each at its own time t_er
    reading  = now + ambient + dark + noise              noise: normal, variance = read^2 + shot x (now + ambient),
                                                         over the board's averages
    counts   = whole number within 0 and full scale

States follow one another as on the board. Each emitter is lit alone. All are off either once at the end, or before and
after each emitter; then the mean of both is subtracted (`optopad.design.recordings.with_one_dark`). In each state the
receivers are read one after another (`optopad.design.circuit.circuit`). Readings of a pair and of its dark states have
different times, so part of the ambient light's flicker remains when the dark state is subtracted.

Left out: settling of amplifiers (the firmware waits for it), crosstalk between the converter's inputs, the finger's
shadow in ambient light, the converter's nonlinearity, temperature except for the drift.

Shot noise, and emitters of unequal power
-----------------------------------------
The current i of a photodiode has the spectral density 2 q i (Schottky). A transimpedance amplifier with feedback R and
C has the noise bandwidth 1 / (4 R C). A step of the converter is V = supply / 2^bits, so a reading of n counts means i
R = n V. In counts

    variance = 2 q i R^2 / (4 R C V^2) = n q / (2 C V)

The variance per count depends only on the capacitor, neither on the light nor on the resistor. With 27 pF and 10 bits
of 5 V it is 6e-7 per count. This is 0.01 counts at 300, far below the reading noise of any board here. Left out: the
resistor's thermal noise, which `read_noise_counts` includes, as the data sheets lack figures.

Position of the tip
-------------------
The true position differs from the one that the stage reports:

    depth = reported + offset of the set + offset of the location, and on the way back + lag, never beyond the turn
    x, y  = reported + error of the press

The depth offsets model a zero that is set by hand, and a surface that is not level. The lag is backlash: after the turn
the tip stays until the stage has taken up the lag. Light is traced at the protocol's locations and interpolated in
depth. So instead of moving the tip, the error in x and y is subtracted from the reported location: the spread is the
same, and one trace serves all seeds. Left out: a stage that is not square or not level, errors that depend on the
location.

Loose walls
-----------
According to the paper, elastomer and wall bond and unbond over 5 to 10 s. It shows this as hysteresis, but gives no
magnitude. Here a press of depth d unbonds at least the share s d / d_max of all walls, and the loose share u heals:

    du/dt = -u / T,   u >= s max(d, 0) / d_max

with s = `noise.wall_unbonded_share` (0 by default) and T = `noise.wall_heal_s`. Signals are (1 - u) times those with
bonded walls plus u times those with an air gap at all walls, both from the light model. This is exact for light that
meets walls once, and a first-order approximation for the rest.

With a black layer, the bottom is silicone cast on silicone and stays bonded. Without a black layer, the elastomer may
come off the mold's floor too, but only the walls are modelled, as the light model has no smooth floor. Left out: the
distribution of the loose share along the walls, and the change of force and shape.

Memory of a press
-----------------
A silicone comes back slowly from a press. Until the next release, the last press adds to the flux of every pair

    c(t) = r / (1 + t / T) x (flux of that press at its deepest - flux untouched)

where t is the time since its release, r = `noise.release_residue` (0 by default) and T = `noise.release_decay_s`. The
sum is added to the untouched pad and to the next press, wherever that is, and is never negative. The law is the one
with two parameters that fits the REMODEL recordings (docs/validation/memory.md). 23 signals of three presses follow it
within 2 to 9 % of the residue, from 0.5 to 6 s after the release from a hold of 20 s. An exponential misses by 10 to
16 %. A power of time misses by 3 to 7 % and has no value at t = 0. r is 0.036 to 0.057 and T 0.7 to 1.4 s there.

That pad is of another silicone, of unknown grade, and its light runs in air; no clear silicone was measured
(`design/data/memory.toml`). Left out: how r and T depend on the time of the hold, on depth and on temperature; the
shape of the residue, which is wider than the press (there its share is about a quarter larger 5 mm away); the first
0.3 s, in which that stage came to rest; the recovery during a slow retraction, since the law begins at the end of the
press; presses before the last one; and the force. Light with loose walls changes as with bonded ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.circuit.circuit import MS_PER_S, US_PER_S, Circuit
from optopad.design.circuit.emitter_switch import current_sink
from optopad.design.circuit.transimpedance import emitted_mw, feedbacks_of, responsivity_at
from optopad.design.errors import ModelScopeError
from optopad.design.recordings import kept_share, lit_emitters, nearest_dark_states, with_one_dark
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.sensor import PURE, Noise
from optopad.sims.readings.readout import Readout


def unbonded_share(
    depth_mm: FloatArray, time_s: FloatArray, *, deepest_mm: float, share: float, heal_s: float
) -> FloatArray:
    """Share (n,) of the walls that is loose at each of a series of samples [-]; it is 0 before the first sample.

    Parameters
    ----------
    depth_mm, time_s : (n,) depth [mm] and increasing time [s] of the samples
    deepest_mm : depth of the press that unbonds a share `share` of the walls [mm]
    heal_s : time constant with which walls bond again [s]
    """
    forced = share * np.clip(depth_mm / deepest_mm, 0.0, 1.0)
    found = np.empty(len(forced))
    left = 0.0
    kept = np.exp(-np.diff(time_s, prepend=time_s[:1]) / heal_s)
    for k, least in enumerate(forced):
        left = max(left * kept[k], least)
        found[k] = left
    return found


def with_loose_walls(design: SensorDesign) -> SensorDesign:
    """The design with an air gap at all walls.

    Raises
    ------
    ModelScopeError : the walls already have an air gap, so they cannot come loose.
    """
    if design.surfaces.wall_finish == "air_gap":
        raise ModelScopeError(
            "noise.wall_unbonded_share: the walls have an air gap already (surfaces.wall_finish), and "
            "cannot come loose; set it to 0, or choose a bonded finish"
        )
    return design.with_(**{"surfaces.wall_finish": "air_gap", "surfaces.wall_index": None})


def blended(bonded: FloatArray, loose: FloatArray, share: FloatArray) -> FloatArray:
    """Flux (n, emitter, receiver) with a share (n,) of the walls loose, from flux with all bonded and all loose."""
    u = share[:, None, None]
    return np.asarray((1.0 - u) * bonded + u * loose)


@dataclass(frozen=True, kw_only=True)
class Remainder:
    """What a press leaves in the light after its release.

    Attributes
    ----------
    change : (emitter, receiver) flux of the press at its deepest, minus the untouched one [-]
    released_s : time of the release [s]
    """

    change: FloatArray
    released_s: float

    def added(self, flux: FloatArray, time_s: FloatArray, noise: Noise) -> FloatArray:
        """Flux (n, emitter, receiver) with the remainder, from the flux without it at times (n,) after the release."""
        since_s = np.maximum(time_s - self.released_s, 0.0)
        share = kept_share(since_s, residue=noise.release_residue, decay_s=noise.release_decay_s)
        return np.asarray(np.maximum(flux + share[:, None, None] * self.change, 0.0))


@dataclass(frozen=True, kw_only=True)
class PressDraw:
    """Errors of the stage in one press.

    Attributes
    ----------
    zero_offset_mm : true minus reported depth while the tip moves in [mm]
    place_error_mm : (2,) true minus reported x, y [mm]
    """

    zero_offset_mm: float
    place_error_mm: FloatArray


def drawn_set_offset_mm(noise: Noise, rng: np.random.Generator) -> float:
    """Draw the depth offset that all presses of a set share [mm]."""
    return float(noise.zero_offset_set_mm * rng.standard_normal())


def drawn_press(noise: Noise, set_offset_mm: float, rng: np.random.Generator) -> PressDraw:
    """Draw the errors of the stage in one press."""
    return PressDraw(
        zero_offset_mm=set_offset_mm + float(noise.zero_offset_place_mm * rng.standard_normal()),
        place_error_mm=noise.position_error_mm * rng.standard_normal(2),
    )


def true_depth_mm(
    reported_mm: FloatArray, is_retracting: BoolArray, drawn: PressDraw, retract_lag_mm: float
) -> FloatArray:
    """True depth (n,) of the tip in one press, from the reported depth while it moves in and back [mm]."""
    deepest = reported_mm.max() if len(reported_mm) else 0.0
    lagging = np.where(is_retracting, np.minimum(reported_mm + retract_lag_mm, deepest), reported_mm)
    return np.asarray(lagging + drawn.zero_offset_mm)


ELECTRON_C = 1.602176634e-19
"""Charge of the electron, exact in the SI [C]."""
F_PER_PF = 1e-12
UNKNOWN_FEEDBACK_PF = 22.0
"""Feedback capacitance assumed if an emitter's power is unknown, so that no capacitor can be chosen [pF]."""


def shot_variance_per_count(design: SensorDesign, readout: Readout) -> FloatArray:
    """Variance of the shot noise divided by the reading (receiver,) [counts]; the design's value if it has one."""
    circuit = Circuit.of(design)
    count = circuit.receiver_count
    if design.noise.shot_variance_per_count is not None:
        return np.full(count, design.noise.shot_variance_per_count / design.board.averages)
    feedbacks = feedbacks_of(circuit, readout.of_each(count))
    capacitors = (
        [UNKNOWN_FEEDBACK_PF] * count if feedbacks is None else [one.capacitor_pf for one in feedbacks]
    )
    step_v = circuit.adc.full_scale_v / 2**circuit.adc.bits
    of_reading = ELECTRON_C / (2.0 * np.array(capacitors) * F_PER_PF * step_v)
    return np.asarray(of_reading / design.board.averages)


def relative_power(design: SensorDesign) -> FloatArray:
    """Photocurrent (emitter, receiver) at equal flux, relative to the mean of the emitters [-].

    It is 1 if all emitters are the same part, or if the power of any emitter is unknown. A readout's gains are for the
    mean emitter.
    """
    circuit = Circuit.of(design)
    cavity, board, sink = circuit.cavity, circuit.board, current_sink(circuit)
    powers = [emitted_mw(one.part, board, sink) for one in cavity.emitters]
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


S_PER_HOUR = 3600.0


@dataclass(frozen=True, kw_only=True)
class SetDraw:
    """Drift and ambient light of one data set, drawn once for all its frames.

    Attributes
    ----------
    emitter_drift, receiver_drift : (emitter,), (receiver,) relative change of gain at the start of the set [-]
    emitter_rate, receiver_rate : (emitter,), (receiver,) further relative change of gain per hour [1/h]
    flicker_phase : phase at time 0 of the flicker in the ambient light [rad]
    ambient_counts : mean reading of ambient light, 0 in a dark set [counts]
    """

    emitter_drift: FloatArray
    receiver_drift: FloatArray
    emitter_rate: FloatArray
    receiver_rate: FloatArray
    flicker_phase: float
    ambient_counts: float

    def gain(self, time_s: FloatArray) -> FloatArray:
        """Factor (n, emitter, receiver) by which drift multiplies the signals, at times (n,) within the set [-].

        It is (1, emitter, receiver) if the parts do not drift within the set.
        """
        if not self._drifts:
            return self._at_start[None]
        hours = np.asarray(time_s, dtype=np.float64)[:, None] / S_PER_HOUR
        emitter = 1.0 + self.emitter_drift + hours * self.emitter_rate
        receiver = 1.0 + self.receiver_drift + hours * self.receiver_rate
        return np.asarray(emitter[:, :, None] * receiver[:, None, :])

    @cached_property
    def _drifts(self) -> bool:
        return bool(self.emitter_rate.any() or self.receiver_rate.any())

    @cached_property
    def _at_start(self) -> FloatArray:
        return np.asarray((1.0 + self.emitter_drift)[:, None] * (1.0 + self.receiver_drift))


@dataclass(frozen=True, kw_only=True)
class SignalChain:
    """Signal chain of one sensor unit, from flux to counts. For another unit, make a copy with other gains.

    Attributes
    ----------
    gains : (emitter, receiver) reading if all of the emitter's power reached the receiver [counts]
    full_scale_counts : largest reading of the converter [counts]
    noise : the design's noise parameters
    shot_variance_per_count : (receiver,) variance of the shot noise, divided by the reading [counts]
    read_at_s : (state, receiver) time of each reading from the frame's start [s]; `lit_emitters` lists the states
    dark : ``frame`` if all emitters are off once per frame, ``each`` if before and after each emitter
    """

    gains: FloatArray
    full_scale_counts: float
    noise: Noise
    shot_variance_per_count: FloatArray
    read_at_s: FloatArray
    dark: str = "frame"

    def draw_set(self, rng: np.random.Generator, *, is_ambient: bool) -> SetDraw:
        """Draw drift and ambient light of a new data set."""
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
        """Readings of frames, including drift, ambient light and noise.

        Parameters
        ----------
        flux : (n, emitter, receiver) share of the emitted power [-]
        time_s : (n,) start of each frame within its set [s]
        rng : random generator for the noise from frame to frame
        is_ambient : whether there is ambient light; ignored if `drawn` is given
        drawn : drift and ambient light of the frames' set; if None, they are drawn with `rng`

        Returns
        -------
        (n, state, receiver) readings, the off state last [counts]; not rounded if `noise.quantised` is false
        """
        held = self.draw_set(rng, is_ambient=is_ambient) if drawn is None else drawn
        reading = self.readings(flux, np.asarray(time_s, dtype=np.float64), rng, held)
        if self.dark != "frame":
            states = lit_emitters(len(self.gains), self.dark)
            reading = with_one_dark(reading, states, self.full_scale_counts)
            if self.noise.quantised:
                np.rint(reading, out=reading)
        return reading.astype(np.float32)

    def readings(
        self, flux: FloatArray, time_s: FloatArray, rng: np.random.Generator, held: SetDraw
    ) -> FloatArray:
        """Readings (n, state, receiver) of frames in all states, as the board sends them [counts].

        Parameters
        ----------
        flux : (n, emitter, receiver) share of the emitted power, each at the time of its reading [-]
        time_s : (n,) start of each frame within its set [s]
        rng : random generator for the noise from frame to frame
        held : drift and ambient light of the frames' set
        """
        emitters, receivers = self.gains.shape
        lit = flux * self.gains * held.gain(time_s)
        lit *= 1.0 + self.noise.led_fluctuation * rng.standard_normal((len(flux), emitters, 1))
        light = np.zeros((len(flux), len(self.read_at_s), receivers))
        light[:, self.is_lit] = lit
        light += self._ambient(time_s, held)
        sigma = np.sqrt(self.noise.read_noise_counts**2 + self.shot_variance_per_count * light)
        reading = light + self.noise.dark_counts + sigma * rng.standard_normal(light.shape)
        if self.noise.quantised:
            np.rint(reading, out=reading)
        np.minimum(np.maximum(reading, 0.0, out=reading), self.full_scale_counts, out=reading)
        return np.asarray(reading)

    @cached_property
    def is_lit(self) -> BoolArray:
        """Whether an emitter is lit in each state (state,)."""
        return np.array([one is not None for one in lit_emitters(len(self.gains), self.dark)])

    def flicker_sigma_counts(self) -> FloatArray:
        """Flicker of ambient light (emitter, receiver) that remains after the off state is subtracted, rms [counts].

        It is A m sqrt(1 - cos(2 pi f dt)) for ambient light A, modulation m and frequency f, if there is one dark state
        at the time dt from a pair's reading. It is A m (1 - cos(2 pi f dt)) / sqrt(2) if there are two, one dt before
        the reading and one dt after.
        """
        states = lit_emitters(len(self.gains), self.dark)
        wave = np.exp(2j * np.pi * self.noise.flicker_hz * self.read_at_s)
        lit = wave[[emitter is not None for emitter in states]]
        left = np.abs(lit - wave[nearest_dark_states(states)].mean(axis=1)) / np.sqrt(2.0)
        return np.asarray(self.noise.ambient_counts * self.noise.ambient_flicker * left)

    def _ambient(self, time_s: FloatArray, held: SetDraw) -> FloatArray | float:
        if held.ambient_counts == 0.0:
            return 0.0
        turns = 2.0 * np.pi * self.noise.flicker_hz * (time_s[:, None, None] + self.read_at_s)
        wave = self.noise.ambient_flicker * np.cos(turns + held.flicker_phase)
        return np.asarray(held.ambient_counts * (1.0 + wave))


def chain_of(design: SensorDesign, readout: Readout) -> SignalChain:
    """The signal chain of a design, with the gains of a readout.

    A readout's gains are for the mean emitter, so the gains of unequal emitters are weighted by their power if all
    powers are known.
    """
    cavity = cavity_of(design)
    gains = relative_power(design) * readout.of_each(len(cavity.receivers))
    return SignalChain(
        gains=gains,
        full_scale_counts=readout.full_scale_counts,
        noise=design.noise_inside.model_copy(update={"read_noise_counts": design.value_noise_counts}),
        shot_variance_per_count=shot_variance_per_count(design, readout),
        read_at_s=reading_times_s(design),
        dark=design.board.dark,
    )


def reading_times_s(design: SensorDesign) -> FloatArray:
    """Time (state, receiver) from the frame's start to the first reading of each value [s]; see `lit_emitters`.

    The times include the multiplexers' settling before the first reading at an address, and the transfer of data to LED
    drivers before they light.
    """
    circuit = Circuit.of(design)
    addresses = np.array(
        [path.terminal or 0 for path in circuit.receivers]
    )  # wait_s is 0 without multiplexers
    wait_s = circuit.address_settle_us / US_PER_S
    value_s = circuit.use.averages * circuit.adc.reading_ms / MS_PER_S
    within_s = np.arange(len(addresses)) * value_s + (addresses + 1) * wait_s
    settle_s = circuit.use.settle_us / US_PER_S + circuit.switch_ms / MS_PER_S
    state_s = settle_s + len(addresses) * value_s + (addresses.max() + 1) * wait_s
    return np.asarray((np.arange(circuit.state_count) * state_s + settle_s)[:, None] + within_s)


def without_noise(design: SensorDesign) -> SensorDesign:
    """The design without noise, drift and other errors of the chain: counts are gain times light, up to full scale."""
    return design.with_(**{f"noise.{name}": value for name, value in PURE.items()})
