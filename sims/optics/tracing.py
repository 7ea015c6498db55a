"""Light of a design under presses: objects in, named signals out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError, ModelScopeError
from design.spec import SensorDesign
from sims.indentation import Indentation
from sims.optics.engine import CLASS_NAMES, Accuracy, trace_scene
from sims.optics.light_signals import LightSignals
from sims.optics.lower import scene_of
from sims.optics.scene import OpticalScene

FloatArray = NDArray[np.float64]
Profile = Indentation | Sequence[Indentation | None]


def trace(
    design: SensorDesign,
    presses: FloatArray,
    profile: Profile | None = None,
    accuracy: str | Accuracy = "standard",
    seed: int = 0,
    pairs: NDArray[np.bool_] | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> LightSignals:
    """Trace a design's pad for a list of presses.

    Parameters
    ----------
    design : the sensor
    presses : (state, 3) rows of x, y, depth, or (state, tip, 3) with NaN rows for absent tips; depth 0 or
        less is untouched [mm]
    profile : None for the contact model, one indentation for all touched states, or one per state
    accuracy : draft, standard, fine, or settings
    seed : of all offsets; same seed, same bits
    pairs : (emitter, receiver) or (state, emitter, receiver) mask of pairs to trace; others are 0
    on_step : called with (states done, states)

    Raises
    ------
    InputError : presses of a wrong shape or outside the block; a bad profile.
    ModelScopeError : more than one tip in a state; a press that contact or surface model does not cover.
    """
    rows = _single_tips(presses)
    indentations = _indentations(design, rows, profile)
    scene = scene_of(design)
    _refuse_what_no_kernel_follows(scene)
    raw = trace_scene(
        scene,
        rows[:, :2],
        indentations,
        accuracy=accuracy,
        seed=seed,
        pairs=pairs,
        on_step=on_step,
    )
    return LightSignals(
        flux=raw.flux.sum(axis=0),
        by_class={name: raw.flux[k] for k, name in enumerate(CLASS_NAMES)},
        standard_error=raw.standard_error,
        presses=rows,
        digest=design.digest,
        seed=seed,
    )


def _refuse_what_no_kernel_follows(scene: OpticalScene) -> None:
    """Refuse options of a scene that the kernels would silently leave out."""
    for name in ("emitter_pattern", "receiver_response", "wall_index"):
        if getattr(scene, name) is not None:
            raise ModelScopeError(f"{name}: this option of the design is not traced; leave it out")


def _single_tips(presses: FloatArray) -> FloatArray:
    """(state, 3) presses with one tip a state."""
    rows = np.asarray(presses, dtype=np.float64)
    if rows.ndim not in (2, 3) or rows.shape[-1] != 3:
        raise InputError(f"presses: shape {rows.shape}, needs (state, 3) or (state, tip, 3) of x, y, depth")
    if rows.ndim == 3:
        rows = np.array([_only_tip(state, tips) for state, tips in enumerate(rows)]).reshape(-1, 3)
    touched = ~(rows[:, 2] <= 0)
    if not np.isfinite(rows[touched]).all():
        raise InputError(
            f"presses: state {int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])} is not finite"
        )
    return rows


def _only_tip(state: int, tips: FloatArray) -> FloatArray:
    active = tips[tips[:, 2] > 0]
    if len(active) > 1:
        raise ModelScopeError(
            f"presses: state {state} has {len(active)} tips; the light model covers one tip, split the state"
        )
    return active[0] if len(active) else np.zeros(3)


def _indentations(
    design: SensorDesign, rows: FloatArray, profile: Profile | None
) -> list[Indentation | None]:
    if isinstance(profile, Indentation):
        return [profile if depth > 0 else None for depth in rows[:, 2]]
    if profile is not None:
        if len(profile) != len(rows):
            raise InputError(
                f"profile: {len(profile)} indentations for {len(rows)} states; give one per state"
            )
        return [given if depth > 0 else None for given, depth in zip(profile, rows[:, 2], strict=True)]
    from sims.contact import indent

    solved: dict[float, Indentation] = {}
    for depth in rows[:, 2]:
        if depth > 0 and depth not in solved:
            solved[float(depth)] = indent(design, float(depth))
    return [solved.get(float(depth)) for depth in rows[:, 2]]
