"""The light of a pad under two touches at once.

    ratio(A, B) = ratio(A) ratio(B) + g(A, B) - g(A) g(B),      pair by pair, light over untouched light

The ratios of single touches are those of the signal map, whose light is that of the verdict. g is the light of the
method for grids, on the tops of both tips together and of each alone (`optopad.sims.contact.held.tips`), all on one
grid with the same random offsets, so that most of its errors cancel. What g adds to the product is how much light both
touches change together: rays that meet both, and the motion of the top under one tip by the other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.sims.contact.held.tips import MOST_TIPS, TipsPress, pressed_tips, require_apart
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import light_of_tops, require_traced
from optopad.sims.learning.traced_map import SignalMap
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.threads import run_each

WINDOW = 32
"""States whose tops are held in memory together; each has 2 to 9 MB."""


def touch_ratios(
    draft: Draft,
    known: SignalMap,
    presses_mm: FloatArray,
    *,
    seed: int = 0,
    accuracy: str | Accuracy = "score",
    on_step: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """Light over untouched light (n, pair) under one or two touches [-].

    Parameters
    ----------
    known : map of the light of single touches
    presses_mm : (n, 2, 3) x, y, depth of both touches [mm]; one with a depth of 0 or less, or NaN, is absent
    seed, accuracy : settings of the light model
    on_step : called with (states done, states)

    Raises
    ------
    InputError : the shape is wrong.
    ModelScopeError : tips overlap or are no hemispheres, or the contact model does not cover a press.
    """
    presses = np.asarray(presses_mm, dtype=np.float64)
    if presses.ndim != 3 or presses.shape[1:] != (MOST_TIPS, 3):
        raise InputError(f"presses_mm: shape {presses.shape}, needs (n, {MOST_TIPS}, 3) of x, y, depth")
    is_touching = presses[:, :, 2] > 0.0
    single = known.ratio_root.values(np.where(is_touching[..., None], presses, 0.0).reshape(-1, 3)) ** 2
    single = np.where(is_touching[..., None], single.reshape(*is_touching.shape, -1), 1.0)
    found = single.prod(axis=1)
    both = np.flatnonzero(is_touching.all(axis=1))
    if len(both):
        found[both] += changes_together(draft, presses[both], seed=seed, accuracy=accuracy, on_step=on_step)
    return np.asarray(np.maximum(found, 0.0))


def changes_together(
    draft: Draft,
    presses_mm: FloatArray,
    *,
    seed: int = 0,
    accuracy: str | Accuracy = "score",
    on_step: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """What the light of two touches (n, 2, 3) has in addition to the product of both (n, pair), over untouched light.

    Errors are those of `touch_ratios`.
    """
    contact, parts = contact_of(draft.design), []
    require_traced(draft)
    for tips in presses_mm:
        require_apart(draft, tips)
    for start in range(0, len(presses_mm), WINDOW):
        few = presses_mm[start : start + WINDOW]
        solved: list[TipsPress | None] = [None] * len(few)

        def solve(number: int, few: FloatArray = few, solved: list[TipsPress | None] = solved) -> None:
            solved[number] = pressed_tips(contact, few[number])

        def tell(done: int, total: int, start: int = start, count: int = len(few)) -> None:
            if on_step is not None:
                on_step(start + count * done // total, len(presses_mm))

        run_each(solve, len(few))
        tops = [top for one in solved if one is not None for top in (one.top, *one.tops_alone)]
        light: Any = light_of_tops(draft, tops, accuracy=accuracy, seed=seed, on_step=tell)
        whole = np.where(light.untouched > 0.0, light.untouched, np.inf)
        together, first, second = np.moveaxis((light.flux / whole).reshape(len(few), 3, -1), 1, 0)
        parts.append(together - first * second)
    return np.concatenate(parts)
