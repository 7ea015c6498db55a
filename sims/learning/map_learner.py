"""The learner "signal-map": a model from a traced map of signals and a sensor's own untouched readings.

    ratio of signals     a pair's signal divided by its untouched signal: from the light model
                         (`optopad.sims.learning.traced_map`)
    untouched signal     mean of the sensor's untouched frames. For a pair at full scale it follows from gains of
                         emitters and receivers that are fitted to the other pairs, and is corrected by the touched
                         frames in which the pair does not clip
    noise                from the design's signal chain, or from the untouched frames if they scatter more; plus the
                         map's measured error
    threshold of touch   the score that `FALSE_ALARMS` of the untouched frames exceed in the worst set. Each set is
                         compared with the untouched signals of the others, because a new set has its own gains,
                         ambient light and phase of flicker

Few presses are needed, or even none: untouched frames alone are enough. Left out: a bias of the reference depth in the
data, which this model does not learn (`optopad.sims.learning.calibration` fits it).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import version
from platform import python_version

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.sims.contact.force_curve import force_curve
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.inference.header import ForceCurve, ModelHeader
from optopad.sims.learning.inference.signal_map import KIND, Box, ReadingNoise, SignalMapModel
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA, SigmaTable
from optopad.sims.learning.learners import DEFAULT, FitSettings, Learner
from optopad.sims.learning.samples import CLEARLY_UNTOUCHED_MM, SIGMA_OF_TIP
from optopad.sims.learning.together_fit import fit_together
from optopad.sims.learning.touch_fit import sigma_table
from optopad.sims.learning.traced_map import (
    DEPTH_NODES,
    PITCH_MM,
    QUICK_DEPTH_NODES,
    QUICK_PITCH_MM,
    SignalMap,
    measured_error,
    traced_map,
)
from optopad.sims.readings.dataset import PressData

MAP_SEED = 104_729
"""Number added to the seed for the map's light. Simulated data use the seed itself, and the map must not share their
numerical errors.
"""
FALSE_ALARMS = 0.01
"""Share of the untouched training frames that may count as touched [-]."""
LEAST_THRESHOLD = 3.0
"""Least threshold of the touch score, which matters if there are few untouched frames. Half of χ² with 3 degrees of
freedom exceeds it in one case of nine.
"""
FEWEST_UNTOUCHED = 10
FORCE_DEPTHS = 51
LOCATED_MM = 0.2
"""Least depth of the presses that scale the deviations [mm]: a lighter press may be detected, but not located."""
CHECK_FRAMES = 4
TRUST_BINS = 5
"""Number of depth bins for scaling deviations; each press counts with `CHECK_FRAMES` frames. With ten presses in a bin,
a factor is known to 16 % in x and y and to 22 % in depth.
"""
MOST_FOR_THRESHOLD = 1500
"""Largest number of untouched frames used for the threshold, all sets together."""
MOST_FOR_CLIPPED = 3000
BRIGHT = 0.05
"""Pairs whose untouched signal is below this share of the median over pairs are not used to fit gains [-]."""
CLIP_SHARE = 0.99
"""Untouched readings above this share of the converter's largest reading count as clipped [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Untouched:
    """Statistics of a sensor's readings without contact.

    Attributes
    ----------
    mean_counts, spread_counts : (pair,) mean signal, and standard deviation of the signal from frame to frame within a
        set [counts]
    clip_counts : (pair,) signal at which the converter clips [counts]; infinite if unknown
    """

    mean_counts: FloatArray
    spread_counts: FloatArray
    clip_counts: FloatArray

    @property
    def is_clipped(self) -> BoolArray:
        """Whether each pair (pair,) counts as clipped: its mean is at least `CLIP_SHARE` of full scale."""
        return np.asarray(self.mean_counts >= CLIP_SHARE * self.clip_counts)


def untouched_rows(data: PressData) -> BoolArray:
    """Mask (sample,) of the frames that certainly have no contact, whatever the error of the reference depth.

    Raises
    ------
    InputError : there are too few such frames.
    """
    rows = data.press_mm[:, 2] <= CLEARLY_UNTOUCHED_MM
    if rows.sum() < FEWEST_UNTOUCHED:
        raise InputError(
            f"data: {int(rows.sum())} frames at {CLEARLY_UNTOUCHED_MM:g} mm or above the surface, needs "
            f">= {FEWEST_UNTOUCHED}; record some frames with the tip clear of the pad (negative depth)"
        )
    return np.asarray(rows)


def untouched_of(data: PressData) -> Untouched:
    """Mean, spread and clipping of the frames without contact; raises `InputError` if there are too few."""
    quiet = data.only(untouched_rows(data))
    signals = quiet.features().astype(np.float64)
    own = signals.copy()
    for number in np.unique(quiet.set_number):
        own[quiet.set_number == number] -= own[quiet.set_number == number].mean(axis=0)
    full = np.inf if data.full_scale_counts is None else data.full_scale_counts
    off = quiet.counts[:, -1].mean(axis=0, dtype=np.float64)
    return Untouched(
        mean_counts=signals.mean(axis=0),
        spread_counts=own.std(axis=0),
        clip_counts=np.tile(full - off, len(data.emitter_names)),
    )


def gain_parts(emitters: int, pairs: int) -> FloatArray:
    """Matrix (pair, emitters + receivers): 1 where a component belongs to a pair; pairs are E1-R1, E1-R2, ..."""
    receivers = pairs // emitters
    emitter, receiver = np.divmod(np.arange(pairs), receivers)
    return np.concatenate([np.eye(emitters)[emitter], np.eye(receivers)[receiver]], axis=1)


def fitted_gains(untouched: Untouched, flux: FloatArray, emitters: int) -> FloatArray:
    """Gains (pair,) in counts per flux, each the product of an emitter's and a receiver's gain.

    They are fitted by least squares of the logarithms, over bright pairs that do not clip. A component that is in none
    of these pairs gets the mean gain.

    Raises
    ------
    InputError : all bright pairs clip.
    """
    counts = untouched.mean_counts
    good = ~untouched.is_clipped & (counts > BRIGHT * np.median(counts)) & (flux > BRIGHT * np.median(flux))
    if not good.any():
        raise InputError("data: no pair reads light without clipping while untouched; check gains and wiring")
    parts = gain_parts(emitters, len(flux))
    level = np.log(counts[good] / flux[good])
    ridge = 1e-4 * np.eye(parts.shape[1])
    normal = parts[good].T @ parts[good] + ridge
    gains = np.linalg.solve(normal, parts[good].T @ (level - level.mean()))
    return np.asarray(np.exp(level.mean() + parts @ gains))


def chain_noise(design: SensorDesign, emitters: int, pairs: int) -> ReadingNoise:
    """Noise of a frame from the design's signal chain, without ambient light; its `clip_counts` are infinite."""
    noise = design.noise
    rounding = 1.0 / 12.0 if noise.quantised else 0.0
    floor = np.sqrt(2.0 * (rounding + noise.read_noise_counts**2))
    return ReadingNoise(
        floor_counts=np.full(pairs, max(floor, 1e-3)),
        shot=noise.shot_variance_per_count or 0.0,
        relative=0.0,
        emitter_drift=float(np.hypot(noise.led_fluctuation, noise.gain_drift)),
        receiver_drift=noise.gain_drift,
        emitters=emitters,
        clip_counts=np.full(pairs, np.inf),
    )


def mapped(
    design: SensorDesign,
    *,
    quick: bool = False,
    accuracy: str = "draft",
    seed: int = 0,
    on_step: OnStep | None = None,
) -> SignalMap:
    """Trace the map of a design, and measure its error at locations and depths between the grid's nodes.

    Parameters
    ----------
    quick : whether to trace a coarser grid, in a third of the time (docs/validation/calibration.md has the errors of
        both grids)
    seed : seed of the data with which the model will be compared; the map's light uses a different one
    """
    found = traced_map(
        design,
        pitch_mm=QUICK_PITCH_MM if quick else PITCH_MM,
        depth_nodes=QUICK_DEPTH_NODES if quick else DEPTH_NODES,
        accuracy=accuracy,
        seed=seed + MAP_SEED,
        on_step=on_step,
    )
    error = measured_error(design, found, accuracy=accuracy, on_step=on_step)
    return replace(found, error=error.of_ratio(found.untouched), checked=error)


def signal_map_learner(
    design: SensorDesign, *, quick: bool = False, seed: int = 0, touches: int = 1
) -> Learner:
    """Make the "signal-map" learner of a design; its map is traced at the first fit and reused.

    Parameters
    ----------
    quick, seed : see `mapped`
    touches : number of touches at once that the model knows, 1 or 2
    """
    traced: list[SignalMap] = []

    def fit(
        train: PressData,
        *,
        seed: int = seed,
        on_step: OnStep = lambda _stage, _share: None,
        settings: FitSettings = DEFAULT,  # noqa: ARG001  no setting concerns a map
    ) -> SignalMapModel:
        if not traced:
            traced.append(mapped(design, quick=quick, seed=map_seed, on_step=on_step))
        header = map_header(design, train, traced[0], seed)
        model = fit_signal_map(design, traced[0], header, train, seed=seed, on_step=on_step)
        if touches == 1:
            return model
        # of the map's seed, so that the light of pairs of touches is traced once for all fits
        return fit_together(Draft.of(design), model, traced[0], seed=map_seed, on_step=on_step)

    map_seed = seed
    return fit


def map_header(design: SensorDesign, data: PressData, found: SignalMap, seed: int) -> ModelHeader:
    """Header of a model that uses a traced map.

    The digest of the design and the names of emitters and receivers come from the data, the settings from the map. The
    force curve is for a press in the middle of the design's pad.
    """
    deepest = design.operating.max_depth_mm
    press = solved_press(contact_of(design), max_depth_mm=deepest)
    curve = force_curve(press, np.linspace(0.0, deepest, FORCE_DEPTHS))
    return ModelHeader(
        kind=KIND,
        design_digest=data.design_digest,
        emitter_names=data.emitter_names,
        receiver_names=data.receiver_names,
        untouched_counts=np.zeros(len(data.emitter_names) * len(data.receiver_names)),
        trained_on={
            "is_simulated": data.true_press_mm is not None,
            "sets": [one.name for one in data.sets],
            "samples": len(data),
            "map_of_design": found.digest,
        },
        settings={
            "pitch_mm": float(found.x_mm[1] - found.x_mm[0]),
            "depths": len(found.root_depth),
            "accuracy": found.accuracy,
            "map_seed": found.seed,
            "seed": seed,
            "sigma_of": SIGMA_OF_TIP,
        },
        created_with={name: version(name) for name in ("optopad", "numpy")} | {"python": python_version()},
        force_curve=ForceCurve(
            depth_mm=tuple(float(one) for one in curve.depth_mm),
            force_n=tuple(float(one) for one in curve.force_n),
        ),
    )


def fit_signal_map(
    design: SensorDesign,
    found: SignalMap,
    header: ModelHeader,
    data: PressData,
    *,
    seed: int = 0,
    on_step: OnStep | None = None,
) -> SignalMapModel:
    """Make a model from a map and a sensor's readings.

    Parameters
    ----------
    found : signal map of the design, before or after calibration
    header : header for the model; its kind and untouched counts are replaced
    data : readings, which must include untouched frames; touched frames improve the untouched signals of pairs that
        clip
    seed : random seed for the choice of untouched frames used for the threshold

    Raises
    ------
    InputError : there are too few untouched frames, or all bright pairs clip.
    """
    untouched = untouched_of(data)
    emitters, spline = len(data.emitter_names), found.ratio_root
    gains = fitted_gains(untouched, found.untouched, emitters)
    full = np.where(
        untouched.is_clipped,
        np.maximum(gains * found.untouched, untouched.clip_counts),
        np.maximum(untouched.mean_counts, 1e-3 * gains * np.median(found.untouched)),
    )
    model = SignalMapModel(
        header=replace(header, kind=KIND, untouched_counts=untouched.mean_counts),
        ratio_root=spline,
        full_counts=full,
        noise=_sensor_noise(
            chain_noise(design, emitters, len(full)),
            design.noise.led_fluctuation,
            untouched,
            full,
            found.error,
        ),
        box=_box(found),
        threshold=0.0,
    )
    model = replace(model, full_counts=_moved_by_touches(model, untouched, data, seed))
    own = _sensor_noise(
        chain_noise(design, emitters, len(full)), design.noise.led_fluctuation, untouched, full, None
    )
    model = replace(model, sigma=_trust(model, found, own, seed))
    return replace(model, threshold=_threshold(model, data, seed, on_step))


def _trust(model: SignalMapModel, found: SignalMap, noise: ReadingNoise, seed: int) -> SigmaTable:
    """Factors by depth from raw deviations to errors, from the map's test presses with the sensor's noise added."""
    if found.checked is None:
        return UNIT_SIGMA
    located = found.checked.press_mm[:, 2] >= LOCATED_MM
    press_mm = np.tile(found.checked.press_mm[located], (CHECK_FRAMES, 1))
    flux = np.tile(found.checked.truth[located].reshape(int(located.sum()), -1), (CHECK_FRAMES, 1))
    mean = flux / found.untouched * model.full_counts
    told = model.found(noise.frames(mean, np.random.default_rng(seed)))
    raw_mm = np.sqrt(np.einsum("nii->ni", told.covariance))
    # x and y are equivalent: each sample counts for both
    told_mm, spread_mm, true_mm = (
        np.concatenate([one, one[:, [1, 0, 2]]]) for one in (told.press_mm, raw_mm, press_mm)
    )
    return sigma_table(told_mm, spread_mm, true_mm, TRUST_BINS)


def _box(found: SignalMap) -> Box:
    space = found.workspace
    return Box(
        low=np.array([space.x0_mm, space.y0_mm, 0.0]),
        high=np.array([space.x1_mm, space.y1_mm, found.root_depth[-1] ** 2]),
    )


def _sensor_noise(
    chain: ReadingNoise, fluctuation: float, untouched: Untouched, full: FloatArray, error: FloatArray | None
) -> ReadingNoise:
    """Noise of the signal chain, or of the untouched frames where that is larger, plus the map's own error."""
    seen = np.where(
        untouched.is_clipped, 0.0, untouched.spread_counts**2 - (fluctuation * full) ** 2 - chain.shot * full
    )
    map_error = np.zeros(len(full)) if error is None else error * full
    floor = np.sqrt(np.maximum(chain.floor_counts**2, seen) + map_error**2)
    return replace(chain, floor_counts=floor, clip_counts=untouched.clip_counts)


def _moved_by_touches(model: SignalMapModel, untouched: Untouched, data: PressData, seed: int) -> FloatArray:
    """Untouched signals (pair,) as they would be without clipping; for clipped pairs, estimated from touched frames.

    The estimate is the median of the reading divided by the simulated ratio, over touched frames that do not clip.
    """
    touched = np.flatnonzero(data.press_mm[:, 2] > 0.3)
    full = model.full_counts.copy()
    if not untouched.is_clipped.any() or not len(touched):
        return full
    if len(touched) > MOST_FOR_CLIPPED:
        touched = np.sort(np.random.default_rng(seed).choice(touched, MOST_FOR_CLIPPED, replace=False))
    signals = data.only(touched).features().astype(np.float64)
    ratio = model.ratio_root.values(data.press_mm[touched]) ** 2
    for pair in np.flatnonzero(untouched.is_clipped):
        reads = (signals[:, pair] < 0.97 * untouched.clip_counts[pair]) & (ratio[:, pair] > 0.1)
        if reads.sum() >= FEWEST_UNTOUCHED:
            moved = np.median(signals[reads, pair] / ratio[reads, pair])
            full[pair] = max(float(moved), float(untouched.clip_counts[pair]))
    return full


def _threshold(model: SignalMapModel, data: PressData, seed: int, on_step: OnStep | None) -> float:
    """Score that only `FALSE_ALARMS` of the untouched frames exceed in the worst set.

    Each set is compared with the untouched signals of the other sets, if there are any.
    """
    quiet = data.only(untouched_rows(data))
    numbers = [
        one for one in np.unique(quiet.set_number) if (quiet.set_number == one).sum() >= FEWEST_UNTOUCHED
    ]
    most = MOST_FOR_THRESHOLD // max(len(numbers), 1)
    highest = LEAST_THRESHOLD
    for number in numbers or [None]:
        own = np.ones(len(quiet), dtype=bool) if number is None else quiet.set_number == number
        others = model if own.all() else _without(model, quiet, own)
        rows = np.flatnonzero(own)
        if len(rows) > most:
            rows = np.sort(np.random.default_rng(seed).choice(rows, most, replace=False))
        score = others.predict(quiet.only(rows).features().astype(np.float64)).touch_score
        highest = max(highest, float(np.quantile(score, 1.0 - FALSE_ALARMS)))
    if on_step is not None:
        on_step("fit", 1.0)
    return highest


def _without(model: SignalMapModel, quiet: PressData, own: BoolArray) -> SignalMapModel:
    """The model with its untouched signals rescaled to the frames outside `own`, except for pairs at full scale."""
    signals = quiet.features().astype(np.float64)
    whole, rest = signals.mean(axis=0), signals[~own].mean(axis=0)
    is_clipped = whole >= CLIP_SHARE * model.noise.clip_counts
    change = np.where(is_clipped, 1.0, rest / np.maximum(whole, 1.0))
    return replace(model, full_counts=model.full_counts * np.maximum(change, 0.5))
