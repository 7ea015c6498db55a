"""The light of a pad under two touches at once.

    ratio(A, B) = ratio(A) ratio(B) + g(A, B) - g(A) g(B),      pair by pair, light over untouched light

The ratios of single touches are those of a signal map, or traced one by one. g is the light of the method for grids,
on the tops of both tips together and of each alone (`optopad.sims.contact.held.tips`), with the same random offsets
and, on flat pads, on one grid, so that most of its errors cancel. What g adds to the product is how much light both
touches change together: rays that meet both, and the motion of the top under one tip by the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.sims.contact.held.tips import MOST_TIPS
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.tracing import trace


def changes_together(
    draft: Draft,
    presses_mm: FloatArray,
    *,
    seeds: Sequence[int] = (0,),
    accuracy: str | Accuracy = "score",
    on_step: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """What the light of two touches (n, 2, 3) has in addition to the product of both, over untouched light.

    Returns
    -------
    (seed, n, pair), from one trace for each seed

    Raises
    ------
    ModelScopeError : tips overlap or are no hemispheres, or the contact model does not cover a press.
    """
    single, number = np.unique(presses_mm.reshape(-1, 3), axis=0, return_inverse=True)
    alone = np.pad(single[:, None], ((0, 0), (0, MOST_TIPS - 1), (0, 0)))
    states = np.concatenate([alone, presses_mm])
    light = _grid_light(draft, states, seeds=seeds, accuracy=accuracy, on_step=on_step)
    alone = light[:, : len(single)][:, np.reshape(number, (-1, MOST_TIPS))]
    return np.asarray(light[:, len(single) :] - alone.prod(axis=2))


def _grid_light(
    draft: Draft,
    tips_mm: FloatArray,
    *,
    seeds: Sequence[int],
    accuracy: str | Accuracy,
    on_step: Callable[[int, int], None] | None,
) -> FloatArray:
    """Light over untouched light (seed, state, pair) of tips (state, tip, 3), on grids; 0 without light."""
    each = []
    for number, seed in enumerate(seeds):

        def tell(done: int, states: int, number: int = number) -> None:
            if on_step is not None:
                on_step((number * states + done) // len(seeds), states)

        states = np.concatenate([np.zeros((1, MOST_TIPS, 3)), tips_mm])
        flux = trace(draft, states, accuracy=accuracy, seed=seed, on_step=tell).flux
        each.append((flux[1:] / np.where(flux[0] > 0.0, flux[0], np.inf)).reshape(len(tips_mm), -1))
    return np.stack(each)
