"""The light of a design under presses, by name: lowers the design, calls the engine, names the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from design.errors import InputError, ModelScopeError
from design.spec import SensorDesign
from sims.contact.indentation import indent
from sims.indentation import Indentation
from sims.optics.engine import CLASS_NAMES, Accuracy, trace_scene
from sims.optics.light_signals import LightSignals
from sims.optics.lower import scene_of

FloatArray = NDArray[np.float64]
Profile = Indentation | Sequence[Indentation | None] | None


def trace(
    design: SensorDesign,
    presses: ArrayLike,
    profile: Profile = None,
    accuracy: str | Accuracy = "standard",
    seed: int = 0,
    pairs: NDArray[np.bool_] | None = None,
    on_step: Callable[[float], None] | None = None,
) -> LightSignals:
    """Flux from every emitter to every receiver under every press.

    Parameters
    ----------
    presses : (state, 3) rows of x, y, depth [mm], depth 0 or less untouched; or (state, tip, 3) with
        NaN rows for absent tips, at most one tip a state touching
    profile : None for the contact model, one surface for all touched states, or one a state
    accuracy : draft, standard, fine, or the engine's settings
    seed : of the random offsets; same seed, same bits
    pairs : (emitter, receiver) or (state, emitter, receiver) mask of pairs to trace; others are 0
    on_step : called with the share of states done

    Raises
    ------
    InputError : presses of another shape, not finite, or outside the cavity.
    ModelScopeError : several tips at once, or deeper than the contact model covers.
    """
    states = _single_presses(presses)
    surfaces = _surfaces(design, states, profile)
    raw = trace_scene(
        scene_of(design),
        states[:, :2],
        surfaces,
        accuracy=accuracy,
        seed=seed,
        pairs=pairs,
        on_step=None if on_step is None else lambda done, total: on_step(done / total),
    )
    return LightSignals(
        flux=raw.flux.sum(axis=0),
        by_class=dict(zip(CLASS_NAMES, raw.flux, strict=True)),
        standard_error=raw.standard_error,
        presses=states,
        digest=design.digest,
        seed=seed,
    )


def _single_presses(presses: ArrayLike) -> FloatArray:
    """(state, 3) presses from either form."""
    given = np.asarray(presses, dtype=np.float64)
    if given.ndim == 2 and given.shape[1] == 3:
        states = given
    elif given.ndim == 3 and given.shape[2] == 3 and given.shape[1] > 0:
        states = np.array([_only_tip(number, tips) for number, tips in enumerate(given)]).reshape(-1, 3)
    else:
        raise InputError(f"presses: shape {given.shape}; needs (state, 3) or (state, tip, 3) of x, y, depth")
    if not np.isfinite(states).all():
        raise InputError("presses: a coordinate is not a finite number; NaN is for absent tips only")
    return states


def _only_tip(number: int, tips: FloatArray) -> FloatArray:
    present = tips[~np.isnan(tips).any(axis=1)]
    touching = present[present[:, 2] > 0]
    if len(touching) > 1:
        raise ModelScopeError(
            f"presses: state {number} has {len(touching)} touching tips; this light model covers one at a time"
        )
    if len(touching):
        return np.asarray(touching[0])
    return np.asarray(present[0]) if len(present) else np.zeros(3)


def _surfaces(design: SensorDesign, states: FloatArray, profile: Profile) -> list[Indentation | None]:
    touched = states[:, 2] > 0
    if profile is None:
        solved = {depth: indent(design, float(depth)) for depth in np.unique(states[touched, 2])}
        return [solved[press[2]] if down else None for press, down in zip(states, touched, strict=True)]
    if isinstance(profile, Indentation):
        return [profile if down else None for down in touched]
    if len(profile) != len(states):
        raise InputError(
            f"profile: {len(profile)} surfaces for {len(states)} presses; give one, or one a press"
        )
    return [surface if down else None for surface, down in zip(profile, touched, strict=True)]
