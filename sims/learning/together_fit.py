"""Fit a signal map to two touches: the error of map and product, and when a frame has two.

Random pairs of presses are traced (`optopad.sims.touches.changes_together`), and single ones with another seed than the
map's, so that the map's own error is in them. The three numbers of the error (`inference.together`) are least squares
of the squared differences. The threshold of the second touch is that which `FALSE_SECONDS` of noisy frames of the
single presses exceed, and the factors of the deviations come from noisy frames of the pairs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.progress import OnStep
from optopad.sims.contact.held.tips import deepest_mm, require_apart
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.inference.signal_map import ReadingNoise, SignalMapModel
from optopad.sims.learning.inference.together import Together
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA, SigmaTable
from optopad.sims.learning.inference.two_touches import search_of
from optopad.sims.learning.touch_fit import sigma_table
from optopad.sims.learning.traced_map import SignalMap, measured_error
from optopad.sims.touches import changes_together

POOLS, PAIRS = (60, 240, 960), 120
"""Single presses, more if few pairs of them have room, and pairs that are traced."""
SHALLOWEST = 0.15
"""Least root of a press's depth over the deepest one's [-]."""
SINGLES, FRAMES = 400, 4
"""Single touches for the threshold, and noisy frames of each press."""
FALSE_SECONDS = 0.002
"""Share of simulated single touches that may count as two [-]."""
LEAST_SECOND = 7.0
"""Least threshold of the second score: half of χ² with 3 degrees of freedom exceeds it in 3 cases of 1,000."""
SEED = 32_452_843
"""Number added to the seed for presses and light."""
PAIR_FRAMES, TRUST_BINS = 8, 4
"""Noisy frames of each pair, and bins of depth, for the factors of the deviations."""


def fit_together(
    draft: Draft, model: SignalMapModel, known: SignalMap, *, seed: int = 0, on_step: OnStep | None = None
) -> SignalMapModel:
    """Make a signal map know two touches.

    Parameters
    ----------
    model : the model of single touches of this design
    known : the map of its light
    on_step : called with ``two touches`` and the share done

    Raises
    ------
    ModelScopeError : the models do not cover two touches on this pad.
    """
    tell = on_step or (lambda _stage, _share: None)
    rng = np.random.default_rng(seed + SEED)
    presses = drawn_pairs(draft, rng)
    (change,) = changes_together(
        draft,
        presses,
        seeds=(seed + SEED,),
        on_step=lambda done, total: tell("two touches", 0.6 * done / total),
    )
    checked = measured_error(
        draft.design,
        known,
        presses=SINGLES,
        on_step=lambda _stage, share: tell("two touches", 0.6 + 0.2 * share),
    )
    pair = known.ratio_root.values(presses.reshape(-1, 3)).reshape(len(presses), 2, -1) ** 2
    single, mapped = (one.reshape(SINGLES, -1) / known.untouched for one in (checked.truth, checked.found))
    noise = _without_map(model.noise, known, model.full_counts)
    bright = known.is_bright
    together = Together(
        radius_mm=draft.design.indenter.tip_radius_mm,
        errors=_errors(single[:, bright], mapped[:, bright], pair[..., bright], change[:, bright]),
        floor_counts=noise.floor_counts,
        threshold=0.0,
        sigma=UNIT_SIGMA,
    )
    search = search_of(replace(model, together=together))
    scores = []
    for number in range(FRAMES):
        scores.append(search.touches(noise.frames(single * model.full_counts, rng)).second_score)
        tell("two touches", 0.8 + 0.15 * number / FRAMES)
    highest = float(np.quantile(np.concatenate(scores), 1.0 - FALSE_SECONDS))
    together = replace(together, threshold=max(LEAST_SECOND, highest))
    truth = np.maximum(pair.prod(axis=1) + change, 0.0)
    sigma = _sigma(replace(model, together=together), presses, truth, noise, rng)
    tell("two touches", 1.0)
    return replace(model, together=replace(together, sigma=sigma))


def drawn_pairs(draft: Draft, rng: np.random.Generator) -> FloatArray:
    """Random pairs (n, 2, 3) of presses of a pool that do not overlap; near ones are drawn more often.

    Raises
    ------
    ModelScopeError : no two tips have room in the workspace.
    """
    contact, most = contact_of(draft.design), draft.design.operating.max_depth_mm
    for pool in POOLS:
        places = draft.workspace.spread(rng.uniform(size=(pool, 2)))
        deepest = np.array([min(deepest_mm(contact, (x, y)), most) for x, y in places.tolist()])
        single = np.column_stack([places, deepest * rng.uniform(SHALLOWEST, 1.0, pool) ** 2])
        first, second = np.triu_indices(pool, 1)
        fits = np.array(
            [_fits(draft, single[[i, j]]) for i, j in zip(first.tolist(), second.tolist(), strict=True)]
        )
        first, second = first[fits], second[fits]
        if len(first) >= PAIRS:
            break
    if not len(first):
        raise ModelScopeError(
            "touches: the workspace has no room for two tips; take a smaller tip, or lower "
            "operating.workspace_margin_mm"
        )
    near = np.hypot(*(single[first, :2] - single[second, :2]).T) ** -2.0
    chosen = rng.choice(len(first), min(PAIRS, len(first)), replace=False, p=near / near.sum())
    return np.stack([single[first[chosen]], single[second[chosen]]], axis=1)


def _fits(draft: Draft, tips_mm: FloatArray) -> bool:
    try:
        require_apart(draft, tips_mm)
    except ModelScopeError:
        return False
    return True


def _errors(single: FloatArray, mapped: FloatArray, pair: FloatArray, change: FloatArray) -> FloatArray:
    """e₀, e₁ and e₂ by least squares of squared differences.

    Parameters
    ----------
    single, mapped : (n, pair) ratios of single presses, and the map's for them
    pair, change : (m, 2, pair) the map's ratios of two touches, and (m, pair) what their light has beyond the product
    """
    off, size = ((single - mapped) ** 2).ravel(), ((1.0 - single) ** 2).ravel()
    (first, second), _ = nnls(np.stack([np.ones_like(size), size], axis=1), off)
    both = np.abs((1.0 - pair).prod(axis=1)).ravel()
    third = float(both @ change.ravel() ** 2 / (both @ both))
    return np.asarray(np.sqrt([first, second, third]))


def _without_map(noise: ReadingNoise, known: SignalMap, full: FloatArray) -> ReadingNoise:
    """The noise of the readings alone, without the map's own error."""
    error = np.zeros(len(full)) if known.error is None else known.error * full
    return replace(noise, floor_counts=np.sqrt(np.maximum(noise.floor_counts**2 - error**2, 1e-6)))


def _sigma(
    model: SignalMapModel,
    presses: FloatArray,
    ratio: FloatArray,
    noise: ReadingNoise,
    rng: np.random.Generator,
) -> SigmaTable:
    """Factors by depth from raw deviations to errors, on simulated frames of two touches."""
    told, raw, true = [], [], []
    for _ in range(PAIR_FRAMES):
        found = search_of(model).touches(noise.frames(ratio * model.full_counts, rng))
        is_two = found.count == 2
        press, sigma = found.press_mm[is_two], found.sigma_mm[is_two]
        matched = matched_to(presses[is_two], press)
        told.append(press.reshape(-1, 3))
        raw.append(sigma.reshape(-1, 3))
        true.append(matched.reshape(-1, 3))
    if sum(map(len, told)) < TRUST_BINS:
        return UNIT_SIGMA
    # x and y are equivalent: each sample counts for both
    of_told, of_raw, of_true = (
        np.concatenate([one, one[:, [1, 0, 2]]]) for one in map(np.concatenate, (told, raw, true))
    )
    return sigma_table(of_told, of_raw, of_true, TRUST_BINS)


def matched_to(true: FloatArray, found: FloatArray) -> FloatArray:
    """True touches (n, 2, 3) in the order in which they are nearest to the found ones, by the sum of distances."""
    other = true[:, ::-1]
    straight, crossed = (
        np.linalg.norm(one[..., :2] - found[..., :2], axis=2).sum(axis=1) for one in (true, other)
    )
    return np.where((crossed < straight)[:, None, None], other, true)
