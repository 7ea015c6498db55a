"""How far the light trace's own error moves continuity, evenness and strength.

The light of a pair is drawn again, every depth moved by a normal error with the standard error of its trace, and judged
again. A figure's error is the root mean square distance of the draws from what was judged, so a shift counts, too:
jitter adds to the range of flat stretches. Of a pad's medians over pairs likewise, pair by pair drawn anew; pairs that
a symmetry makes one share their draws.

Left out: errors of neighbouring depths go together to an unknown degree (they are drawn apart, which is too much jitter
and too little drift), that of the untouched pad, whose light has no replicates, errors of the gain, of the boundaries
of the modes (they have their own), and of the models.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from design.arrays import FloatArray
from design.spec import SensorDesign
from sims.readings.readout import Readout
from sims.verdict.pair.deadbands import continuity, deadband_intervals_mm, evenness
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD
from sims.verdict.pair.depth_curve import between, clipped
from sims.verdict.pair.noise_units import noise_of, noise_units
from sims.verdict.pair.pair_score import PairScore
from sims.verdict.presses import PairCurves

FIGURES = ("continuity", "evenness", "swing", "resolvable_steps")
"""Columns of drawn figures: shares [-], and a number of steps."""

DRAWS = 16
"""How often a pair is drawn again: its errors are then known to a sixth."""

SEED = 20170601

SAME = 1e-4
"""Pressed curves that agree to this are one [counts]."""


def drawn_figures(
    design: SensorDesign, curves: Sequence[PairCurves], scores: Sequence[PairScore], readout: Readout
) -> FloatArray:
    """(pair, draw, figure) figures of pairs drawn again, in the order of `FIGURES`."""
    known: dict[bytes, FloatArray] = {}
    found = []
    for number, (of_pair, score) in enumerate(zip(curves, scores, strict=True)):
        gain = readout.of_receiver(of_pair.pair[1])
        content = _content(of_pair, gain, score.end_mm)
        if content not in known:
            known[content] = _drawn(
                design, of_pair, score.end_mm, gain, readout.full_scale_counts, (SEED, number)
            )
        found.append(known[content])
    return np.stack(found)


def _content(curves: PairCurves, gain: float, end_mm: float) -> bytes:
    """What is the same for pairs that a symmetry makes one, to round-off; their untouched light is each pair's own."""
    pressed = slice(1, None)
    light = np.concatenate([curves.total[pressed], curves.standard_error[pressed]])
    return np.rint(np.append(gain * light, end_mm) / SAME).astype(np.int64).tobytes()


def _drawn(
    design: SensorDesign,
    curves: PairCurves,
    end_mm: float,
    gain: float,
    full_scale_counts: float,
    seed: tuple[int, int],
) -> FloatArray:
    jitter = np.random.default_rng(seed).normal(size=(DRAWS, len(curves.depth_mm)))
    light = np.maximum(curves.total + jitter * curves.standard_error, 0.0)
    return np.array(
        [_figures(design, curves.depth_mm, gain * one, end_mm, full_scale_counts) for one in light]
    )


def _figures(
    design: SensorDesign,
    depth_mm: FloatArray,
    unlimited: FloatArray,
    end_mm: float,
    full_scale_counts: float,
) -> FloatArray:
    """(figure,) of one curve of counts, as `sims.verdict.pair.pair_score` works them out."""
    noise = noise_of(design)
    at_mm, counts = clipped(depth_mm, unlimited, full_scale_counts)
    _, units = between(at_mm, noise_units(counts, **noise), 0.0, end_mm)
    dead = deadband_intervals_mm(at_mm, counts, end_mm=end_mm, **noise)
    return np.array(
        [
            continuity(dead, end_mm),
            evenness(at_mm, counts, end_mm=end_mm, **noise),
            1.0 - counts.min() / counts[0],
            np.ptp(units) / DEADBAND_THRESHOLD,
        ]
    )


def figures_of(score: PairScore) -> FloatArray:
    """(figure,) of a pair as it was judged."""
    strength = score.strength
    return np.array(
        [
            score.continuity,
            score.evenness,
            strength.swing,
            strength.resolvable_steps,
        ]
    )


def figure_errors(drawn: FloatArray, judged: FloatArray) -> dict[str, float]:
    """Errors by name of one pair's figures, or of the medians over several.

    Parameters
    ----------
    drawn : (pair, draw, figure)
    judged : (pair, figure)
    """
    away = np.median(drawn, axis=0) - np.median(judged, axis=0)
    return dict(zip(FIGURES, np.sqrt(np.mean(away**2, axis=0)).tolist(), strict=True))
