"""Errors of continuity, evenness and strength from the numerical error of the light model.

A normally distributed error is added to a pair's light at every depth, as large as its standard error there, and the
pair is judged again; this is repeated. The error of a figure is the root mean square distance of these draws from the
judged value. It includes a shift, because errors add to the range of flat parts. For medians over a pad's pairs, every
pair is drawn in this way; pairs that are equal by symmetry have the same draws.

Left out: the unknown correlation of errors at neighbouring depths (independent draws have too much jitter and too
little drift); the error of the untouched pad, whose light has no replicates; errors of the gain, of the mode
boundaries (computed separately), and of the models.

Mode boundaries in newtons: the load at which a mode starts or ends, with the band of the modulus.

    depth of the boundary ──► load of the press there, at the best value of the modulus and at both ends of its band

Depths do not depend on the modulus: light depends on the shape only, and the shape of a frictionless layer does not
depend on its stiffness. Loads are proportional to it, so a softer mix moves every boundary in newtons and none in
millimetres. The load is that of the pair's own press where the contact model covers its location, even near walls;
elsewhere it is that of a press at the pad's centre, and `is_at_place` is False.

Left out: the error of the contact model, friction, viscosity.

Errors of the mode boundaries from the numerical error of the light model.

A boundary is where a curve crosses a level, so an error of the curve moves it by that error divided by the curve's
slope there. The light model gives the standard error of the total light only. The same is assumed for the mirrored and
for the direct part, which is too much for the direct part (it comes from quadrature, not rays). Errors of the level (a
share of the curve's range) and of neighbouring depths, which partly cancel, are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import ModelScopeError
from optopad.sims.contact.force_curve import LoadCurve, load_curve
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import Contact
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, between, clipped, noise_units
from optopad.sims.verdict.pair_score import Modes, PairScore, continuity, deadband_intervals_mm, evenness
from optopad.sims.verdict.presses import PairCurves

Load = tuple[float, float, float]
"""Load, and the low and high end of its band [N]."""


@dataclass(frozen=True, kw_only=True)
class BoundaryForces:
    """Loads at the boundaries of the modes, each (load, low end, high end) [N]; None if no press reaches it.

    Attributes
    ----------
    mode1_start, mode1_end, mode2_onset, mode2_end : the boundaries
    is_at_place : whether the load is that of the pair's own press; if False, it is that of a press at the pad's centre
    """

    mode1_start: Load
    mode1_end: Load
    mode2_onset: Load | None
    mode2_end: Load | None
    is_at_place: bool

    def to_json(self) -> dict[str, object]:
        """The loads as plain data for JSON."""
        loads = {name: getattr(self, name) for name in BOUNDARIES}
        return {
            name: None if load is None else [round(end, 4) for end in load] for name, load in loads.items()
        } | {"is_at_place": self.is_at_place}


BOUNDARIES = ("mode1_start", "mode1_end", "mode2_onset", "mode2_end")


def boundary_forces(modes: Modes, force: LoadCurve, *, is_at_place: bool = True) -> BoundaryForces:
    """The loads of a press at the boundaries of the modes.

    Parameters
    ----------
    force : load of the press against depth, down to the deepest boundary or deeper
    """
    onset, end = modes.mode2_mm
    return BoundaryForces(
        mode1_start=force.at(modes.mode1_mm[0]),
        mode1_end=force.at(modes.mode1_mm[1]),
        mode2_onset=None if onset is None else force.at(onset),
        mode2_end=None if end is None else force.at(end),
        is_at_place=is_at_place,
    )


def place_force(contact: Contact, place_mm: tuple[float, float]) -> tuple[LoadCurve, bool]:
    """Load of a press against depth, and whether it is at the given location (True) or at the pad's centre (False)."""
    depth_mm = depth_schedule_mm(contact.design.operating.max_depth_mm)
    try:
        return load_curve(solved_press(contact, at_mm=place_mm), depth_mm), True
    except ModelScopeError:
        return load_curve(solved_press(contact), depth_mm), False


Errors = tuple[float | None, float | None]


def mode_errors_mm(curves: PairCurves, modes: Modes) -> tuple[Errors, Errors]:
    """Standard errors of start and end of mode 1 and mode 2 [mm]; None if not reached, or where the curve is flat."""
    first = tuple(_moved_mm(curves, curves.top, boundary) for boundary in modes.mode1_mm)
    second = tuple(_moved_mm(curves, curves.direct, boundary) for boundary in modes.mode2_mm)
    return (first[0], first[1]), (second[0], second[1])


def _moved_mm(curves: PairCurves, light: FloatArray, boundary_mm: float | None) -> float | None:
    """Error of a boundary [mm]: standard error of the light divided by its slope; None if the slope is 0."""
    if boundary_mm is None:
        return None
    depth = curves.depth_mm
    segment = min(max(int(np.searchsorted(depth, boundary_mm)) - 1, 0), len(depth) - 2)
    slope = abs(light[segment + 1] - light[segment]) / (depth[segment + 1] - depth[segment])
    if slope == 0.0:
        return None
    return float(np.interp(boundary_mm, depth, curves.standard_error) / slope)


FIGURES = ("continuity", "evenness", "swing", "resolvable_steps")
"""Names of the figures, which are all dimensionless."""

DRAWS = 16
"""Number of draws for each pair; with these, an error is known to about a sixth of its value."""

SEED = 20170601

SAME = 1e-4
"""Largest difference between curves under a press that count as the same [counts]."""


def drawn_figures(curves: Sequence[PairCurves], scores: Sequence[PairScore], readout: Readout) -> FloatArray:
    """(pair, draw, figure) figures of pairs after random errors of their light, in the order of `FIGURES`."""
    known: dict[bytes, FloatArray] = {}
    found = []
    for number, (of_pair, score) in enumerate(zip(curves, scores, strict=True)):
        gain = readout.of_receiver(of_pair.pair[1])
        content = _content(of_pair, gain, score.end_mm)
        if content not in known:
            known[content] = _drawn(of_pair, score.end_mm, readout, (SEED, number))
        found.append(known[content])
    return np.stack(found)


def _content(curves: PairCurves, gain: float, end_mm: float) -> bytes:
    """Cache key that is equal for pairs whose light under a press is the same, such as pairs equal by symmetry."""
    pressed = slice(1, None)
    light = np.concatenate([curves.total[pressed], curves.standard_error[pressed]])
    return np.rint(np.append(gain * light, end_mm) / SAME).astype(np.int64).tobytes()


def _drawn(curves: PairCurves, end_mm: float, readout: Readout, seed: tuple[int, int]) -> FloatArray:
    jitter = np.random.default_rng(seed).normal(size=(DRAWS, len(curves.depth_mm)))
    light = np.maximum(curves.total + jitter * curves.standard_error, 0.0)
    gain = readout.of_receiver(curves.pair[1])
    return np.array([_figures(curves.depth_mm, gain * one, end_mm, readout) for one in light])


def _figures(depth_mm: FloatArray, unlimited: FloatArray, end_mm: float, readout: Readout) -> FloatArray:
    """(figure,) figures of one curve of counts, computed as in `optopad.sims.verdict.pair_score`."""
    noise = readout.noise
    at_mm, counts = clipped(depth_mm, unlimited, readout.full_scale_counts)
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
    """(figure,) figures of a judged pair, in the order of `FIGURES`."""
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
    """Root mean square errors of one pair's figures, or of the medians over several pairs, by name.

    Parameters
    ----------
    drawn : (pair, draw, figure) figures from `drawn_figures`
    judged : (pair, figure) figures from `figures_of`
    """
    away = np.median(drawn, axis=0) - np.median(judged, axis=0)
    return dict(zip(FIGURES, np.sqrt(np.mean(away**2, axis=0)).tolist(), strict=True))
