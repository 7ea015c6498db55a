"""How soon after a press a trained model finds a light touch again, on a pad with a memory.

Such a pad keeps a share of the last press's signal change (`optopad.sims.readings.signal_chain`, "Memory of a press").
A large share looks like a touch. The bearable share is the largest one with which, at the same location,

- at most `FALSE_ALARMS` of the untouched frames count as touched, and
- a touch of `TOUCH_MM` is found as often as on a rested pad, or `FEWER` less.

It is a property of pad and model, and does not depend on the law of the decay. With residue r and decay T it is reached
at the time T (r / share - 1) after the release. Frames are drawn as for data of a protocol, with other drifts. All
shares have the same random numbers.

Left out: drift tracking of the driver, which measures the untouched signals before the press, as the frames here have
those of the model's training.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.fields.packaged import data_quantities
from optopad.design.recordings import signals_of
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.readings.protocol import ProtocolCurves
from optopad.sims.readings.signal_chain import SetDraw, chain_of

TOUCH_MM = 0.2
FALSE_ALARMS = 0.05
FEWER = 0.05
DRAWS = 3
"""Number of draws of drift for each test set."""
LEAST_SHARE, STEPS = 1e-3, 8
"""Smallest share that is tried, and halvings of the range of its logarithm: 3 % in the share."""
SEED = 640_009
"""Number added to the seed, so that no frame is one of the test data."""


@dataclass(frozen=True, kw_only=True)
class FoundAgain:
    """When a model finds a touch again after the deepest press at the same location.

    Attributes
    ----------
    learner : kind of the model
    press_mm, touch_mm : depths of the press and of the touch [mm]
    rested_alarms, rested_found : shares of the frames of a rested pad that the model takes for touched: without contact
        and with the touch [-]
    share : largest bearable share of the press's signal change [-]; None if there is none
    after_s : time from the release until this share is reached [s]; None if it is never reached
    low_s, high_s : the same time at both ends of the catalogue's band of a silicone [s]; None if the design's residue
        was measured, or is outside the band
    """

    learner: str
    press_mm: float
    touch_mm: float
    rested_alarms: float
    rested_found: float
    share: float | None
    after_s: float | None
    low_s: float | None
    high_s: float | None

    def __str__(self) -> str:
        begin = (
            f"{self.learner}: after a press to {self.press_mm:g} mm, a touch of {self.touch_mm:g} mm there is"
        )
        if self.share is None or self.after_s is None:
            free = "of a rested pad" if self.rested_alarms > FALSE_ALARMS else "with the least residue"
            return (
                f"{begin} not distinguished from the residue: more than {100 * FALSE_ALARMS:.0f} % of the untouched "
                f"frames {free} count as touched, or fewer touches are found"
            )
        soon = f"after {self.after_s:.1f} s" if self.after_s > 0.0 else "at once"
        band = ""
        if self.low_s is not None and self.high_s is not None:
            band = f" ({self.low_s:.1f} to {self.high_s:.1f} s for the band of silicones)"
        return (
            f"{begin} found as often as on a rested pad, in {100 * self.rested_found:.0f} % of the frames, "
            f"{soon}{band}; before that, more than {100 * self.share:.1f} % of the press is left, "
            "which hides it or counts as a touch"
        )


def found_again(curves: ProtocolCurves, model: TouchModel, *, learner: str, seed: int = 0) -> FoundAgain:
    """When a model finds a light touch again after the deepest press, at the test locations of a protocol."""
    frames = _Frames(curves, model, seed)
    rested_alarms, rested_found = frames.touched(0.0)
    share = frames.bearable(rested_found) if rested_alarms <= FALSE_ALARMS else None
    design, band = curves.design, data_quantities("memory.toml")
    noise = design.noise
    ends = [(noise.release_residue, noise.release_decay_s)]
    known = band["release_residue"]
    is_within = (known.low or 0.0) <= noise.release_residue <= (known.high or known.value)
    if is_within and "noise.release_residue" not in design.measured:
        ends += zip(*[(one.low or 0.0, one.high or one.value) for one in band.values()], strict=True)
    times = [
        None if share is None else decay_s * max(residue / share - 1.0, 0.0) for residue, decay_s in ends
    ]
    after_s, low_s, high_s = (*times, None, None)[:3]
    return FoundAgain(
        learner=learner,
        press_mm=curves.protocol.deepest_mm,
        touch_mm=TOUCH_MM,
        rested_alarms=rested_alarms,
        rested_found=rested_found,
        share=share,
        after_s=after_s,
        low_s=low_s,
        high_s=high_s,
    )


class _Frames:
    """Frames of the test sets' locations after a press there, with any share of its change."""

    def __init__(self, curves: ProtocolCurves, model: TouchModel, seed: int) -> None:
        self._model, self._seed = model, seed + SEED
        self._chain = chain_of(curves.design, curves.readout)
        rng = np.random.default_rng(self._seed)
        self._sets: list[tuple[SetDraw, FloatArray, FloatArray, FloatArray]] = []
        light = curves.curves
        for number, one in enumerate(curves.protocol.sets):
            if one.role == "test":
                places = curves.place_of[number]
                pressed, touch = (
                    light.at(places, np.full(len(places), depth))
                    for depth in (curves.protocol.deepest_mm, TOUCH_MM)
                )
                free = np.broadcast_to(light.untouched, touch.shape)
                for _ in range(DRAWS):
                    drawn = self._chain.draw_set(rng, is_ambient=one.is_ambient)
                    self._sets.append((drawn, free, touch, pressed - free))

    def touched(self, share: float) -> tuple[float, float]:
        """Shares of the frames that count as touched: untouched ones and those with the touch [-]."""
        rng = np.random.default_rng(self._seed + 1)
        counted: list[list[BoolArray]] = [[], []]
        for drawn, free, touch, change in self._sets:
            for state, flux in enumerate((free, touch)):
                lit = np.maximum(flux + share * change, 0.0)
                time_s = rng.uniform(0.0, 1.0, len(lit))
                counts = self._chain.counts(lit, time_s, rng, drawn=drawn)
                signals = signals_of(counts).reshape(len(lit), -1).astype(np.float64)
                counted[state].append(self._model.predict(signals).is_touched)
        alarms, found = (float(np.concatenate(one).mean()) for one in counted)
        return alarms, found

    def bearable(self, rested_found: float) -> float | None:
        """The largest bearable share, by bisection; None if not even the smallest one is bearable."""
        low, high = np.log(LEAST_SHARE), 0.0
        best = None
        for step in range(STEPS + 1):
            tried = low if step == 0 else (low + high) / 2
            alarms, found = self.touched(float(np.exp(tried)))
            if alarms <= FALSE_ALARMS and found >= rested_found - FEWER:
                low, best = tried, float(np.exp(tried))
            elif step == 0:
                return None
            else:
                high = tried
        return best
