"""Frames of presses and slides at a board's own rate and timing, and a touch reader's detector of slips on them.

True light and model are maps of signals with different nodes, traced with different seeds. So the model is off by what
its grid and its light cost. Each pair is read at its own time within a frame. The detector gets every touched frame.
The model is asked at 250 of them a second at most, and its last answer is kept in between, which saves hours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.recordings import SetEntry, lit_emitters, signals_of
from optopad.design.shape.cavity import judged_pairs, mask_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.simulated.finger import HOVER_MM, FingerPath
from optopad.fabrication.driver.slip import SlipDetector
from optopad.sims.learning.inference.signal_map import SignalMapModel, TensorSpline
from optopad.sims.learning.map_learner import fit_signal_map, map_header, mapped
from optopad.sims.learning.traced_map import SignalMap, measured_error, traced_map
from optopad.sims.readings.press_data import PressData
from optopad.sims.readings.readout import readout_of
from optopad.sims.readings.signal_chain import SetDraw, SignalChain, chain_of

TRUE_SEED, KNOWN_SEED = 7, 1_000_003
FINE_PITCH_MM, FINE_DEPTHS = 0.9, 12
"""The model's map where a quick one is too coarse; its nodes are not those of the true map."""
START_S = 0.5
"""Time for which the untouched pad is read at the start, as by the driver [s]."""
TRAIN_FRAMES, TRAIN_SETS = 300, 3
NODES = 3
"""Times within a frame at which light is taken from the map; between them it is interpolated."""
AT_ONCE = 4000
ASKED_HZ = 250.0
APART_S = 0.1
"""Slipping frames that are closer belong to the same slip [s]."""
LIGHTEST_MM, DEEPEST_MM = 0.3, 2.5
PRESS_MM_S = (2.0, 50.0)
"""Slowest and fastest speed at which random presses go in and out [mm/s]."""
SLIDE_MM, HELD_S, APPROACH_MM_S = 0.5, 0.2, 20.0
"""Length of a slide [mm], and time for which the press is held before [s] after it went in at this speed [mm/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """A simulated sensor: its true light and chain, and a model that was trained on its untouched frames."""

    name: str
    design: SensorDesign
    truth: SignalMap
    chain: SignalChain
    model: SignalMapModel

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.design.board.frame_rate_hz

    @cached_property
    def read_s(self) -> FloatArray:
        """(pair,) time of each pair's reading from the frame's start [s]."""
        lit = [one is not None for one in lit_emitters(len(self.chain.gains), self.chain.dark)]
        return np.asarray(self.chain.read_at_s[lit]).ravel()

    def light(self, press_mm: FloatArray) -> FloatArray:
        """(n, pair) light of presses (n, 3) by the true map [-]."""
        states, where = np.unique(press_mm, axis=0, return_inverse=True)
        found = np.tile(self.truth.untouched, (len(states), 1))
        touched = states[:, 2] > 0.0
        found[touched] *= self._root.values(states[touched]) ** 2
        return np.asarray(found[where.reshape(-1)])

    @cached_property
    def _root(self) -> TensorSpline:
        return self.truth.ratio_root

    def signals(self, flux: FloatArray, start_s: FloatArray, unit: Unit) -> FloatArray:
        """(n, pair) signals of frames that start at times (n,), from light at `NODES` times in each (n, node, pair)."""
        place = self.read_s / self.read_s.max() * (NODES - 1)
        low = np.minimum(place.astype(np.int64), NODES - 2)
        share, pairs = place - low, np.arange(flux.shape[2])
        lit = flux[:, low, pairs] * (1.0 - share) + flux[:, low + 1, pairs] * share
        shape = (len(flux), *self.chain.gains.shape)
        counts = self.chain.counts(lit.reshape(shape), start_s, unit.rng, drawn=unit.drawn)
        return signals_of(counts).reshape(len(flux), -1).astype(np.float64)

    def times_s(self, start_s: FloatArray) -> FloatArray:
        """(n, NODES) times within frames at which light is needed [s]."""
        return np.asarray(start_s[:, None] + np.linspace(0.0, self.read_s.max(), NODES))


@dataclass(frozen=True, kw_only=True, eq=False)
class Unit:
    """One sitting at the sensor: noise, drift and ambient light, and the untouched frames that the driver starts with.

    Attributes
    ----------
    factor : (pair,) from signals to the model's input, as by the drift tracker [-]
    start : (n, pair) untouched frames at the start as the model takes them [counts]
    """

    rng: np.random.Generator
    drawn: SetDraw
    factor: FloatArray
    start: FloatArray


def sitting(bench: Bench, seed: int) -> Unit:
    """Draw one sitting."""
    rng = np.random.default_rng(seed)
    unit = Unit(
        rng=rng,
        drawn=bench.chain.draw_set(rng, is_ambient=True),
        factor=np.ones(len(bench.read_s)),
        start=np.zeros((0, len(bench.read_s))),
    )
    start_s = np.arange(max(int(START_S * bench.rate_hz), 20)) / bench.rate_hz
    flux = np.broadcast_to(bench.truth.untouched, (len(start_s), NODES, len(bench.read_s)))
    signals = bench.signals(flux, start_s, unit)
    factor = bench.model.header.untouched_counts / signals.mean(axis=0)
    return replace(unit, factor=factor, start=signals * factor)


def bench_of(name: str, design: SensorDesign, *, quick: bool) -> Bench:
    """Trace both maps of a design, and train its model on untouched frames.

    quick : whether the model's map is a quick one
    """
    truth = traced_map(design, seed=TRUE_SEED)
    if quick:
        return bench_with(name, design, truth, mapped(design, quick=True))
    known = traced_map(design, pitch_mm=FINE_PITCH_MM, depth_nodes=FINE_DEPTHS, seed=KNOWN_SEED)
    checked = measured_error(design, known)
    return bench_with(name, design, truth, replace(known, error=checked.of_ratio(known.untouched)))


def bench_with(name: str, design: SensorDesign, truth: SignalMap, known: SignalMap) -> Bench:
    """A bench with the given true light, and the map `known` to the model."""
    draft = Draft.of(design)
    judged = mask_of(judged_pairs(draft.cavity), draft.cavity)
    chain = chain_of(design, readout_of(draft, truth.flux[0, 0, 0], judged))
    data = _untouched_data(design, truth, chain)
    model = fit_signal_map(design, known, map_header(design, data, known, 0), data)
    return Bench(name=name, design=design, truth=truth, chain=chain, model=model)


def _untouched_data(design: SensorDesign, truth: SignalMap, chain: SignalChain) -> PressData:
    rng = np.random.default_rng(0)
    flux = np.broadcast_to(truth.flux[0, 0, 0], (TRAIN_FRAMES, *chain.gains.shape))
    time_s = np.arange(TRAIN_FRAMES) / design.board.frame_rate_hz
    count, space = TRAIN_SETS * TRAIN_FRAMES, truth.workspace
    return PressData(
        counts=np.concatenate([chain.counts(flux, time_s, rng, is_ambient=True) for _ in range(TRAIN_SETS)]),
        press_mm=np.tile([space.x0_mm, space.y0_mm, HOVER_MM], (count, 1)),
        time_s=np.tile(time_s, TRAIN_SETS),
        set_number=np.repeat(np.arange(TRAIN_SETS), TRAIN_FRAMES),
        place_number=np.zeros(count, dtype=np.int64),
        sets=tuple(
            SetEntry(name=f"set{k}", role="train", pattern="unknown", is_ambient=True)
            for k in range(TRAIN_SETS)
        ),
        state_names=(*(f"E{k + 1}" for k in range(len(chain.gains))), "off"),
        receiver_names=tuple(f"R{k + 1}" for k in range(chain.gains.shape[1])),
        full_scale_counts=chain.full_scale_counts,
        design_digest=design.digest,
    )


Light = Callable[[FloatArray], FloatArray]
"""Function from times (n,) [s] to light (n, pair) [-]."""


def of_path(bench: Bench, path: FingerPath) -> Light:
    """Light of a finger that moves along a path without friction."""
    return lambda time_s: bench.light(path.at(time_s))


@dataclass(frozen=True, kw_only=True)
class Followed:
    """What the detector said of the frames of touches.

    Attributes
    ----------
    end_s : (n,) time at which each frame has been read [s]
    is_slipping : (n,) whether the touch slips
    slip_mm_s : (n, 2) its speed [mm/s]
    """

    end_s: FloatArray
    is_slipping: BoolArray
    slip_mm_s: FloatArray

    @property
    def alarms_s(self) -> FloatArray:
        """Times of slips; those less than `APART_S` after another slipping frame belong to the same slip [s]."""
        found = self.end_s[self.is_slipping]
        return np.asarray(found[np.diff(found, prepend=-np.inf) > APART_S])

    def delay_s(self, onset_s: float) -> float:
        """Time from `onset_s` to the first slipping frame after it [s]; infinite if there is none."""
        after = self.end_s[self.is_slipping & (self.end_s > onset_s)]
        return float(after[0] - onset_s) if len(after) else np.inf


def followed(
    bench: Bench, unit: Unit, start_s: FloatArray, light: Light, detector: SlipDetector | None = None
) -> Followed:
    """Frames that start at times (n,) [s] through chain, model and detector, as in `TouchReader`."""
    detector = detector or SlipDetector(bench.model, unit.start)
    every = max(int(bench.rate_hz / ASKED_HZ), 1)
    last, parts = -np.inf, []
    for first in range(0, len(start_s), AT_ONCE):
        times_s = start_s[first : first + AT_ONCE]
        flux = light(bench.times_s(times_s).ravel()).reshape(len(times_s), NODES, -1)
        rows = np.flatnonzero((flux != bench.truth.untouched).any(axis=(1, 2)))
        signals = bench.signals(flux[rows], times_s[rows], unit) * unit.factor
        found = bench.model.predict(signals[::every])
        slopes = detector.seen(signals[::every], found.press_mm)[1]
        for k, time_s in enumerate(times_s[rows]):
            if not found.is_touched[k // every]:
                continue
            if time_s - last > 1.5 / bench.rate_hz:
                detector.forget()
            last = time_s
            slip = detector.follow(float(time_s), signals[k], slopes[k // every])
            parts.append((time_s + bench.read_s.max(), slip.is_slipping, *slip.slip_mm_s))
    table = np.array(parts).reshape(-1, 4)
    return Followed(end_s=table[:, 0], is_slipping=table[:, 1] > 0.0, slip_mm_s=table[:, 2:])


def pressing(bench: Bench, seconds: float, rng: np.random.Generator) -> FingerPath:
    """Presses at random places, each of one to three depths with holds, approached and left at random speeds."""
    space, deepest = bench.truth.workspace, min(bench.design.operating.max_depth_mm, DEEPEST_MM)
    points = [(0.0, space.x0_mm, space.y0_mm, HOVER_MM)]

    def to(x: float, y: float, depth: float, seconds: float) -> None:
        points.append((points[-1][0] + seconds, x, y, depth))

    while points[-1][0] < seconds:
        x, y = space.spread(rng.uniform(size=(1, 2)))[0]
        to(x, y, HOVER_MM, 1e-3)
        to(x, y, HOVER_MM, rng.uniform(0.05, 0.4))
        for depth in (*rng.uniform(LIGHTEST_MM, deepest, rng.integers(1, 4)), HOVER_MM):
            to(x, y, depth, abs(depth - points[-1][3]) / np.exp(rng.uniform(*np.log(PRESS_MM_S))))
            to(x, y, depth, rng.uniform(0.1, 2.0) * (depth > 0.0) + 1e-3)
    table = np.array(points)
    return FingerPath(time_s=table[:, 0], press_mm=table[:, 1:])


def sliding(
    bench: Bench, depth_mm: float, speed_mm_s: float, rng: np.random.Generator
) -> tuple[FingerPath, float]:
    """A press at a random place that is held and then moved by `SLIDE_MM`, and the time at which that begins [s]."""
    space = bench.truth.workspace
    while True:
        (place,), angle = space.spread(rng.uniform(size=(1, 2))), rng.uniform(0.0, 2.0 * np.pi)
        end = place + SLIDE_MM * np.array([np.cos(angle), np.sin(angle)])
        if space.contains(*end):
            break
    pressed_s = depth_mm / APPROACH_MM_S
    onset_s = pressed_s + HELD_S + rng.uniform() / bench.rate_hz
    time_s = np.array([0.0, pressed_s, onset_s, onset_s + SLIDE_MM / speed_mm_s, onset_s + 1.0])
    press = [
        (*at, depth) for at, depth in ((place, 0.0), *((at, depth_mm) for at in (place, place, end, end)))
    ]
    return FingerPath(time_s=time_s, press_mm=np.array(press)), onset_s
